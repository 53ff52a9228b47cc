"""Earthquakes whose PGV/PGA no run is near, so that it is open whether they topple a rock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from pipeline.config.in_si import acceleration
from pipeline.config.layers import Origin
from pipeline.stages.hazard.open_ends import (
    LIKELY,
    OFF,
    levels_asked,
    off_all_runs,
    open_share,
    told,
)
from pipeline.stages.hazard.rock_fragility import RockFragility
from vsr_core.arrays import Array
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.scenarios import Shaking, ratios_given


def open_faults(
    rock: RockFragility,
    shaking: Shaking,
    names: Sequence[str],
    often: Sequence[float],
    origin: Origin,
) -> tuple[str, ...]:
    """Faults of whose shaking much is open, in words.

    Parameters
    ----------
    names : of faults, some of which may have several kinds of earthquakes
    often : how many of these came within the age, on average

    Raises
    ------
    InputError
        If most of it is.
    """
    found: list[str] = []
    for name, (share, given) in zip(names, _open(rock, shaking, often), strict=True):
        said = f"{given} by {name}"
        line = f"{said}: it counts as of the nearest of them"
        found += told(share, OFF, line, off_all_runs(origin, said))
    return tuple(found)


def open_magnitudes(rock: RockFragility, shaking: Shaking, magnitudes: Array) -> tuple[str, ...]:
    """Magnitudes whose least distances are open, in words.

    Parameters
    ----------
    shaking : of earthquakes at those distances
    magnitudes : ndarray, shape (n,), of each of them
    """
    found = _open(rock, shaking, [1.0] * len(magnitudes))
    open_ones = [at for at, (share, _) in enumerate(found) if share >= OFF[0]]
    if not open_ones:
        return ()
    worst = max(open_ones, key=lambda at: found[at][0])
    low, high = magnitudes[open_ones].min(), magnitudes[open_ones].max()
    span = f"M {low:.1f}" if low == high else f"M {low:.1f} to {high:.1f}"
    given = f"{found[worst][1]} by M {magnitudes[worst]:.1f}"
    return (f"least distances of {span} may be far off: {given}",)


def _open(rock: RockFragility, shaking: Shaking, often: Sequence[float]) -> list[tuple[float, str]]:
    """Share of each earthquake's shaking that is open at some PGA, and that in words."""
    found, toppling = [], levels_asked(rock)
    for one, number in zip(shaking.parted(1), often, strict=True):
        asked = np.append(np.exp(one.pga), toppling)
        exceeded = max(number, 1.0) * ndtr((one.pga - np.log(asked)) / one.pga_sd)
        medians, log_sds = ratios_given(one, asked)
        each = [
            open_share(rock, "the rock", RatioTable(asked[[at]], medians[0, [at]], log_sds), level)
            for at, level in enumerate(asked)
            if exceeded[at] >= LIKELY and level >= acceleration(rock.static)
        ]
        found.append(max(each, default=(0.0, "")))
    return found
