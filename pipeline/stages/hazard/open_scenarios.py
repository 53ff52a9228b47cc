"""Earthquakes whose PGV/PGA no run is near, so that it is open whether they topple a rock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from pipeline.config.in_si import acceleration
from pipeline.config.layers import Origin
from pipeline.stages.hazard.open_runs import OFF, Open, in_words, off_all_runs, open_number, told
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
        If so much is that survival may be any.
    """
    found: list[str] = []
    each = list(zip(names, _open(rock, shaking, often), strict=True))
    groups = [[one for one in each if one[0] == name] for name in dict.fromkeys(names)]
    for group in [*groups, each]:
        number = sum(one.number for _, one in group)
        if group is each and found:  # some of which are told
            continue
        _, worst = max(group, key=lambda one: one[1].number)
        by = "all faults together" if group is each else group[0][0]
        said = f"{in_words(rock, 'the rock', number, worst)}, by {by}"
        line = f"{said}: each counts as of the nearest run"
        found += told(number, OFF, line, off_all_runs(origin, said))
    return tuple(found)


def open_magnitudes(rock: RockFragility, shaking: Shaking, magnitudes: Array) -> tuple[str, ...]:
    """Magnitudes whose least distances are open, in words.

    Parameters
    ----------
    shaking : of earthquakes at those distances
    magnitudes : ndarray, shape (n,), of each of them
    """
    found = _open(rock, shaking, [1.0] * len(magnitudes))
    open_ones = [at for at, one in enumerate(found) if one.number >= _TOLD]
    if not open_ones:
        return ()
    worst = max(open_ones, key=lambda at: found[at].number)
    low, high = magnitudes[open_ones].min(), magnitudes[open_ones].max()
    span = f"M {low:.1f}" if low == high else f"M {low:.1f} to {high:.1f}"
    given = in_words(rock, "the rock", found[worst].number, found[worst])
    given += f", by M {magnitudes[worst]:.1f}"
    return (f"least distances of {span} may be far off: {given}",)


def _open(rock: RockFragility, shaking: Shaking, often: Sequence[float]) -> list[Open]:
    """What is open of earthquakes of each kind, of so many on average."""
    found, static = [], acceleration(rock.static)
    for one, number in zip(shaking.parted(1), often, strict=True):
        least, last = np.exp(one.pga + _REACH * one.pga_sd * [[-1.0], [1.0]]).ravel()
        levels = np.geomspace(max(least, static), max(last, 1.01 * static), 200)
        exceeded = number * ndtr((one.pga - np.log(levels)) / one.pga_sd)
        medians, log_sds = ratios_given(one, levels)
        table = RatioTable(levels, medians[0], np.broadcast_to(log_sds, levels.shape))
        found.append(open_number(rock, table, levels, exceeded))
    return found


_TOLD = 0.1
"""Share of the earthquakes at a least distance that are open, from which on it is told."""

_REACH = 4.0
"""Standard deviations to each side of the median PGA that are looked at."""
