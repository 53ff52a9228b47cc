"""The overturning boundary read off the grid: its intervals, balanced islands, toppled clusters.

The first-overturning PGA of a row is the geometric middle of the interval that brackets it, from
the last PGA that leaves the rock standing to the first that topples it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.cells import outcomes
from vsr_core.fragility.result import Boundary


def locate(pga: npt.ArrayLike, overturned: npt.ArrayLike) -> Boundary:
    """Locate the first-overturning PGA of each row and what disturbs a single boundary.

    Parameters
    ----------
    pga : array_like, shape (n_pga,) [g]
        Increasing.
    overturned : array_like, shape (n_ratio, n_pga)
        1, 0, or NaN / -1 for undecided. Undecided cells are passed over, which widens the
        interval around them.

    Examples
    --------
    >>> found = locate([0.1, 0.2, 0.3, 0.4], [[0, 1, 0, 1], [0, 0, -1, 0]])
    >>> found.lower, found.upper, found.pga.round(3), found.islands
    (array([0.1, 0.4]), array([0.2, inf]), array([0.141,   inf]), array([1, 0]))
    """
    grid = outcomes(overturned)
    lower, upper = interval(pga, grid)
    return Boundary(
        pga=middle(pga, lower, upper),
        lower=lower,
        upper=upper,
        censored=np.isinf(upper),
        islands=((grid == 0) & (np.asarray(pga) > upper[:, None])).sum(axis=1),
        cluster_sizes=_toppled_clusters(grid),
    )


def interval(pga: npt.ArrayLike, overturned: npt.ArrayLike) -> tuple[Array, Array]:
    """Last PGA that leaves the rock standing and first that topples it.

    Parameters
    ----------
    pga : array_like, shape (n_pga,) [g]
        Increasing.
    overturned : array_like, shape (..., n_pga)
        1 toppled, 0 stood; all else is passed over.

    Returns
    -------
    lower, upper : ndarray, shape (...) [g]
        See `Boundary`.
    """
    levels, grid = np.asarray(pga, dtype=np.float64), np.asarray(overturned)
    upper = np.where(grid == 1, levels, np.inf).min(axis=-1)
    below = (grid == 0) & (levels < upper[..., None])
    lower = np.where(below, levels, -np.inf).max(axis=-1)
    stood = np.isfinite(lower)
    return np.where(stood, lower, np.nan), np.where(stood | np.isfinite(upper), upper, np.nan)


def middle(pga: npt.ArrayLike, lower: Array, upper: Array) -> Array:
    """First-overturning PGA: the geometric middle of its interval.

    Parameters
    ----------
    pga : array_like, shape (n_pga,) [g]
        Increasing, positive. Where its lowest value topples, the interval is taken to begin one
        step lower, as wide as the first one in the logarithm.
    lower, upper : ndarray, shape (...) [g]
        As `interval` gives them.
    """
    levels = np.asarray(pga, dtype=np.float64)
    beneath = levels[0] ** 2 / levels[1] if levels.size > 1 else 0.5 * levels[0]
    return np.asarray(np.sqrt(np.where(np.isnan(lower), beneath, lower) * upper))


def first_crossing(ln_pga: Array, margin: Array) -> Array:
    """Smallest PGA at which a curve sampled on the grid rises to a level.

    Parameters
    ----------
    ln_pga : ndarray, shape (n_pga,) [ln g]
    margin : ndarray, shape (..., n_pga)
        logit P minus the logit of the level; linear in ln PGA between the samples.

    Returns
    -------
    ndarray, shape (...) [g]
        0 when the first sample is already at the level, inf when none is.

    Examples
    --------
    >>> first_crossing(np.log([1.0, 2.0, 4.0]), np.array([[-1.0, 0.0, 1.0], [-2.0, -1.0, -0.5]]))
    array([ 2., inf])
    """
    reached = margin >= 0
    after = np.maximum(reached.argmax(axis=-1), 1)[..., None]
    if margin.shape[-1] == 1:
        return np.where(reached[..., 0], 0.0, np.inf)
    high = np.take_along_axis(margin, after, axis=-1)[..., 0]
    low = np.take_along_axis(margin, after - 1, axis=-1)[..., 0]
    right, left = ln_pga[after[..., 0]], ln_pga[after[..., 0] - 1]
    # the slope is only used where the curve crosses; elsewhere any finite number will do
    rise = np.where((low < 0) & (high >= 0), high - low, 1.0)
    crossing = np.exp(left - low / rise * (right - left), where=rise > 0, out=np.zeros_like(low))
    crossing = np.where(reached.any(axis=-1), crossing, np.inf)
    return np.where(reached[..., 0], 0.0, crossing)


def _toppled_clusters(grid: Array) -> Indices:
    """Cells in each group of toppled cells that balanced cells separate.

    Cells touching at a corner belong together: a slanted boundary on a grid is a staircase.
    An undecided cell joins its neighbours, so that only balanced cells separate.
    """
    joined, _ = ndimage.label(grid != 0, structure=np.ones((3, 3)))
    sizes = np.bincount(joined[grid == 1])
    return sizes[sizes > 0]
