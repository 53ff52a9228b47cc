"""Where the boundary of a draw is expected: from other draws, and from its own rows."""

from __future__ import annotations

import math

import numpy as np

from vsr_core.arrays import Array, Indices
from vsr_core.rock.hull import Hull
from vsr_core.rock.tipping import tipping

EVERY = 5
"""Rows apart from which a draw's own boundary is searched first, to guide its other rows."""


def scales(hull: Hull, yaw: Array) -> Array:
    """Static scales of the boundary: what topples the rock steadily, to either side of the shaking.

    A boundary of slow motions moves with them. Which of them goes best with the draws done so far
    is told by `offsets`.

    Parameters
    ----------
    hull : Hull, of the rock in its rest pose
    yaw : ndarray, shape (k,) [rad]

    Returns
    -------
    ndarray, shape (4, k) [ln g]: nothing, the side that a pulse pushes the rock to first, the
    """
    both = tipping(hull, np.concatenate([math.pi - yaw, -yaw])).overturning
    first, other = np.log(both).reshape(2, -1)
    return np.stack([np.zeros(len(yaw)), first, other, 0.5 * (first + other)])


def offsets(boundaries: Array, scale: Array) -> tuple[Indices, Array]:
    """Which scale the boundaries of draws go with best in each direction, and how far they are off.

    Parameters
    ----------
    boundaries : ndarray, shape (draws, yaws, rows) [ln g], finite
    scale : ndarray, shape (draws, 4, yaws), as `scales` gives it

    Returns
    -------
    chosen : ndarray of int, shape (yaws,)
    offset : ndarray, shape (yaws, rows), median of the boundaries less that scale
    """
    apart = boundaries[:, None] - scale[..., None]
    chosen = apart.std(axis=0).mean(axis=-1).argmin(axis=0)
    offset = np.median(apart, axis=0)[chosen, np.arange(len(chosen))]
    return chosen, np.asarray(offset)


def first_rows(count: int, *, ordered: bool) -> Indices:
    """Rows that are searched first: all of those that no order joins, else some of them.

    Parameters
    ----------
    ordered : bool, whether neighbouring rows are alike, as pulses are and records are not
    """
    if not ordered:
        return np.arange(count)
    return np.unique(np.append(np.arange(0, count, EVERY), count - 1))


def from_own_rows(expected: Array, found: Array, rows: Indices) -> Array:
    """Expectation of all rows, moved to where the boundary was found in some.

    Parameters
    ----------
    expected : ndarray, shape (..., rows) [ln g]
    found : ndarray, shape (..., k) [ln g], finite
    rows : ndarray of int, shape (k,), ascending

    Returns
    -------
    ndarray, shape (..., rows) [ln g]
    """
    every = np.arange(expected.shape[-1])
    weights = np.array([np.interp(every, rows, one) for one in np.eye(len(rows))])
    return np.asarray(expected + (found - expected[..., rows]) @ weights)
