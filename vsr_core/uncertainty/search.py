"""At which PGA to run a draw next, so that its first overturning is bracketed with few runs.

A level is one direction and one row of motions of a draw. Its first overturning is expected where
those of the draws before lie, shifted by the acceleration that topples each rock steadily, and by
how far the levels of the same draw that are found are from where they were expected; and straight
between these levels. The nearer either was in draws before, the more it counts. A run parts
the bracket where what is expected is as likely above as below, until upper over lower end is as
asked for. What lies below the bracket is taken to stand, and what lies above it to topple. A run
that is unresolved guides the search as if the rock stood, and is no end of a bracket.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array, Indices
from vsr_core.fragility.bisection import Known
from vsr_core.rock.body import Hull
from vsr_core.rock.tipping import tipping

UNSURE = (0.1, 0.03)
"""How far the first row, and the others, are expected to be off before any draw is found [ln g]."""

SURE = 0.25
"""Share of a bracket's width that an expectation is never taken to be nearer than."""

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
    ndarray, shape (5, k) [ln g]: the lesser of both sides, the side that a pulse pushes the rock to
        first, the other side, their mean, and nothing
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
    """The five scales, of the accelerations that topple to either side, shape (2 n,) [g]."""
    first, other = np.log(tipping).reshape(2, -1)
    nothing = np.zeros(len(first))
    return np.stack([np.minimum(first, other), first, other, 0.5 * (first + other), nothing])


def offsets(boundaries: Array, scale: Array) -> tuple[Indices, Array]:
    """Which scale the boundaries of draws go with best in each direction, and how far they are off.

    Those of one draw go with all alike, and the first is taken.

    Parameters
    ----------
    boundaries : ndarray, shape (draws, yaws, rows) [ln g], finite
    scale : ndarray, shape (draws, 5, yaws), as `scales` gives it

    Returns
    -------
    chosen : ndarray of int, shape (yaws,)
    offset : ndarray, shape (yaws, rows), median of the boundaries less that scale
    """
    apart = boundaries[:, None] - scale[..., None]
    chosen = apart.std(axis=0).mean(axis=-1).argmin(axis=0)
    offset = np.median(apart, axis=0)[chosen, np.arange(len(chosen))]
    return chosen, np.asarray(offset)


def from_others(boundaries: Array, scale: Array, own: Array) -> Array:
    """Where the boundaries of further draws are expected.

    Parameters
    ----------
    boundaries, scale : ndarray, of the draws that are known, as for `offsets`
    own : ndarray, shape (further draws, 5, yaws), their scales

    Returns
    -------
    ndarray, shape (further draws, yaws, rows) [ln g]
    """
    chosen, offset = offsets(boundaries, scale)
    base = np.take_along_axis(own, chosen[None, None], axis=1)[:, 0]
    return np.asarray(base[..., None] + offset)


def stages(count: int, *, ordered: bool) -> list[Indices]:
    """Rows that are searched together: all of those that no order joins, else some, then between.

    Parameters
    ----------
    ordered : bool, whether neighbouring rows are alike, as pulses are and records are not

    Examples
    --------
    >>> [rows.tolist() for rows in stages(7, ordered=True)]
    [[3], [1, 5], [0, 2, 4, 6]]
    """
    if not ordered:
        return [np.arange(count)]
    number = np.arange(1, count + 1)
    apart = number & -number  # the largest power of two that parts it
    return [np.flatnonzero(apart == stride) for stride in np.unique(apart)[::-1]]


def together(ways: Array, off: Array) -> tuple[Array, Array]:
    """Where the boundary is expected by several ways, and how far that is off.

    Parameters
    ----------
    ways : ndarray, shape (ways, ..., rows) [ln g]
    off : ndarray, shape (ways, rows) [ln g], how far each was in the draws before, above 0

    Returns
    -------
    expected : ndarray, shape (..., rows) [ln g]
    scale : ndarray, shape (rows,) [ln g]
    """
    weight = off**-2.0 / (off**-2.0).sum(axis=0)
    return np.asarray(np.einsum("k...r,kr->...r", ways, weight)), off.min(axis=0)


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


def next_ln_pga(lower: Array, upper: Array, expected: Array, scale: Array, width: float) -> Array:
    """Where to part brackets: as likely above as below, in Student's distribution of 2 degrees.

    Its tails make the steps double that leave a wrong expectation behind. No part is made narrower
    than asked for where the other would stay wider.

    Parameters
    ----------
    lower, upper : ndarray, shape (n,) [ln g], infinite where no run has stood, or toppled
    expected, scale : ndarray, shape (n,) [ln g]
    width : float, of a bracket as asked for [ln g]

    Examples
    --------
    >>> next_ln_pga(*np.array([[-np.inf, 0.0], [np.inf] * 2, [0.3, 0.0], [0.1] * 2]), 0.2).round(2)
    array([0.3, 0.2])
    """
    low, high = ((end - expected) / scale for end in (lower, upper))
    chance = 0.5 * (_share(low) + _share(high))
    sought = expected + scale * chance * np.sqrt(2.0 / (1.0 - chance**2))
    inner = [lower + width, upper - width]
    return np.asarray(np.clip(sought, np.minimum(*inner), np.maximum(*inner)))


def _share(z: Array) -> Array:
    """Student's distribution of 2 degrees, less its part below 0, from -1 to 1."""
    finite = np.where(np.isinf(z), 0.0, z)
    return np.where(np.isinf(z), np.sign(z), finite / np.sqrt(2.0 + finite**2))


def rounded(pga: Array, width: float) -> Array:
    """PGA to as many binary digits as a bracket needs: the last ones differ between processors.

    Parameters
    ----------
    width : float, of a bracket [ln g], of which it moves by a sixty-fourth or less
    """
    mantissa, exponent = np.frexp(pga)
    digit = 2.0 ** np.floor(np.log2(width / 64.0))
    return np.asarray(np.ldexp(np.round(mantissa / digit) * digit, exponent))


@dataclass(eq=False)
class Brackets:
    """Brackets of the first overturning of some levels, narrowed by each round of runs.

    Attributes
    ----------
    expected, scale : ndarray, shape (n,) [ln g], where it is expected, and how far off
    width : float, of a bracket [ln g]
    bounds : tuple of float [g], between which it is looked for
    """

    expected: Array
    scale: Array
    width: float
    bounds: tuple[float, float]

    def __post_init__(self) -> None:
        count = len(self.expected)
        self.lower, self.upper = np.full(count, -np.inf), np.full(count, np.inf)
        nothing = np.zeros(0, dtype=np.int64)
        self.known = Known(nothing, np.zeros(0), nothing.astype(np.int8))

    def next_runs(self) -> tuple[Indices, Array]:
        """Levels and PGA [g] of the next round; none once all are found."""
        least, most = np.log(self.bounds)
        wide = self.upper - self.lower > self.width
        level = np.flatnonzero(wide & (self.lower < most) & (self.upper > least))
        ends = (self.lower[level], self.upper[level], self.expected[level], self.scale[level])
        sought = np.exp(next_ln_pga(*ends, self.width * (1.0 - 1.0 / 32.0)))
        return level, np.clip(rounded(sought, self.width), *self.bounds)

    def add(self, level: Indices, pga: Array, side: NDArray[np.int8]) -> None:
        """Take in what came of a round."""
        fell, at = side == 1, np.log(pga)
        self.upper[level[fell]] = at[fell]
        self.lower[level[~fell]] = at[~fell]
        self.known = self.known.joined(level, pga, side)
