"""Ground as a sheet of triangles over the plane, and functions of place that give it its shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import Delaunay, KDTree

from vsr_core.arrays import Array, Indices

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_WAVES = 16
_PLASTIC = 1.32471795724474602596  # its powers spread points over a square most evenly


def waves(place: Array, length: float, seed: int) -> Array:
    """Smooth noise of root mean square 1: plane waves spread in direction, length and phase.

    Parameters
    ----------
    place : ndarray, shape (..., 2) [m]
    length : float [m], of the longest wave; the shortest is half as long
    seed : int, another one gives other phases and directions

    Returns
    -------
    ndarray, shape (...)

    Examples
    --------
    >>> waves(np.zeros((5, 2)), 3.0, 0).shape
    (5,)
    """
    value = np.zeros(place.shape[:-1])
    for j in range(_WAVES):
        turn = (j + 0.37 * seed) * _GOLDEN_ANGLE
        number = 2.0 * math.pi / length * (1.0 + j / (_WAVES - 1))
        phase = (1.0 + j * j) * (1.7 + seed)
        along = math.cos(turn) * place[..., 0] + math.sin(turn) * place[..., 1]
        value += np.cos(number * along + phase)
    return value * math.sqrt(2.0 / _WAVES)


def rough(place: Array, longest: float, octaves: int, seed: int) -> Array:
    """Noise like that of broken rock, each octave half as long and half as high as the last.

    Parameters
    ----------
    place : ndarray, shape (..., 2) [m]
    longest : float [m], of the longest wave of the first octave, whose root mean square is 1

    Returns
    -------
    ndarray, shape (...)
    """
    value = np.zeros(place.shape[:-1])
    for k in range(octaves):
        value += 0.5**k * waves(place, longest / 2.0**k, seed + 7 * k)
    return value


def scattered(count: int) -> Array:
    """Points of the unit square, evenly spread without a pattern.

    Returns
    -------
    ndarray, shape (count, 2)

    References
    ----------
    Roberts (2018), The unreasonable effectiveness of quasirandom sequences.

    Examples
    --------
    >>> scattered(2).round(2).tolist()
    [[0.25, 0.07], [0.01, 0.64]]
    """
    number = np.arange(1, count + 1)[:, None]
    return (0.5 + number * np.array([1.0 / _PLASTIC, 1.0 / _PLASTIC**2])) % 1.0


def rise(t: Array) -> Array:
    """0 below t = 0, 1 above t = 1, smooth between.

    Parameters
    ----------
    t : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> rise(np.array([-1.0, 0.5, 2.0])).tolist()
    [0.0, 0.5, 1.0]
    """
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def ramp(t: Array, width: float) -> Array:
    """Zero, then ``t``, with a smooth bend at t = 0.

    Parameters
    ----------
    t : ndarray, shape (n,) [m]
    width : float [m], of the bend

    Returns
    -------
    ndarray, shape (n,) [m]

    Examples
    --------
    >>> ramp(np.array([-9.0, 9.0]), 0.1).round(6).tolist()
    [0.0, 9.0]
    """
    return width * np.logaddexp(0.0, t / width)


def stepped(height: Array, shift: Array, step: float, share: float) -> Array:
    """Ground broken into steps.

    Parameters
    ----------
    height : ndarray, shape (n,) [m]
    shift : ndarray, shape (n,) [m], by which the steps lie lower
    step : float [m], height of a step
    share : float, 0 for no steps to 1 for level treads

    Returns
    -------
    ndarray, shape (n,) [m]

    Examples
    --------
    >>> stepped(np.array([0.0, 0.25, 1.0]), np.zeros(3), 1.0, 1.0).round(3).tolist()
    [0.0, 0.091, 1.0]
    """
    turn = 2.0 * math.pi / step
    return height - share / turn * np.sin(turn * (height + shift))


Field = Callable[[Array], Array]
"""From places in the plane, shape (n, 2) [m], to a value at each, shape (n,)."""

Extent = tuple[float, float, float, float]
"""Least and greatest x, least and greatest y of a sheet [m]."""

_GRADE = 2.0**0.5  # each lattice of points is this much coarser than the last
_NEAREST = 0.7  # of a lattice's spacing, within which its points give way to finer ones


@dataclass(frozen=True, eq=False)
class StandingBlock:
    """A block that stands out of the ground; where the ground is higher, the ground is seen.

    Attributes
    ----------
    outline : ndarray, shape (n, 2) [m], edge of its top, counter-clockwise, evenly spaced
    top : Field, height [m]
    batter : float [m], by which the foot of the wall lies outside the edge
    bevel : float [m], by which the edge is rounded off, inward and down
    """

    outline: Array
    top: Field
    batter: float
    bevel: float

    @property
    def foot(self) -> Array:
        """Foot of the wall, shape (n, 2) [m], one point beside each of the outline."""
        return offset(self.outline, self.batter)

    @property
    def crown(self) -> Array:
        """Where the bevel meets the top, shape (n, 2) [m]."""
        return offset(self.outline, -self.bevel)


def sheet(
    extent: Extent, spacing: Field, ground: Field, blocks: list[StandingBlock], rim: Array
) -> tuple[Array, Indices, Indices]:
    """Triangulate the ground with its blocks.

    Parameters
    ----------
    spacing : Field, length of edges [m]
    ground : Field, height [m]
    blocks : list of StandingBlock, whose feet do not cross
    rim : ndarray, shape (k, 2) [m], a loop whose sides are edges of the sheet

    Returns
    -------
    vertices : ndarray, shape (n, 3) [m], rounded to a micrometre
    faces : ndarray of int64, shape (m, 3), counter-clockwise seen from above
    loop : ndarray of int64, shape (k,), the vertices on the rim

    Raises
    ------
    ValueError
        If the foot of a block comes so near to the rim that it is no loop of edges.
    """
    outlines = [rim]
    for block in blocks:
        outlines += [block.foot, block.outline, block.crown]
    fixed = np.vstack(outlines)
    places = _clear(_graded(extent, spacing, fixed), len(fixed), rim)
    height = ground(places)
    start = len(rim)
    for block in blocks:
        size = len(block.outline)
        edge = np.arange(start + size, start + 2 * size)
        on = shapely.contains_xy(shapely.Polygon(block.outline), places)
        on[start : start + size] = False
        on[edge[0] : edge[0] + 2 * size] = True
        top = block.top(places[on])
        top[np.isin(np.flatnonzero(on), edge)] -= block.bevel
        height[on] = np.maximum(height[on], top)
        start += 3 * size
    faces = Delaunay(places).simplices.astype(np.int64)
    corners = places[faces]
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    faces[area < 0.0] = faces[area < 0.0][:, ::-1]
    _require_loop(faces, len(rim))
    vertices: Array = np.column_stack([places, height])
    return np.round(vertices, 6), faces, np.arange(len(rim))


def _require_loop(faces: Indices, size: int) -> None:
    """Check that the first ``size`` vertices follow each other along edges."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    joined = set(map(tuple, edges[(edges < size).all(axis=1)].tolist()))
    if any((k, (k + 1) % size) not in joined for k in range(size)):
        raise ValueError("a block stands too near to the rock's foot; widen the gap")


