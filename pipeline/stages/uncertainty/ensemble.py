"""First overturning of all draws, bracketed, and what that says of the cells of the grid.

Each draw's boundary is searched from where those of the draws before it lie, by the rule of
``vsr_core.uncertainty.search``; of the cells that need no run, some are run all the same, to count
how often it is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.config import in_si
from pipeline.stages.motions.motion_grid import Pulses, TablePulses
from pipeline.stages.uncertainty.draw_runs import Runner, Search, Table
from pipeline.stages.uncertainty.draws import Draw
from pipeline.workflow.run_store import RunStore
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.fragility.bisection import first_changes, middles
from vsr_core.outcome import FoundBy
from vsr_core.run.cases import never_starts
from vsr_core.uncertainty import search

TOGETHER = 8
"""Draws that are searched at once, as many as the engine keeps rocks of; the first of them from the
boundary of the site as it is, the others from those of all draws before."""

CHECKED = 0.005
"""Share of the inferred cells that are run all the same."""

FOLLOWED, FEWEST_FOLLOWED = 0.01, 32
"""Share and least number of the levels that are followed below their bracket, to see whether it is
first: at all cells, and at PGAs each lower than the one before by the width of a bracket, down to
`REACH`."""

REACH = 0.25
"""How far below a bracket [ln g]."""


@dataclass(frozen=True, eq=False)
class Ensemble:
    """What was found of all draws.

    Attributes
    ----------
    overturned : ndarray of int, shape (draws, yaws, rows, pga), 1, 0, or -1 unresolved
    lower, upper : ndarray, shape (draws, yaws, rows) [g]
        Bracket of the first overturning, as ``vsr_core.fragility.boundary.Boundary`` has them.
    runs, unresolved : ndarray of int, shape (draws, yaws, rows), of the search, and all of those
        without a verdict
    non_monotonic : ndarray of bool, shape (rows,), those in which the site as it is may be ragged
    checked, wrong : ndarray of int, shape (2,)
        Inferred cells that were run all the same, and those that were wrong: of other rows, and of
        non-monotonic ones.
    followed, not_first : ndarray of int, shape (2,)
        Levels that were followed below their bracket, and those in which a run toppled.
    too_high : ndarray, shape (2,), ln of the bracket over the lowest PGA that toppled, all added up
    crashed : int, runs that killed their worker
    """

    overturned: Table
    found_by: Table
    lower: Array
    upper: Array
    runs: Indices
    unresolved: Indices
    non_monotonic: Mask
    checked: Indices
    wrong: Indices
    followed: Indices
    not_first: Indices
    too_high: Array
    crashed: int

    @property
    def boundary(self) -> Array:
        """First-overturning PGA: the geometric middles of the brackets, shape as theirs [g]."""
        return middles(self.lower, self.upper)

    @property
    def known(self) -> Array:
        """The same, but 0 of a draw that topples at the lowest PGA tried, as it is not known."""
        open_below = np.isnan(self.lower) & np.isfinite(self.upper)
        return np.where(open_below, 0.0, self.boundary)


def outcomes(wanted: Search) -> Ensemble:
    """Bracket the first overturning of all draws, some draws after the others."""
    known = [wanted.ln(wanted.boundary)]
    scales, errors = [wanted.given], Errors()
    log_gain = np.log([draw.member.amplitude for draw in wanted.draws])
    parts: list[Ensemble] = []
    with closing(RunStore(wanted.work.runs, wanted.kind.row)) as store:
        for start in range(0, len(wanted.draws), TOGETHER):
            part = slice(start, start + TOGETHER)
            draws, gain = wanted.draws[part], log_gain[part, None, None]
            runner = Runner(wanted, store, draws)
            scale = np.array([draw.scales() for draw in draws])
            expected = search.from_others(np.array(known), np.array(scales), scale) - gain
            found = _cells(wanted, runner, *_search(wanted, runner, expected, errors))
            parts.append(found)
            known += list(wanted.ln(found.boundary) + gain)
            scales += list(scale)
    return _together(parts)


COUNTED = ("checked", "wrong", "followed", "not_first", "too_high")
"""What is counted of all draws together."""


def _together(parts: list[Ensemble]) -> Ensemble:
    """Draws one after the other; what is counted of all of them is added."""
    own = ("overturned", "found_by", "lower", "upper", "runs", "unresolved")
    values: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in own
    }
    values |= {name: sum(getattr(part, name) for part in parts) for name in (*COUNTED, "crashed")}
    return Ensemble(**values, non_monotonic=parts[0].non_monotonic)


def followed_share(levels: int) -> float:
    """Share of so many levels that are followed.

    >>> followed_share(50), followed_share(1000), followed_share(10**6)
    (0.64, 0.032, 0.01)
    """
    return min(max(FOLLOWED, FEWEST_FOLLOWED / levels), 1.0)


class Errors:
    """How far each way was from the boundaries of the draws before, stage by stage."""

    def __init__(self) -> None:
        self._apart: dict[int, list[Array]] = {}

    def add(self, stage: int, apart: Array) -> None:
        """Distances, shape (ways, draws, yaws, rows of the stage) [ln g]."""
        self._apart.setdefault(stage, []).append(np.abs(apart))

    def expected(self, stage: int, ways: Array, width: float) -> tuple[Array, Array]:
        """Where it is expected by all ways, and how far off, not far below a bracket's width."""
        if stage not in self._apart:
            return ways[0], np.full(ways.shape[-1], search.UNSURE[min(stage, 1)])
        off = np.median(np.concatenate(self._apart[stage], axis=1), axis=(1, 2))
        return search.together(ways, np.maximum(off, search.SURE * width))


