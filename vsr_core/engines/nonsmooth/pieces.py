"""Whether a piece of a rock may be touched where another piece is beside it or in front of it.

A point of a piece is on the rock's surface where no other piece has it inside, or where those that
do end there: none of their corners is beyond it. In a notch the pieces on both sides go on, and
each is touched all the same, by what meets it beside.
"""

from __future__ import annotations

import math

from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import cross
from vsr_core.engines.nonsmooth.features import Edge
from vsr_core.engines.nonsmooth.tree import SAME_SHARE, Ground

BESIDE = 1e-3
"""How far beside a point it is asked whether a piece ends there, as a share of the radius."""

WAYS = 8
"""Directions in a face in which that is asked."""


@compiled
def face_shows(
    ground: Ground, number: int, x: float, y: float, z: float, gap: float, radius: float
) -> bool:
    """Whether a face of a piece is on the rock's surface where it is touched.

    Parameters
    ----------
    number : int, of the face
    x, y, z : float [m], the point, in principal axes
    gap : float [m], negative where the point is behind the face
    radius : float [m], of the rock
    """
    n, margin, reach = ground.faces[number].normal, SAME_SHARE * radius, BESIDE * radius
    own = ground.shape.home[number - ground.own_face]
    i, j, k, deep = n[0], n[1], n[2], min(gap, 0.0)
    x, y, z = x - deep * i, y - deep * j, z - deep * k
    if _is_in(ground, own, x, y, z, margin) and not _goes_on(ground, own, x, y, z, i, j, k, margin):
        return True
    if not _in_another(ground, own, x, y, z, margin):
        return False
    a, b, c = cross(i, j, k, 0.0, 0.0, 1.0) if abs(k) < 0.9 else cross(i, j, k, 1.0, 0.0, 0.0)
    size = math.sqrt(a * a + b * b + c * c)
    a, b, c = a / size, b / size, c / size
    d, e, f = cross(i, j, k, a, b, c)
    for way in range(WAYS):
        cos, sin = math.cos(2.0 * math.pi * way / WAYS), math.sin(2.0 * math.pi * way / WAYS)
        p = x + reach * (cos * a + sin * d)
        q = y + reach * (cos * b + sin * e)
        r = z + reach * (cos * c + sin * f)
        if not _is_in(ground, own, p, q, r, margin):
            continue
        if not _goes_on(ground, own, p, q, r, i, j, k, margin):
            return True
    return False


@compiled
def edge_shows(
    ground: Ground, edge: Edge, s: float, i: float, j: float, k: float, radius: float
) -> bool:
    """Whether an edge of a piece is on the rock's surface at a point of it.

    Parameters
    ----------
    s : float [m], along it
    i, j, k : float, unit vector out of the rock, in principal axes
    radius : float [m], of the rock
    """
    margin, reach = SAME_SHARE * radius, BESIDE * radius
    own, start, along = ground.shape.home[edge.face], edge.start, edge.along
    for n in range(3):
        t = s + reach * (n if n < 2 else -1)
        if n > 0 and (t < 0.0 or t > edge.length):
            continue
        x, y, z = start[0] + t * along[0], start[1] + t * along[1], start[2] + t * along[2]
        if not _goes_on(ground, own, x, y, z, i, j, k, margin):
            return True
    return False


@compiled
def _is_in(ground: Ground, piece: int, x: float, y: float, z: float, margin: float) -> bool:
    """Whether a point is in a piece."""
    for at in range(ground.shape.starts[piece], ground.shape.starts[piece + 1]):
        face = ground.faces[ground.own_face + at]
        normal = face.normal
        if normal[0] * x + normal[1] * y + normal[2] * z - face.offset > margin:
            return False
    return True


@compiled
def _in_another(ground: Ground, own: int, x: float, y: float, z: float, margin: float) -> bool:
    """Whether a point is in a piece besides one."""
    for piece in range(len(ground.shape.middles)):
        if piece != own and _is_in(ground, piece, x, y, z, margin):
            return True
    return False


@compiled
def _goes_on(
    ground: Ground,
    own: int,
    x: float,
    y: float,
    z: float,
    i: float,
    j: float,
    k: float,
    margin: float,
) -> bool:
    """Whether another piece that has a point in it has a corner beyond it along (i, j, k)."""
    shape = ground.shape
    for piece in range(len(shape.middles)):
        if piece == own or not _is_in(ground, piece, x, y, z, margin):
            continue
        for n in range(shape.begins[piece], shape.begins[piece + 1]):
            corner = shape.points[n]
            beyond = i * (corner[0] - x) + j * (corner[1] - y) + k * (corner[2] - z)
            if beyond > margin:
                return True
    return False
