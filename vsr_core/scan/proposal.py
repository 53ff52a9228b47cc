"""A seam proposed around what stands out of the ground most, and cuts that could take its place."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import shapely
import trimesh
from scipy.spatial import cKDTree
from trimesh.graph import connected_component_labels

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.rock.triangles import areas
from vsr_core.scan.cleaning import colours_of
from vsr_core.scan.concave import Turns, cheapest_cut, turns
from vsr_core.scan.cuts import Box, Colour, Cut, Plane, Polygon
from vsr_core.scan.separation import Separation, at_border, by_cut, nearest, seams, settled, whole
from vsr_core.scan.topology import border
from vsr_core.scan.underside import area_vector
from vsr_core.scan.weighing import place

_CONCAVE_SHARE = 0.6  # of a seam's length along a clear hollow, below which it is none
_SAME = 0.8  # two cuts whose rocks share this part of their joint area are one

# Another rock counts if its area is within this factor of the best one's (what is smaller are
# pebbles, what is larger is relief of the ground) and its seam costs at most this part of its
# length, or three times the best one's.
_RIVAL_SIZE, _RIVAL_COST = 4.0, 0.15

_AS_CHEAP = (
    1.25  # times the lowest cost: around a niche it is that of its walls, which rock touches
)

_LEVELS = np.linspace(0.9, 0.1, 9)  # heights above the ground of the seeds, of the highest
_REACHES = 0.25 * 0.6 ** np.arange(8)  # of the seeds around a point, of the scan's extent
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
    mesh: trimesh.Trimesh, near: tuple[float, float, float] | None, offset: Array
) -> Separation:
    """Rock and ground of a clean scan, separated along the hollow between them.

    What rises above the ground, at several heights, seeds a minimum cut whose cost is a length
    that is cheap along hollows; the border of the scan is ground. Where none of these is around a
    point that is given, what lies near it, at several distances, seeds more: a rock in a pit does
    not rise above the border. Of the seams that follow a
    hollow the one with the lowest cost for its length is proposed. The confidence is the share
    of its length along a clear hollow, times the share of the seeds within the rock that lead to
    it.

    Parameters
    ----------
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
    if near is not None:
        point = np.array(near) - offset
        own = nearest(vertices[faces].mean(axis=1), point)
        if not any(cut.rock[own] and cut.concave >= _CONCAVE_SHARE for cut in cuts):
            cuts += _around(point, vertices, faces, found, outer, offset)
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


def _around(
    near: Array, vertices: Array, faces: Indices, found: Turns, outer: Mask, offset: Array
) -> list[_Found]:
    """Different cuts around what lies near a point."""
    area, middle = areas(vertices, faces), vertices[faces].mean(axis=1)
    own = nearest(middle, near)
    away = np.linalg.norm(middle - middle[own], axis=1)
    cuts: list[_Found] = []
    for reach in _REACHES * float(np.ptp(vertices, axis=0).max()):
        within = (away <= reach) & ~outer
        linked = found.faces[within[found.faces].all(axis=1)]
        piece = connected_component_labels(linked, len(faces))
        seed = within & (piece == piece[own])
        if seed.any():
            top = middle[seed][np.argmax(middle[seed, 2])] + offset
            _add(cuts, cheapest_cut(found, seed, outer), area, found, top)
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
        own = nearest(middle, np.array(near))
        held = [cut for cut in good if cut.rock[own]]
        if not held:
            raise Undecided(
                f"no rock at {place(np.array(near))}",
                "the point lies on the rock",
                f"set pedestal.point_on_rock to one of the tops found: "
                f"{', '.join(place(cut.top) for cut in good)}",
                _told(good),
            )
        return _cheapest(held)
    best = _cheapest(good)
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


def _cheapest(cuts: list[_Found]) -> _Found:
    """Of cuts around the cheapest one or within it that cost about as much, that of most seeds."""
    best = min(cuts, key=lambda cut: cut.cost)
    alike = [c for c in cuts if c.cost < _AS_CHEAP * best.cost and (c.rock & best.rock).any()]
    return max(alike, key=lambda cut: (cut.seeds, -cut.cost))


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


_MOST_CORNERS = 12  # of a polygon to write down by hand
_CLOSE, _WIDE = 0.015, 0.05  # of the rock's size, between a cut and the seam or the rock
_DIGITS = 3  # of metres that are written down
_BETWEEN = np.arange(0.0, 1.0, 0.125)  # places on each edge of a seam that are compared


@dataclass(frozen=True)
class Alternative:
    """A cut that stands for a separation.

    Attributes
    ----------
    cut : Cut, in the coordinates of the clean scan, in whole millimetres
    away : float [m], farthest of its seam from the separation's, or the reverse; nan if it fails
    area : float, area of its rock as a share of the separation's
    reason : str, why it fails; else empty
    """

    cut: Cut
    away: float
    area: float
    reason: str


