"""The ground beneath a rock, which no scan sees: it follows the underside, a little lower."""

from __future__ import annotations

import numpy as np
import trimesh

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidPlace
from vsr_core.scan.closing import Closed
from vsr_core.scan.separation import Separation
from vsr_core.scan.weighing import signed_distance
from vsr_core.terrain.surface import Terrain

_LARGEST_PUSH = 0.1  # of the rock's size: ground that reaches deeper into the rock is no noise
_ROUNDS = 12  # of pushing ground out of the rock

_REMEDY = "move pedestal.cut, or set rock.closing to another of caps, hull and poisson"


def ground_beneath(
    separation: Separation, closed: Closed, clearance: float
) -> tuple[Terrain, Mask, tuple[str, ...]]:
    """Ground without a hole: with a mating surface under each cap of the closed rock.

    The mating surface is the cap moved out of the rock; the rim of the ground goes with it, so
    that no gap opens. Ground beside the rim that noise has put into the rock, or nearer to it
    than the clearance, is moved away to that distance.

    Parameters
    ----------
    clearance : float [m], from the rock down to the mating surface

    Returns
    -------
    terrain : Terrain, in the scan's coordinates
    seat : ndarray of bool, shape (m,), its faces beneath the rock

    Raises
    ------
    InvalidPlace
        If ground reaches into the rock by more than a tenth of its size, or stays there.
    """
    vertices = closed.vertices
    faces = separation.faces[~separation.rock]
    seat = np.concatenate([cap.faces[:, ::-1] for cap in closed.caps])
    name = np.arange(len(vertices))
    for cap in closed.caps:
        own = np.concatenate([cap.rim, cap.inner])
        name[own] = len(vertices) + np.arange(len(own))
        vertices = np.concatenate([vertices, vertices[own] - clearance * cap.up])
    used, triangles = np.unique(name[np.concatenate([faces, seat])], return_inverse=True)
    ground, pushed, count = _pushed_out(vertices[used], triangles, closed.rock, clearance)
    notes = [f"mating surface of {len(seat)} faces, {1e3 * clearance:.3g} mm below the rock"]
    if count:
        notes.append(
            f"{count} vertices of the ground in or near the rock moved away, by at most "
            f"{1e3 * pushed:.1f} mm"
        )
    return Terrain(ground, triangles), np.arange(len(triangles)) >= len(faces), tuple(notes)


def depth_in(terrain: Terrain, rock: trimesh.Trimesh) -> float:
    """How deep a rock's vertices lie in the ground at most.

    Parameters
    ----------
    rock : trimesh.Trimesh [m], in the same coordinates

    Returns
    -------
    float [m], 0 if none does
    """
    return max((terrain.depth(vertex) or 0.0 for vertex in np.array(rock.vertices)), default=0.0)


def _pushed_out(
    ground: Array, faces: Indices, rock: trimesh.Trimesh, clearance: float
) -> tuple[Array, float, int]:
    """Ground moved away from the rock, how far at most [m], and how many vertices."""
    given = ground
    low, high = rock.bounds
    largest = _LARGEST_PUSH * float((high - low).max())
    for _ in range(_ROUNDS):
        beside = ((ground > low - clearance) & (ground < high + clearance)).all(axis=1)
        near = np.flatnonzero(beside)
        outward, distance = _from_rock(rock, ground[near])
        close = distance < clearance * (1.0 - 1e-6)
        caught = _caught(ground, faces, rock)
        if not close.any() and not len(caught):
            break
        ground = ground.copy()
        ground[near[close]] += (clearance - distance[close])[:, None] * outward[close]
        corners = np.unique(faces[caught])
        ground[corners, 2] -= clearance
        moved = float(np.linalg.norm(ground - given, axis=1).max())
        if moved > largest:
            deepest = int(np.argmax(np.linalg.norm(ground - given, axis=1)))
            raise InvalidPlace(
                f"ground that reaches {moved:.3g} m into the rock",
                f"rock and ground touch, to {_LARGEST_PUSH:.0%} of the rock's size",
                _REMEDY,
                given[deepest : deepest + 1],
            )
    else:
        raise InvalidPlace(
            "ground that stays in the rock however it is moved",
            "rock and ground touch along a seam",
            _REMEDY,
            given[np.union1d(near[close], corners)],
        )
    away = np.linalg.norm(ground - given, axis=1)
    return ground, float(away.max()), int((away > 0.0).sum())


def _from_rock(rock: trimesh.Trimesh, points: Array) -> tuple[Array, Array]:
    """Directions out of the rock, shape (n, 3), and distances from it [m], negative inside."""
    distance, nearest, face = signed_distance(rock, points)
    touching = np.abs(distance) < 1e-9
    outward = (points - nearest) / np.where(touching, 1.0, distance)[:, None]
    outward[touching] = np.array(rock.face_normals)[face[touching]]
    return outward, distance


def _caught(ground: Array, faces: Indices, rock: trimesh.Trimesh) -> Indices:
    """Faces of the ground above which a vertex of the rock lies hidden."""
    terrain = Terrain(ground, faces)
    found = [_just_above(terrain, v) for v in np.array(rock.vertices) if terrain.depth(v)]
    return np.unique(np.concatenate(found)) if found else np.empty(0, dtype=np.int64)


def _just_above(terrain: Terrain, point: Array) -> Indices:
    """Faces near the vertical through a point that reach above it."""
    near = terrain.around(float(point[0]), float(point[1]))
    corners = terrain.vertices[terrain.faces[near]]
    over = (corners[:, :, :2].min(axis=1) <= point[:2]).all(axis=1)
    over &= (corners[:, :, :2].max(axis=1) >= point[:2]).all(axis=1)
    return near[over & (corners[:, :, 2].max(axis=1) >= point[2])]
