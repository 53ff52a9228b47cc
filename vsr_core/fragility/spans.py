"""What runs say of every PGA between them, in cells that do not follow the grid they are from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vsr_core.arrays import Array, Mask
from vsr_core.fragility.bisection import Known, changes, first_changes
from vsr_core.fragility.boundary import Cells

STEP = 0.08
"""Width of a cell in ln PGA."""

REACH = 2.0
"""Factor beyond the lowest and the highest first overturning to which the cells go, unless a row
has its nearest run farther away."""


@dataclass(frozen=True)
class Thresholds:
    """First overturning of each PGV/PGA row, as an interval, and the end of its last change.

    Attributes
    ----------
    lower, upper : ndarray, shape (n_ratio,) [ln g]
        NaN and infinite as ``vsr_core.fragility.boundary.Boundary`` has them.
    last : ndarray, shape (n_ratio,) [ln g]
        Above which all in reach of the first overturning topples; NaN where some stands.
    single : ndarray of bool, shape (n_ratio,), rows that change once, or never
    """

    lower: Array
    upper: Array
    last: Array
    single: Mask


def thresholds(known: Known, rows: int) -> Thresholds:
    """First overturning of rows, which are the levels of the runs."""
    lower, upper = first_changes(known, rows)
    every, last = changes(known), np.full(rows, np.nan)
    inside = every.upper <= REACH * upper[every.level]
    # ascending: the highest of a level remains
    ends = np.where(every.rises, every.upper, np.nan)[inside]
    last[every.level[inside]] = np.log(ends)
    number = np.bincount(every.level, minlength=rows)
    return Thresholds(np.log(lower), np.log(upper), last, number <= 1)


def shares(known: Known, pgv_pga: npt.ArrayLike) -> Cells:
    """Share of each cell that topples, and share of it that is known.

    Between two runs that end alike all is taken to end like them, unless an unresolved one lies
    there; of an interval of a change half. What was not tested is not known. Where a row has no two
    runs beside each other, as of one PGA, each is taken for its cell.

    Parameters
    ----------
    known : Known, the runs of rows, which are its levels
    pgv_pga : array_like, shape (n_ratio,) [s]
    """
    ratios = np.asarray(pgv_pga, dtype=np.float64)
    upper = first_changes(known, ratios.size)[1]
    first = upper[np.isfinite(upper)]
    lowest, highest = _reach(np.log(first if first.size else known.pga))
    low, high = float(lowest.min()), float(highest.max())
    for row in range(ratios.size):
        if len(at := _told(known, row)):
            low, high = min(low, float(at.max()) - STEP), max(high, float(at.min()) + STEP)
    centres = STEP * np.arange(np.floor(low / STEP), np.ceil(high / STEP) + 1)
    borders = np.append(centres, centres[-1] + STEP) - 0.5 * STEP
    rows = [_row(known, row, borders) for row in range(ratios.size)]
    toppled, trials = (np.array(part) / STEP for part in zip(*rows, strict=True))
    trials[trials < 1e-9] = 0.0
    return Cells(centres, np.log(ratios), np.where(trials > 0.0, toppled, 0.0), trials)


def in_reach(cells: Cells, thresholds: Thresholds) -> Cells:
    """Of each row the cells in reach of its own first overturning, as if it were alone."""
    low, high = _reach(np.where(np.isfinite(thresholds.upper), thresholds.upper, 0.0)[:, None])
    own = (cells.ln_pga > low - STEP) & (cells.ln_pga < high + STEP)
    own |= ~np.isfinite(thresholds.upper)[:, None]
    return replace(cells, toppled=cells.toppled * own, trials=cells.trials * own)


def _reach(ln_first: Array) -> tuple[Array, Array]:
    """Lowest and highest PGA [ln g] in reach of a first overturning."""
    return ln_first - np.log(REACH), ln_first + np.log(REACH)


def _told(known: Known, row: int) -> Array:
    """Places [ln g] of a row's runs with a verdict, of those beside each other if there are any."""
    start, end = np.searchsorted(known.level, [row, row + 1])
    at, decided = np.log(known.pga[start:end]), known.side[start:end] >= 0
    beside = decided[1:] & decided[:-1]
    paired = np.append(beside, False) | np.append(False, beside)
    return at[paired if paired.any() else decided]


def _row(known: Known, row: int, borders: Array) -> tuple[Array, Array]:
    """Lengths [ln g] of each cell that topple, and that are known."""
    start, end = np.searchsorted(known.level, [row, row + 1])
    at, side = np.log(known.pga[start:end]), known.side[start:end]
    decided = np.flatnonzero(side >= 0)
    length = np.diff(at[decided]) * (np.diff(decided) == 1)
    if not length.any():
        count = np.histogram(at[decided], borders)[0]
        toppled = np.histogram(at[decided], borders, weights=side[decided])[0]
        return STEP * toppled / np.maximum(count, 1), np.where(count > 0, STEP, 0.0)
    fell = 0.5 * (side[decided][1:] + side[decided][:-1])
    found = []
    for part in (length * fell, length):
        so_far = np.append(0.0, np.cumsum(part))
        found.append(np.diff(np.interp(borders, at[decided], so_far)))
    return found[0], found[1]
