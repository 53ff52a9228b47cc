"""A surrogate of Double Rock's site: the rock in a niche near the top of a stepped slope.

Published are the relief of the outcrop, about 12 m, that the rock stands between lower pedestals
that support it laterally along its weak direction, and that rocks which topple tend to come to
rest after about 6 m. The ground here is made up of such parts: a level seat, supports around it,
a stepped slope with blocks, and on the way down a niche behind a lip that catches rocks.

References
----------
Chen et al. (2024), Seismica 3(1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.surrogates.ground_shapes import ramp, rise, rough, scattered, stepped, waves
from vsr_core.surrogates.ground_sheet import Block, Field, resampled, rounded, sheet
from vsr_core.surrogates.ring_stack import polygon_radius
from vsr_core.surrogates.surrogate_site import SurrogateSite, over_origin, rim_around


@dataclass(frozen=True)
class Shape:
    """What the ground looks like; lengths in metres, in the site frame.

    Attributes
    ----------
    clearance : of the seat below the rock's base
    front_height, back_height : tops of the supports toward +x and -x, above the seat
    front_depth, back_depth : radial thickness of the supports
    gap : between the supports' edges and the rock's hull below them
    slope : float [degree], mean slope below the shoulder
    shoulder : x at which the slope begins
    foot : x at which it begins to level out
    step, step_share : height of the slope's steps; 0 for none to 1 for level treads
    roughness : root mean square of the longest waves of the ground, away from the seat
    chute : depth of the shallow gully that leads to the niche
    niche_x, niche_y : middle of the niche
    niche_length, niche_width : its size along x and along y
    niche_depth : of its floor below the slope at its middle
    lip_height : of the rim on its outer side above its floor
    blocks : int, number of blocks tried on the slope
    """

    clearance: float = 0.001
    front_height: float = 0.45
    back_height: float = 0.5
    front_depth: float = 0.34
    back_depth: float = 0.6
    gap: float = 0.04
    slope: float = 34.0
    shoulder: float = 1.0
    foot: float = 14.0
    step: float = 0.95
    step_share: float = 0.85
    roughness: float = 0.09
    chute: float = 0.35
    niche_x: float = 2.8
    niche_y: float = 0.15
    niche_length: float = 2.1
    niche_width: float = 2.9
    niche_depth: float = 0.5
    lip_height: float = 0.7
    blocks: int = 150


SHAPE = Shape()
"""The shape of the surrogate `double_rock_terrain`."""

_EXTENT = (-5.0, 19.0, -10.0, 10.0)
_FINE = 0.036  # m, edges at the seat and the supports
_COARSE = 0.29  # m, far from what the rock touches first
_SEAM = 0.012  # m, from the rock's foot to the rim of the seat
_BATTER, _BEVEL = 0.015, 0.03  # m, of the supports
_DIP = 0.2  # slope of the supports' tops, away from the rock
_HEART = (-0.2, -0.05)  # x, y inside every level cut of the rock up to the supports' tops [m]

# Supports: from and to [degree about the heart, from +x], height and depth as shares.
_FRONT = ((-32.0, -2.0, 1.0, 1.0), (2.0, 32.0, 0.9, 1.15))
_BACK = ((150.0, 178.0, 0.85, 1.0), (182.0, 212.0, 1.0, 0.9))


def site(shape: Shape = SHAPE) -> SurrogateSite:
    """Double Rock's surrogate and the ground around it, of about 12 m relief, 24 m x 20 m.

    Examples
    --------
    >>> site().rock_vertices.shape
    (4322, 3)
    """
    vertices, faces = double_rock()
    vertices = over_origin(vertices, faces)
    ring = np.flatnonzero(vertices[:, 2] == 0.0)[:-1]  # the last is the middle of the base
    size = len(ring)
    rim = rim_around(vertices[ring, :2], vertices[size : 2 * size, :2], _SEAM)

    def ground(places: Array) -> Array:
        return _ground(places, shape)

    blocks = _supports(vertices, shape) + _strewn(ground, shape)
    terrain, triangles, loop = sheet(_EXTENT, _spacing(shape), ground, blocks, rim)
    return SurrogateSite(
        rock_vertices=vertices,
        rock_faces=faces,
        terrain_vertices=terrain,
        terrain_faces=triangles,
        contact_rim=vertices[ring],
        clearance=shape.clearance,
        rock_rim=np.arange(size, 2 * size),
        seat_rim=loop,
    )


def _ground(places: Array, shape: Shape) -> Array:
    """Height [m] of the ground without blocks at ``places``, shape (n, 2) [m]."""
    x = places[:, 0]
    slope = _slope(places, shape)
    far = _far(places)
    broken = stepped(slope, 0.22 * waves(places, 5.0, 3), shape.step, shape.step_share)
    broken += shape.roughness * rough(places, 3.0, 3, 11)
    niche = _niche(places, shape)
    outward = (x - shape.niche_x) / (0.5 * shape.niche_length)
    floor = _niche_floor(shape) + shape.lip_height * rise((outward - 0.5) / 0.4)
    floor += 0.02 * waves(places, 0.9, 5)
    broken = (1.0 - niche) * broken + niche * floor
    # The ground about the seat only sinks away from it, so that the rock touches the seat alone.
    near = -shape.clearance - rise((_beside_seat(places) - 0.12) / 0.3) * (
        0.025 + 0.008 * np.clip(rough(places, 0.5, 3, 2), -3.0, 3.0)
    )
    return (1.0 - far) * near + far * broken


def _slope(places: Array, shape: Shape) -> Array:
    """Height [m] of the smooth outcrop: a knoll behind the seat, a spur, a chute down its nose."""
    x, y = places.T
    fall = math.tan(math.radians(shape.slope))
    along = x + 0.5 * waves(places, 9.0, 1) * rise((np.abs(y) - 0.8) / 3.0)
    height = -fall * ramp(along - shape.shoulder, 0.25)
    height += 0.8 * fall * ramp(along - shape.foot, 0.8)
    height += 0.45 * ramp(-0.9 - x, 0.25) - 0.5 * ramp(-2.8 - x, 0.5)
    height -= 0.28 * ramp(np.abs(y) - 4.0, 1.2)
    chute = np.exp(-(((y - shape.niche_y) / 1.7) ** 2))
    return height - shape.chute * chute * rise((x - shape.shoulder) / 2.0)


def _beside_seat(places: Array) -> Array:
    """Distance [m] from a box about the rock's base, shape (n,)."""
    return _beyond(places, (-0.56, 0.13, -0.38, 0.26))


