"""What a time step does to boundaries, told of outcomes whose boundaries are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from vsr_core.arrays import Array
from vsr_core.uncertainty.step_error import AROUND, SPACING, measured


def toppled_above(boundaries: Array) -> NDArray[np.int8]:
    """Outcomes around levels that topple from some ln PGA on, shape (..., runs)."""
    return (boundaries[..., None] <= AROUND).astype(np.int8)


def test_a_step_that_moves_all_boundaries_is_told_by_how_far() -> None:
    """Boundaries anywhere between two runs: in the mean more is known than the runs are apart."""
    rng = np.random.default_rng(3)
    own = rng.uniform(-0.02, 0.02, 2000)
    found = measured(toppled_above(own + np.array([[0.017], [-0.004], [0.0]])))
    np.testing.assert_allclose(found.shift, [0.017, -0.004], atol=4 * found.unsure.max())
    assert found.unsure.max() < 1e-4
    assert found.levels == 2000
    assert 0.017 <= found.kept[0] <= 0.017 + SPACING
    assert found.islands.tolist() == [0.0, 0.0]


def test_the_error_of_one_boundary_is_kept_by_four_in_five() -> None:
    apart = np.repeat([0.0, 4.0, 5.0], [12, 4, 4]) * SPACING
    found = measured(toppled_above(np.stack([apart, np.zeros(20)]) + 1e-9))
    assert found.kept[0] == pytest.approx(4 * SPACING)
    assert found.shift[0] == pytest.approx(1.8 * SPACING)


def test_islands_are_as_wide_as_outcomes_change_to_and_fro() -> None:
    """A level that stands once more, 3 runs above its first overturning, beside two that do not."""
    plain = toppled_above(np.zeros(3) + 1e-9)
    ragged = plain.copy()
    at = int(np.flatnonzero(plain[0])[0])
    ragged[0, at + 3] = 0
    found = measured(np.stack([ragged, plain]))
    assert found.islands[0] == pytest.approx(3 * SPACING / 3)
    assert found.shift[0] == pytest.approx(SPACING / 3)  # one run in three levels
    assert measured(np.stack([plain, ragged])).islands[0] == 0.0


def test_levels_with_an_unresolved_run_tell_nothing() -> None:
    side = toppled_above(np.array([[0.03] * 4, [0.0] * 4]))
    side[1, 0, 5] = -1
    assert measured(side).levels == 3
    side[0, 2, 0] = -1
    found = measured(side)
    assert found.levels == 2
    assert np.isnan([*found.shift, *found.kept, *found.islands]).all()
    assert found.coarsest(0.01) == 0
