"""Which cells of a draw need no run, and what lies below its brackets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.config.layers import load_site
from pipeline.config.motion_schema import AxisPulseConfig
from pipeline.stages.mesh.products import Standing
from pipeline.stages.motions.motion_grid import Pulses, Shaking, ShapedPulses, TablePulses
from pipeline.stages.uncertainty import ensemble
from pipeline.stages.uncertainty.draw_runs import Search
from pipeline.stages.uncertainty.draws import Draw
from vsr_core.arrays import Array, Indices
from vsr_core.judge.proofs import barrier
from vsr_core.rock.solid import block
from vsr_core.run.cases import Settings
from vsr_core.validation.priors import Priors, best_guess

PGA, RATIO = (0.2, 0.39, 0.41, 0.6), (0.1, 0.4)


@pytest.mark.parametrize(
    ("motions", "drive", "still"),
    [
        (Pulses(RATIO, PGA), "table_frame", [1, 1, 0, 0]),
        (ShapedPulses(RATIO, PGA, "sine_pulse"), "table_frame", [1, 1, 0, 0]),
        (ShapedPulses(RATIO, PGA, "ricker_pulse"), "table_frame", [1, 1, 0, 0]),
        (Pulses(RATIO, PGA), "servo", [0, 0, 0, 0]),
        (TablePulses(RATIO, PGA, (AxisPulseConfig(axis="z"),)), "table_frame", [0, 0, 0, 0]),
    ],
)
def test_a_block_stands_below_its_width_over_height(
    motions: Shaking, drive: str, still: list[int]
) -> None:
    """A block of 1:2 moves from 0.5 g on, with a gain of 1.25 from 0.4 g on the grid."""
    config = load_site("cuboid_1x1x2", None, (f"drive={drive}",)).config
    rock = block((1.0, 1.0, 2.0), 2000.0)
    member = best_guess(Priors((0.0, 0.0), 0.0, friction=(0.7, 0.7), amplitude=(1.25, 0.0)))
    standing = Standing(rock, barrier(rock))
    draw = Draw(0, member, rock, config.scene, config.yaw, standing)
    nominal = np.zeros((len(config.yaw), len(RATIO), len(PGA)), np.int8)
    nothing: Any = None
    given = np.zeros((5, len(config.yaw)))
    edges, bounds = np.ones(nominal.shape[:2]), (1e-3, 4.0)
    wanted = Search(nothing, [draw], given, motions, Settings(1e-3), nominal, edges, 0.01, bounds)
    found = ensemble._proved(wanted, [draw])
    np.testing.assert_array_equal(found, np.broadcast_to(np.array(still, bool), found.shape))


class Islands:
    """Rocks that topple between two PGAs [g] below their brackets, of one draw each."""

    def __init__(self, *islands: tuple[float, float]) -> None:
        self.islands = np.array(islands)
        self.tried: list[float] = []

    def run(self, draw: Indices, yaw: Indices, row: Indices, pga: Array) -> NDArray[np.int8]:
        """Outcomes, the first without a verdict."""
        self.tried += pga.tolist()
        low, high = self.islands[draw].T
        return np.where(np.arange(len(pga)) == 0, -1, (pga > low) & (pga < high)).astype(np.int8)


def test_the_lowest_overturning_within_a_fifth_below_a_bracket_is_found() -> None:
    """An island as wide as a bracket is met; one farther away, or below the bounds, is not."""
    nothing: Any = None
    bounds = (0.09, 4.0)
    wanted = Search(
        nothing, [], np.zeros(0), nothing, nothing, np.zeros(0), np.zeros(0), 0.01, bounds
    )
    lower = np.array([0.4, 0.4, 0.1, np.nan])[:, None, None]
    runner: Any = Islands((0.35, 0.3536), (0.2, 0.3), (0.08, 0.085), (0.0, 9.0))
    unresolved = np.zeros(lower.shape, np.int64)
    found = ensemble._lowest(wanted, runner, lower, unresolved).ravel()
    assert 0.35 < found[0] < 0.3536
    assert np.isinf(found[1:]).all()
    assert min(runner.tried) >= bounds[0]
    assert unresolved.ravel().tolist() == [1, 0, 0, 0]
