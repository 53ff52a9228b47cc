"""What of a rock can touch a terrain, computed once: of its hull, or of the pieces that it is.

Pieces lie beside each other. A face that is inside other pieces is no part of the rock's surface:
it is left out, and with it each piece goes on into its neighbours, so that what slides over a
border, or lies in a notch, meets the faces that the rock has.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.compiled.records import layout
from vsr_core.engines.nonsmooth.features import Columns, Edge, Face, lines
from vsr_core.rock.body import Hull, convex_hull

_SPREAD = 4  # parts of a facet's side, between points in which it is asked what covers it


class RockFeatures(NamedTuple):
    """Faces, edges and corners of a rock in principal axes.

    Attributes
    ----------
    faces : array of ``Face``, of the hull and then of the pieces, if any
    ring : ndarray of int, shape (f, k), neighbours of each face, the last repeated
    edges : array of ``Edge``, of what touches: the hull, or the pieces; as are the next ones
    corners : ndarray, shape (c, 3) [m]
    middles : ndarray, shape (p, 3) [m], a point inside each piece; the centre of mass in a hull
    firsts : ndarray of int, shape (p,), a face of each on the rock's surface
    home : ndarray of int, shape (f,), piece of each face; -1 of a hull that does not touch
    starts : ndarray of int, shape (p + 1,), where the faces of each piece begin
    points : ndarray, shape (k, 3) [m], corners of one piece after another
    begins : ndarray of int, shape (p + 1,), where those of each begin
    """

    faces: Columns
    ring: Indices
    edges: Columns
    corners: Array
    middles: Array
    firsts: Indices
    home: Indices
    starts: Indices
    points: Array
    begins: Indices


class _Body(NamedTuple):
    """A convex body: its middle [m], its hull about it, and its edges with the corners there."""

    middle: Array
    hull: Hull
    faces: Columns
    edges: Columns
    ends: Indices

    @property
    def corners(self) -> Array:
        return self.middle + self.hull.vertices

    def beyond(self, points: Array) -> Array:
        """How far points, shape (n, 3), are beyond it, shape (n,) [m]."""
        out = (points - self.middle) @ self.hull.normals.T - self.hull.offsets
        return np.asarray(out.max(axis=1))


def of_sphere() -> RockFeatures:
    """Of a sphere there are none."""
    none, index = np.empty((0, 3)), np.empty(0, np.int64)
    ring, faces, edges = np.empty((0, 1), np.int64), np.empty(0, layout(Face)), layout(Edge)
    of_pieces = none, none, index, index, index, none, index
    return RockFeatures(faces, ring, np.empty(0, edges), *of_pieces)


def of_rock(hull: Hull, pieces: Sequence[Array], margin: float) -> RockFeatures:
    """Features of a rock.

    Parameters
    ----------
    pieces : sequence of ndarray, each of shape (k, 3) [m]; none where the hull touches
    margin : float [m], to which it is known where pieces meet
    """
    whole = _body(np.zeros(3), hull)
    made = [_body(at, convex_hull(piece - at)) for piece in pieces for at in [piece.mean(axis=0)]]
    bodies, touching = [whole, *made], made or [whole]
    counts = [len(body.faces) for body in bodies]
    starts = np.cumsum([0, *counts])
    shown = [np.ones(len(whole.faces), dtype=bool)]
    shown += [~_covered(body, made, margin) for body in made]
    rings = [_ring(body, own) for body, own in zip(bodies, shown, strict=True)]
    width = max(ring.shape[1] for ring in rings)
    ring = np.concatenate(
        [
            start + np.pad(own, ((0, 0), (0, width - own.shape[1])), mode="edge")
            for own, start in zip(rings, starts, strict=False)
        ]
    )
    first, places = len(bodies) - len(touching), [body.corners for body in touching]
    edges = [_edges(body, touching, margin) for body in touching]
    for own, start in zip(edges, starts[first:], strict=False):
        own["face"] += start
    return RockFeatures(
        np.concatenate([body.faces for body in bodies]),
        ring,
        np.concatenate(edges),
        _corners(touching, margin),
        np.array([body.middle for body in touching]),
        starts[first:-1] + [int(own.argmax()) for own in shown[first:]],
        np.repeat(np.arange(len(bodies)) - first, counts),
        starts[first:],
        np.concatenate(places),
        np.cumsum([0, *map(len, places)]),
    )


def _body(middle: Array, hull: Hull) -> _Body:
    """Flat faces and edges of a hull."""
    facet, corner = np.nonzero(hull.face[hull.neighbours] != hull.face[:, None])
    ends = np.stack([hull.facets[facet, (corner + k) % 3] for k in (1, 2)], axis=1)
    other = hull.neighbours[facet, corner]
    once = hull.face[facet] < hull.face[other]
    facet, other, ends = facet[once], other[once], ends[once]
    faces = np.zeros(hull.face.max() + 1, layout(Face))
    faces["normal"][hull.face], faces["offset"][hull.face] = hull.normals, hull.offsets
    faces["offset"] += faces["normal"] @ middle
    edges = np.zeros(len(facet), layout(Edge))
    start, edges["along"], edges["length"] = lines(
        hull.vertices[ends[:, 0]], hull.vertices[ends[:, 1]]
    )
    edges["start"], edges["face"], edges["line"] = (
        start + middle,
        hull.face[facet],
        np.arange(len(edges)),
    )
    for name, beside in (("left", facet), ("right", other)):
        inside = hull.vertices[hull.facets[beside]].mean(axis=1) - start
        within = np.cross(hull.normals[beside], edges["along"])
        within *= np.sign((within * inside).sum(axis=1))[:, None]
        edges[name] = within
    return _Body(middle, hull, faces, edges, ends)


def _ring(body: _Body, kept: Mask) -> Indices:
    """Neighbours of each face of the body that only the faces ``kept`` bound, shape (f, k).

    Where that is open to infinity, the faces around its openings are neighbours of each other: a
    search for the face that a ray meets goes past them.
    """
    own = np.flatnonzero(kept)
    offsets = body.faces["offset"] - body.faces["normal"] @ body.middle
    duals = (body.faces["normal"] / offsets[:, None])[own]
    beside: list[set[int]] = [set() for _ in body.faces]
    try:
        found = ConvexHull(np.vstack([duals, np.zeros(3)])).simplices
    except (QhullError, ValueError):  # of faces along one line, or too few
        facets = [own.tolist()]
    else:
        facets = np.append(own, -1)[found].tolist()
        facets.append(sorted({face for facet in facets if -1 in facet for face in facet} - {-1}))
    for facet in facets:
        for face in facet:
            if face >= 0:
                beside[face].update(other for other in facet if other not in (face, -1))
    width = max(1, *map(len, beside))
    rows = [sorted(others) or [face] for face, others in enumerate(beside)]
    return np.array([row + row[-1:] * (width - len(row)) for row in rows], np.int64)


def _covered(body: _Body, others: Sequence[_Body], margin: float) -> Mask:
    """Which faces of a piece are inside other pieces, shape (f,)."""
    share = np.array(
        [(i, j, _SPREAD - i - j) for i in range(_SPREAD + 1) for j in range(_SPREAD + 1 - i)]
    )
    points = np.einsum("kb,fbx->fkx", share / _SPREAD, body.corners[body.hull.facets])
    near = [other.beyond(points.reshape(-1, 3)) <= margin for other in others if other is not body]
    within = np.any([np.zeros(points.shape[0] * points.shape[1], dtype=bool), *near], axis=0)
    covered = np.ones(len(body.faces), dtype=bool)
    np.logical_and.at(covered, body.hull.face, within.reshape(points.shape[:2]).all(axis=1))
    return covered


def _edges(body: _Body, others: Sequence[_Body], margin: float) -> Columns:
    """Edges of a piece, but for those inside another one, which cannot touch."""
    inside = np.zeros(len(body.edges), dtype=bool)
    for other in others:
        if other is not body:
            inside |= (other.beyond(body.corners) < -margin)[body.ends].all(axis=1)
    return body.edges[~inside]


def _corners(bodies: Sequence[_Body], margin: float) -> Array:
    """Corners of pieces that stand out of all pieces that meet there, shape (c, 3) [m]."""
    found: list[Array] = []
    for body in bodies:
        near = [other.beyond(body.corners) <= margin for other in bodies]
        for at, corner in enumerate(body.corners):
            meeting = [k for k, other in enumerate(bodies) if near[k][at] or other is body]
            if any(np.linalg.norm(corner - other) <= margin for other in found):
                continue
            points = np.concatenate([bodies[k].corners for k in meeting])
            if len(meeting) == 1 or _stands_out(corner, points, margin):
                found.append(corner)
    return np.array(found)


def _stands_out(corner: Array, points: Array, margin: float) -> bool:
    """Whether a point is beyond the hull of others, those that it is itself left out."""
    planes = ConvexHull(points[np.linalg.norm(points - corner, axis=1) > margin]).equations
    return bool((planes[:, :3] @ corner + planes[:, 3]).max() > margin)
