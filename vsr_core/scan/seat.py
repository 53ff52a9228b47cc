"""What of the ground bears a rock that was scanned with it.

Nobody has seen the seam between the two, and two rigid surfaces that conform everywhere would lock
a rock into its hollow. So what bears there is a model: some points on the rock's underside, each a
small pyramid on the ground, while the ground that was not seen lies lower, and that beside the seam
goes down to it. Other ground that was scanned stays, but for what reaches into the rock's convex
hull, which is its contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
import shapely
import trimesh
from scipy.spatial import ConvexHull, cKDTree

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput
from vsr_core.rock.triangles import cross_products
from vsr_core.scan.topology import rims
from vsr_core.terrain.surface import Terrain

Bearing = Literal["rim", "whole"] | int

DEPTH_SHARE = 0.01
"""Depth of unseen ground below the rock, as a share of its radius."""

BANK_SHARE = 0.05
"""Distance beside the seam over which scanned ground goes down to that depth, likewise: lowered by
its triangles alone, it would hold the foot of the rock by how small they are."""

GAP_SHARE = 2e-4
"""Gap that is left between the rock's hull and scanned ground that reached into it, likewise."""

STEEPEST = 0.5
"""Share of a side's normal that points down, from which the side is of a rock's underside."""

INSET_SHARE = 0.004
"""Distance of the points that bear from the outline of the seam, likewise."""

OUTLINE_SHARE = 0.006
"""How far the polygon of the points that bear may stand off that outline, likewise."""

REACH_SHARE = 0.02
"""Height of the seam above the rock's hull up to which it may bear, likewise."""

LARGE_SHARE = 0.05
"""Size of a triangle from which on it is asked whether it really reaches into the hull, as a share
of the hull's: of the small ones those that no side parts from it are next to it at least."""

MEETING_SHARE = 1e-4
"""Distance to which it is known where pieces of a rock meet, likewise."""

_ROUNDS = 200  # of moving ground out of a hull
_PASSES = 20  # over pieces of a rock
_SIDES = 5  # of a pyramid
_ROUNDING = 1e-9  # m
_LEVEL = 0.02  # least share of a side's normal that points down, of the underside


@dataclass(frozen=True, eq=False)
class Seat:
    """Ground on which a rock stands as it was scanned.

    Attributes
    ----------
    ground : Terrain, out of the rock's hull
    points : ndarray, shape (k, 3) [m], that bear; none where all of the seam does
    pyramids : tuple of ndarray, shape (6, 3) [m], the tip of each at a point, and its foot
    moved : float [m], by which scanned ground was moved out of the hull at most
    """

    ground: Terrain
    points: Array
    pyramids: tuple[Array, ...]
    moved: float

    @property
    def terrain(self) -> Terrain:
        """The ground with its pyramids."""
        first = len(self.ground.vertices)
        ring = 1 + np.arange(_SIDES)
        sides = np.column_stack([0 * ring, ring, 1 + ring % _SIDES])
        faces = [first + sides + k * (_SIDES + 1) for k in range(len(self.pyramids))]
        return Terrain(
            np.concatenate([self.ground.vertices, *self.pyramids]),
            np.concatenate([self.ground.faces, *faces]),
        )


def seams(terrain: Terrain, unseen: Mask) -> tuple[Array, ...]:
    """Loops around ground that was not seen, each of shape (n, 3) [m].

    Parameters
    ----------
    unseen : ndarray of bool, shape (m,), faces beneath the rock
    """
    return tuple(terrain.vertices[loop] for loop in rims(terrain.faces[unseen]))


