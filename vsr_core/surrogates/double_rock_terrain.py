"""A surrogate of Double Rock's site: the rock in a niche near the top of a stepped slope.

Published are the relief of the outcrop, about 12 m, that the rock stands between lower pedestals
that support it laterally along its weak direction, and that rocks which topple tend to come to
rest after about 6 m. The ground here is made up of such parts: a level seat, supports around it,
a stepped slope with blocks, and down the slope a niche behind a lip that catches rocks.

References
----------
Chen et al. (2024), Seismica 3(1).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.surrogates.ground import (
    Field,
    StandingBlock,
    ramp,
    resampled,
    rise,
    rough,
    rounded,
    scattered,
    sheet,
    stepped,
    waves,
)
from vsr_core.surrogates.surrogate_site import (
    SurrogateSite,
    over_origin,
    polygon_radius,
    rim_around,
)

# What the ground looks like; lengths in metres, in the site frame.
CLEARANCE = 0.001  # of the seat below the rock's base
FRONT_HEIGHT, BACK_HEIGHT = 0.45, 0.5  # tops of the supports toward +x and -x, above the seat
FRONT_DEPTH, BACK_DEPTH = 0.34, 0.6  # radial thickness of the supports
GAP = 0.04  # between the supports' edges and the rock's hull below them
SLOPE = 34.0  # degree, mean slope below the shoulder
SHOULDER, FOOT = 1.0, 14.0  # x at which the slope begins, and at which it begins to level out
STEP, STEP_SHARE = 0.95, 0.85  # height of the slope's steps; 0 for none to 1 for level treads
ROUGHNESS = 0.09  # root mean square of the longest waves of the ground, away from the seat
CHUTE = 0.35  # depth of the shallow gully that leads to the niche
NICHE_X, NICHE_Y = 2.8, 0.15  # middle of the niche
NICHE_LENGTH, NICHE_WIDTH = 2.1, 2.9  # its size along x and along y
NICHE_DEPTH = 0.5  # of its floor below the slope at its middle
LIP_HEIGHT = 0.7  # of the rim on its outer side above its floor
BLOCKS = 150  # number of blocks tried on the slope

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


def site() -> SurrogateSite:
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

    blocks = _supports(vertices) + _strewn()
    terrain, triangles, loop = sheet(_EXTENT, _spacing, _ground, blocks, rim)
    return SurrogateSite(
        rock_vertices=vertices,
        rock_faces=faces,
        terrain_vertices=terrain,
        terrain_faces=triangles,
        contact_rim=vertices[ring],
        clearance=CLEARANCE,
        rock_rim=np.arange(size, 2 * size),
        seat_rim=loop,
    )


def _ground(places: Array) -> Array:
    """Height [m] of the ground without blocks at ``places``, shape (n, 2) [m]."""
    x = places[:, 0]
    slope = _slope(places)
    far = _far(places)
    broken = stepped(slope, 0.22 * waves(places, 5.0, 3), STEP, STEP_SHARE)
    broken += ROUGHNESS * rough(places, 3.0, 3, 11)
    niche = _niche(places)
    outward = (x - NICHE_X) / (0.5 * NICHE_LENGTH)
    floor = _niche_floor() + LIP_HEIGHT * rise((outward - 0.5) / 0.4)
    floor += 0.02 * waves(places, 0.9, 5)
    broken = (1.0 - niche) * broken + niche * floor
    # The ground about the seat only sinks away from it, so that the rock touches the seat alone.
    near = -CLEARANCE - rise((_beside_seat(places) - 0.12) / 0.3) * (
        0.025 + 0.008 * np.clip(rough(places, 0.5, 3, 2), -3.0, 3.0)
    )
    return (1.0 - far) * near + far * broken


def _slope(places: Array) -> Array:
    """Height [m] of the smooth outcrop: a knoll behind the seat, a spur, a chute down its nose."""
    x, y = places.T
    fall = math.tan(math.radians(SLOPE))
    along = x + 0.5 * waves(places, 9.0, 1) * rise((np.abs(y) - 0.8) / 3.0)
    height = -fall * ramp(along - SHOULDER, 0.25)
    height += 0.8 * fall * ramp(along - FOOT, 0.8)
    height += 0.45 * ramp(-0.9 - x, 0.25) - 0.5 * ramp(-2.8 - x, 0.5)
    height -= 0.28 * ramp(np.abs(y) - 4.0, 1.2)
    chute = np.exp(-(((y - NICHE_Y) / 1.7) ** 2))
    return height - CHUTE * chute * rise((x - SHOULDER) / 2.0)


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


def _niche(places: Array) -> Array:
    """1 on the floor of the niche, 0 outside, steep between, shape (n,)."""
    u = (places[:, 0] - NICHE_X) / (0.5 * NICHE_LENGTH)
    v = (places[:, 1] - NICHE_Y) / (0.5 * NICHE_WIDTH)
    distance = (u**4 + v**4) ** 0.25 + 0.05 * waves(places, 1.3, 9)
    return rise((1.42 - distance) / 0.4)


def _niche_floor() -> float:
    middle = np.array([[NICHE_X, NICHE_Y]])
    return float(_slope(middle)[0]) - NICHE_DEPTH


def _spacing(places: Array) -> Array:
    """Length of edges [m]."""
    seat = _beyond(places, (-1.0, 0.8, -0.7, 0.65))
    u, v = 0.5 * NICHE_LENGTH + 0.6, 0.5 * NICHE_WIDTH + 0.3
    niche = _beyond(places, (NICHE_X - u, NICHE_X + u, NICHE_Y - v, NICHE_Y + v))
    finest = np.minimum(_FINE + 0.12 * seat, 0.08 + 0.12 * niche)
    return np.minimum(finest, _COARSE)


def _supports(rock: Array) -> list[StandingBlock]:
    """Blocks around the seat, their inner walls along the rock's flanks."""
    blocks = []
    for parts, top, thickness in (
        (_FRONT, FRONT_HEIGHT, FRONT_DEPTH),
        (_BACK, BACK_HEIGHT, BACK_DEPTH),
    ):
        for start, end, tall, deep in parts:
            height = top * tall
            outline = _sector(rock, (start, end), height, thickness * deep)
            middle = math.radians(0.5 * (start + end))
            tilt = (-_DIP * math.cos(middle), -_DIP * math.sin(middle))
            blocks.append(StandingBlock(outline, _top(outline, height, tilt), _BATTER, _BEVEL))
    return blocks


