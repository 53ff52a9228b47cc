"""Which PGA to run next, so that every change of outcome along PGA is known to a given width.

A level is one direction, one friction and one row of motions. What is known of all levels is one
list of runs; `next_runs` names those of a round, at most a few of each level, until nothing is
left to ask. It looks at nothing else, so that a search goes on from whatever runs there are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsr_core.arrays import Array, Indices, Mask

OUTWARD = 1.25
"""Factor between the PGAs at which a first change is looked for above the last run of a level that
never topples, and below the first one of a level that is not known to stand far below its change.
"""

ASIDE = 0.1
"""Distance from an unresolved run, as a share of a bracket, within which no other is tried."""

NEAR = 2.0
"""Factor from the first overturning within which levels are probed, and below it are run: a grid
may begin on or above an island of standing runs, below which the rock topples."""


@dataclass(frozen=True, eq=False)
class Known:
    """Runs that are done, by level and ascending PGA, each PGA of a level once.

    Attributes
    ----------
    level : ndarray of int, shape (n,)
    pga : ndarray, shape (n,) [g]
    side : ndarray of int, shape (n,), 1 overturned, 0 not, -1 unresolved
    """

    level: Indices
    pga: Array
    side: npt.NDArray[np.int8]

    @classmethod
    def of(cls, level: npt.ArrayLike, pga: npt.ArrayLike, side: npt.ArrayLike) -> Known:
        """The same in order, whatever the order they are given in."""
        levels, peaks = np.asarray(level, dtype=np.int64), np.asarray(pga, dtype=np.float64)
        order = np.lexsort((peaks, levels))
        return cls(levels[order], peaks[order], np.asarray(side, dtype=np.int8)[order])

    def joined(self, level: Indices, pga: Array, side: npt.ArrayLike) -> Known:
        """These runs and others."""
        parts = ((self.level, level), (self.pga, pga), (self.side, np.asarray(side)))
        return Known.of(*(np.concatenate(pair) for pair in parts))

    @property
    def decided(self) -> Known:
        """The runs with a verdict."""
        kept = self.side >= 0
        return Known(self.level[kept], self.pga[kept], self.side[kept])


@dataclass(frozen=True, eq=False)
class Changes:
    """Neighbouring runs with a verdict, of one level, that end differently.

    Attributes
    ----------
    level : ndarray of int, shape (n,), ascending
    lower, upper : ndarray, shape (n,) [g], ascending within a level
    rises : ndarray of bool, shape (n,), whether the rock stands below and topples above
    """

    level: Indices
    lower: Array
    upper: Array
    rises: Mask

    @property
    def width(self) -> Array:
        """Logarithm of upper over lower end."""
        return np.log(self.upper / self.lower)


def changes(known: Known) -> Changes:
    """All changes of outcome along PGA.

    Examples
    --------
    >>> found = changes(Known.of([0, 0, 0, 0], [0.1, 0.2, 0.3, 0.4], [0, 1, -1, 0]))
    >>> found.lower.tolist(), found.upper.tolist(), found.rises.tolist()
    ([0.1, 0.2], [0.2, 0.4], [True, False])
    """
    runs = known.decided
    here = np.flatnonzero((runs.level[1:] == runs.level[:-1]) & (runs.side[1:] != runs.side[:-1]))
    return Changes(runs.level[here], runs.pga[here], runs.pga[here + 1], runs.side[here] == 0)


def of_grid(pga: Array, side: npt.NDArray[np.int8], also: Mask | None = None) -> Known:
    """The runs of a grid that bound changes: the others tell a search nothing.

    Parameters
    ----------
    pga : ndarray, shape (n,) [g], ascending
    side : ndarray of int, shape (levels, n)
    also : ndarray of bool, shape (levels, n - 1), gaps whose ends are wanted, too
    """
    differ = side[:, 1:] != side[:, :-1]
    if also is not None:
        differ = differ | also
    kept = np.zeros(side.shape, dtype=bool)
    kept[:, :-1] |= differ
    kept[:, 1:] |= differ
    kept[:, [0, -1]] = True
    level, column = np.nonzero(kept)
    return Known(level, pga[column], side[kept])


def next_runs(known: Known, width: Array, bounds: tuple[float, float]) -> tuple[Indices, Array]:
    """Runs of the next round; none once every change is known to its width.

    Parameters
    ----------
    width : ndarray, shape (levels,), of the logarithm of upper over lower end of a change
    bounds : tuple of float [g], between which a first change is looked for beyond the runs

    Returns
    -------
    level : ndarray of int, shape (k,)
    pga : ndarray, shape (k,) [g], none of them known

    Examples
    --------
    >>> known = Known.of([0, 0, 1, 1], [0.1, 0.4, 0.1, 0.4], [0, 1, 0, 0])
    >>> level, pga = next_runs(known, np.array([0.01, 0.01]), (0.001, 4.0))
    >>> level.tolist(), pga.round(3).tolist()
    ([0, 1], [0.25, 0.5])
    """
    found = changes(known)
    wide = found.width > width[found.level]
    level, lower, upper = found.level[wide], found.lower[wide], found.upper[wide]
    pga = roundest(lower, upper)
    hindered = np.isin(level, known.level[known.side < 0])
    for at in np.flatnonzero(hindered):
        pga[at] = _beside(known, level[at], lower[at], upper[at])
    inward = (pga > lower) & (pga < upper)  # else no place is left between them
    below, above = _outward(known, bounds)
    levels = np.concatenate([level[inward], below[0], above[0]])
    peaks = np.concatenate([pga[inward], below[1], above[1]])
    order = np.lexsort((peaks, levels))
    return levels[order], peaks[order]


def roundest(lower: Array, upper: Array) -> Array:
    """PGA between two others that is a whole number of the largest power of two.

    Whatever the grid, brackets of one change are parted at the same PGAs, so that grids share their
    runs and end in the same interval, also where changes lie close together.

    Examples
    --------
    >>> roundest(np.array([0.3, 0.3125, 0.3125]), np.array([0.32, 0.32, 0.375])).tolist()
    [0.3125, 0.31640625, 0.34375]
    """
    step = np.ldexp(1.0, np.frexp(upper - lower)[1] - 1)  # of which one or two lie between
    first = np.floor(lower / step) + 1.0
    second = (first % 2.0 == 1.0) & ((first + 1.0) * step < upper)
    found = (first + second) * step
    between = (np.floor(2.0 * lower / step) + 1.0) * 0.5 * step
    return np.asarray(np.where(found < upper, found, between))


def _beside(known: Known, level: int, lower: float, upper: float) -> float:
    """PGA to try in a bracket, away from unresolved runs; nan where there is no place."""
    start, end = np.searchsorted(known.level, [level, level + 1])
    inside = known.pga[start:end]
    inside = inside[(inside > lower) & (inside < upper)]
    near = ASIDE * np.log(upper / lower)
    middle = np.sqrt(lower * upper)
    usual = roundest(np.array([lower]), np.array([upper]))[0]
    for tried in (usual, middle, np.sqrt(lower * middle), np.sqrt(middle * upper)):
        if (np.abs(np.log(inside / tried)) > near).all():
            return float(tried)
    return np.nan


def _outward(known: Known, bounds: tuple[float, float]) -> list[tuple[Indices, Array]]:
    """Runs well below the first overturning of levels, and above those that never topple."""
    levels, start = np.unique(known.level, return_index=True)
    lowest, highest = known.pga[start], known.pga[np.append(start[1:], len(known.pga)) - 1]
    runs = known.decided
    fallen, first = np.unique(runs.level[runs.side == 1], return_index=True)
    falls, far = np.isin(levels, fallen), np.full(len(levels), np.inf)
    far[falls] = runs.pga[runs.side == 1][first] / NEAR
    down = lowest > np.maximum(far, bounds[0])
    up = np.isin(levels, runs.level) & ~falls & (highest < bounds[1])
    return [
        (levels[down], np.maximum(lowest[down] / OUTWARD, bounds[0])),
        (levels[up], np.minimum(highest[up] * OUTWARD, bounds[1])),
    ]


def first_changes(known: Known, levels: int) -> tuple[Array, Array]:
    """Interval of the first overturning of each level.

    Parameters
    ----------
    levels : int, their number

    Returns
    -------
    lower, upper : ndarray, shape (levels,) [g]
        As ``vsr_core.fragility.boundary.Boundary`` has them.

    Examples
    --------
    >>> first_changes(Known.of([0, 0, 2, 3], [0.1, 0.2, 0.1, 0.1], [0, 1, 1, 0]), 5)
    (array([0.1, nan, nan, 0.1, nan]), array([0.2, nan, 0.1, inf, nan]))
    """
    runs = known.decided
    upper = np.full(levels, np.inf)
    np.minimum.at(upper, runs.level, np.where(runs.side == 1, runs.pga, np.inf))
    lower = np.full(levels, -np.inf)
    below = (runs.side == 0) & (runs.pga < upper[runs.level])
    np.maximum.at(lower, runs.level[below], runs.pga[below])
    stood = np.isfinite(lower)
    return np.where(stood, lower, np.nan), np.where(stood | np.isfinite(upper), upper, np.nan)


def middles(lower: Array, upper: Array) -> Array:
    """First-overturning PGA: the geometric middle of its interval.

    Parameters
    ----------
    lower, upper : ndarray, shape (...) [g]
        As `first_changes` gives them; where nothing stood, the interval is taken to begin where the
        next run would have been.

    Examples
    --------
    >>> middles(np.array([0.1, np.nan, 4.0]), np.array([0.4, 0.002, np.inf])).round(4).tolist()
    [0.2, 0.0018, inf]
    """
    return np.asarray(np.sqrt(np.where(np.isnan(lower), upper / OUTWARD, lower) * upper))


def probes(
    pga: Array, side: npt.NDArray[np.int8], drawn: Array, share: float
) -> tuple[Indices, Array, Indices]:
    """Runs between neighbouring cells of one outcome, near the first overturning of some levels.

    Parameters
    ----------
    pga : ndarray, shape (n,) [g], ascending
    side : ndarray of int, shape (levels, n)
    drawn : ndarray, shape (levels, 3), uniform on (0, 1): whether, between which cells, and where
    share : float, of the levels

    Returns
    -------
    level : ndarray of int, shape (k,)
    pga : ndarray, shape (k,) [g]
    gap : ndarray of int, shape (k,), column of the cell below
    """
    first = np.where(side == 1, pga, np.inf).min(axis=1, initial=np.inf)
    middle = np.sqrt(pga[1:] * pga[:-1])
    near = (middle * NEAR > first[:, None]) & (middle < NEAR * first[:, None])
    open_to = near & (side[:, 1:] == side[:, :-1]) & (side[:, 1:] >= 0)
    number = open_to.sum(axis=1)
    level = np.flatnonzero((drawn[:, 0] < share) & (number > 0))
    if not len(level):  # as on a grid of one PGA
        return level, np.zeros(0), level
    wanted = (drawn[level, 1] * number[level]).astype(int)
    gap = (open_to[level].cumsum(axis=1) > wanted[:, None]).argmax(axis=1)
    tried = pga[gap] + drawn[level, 2] * (pga[gap + 1] - pga[gap])
    inside = (tried > pga[gap]) & (tried < pga[gap + 1])
    return level[inside], tried[inside], gap[inside]
