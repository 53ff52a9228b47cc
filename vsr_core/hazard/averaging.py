"""One fragility in peak ground acceleration, from those of all directions and all PGV/PGA."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import ndtr

from vsr_core.arrays import Array
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.toppling import Fragility

Ratio = Callable[[Array], Array]
"""Median PGV/PGA [s] at peak ground accelerations [m/s^2]."""

FINEST = 1.02
"""Factor between accelerations at which an average is computed."""


def averaged(
    medians: Array, betas: Array, ratios: Array, ratio: Ratio, log_sd: float, levels: Array
) -> Fragility:
    """Probability of toppling given PGA alone.

    A rock does not choose where shaking comes from: all directions count equally. PGV/PGA is
    lognormal about ``ratio`` at each PGA, and each row of fragilities stands for the values nearer
    to its own than to another's, in logarithms. The result is made not to fall.

    Parameters
    ----------
    medians, betas : ndarray, shape (directions, rows)
        Of lognormal fragilities Phi(ln(PGA / median) / beta), medians in m/s^2.
    ratios : ndarray, shape (rows,) [s], ascending, PGV/PGA of the rows
    ratio : Ratio
    log_sd : float, standard deviation of ln PGV/PGA at a PGA
    levels : ndarray, shape (2,) [m/s^2], accelerations between which it is wanted

    Returns
    -------
    Fragility, between the levels; beyond them with their values
    """
    number = 2 + int(np.log(levels[1] / levels[0]) / np.log(FINEST))
    at = np.geomspace(levels[0], levels[1], number)
    shares = row_shares(ratios, ratio(at), log_sd)
    topples = ndtr(np.log(at / medians[..., None]) / betas[..., None]).mean(axis=0)
    chance = np.maximum.accumulate((shares * topples).sum(axis=0))

    def fragility(level: Array) -> Array:
        return np.interp(np.log(level), np.log(at), chance)

    return fragility


def row_shares(ratios: Array, medians: Array, log_sd: float) -> Array:
    """Share of a lognormal PGV/PGA that each row of a grid stands for.

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s], ascending
    medians : ndarray, shape (n,) [s]
    log_sd : float

    Returns
    -------
    ndarray, shape (rows, n), columns sum to 1
    """
    x = np.log(ratios)
    borders = np.concatenate([[-np.inf], 0.5 * (x[1:] + x[:-1]), [np.inf]])
    below = ndtr((borders[:, None] - np.log(medians)) / log_sd)
    return np.diff(below, axis=0)


def ratio_of_curves(pga: HazardCurve, pgv: HazardCurve) -> Ratio:
    """PGV/PGA where both are exceeded equally often, straight in logarithms of PGA.

    It is not the median of PGV given PGA: extremes of the two come together only in part, and so
    it is somewhat larger at rare levels.

    Parameters
    ----------
    pga, pgv : HazardCurve [m/s^2] and [m/s]

    Returns
    -------
    Ratio, beyond the rates of both with the first and the last value
    """
    velocities = np.array([pgv.level_at(rate) for rate in pga.rates])
    known = np.isfinite(velocities)
    x, y = np.log(pga.levels[known]), np.log(velocities[known] / pga.levels[known])

    def ratio(level: Array) -> Array:
        return np.exp(np.interp(np.log(level), x, y))

    return ratio
