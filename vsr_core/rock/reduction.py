"""How much of a rock's hull a run needs: subsets of its corners, certified by distance."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.rock.body import Rock, touching
from vsr_core.rock.tipping import tipping

SEAT_SHARE = 0.01
"""Distance of the hull of a rock on its seat from the complete one, as a share of its radius."""

FLIGHT_SHARE = 0.015
"""The same once the rock has toppled and its base no longer matters."""

BASE_SHARE = 0.08
"""Corners this close to the lowest one are all kept on the seat, as a share of the radius."""

KEPT_TILT = np.radians(80.0)
"""Vertices that touch only beyond this tilt are left out of a reduced hull [rad]."""

MEETING_SHARE = 1e-4
"""Distance of corners from another piece at which the two meet there, likewise."""

_DIRECTIONS = 72  # in which a reduced hull must tip as the complete one does


def on_its_seat(rock: Rock) -> Rock:
    """The rock with all corners of its base, and as few others as ``SEAT_SHARE`` allows."""
    low = float(rock.vertices[:, 2].min()) + BASE_SHARE * rock.radius
    light = lightened(rock, SEAT_SHARE * rock.radius, rock.vertices[:, 2] <= low)
    return _with_lighter_pieces(light, SEAT_SHARE * rock.radius, low)


def in_flight(rock: Rock) -> Rock:
    """The rock with as few corners as ``FLIGHT_SHARE`` allows."""
    tolerance = FLIGHT_SHARE * rock.radius
    light = lightened(rock, tolerance, np.zeros(len(rock.vertices), dtype=bool))
    return _with_lighter_pieces(light, tolerance, -np.inf)


def _with_lighter_pieces(rock: Rock, tolerance: float, low: float) -> Rock:
    """Leave corners of pieces out, but for those below ``low`` [m] and those where pieces meet."""
    if not rock.pieces:
        return rock
    planes = [ConvexHull(piece).equations for piece in rock.pieces]
    found = []
    for number, piece in enumerate(rock.pieces):
        chosen = piece[:, 2] <= low
        chosen[on_bounding_box(piece, rock.axes)] = True
        for k, other in enumerate(planes):
            beyond = (piece @ other[:, :3].T + other[:, 3]).max(axis=1)
            chosen |= (beyond <= MEETING_SHARE * rock.radius) & (k != number)
        found.append(piece[needed(piece, tolerance, chosen)])
    return replace(rock, pieces=tuple(found))


def lightened(rock: Rock, tolerance: float, kept: Mask) -> Rock:
    """The rock with a subset of its corners whose hull is within ``tolerance`` of the complete one.

    The new hull lies inside the old one, and no corner of the old one is farther than
    ``tolerance`` from it: of nested convex bodies this is their Hausdorff distance. Corners go in
    one by one, the farthest first, as in Qhull; mass and inertia stay those of the complete rock.

    Parameters
    ----------
    tolerance : float [m]
    kept : ndarray of bool, shape (n,), corners that stay in any case

    Returns
    -------
    Rock
        The same rock where all corners are needed.
    """
    chosen = kept.copy()
    chosen[on_bounding_box(rock.vertices, rock.axes)] = True
    chosen = needed(rock.vertices, tolerance, chosen)
    return rock if chosen.all() else replace(rock, vertices=rock.vertices[chosen])


def on_bounding_box(corners: Array, axes: Array) -> Indices:
    """Corners on the bounding box in the principal frame: engines size their tolerances by it.

    Parameters
    ----------
    corners : ndarray, shape (n, 3) [m]
    axes : ndarray, shape (3, 3), principal axes as columns

    Returns
    -------
    ndarray of int, shape (6,)

    Examples
    --------
    >>> on_bounding_box(np.array([[0.0, 5, 1], [1, 0, 2], [2, 4, 0]]), np.eye(3)).tolist()
    [0, 1, 2, 2, 0, 1]
    """
    along = corners @ axes
    return np.concatenate([along.argmin(axis=0), along.argmax(axis=0)])


def needed(corners: Array, tolerance: float, chosen: Mask) -> Mask:
    """Which corners make a hull within ``tolerance`` [m] of that of all, shape (n, 3) [m].

    Parameters
    ----------
    corners : ndarray, shape (n, 3) [m]
    tolerance : float [m]
    chosen : ndarray of bool, shape (n,), to begin with

    Returns
    -------
    ndarray of bool, shape (n,)
        All of them if those to begin with span no volume.
    """
    if not _spans_volume(corners[chosen]):
        return np.ones(len(corners), dtype=bool)
    chosen = chosen.copy()
    while not chosen.all():
        hull = ConvexHull(corners[chosen])
        distance = _outside(corners, corners[chosen][hull.simplices], hull.equations)
        farthest = int(np.argmax(distance))
        if distance[farthest] <= tolerance:
            break
        chosen[farthest] = True
    return chosen


def _spans_volume(points: Array) -> bool:
    if len(points) < 4:
        return False
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(extent[2] > 1e-6 * extent[0])


def _outside(points: Array, triangles: Array, planes: Array) -> Array:
    """Distances [m] of points, shape (n, 3), from a convex hull given by its facets; 0 inside.

    Of all facets only those that a point is in front of can be nearest to it.
    """
    above = points @ planes[:, :3].T + planes[:, 3]
    distance = np.zeros(len(points))
    point, facet = np.nonzero(above > 1e-12)
    if len(point):
        from trimesh.triangles import closest_point

        nearest = closest_point(triangles[facet], points[point])
        distance[:] = np.inf
        np.minimum.at(distance, point, np.linalg.norm(points[point] - nearest, axis=1))
        distance[~(above > 1e-12).any(axis=1)] = 0.0
    return distance


@lru_cache(maxsize=8)
def simplified(rock: Rock) -> Rock:
    """The rock with those vertices of its hull that can touch below ``KEPT_TILT``.

    Certified: static uplift and tipping in 72 directions are those of the complete hull, or the
    rock is returned as it is.
    """
    hull = rock.hull
    keep = touching(hull, KEPT_TILT)
    keep[on_bounding_box(hull.vertices, rock.axes)] = True
    kept = replace(rock, vertices=hull.vertices[keep])
    toward = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    before, after = tipping(hull, toward), tipping(kept.hull, toward)
    same = np.allclose(after.overturning, before.overturning, rtol=1e-9, atol=0.0) and np.allclose(
        after.uplift, before.uplift, rtol=1e-9, atol=0.0
    )
    return kept if same else rock
