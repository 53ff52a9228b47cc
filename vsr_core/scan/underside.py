"""What a rock's unseen underside may be: planes, a convex hull or Poisson's surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput

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
        """Height of the envelope at points.

        Parameters
        ----------
        points : ndarray, shape (n, 2) [m], u and v

        Returns
        -------
        ndarray, shape (n,) [m]
        """
        return self.sign * (self.sign * self.each(points)).max(axis=1)

    def each(self, points: Array) -> Array:
        """Height of each plane at points.

        Parameters
        ----------
        points : ndarray, shape (n, 2) [m], u and v

        Returns
        -------
        ndarray, shape (n, k) [m]
        """
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
    vertices : ndarray, shape (n, 3) [m]
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
