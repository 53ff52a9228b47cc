"""Shaking under the branches of a hazard model, of curves or of events, and what it topples."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from vsr_core.arrays import Array, Indices
from vsr_core.hazard.curve import HazardCurve, mean_curve
from vsr_core.hazard.events import Events, table_of
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.toppling import (
    PARTS,
    Fragility,
    RowFragility,
    Toppling,
    borders_of,
    points,
    rate_by_row,
    shares_between,
    summed,
    toppling,
)

REACH = 10.0
"""How far beyond the first and last level of shaking a fragility is known, as a factor: components
and scale factors move the shaking along it."""


PART = 1.002
"""Factor between the borders of parts of PGA in which events are counted."""


@dataclass(frozen=True, eq=False)
class CurveShaking:
    """Shaking as curves tell it: how often each PGA, and one lognormal PGV/PGA at each.

    Attributes
    ----------
    borders : ndarray, shape (cells - 1,) [s], ascending, of PGV/PGA, between those of all rocks
    factor : float, of the PGA at the rock over that of the curves
    """

    curves: tuple[HazardCurve, ...]
    table: RatioTable
    borders: Array
    factor: float = 1.0

    @property
    def levels(self) -> Array:
        """Levels of PGA at which some branch has a rate [m/s^2]."""
        return max((one.levels for one in self.curves), key=len)

    @cached_property
    def _at(self) -> Array:
        """PGA at the rock at which a fragility is known, shape (n,) [m/s^2]."""
        return points(self.levels[[0, -1]] * [1.0 / REACH, REACH])

    @cached_property
    def _shares(self) -> Array:
        """Share of the shaking in each cell of PGV/PGA, which no factor changes, (cells, n)."""
        return shares_between(self.borders, *self.table.at(self._at / self.factor))

    def fragility(self, rows: RowFragility, ratios: Array) -> Fragility:
        """Fragility in each cell of PGV/PGA, shape (cells, n) at n PGA.

        Parameters
        ----------
        ratios : ndarray, shape (rows,) [s], ascending, PGV/PGA of the rows
        """
        return _in_cells(rows, self._at, _row_of_cells(self.borders, ratios))

    def _averaged(self, fragility: Fragility) -> Fragility:
        """The same over PGA alone: only then, as rocks feel one PGV/PGA in an earthquake."""
        return summed(self._at, self._shares, fragility(self._at))

    def rates(self, fragility: Fragility) -> Array:
        """Annual rates of toppling, shape (branches,)."""
        return np.array([one.rate for one in self._each(fragility)])

    def largest_rates(self, fragility: Fragility) -> Array:
        """The same if all that exceeds the last level of a curve topples."""
        return np.array([one.rate + one.beyond for one in self._each(fragility)])

    def _each(self, fragility: Fragility) -> list[Toppling]:
        mean = self._averaged(fragility)

        def moved(level: Array) -> Array:
            return mean(self.factor * level)

        return [toppling(one, moved) for one in self.curves]

    def mean(self, weights: Array) -> CurveShaking:
        """That of the mean of the branches."""
        return replace(self, curves=(mean_curve(self.curves, weights, self.levels),))

    def times(self, factor: float) -> CurveShaking:
        """The same with all accelerations, and velocities, multiplied."""
        return replace(self, factor=factor * self.factor)

    def by_row(self, rows: RowFragility, ratios: Array) -> tuple[Array, Array]:
        """Which PGA and PGV/PGA topple a rock under the first branch.

        Returns
        -------
        starts : ndarray, shape (m,) [m/s^2], where parts of PGA begin; the last has no end
        rates : ndarray, shape (rows, m) [1/year]
        """
        curve, fragility = self.curves[0], self._averaged(self.fragility(rows, ratios))
        _, rates = rate_by_row(curve, fragility, rows, ratios, self.table)
        places = np.arange(len(curve.levels)), np.log(curve.levels)
        return np.exp(np.interp(np.arange(rates.shape[1]) / PARTS, *places)), rates


@dataclass(frozen=True, eq=False)
class EventShaking:
    """Shaking as simulated earthquakes tell it: how often each PGA with each PGV/PGA.

    Earthquakes are counted in fine parts of PGA and in cells of PGV/PGA, which lie between the
    borders of the rows of all rocks: a fragility is one number in each.

    Attributes
    ----------
    levels : ndarray, shape (m,) [m/s^2], PGA in the middle of each part
    borders : ndarray, shape (cells - 1,) [s], ascending, of PGV/PGA
    counted : sparse array, shape (branches, cells * m) [1/year]
    table : RatioTable, of PGV/PGA at a PGA, all branches together
    events : Events, that were counted
    place : ndarray of int, shape (n,), where each of them was
    """

    levels: Array
    borders: Array
    counted: sparse.csr_array
    table: RatioTable
    events: Events = field(repr=False)
    place: Indices = field(repr=False)

    def fragility(self, rows: RowFragility, ratios: Array) -> Fragility:
        """Fragility in each cell of PGV/PGA, shape (cells, n) at n PGA.

        Parameters
        ----------
        ratios : ndarray, shape (rows,) [s], ascending, PGV/PGA of the rows
        """
        first, last = np.log(self.levels[[0, -1]]) + np.log([1.0 / REACH, REACH])
        at = np.exp(np.arange(first, last + np.log(PART), np.log(PART)))
        return _in_cells(rows, at, _row_of_cells(self.borders, ratios))

    def rates(self, fragility: Fragility) -> Array:
        """Annual rates of toppling, shape (branches,)."""
        return np.asarray(self.counted @ fragility(self.levels).ravel())

    def mean(self, weights: Array) -> EventShaking:
        """That of the mean of the branches."""
        return replace(self, counted=sparse.csr_array((weights @ self.counted)[None]))

    def times(self, factor: float) -> EventShaking:
        """The same with all accelerations, and velocities, multiplied."""
        return replace(self, levels=factor * self.levels)

    def by_row(self, rows: RowFragility, ratios: Array) -> tuple[Array, Array]:
        """Which PGA and PGV/PGA topple a rock under the first branch, as of curves."""
        fragility = self.fragility(rows, ratios)(self.levels)
        rates = np.zeros((len(ratios), len(self.levels)))
        parts = self.counted[[0]].toarray().reshape(fragility.shape) * fragility
        np.add.at(rates, _row_of_cells(self.borders, ratios), parts)
        return self.levels / np.sqrt(PART), rates

    def resampled(self, fragility: Fragility, number: int, seed: int = 1) -> Array:
        """Rates of toppling of other catalogues that might have been simulated.

        A bootstrap over ruptures, each there as often as Poisson's law has it, with all of its
        earthquakes in all branches.

        Returns
        -------
        ndarray, shape (number, branches) [1/year]
        """
        events, rng = self.events, np.random.default_rng(seed)
        shape = int(events.rupture.max()) + 1, self.counted.shape[0]
        own = self._each(fragility), (events.rupture, events.branch)
        of_rupture = sparse.csr_array(own, shape=shape).T
        return np.array([of_rupture @ rng.poisson(1.0, shape[0]) for _ in range(number)])

    def variance_of_independent(self, fragility: Fragility) -> Array:
        """Variance of the rates if each event were a rupture of its own, shape (branches,)."""
        own = self._each(fragility) ** 2
        return np.bincount(self.events.branch, own, self.counted.shape[0]).astype(np.float64)

    def _each(self, fragility: Fragility) -> Array:
        """What each event adds to the rate of its branch [1/year]."""
        return fragility(self.levels).ravel()[self.place] / self.events.years


Shaking = CurveShaking | EventShaking


def _row_of_cells(borders: Array, ratios: Array) -> Indices:
    """The row that each cell of PGV/PGA is in, shape (cells,)."""
    return np.searchsorted(borders_of(ratios), np.append(0.0, borders), side="right")


def _in_cells(rows: RowFragility, at: Array, row: Indices) -> Fragility:
    """Rows in each cell, straight in ln PGA between points that are equally far apart."""
    known, first = rows(at), np.log(at[0])
    step = (np.log(at[-1]) - first) / (len(at) - 1)

    def fragility(level: Array) -> Array:
        place = np.clip((np.log(level) - first) / step, 0.0, len(at) - 1.001)
        below = place.astype(np.int64)
        part = place - below
        return ((1.0 - part) * known[:, below] + part * known[:, below + 1])[row]

    return fragility


def counted_shaking(events: Events, ratio: Array, borders: Array, weights: Array) -> EventShaking:
    """Shaking of events, counted.

    Parameters
    ----------
    ratio : ndarray, shape (n,) [s], PGV/PGA of each event
    borders : ndarray, shape (cells - 1,) [s], ascending, between which fragilities do not change
    weights : ndarray, shape (branches,)
    """
    x, step = np.log(events.pga), np.log(PART)
    part = ((x - x.min()) / step).astype(np.int64)
    number = int(part.max()) + 2
    levels = np.exp(x.min() + step * (np.arange(number) + 0.5))
    place = np.searchsorted(borders, ratio, side="right") * number + part
    shape = len(weights), (len(borders) + 1) * number
    each = np.full(len(place), 1.0 / events.years)
    rates = sparse.csr_array((each, (events.branch, place)), shape=shape)
    rates.sum_duplicates()
    table = table_of(events.pga, ratio, weights[events.branch])
    return EventShaking(levels, borders, rates, table, events, place)
