"""A rock put on a terrain that was not scanned with it: how far it is from the ground there."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput, InvalidPlace
from vsr_core.rock.triangles import chunks
from vsr_core.scan.seat import LARGE_SHARE, Seat, seat
from vsr_core.terrain.surface import Terrain

LARGEST_GAP = 0.1
"""Gap or overlap of rock and ground that settling may close, as a share of the rock's radius."""

MARGIN_SHARE = 0.002
"""Gap beneath a rock that is raised out of the ground or about to fall, likewise."""

_AT_ONCE = 10_000  # points looked up at a time, to save memory
_SAMPLES_ACROSS = 500  # of the ground's edges, over the rock's width


def require_ground(terrain: Terrain, points: Array) -> None:
    """Check that there is ground below or above all of a rock.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], corners of its hull

    Raises
    ------
    InvalidPlace
        If it reaches beyond the border of the terrain, or lies over a hole in it.
    """
    beyond = [point for point in points if not len(terrain.surfaces(*point[:2])[0])]
    if beyond:
        raise InvalidPlace(
            f"a rock of which {len(beyond) / len(points):.0%} is beyond the terrain",
            "there is ground beneath all of the rock",
            "correct rock.pose, or take a larger terrain",
            [np.mean(beyond, axis=0)],
        )


def require_contact(terrain: Terrain, points: Array, radius: float) -> float:
    """Check that a rock lies on the ground, nearly.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], corners of its hull

    Returns
    -------
    float [m], see ``clearance``

    Raises
    ------
    InvalidPlace
        If it lies wholly inside the ground, or floats.
    """
    depth = min(terrain.depth(point) or 0.0 for point in points)
    gap = clearance(terrain, points)
    if depth <= 0.0 and gap <= LARGEST_GAP * radius:
        return gap
    inside = f"a rock wholly inside the ground, at least {depth:.3g} m deep"
    floats = f"a rock that floats {gap:.3g} m above the ground"
    raise InvalidPlace(
        inside if depth > 0.0 else floats,
        f"it stands on the ground, to {LARGEST_GAP:.0%} of its radius",
        "correct rock.pose, or let it fall: drop: true",
        [points.mean(axis=0)],
    )


def clearance(terrain: Terrain, points: Array) -> float:
    """How far a rock's hull can be lowered until it meets the ground beneath it [m].

    Negative where it has to be raised. Measured at the corners of both and along the ground's
    edges, which are sampled.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], of the hull

    Examples
    --------
    >>> square = np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]])
    >>> flat = Terrain(square, np.array([[0, 1, 2], [0, 2, 3]]))
    >>> from itertools import product
    >>> cube = np.array(list(product((-1.0, 1.0), repeat=3)))
    >>> clearance(flat, cube + [0, 0, 1.5]), clearance(flat, cube + [0, 0, 0.75])
    (0.5, -0.25)
    """
    hull = ConvexHull(points)
    found = [np.inf]
    corners = points[hull.vertices]
    lower, upper = _ends(hull, corners[:, :2])
    for corner, low, high in zip(corners, lower, upper, strict=True):
        heights = terrain.surfaces(corner[0], corner[1])[0]
        found += [low - height for height in heights[heights <= high + 1e-9][-1:]]
    ground = _along_edges(terrain, hull)
    for chunk in chunks(len(ground), _AT_ONCE):
        points = ground[chunk]
        lower, upper = _ends(hull, points[:, :2])
        beneath = (lower <= upper) & (points[:, 2] <= upper)
        found.append(float((lower - points[:, 2])[beneath].min(initial=np.inf)))
    return float(min(found))


def set_down(terrain: Terrain, corners: Array, outer: Array, radius: float) -> tuple[Seat, float]:
    """The ground as a rock stands on it, and by how much the rock is raised for that [m].

    Where the two overlap, the ground gives way (see ``seat``). Large triangles would take the
    ground far around with them: there the rock is raised, if that is enough.

    Parameters
    ----------
    corners, outer : ndarray, shape (c, 3) and (d, 3) [m], see ``seat``

    Raises
    ------
    InvalidInput
        If ground and rock overlap by more than ``LARGEST_GAP`` of its radius.
    """
    laid, raised, most = seat(terrain, (), corners, outer, "whole"), 0.0, LARGEST_GAP * radius
    given = (laid.ground.vertices != terrain.vertices).any(axis=1)
    wide = np.ptp(terrain.vertices[terrain.faces[given[terrain.faces].any(axis=1)]], axis=1)
    if wide.max(initial=0.0) > LARGE_SHARE * np.ptp(outer, axis=0).max():
        needed = MARGIN_SHARE * radius - clearance(terrain, outer)
        if 0.0 < needed <= most:
            raised, above = needed, np.array([0.0, 0.0, needed])
            laid = seat(terrain, (), corners + above, outer + above, "whole")
    if laid.moved > most:
        raise InvalidInput(
            f"ground that reaches into the rock: it would have to move by {laid.moved:.3g} m",
            f"what overlaps is parted by at most {LARGEST_GAP:.0%} of the rock's radius",
            "correct rock.pose, or let it fall: drop: true",
        )
    return laid, raised


def _ends(hull: ConvexHull, places: Array) -> tuple[Array, Array]:
    """Heights at which verticals enter and leave a hull; those that miss it leave before."""
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    steep = np.abs(normals[:, 2]) < 1e-9
    level = np.where(steep, 1.0, normals[:, 2])
    heights = -(places @ normals[:, :2].T + offsets) / level
    below, above = normals[:, 2] < 0.0, normals[:, 2] > 0.0
    lower = heights[:, below & ~steep].max(axis=1)
    upper = heights[:, above & ~steep].min(axis=1)
    aside = (places @ normals[steep, :2].T + offsets[steep]).max(axis=1, initial=-np.inf) > 1e-9
    return np.where(aside, np.inf, lower), upper


def _along_edges(terrain: Terrain, hull: ConvexHull) -> Array:
    """Points on the edges of the ground above or below a hull's box, shape (n, 3) [m]."""
    low, high = hull.min_bound[:2], hull.max_bound[:2]
    corners = terrain.vertices[terrain.faces]
    plan = corners[:, :, :2]
    near = ((plan.max(axis=1) >= low) & (plan.min(axis=1) <= high)).all(axis=1)
    start = corners[near].reshape(-1, 3)
    step = np.roll(corners[near], -1, axis=1).reshape(-1, 3) - start
    along = step[:, :2]
    across = np.where(along == 0.0, 1e-30, along)
    ends = np.sort([(low - start[:, :2]) / across, (high - start[:, :2]) / across], axis=0)
    first, last = ends[0].max(axis=1).clip(0.0, 1.0), ends[1].min(axis=1).clip(0.0, 1.0)
    meets = first <= last
    start, step, first, last = start[meets], step[meets], first[meets], last[meets]
    longest = float(((last - first) * np.linalg.norm(step, axis=1)).max(initial=0.0))
    count = 2 + int(longest * _SAMPLES_ACROSS / (high - low).max())
    share = first + np.linspace(0.0, 1.0, count)[:, None] * (last - first)
    points: Array = (start + share[:, :, None] * step).reshape(-1, 3)
    return points