def alternatives(
    mesh: trimesh.Trimesh, separation: Separation, near: Array | None = None
) -> tuple[Alternative, ...]:
    """A plane, a box, a polygon and, where the scan has colours, a colour, all tried.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], the clean scan
    near : ndarray, shape (3,) [m], a point on the rock, in the mesh's coordinates, as of ``by_cut``
    """
    seam = separation.seams[0].points
    rock = separation.vertices[np.unique(separation.faces[separation.rock])]
    size = float(np.ptp(rock, axis=0).max())
    mesh = _around_rock(mesh, rock, size)
    colours = colours_of(mesh)
    made: list[Cut] = [
        _plane(seam, _CLOSE * size),
        _box(seam, rock, _CLOSE * size, _WIDE * size),
        _polygon(seam, _CLOSE * size),
        _polygon(rock, _WIDE * size),
    ]
    if colours is not None:
        made.append(_colour(np.array(mesh.vertices), colours[:, :3].astype(np.float64), rock))
    tried = [_tried(mesh, separation, cut, near) for cut in made]
    worse = max(tried[2:4], key=lambda found: np.nan_to_num(found.away, nan=np.inf))
    return tuple(found for found in tried if found is not worse)


def _around_rock(mesh: trimesh.Trimesh, rock: Array, margin: float) -> trimesh.Trimesh:
    """The faces within a margin [m] of a rock's points, shape (n, 3) [m]."""
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    within = (middle > rock.min(axis=0) - margin) & (middle < rock.max(axis=0) + margin)
    near = trimesh.Trimesh(
        mesh.vertices, mesh.faces[within.all(axis=1)], vertex_colors=colours_of(mesh), process=False
    )
    near.remove_unreferenced_vertices()
    return near


def _plane(seam: Array, above: float) -> Plane:
    """Square to a seam, ``above`` its middle [m]: noise of the ground stays below."""
    normal = area_vector(seam)
    normal /= np.linalg.norm(normal)
    return Plane(_three(seam.mean(axis=0) + above * normal), _three(normal))


def _box(seam: Array, rock: Array, above: float, margin: float) -> Box:
    """Around a rock, down to ``above`` the highest point of its seam [m]."""
    low, high = rock.min(axis=0) - margin, rock.max(axis=0) + margin
    low[2] = seam[:, 2].max() + above
    return Box(_three(low), _three(high))


def _polygon(points: Array, margin: float) -> Polygon:
    """Outline of points from above, wider by ``margin`` [m], with few corners."""
    outline = shapely.convex_hull(shapely.MultiPoint(points[:, :2])).buffer(margin)
    tolerance = 0.0
    while len(corners := shapely.get_coordinates(outline.simplify(tolerance))[:-1]) > _MOST_CORNERS:
        tolerance = max(1.3 * tolerance, 0.1 * margin)
    return Polygon(tuple((round(x, _DIGITS), round(y, _DIGITS)) for x, y in corners.tolist()))


def _colour(vertices: Array, colours: Array, rock: Array) -> Colour:
    """Of the rock in the mean, as tolerant as tells it best from what lies around it."""
    reach = float(np.ptp(rock, axis=0).max())
    near = np.linalg.norm(vertices - rock.mean(axis=0), axis=1) < 2.0 * reach
    # Vertices of the seam have moved by up to two edges; a hundredth of the rock is less.
    own = near & (cKDTree(rock).query(vertices)[0] < 0.01 * reach)
    rgb = np.round(colours[own].mean(axis=0)).astype(int)
    away = np.linalg.norm(colours - rgb, axis=1)
    levels = np.arange(2.0, 442.0)
    right = [(away[own] < t).mean() + (away[near & ~own] >= t).mean() for t in levels]
    red, green, blue = rgb.tolist()
    return Colour((red, green, blue), float(levels[int(np.argmax(right))]))


def _tried(
    mesh: trimesh.Trimesh, separation: Separation, cut: Cut, near: Array | None
) -> Alternative:
    try:
        other = settled(by_cut(mesh, cut, near))
    except InvalidInput as error:
        return Alternative(cut, np.nan, np.nan, error.given)
    area = [float(areas(s.vertices, s.faces)[s.rock].sum()) for s in (other, separation)]
    return Alternative(cut, _apart(other, separation), area[0] / area[1], "")


def _apart(one: Separation, other: Separation) -> float:
    """Farthest distance of a point on one's seams from the other's, either way [m]."""
    here, there = (np.concatenate([_along(seam.points) for seam in s.seams]) for s in (one, other))
    return float(max(cKDTree(a).query(b)[0].max() for a, b in ((here, there), (there, here))))


def _along(loop: Array) -> Array:
    """Points all along a closed line through points, shape (n, 3) [m]."""
    step = np.roll(loop, -1, axis=0) - loop
    return (loop[:, None] + _BETWEEN[:, None] * step[:, None]).reshape(-1, 3)


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = np.round(values, _DIGITS).tolist()
    return x, y, z
