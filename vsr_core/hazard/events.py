"""Simulated earthquakes at a site, in each branch of a hazard model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.hazard.ratio import LOG_SD, RatioTable, log_pgv_given

_DEGREE = 111.195
"""Kilometres of a degree of latitude."""

_NEAR = 6.0
"""Distance within which shaking hardly grows, for a fit of medians [km]."""

_MOST_FITTED = 1_000_000
"""Events of which a correlation is measured; of more, every second, third, ..."""

_LEAST = 1e-6
"""Standard deviation of ln PGV/PGA in place of none."""

_BIN, _FEWEST = 1.25, 30
"""Factor between accelerations of a table of PGV/PGA, and events that a value is made of."""


@dataclass(frozen=True, eq=False)
class Ruptures:
    """Where earthquakes come from.

    Attributes
    ----------
    magnitudes, distances : ndarray, shape (ruptures,) [1] and [km], from the surface projection
    """

    magnitudes: Array
    distances: Array


@dataclass(frozen=True, eq=False)
class Events:
    """Earthquakes as they shake a site.

    Attributes
    ----------
    pga : ndarray, shape (n,) [m/s^2], positive
    pgv : ndarray, shape (n,) [m/s], where it was simulated; 0 is less than was kept
    branch, rupture : ndarray of int, shape (n,), their numbers, from 0
    years : float, for which each branch was simulated
    ruptures : Ruptures, where they are known
    """

    pga: Array
    pgv: Array | None
    branch: Indices
    rupture: Indices
    years: float
    ruptures: Ruptures | None

    def rates(self, values: Array, levels: Array, branches: int) -> Array:
        """Annual rates at which levels are exceeded, shape (branches, levels).

        Parameters
        ----------
        values : ndarray, shape (n,), such as PGA
        levels : ndarray, shape (k,), ascending
        """
        number = len(levels) + 1
        place = self.branch.astype(np.int64) * number + np.searchsorted(levels, values)
        counted = np.bincount(place, minlength=branches * number).reshape(branches, number)
        return np.cumsum(counted[:, :0:-1], axis=1)[:, ::-1] / self.years

    def ratio_as_simulated(self) -> Array:
        """PGV/PGA of each event [s]."""
        assert self.pgv is not None
        return self.pgv / self.pga

    def ratio_anew(self, seed: int = 1) -> Array:
        """PGV/PGA of each event, PGV drawn anew given its PGA, magnitude and distance [s]."""
        assert self.ruptures is not None
        magnitude, distance = (
            one[self.rupture] for one in (self.ruptures.magnitudes, self.ruptures.distances)
        )
        x = np.log(self.pga)
        drawn = LOG_SD * np.random.default_rng(seed).standard_normal(len(x))
        return np.exp(log_pgv_given(x, magnitude, distance) - x + drawn)

    def ratio_of_table(self, table: RatioTable, seed: int = 1) -> Array:
        """PGV/PGA of each event, drawn from a table [s]."""
        median, log_sd = table.at(self.pga)
        drawn = np.random.default_rng(seed).standard_normal(len(self.pga))
        return median * np.exp(log_sd * drawn)

    def correlation(self) -> float:
        """Correlation of the residuals of ln PGA and ln PGV, as they were simulated.

        Residuals are about what fits a branch best of 1, M, M^2, ln r and M ln r, with
        r = sqrt(R^2 + (6 km)^2).
        """
        assert self.ruptures is not None
        assert self.pgv is not None
        some = np.arange(0, len(self.pga), 1 + len(self.pga) // _MOST_FITTED)
        some = some[self.pgv[some] > 0.0]
        rupture = self.rupture[some]
        magnitude = self.ruptures.magnitudes[rupture]
        near = np.log(np.hypot(self.ruptures.distances[rupture], _NEAR))
        parts = np.ones_like(near), magnitude, magnitude**2, near, magnitude * near
        x = np.column_stack(parts)
        y = np.log(np.column_stack([self.pga[some], self.pgv[some]]).astype(np.float64))
        left = np.zeros((2, 2))
        for branch in np.unique(self.branch[some]):
            own = self.branch[some] == branch
            residual = y[own] - x[own] @ np.linalg.lstsq(x[own], y[own])[0]
            left += residual.T @ residual
        return float(left[0, 1] / np.sqrt(left[0, 0] * left[1, 1]))


def table_of(pga: Array, ratio: Array, weight: Array) -> RatioTable:
    """Median PGV/PGA and its spread at each PGA, of events.

    Parameters
    ----------
    pga, ratio, weight : ndarray, shape (n,) [m/s^2], [s], and how much an event counts
    """
    known = ratio > 0.0
    x, y, weight = np.log(pga[known]), np.log(ratio[known]), weight[known]
    place = ((x - x.min()) / np.log(_BIN)).astype(np.int64)
    place = np.minimum(place, _last(place))

    def mean(values: Array) -> Array:
        with np.errstate(invalid="ignore"):  # where no event is that counts
            return np.bincount(place, weight * values) / np.bincount(place, weight)

    middle, level = mean(y), mean(x)
    spread = np.sqrt(mean((y - middle[place]) ** 2))
    held = np.isfinite(spread)
    spread = np.maximum(spread, _LEAST)
    return RatioTable(np.exp(level[held]), np.exp(middle[held]), spread[held])


def _last(place: Indices) -> int:
    """The last bin before the first that has too few; all beyond is counted with it."""
    few = np.flatnonzero(np.bincount(place)[1:] < _FEWEST)
    return int(few[0]) if len(few) else int(place.max())


def distance_of(
    magnitude: Array, longitude: Array, latitude: Array, strike: Array, dip: Array
) -> Array:
    """Distance from the surface projection of ruptures that are known by their middles [km].

    A rupture is a rectangle about its middle, of length 10^(-2.44 + 0.59 M) and width
    10^(-1.01 + 0.32 M) km.

    Parameters
    ----------
    longitude, latitude : ndarray, shape (ruptures,) [degree], of the site from the middle
    strike, dip : ndarray, shape (ruptures,) [degree]

    References
    ----------
    Wells & Coppersmith (1994), Bull. Seismol. Soc. Am. 84(4), table 2A.
    """
    east, north = _DEGREE * longitude, _DEGREE * latitude
    sine, cosine = np.sin(np.radians(strike)), np.cos(np.radians(strike))
    along, across = np.abs(east * sine + north * cosine), np.abs(east * cosine - north * sine)
    length, width = 10.0 ** (-2.44 + 0.59 * magnitude), 10.0 ** (-1.01 + 0.32 * magnitude)
    beyond = np.maximum(along - 0.5 * length, 0.0)
    return np.hypot(beyond, np.maximum(across - 0.5 * width * np.cos(np.radians(dip)), 0.0))