def seat(
    terrain: Terrain,
    loops: Sequence[Array],
    corners: Array,
    outer: Array,
    bearing: Bearing,
    pieces: Sequence[Array] = (),
) -> Seat:
    """Ground that bears a rock in the pose of its scan.

    Parameters
    ----------
    loops : sequence of ndarray, shape (n, 3) [m] each, the seams
    corners : ndarray, shape (c, 3) [m], of the hull that is the rock's contact, in the site's frame
    outer : ndarray, shape (d, 3) [m], of the complete hull, which holds the other
    bearing : "rim" for points along the outline of the seam, a number for so many of them that
        span the largest area about the centre of mass, "whole" for all of the seam
    pieces : sequence of ndarray, each of shape (k, 3) [m], that touch in place of the hull

    Raises
    ------
    InvalidInput
        If the points that can bear have no weight between them, or ground stays in the rock.
    """
    middle = trimesh.convex.convex_hull(outer).center_mass  # not of the rock, which may be unknown
    radius = float(np.linalg.norm(outer - middle, axis=1).max())
    beneath = shapely.union_all([shapely.make_valid(shapely.Polygon(loop)) for loop in loops])
    if loops:
        terrain = _without_foot(terrain, loops, beneath, radius)
    middles = terrain.vertices[terrain.faces].mean(axis=1)
    unseen = shapely.contains_xy(beneath, middles[:, :2]) & (middles[:, 2] < outer[:, 2].mean())
    whole = bearing == "whole"
    laid = terrain if whole else _banked(terrain, beneath, radius)
    depth = GAP_SHARE if whole else DEPTH_SHARE
    ground = Terrain(_cleared(laid, pieces or (outer,), radius, depth), terrain.faces)
    seen = np.setdiff1d(terrain.faces[~unseen], terrain.faces[unseen])
    moved = np.linalg.norm(ground.vertices - laid.vertices, axis=1)[seen].max(initial=0.0)
    if whole:
        return Seat(ground, np.empty((0, 3)), (), float(moved))
    points, upward = _bearing(np.concatenate(loops), ConvexHull(corners), radius, bearing)
    height = DEPTH_SHARE * radius
    pyramids = (_pyramid(tip, up, height) for tip, up in zip(points, upward, strict=True))
    return Seat(ground, points, tuple(pyramids), float(moved))


def _without_foot(
    terrain: Terrain, loops: Sequence[Array], beneath: shapely.Geometry, radius: float
) -> Terrain:
    """Ground without faces that are turned down at the seam or below it.

    They are of a foot that overhangs where the cut is above its seam, turned away from the rock, or
    folded at the seam. No rock is under them; a wall that leans over one is turned towards it.
    """
    depth, wide = DEPTH_SHARE * radius, BANK_SHARE * radius
    middles = terrain.vertices[terrain.faces].mean(axis=1)
    normals = cross_products(terrain.vertices, terrain.faces)
    down = np.flatnonzero(normals[:, 2] < 0.0)
    plan = middles[down, :2]
    lines = [shapely.segmentize(shapely.LinearRing(loop), depth) for loop in loops]
    seam = shapely.get_coordinates(lines, include_z=True)
    below = middles[down, 2] < seam[cKDTree(seam[:, :2]).query(plan)[1], 2] + depth
    away = plan - shapely.get_coordinates(beneath.centroid)
    outward = np.einsum("ij,ij->i", normals[down, :2], away) > 0.0
    near = shapely.distance(beneath, shapely.points(plan)) <= np.where(outward, wide, depth)
    return Terrain(terrain.vertices, np.delete(terrain.faces, down[near & below], axis=0))


def _cleared(terrain: Terrain, bodies: Sequence[Array], radius: float, depth: float) -> Array:
    """Vertices of ground that is moved out of convex bodies, shape (n, 3) [m].

    Parameters
    ----------
    bodies : sequence of ndarray, each of shape (k, 3) [m]
    depth : float, gap beneath them, as a share of the radius [m]
    """
    hulls = [ConvexHull(body) for body in bodies]
    for _ in range(_PASSES):
        before = terrain
        for number, hull in enumerate(hulls):
            beneath = hull.equations[:, 2] < -STEEPEST
            gap = np.where(beneath, depth * radius, GAP_SHARE * radius)
            within = np.zeros(len(gap), dtype=bool)
            for other in hulls[:number] + hulls[number + 1 :]:
                within |= _inside(hull, other, MEETING_SHARE * radius)
            gap[within] = 0.0
            terrain = Terrain(out_of(terrain, hull, gap, within), terrain.faces)
        if len(hulls) == 1 or np.abs(terrain.vertices - before.vertices).max() <= _ROUNDING:
            return terrain.vertices
    raise _stays()