def _non_monotonic(wanted: Search) -> Mask:
    """Rows that may be ragged: where the site stands above a toppled cell, and next to them."""
    fell = np.maximum.accumulate(wanted.nominal == 1, axis=-1)
    own: Mask = (fell & (wanted.nominal == 0)).any(axis=(0, 2))
    if wanted.motions.dimension != "pgv_pga":
        return own
    return np.asarray(np.convolve(own, np.ones(3))[1:-1] > 0)


def _proved(wanted: Search, draws: Sequence[Draw]) -> Mask:
    """Cells in which a draw provably stands, shape (draws, yaws, rows, pga)."""
    shape = (len(draws), *wanted.nominal.shape)
    along_x = isinstance(wanted.motions, Pulses) and not isinstance(wanted.motions, TablePulses)
    if (
        not along_x or draws[0].settings.drive == "servo"
    ):  # the peak of what the rock feels is not the PGA
        return np.zeros(shape, dtype=bool)
    still = np.zeros((len(draws), shape[1], shape[3]), dtype=bool)
    for at, draw in enumerate(draws):
        peaks = in_si.acceleration(draw.member.amplitude * np.array(wanted.motions.pga))
        for yaw, limits in enumerate(draw.static_limits()):
            still[at, yaw] = [never_starts(limits, peak, wanted.settings) for peak in peaks]
    return np.broadcast_to(still[:, :, None], shape)


def _search(
    wanted: Search, runner: Runner, expected: Array, errors: Errors
) -> tuple[Array, Array, Indices, Indices]:
    """Bracket the boundaries of some draws, stage by stage.

    Parameters
    ----------
    expected : ndarray, shape (draws, yaws, rows) [ln g]

    Returns
    -------
    lower, upper, runs, unresolved : ndarray, shape (draws, yaws, rows), as `Ensemble` has them
    """
    ordered, width = wanted.motions.dimension == "pgv_pga", float(np.log1p(wanted.width))
    lower, upper = np.full((2, *expected.shape), np.nan)
    runs, unresolved = np.zeros((2, *expected.shape), dtype=np.int64)
    done, ways = np.zeros(0, dtype=np.int64), np.stack([expected, expected])
    for stage, rows in enumerate(search.stages(expected.shape[2], ordered=ordered)):
        here, off = errors.expected(stage, ways[..., rows], width)
        scale, size = np.broadcast_to(off, here.shape), here.size
        draw, yaw, row = np.unravel_index(np.arange(size), here.shape)
        known = runner.bracketed(draw, yaw, rows[row], here.ravel(), scale.ravel())
        counts = (
            *first_changes(known, size),
            np.bincount(known.level, minlength=size),
            np.bincount(known.level[known.side < 0], minlength=size),
        )
        for every, own in zip((lower, upper, runs, unresolved), counts, strict=True):
            every[:, :, rows] = own.reshape(here.shape)
        done = np.union1d(done, rows)
        found = wanted.ln(middles(lower, upper))
        errors.add(stage, found[:, :, rows] - ways[..., rows])
        own, nothing = found[:, :, done], np.zeros(expected.shape)
        ways = np.stack([search.from_own_rows(one, own, done) for one in (ways[0], nothing)])
    return lower, upper, runs, unresolved


