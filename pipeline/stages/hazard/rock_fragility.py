"""A rock's fragility as its products hold it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.config.problems import InputError, Problem
from pipeline.stages.archive.archived_rock import PGV_PGA, SHARP, Answered
from pipeline.stages.fragility.summary import SEARCHED, Fits
from pipeline.stages.mesh.products import RockData
from pipeline.stages.uncertainty.draws import EnsembleData
from pipeline.workflow.datasets import open_below, rows_of
from vsr_core.arrays import Array, Indices
from vsr_core.hazard.toppling import (
    MOVED,
    RowFragility,
    borders_of,
    continued_rows,
    lognormal_rows,
    moved,
)
from vsr_core.validation.priors import FIRST_SEED

FITTED, DRAWN = "fits", "members"
"""Origin of the range of a survival probability: intervals of fits, or members of an ensemble."""


MOST_BELOW = 0.01
"""Share of the boundaries of draws below the least PGA tried, at most."""

_ALIKE = 1e-6
"""Difference of ln PGV/PGA up to which rows are one: a record and its mirror image."""


@dataclass(frozen=True, eq=False)
class RockFragility:
    """Probability of toppling of a rock on rows of PGV/PGA.

    Attributes
    ----------
    ratios : ndarray, shape (rows,) [s], ascending
    mean : RowFragility, all directions and frictions counting equally
    by_yaw : dict, from the direction [degree] to its RowFragility
    others : tuple of RowFragility, of each member, or of the ends of the intervals of the fits
    others_by_yaw : dict, from the direction [degree] to those of each member
    tested : tuple of float [g], least and largest PGA that was tried
    records : bool, whether the rows are recorded motions, not pulses
    static : float [g], least steady acceleration that topples it, 0 where that is not known
    numbers : ndarray of int, shape (others,), of the draws among all that may be drawn, which
        observations may have chosen repeatedly; none of fits
    """

    ratios: Array
    mean: RowFragility
    by_yaw: dict[float, RowFragility]
    others: tuple[RowFragility, ...]
    source: str
    tested: tuple[float, float]
    frictions: tuple[float, ...]
    records: bool
    static: float = 0.0
    others_by_yaw: dict[float, tuple[RowFragility, ...]] = field(default_factory=dict)
    numbers: Indices = field(default_factory=lambda: np.array([], np.int64))

    @property
    def effective(self) -> float:
        """Effective number of draws of the rock, 0 where there are none (Kish 1965)."""
        counts = np.unique(self.numbers, return_counts=True)[1]
        return float(counts.sum() ** 2 / max(np.square(counts).sum(), 1))

    def places(self, numbers: Indices) -> Indices:
        """Where draws of some numbers are among the others; of fits, their ends."""
        if self.source == FITTED or numbers is self.numbers:
            return np.arange(len(numbers))
        order = np.argsort(self.numbers, kind="stable")
        return order[np.searchsorted(self.numbers, numbers, sorter=order)]

    def towards(self, yaw: float) -> RockFragility:
        """The same in one direction [degree] alone, where that is known; 270 is -90."""
        same = [one for one in self.by_yaw if math.isclose((one - yaw + 180.0) % 360.0, 180.0)]
        if not same:
            return self
        others = self.others_by_yaw.get(same[0], self.others)
        return replace(self, mean=self.by_yaw[same[0]], others=others)

    def one_row_each(self) -> RockFragility:
        """The same with one row for each PGV/PGA: the mean of records that share one."""
        place = np.append(0, np.cumsum(np.diff(np.log(self.ratios)) > _ALIKE))
        if place[-1] == len(place) - 1:
            return self

        def mean(rows: RowFragility) -> RowFragility:
            def merged(level: Array) -> Array:
                each = rows(level)
                return np.array([each[place == n].mean(axis=0) for n in range(place[-1] + 1)])

            return merged

        return self._with_rows(self.ratios[np.unique(place, return_index=True)[1]], mean)

    def within_tested(self) -> RockFragility:
        """The same, as if nothing more toppled beyond the largest PGA that was tried."""
        last = in_si.acceleration(self.tested[1])
        return self._with_rows(
            self.ratios, lambda rows: lambda level: rows(np.minimum(level, last))
        )

    def every_second(self, first: int) -> RockFragility:
        """The same by half of its rows, from the first or second (0 or 1) on; one row stays."""
        ratios = self.ratios[first::2]
        if not len(ratios):
            return self
        return self._with_rows(ratios, lambda rows: lambda level: rows(level)[first::2])

    def moved(self, part: float) -> RockFragility:
        """The same with its rows moved, as `vsr_core.hazard.toppling.moved` does."""
        return replace(self, ratios=moved(self.ratios, part))

    def _with_rows(
        self, ratios: Array, of: Callable[[RowFragility], RowFragility]
    ) -> RockFragility:
        return replace(
            self,
            ratios=ratios,
            mean=of(self.mean),
            by_yaw={yaw: of(rows) for yaw, rows in self.by_yaw.items()},
            others=tuple(map(of, self.others)),
            others_by_yaw={yaw: tuple(map(of, rows)) for yaw, rows in self.others_by_yaw.items()},
        )


OTHER_ROWS: dict[str, Callable[[RockFragility], RockFragility]] = {
    "grid: every second PGV/PGA of the runs, from the first on": lambda one: one.every_second(0),
    "grid: every second PGV/PGA of the runs, from the second on": lambda one: one.every_second(1),
    "grid: PGV/PGA of the runs a tenth of a row shorter": lambda one: one.moved(-MOVED),
    "grid: PGV/PGA of the runs a tenth of a row longer": lambda one: one.moved(MOVED),
}
"""The cases that show whether the PGV/PGA of the runs are close enough."""


def all_borders(rocks: Iterable[RockFragility]) -> Array:
    """Borders between rows of PGV/PGA, in all cases of all rocks [s], ascending, shape (n,)."""
    rows = (of(one).ratios for one in rocks for of in (lambda one: one, *OTHER_ROWS.values()))
    return np.unique(np.concatenate([*map(borders_of, rows)]))


def of_rock(rock: RockData, fits: Fits, ensemble: EnsembleData | None) -> RockFragility:
    """Fragility of a rock by its ensemble, or, without one, by its fits.

    Raises
    ------
    InputError
        As of `of_fits` and `of_members`.
    """
    if ensemble is None:
        found = of_fits(fits)
    else:
        found = of_members(ensemble.data, str(ensemble.folder / ensemble.FILE))
    return replace(found, static=float(rock.data["tipping_pga"].min()))


def of_fits(fits: Fits) -> RockFragility:
    """Fragility of the fits of a rock."""
    data = fits.data
    data = data.isel({rows_of(data): np.argsort(data["pgv_pga"].values, kind="stable")})
    known = np.isfinite(data["theta"].values).all(axis=2)
    if not known.any():
        raise _without_fragility(str(fits.folder / fits.FILE), "report")
    below = data["theta"].values[known] < _searched(data)[0]
    if (share := float(below.mean())) > MOST_BELOW:
        raise _too_low(str(fits.folder / fits.FILE), "fits", share, _searched(data)[0])
    theta = in_si.acceleration(data["theta"].values)
    ends = in_si.acceleration(data["theta_interval"].values)
    beta = data["beta"].values
    yaws = data["yaw"].values
    found = RockFragility(
        data["pgv_pga"].values,
        lognormal_rows(theta[known], beta[known]),
        {
            float(yaw): lognormal_rows(theta[i][known[i]], beta[i][known[i]])
            for i, yaw in enumerate(yaws)
            if known[i].any()
        },
        tuple(lognormal_rows(ends[..., end][known], beta[known]) for end in (0, 1)),
        FITTED,
        _searched(data),
        tuple(data["friction"].values.tolist()),
        rows_of(data) == "record",
    )
    return found.one_row_each()


def of_members(data: xr.Dataset, file: str = EnsembleData.FILE) -> RockFragility:
    """Fragility of an ensemble whose members differ in what is not known of the rock.

    Parameters
    ----------
    data : Dataset
        ``member_boundary`` and its ends on (member, yaw, pgv_pga), ``overturned`` on these and
        pga, -1 where unresolved, and the lognormal fits ``theta`` and ``beta`` on (yaw, pgv_pga),
        by which all go on beyond the PGA that was tried: below it, draws that slide and never
        topple would be counted as some that topple a little beyond. Rows without a verdict go by
        the fits, which lie between their neighbours there.

    Raises
    ------
    InputError
        If no direction has a fragility, or too many draws topple at the least PGA that was tried.
    """
    below = open_below(data, "member_boundary") == 0.0
    if (share := float(below.mean())) > MOST_BELOW:
        raise _too_low(file, "draws", share, _searched(data)[0])
    row = rows_of(data)
    ratio = "pgv_pga" if row == "pgv_pga" else "record_pgv_pga"
    data = data.isel({row: np.argsort(data[ratio].values, kind="stable")})
    data = data.isel(yaw=np.flatnonzero(np.isfinite(data["theta"].values).all(axis=1)))
    if not data.sizes["yaw"]:
        raise _without_fragility(file, "uncertainty")
    theta, beta = in_si.acceleration(data["theta"].values), data["beta"].values
    levels, edges = (in_si.acceleration(data[name].values) for name in ("pga", "member_boundary"))
    overturned, tested = data["overturned"].values, _searched(data)
    tried = in_si.acceleration(np.array(tested))

    def rows_with(cells: Array, edges: Array, fitted: RowFragility) -> RowFragility:
        rows = continued_rows(partial(_share, levels, cells, edges), tried, fitted)
        unknown = np.asarray(np.isnan(edges).all(axis=0))[:, None]
        return lambda level: np.where(unknown, fitted(level), rows(level))

    fits = _remembered(lognormal_rows(theta, beta))
    own = [
        _remembered(lognormal_rows(*one)) for one in zip(theta[:, None], beta[:, None], strict=True)
    ]
    yaws = [(float(yaw), i) for i, yaw in enumerate(data["yaw"].values)]
    members = list(zip(overturned, edges, strict=True))
    of_yaw = {yaw: rows_with(overturned[:, i], edges[:, i], own[i]) for yaw, i in yaws}
    found = RockFragility(
        data[ratio].values,
        lambda level: np.mean([rows(level) for rows in of_yaw.values()], axis=0),
        of_yaw,
        tuple(rows_with(*one, fits) for one in members),
        DRAWN,
        tested,
        (),
        records=row == "record",
        others_by_yaw={
            yaw: tuple(rows_with(cells[[i]], edge[[i]], own[i]) for cells, edge in members)
            for yaw, i in yaws
        },
        numbers=data["drawn_seed"].values - FIRST_SEED,
    )
    return found.one_row_each()


def _too_low(file: str, of: str, share: float, least: float) -> InputError:
    given = f"{share:.0%} of the boundaries of its {of} below {least:g} g"
    rule = f"at most {MOST_BELOW:.0%} lie below the least PGA tried, where they are assumed"
    return InputError(Problem(file, "fragility.lowest", given, rule, "lower it"))


def _remembered(rows: RowFragility) -> RowFragility:
    """The same, computed once for all draws that are asked about the same levels in turn."""
    last: list[Array] = []

    def asked(level: Array) -> Array:
        if not last or not np.array_equal(last[0], level):
            last[:] = level.copy(), rows(level)
        return last[1]

    return asked


def _without_fragility(file: str, page: str) -> InputError:
    rule, remedy = "some runs have a verdict", f"look at {page}.html"
    return InputError(Problem(file, "theta", "no direction with a fragility", rule, remedy))


def of_photograph(rock: Answered) -> RockFragility:
    """Fragility of a rock of an archive; its draws differ in what is not known of it."""
    median, draws = in_si.acceleration(rock.median), in_si.acceleration(rock.draws)
    sharp, spread = np.full_like(median, SHARP), np.hypot(rock.log_sd, SHARP)
    farthest = np.full_like(median, in_si.acceleration(rock.farthest))
    sides = list(enumerate(rock.directions.tolist()))

    def towards(i: int) -> RowFragility:
        tips, last = (
            lognormal_rows(median[[i]], spread[[i]]),
            lognormal_rows(farthest[[i]], sharp[[i]]),
        )
        none, tip = rock.none[i][:, None], 1.0 - rock.sliding
        return lambda level: tip * ((1.0 - none) * tips(level) + none * last(level))

    by_yaw = {yaw: towards(i) for i, yaw in sides}
    return RockFragility(
        np.array(PGV_PGA),
        lambda level: np.mean([rows(level) for rows in by_yaw.values()], axis=0),
        by_yaw,
        tuple(lognormal_rows(one, sharp) for one in draws),
        DRAWN,
        (rock.static, rock.farthest),
        (),
        records=False,
        static=rock.static,
        others_by_yaw={
            yaw: tuple(lognormal_rows(one[[i]], sharp[[i]]) for one in draws) for i, yaw in sides
        },
        numbers=np.arange(len(draws)),
    )


def _share(levels: Array, cells: Array, edges: Array, at: Array) -> Array:
    """Share of what topples among draws or directions with a boundary, shape (rows, m).

    A draw stands below its first overturning and topples above it up to the next cell of the grid;
    then cells known to stand speak for what is nearest to them; beyond the last there are none.

    Parameters
    ----------
    levels : ndarray, shape (n,) [m/s^2], of the cells
    cells : ndarray of int, shape (k, rows, n), 1, 0, or -1 unresolved
    edges : ndarray, shape (k, rows) [m/s^2], infinite or NaN as a boundary is
    at : ndarray, shape (m,) [m/s^2]
    """
    ends = np.append(levels, np.inf)
    nearest = cells[..., np.searchsorted(np.sqrt(levels[1:] * levels[:-1]), at)]
    beside = at < ends[np.searchsorted(levels, edges)][..., None]
    above = np.where(beside | (at > levels[-1]), 1, nearest != 0)
    sides = np.where(at < edges[..., None], 0, above)
    sides[np.isnan(edges)] = -1
    return np.asarray((sides == 1).sum(axis=0) / np.maximum((sides >= 0).sum(axis=0), 1))


def _searched(data: xr.Dataset) -> tuple[float, float]:
    """Least and largest PGA at which a boundary was looked for, of the grid or beyond it."""
    (low, high), (first, last) = (float(data.attrs[name]) for name in SEARCHED), _span(data)
    return min(low, first), max(high, last)


def _span(data: xr.Dataset) -> tuple[float, float]:
    pga = data["pga"].values
    return float(pga[0]), float(pga[-1])