def _banked(terrain: Terrain, beneath: shapely.Geometry, radius: float) -> Terrain:
    """Ground that goes down to the depth of what was not seen, and beside the seam towards it."""
    apart = shapely.distance(beneath, shapely.points(terrain.vertices[:, :2]))
    share = np.clip(1.0 - apart / (BANK_SHARE * radius), 0.0, 1.0)
    down = np.outer(DEPTH_SHARE * radius * share, [0.0, 0.0, 1.0])
    return Terrain(terrain.vertices - down, terrain.faces)


def _inside(hull: ConvexHull, other: ConvexHull, margin: float) -> Mask:
    """Sides of a hull that are inside another one: no ground is moved through them."""
    planes = other.equations
    own = (hull.points @ planes[:, :3].T + planes[:, 3]).max(axis=1) <= margin
    return np.asarray(own[hull.simplices].all(axis=1))


def _stays() -> InvalidInput:
    return InvalidInput(
        "ground that stays in the rock however it is moved",
        "rock and ground touch along a seam",
        "look at the cut of the scan (`vsr prep`)",
    )


def out_of(terrain: Terrain, hull: ConvexHull, gap: Array, closed: Mask | None = None) -> Array:
    """Vertices of ground that is moved out of a convex hull, each triangle by its shortest way.

    A triangle is outside where one side of the hull has all of it in front, and a large one where
    none of it is left behind all sides. The others move along the normal of the side that needs
    least.

    Parameters
    ----------
    gap : ndarray, shape (k,) [m], to be left in front of each of its sides
    closed : ndarray of bool, shape (k,), sides through which nothing is moved

    Returns
    -------
    ndarray, shape (n, 3) [m]

    Raises
    ------
    InvalidInput
        If some stays within.
    """
    vertices, faces = terrain.vertices.copy(), terrain.faces
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3] - gap
    large = LARGE_SHARE * float(np.ptp(hull.points, axis=0).max())
    for _ in range(_ROUNDS):
        corners = vertices[faces]
        apart = (corners.min(axis=1) > hull.max_bound + gap.max()).any(axis=1)
        apart |= (corners.max(axis=1) < hull.min_bound - gap.max()).any(axis=1)
        near = np.flatnonzero(~apart)
        used, local = np.unique(faces[near], return_inverse=True)
        front = (vertices[used] @ normals.T + offsets)[local.reshape(-1, 3)].min(axis=1)
        short = -front.max(axis=1)
        side = (front if closed is None else np.where(closed, -np.inf, front)).argmax(axis=1)
        inside = np.flatnonzero(short > _ROUNDING)
        wide = np.ptp(corners[near[inside]], axis=1).max(axis=1) > large
        clear = [not _meets(corners[near[at]], normals, offsets) for at in inside[wide]]
        inside = np.setdiff1d(inside, inside[wide][clear])
        if not len(inside):
            return vertices
        for at in inside[np.argsort(-short[inside])]:
            own, normal = faces[near[at]], normals[side[at]]
            lacking = -(vertices[own] @ normal + offsets[side[at]])
            vertices[own] += np.maximum(lacking, 0.0)[:, None] * normal
    raise _stays()


