"""Collision shapes of a rock and of what it stands on, as Bullet needs them."""

from __future__ import annotations

import itertools
import math
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.spatial import ConvexHull

from vsr_core.arrays import Array, matrix_product
from vsr_core.engines.bullet.binding import pybullet
from vsr_core.engines.bullet.tiles import triangle_shape
from vsr_core.rock.body import Hull, Rock, convex_hull

CONTACTS = 4
"""Contact points that Bullet keeps between two shapes."""

FLAT_SHARE = 1e-3
"""Corners this close to the pedestal at rest bear the rock, as a share of its radius."""

NARROW_SHARE = 0.1
"""Width of a base, as a share of the radius, below which its corners get feet. Bullet moves the
corners of a hull to a grid of a ten-thousandth of its length, by cutting digits: whether two equal
heights stay equal is a matter of the last bit, which differs from machine to machine. A step of the
grid under one corner tilts a base of this width by 3 % of the angle at which the rock topples, and
a needle by more than all of it."""

MOST_FEET = 6
"""Corners of a base that get feet: with six a rock on a flat base stands to within 2 % of its
static limit, as the hull adds the corner it leans on. Fifteen, all that Bullet takes, cost twice
as much."""

PEDESTAL_RADII = 20.0
"""Half the width of a slab or of a triangulated pedestal, in radii of the rock."""

MESH_CELLS = 80
"""Squares along a triangulated pedestal: half a radius each."""


def rock_shape(rock: Rock, scale: float, margin: float, client: int, *, on_level: bool) -> int:
    """Bullet's number of the rock's shape, in its principal axes, lengths times ``scale``.

    A hull on a flat base of more than four corners gets feet, balls as small as its ``margin``
    (in Bullet's length unit) in the corners of the base. Bullet keeps four contact points between
    two shapes, so that without feet the rock would stand on four of its corners and topple before
    its base says so. So does a narrow base on level ground (see ``NARROW_SHARE``); on a terrain the
    rock need not stand on it. There a rock of several pieces is these.

    Parameters
    ----------
    scale : float, Bullet's length units in a metre
    margin : float, of a hull, in Bullet's length unit
    client : int, Bullet's number of the connection
    on_level : bool, whether the rock stands on level ground

    Returns
    -------
    int, Bullet's number of the shape
    """
    if rock.shape == "box":
        half = np.abs(rock.vertices).max(axis=0) * scale
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=half.tolist(), physicsClientId=client
        )
    elif rock.shape == "sphere":
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_SPHERE, radius=rock.radius * scale, physicsClientId=client
        )
    elif rock.pieces and not on_level:
        shape = _pieces(rock, scale, client)
    elif len(feet := bearing_corners(rock)) > CONTACTS or (
        on_level and _width(feet) < NARROW_SHARE * rock.radius
    ):
        shape = _hull_on_feet(rock, matrix_product(feet, rock.axes) * scale, scale, margin, client)
    else:
        corners = matrix_product(rock.vertices, rock.axes) * scale
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH, vertices=corners.tolist(), physicsClientId=client
        )
    return int(shape)


def surroundings(rock: Rock) -> Array:
    """Corners of a convex body that holds the rock, shape (n, 3) [m]: its hull, or a cube.

    Returns
    -------
    ndarray, shape (n, 3) [m], in the rock's axes
    """
    if rock.shape == "sphere":
        return rock.radius * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    return rock.vertices


def bearing_corners(rock: Rock) -> Array:
    """Corners of the face that a rock rests on, shape (n, 3) [m]; at most ``MOST_FEET``.

    Of a base with more, those go first whose triangle with their neighbours is smallest.
    """
    low = rock.vertices[:, 2].min() + FLAT_SHARE * rock.radius
    base = rock.vertices[rock.vertices[:, 2] <= low]
    if len(base) < 3:
        return base
    corners = base[ConvexHull(base[:, :2]).vertices]
    while len(corners) > MOST_FEET:
        before, after = (np.roll(corners[:, :2], shift, axis=0) for shift in (1, -1))
        (x1, y1), (x2, y2) = (corners[:, :2] - before).T, (after - before).T
        corners = np.delete(corners, np.argmin(np.abs(x1 * y2 - y1 * x2)), axis=0)
    return corners


