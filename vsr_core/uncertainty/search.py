"""Which cells of a draw's grid to run, so that its boundary is found with few of them.

A table holds the outcomes of one draw on (row, PGA), rows one below the other: 1 overturned, 0 not,
-1 unresolved, `UNKNOWN` not run. In each row the boundary is searched from where it is
expected, by steps that double and then by halving, until a cell that stands is next to one that
topples. In a row that may be ragged, cells are run on above it until `CALM` in a row topple, and
`CALM_BELOW` below it. What is then unknown is taken to topple above the first cell that toppled,
and to stand below. A cell unresolved guides the search as if it stood, and stays without.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.rock.body import Hull
from vsr_core.rock.tipping import tipping

EVERY = 5
"""Rows apart from which a draw's own boundary is searched first, to guide its other rows."""

GUIDES = (1e-3, 1e2)
"""Ends of the static accelerations of a rock on points [g], where an edge lies above its weight."""


def scales(hull: Hull, yaw: Array) -> Array:
    """Static scales of the boundary: what topples the rock steadily, to either side of the shaking.

    A boundary of slow motions moves with them. Which of them goes best with the draws done so far
    is found by `offsets`.

    Parameters
    ----------
    hull : Hull, of the rock in its rest pose
    yaw : ndarray, shape (k,) [rad]

    Returns
    -------
    ndarray, shape (4, k) [ln g]: nothing, the side that a pulse pushes the rock to first, the
        other side, and their mean
    """
    return _both_ways(tipping(hull, np.concatenate([math.pi - yaw, -yaw])).overturning)


def scales_on(points: Array, yaw: Array) -> Array:
    """The same of a rock on some points, as ``tipping_on`` has it."""
    return _both_ways(tipping_on(points, np.concatenate([math.pi - yaw, -yaw])))


def tipping_on(points: Array, direction: Array) -> Array:
    """Steady acceleration that tips a rock on some points about an edge between two of them [g].

    Points may lie at any height, and nothing else holds the rock.

    Parameters
    ----------
    points : ndarray, shape (k, 3) [m], from the centre of mass, around which they are
    direction : ndarray, shape (n,) [rad], in which the rock tips, counter-clockwise from +x

    Returns
    -------
    ndarray, shape (n,), within ``GUIDES``
    """
    corners = points[ConvexHull(points[:, :2]).vertices]
    edges = np.roll(corners, -1, axis=0) - corners
    ways = np.column_stack([np.cos(direction), np.sin(direction), np.zeros(len(direction))])
    # moments about each edge of the weight and of a push of 1 g at the centre of mass
    weight = np.einsum("ij,ij->i", np.cross(corners, [0.0, 0.0, 1.0]), edges)
    push = np.einsum("kij,ij->ki", np.cross(-corners, ways[:, None]), edges)
    needed = np.where(push > 0.0, -weight / np.where(push > 0.0, push, 1.0), np.inf)
    return np.asarray(np.clip(needed.min(axis=1), *GUIDES))


def _both_ways(tipping: Array) -> Array:
    """The four scales, of the accelerations that topple to either side, shape (2 n,) [g]."""
    first, other = np.log(tipping).reshape(2, -1)
    return np.stack([np.zeros(len(first)), first, other, 0.5 * (first + other)])


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


Table = NDArray[np.int8]

UNKNOWN = -2
"""Outcome of a cell that was not run."""

CALM, CALM_BELOW = 2, 1
"""Toppled cells above, and standing ones below, between which the cells of a ragged row are run."""


def first_toppled(table: Table) -> Indices:
    """Column of the lowest PGA that is known to topple, in each row.

    Parameters
    ----------
    table : ndarray of int, shape (..., n)

    Returns
    -------
    ndarray of int, shape (...), n where none is known

    Examples
    --------
    >>> first_toppled(np.array([[0, -2, 1, 1], [0, 0, -2, -2]], np.int8)).tolist()
    [2, 4]
    """
    fell = table == 1
    return np.where(fell.any(axis=-1), fell.argmax(axis=-1), table.shape[-1])


def ragged(table: Table) -> Mask:
    """Rows in which a cell stands above one that topples.

    Parameters
    ----------
    table : ndarray of int, shape (..., n)

    Returns
    -------
    ndarray of bool, shape (...)
    """
    above = np.arange(table.shape[-1]) > first_toppled(table)[..., None]
    return np.asarray(((table == 0) & above).any(axis=-1))


def next_cells(table: Table, expected: Indices, may_be_ragged: Mask) -> Mask:
    """Cells to run next; none once the boundary is found in all rows.

    Parameters
    ----------
    table : ndarray of int, shape (rows, n)
    expected : ndarray of int, shape (rows,), column at which each row is expected to topple first
    may_be_ragged : ndarray of bool, shape (rows,)

    Returns
    -------
    ndarray of bool, shape (rows, n)
    """
    number, column = table.shape[1], np.arange(table.shape[1])
    first = first_toppled(table)
    stands = ((table == 0) | (table == -1)) & (column < first[:, None])
    has_stood, has_fallen = stands.any(axis=1), first < number
    last = _last(stands)
    lowest = np.where(has_stood, np.maximum(stands.argmax(axis=1), expected - 1), 0)
    highest = np.where(has_fallen, _last(table == 1), number)
    up = np.maximum(last + 1 + 2 * np.maximum(last - lowest, 0), expected)
    down = first - 1 - 2 * (highest - first)
    probe = np.select(
        [has_stood & has_fallen, has_fallen, has_stood],
        [(first + last) // 2, np.maximum(down, 0), np.minimum(up, number - 1)],
        np.clip(expected, 0, number - 1),
    )
    found = first - last == 1
    ask = (column == probe[:, None]) & ~found[:, None]
    calm = np.maximum(_last(table == 0), first - 1)[:, None]
    near = ((column > calm) & (column <= calm + CALM)) | (
        (column < first[:, None]) & (column >= first[:, None] - CALM_BELOW)
    )
    ask |= near & (found & may_be_ragged)[:, None]
    return ask & (table == UNKNOWN)


def _last(cells: Mask) -> Indices:
    """Column of the last of some cells in each row, -1 where there is none."""
    return np.where(cells.any(axis=1), cells.shape[1] - 1 - cells[:, ::-1].argmax(axis=1), -1)


def completed(table: Table) -> Table:
    """Outcomes of all cells: those not run as the rule of this module takes them.

    Parameters
    ----------
    table : ndarray of int, shape (..., n)

    Returns
    -------
    ndarray of int, shape (..., n)
    """
    above = np.arange(table.shape[-1]) > first_toppled(table)[..., None]
    return np.where(table == UNKNOWN, above, table).astype(np.int8)


def expected_columns(ln_boundary: Array, ln_pga: Array) -> Indices:
    """Columns at which rows topple first, by where their boundary is expected.

    Parameters
    ----------
    ln_boundary : ndarray, shape (...) [ln g]
    ln_pga : ndarray, shape (n,) [ln g], ascending

    Returns
    -------
    ndarray of int, shape (...), 0 to n
    """
    return np.searchsorted(ln_pga, ln_boundary)
