"""The overturning boundary read off the grid: intervals, balanced islands, toppled clusters."""

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
    >>> found.lower, found.upper, found.islands
    (array([0.1, 0.4]), array([0.2, inf]), array([1, 0]))
    """
    levels = np.asarray(pga, dtype=np.float64)
    grid = outcomes(overturned)
    fell, stood = grid == 1, grid == 0
    any_fell, decided = fell.any(axis=1), (fell | stood).any(axis=1)
    first = np.where(any_fell, fell.argmax(axis=1), levels.size)
    column = np.arange(levels.size)
    below = stood & (column < first[:, None])
    last_below = levels.size - 1 - below[:, ::-1].argmax(axis=1)
    upper = np.where(any_fell, levels[np.minimum(first, levels.size - 1)], np.inf)
    return Boundary(
        lower=np.where(below.any(axis=1), levels[last_below], np.nan),
        upper=np.where(decided, upper, np.nan),
        censored=decided & ~any_fell,
        islands=(stood & (column > first[:, None])).sum(axis=1),
        cluster_sizes=_toppled_clusters(grid),
    )


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
