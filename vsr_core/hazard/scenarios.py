"""Chance that an earthquake of a magnitude and distance topples a rock, and how near one was."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.special import ndtr

from vsr_core.arrays import Array
from vsr_core.hazard.ratio import CORRELATION, PGA, PGV
from vsr_core.hazard.toppling import FINEST, RowFragility, row_shares

MAGNITUDES, DISTANCES = (5.0, 7.6), (1.0, 100.0)
"""Least and largest magnitude, and distance [km], of the earthquakes that the equations are of."""

AT_ONCE = 64
"""Earthquakes whose shaking is held in memory together: 50 rows of PGV/PGA take 1 MB each."""


@dataclass(frozen=True, eq=False)
class Shaking:
    """Peaks that are to be expected in some earthquakes, jointly lognormal.

    Attributes
    ----------
    pga, pgv : ndarray, shape (n,), natural logarithms of the medians [m/s^2] and [m/s]
    pga_sd, pgv_sd : ndarray, shape (n,), standard deviations of the logarithms
    correlation : float, of their residuals
    """

    pga: Array
    pga_sd: Array
    pgv: Array
    pgv_sd: Array
    correlation: float = CORRELATION

    def parted(self, number: int) -> Iterator[Shaking]:
        """The same in parts of so many earthquakes."""
        each = {name: getattr(self, name) for name in ("pga", "pga_sd", "pgv", "pgv_sd")}
        for start in range(0, len(self.pga), number):
            some = slice(start, start + number)
            yield replace(self, **{name: values[some] for name, values in each.items()})


def of_equations(magnitudes: Array, distances: Array) -> Shaking:
    """Shaking on rock by strike-slip earthquakes.

    Parameters
    ----------
    magnitudes, distances : ndarray, shape (n,) [1] and [km]

    References
    ----------
    PGA: Bommer, Akkar & Drouet (2012); PGV: Akkar & Bommer (2010); Bradley (2012).
    """
    sds = (np.full(len(magnitudes), one.log_sd) for one in (PGA, PGV))
    medians = (one.log_median(magnitudes, distances) for one in (PGA, PGV))
    pga, pgv = medians
    pga_sd, pgv_sd = sds
    return Shaking(pga, pga_sd, pgv, pgv_sd)


@dataclass(frozen=True, eq=False)
class GroundMotionTable:
    """Medians and standard deviations on a grid, straight in magnitude and ln distance between.

    Attributes
    ----------
    magnitudes, distances : ndarray, shape (k,) and (m,) [1] and [km], ascending
    values : ndarray, shape (k, m, 4), as `Shaking` has them: pga, pga_sd, pgv, pgv_sd
    """

    magnitudes: Array
    distances: Array
    values: Array

    def at(self, magnitudes: Array, distances: Array) -> Shaking:
        """Shaking of some earthquakes; those beyond the table are as at its ends.

        Parameters
        ----------
        magnitudes, distances : ndarray, shape (n,) [1] and [km]
        """
        axes = self.magnitudes, np.log(self.distances)
        asked = (magnitudes, np.log(np.maximum(distances, self.distances[0])))
        places = [np.clip(one, axis[0], axis[-1]) for one, axis in zip(asked, axes, strict=True)]
        found = RegularGridInterpolator(axes, self.values)(np.column_stack(places))
        return Shaking(*found.T)


def parts_between(low: float, high: float) -> Array:
    """Accelerations [m/s^2] that part a range finely, shape (n,)."""
    return np.geomspace(low, high, 2 + int(np.log(high / low) / np.log(FINEST)))


def shares(shaking: Shaking, ratios: Array, borders: Array) -> tuple[Array, Array]:
    """How likely each PGA and PGV/PGA is in each of some earthquakes.

    ln PGA is normal with mean m_A and deviation s_A. Each row of PGV/PGA stands for the
    values nearer to its own than to another's, in logarithms.

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s], ascending
    borders : ndarray, shape (k,) [m/s^2], ascending, of parts of PGA; the first part is all below
        the first border, the last all above the last

    Returns
    -------
    levels : ndarray, shape (k + 1,) [m/s^2], that stand for the parts
    share : ndarray, shape (n, rows, k + 1), of sum 1 in each earthquake
    """
    x, middles = np.log(borders), _middles(borders)
    medians, left = ratios_given(shaking, np.exp(middles))
    of_rows = row_shares(ratios, medians.ravel(), np.repeat(left, len(middles)))
    of_rows = of_rows.reshape(len(ratios), *medians.shape).transpose(1, 0, 2)
    below = ndtr((x - shaking.pga[:, None]) / shaking.pga_sd[:, None])
    edges = np.pad(below, ((0, 0), (1, 1)), constant_values=((0, 0), (0, 1)))
    return np.exp(middles), of_rows * np.diff(edges, axis=1)[:, None, :]


def ratios_given(shaking: Shaking, levels: Array) -> tuple[Array, Array]:
    """PGV/PGA of some earthquakes where they have a PGA.

    Given ln PGA = a, ln PGV is normal with mean m_V + rho s_V (a - m_A) / s_A and variance
    s_V^2 (1 - rho^2).

    Parameters
    ----------
    levels : ndarray, shape (k,) [m/s^2]

    Returns
    -------
    medians : ndarray, shape (n, k) [s]
    log_sds : ndarray, shape (n,)
    """
    x = np.log(levels)
    residual = (x - shaking.pga[:, None]) / shaking.pga_sd[:, None]
    velocity = shaking.pgv[:, None] + shaking.correlation * shaking.pgv_sd[:, None] * residual
    return np.exp(velocity - x), shaking.pgv_sd * np.sqrt(1.0 - shaking.correlation**2)


def toppling_chance(
    shaking: Shaking, ratios: Array, rocks: list[RowFragility], borders: Array
) -> Array:
    """Probability that an earthquake topples a rock, P(toppled | M, R).

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s], ascending, of the fragilities
    rocks : fragilities, of draws of one rock
    borders : ndarray, shape (k,) [m/s^2], as of `shares`

    Returns
    -------
    ndarray, shape (rocks, n)
    """
    levels = np.exp(_middles(borders))
    chances = np.stack([rows(levels).ravel() for rows in rocks])
    each = (shares(part, ratios, borders)[1] for part in shaking.parted(AT_ONCE))
    return np.concatenate([chances @ one.reshape(len(one), -1).T for one in each], axis=1)


def _middles(borders: Array) -> Array:
    """Ln PGA that stands for each part between borders, and for what is beyond them."""
    x = np.log(borders)
    return np.concatenate([x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]])


def nearest(distances: Array, toppled: Array, chance: float) -> Array:
    """Least distance at which a rock still stands with a given chance, by magnitude.

    Straight in ln distance between the distances tried; the chance of toppling is made not to rise
    with distance.

    Parameters
    ----------
    distances : ndarray, shape (n,) [km], ascending
    toppled : ndarray, shape (magnitudes, n), chances of toppling
    chance : float, of standing

    Returns
    -------
    ndarray, shape (magnitudes,) [km]
        0 where it stands at the least distance tried, infinite where not even at the largest.
    """
    stands = np.maximum.accumulate(1.0 - toppled, axis=1)
    found = np.empty(len(stands))
    for i, row in enumerate(stands):
        if row[0] >= chance:
            found[i] = 0.0
        elif row[-1] < chance:
            found[i] = np.inf
        else:
            after = int(np.argmax(row >= chance))
            pair = slice(after - 1, after + 1)
            found[i] = np.exp(np.interp(chance, row[pair], np.log(distances[pair])))
    return found


def survival(chances: Array, rates: Array, ages: Array) -> Array:
    """Chance that a rock has stood through the earthquakes of some faults, by draw.

    What is unknown of the rock stays as it is in all earthquakes, and so does its age:
    S_m = E[exp(-T sum over faults of rate times P_m)].

    Parameters
    ----------
    chances : ndarray, shape (draws, faults), of toppling in one earthquake
    rates : ndarray, shape (faults,) [1/year], of earthquakes
    ages : ndarray, shape (n,) [year], equally likely

    Returns
    -------
    ndarray, shape (draws,)
    """
    toppling = (chances * rates).sum(axis=1)
    return np.asarray(np.exp(-np.outer(toppling, ages)).mean(axis=1))
