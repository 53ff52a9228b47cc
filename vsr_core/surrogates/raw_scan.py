"""What a survey of a surrogate site from photographs would bring: one open, noisy surface.

Structure from motion sees neither the rock's base nor the ground under it. Its mesh runs from the
ground up the rock in one sheet, in projected coordinates, with the usual faults of an export.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.rock.triangles import cross_products
from vsr_core.surrogates.surrogate_site import SurrogateSite

_OFFSET = np.array([712345.678, 3894567.89, 251.3])  # m, site frame to projected coordinates
_SPLIT_SHARE = 0.02  # of the faces, with vertices of their own, doubled from their neighbours'
_HIDDEN = 0.01  # m above the seat, below which the crevice hides the rock
_PATCH = 0.25  # m, radius of the patches on the rock and beside it that are wound wrongly
_ROCK, _GROUND = (116, 94, 82), (190, 174, 152)  # mean red, green, blue: varnish, lighter ground


@dataclass(frozen=True, eq=False)
class RawScan:
    """A scan as it comes, and what is true of it.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m], projected coordinates: easting, northing, height
    faces : ndarray of int64, shape (m, 3)
    colours : ndarray of uint8, shape (n, 3), red, green, blue of each vertex
    rock : ndarray of bool, shape (m,), the faces that show the rock
    offset : ndarray, shape (3,) [m], from the site frame to the scan's coordinates
    """

    vertices: Array
    faces: Indices
    colours: NDArray[np.uint8]
    rock: Mask
    offset: Array


def scan(site: SurrogateSite, seed: int = 0, noise: float = 0.005, spacing: float = 0.4) -> RawScan:
    """Scan a site.

    Parameters
    ----------
    seed : int, of all that is random; the same seed gives the same bytes
    noise : float [m], root mean square of the error along the normals: half of its variance is
        white, half smooth over decimetres
    spacing : float [m], longest edge before the noise; longer ones are halved
    """
    random = np.random.default_rng(seed)
    vertices, faces, rock = _refined(*_seen(site), spacing)
    error = (
        noise * np.sqrt(0.5) * (random.standard_normal(len(vertices)) + _smooth(vertices, random))
    )
    colours = _colours(vertices, faces[rock], random)
    turned = _miswound(vertices, faces, rock, random)
    vertices = vertices + error[:, None] * _normals(vertices, faces) + _OFFSET
    faces = turned
    own = random.choice(len(faces), round(_SPLIT_SHARE * len(faces)), replace=False)
    doubled = faces[own].ravel()
    faces[own] = len(vertices) + np.arange(len(doubled)).reshape(-1, 3)
    vertices, colours = (
        np.vstack([vertices, vertices[doubled]]),
        np.vstack([colours, colours[doubled]]),
    )
    order, place = random.permutation(len(faces)), random.permutation(len(vertices))
    return RawScan(
        vertices=vertices[np.argsort(place)],
        faces=place[faces[order]],
        colours=colours[np.argsort(place)],
        rock=rock[order],
        offset=_OFFSET,
    )


def _seen(site: SurrogateSite) -> tuple[Array, Indices, Mask]:
    """Vertices, faces and which of them are rock, of the one sheet that can be seen.

    The rock below ``_HIDDEN`` and the terrain within the seat's rim are not; a strip joins the two.
    """
    rim, count = site.rock_vertices[site.rock_rim], len(site.rock_vertices)
    rock = (site.rock_vertices[site.rock_faces, 2] >= rim[:, 2].min()).all(axis=1)
    hole = site.terrain_vertices[site.seat_rim, :2]
    middles = site.terrain_vertices[site.terrain_faces, :2].mean(axis=1)
    terrain = count + site.terrain_faces[~shapely.contains_xy(shapely.Polygon(hole), middles)]
    share = (_HIDDEN / rim[:, 2])[:, None]
    foot = (1.0 - share) * site.contact_rim + share * rim
    vertices = np.vstack([site.rock_vertices, site.terrain_vertices, foot])
    low = len(vertices) - len(foot) + np.arange(len(foot))
    side = _band(low, site.rock_rim)
    faces = np.vstack([site.rock_faces[rock], side, terrain, _band(count + site.seat_rim, low)])
    used, named = np.unique(faces, return_inverse=True)
    shown = np.arange(len(faces)) < np.count_nonzero(rock) + len(side)
    return vertices[used], named.reshape(-1, 3), shown


def _band(outer: Indices, inner: Indices) -> Indices:
    """Triangles between two loops of as many vertices, counter-clockwise seen from outside."""
    outer_next, inner_next = np.roll(outer, -1), np.roll(inner, -1)
    return np.vstack(
        [
            np.column_stack([outer, outer_next, inner_next]),
            np.column_stack([outer, inner_next, inner]),
        ]
    )


def _refined(
    vertices: Array, faces: Indices, rock: Mask, longest: float
) -> tuple[Array, Indices, Mask]:
    """Halve edges until none is longer than ``longest`` [m]; faces stay joined edge to edge."""
    while True:
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, which = np.unique(edges, axis=0, return_inverse=True)
        ends = vertices[edges]
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > longest
        if not long.any():
            return vertices, faces, rock
        middle = np.where(long, len(vertices) + np.cumsum(long) - 1, -1)
        vertices = np.vstack([vertices, ends[long].mean(axis=1)])
        faces, parent = _divided(faces, middle[which].reshape(-1, 3))
        rock = rock[parent]


def _divided(faces: Indices, middle: Indices) -> tuple[Indices, Indices]:
    """Divide faces at the middles of edges 01, 12 and 20, -1 where an edge stays whole.

    Returns
    -------
    faces : ndarray of int, shape (n, 3)
    parent : ndarray of int, shape (n,), the face that each was part of
    """
    count = (middle >= 0).sum(axis=1)
    # Turned so that the one halved edge of a face is its 01, and the one whole edge its 20.
    first = np.where(count == 1, np.argmax(middle >= 0, axis=1), np.argmin(middle, axis=1) + 1)
    first[count == 3] = 0
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middle, turn, axis=1).T
    parts = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(a, ab, bc), (ab, b, bc), (a, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    divided, parent = [], []
    for halved, corners in parts.items():
        own = np.flatnonzero(count == halved)
        for three in corners:
            divided.append(np.column_stack(three)[own])
            parent.append(own)
    return np.vstack(divided), np.concatenate(parent)


def _smooth(vertices: Array, random: np.random.Generator) -> Array:
    """Noise of root mean square 1 that is smooth over decimetres, at each vertex."""
    count = 48
    direction = random.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    number = 2.0 * np.pi / random.uniform(0.5, 2.0, count)  # lengths of 0.5 to 2 m
    phase = random.uniform(0.0, 2.0 * np.pi, count)
    value: Array = np.cos(vertices @ (direction * number[:, None]).T + phase).sum(axis=1)
    return value * np.sqrt(2.0 / count)


def _normals(vertices: Array, faces: Indices) -> Array:
    """Unit normal at each vertex, shape (n, 3): the mean of its faces' by area."""
    area = cross_products(vertices, faces)
    normals = np.zeros_like(vertices)
    for corner in faces.T:
        np.add.at(normals, corner, area)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _colours(vertices: Array, rock: Indices, random: np.random.Generator) -> NDArray[np.uint8]:
    mean = np.tile(np.array(_GROUND, dtype=np.float64), (len(vertices), 1))
    mean[np.unique(rock)] = _ROCK
    stain = 9.0 * _smooth(vertices, random) + 5.0 * random.standard_normal(len(vertices))
    return np.clip(mean + stain[:, None], 0, 255).astype(np.uint8)


def _miswound(vertices: Array, faces: Indices, rock: Mask, random: np.random.Generator) -> Indices:
    """Faces with a patch on the rock and a patch within 2 m of it wound wrongly."""
    faces, middles = faces.copy(), vertices[faces].mean(axis=1)
    beside = ~rock & (np.linalg.norm(middles - middles[rock].mean(axis=0), axis=1) < 2.0)
    for part in (rock, beside):
        centre = middles[random.choice(np.flatnonzero(part))]
        patch = part & (np.linalg.norm(middles - centre, axis=1) < _PATCH)
        faces[patch] = faces[patch][:, ::-1]
    return faces
