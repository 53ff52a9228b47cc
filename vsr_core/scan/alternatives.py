"""Cuts by hand around a rock that is known, each tried: a start for a user's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
import trimesh
from scipy.spatial import cKDTree

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.rock.triangles import areas
from vsr_core.scan.cleaning import colours_of
from vsr_core.scan.cuts import Box, Colour, Cut, Plane, Polygon
from vsr_core.scan.fill import area_vector
from vsr_core.scan.rim import settled
from vsr_core.scan.separation import Separation, by_cut

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


def alternatives(mesh: trimesh.Trimesh, separation: Separation) -> tuple[Alternative, ...]:
    """A plane, a box, a polygon and, where the scan has colours, a colour, all tried.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], the clean scan
    """
    seam = separation.seams[0].points
    rock = separation.vertices[np.unique(separation.faces[separation.rock])]
    colours = colours_of(mesh)
    size = float(np.ptp(rock, axis=0).max())
    made: list[Cut] = [
        _plane(seam, _CLOSE * size),
        _box(seam, rock, _CLOSE * size, _WIDE * size),
        _polygon(seam, _CLOSE * size),
        _polygon(rock, _WIDE * size),
    ]
    if colours is not None:
        made.append(_colour(np.array(mesh.vertices), colours[:, :3].astype(np.float64), rock))
    tried = [_tried(mesh, separation, cut) for cut in made]
    worse = max(tried[2:4], key=lambda found: np.nan_to_num(found.away, nan=np.inf))
    return tuple(found for found in tried if found is not worse)


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


def _tried(mesh: trimesh.Trimesh, separation: Separation, cut: Cut) -> Alternative:
    try:
        other = settled(by_cut(mesh, cut))
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