def _far(places: Array) -> Array:
    """0 where the supports stand, 1 away from them, shape (n,)."""
    return rise((_beyond(places, (-0.95, 0.75, -0.65, 0.6)) - 0.05) / 0.5)


def _beyond(places: Array, box: tuple[float, float, float, float]) -> Array:
    """Distance [m] outside a box of least and greatest x, least and greatest y."""
    x, y = places.T
    across = np.maximum(np.maximum(box[0] - x, x - box[1]), 0.0)
    return np.hypot(across, np.maximum(np.maximum(box[2] - y, y - box[3]), 0.0))


def _niche(places: Array, shape: Shape) -> Array:
    """1 on the floor of the niche, 0 outside, steep between, shape (n,)."""
    u = (places[:, 0] - shape.niche_x) / (0.5 * shape.niche_length)
    v = (places[:, 1] - shape.niche_y) / (0.5 * shape.niche_width)
    distance = (u**4 + v**4) ** 0.25 + 0.05 * waves(places, 1.3, 9)
    return rise((1.42 - distance) / 0.4)


def _niche_floor(shape: Shape) -> float:
    middle = np.array([[shape.niche_x, shape.niche_y]])
    return float(_slope(middle, shape)[0]) - shape.niche_depth


def _spacing(shape: Shape) -> Field:
    def spacing(places: Array) -> Array:
        seat = _beyond(places, (-1.0, 0.8, -0.7, 0.65))
        u, v = 0.5 * shape.niche_length + 0.6, 0.5 * shape.niche_width + 0.3
        x, y = shape.niche_x, shape.niche_y
        niche = _beyond(places, (x - u, x + u, y - v, y + v))
        finest = np.minimum(_FINE + 0.12 * seat, 0.08 + 0.12 * niche)
        return np.minimum(finest, _COARSE)

    return spacing


