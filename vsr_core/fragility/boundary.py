"""A grid of outcomes as a table of counts, and the overturning boundary read off it.

The first-overturning PGA of a row is the geometric middle of the interval that brackets it, from
the last PGA that leaves the rock standing to the first that topples it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput


@dataclass(frozen=True)
class Cells:
    """Counts of runs on the product of PGV/PGA and PGA values.

    Attributes
    ----------
    ln_pga : ndarray, shape (n_pga,) [ln g]
    ln_ratio : ndarray, shape (n_ratio,) [ln s]
    toppled, trials : ndarray, shape (n_ratio, n_pga)
        Overturned and decided runs of each cell; trials is 0 where nothing was decided.
    """

    ln_pga: Array
    ln_ratio: Array
    toppled: Array
    trials: Array

    @property
    def usable(self) -> Mask:
        """Rows with at least one decided run, shape (n_ratio,)."""
        return self.trials.sum(axis=1) > 0

    @property
    def varied(self) -> bool:
        """Whether both outcomes occur."""
        return 0 < self.toppled.sum() < self.trials.sum()


def outcomes(overturned: npt.ArrayLike) -> Array:
    """Outcomes as 1.0, 0.0 and NaN.

    Raises
    ------
    InvalidInput
        For any other value.

    Examples
    --------
    >>> outcomes([1, 0, -1])
    array([ 1.,  0., nan])
    """
    array = np.array(overturned, dtype=np.float64)
    array[array == -1] = np.nan
    if not np.isin(array[~np.isnan(array)], (0.0, 1.0)).all():
        given = "overturned holds values other than 0, 1, -1 and NaN"
        rule = "a run overturned (1), did not (0) or is undecided (-1 or NaN)"
        raise InvalidInput(given, rule, "pass the variable `overturned` of the responses")
    return array


def counted(pga: npt.ArrayLike, pgv_pga: npt.ArrayLike, overturned: npt.ArrayLike) -> Cells:
    """Count the runs of a grid with one run in each cell.

    Parameters
    ----------
    pga : array_like, shape (n_pga,) [g]
        Positive, strictly increasing.
    pgv_pga : array_like, shape (n_ratio,) [s]
        Positive, not decreasing: two records may have the same.
    overturned : array_like, shape (n_ratio, n_pga)
        1, 0, or NaN / -1 for an undecided run, which adds no trial.

    Raises
    ------
    InvalidInput
        If an axis or the shape does not fit, or no run is decided.
    """
    columns, rows = _axis(pga, "pga"), _axis(pgv_pga, "pgv_pga", ties=True)
    grid = outcomes(overturned)
    if grid.shape != (rows.size, columns.size):
        given = f"overturned of shape {grid.shape} for {rows.size} PGV/PGA and {columns.size} PGA"
        raise InvalidInput(given, "its shape is (n_ratio, n_pga)", "transpose or reshape it")
    decided = ~np.isnan(grid)
    if not decided.any():
        raise InvalidInput(
            "no decided run", "a fit needs at least one outcome", "check the runs' outcome codes"
        )
    toppled = np.where(decided, grid, 0.0)
    return Cells(np.log(columns), np.log(rows), toppled, decided.astype(np.float64))


def _axis(values: npt.ArrayLike, name: str, *, ties: bool = False) -> Array:
    axis = np.asarray(values, dtype=np.float64)
    if not (np.isfinite(axis) & (axis > 0)).all():
        given = f"{name} holds values that are not finite and above 0"
        rule = "fragility is fitted in ln PGA and ln PGV/PGA"
        raise InvalidInput(given, rule, f"leave such runs out or correct {name}")
    steps = np.diff(axis) if axis.ndim == 1 and axis.size else np.zeros(1)
    if (steps < 0.0).any() or not (ties or steps.all()) or axis.ndim != 1 or not axis.size:
        given = f"{name} of shape {axis.shape} that is not one strictly increasing axis"
        rule = "the grid's axes increase"
        raise InvalidInput(given, rule, f"sort the grid along {name} and merge repeated values")
    return axis


@dataclass(frozen=True)
class Boundary:
    """First-overturning PGA of each PGV/PGA row, read off the grid without a model.

    Attributes
    ----------
    pga : ndarray, shape (n_ratio,) [g]
        Geometric middle of the interval; inf in a row that never topples, NaN in a row without
        decided cells.
    lower : ndarray, shape (n_ratio,) [g]
        Largest balanced PGA below the first overturned one. NaN when the first decided cell
        already overturned. In a censored row: the largest balanced PGA.
    upper : ndarray, shape (n_ratio,) [g]
        First overturned PGA; inf in a row that never topples, NaN in a row without decided cells.
    censored : ndarray of bool, shape (n_ratio,)
        The row has decided cells and none overturned: the boundary lies above the grid.
    islands : ndarray of int, shape (n_ratio,)
        Balanced cells above the first overturned one.
    cluster_sizes : ndarray of int, shape (n_clusters,)
        Cells in each group of toppled cells that balanced cells separate from the others.
    """

    pga: Array
    lower: Array
    upper: Array
    censored: Mask
    islands: Indices
    cluster_sizes: Indices


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
