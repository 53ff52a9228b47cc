"""A seam proposed without handwork: the hollow around what stands out of the ground most."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from trimesh.graph import connected_component_labels

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.rock.triangles import areas
from vsr_core.scan.concave import Turns, cheapest_cut, turns
from vsr_core.scan.refusal import place
from vsr_core.scan.separation import Separation, at_border, seams, whole
from vsr_core.scan.topology import border

_CONCAVE_SHARE = 0.6  # of a seam's length along a clear hollow, below which it is none
_SAME = 0.8  # two cuts whose rocks share this part of their joint area are one

# Another rock counts if its area is within this factor of the best one's (what is smaller are
# pebbles, what is larger is relief of the ground) and its seam costs at most this part of its
# length, or three times the best one's.
_RIVAL_SIZE, _RIVAL_COST = 4.0, 0.15

_LEVELS = np.linspace(0.9, 0.1, 9)  # heights above the ground of the seeds, of the highest
_STANDS_OUT = 0.15  # of the highest, by which a seed's top must rise above its foot


class Undecided(InvalidInput):
    """Several rocks, or no clear one.

    Parameters
    ----------
    rocks : dict of ndarray of bool, the faces of each candidate, by where its top is
    """

    def __init__(self, given: str, rule: str, remedy: str, rocks: dict[str, Mask]) -> None:
        super().__init__(given, rule, remedy)
        self.rocks = rocks


@dataclass(frozen=True)
class _Found:
    """A cut: its rock, its cost for a length [1], how many seeds led to it, of how many."""

    rock: Mask
    area: float
    cost: float
    concave: float
    seeds: int
    top: Array


def propose(
    mesh: trimesh.Trimesh,
    near: tuple[float, float, float] | None,
    offset: Array,
) -> Separation:
    """Rock and ground of a clean scan, separated along the hollow between them.

    What rises above the ground, at several heights, seeds a minimum cut whose cost is a length
    that is cheap along hollows; the border of the scan is ground. Of the seams that follow a
    hollow the one with the lowest cost for its length is proposed. The confidence is the share
    of its length along a clear hollow, times the share of the seeds within the rock that lead to
    it.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], z up
    near : three floats [m], or None
        A point on or in the rock, where several stand on the ground, in the given coordinates.
    offset : ndarray, shape (3,) [m], given coordinates are the mesh's plus these

    Raises
    ------
    Undecided
        If no part of the scan is set off by a hollow, or several are.
    """
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    outer = at_border(faces)
    found = turns(vertices, faces)
    cuts = _candidates(vertices, faces, found, outer, offset)
    good = [cut for cut in cuts if cut.concave >= _CONCAVE_SHARE]
    if not good:
        raise Undecided(
            "a scan in which no hollow runs around a rock"
            + (f" (at best {max(c.concave for c in cuts):.0%} of a seam)" if cuts else ""),
            f"{_CONCAVE_SHARE:.0%} of the seam between rock and ground is a hollow",
            "give pedestal.cut: a plane, a box, a polygon or a colour",
            _told(cuts),
        )
    best = _the_one(good, vertices[faces].mean(axis=1) + offset, near)
    inside = [cut for cut in cuts if (cut.rock & best.rock).any()]
    seeds = sum(cut.seeds for cut in inside if not (cut.rock & ~best.rock).any())
    rock, notes = whole(vertices, faces, best.rock)
    others = [c for c in good if c is not best and (c.rock & best.rock).any()]
    notes += tuple(
        f"another hollow is possible, around {c.area:.2g} m2 with its top at {place(c.top)}"
        for c in others
    )
    return Separation(
        vertices,
        faces,
        rock,
        seams(vertices, faces, rock, found),
        best.concave * best.seeds / max(seeds, 1),
        notes,
    )


def _candidates(
    vertices: Array, faces: Indices, found: Turns, outer: Mask, offset: Array
) -> list[_Found]:
    """Different cuts around what rises above the ground."""
    height = _above_ground(vertices, faces)
    area, middle = areas(vertices, faces), vertices[faces].mean(axis=1)
    highest = float(height.max())
    cuts: list[_Found] = []
    for level in _LEVELS:
        above = (height > level * highest) & ~outer
        linked = found.faces[above[found.faces].all(axis=1)]
        piece = connected_component_labels(linked, len(faces))
        tops = np.full(len(faces), -np.inf)
        np.maximum.at(tops, piece[above], height[above])
        for name in np.flatnonzero(tops > (level + _STANDS_OUT * (level < 0.85)) * highest):
            seed = above & (piece == name)
            top = middle[seed][np.argmax(height[seed])] + offset
            rock = cheapest_cut(found, seed, outer)
            _add(cuts, rock, area, found, top)
    return cuts


def _add(cuts: list[_Found], rock: Mask, area: Array, found: Turns, top: Array) -> None:
    """Add a cut, or count another seed for one that is there."""
    for k, cut in enumerate(cuts):
        if area[cut.rock & rock].sum() > _SAME * area[cut.rock | rock].sum():
            cuts[k] = replace(cut, seeds=cut.seeds + 1)
            return
    between = rock[found.faces[:, 0]] != rock[found.faces[:, 1]]
    length = float(found.length[between].sum())
    cost = float(found.cost[between].sum()) / length
    hollow = between & found.hollow
    concave = float(found.length[hollow].sum()) / length
    cuts.append(_Found(rock, float(area[rock].sum()), cost, concave, 1, top))


def _the_one(good: list[_Found], middle: Array, near: tuple[float, float, float] | None) -> _Found:
    """The cheapest cut, or of those with the face nearest to a point; bumps are of one rock."""
    if near is not None:
        nearest = int(np.argmin(np.linalg.norm(middle - np.array(near), axis=1)))
        held = [cut for cut in good if cut.rock[nearest]]
        if not held:
            raise Undecided(
                f"no rock at {place(np.array(near))}",
                "the point lies on the rock",
                f"set pedestal.point_on_rock to one of the tops found: "
                f"{', '.join(place(cut.top) for cut in good)}",
                _told(good),
            )
        return min(held, key=lambda cut: cut.cost)
    best = min(good, key=lambda cut: cut.cost)
    rivals = _rivals(best, good)
    if not rivals:
        return best
    found = (best, *rivals)
    largest = _RIVAL_SIZE * sum(cut.area for cut in found)
    around = [c for c in good if c.area < largest and all(_within(bump, c) for bump in found)]
    if around:  # they are bumps of one rock
        return max(around, key=lambda cut: cut.concave)
    raise Undecided(
        f"{len(found)} rocks, their tops at {', '.join(place(cut.top) for cut in found)}",
        "one rock stands on the ground",
        "set pedestal.point_on_rock to one of these points, give pedestal.cut, or crop the scan",
        _told(found),
    )


def _rivals(best: _Found, good: list[_Found]) -> list[_Found]:
    """Other rocks than the best; of cuts that overlap, which are of one rock, the cheapest."""
    rivals: list[_Found] = []
    for cut in sorted(good, key=lambda cut: cut.cost):
        alike = best.area / _RIVAL_SIZE < cut.area < best.area * _RIVAL_SIZE
        cheap = cut.cost < max(_RIVAL_COST, 3.0 * best.cost)
        if alike and cheap and not any((cut.rock & c.rock).any() for c in (best, *rivals)):
            rivals.append(cut)
    return rivals


def _within(one: _Found, other: _Found) -> bool:
    """Whether a cut's rock is part of another's, but for a few faces at its seam."""
    return one is not other and (one.rock & other.rock).sum() > _SAME * one.rock.sum()


def _told(cuts: Iterable[_Found]) -> dict[str, Mask]:
    """Rocks of cuts by the places of their tops, the largest first: others may lie within."""
    return {place(cut.top): cut.rock for cut in sorted(cuts, key=lambda cut: -cut.area)}


def _above_ground(vertices: Array, faces: Indices) -> Array:
    """Height of each face over the plane through the scan's border [m], shape (m,)."""
    open_ = np.unique(border(faces))
    rows = np.column_stack([vertices[:, :2], np.ones(len(vertices))])
    plane = np.linalg.lstsq(rows[open_], vertices[open_, 2], rcond=None)[0]
    return (vertices[:, 2] - rows @ plane)[faces].mean(axis=1)