def _sector(rock: Array, between: tuple[float, float], height: float, depth: float) -> Array:
    """Outline of a support: along the rock's hull below its top inside, irregular outside."""
    below = _below(rock, height + 0.05) - _HEART
    angles = np.radians(np.linspace(*between, 24))
    inner = polygon_radius(angles, below, GAP)
    bulge = np.array([0.75, 1.0, 0.86, 1.05, 0.8])
    few = np.radians(np.linspace(*between, len(bulge)))
    outer = polygon_radius(few, below, GAP) + depth * bulge
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


def _strewn() -> list[StandingBlock]:
    """Blocks of the jointed slope, large ones first, clear of the seat, the niche and others."""
    low, high = np.array(_EXTENT[::2]) + 1.3, np.array(_EXTENT[1::2]) - 1.3
    places = low + (high - low) * scattered(BLOCKS)
    blocks: list[StandingBlock] = []
    taken = [(NICHE_X, NICHE_Y, 0.62 * NICHE_WIDTH), (0.0, 0.0, 1.7)]
    for k, (x, y) in enumerate(places):
        radius = 0.3 + 0.85 * (1.0 - k / BLOCKS) ** 2
        if any(math.hypot(x - a, y - b) < 1.25 * (radius + r) for a, b, r in taken):
            continue
        taken.append((x, y, radius))
        blocks.append(_strewn_block(np.array([x, y]), radius, k))
    return blocks


def _strewn_block(middle: Array, radius: float, number: int) -> StandingBlock:
    corners = 5 + number % 3
    turn = 2.0 * math.pi * (np.arange(corners) + 0.25 * np.cos(5.0 * np.arange(corners) + number))
    angles = turn / corners + 2.4 * number
    reach = radius * (0.85 + 0.2 * np.cos(3.0 * np.arange(corners) + 2.0 * number))
    outline = middle + np.column_stack([np.cos(angles), np.sin(angles)]) * reach[:, None]
    around = _ground(middle + 0.8 * radius * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [0, 0]]))
    tilt = 0.45 * np.array([around[0] - around[1], around[2] - around[3]]) / (1.6 * radius)
    height = around.mean() + radius * (0.3 + 0.2 * math.sin(1.9 * number))
    outline = resampled(rounded(outline), 0.9 * float(_spacing(middle[None])[0]))
    return StandingBlock(
        outline, _top(outline, height, (tilt[0], tilt[1])), 0.12 * radius, 0.08 * radius
    )
