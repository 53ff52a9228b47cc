"""How often a year a rock would topple: one fragility in PGA, over a hazard curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from vsr_core.arrays import Array
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import RatioTable

Fragility = Callable[[Array], Array]
"""Probability of toppling at n peak ground accelerations [m/s^2]: of shape (n,), and it does not
fall with them, or in cells of PGV/PGA, of shape (cells, n)."""

PARTS = 128
"""Parts of an interval between two levels of a curve, equal in ln level."""


@dataclass(frozen=True, eq=False)
class Toppling:
    """Annual rate of toppling, and what the curve leaves open.

    Attributes
    ----------
    rate : float [1/year]
        Beyond the last level with the probability of toppling there.
    beyond : float [1/year], by how much it is larger if all that exceeds the last level topples
    below : float, probability of toppling at the first level: what is weaker is left out
    levels : ndarray, shape (m,) [m/s^2], of the parts that the rate is made of
    parts : ndarray, shape (m,) [1/year], the last of all that exceeds the last level
    """

    rate: float
    beyond: float
    below: float
    levels: Array
    parts: Array


def toppling(curve: HazardCurve, fragility: Fragility) -> Toppling:
    """Annual rate of earthquakes that topple a rock, nu = integral of P(a) (-d lambda(a)).

    References
    ----------
    Baker, Abrahamson, Whitney, Board & Hanks (2013), Bull. Seismol. Soc. Am. 103(3).
    """
    x = np.log(curve.levels)
    fine = np.interp(np.arange((len(x) - 1) * PARTS + 1) / PARTS, np.arange(len(x)), x)
    rates = np.exp(np.interp(fine, x, np.log(curve.rates)))
    middles = np.exp(0.5 * (fine[1:] + fine[:-1]))
    parts = fragility(middles) * -np.diff(rates)
    first, last = fragility(curve.levels[[0, -1]])
    ends = np.append(parts, last * curve.rates[-1])
    return Toppling(
        float(ends.sum()),
        float((1.0 - last) * curve.rates[-1]),
        float(first),
        np.append(middles, curve.levels[-1]),
        ends,
    )


def any_of(fragilities: Sequence[Fragility]) -> Fragility:
    """Probability that one or more of several rocks topple in the same shaking.

    Given the shaking they topple independently; that it is the same shaking joins them.
    """

    def together(level: Array) -> Array:
        stands = np.ones_like(level)
        for fragility in fragilities:
            stands = stands * (1.0 - fragility(level))
        return 1.0 - stands

    return together


RowFragility = Callable[[Array], Array]
"""Probability of toppling of each row of PGV/PGA, shape (rows, n), at n accelerations [m/s^2]."""

FINEST = 1.005
"""Factor between accelerations at which an average is computed."""


def lognormal_rows(medians: Array, betas: Array) -> RowFragility:
    """Rows of lognormal fragilities, the mean over directions: a rock does not choose from where.

    Parameters
    ----------
    medians, betas : ndarray, shape (directions, rows)
        Of Phi(ln(PGA / median) / beta), medians in m/s^2, infinite where nothing topples it and 0
        where all does.
    """
    with np.errstate(divide="ignore"):  # ln 0
        ln_medians = np.log(medians)[..., None]

    def rows(level: Array) -> Array:
        off = np.log(level) - ln_medians
        return ndtr(off / betas[..., None]).mean(axis=0)

    return rows


def continued_rows(rows: RowFragility, tried: Array, beyond: RowFragility) -> RowFragility:
    """Rows that go on as others do beyond the levels that were tried.

    What stands at the last level falls beyond it with the chance that the others have for what
    stands there; below the first level what falls is by as much rarer as it is there.

    Parameters
    ----------
    tried : ndarray, shape (2,) [m/s^2], the first and the last level
    """
    first, last = beyond(tried).T[:, :, None]

    def all_rows(level: Array) -> Array:
        inner, outer = rows(np.clip(level, *tried)), beyond(level)
        stand = np.divide(1.0 - outer, 1.0 - last, out=np.ones_like(outer), where=last < 1.0)
        rarer = np.divide(outer, first, out=np.ones_like(outer), where=first > 0.0)
        above = 1.0 - (1.0 - inner) * np.minimum(stand, 1.0)
        return np.where(level > tried[1], above, inner * np.minimum(rarer, 1.0))

    return all_rows


def averaged(rows: RowFragility, ratios: Array, table: RatioTable, levels: Array) -> Fragility:
    """Probability of toppling given PGA alone.

    PGV/PGA is lognormal at each PGA, and each row stands for the values nearer to its own than to
    another's, in logarithms. The result is made not to fall.

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s], ascending, PGV/PGA of the rows
    levels : ndarray, shape (2,) [m/s^2], accelerations between which it is wanted

    Returns
    -------
    Fragility, between the levels; beyond them with their values
    """
    at = points(levels)
    return summed(at, row_shares(ratios, *table.at(at)), rows(at))


def points(levels: Array) -> Array:
    """Accelerations at which an average is computed, shape (n,), equally far apart in logarithm."""
    number = 2 + int(np.log(levels[1] / levels[0]) / np.log(FINEST))
    return np.geomspace(levels[0], levels[1], number)


def summed(at: Array, shares: Array, chances: Array) -> Fragility:
    """Probability of toppling of which rows have shares, made not to fall.

    Parameters
    ----------
    at : ndarray, shape (n,) [m/s^2], ascending; beyond them it is as at the ends
    shares, chances : ndarray, shape (rows, n)
    """
    x, chance = np.log(at), np.maximum.accumulate((shares * chances).sum(axis=0))

    def fragility(level: Array) -> Array:
        return np.interp(np.log(level), x, chance)

    return fragility


def borders_of(ratios: Array) -> Array:
    """Borders between rows of PGV/PGA, each of which stands for what is nearest to it [s]."""
    return np.sqrt(ratios[1:] * ratios[:-1])


MOVED = 0.1
"""Part of the gap between rows by which rows are moved to see what their places do. Where a
boundary falls as 1/(PGV/PGA), and rates as PGA^-k, rows of a factor q are as if they lay
ln(sinh(x) / x) / 2x of the way off, x = k ln(q) / 2: 0.07 for 2.5 and 2, 0.10 for 3.7 and 2."""


def moved(ratios: Array, part: float) -> Array:
    """Rows of PGV/PGA moved a part of the wider gap beside each, in logarithms; in their order.

    So rows in pairs, which every second of them leaves as they are, are moved as the pairs lie.

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s], ascending
    part : float, to longer ones where it is above 0

    Examples
    --------
    >>> moved(np.array([0.1, 0.2, 0.8]), 0.5).round(3).tolist()
    [0.2, 0.4, 1.6]
    >>> moved(np.array([0.1, 0.8, 0.81]), -0.5).round(3).tolist()
    [0.035, 0.283, 0.286]
    """
    if len(ratios) < 2:
        return ratios
    gaps = np.diff(np.log(ratios))
    wider = np.maximum(np.append(gaps[0], gaps), np.append(gaps, gaps[-1]))
    wider[[0, -1]] = wider[:2].max(), wider[-2:].max()  # of a pair at an end, that beyond it
    rows = ratios * np.exp(part * wider)
    if part > 0.0:
        return np.asarray(np.maximum.accumulate(rows))
    return np.asarray(np.minimum.accumulate(rows[::-1])[::-1])


def row_shares(ratios: Array, medians: Array, log_sds: Array) -> Array:
    """Share of a lognormal PGV/PGA that each row of a grid stands for.

    Parameters
    ----------
    ratios : ndarray, shape (rows,) [s], ascending
    medians : ndarray, shape (n,) [s]
    log_sds : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (rows, n), columns sum to 1
    """
    return shares_between(borders_of(ratios), medians, log_sds)


def shares_between(borders: Array, medians: Array, log_sds: Array) -> Array:
    """The same of cells between borders, shape (cells - 1,) [s], ascending."""
    ends = np.concatenate([[-np.inf], np.log(borders), [np.inf]])
    return np.diff(ndtr((ends[:, None] - np.log(medians)) / log_sds), axis=0)


def rate_by_row(
    curve: HazardCurve, fragility: Fragility, rows: RowFragility, ratios: Array, table: RatioTable
) -> tuple[Array, Array]:
    """Which PGA and which PGV/PGA the earthquakes have that topple a rock.

    Returns
    -------
    levels : ndarray, shape (m,) [m/s^2]
    rates : ndarray, shape (rows, m) [1/year], whose sum is the rate of toppling
    """
    whole = toppling(curve, fragility)
    parts = row_shares(ratios, *table.at(whole.levels)) * rows(whole.levels)
    total = parts.sum(axis=0)
    return whole.levels, whole.parts * np.divide(
        parts, total, out=np.zeros_like(parts), where=total > 0.0
    )
