"""A raw scan cleaned: near the origin, one piece, each edge between two faces or on a rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.graph import connected_component_labels

from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput, InvalidPlace
from vsr_core.rock.triangles import areas, chunks, cross_products, of_no_face
from vsr_core.scan.topology import edges, ends, split_fans
from vsr_core.terrain.surface import Terrain

MEMORY = 4 * 2**30
"""What cleaning may take, the given mesh included [byte]: 20 million faces of a scan without
split vertices."""

_BYTES_A_FACE, _BYTES_A_VERTEX = 180, 30  # measured peak, on scans of 1 and 2 million faces

SIZES = (0.1, 1000.0)
"""Shortest and longest of the longest sides of a scan in metres [m]."""

SAME_POINT = 1e-6
"""Vertices that agree to this [m] were split by an exporter and are one."""

FAULTY_SHARE = 0.01
"""Share of the area that may be dropped where edges branch; more is no surface."""

LOOSE_SHARE = 0.05
"""Share of the area that may be dropped as loose pieces; a larger piece may be the rock."""

LARGEST_LOOSE = 0.05
"""Longest side [m] of a closed piece that may be dropped beside a scan of rock and ground."""


@dataclass(frozen=True)
class Cleaned:
    """A clean scan.

    Attributes
    ----------
    mesh : trimesh.Trimesh [m], z up, normals outward
    offset : ndarray, shape (3,) [m], whole metres; given coordinates are the mesh's plus these
    """

    mesh: trimesh.Trimesh
    offset: Array
    notes: tuple[str, ...]


def clean(mesh: trimesh.Trimesh, *, alone: bool = False) -> Cleaned:
    """Clean copy of a raw scan; colours of vertices are kept.

    Parameters
    ----------
    alone : bool, whether it holds a rock alone, closed but for holes, and no ground

    Raises
    ------
    InvalidInput
        If the scan is empty, too large for the memory, of an unlikely size, stored too coarsely,
        in several large pieces, beside a closed rock, not a surface, or without outside.
    """
    _require_memory(mesh)
    notes = of_no_face(len(mesh.vertices), np.asarray(mesh.faces))
    colours = colours_of(mesh)
    vertices, offset, faces = _near_origin(mesh, notes)
    if not alone:
        _require_size(vertices)
        if offset.any():
            moved = ", ".join(f"{-x:.0f}" for x in offset)
            notes.append(f"moved by ({moved}) m to near the origin")
    origin, faces = _merged(vertices, faces, notes)
    if len(faces) == 0:
        raise InvalidInput(
            "a scan without a face between three finite points",
            "a scan has a surface",
            "export the scan again",
        )
    vertices = vertices[origin]
    faces = with_area(vertices, faces, notes)
    faces = _manifold(vertices, faces, notes)
    faces = _one_piece(vertices, faces, notes, alone)
    faces, copied = split_fans(faces, len(vertices))
    if len(copied):
        notes.append(f"{len(copied)} vertices where the surface only touched itself split")
    origin = np.concatenate([origin, origin[copied]])
    vertices = np.concatenate([vertices, vertices[copied]])
    used = np.zeros(len(vertices), dtype=bool)
    used[faces.ravel()] = True
    faces = (np.cumsum(used) - 1)[faces]
    cleaned = trimesh.Trimesh(
        vertices[used],
        faces,
        vertex_colors=None if colours is None else colours[origin[used]],
        process=False,
    )
    return Cleaned(cleaned, offset, tuple(notes))


def _require_memory(mesh: trimesh.Trimesh) -> None:
    count = len(mesh.faces)
    if count == 0:
        raise InvalidInput("a scan without faces", "a scan has a surface", "export the scan again")
    needed = count * _BYTES_A_FACE + len(mesh.vertices) * _BYTES_A_VERTEX
    if needed > MEMORY:
        raise InvalidInput(
            f"a scan of {count / 1e6:.1f} million faces, {needed / 2**30:.1f} GiB to clean",
            f"at most {MEMORY / 2**30:.0f} GiB: about 20 million faces",
            "decimate or crop it first; 2 million faces resolve 1 mm on a rock of 1 m",
        )


def colours_of(mesh: trimesh.Trimesh) -> NDArray[np.uint8] | None:
    """Colours of a mesh's vertices.

    Returns
    -------
    ndarray of uint8, shape (n, 4), or None
        Red, green, blue and opacity; None where it has none.
    """
    visual: Any = mesh.visual
    return np.asarray(visual.vertex_colors) if getattr(visual, "kind", None) == "vertex" else None


def _near_origin(mesh: trimesh.Trimesh, notes: list[str]) -> tuple[Array, Array, Indices]:
    """Vertices less whole metres, those metres, and the faces whose vertices are finite."""
    vertices = np.array(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    finite = np.asarray(np.isfinite(vertices).all(axis=1))
    if not finite.all():
        whole = finite[faces].all(axis=1)
        notes.append(
            f"{int((~finite).sum())} vertices that are not finite and "
            f"{int((~whole).sum())} faces at them dropped"
        )
        faces = faces[whole]
        vertices[~finite] = vertices[finite][:1] if finite.any() else 0.0
    _require_precision(vertices, float(max(-vertices.min(), vertices.max())))
    offset = whole_metres(vertices)
    vertices -= offset
    return vertices, offset, faces


def whole_metres(vertices: Array) -> Array:
    """The middle of points, in whole metres, shape (3,)."""
    return np.round(0.5 * (vertices.min(axis=0) + vertices.max(axis=0)))


def _require_size(vertices: Array) -> None:
    size = float(np.ptp(vertices, axis=0).max())
    if not SIZES[0] <= size <= SIZES[1]:
        raise InvalidInput(
            f"a scan {size:.3g} m large",
            f"scans here are {SIZES[0]} to {SIZES[1]:.0f} m",
            "scale it to metres, or crop it around the rock",
        )


def _require_precision(vertices: Array, largest: float) -> None:
    spacing = float(np.spacing(np.float32(largest)))
    if spacing > 1e-3 and bool((vertices == vertices.astype(np.float32)).all()):
        raise InvalidInput(
            f"coordinates in single precision, {largest:.3g} m from their origin",
            f"a rock needs 1 mm; these come in steps of {spacing:.2g} m",
            "export in double precision or about a local origin",
        )


def _merged(vertices: Array, faces: Indices, notes: list[str]) -> tuple[Indices, Indices]:
    """One vertex of each of those at the same point; faces on them, those without area gone."""
    x, y, z = (np.round(vertices[:, k] / SAME_POINT).astype(np.int32) for k in range(3))
    order = np.lexsort((x, y, z))
    new = np.zeros(len(order), dtype=bool)
    new[0] = True
    for values in (x, y, z):
        ordered = values[order]
        new[1:] |= ordered[1:] != ordered[:-1]
    del x, y, z, values, ordered
    name = np.empty(len(order), dtype=np.int64)
    name[order] = np.cumsum(new) - 1
    origin = order[new]
    if len(origin) < len(order):
        notes.append(f"{len(order) - len(origin)} split vertices merged")
    faces = name[faces]
    flat = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    if flat.any():
        notes.append(f"{int(flat.sum())} faces between fewer than three points dropped")
        faces = faces[~flat]
    return origin, faces


def with_area(vertices: Array, faces: Indices, notes: list[str]) -> Indices:
    """Faces that lie on a line turned about their longest side, into the face beyond it.

    Of several beside each other those are first that have one of area beyond that side.

    Returns
    -------
    ndarray of int, shape (k, 3)
    """
    flat = np.flatnonzero(areas(vertices, faces) <= SAME_POINT**2)
    if len(flat) == 0:
        return faces
    number = len(flat)
    while len(flat) and len(found := _turned(vertices, faces, flat)):
        faces = faces.copy()
        one, other = found.T
        apex = faces[one // 3, (one % 3 + 2) % 3]
        beyond = faces[other // 3, (other % 3 + 2) % 3]
        start, end = ends(faces, other).T
        faces[one // 3] = np.column_stack([start, apex, beyond])
        faces[other // 3] = np.column_stack([apex, end, beyond])
        before, flat = len(flat), np.flatnonzero(areas(vertices, faces) <= SAME_POINT**2)
        if len(flat) == before:
            break
    notes.append(f"{number} faces without area repaired, {len(flat)} of them dropped")
    return np.delete(faces, flat, axis=0)


def _turned(vertices: Array, faces: Indices, flat: Indices) -> Indices:
    """Longest sides of faces without area, shape (k, 2), each with that of the face beyond it."""
    found = edges(faces).pairs
    own = np.isin(found // 3, flat)
    found = np.concatenate([found[own[:, 0]], found[own[:, 1]][:, ::-1]])
    lengths = np.linalg.norm(vertices[faces[flat]] - vertices[np.roll(faces[flat], -1, 1)], axis=2)
    longest = np.full(len(faces), -1)
    longest[flat] = 3 * flat + np.argmax(lengths, axis=1)
    found = found[longest[found[:, 0] // 3] == found[:, 0]]
    found = found[~np.isin(found[:, 1] // 3, flat)]
    return found[np.unique(found[:, 1] // 3, return_index=True)[1]]


def _manifold(vertices: Array, faces: Indices, notes: list[str]) -> Indices:
    """Of more than two faces at an edge the largest two are kept, of equal faces one."""
    area, total = areas(vertices, faces), 0.0
    whole, before = float(area.sum()), len(faces)
    while True:
        found = edges(faces)
        branching = np.repeat(found.count > 2, found.count)
        if not branching.any():
            break
        group = np.repeat(np.arange(len(found.count)), found.count)[branching]
        face = found.side[branching] // 3
        names = np.sort(faces[face], axis=1)
        order = np.lexsort((face, *names.T, -area[face], group))
        group, face, names = group[order], face[order], names[order]
        same = np.concatenate(
            [[False], (group[1:] == group[:-1]) & (names[1:] == names[:-1]).all(axis=1)]
        )
        drop = same.copy()
        kept = np.cumsum(~same)
        first = np.searchsorted(group, group)
        drop |= kept - kept[first] >= 2
        keep = np.ones(len(faces), dtype=bool)
        keep[face[drop]] = False
        total += float(area[~keep].sum())
        faces, area = faces[keep], area[keep]
    if total > FAULTY_SHARE * whole:
        raise InvalidInput(
            f"a mesh whose edges branch ({total / whole:.0%} of its area in excess)",
            f"an edge joins two faces; faces in excess make up at most {FAULTY_SHARE:.0%}",
            "remesh the scan as one surface",
        )
    if len(faces) < before:
        notes.append(f"{before - len(faces)} faces dropped where edges branched ({total:.2g} m2)")
    return faces


def _one_piece(vertices: Array, faces: Indices, notes: list[str], alone: bool) -> Indices:
    """The largest piece, all faces wound alike and outward."""
    found = edges(faces)
    pairs, rim = found.pairs, found.open // 3
    del found
    start = ends(faces, pairs[:, 0])[:, 0]
    alike = start != ends(faces, pairs[:, 1])[:, 0]
    del start
    pairs //= 3
    patch = connected_component_labels(pairs[alike], len(faces))
    across = np.unique(patch[pairs[~alike]], axis=0)
    del pairs, alike
    count = int(patch.max()) + 1
    # Every patch and its turned twin: patches wound against each other hang with the other's twin.
    twins = connected_component_labels(
        np.concatenate([across + np.array([0, count]), across + np.array([count, 0])]), 2 * count
    )
    if (twins[:count] == twins[count:]).any():
        raise InvalidInput("a surface with one side", "a scan has an outside", "remesh the scan")
    piece = np.minimum(twins[:count], twins[count:])
    against = (twins[:count] != piece)[patch]
    faces[against] = faces[against, ::-1]
    area = areas(vertices, faces)
    whole = np.bincount(piece[patch], weights=area)
    keep = piece[patch] == int(np.argmax(whole))
    loose = float(whole.sum() - whole.max())
    if loose > LOOSE_SHARE * whole.sum():
        second = piece[patch] == int(np.argsort(whole)[-2])
        raise InvalidPlace(
            f"a scan in {int((whole > 0).sum())} pieces ({loose:.2g} m2 beside the largest)",
            ("one rock is one body" if alone else "rock and ground hang together")
            + f"; loose pieces make up at most {LOOSE_SHARE:.0%} of the surface",
            "keep the rock alone"
            if alone
            else "join the pieces, crop the scan, or save rock and terrain as two files "
            "(pedestal.mesh)",
            vertices[faces[second]].mean(axis=(0, 1))[None],
        )
    if loose > 0.0:
        number = int((whole > 0).sum()) - 1
        pieces = f"{number} loose piece{'s' * (number > 1)}"
        notes.append(f"{pieces} dropped ({loose:.2g} m2)")
    turned = min(float(area[keep & against].sum()), float(area[keep & ~against].sum()))
    is_open = np.zeros(len(piece), dtype=bool)
    is_open[piece[patch[rim]]] = True
    apart = ~is_open[piece][patch] & ~keep
    closed = faces[apart], piece[patch[apart]]
    faces = faces[keep]
    if _looks_in(vertices, faces, sheet=not alone and bool(keep[rim].any())):
        faces = faces[:, ::-1]
        notes.append("all faces turned outward")
    if apart.any() and not alone:
        _require_no_rock_apart(Terrain(vertices, faces), *closed)
    if turned > 0.0:
        notes.append(f"faces wound against their neighbours turned ({turned:.2g} m2)")
    return np.ascontiguousarray(faces)


def _require_no_rock_apart(ground: Terrain, faces: Indices, piece: Indices) -> None:
    """Check that no closed piece that is larger than a pebble is outside of the scan's surface.

    Those within it are crevices that the surface was continued across.
    """
    order = np.argsort(piece)
    for own in np.split(faces[order], 1 + np.flatnonzero(np.diff(piece[order]))):
        points = ground.vertices[np.unique(own)]
        size = float(np.ptp(points, axis=0).max())
        if size > LARGEST_LOOSE and not ground.depth(points[np.argmax(points[:, 2])]):
            raise InvalidPlace(
                f"a closed piece {size:.2g} m large apart from the rest",
                "rock and ground in one file are one surface",
                "save them as two files, the terrain as pedestal.mesh, or delete what is neither",
                0.5 * (points.min(axis=0) + points.max(axis=0))[None],
            )


def _looks_in(vertices: Array, faces: Indices, *, sheet: bool) -> bool:
    """Whether an open sheet faces down, or a surface that is closed but for holes inward."""
    up = volume = 0.0
    middle = vertices[faces[:, 0]].mean(axis=0)
    for chunk in chunks(len(faces)):
        cross = cross_products(vertices, faces[chunk])
        up += float(cross[:, 2].sum())
        volume += float(np.einsum("ij,ij->", vertices[faces[chunk, 0]] - middle, cross))
    return (up if sheet else volume) < 0.0