def _meets(triangle: Array, normals: Array, offsets: Array) -> bool:
    """Whether any of a triangle, shape (3, 3) [m], is behind all sides of a hull: it is clipped."""
    left = triangle
    while len(left):
        front = left @ normals.T + offsets
        side = int(front.max(axis=0).argmax())
        if front[:, side].max() <= _ROUNDING:
            return True
        one, other = front[:, side], np.roll(front[:, side], -1)
        crosses = (one > 0.0) != (other > 0.0)
        share = one / np.where(crosses, one - other, 1.0)
        crossing = left + share[:, None] * (np.roll(left, -1, axis=0) - left)
        both = np.stack([left, crossing], axis=1)
        left = both[np.stack([one <= 0.0, crosses], axis=1)]
    return False


def _bearing(rim: Array, hull: ConvexHull, radius: float, bearing: Bearing) -> tuple[Array, Array]:
    """Points on a hull's underside that bear it, and the directions in which the ground pushes."""
    below = hull.equations[hull.equations[:, 2] < -_LEVEL]
    slopes, heights = -below[:, :2] / below[:, 2:3], -below[:, 3] / below[:, 2]
    at = rim[:, :2]
    on = at[rim[:, 2] - (at @ slopes.T + heights).max(axis=1) < REACH_SHARE * radius]
    outline = shapely.convex_hull(shapely.MultiPoint(on))
    inner = shapely.buffer(outline, -INSET_SHARE * radius)
    if inner.is_empty or not shapely.contains_xy(inner, 0.0, 0.0):
        raise InvalidInput(
            f"a seam of which {len(on)} of {len(rim)} points can bear, not around the weight",
            "the seam bears the rock",
            "set pedestal.seat: whole, or look at the cut (`vsr prep`)",
        )
    chosen = _corners(shapely.get_coordinates(inner)[:-1], OUTLINE_SHARE * radius)
    if isinstance(bearing, int):
        chosen = _widest(chosen, bearing)
    height = chosen @ slopes.T + heights
    side = height.argmax(axis=1)
    points = np.column_stack([chosen, height[np.arange(len(chosen)), side]])
    return points, -below[side, :3]


def _corners(outline: Array, tolerance: float) -> Array:
    """As few corners of a convex polygon, shape (k, 2), as keep within a tolerance [m] of it.

    The corner that is missed least goes first, so that they are the same wherever the outline
    begins and however it is turned.
    """
    kept = [*range(len(outline))]

    def missed(place: int) -> float:
        """How far the polygon comes to stand off the outline without a corner [m]."""
        start, end = kept[place - 1], kept[(place + 1) % len(kept)]
        between = np.arange(start, end + len(outline) * (end < start)) % len(outline)
        chord, away = outline[end] - outline[start], outline[between] - outline[start]
        return float(np.abs(away @ [-chord[1], chord[0]]).max() / np.linalg.norm(chord))

    lost = [missed(place) for place in range(len(kept))]
    while len(kept) > 3 and min(lost) <= tolerance:
        place = int(np.argmin(lost))
        del kept[place], lost[place]
        for beside in (place - 1, place % len(kept)):
            lost[beside] = missed(beside % len(kept))
    return outline[kept]


def _widest(corners: Array, number: int) -> Array:
    """The corners of which so many span the largest polygon about the origin."""
    choices = (corners[list(own)] for own in combinations(range(len(corners)), number))
    areas = {
        shapely.area(polygon): own
        for own in choices
        if shapely.contains_xy(polygon := shapely.Polygon(own), 0.0, 0.0)
    }
    return areas[max(areas)] if areas else corners


def _pyramid(tip: Array, up: Array, height: float) -> Array:
    """Tip and foot of a steep pyramid, shape (1 + ``_SIDES``, 3) [m], one corner of it outward."""
    turn = 2.0 * np.pi * np.arange(_SIDES)[:, None] / _SIDES
    outward = tip * [1.0, 1.0, 0.0]
    u = outward - outward @ up * up
    u /= np.linalg.norm(u)
    foot = np.cos(turn) * u + np.sin(turn) * np.cross(up, u) - 2.0 * up
    return np.vstack([tip, tip + height * foot])