def _width(corners: Array) -> float:
    """Least width [m] of a convex outline, shape (n, 3), seen from above; inf if it is none."""
    if len(corners) < 3:
        return math.inf
    edges = np.roll(corners, -1, axis=0)[:, :2] - corners[:, :2]
    across = np.column_stack([-edges[:, 1], edges[:, 0]])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return float(np.ptp(corners[:, :2] @ across.T, axis=0).min())


def _hull_on_feet(rock: Rock, feet: Array, scale: float, margin: float, client: int) -> int:
    return _compound([_as_obj(rock.hull, rock.axes, scale)], feet, margin, client)


def _pieces(rock: Rock, scale: float, client: int) -> int:
    middles = [piece.mean(axis=0) for piece in rock.pieces]
    hulls = (convex_hull(piece - at) for piece, at in zip(rock.pieces, middles, strict=True))
    made = [
        _as_obj(replace(hull, vertices=hull.vertices + at), rock.axes, scale)
        for hull, at in zip(hulls, middles, strict=True)
    ]
    return _compound(made, np.empty((0, 3)), 0.0, client)


def _compound(bodies: Sequence[str], balls: Array, radius: float, client: int) -> int:
    """Convex bodies, as texts of files, and balls as one shape."""
    count = len(bodies) + len(balls)
    kinds = [pybullet.GEOM_MESH] * len(bodies) + [pybullet.GEOM_SPHERE] * len(balls)
    with ExitStack() as open_files:
        # Among several shapes PyBullet takes a hull only from a file.
        files = [
            open_files.enter_context(tempfile.NamedTemporaryFile("w", suffix=".obj"))
            for _ in bodies
        ]
        for file, body in zip(files, bodies, strict=True):
            file.write(body)
            file.flush()
        return int(
            pybullet.createCollisionShapeArray(
                shapeTypes=kinds,
                fileNames=[file.name for file in files] + [""] * len(balls),
                radii=[radius] * count,
                halfExtents=[[1.0] * 3] * count,
                lengths=[1.0] * count,
                meshScales=[[1.0] * 3] * count,
                collisionFramePositions=[[0.0] * 3] * len(bodies) + balls.tolist(),
                collisionFrameOrientations=[[0.0, 0.0, 0.0, 1.0]] * count,
                physicsClientId=client,
            )
        )


def _as_obj(hull: Hull, axes: Array, scale: float) -> str:
    """A hull in principal axes, lengths times ``scale``, as the text of a file."""
    corners = matrix_product(hull.vertices, axes) * scale
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (hull.facets + 1).tolist()]
    return "\n".join(lines)


def pedestal_shape(
    kind: Literal["plane", "box", "mesh"], radius: float, client: int
) -> tuple[int, list[float]]:
    """Bullet's number of a pedestal's shape and its centre; ``radius`` is the rock's in Bullet.

    Parameters
    ----------
    radius : float, of the rock, in Bullet's length unit
    client : int, Bullet's number of the connection

    Returns
    -------
    (int, list of float), Bullet's number of the shape, and where its centre lies
    """
    half = PEDESTAL_RADII * radius
    centre = [0.0, 0.0, 0.0]
    if kind == "plane":
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    elif kind == "box":
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[half, half, radius], physicsClientId=client
        )
        centre = [0.0, 0.0, -radius]
    else:
        shape = level_sheet(half, MESH_CELLS, client)
    return int(shape), centre


def level_sheet(half: float, cells: int, client: int) -> int:
    """Level square of triangles.

    Parameters
    ----------
    half : float, of its width, in Bullet's length unit
    cells : int, squares along a side, of two triangles each

    Returns
    -------
    int
        Bullet's number of the shape.
    """
    along = np.linspace(-half, half, cells + 1)
    x, y = np.meshgrid(along, along)
    corners = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    row = cells + 1
    a = (row * np.arange(cells)[:, None] + np.arange(cells)).ravel()
    triangles = np.concatenate(
        [np.column_stack([a, a + 1, a + row + 1]), np.column_stack([a, a + row + 1, a + row])]
    )
    return triangle_shape(corners, triangles.ravel(), client)


def leave_to_the_rock(body: int, link: int, client: int) -> None:
    """Have the rock's coefficients be those of the pair.

    Bullet multiplies friction and restitution of two bodies, and combines rolling friction as
    r1 mu2 + r2 mu1.
    """
    pybullet.changeDynamics(
        body,
        link,
        lateralFriction=1.0,
        restitution=1.0,
        rollingFriction=0.0,
        spinningFriction=0.0,
        physicsClientId=client,
    )