def _graded(extent: Extent, spacing: Field, fixed: Array) -> Array:
    """Points of lattices from fine to coarse, each where its spacing is asked, after ``fixed``."""
    x0, x1, y0, y1 = extent
    ends = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    coarsest, finest = spacing(ends).max(), spacing(fixed).min()
    kept = np.vstack([fixed, resampled(ends, coarsest)])
    step = finest
    while step <= coarsest:
        x = np.arange(x0 + 0.5 * step, x1 - 0.4 * step, step)
        y = np.arange(y0 + 0.5 * step, y1 - 0.4 * step, step * 0.75**0.5)
        lattice = np.stack(np.meshgrid(x, y), axis=-1)
        lattice[1::2, :, 0] += 0.4 * step  # not half: no four points lie on one circle
        places = lattice.reshape(-1, 2)
        wanted = spacing(places)
        places = places[(wanted >= step) & (wanted < step * _GRADE)]
        if len(places):
            apart = KDTree(kept).query(places)[0] > _NEAREST * step
            kept = np.vstack([kept, places[apart]])
        step *= _GRADE
    return kept


def _clear(places: Array, fixed: int, rim: Array) -> Array:
    """Leave out the places, after the ``fixed`` first, in a circle over a side of the rim.

    A side whose circle holds no point is an edge of the Delaunay triangulation (Gabriel and
    Sokal 1969).
    """
    after = np.roll(rim, -1, axis=0)
    half = 0.5 * np.linalg.norm(after - rim, axis=1)
    apart = np.linalg.norm(places[:, None] - 0.5 * (rim + after), axis=2)
    free = (apart >= half).all(axis=1)
    free[:fixed] = True
    return places[free]


def resampled(corners: Array, spacing: float) -> Array:
    """Points along a closed polygon, its corners among them.

    Parameters
    ----------
    corners : ndarray, shape (n, 2) [m]
    spacing : float [m], about what the points are apart

    Returns
    -------
    ndarray, shape (k, 2) [m]

    Examples
    --------
    >>> len(resampled(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), 0.5))
    8
    """
    points = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(1, round(float(np.linalg.norm(b - a)) / spacing))
        points.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.vstack(points)


def rounded(corners: Array) -> Array:
    """A closed polygon with each corner cut back to a quarter of its sides.

    Parameters
    ----------
    corners : ndarray, shape (n, 2) [m]

    Returns
    -------
    ndarray, shape (2 n, 2) [m]

    References
    ----------
    Chaikin (1974), An algorithm for high-speed curve generation.

    Examples
    --------
    >>> rounded(np.array([[0.0, 0.0], [4.0, 0.0]])).tolist()
    [[1.0, 0.0], [3.0, 0.0], [3.0, 0.0], [1.0, 0.0]]
    """
    after = np.roll(corners, -1, axis=0)
    cut = np.stack([0.75 * corners + 0.25 * after, 0.25 * corners + 0.75 * after], axis=1)
    return cut.reshape(-1, 2)


def offset(loop: Array, distance: float) -> Array:
    """A loop with its points moved outward.

    A point at a corner moves along the corner's bisector, further by up to a half.

    Parameters
    ----------
    loop : ndarray, shape (n, 2) [m], counter-clockwise
    distance : float [m]

    Returns
    -------
    ndarray, shape (n, 2) [m]

    Examples
    --------
    >>> offset(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), 0.5)[0].round(9).tolist()
    [-0.5, -0.5]
    """
    side = np.roll(loop, -1, axis=0) - loop
    normal = np.column_stack([side[:, 1], -side[:, 0]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    outward = normal + np.roll(normal, 1, axis=0)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", outward, normal)
    return loop + distance * outward / np.maximum(cosine, 2.0 / 3.0)[:, None]
