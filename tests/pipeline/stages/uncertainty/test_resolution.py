"""How narrow the brackets of draws are: as asked for, on any grid, and not below the error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

SITE = """
rock: {shape: box, size: [0.25, 0.8, 1.0], density: 2000}
contact: {friction: 10}
motion: {pga: {start: 0.1, stop: 0.7, num: NUMBER}, pgv_pga: {start: 0.1, stop: 0.4, num: 3}}
yaw: 0
simulation: {engine: nonsmooth, time_step: 0.002}
uncertainty: {members: 8, friction: [10, 10], restitution: [0, 0], centre_of_mass: 0.01}
"""


@pytest.mark.slow
def test_a_finer_grid_moves_the_band_by_no_more_than_a_bracket(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path
) -> None:
    """Of 4 and of 13 PGAs, then again with its product gone: the same runs, and the same bytes."""
    found = []
    for number in (4, 13, 13):
        site = write_site(SITE.replace("NUMBER", str(number)))
        (derived / "rock" / "uncertainty.nc").unlink(missing_ok=True)
        ran = vsr("run", "uncertainty", "--site", site)
        assert ran.code in (0, 1), ran.err  # a run that is unresolved widens its own bracket only
        found.append(xr.load_dataset(derived / "rock" / "uncertainty.nc", mask_and_scale=False))
    coarse, fine, again = found
    for one in found:
        width = (one["member_boundary_upper"] / one["member_boundary_lower"]).values
        decided = one["member_unresolved"].values == 0
        assert decided.mean() > 0.8
        assert width[decided].max() <= 1.01
    assert float(fine["boundary_high"].max() / fine["boundary_low"].min()) > 1.1
    for name in ("low", "median", "high"):
        ratio = fine[f"boundary_{name}"] / coarse[f"boundary_{name}"]
        np.testing.assert_allclose(ratio.values, 1.0, atol=0.01)
    assert again.identical(fine)


@pytest.mark.slow
def test_a_bracket_finer_than_the_numerical_error_is_refused(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path
) -> None:
    site = write_site(SITE.replace("NUMBER", "4").replace(", time_step: 0.002", ""))
    ran = vsr("run", "uncertainty", "--site", site, "--set", "uncertainty.resolution=0.0001")
    assert ran.code == 2
    line = ran.err.strip().splitlines()[-1]
    for words in ("uncertainty.resolution: got 0.0001", "no narrower than", "or more"):
        assert words in line
    assert not list(derived.rglob("uncertainty.nc"))