def _cells(
    wanted: Search, runner: Runner, lower: Array, upper: Array, runs: Indices, unresolved: Indices
) -> Ensemble:
    """Outcomes of the cells of some draws, by their brackets and by some runs that check these."""
    pga, kinds = np.array(wanted.motions.pga), _non_monotonic(wanted)
    table = (pga >= middles(lower, upper)[..., None]).astype(np.int8)
    open_to = ~(pga <= lower[..., None]) & (pga < upper[..., None])
    table[(open_to & (unresolved > 0)[..., None]) | np.isnan(upper)[..., None]] = -1
    proved = _proved(wanted, runner.draws)
    found_by = np.where(proved, FoundBy.PROVED, FoundBy.INFERRED).astype(np.int8)
    table[proved] = 0
    chance = [np.random.default_rng(draw.member.seed) for draw in runner.draws]
    checked = ~proved & (np.array([one.random(table.shape[1:]) for one in chance]) < CHECKED)
    share = followed_share(len(wanted.draws) * wanted.boundary.size)
    followed = np.array([one.random(table.shape[1:3]) for one in chance]) < share
    followed &= np.isfinite(lower) & np.isfinite(upper)
    below = ~proved & followed[..., None] & (pga <= lower[..., None])
    asked, taken = np.nonzero(checked | below), table.copy()
    draw, yaw, row, column = asked
    table[asked] = runner.run(draw, yaw, row, pga[column])
    found_by[asked] = FoundBy.SIMULATED
    wrong = checked & (table >= 0) & (table != taken)
    np.add.at(unresolved, (draw, yaw, row), table[asked] < 0)
    lowest = np.where(below & (table == 1), pga, np.inf).min(axis=-1, initial=np.inf)
    lowest = np.minimum(
        lowest, _lowest(wanted, runner, np.where(followed, lower, np.nan), unresolved)
    )
    high = np.where(followed, upper, 1.0)
    too_high = np.log(high / np.minimum(lowest, high))
    not_first = too_high > 0.0
    counts = {
        name: np.array([part[:, :, kind].sum() for kind in (~kinds, kinds)])
        for name, part in zip(COUNTED, (checked, wrong, followed, not_first, too_high), strict=True)
    }
    return Ensemble(
        table, found_by, lower, upper, runs, unresolved, kinds, crashed=runner.crashed, **counts
    )


def _lowest(wanted: Search, runner: Runner, lower: Array, unresolved: Indices) -> Array:
    """Lowest PGA [g] that topples within some steps below brackets; infinite where none does.

    Parameters
    ----------
    lower : ndarray, shape (draws, yaws, rows) [g], lower ends of brackets; NaN of those left alone
    """
    width = float(np.log1p(wanted.width))
    steps = width * (np.arange(math.ceil(REACH / width)) + 0.5)
    peaks = search.rounded(lower[..., None] * np.exp(-steps), width)
    draw, yaw, row, step = np.nonzero(peaks >= wanted.bounds[0])
    tried = peaks[draw, yaw, row, step]
    side = runner.run(draw, yaw, row, tried)
    np.add.at(unresolved, (draw, yaw, row), side < 0)
    found = np.full(lower.shape, np.inf)
    np.minimum.at(found, (draw, yaw, row), np.where(side == 1, tried, np.inf))
    return found
