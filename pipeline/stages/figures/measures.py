"""Measures of overturning responses that several figures quote."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import xarray as xr

from vsr_core import GRAVITY
from vsr_core.arrays import Array, Mask
from vsr_core.fragility.boundary import locate
from vsr_core.run.rocking_block import Block, first_overturning_pga

_TRIED, _TOLERANCE = 100, 1e-3
"""Of the search on Housner's equation: PGAs tried up to the highest, and relative width."""


def grid(responses: xr.Dataset, yaw: float | None = None, friction: int = 0) -> Array:
    """Outcomes of one direction: 1 overturned, 0 not, -1 undecided.

    Parameters
    ----------
    yaw : float or None [degree], the first one if None

    Returns
    -------
    ndarray, shape (PGV/PGA, PGA)
    """
    place = 0 if yaw is None else responses["yaw"].values.tolist().index(yaw)
    outcomes: Array = responses["overturned"].values[place, friction]
    return outcomes


def toppled_share(outcomes: Array) -> float:
    """Share of the decided runs that overturned.

    >>> round(toppled_share(np.array([[1, 0], [-1, 0]])), 3)
    0.333
    """
    return _share((outcomes == 1)[outcomes >= 0])


def differing(one: Array, other: Array) -> float:
    """Share of the cells decided in both that end differently.

    >>> differing(np.array([1, 0, -1]), np.array([1, 1, 1]))
    0.5
    """
    both = (one >= 0) & (other >= 0)
    return _share((one != other)[both])


def _share(which: Mask) -> float:
    return float(which.mean()) if which.size else math.nan


def first_overturning(pga: Array, outcomes: Array) -> Array:
    """First-overturning PGA of each row.

    Parameters
    ----------
    pga : ndarray, shape (columns,) [g]
    outcomes : ndarray, shape (rows, columns)

    Returns
    -------
    ndarray, shape (rows,) [g]; nan where the row does not overturn
    """
    found = locate(pga, outcomes).pga
    return np.where(np.isfinite(found), found, np.nan)


def lower_in(one: Array, other: Array) -> float:
    """Share of the rows in which one boundary lies lower than another, or as low.

    Parameters
    ----------
    one, other : ndarray, shape (rows,) [g]
        Rows where neither is known do not count; an unknown one lies above the grid.
    """
    known = np.isfinite(one) | np.isfinite(other)
    return _share((np.nan_to_num(one, nan=np.inf) <= np.nan_to_num(other, nan=np.inf))[known])


def housner(width: float, height: float, ratios: Array, highest: float) -> Array:
    """First-overturning PGA of a block by Housner's equation.

    Parameters
    ----------
    width, height : float [m]
    ratios : ndarray, shape (rows,), PGV/PGA [s]
    highest : float [g], up to which is looked

    Returns
    -------
    ndarray, shape (rows,) [g]; nan where none is found
    """
    return np.array([_exact(width, height, float(ratio), float(highest)) for ratio in ratios])


@cache
def _exact(width: float, height: float, ratio: float, highest: float) -> float:
    block, top = Block(0.5 * width, 0.5 * height), highest * GRAVITY
    found = first_overturning_pga(block, ratio, top, top / _TRIED, _TOLERANCE)
    return found / GRAVITY if math.isfinite(found) else math.nan


def from_housner(responses: xr.Dataset, width: float, height: float) -> Array:
    """Relative distance of a block's first overturning from that by Housner's equation.

    Parameters
    ----------
    width, height : float [m]

    Returns
    -------
    ndarray, shape (rows in which both are known,)
    """
    pga, ratios = responses["pga"].values, responses["pgv_pga"].values
    first = first_overturning(pga, grid(responses))
    return apart(first, housner(width, height, ratios, pga[-1]))


def apart(boundary: Array, reference: Array) -> Array:
    """Relative difference of two boundaries in the rows where both are known.

    Parameters
    ----------
    boundary, reference : ndarray, shape (rows,) [g]

    Returns
    -------
    ndarray, shape (known rows,)
    """
    known: Mask = np.isfinite(boundary) & np.isfinite(reference)
    difference: Array = boundary[known] / reference[known] - 1.0
    return difference


def middle(differences: Array) -> float:
    """Median of the absolute values of differences."""
    return float(np.median(np.abs(differences))) if differences.size else math.nan