def _supports(rock: Array, shape: Shape) -> list[Block]:
    """Blocks around the seat, their inner walls along the rock's flanks."""
    thickness = {"front": shape.front_depth, "back": shape.back_depth}
    heights = {"front": shape.front_height, "back": shape.back_height}
    blocks = []
    for kind, parts in (("front", _FRONT), ("back", _BACK)):
        for start, end, tall, deep in parts:
            height, depth = heights[kind] * tall, thickness[kind] * deep
            outline = _sector(rock, (start, end), height, depth, shape.gap)
            middle = math.radians(0.5 * (start + end))
            tilt = (-_DIP * math.cos(middle), -_DIP * math.sin(middle))
            blocks.append(Block(outline, _top(outline, height, tilt), _BATTER, _BEVEL))
    return blocks


def _sector(
    rock: Array, between: tuple[float, float], height: float, depth: float, gap: float
) -> Array:
    """Outline of a support: along the rock's hull below its top inside, irregular outside."""
    below = _below(rock, height + 0.05) - _HEART
    angles = np.radians(np.linspace(*between, 24))
    inner = polygon_radius(angles, below, gap)
    bulge = np.array([0.75, 1.0, 0.86, 1.05, 0.8])
    few = np.radians(np.linspace(*between, len(bulge)))
    outer = polygon_radius(few, below, gap) + depth * bulge
    loop = np.vstack(
        [
            np.column_stack([outer * np.cos(few), outer * np.sin(few)]),
            np.column_stack([inner * np.cos(angles), inner * np.sin(angles)])[::-1],
        ]
    )
    return resampled(rounded(loop) + _HEART, _FINE)


def _below(rock: Array, height: float) -> Array:
    """Corners, shape (n, 2) [m], of the shadow on the ground of the rock's hull below a height."""
    hull = ConvexHull(rock)
    edges = rock[hull.simplices[:, [0, 1, 1, 2, 2, 0]]].reshape(-1, 2, 3)
    edges = edges[(edges[:, :, 2] > height).sum(axis=1) == 1]
    low, high = edges[:, 0], edges[:, 1]
    share = (height - low[:, 2:]) / (high[:, 2:] - low[:, 2:])
    points = np.vstack([(low + share * (high - low))[:, :2], rock[rock[:, 2] <= height, :2]])
    return points[ConvexHull(points).vertices]


def _top(outline: Array, height: float, tilt: tuple[float, float]) -> Field:
    """A nearly plane top through ``height`` [m] over the middle of an outline."""
    middle = outline.mean(axis=0)

    def top(places: Array) -> Array:
        return height + (places - middle) @ np.array(tilt) + 0.006 * rough(places, 0.4, 2, 4)

    return top


def _strewn(ground: Field, shape: Shape) -> list[Block]:
    """Blocks of the jointed slope, large ones first, clear of the seat, the niche and others."""
    low, high = np.array(_EXTENT[::2]) + 1.3, np.array(_EXTENT[1::2]) - 1.3
    places = low + (high - low) * scattered(shape.blocks)
    spacing = _spacing(shape)
    blocks: list[Block] = []
    taken = [(shape.niche_x, shape.niche_y, 0.62 * shape.niche_width), (0.0, 0.0, 1.7)]
    for k, (x, y) in enumerate(places):
        radius = 0.3 + 0.85 * (1.0 - k / shape.blocks) ** 2
        if any(math.hypot(x - a, y - b) < 1.25 * (radius + r) for a, b, r in taken):
            continue
        taken.append((x, y, radius))
        blocks.append(_strewn_block(np.array([x, y]), radius, k, ground, spacing))
    return blocks


def _strewn_block(
    middle: Array, radius: float, number: int, ground: Field, spacing: Field
) -> Block:
    corners = 5 + number % 3
    turn = 2.0 * math.pi * (np.arange(corners) + 0.25 * np.cos(5.0 * np.arange(corners) + number))
    angles = turn / corners + 2.4 * number
    reach = radius * (0.85 + 0.2 * np.cos(3.0 * np.arange(corners) + 2.0 * number))
    outline = middle + np.column_stack([np.cos(angles), np.sin(angles)]) * reach[:, None]
    around = ground(middle + 0.8 * radius * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [0, 0]]))
    tilt = 0.45 * np.array([around[0] - around[1], around[2] - around[3]]) / (1.6 * radius)
    height = around.mean() + radius * (0.3 + 0.2 * math.sin(1.9 * number))
    outline = resampled(rounded(outline), 0.9 * float(spacing(middle[None])[0]))
    return Block(outline, _top(outline, height, (tilt[0], tilt[1])), 0.12 * radius, 0.08 * radius)
