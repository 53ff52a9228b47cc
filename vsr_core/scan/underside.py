"""What a rock's unseen underside may be, and a surface of triangles across a rim."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from scipy.spatial import ConvexHull, QhullError, cKDTree

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.scan.topology import border, rims, touching

Height: TypeAlias = Callable[[Array], Array]
"""Height [m], shape (n,), at points u, v, shape (n, 2) [m]."""

_MOST_PLANES = 3  # of an underside
_FLAT = 0.02  # of its width: a rim that scatters about its plane by less is flat
_BETTER = 0.6  # another plane is worth it if the scatter falls below this share
_SLOPE_SCATTER = 0.2  # tangent of the angle by which a joint's slope differs from its neighbours'
_LEAST_SCATTER = 1e-3  # m, below which points are not trusted against each other
_ROUNDING = 1e-9  # m, by which a point may lie outside an outline
_DEPTH = 9  # of the octree of Poisson's surface


@dataclass(frozen=True)
class Planes:
    """The upper (``sign`` 1) or lower (-1) envelope of planes.

    Attributes
    ----------
    rows : ndarray, shape (k, 3), slopes along u and v [1] and height at the origin [m]
    scatter : float [m], of the rim about it (1.48 times the median distance)
    """

    rows: Array
    sign: int
    scatter: float

    def __call__(self, points: Array) -> Array:
        """Height of the envelope [m], shape (n,), at points u, v, shape (n, 2) [m]."""
        return self.sign * (self.sign * self.each(points)).max(axis=1)

    def each(self, points: Array) -> Array:
        """Height of each plane [m], shape (n, k), at such points."""
        return points @ self.rows[:, :2].T + self.rows[:, 2]


def planes(rim: Array, slope: Array) -> Planes:
    """The fewest planes that a rim lies in.

    One plane is fitted robustly, and further ones while the rim does not lie flat: an envelope
    of planes, each fitted to the part of the rim on it (Magnani & Boyd 2009). Where a part of
    the rim leaves a slope undetermined, as a straight one does, the plane follows the slope of
    the joint surface beside it.

    Parameters
    ----------
    rim : ndarray, shape (n, 3) [m], u, v and h of its points
    slope : ndarray, shape (n, 2), slope along u and v of the ground beside each point

    Examples
    --------
    >>> square = np.array([[0.0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    >>> (planes(square, np.zeros((4, 2))).rows.round(6) + 0.0).tolist()
    [[0.0, 0.0, 1.0]]
    """
    best = _envelope(rim, slope, np.zeros(len(rim), dtype=np.int64), 1, 1)
    width = float(np.ptp(rim[:, :2], axis=0).max())
    while best.scatter > _FLAT * width and len(best.rows) < _MOST_PLANES:
        more = min(
            (
                _envelope(rim, slope, part, len(best.rows) + 1, sign)
                for part in _parts(rim, len(best.rows) + 1)
                for sign in (1, -1)
            ),
            key=lambda found: found.scatter,
        )
        if more.scatter > _BETTER * best.scatter:
            break
        best = more
    return best


def _parts(rim: Array, count: int) -> list[Indices]:
    """Several divisions of a rim into sectors about its middle."""
    u, v = (rim[:, :2] - rim[:, :2].mean(axis=0)).T
    turn = np.arctan2(v, u) / (2.0 * np.pi)
    return [
        np.floor(((turn + start / 12.0 / count) % 1.0) * count).astype(np.int64)
        for start in range(12)
    ]


def _envelope(rim: Array, slope: Array, part: Indices, count: int, sign: int) -> Planes:
    """Envelope of ``count`` planes, from a first guess of which points lie in which."""
    found = Planes(np.zeros((count, 3)), sign, np.inf)
    for _ in range(20):
        rows = [
            _plane(rim[part == k], slope[part == k] if (part == k).any() else slope)
            for k in range(count)
        ]
        found = Planes(np.array(rows), sign, 0.0)
        again = np.argmax(sign * found.each(rim[:, :2]), axis=1)
        if (again == part).all():
            break
        part = again
    residual = np.abs(rim[:, 2] - found(rim[:, :2]))
    return Planes(found.rows, sign, 1.48 * float(np.median(residual)))


def _plane(points: Array, slope: Array) -> Array:
    """Slopes and height of a plane through points, shape (n, 3) [m], robust (Tukey 1960's)."""
    rows = np.column_stack([points[:, :2], np.ones(len(points))])
    prior = np.eye(3)[:2] / _SLOPE_SCATTER
    expected = np.median(slope, axis=0) / _SLOPE_SCATTER
    weight, scatter = np.ones(len(points)), 0.1
    plane = np.zeros(3)
    for _ in range(20):
        by = weight / scatter
        system = np.concatenate([rows * by[:, None], prior, 1e-9 * np.eye(3)[2:]])
        plane = np.linalg.lstsq(
            system, np.concatenate([points[:, 2] * by, expected, [0.0]]), rcond=None
        )[0]
        residual = np.abs(points[:, 2] - rows @ plane)
        if len(residual):
            scatter = max(1.48 * float(np.median(residual)), _LEAST_SCATTER)
        weight = np.maximum(1.0 - (residual / (4.0 * scatter)) ** 2, 0.0)
    return plane


def lower_hull(points: Array) -> Height:
    """Lower side of a convex hull.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], u, v and h

    Returns
    -------
    Height, -inf beside the points, where their hull has no lower side

    Raises
    ------
    InvalidInput
        If the points lie in a plane.

    Examples
    --------
    >>> tent = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1]])
    >>> lower_hull(tent)(np.array([[1.0, 1.0]])).tolist()
    [0.0]
    """
    try:
        sides = ConvexHull(points).equations
    except QhullError as error:
        raise InvalidInput(
            "a rim that lies in a plane",
            "its hull has a lower side of its own",
            "close it with caps",
        ) from error
    outline = ConvexHull(points[:, :2]).equations
    below = sides[sides[:, 2] < -1e-9]
    rows = -np.column_stack([below[:, :2], below[:, 3]]) / below[:, 2:3]

    def height(at: Array) -> Array:
        outside = (at @ outline[:, :2].T + outline[:, 2] > _ROUNDING).any(axis=1)
        return np.where(outside, -np.inf, (at @ rows[:, :2].T + rows[:, 2]).max(axis=1))

    return height


def poisson(vertices: Array, normals: Array) -> tuple[Array, Indices]:
    """Closed surface through points with normals (Kazhdan & Hoppe 2013, by Open3D).

    Parameters
    ----------
    normals : ndarray, shape (n, 3), outward

    Returns
    -------
    vertices : ndarray, shape (k, 3) [m]
    faces : ndarray of int, shape (l, 3)

    Raises
    ------
    InvalidInput
        If Open3D is not installed.
    """
    try:
        import open3d
    except ImportError as error:
        raise InvalidInput(
            "a closing by Poisson's equation without Open3D",
            "it needs the extra poisson",
            "install it: .venv/bin/pip install -e '.[poisson]', or set rock.closing: caps or hull",
        ) from error
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(vertices))
    cloud.normals = open3d.utility.Vector3dVector(normals)
    mesh = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=_DEPTH)[0]
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles, dtype=np.int64)


_UNCROSSING = 20  # rounds of smoothing a rim along itself
_STRIP = 0.6  # width of the strip along the rim, of the spacing, that holds no inner vertex


@dataclass(frozen=True)
class Frame:
    """Coordinates u, v in a plane and h along ``up``, all in metres.

    Attributes
    ----------
    origin : ndarray, shape (3,) [m]
    axes : ndarray, shape (3, 3), rows: the unit vectors of u, v and h, right-handed
    """

    origin: Array
    axes: Array

    def into(self, points: Array) -> Array:
        """Points, shape (n, 3) [m], in these coordinates."""
        return (points - self.origin) @ self.axes.T

    def back(self, points: Array) -> Array:
        """The reverse of ``into``."""
        return self.origin + points @ self.axes


def frame(points: Array, up: Array) -> Frame:
    """Frame about the middle of points.

    Parameters
    ----------
    up : ndarray, shape (3,), direction of h, of any length

    Examples
    --------
    >>> frame(np.eye(3), np.array([0.0, 0.0, 2.0])).axes[2].tolist()
    [0.0, 0.0, 1.0]
    """
    h = up / np.linalg.norm(up)
    u = np.cross(np.eye(3)[int(np.argmin(np.abs(h)))], h)
    u /= np.linalg.norm(u)
    return Frame(points.mean(axis=0), np.array([u, np.cross(h, u), h]))


def area_vector(loop: Array) -> Array:
    """Area vector of a closed loop of points: its normal where it runs counter-clockwise.

    Parameters
    ----------
    loop : ndarray, shape (n, 3) [m]

    Returns
    -------
    ndarray, shape (3,) [m^2]

    Examples
    --------
    >>> area_vector(np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])).tolist()
    [0.0, 0.0, 2.0]
    """
    middle = loop - loop.mean(axis=0)
    return 0.5 * np.cross(middle, np.roll(middle, -1, axis=0)).sum(axis=0)


def uncrossed(rim: Array) -> Array:
    """A rim smoothed along itself until, seen along h, it does not cross itself.

    Parameters
    ----------
    rim : ndarray, shape (n, 3) [m], u, v and h of its points

    Returns
    -------
    ndarray, shape (n, 3) [m]
        As it was, where it does not; crossing still, where that does not help.
    """
    placed = rim.copy()
    for _ in range(_UNCROSSING):
        if shapely.Polygon(placed[:, :2]).is_valid:
            break
        beside = 0.5 * (np.roll(placed, 1, axis=0) + np.roll(placed, -1, axis=0))
        placed = 0.5 * (placed + beside)
    return placed


def across(rim: Array, spacing: float) -> tuple[Array, Indices]:
    """Triangles that fill a simple polygon, every side of it the side of one triangle.

    Parameters
    ----------
    rim : ndarray, shape (n, 2) [m], counter-clockwise
    spacing : float [m], of the vertices inside; none if infinite

    Returns
    -------
    inner : ndarray, shape (k, 2) [m], vertices inside
    faces : ndarray of int, shape (m, 3), counter-clockwise; n, n + 1, ... are the inner ones

    Raises
    ------
    InvalidInput
        If the polygon crosses itself.

    Examples
    --------
    >>> inner, faces = across(np.array([[0.0, 0], [2, 0], [2, 1], [0, 1]]), np.inf)
    >>> len(inner), len(faces)
    (0, 2)
    """
    if not (polygon := shapely.Polygon(rim)).is_valid:
        raise InvalidInput(
            f"a rim of {len(rim)} edges that crosses itself, seen along its normal",
            "a rim is filled across the plane it lies in",
            "smooth or crop the scan there, or cut along a plane",
        )
    inner, even = _lattice(polygon, spacing)
    holes = [inner[loop] for loop in rims(even)]
    strip = shapely.constrained_delaunay_triangles(shapely.Polygon(rim, holes))
    corners = shapely.get_coordinates(strip).reshape(-1, 4, 2)[:, :3]
    faces = np.asarray(cKDTree(np.concatenate([rim, inner])).query(corners)[1], dtype=np.int64)
    side = corners[:, 1:] - corners[:, :1]
    clockwise = side[:, 0, 0] * side[:, 1, 1] < side[:, 0, 1] * side[:, 1, 0]
    faces[clockwise] = faces[clockwise, ::-1]
    faces = np.concatenate([faces, even + len(rim)])
    _require_border(faces, len(rim))
    return inner, faces


def _lattice(polygon: shapely.Polygon, spacing: float) -> tuple[Array, Indices]:
    """Vertices and faces of the equilateral triangles well inside a polygon."""
    none = np.empty((0, 2)), np.empty((0, 3), dtype=np.int64)
    if not np.isfinite(spacing):
        return none
    room = shapely.buffer(polygon, -_STRIP * spacing)
    if room.is_empty:
        return none
    low, high = np.array(room.bounds).reshape(2, 2)
    height = spacing * np.sqrt(0.75)
    wide, tall = np.ceil((high - low) / (spacing, height)).astype(int) + 3
    row, column = np.divmod(np.arange(wide * tall), wide)
    x = low[0] + (column - 1.0 + 0.5 * (row % 2)) * spacing
    points = np.column_stack([x, low[1] + (row - 1.0) * height])
    here = np.flatnonzero((column < wide - 1) & (row < tall - 1))
    odd = row[here] % 2
    up = np.column_stack([here, here + 1, here + wide + odd])
    down = np.column_stack([here + 1 - odd, here + wide + 1, here + wide])
    faces = np.concatenate([up, down])
    kept = shapely.contains(room, shapely.points(points))
    faces = _without_pinches(faces[kept[faces].all(axis=1)])
    used, local = np.unique(faces, return_inverse=True)
    return points[used], local


def _without_pinches(faces: Indices) -> Indices:
    """Faces less those at a vertex where their rim meets itself."""
    while len(faces):
        start = np.sort(border(faces)[:, 0])
        pinched = start[1:][start[1:] == start[:-1]]
        if len(pinched) == 0:
            break
        faces = faces[~touching(faces, pinched)]
    return faces


def _require_border(faces: Indices, rim: int) -> None:
    """Check that the border of the faces is the rim, vertices 0, 1, ... in order."""
    links = border(faces)
    along = np.column_stack([np.arange(rim), (np.arange(rim) + 1) % rim])
    if not np.array_equal(links[np.argsort(links[:, 0])], along):
        raise InvalidInput(
            f"a rim of {rim} edges that cannot be filled",
            "its points are distinct",
            "clean the scan first",
        )
