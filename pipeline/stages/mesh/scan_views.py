"""Views of a scan's surfaces: the side to look from, and a panel with a surface and its marks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from pipeline.drawing import style
from pipeline.drawing.painting import Floats, normals, smaller
from pipeline.drawing.rendering import drawn, faces_of, in_sight, seen
from pipeline.drawing.view import View, axes_of, fitted, round_number
from vsr_core.arrays import Array, Indices, Mask

SEAM = style.OVERTURNED
"""Colour of lines on a surface."""

ABOVE, BELOW = np.eye(3), np.diag([1.0, -1.0, -1.0])
"""Axes of views straight down and straight up, x to the right in both."""

PANEL = 560  # pixels, side of a panel
SMOOTH = 2  # side of the square of computed pixels that becomes one

_AROUND = 0.75  # of the rock's size, of ground shown around it
_LIFT = 4.0  # pixels by which a line on a surface is held off it when it is seen or not
_LIGHT = np.array([-0.4, 0.5, 0.77]) / np.linalg.norm([-0.4, 0.5, 0.77])  # right, up, eye
_DARK, _BRIGHT = 0.3, 1.05


@dataclass(frozen=True, eq=False)
class Painted:
    """A surface in several colours.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m], site frame
    faces : ndarray of int, shape (m, 3)
    colours : ndarray, shape (m, 3), 0 to 1
    """

    vertices: Array
    faces: Indices
    colours: Array

    def around(self, rock: Array) -> Painted:
        """The part of it around a rock, by the middles of its faces.

        Parameters
        ----------
        rock : ndarray, shape (n, 3) [m]
        """
        low, high = rock.min(axis=0), rock.max(axis=0)
        reach = _AROUND * float((high - low).max())
        middle = self.vertices[self.faces].mean(axis=1)
        keep = ((middle > low - reach) & (middle < high + reach)).all(axis=1)
        return Painted(self.vertices, self.faces[keep], self.colours[keep])


def fit(axes: Array, points: Array, margin: float = 0.0) -> View:
    """View of a panel with all points in it.

    Parameters
    ----------
    axes : ndarray, shape (3, 3), see ``axes_of``
    points : ndarray, shape (n, 3) [m]
    margin : float, share of the panel that stays free on every side
    """
    return fitted(axes, points, (SMOOTH * PANEL, SMOOTH * PANEL), margin)


def best_eye(
    near: Painted, points: Array, rock: Array, other: Array | None = None
) -> tuple[str, Array]:
    """Title and axes of the side from which most of the points are seen, low if possible.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], on the surface
    rock : ndarray, shape (k, 3) [m], points that fill the picture
    other : ndarray, shape (3, 3), optional, axes of a view that is to be another

    Returns
    -------
    str, and ndarray, shape (3, 3), see ``axes_of``
    """
    best, found = -np.inf, ("", ABOVE)
    for azimuth, elevation in product(range(0, 360, 30), (12, 25, 40)):
        axes = axes_of(math.radians(azimuth), math.radians(elevation))
        if other is not None and axes[2, :2] @ other[2, :2] > 0.3 * np.linalg.norm(other[2, :2]):
            continue
        view = fitted(axes, rock, (PANEL // 2, PANEL // 2), 0.16)
        worth = float(visible(view, near, points).mean()) - 0.006 * elevation
        if worth > best:
            title = f"from {azimuth}°, {elevation}° above level"
            best, found = worth, (title, axes)
    return found


def visible(view: View, surface: Painted, points: Array) -> Mask:
    """Find the points on a surface that are seen.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m]

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    buffer = drawn(view, surface.vertices, surface.faces)
    return in_sight(view, buffer, points + _LIFT * view.pixel * view.axes[2])


def show(panel: Axes, view: View, surface: Painted, seams: list[Array], title: str) -> None:
    """Paint a surface, seams on it, the axes and a scale.

    Parameters
    ----------
    seams : list of ndarray, shape (n, 3) [m], closed lines on the surface
    """
    rows, columns = (side // SMOOTH for side in view.shape)
    panel.imshow(_picture(view, surface), extent=(0, columns, rows, 0), gid="picture")
    panel.set_title(title)
    panel.set_axis_off()
    panel.autoscale(False)
    for seam in seams:
        _seam(panel, view, surface, seam)
    along = view.axes[:2].T * (1.0, -1.0)  # rows run downwards
    style.directions(panel, along, np.array([44.0, rows - 44.0]), 34.0, 9.0, style.INK)
    scale(panel, SMOOTH * view.pixel)


def scale(panel: Axes, metres: float) -> None:
    """Draw a bar of a round length in the lower right corner.

    Parameters
    ----------
    metres : float [m], a unit of the axes
    """
    (left, right), (bottom, top) = panel.get_xlim(), panel.get_ylim()
    length = round_number(0.3 * (right - left) * metres)
    end, low, above = right - 0.03 * (right - left), 0.03 * (top - bottom), 0.04 * (top - bottom)
    start = end - length / metres
    panel.plot([start, end], [bottom + low] * 2, color=style.INK, lw=1.6)
    middle: Any = {"ha": "center", "va": "bottom", "size": 7.5, "path_effects": style.HALO}
    panel.text(0.5 * (start + end), bottom + above, f"{length:g} m", gid="scale", **middle)


def _picture(view: View, surface: Painted) -> Floats:
    """Paint a surface under a lamp at the eye's left, without shadows: they would hide the seam."""
    buffer = drawn(view, surface.vertices, surface.faces)
    pixels = seen(buffer)
    face = faces_of(buffer[pixels])
    picture = np.ones((buffer.size, 3), dtype=np.float32)
    normal = normals(surface.vertices, surface.faces)[face]
    light = 0.5 + 0.5 * (normal * (_LIGHT @ view.axes)).sum(axis=1, keepdims=True)
    picture[pixels] = np.clip(surface.colours[face] * (_DARK + (_BRIGHT - _DARK) * light), 0, 1)
    return smaller(picture.reshape(*view.shape, 3), SMOOTH)


def _seam(panel: Axes, view: View, surface: Painted, seam: Array) -> None:
    points = view.project(seam)[:, :2] / SMOOTH
    parts = np.stack([points, np.roll(points, -1, axis=0)], axis=1)
    in_view = visible(view, surface, seam)
    look: Any = {"colors": np.tile(to_rgb(SEAM), (len(parts), 1)), "linewidths": 1.8}
    style.line_on_surface(panel, parts, in_view & np.roll(in_view, -1), "seam", **look)
