"""A scan on its way to rock and terrain: what is which, what was added, what that does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from trimesh.intersections import mesh_plane

from pipeline.drawing import style
from pipeline.drawing.painting import GROUND, normals, smaller
from pipeline.drawing.rendering import (
    View,
    axes_of,
    drawn,
    faces_of,
    fitted,
    in_sight,
    round_number,
    seen,
)
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.scan.preparation import Prepared
from vsr_core.scan.weighing import DIRECTIONS

Floats = NDArray[np.floating]

ROCK, ADDED, SEAM = "#7fa8d6", "#f0a030", style.OVERTURNED
"""Colours of the rock, of what no scan saw, and of the seam."""

ABOVE, BELOW = np.eye(3), np.diag([1.0, -1.0, -1.0])
"""Axes of views straight down and straight up, x to the right in both."""

WIDTH = 9.6  # inches
PANEL = 560  # pixels, side of a panel
SMOOTH = 2  # side of the square of computed pixels that becomes one

_AROUND = 0.75  # of the rock's size, of ground shown around it
_LIFT = 4.0  # pixels by which a line on a surface is held off it when it is seen or not
_HALO = [withStroke(linewidth=2.4, foreground="white")]
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

    def within(self, keep: Mask) -> Painted:
        """The part of it of some faces."""
        return Painted(self.vertices, self.faces[keep], self.colours[keep])


@style.styled
def separation(prepared: Prepared, source: str) -> Figure:
    """Draw the scan with rock and ground told apart, and the seam, from above and two sides."""
    scan, loops = _scan(prepared)
    rock = _rock_points(prepared)
    near = scan.within(_near(scan, rock))
    seam = np.concatenate(loops)
    figure, panels = _panels(2, 2)
    whole = fitted(ABOVE, scan.vertices, (SMOOTH * PANEL, SMOOTH * PANEL), 0.03)
    _show(panels[0], whole, scan, loops, "all of the scan, from above")
    _ring(panels[0], whole, rock)
    for panel, (place, axes) in zip(panels[1:], _eyes(near, rock, seam), strict=True):
        view = fitted(axes, rock, (SMOOTH * PANEL, SMOOTH * PANEL), 0.16)
        _show(panel, view, near, loops, place)
    _key(figure, {"rock": ROCK, "ground": GROUND, "seam, dotted where hidden": SEAM}, source)
    return figure


@style.styled
def closed_rock(prepared: Prepared, source: str) -> Figure:
    """Draw the closed rock, what the scan saw and what was added, from the sides and below."""
    colours = np.where(prepared.added[:, None], to_rgb(ADDED), to_rgb(ROCK))
    rock = Painted(np.array(prepared.rock.vertices), np.array(prepared.rock.faces), colours)
    figure, panels = _panels(1, 4)
    for panel, (title, axes) in zip(
        panels,
        (
            ("along +y", axes_of(math.radians(-90.0), math.radians(12.0))),
            ("against +x", axes_of(0.0, math.radians(12.0))),
            ("from below, aslant", axes_of(math.radians(-60.0), math.radians(-40.0))),
            ("from below", BELOW),
        ),
        strict=True,
    ):
        view = fitted(axes, rock.vertices, (SMOOTH * PANEL, SMOOTH * PANEL), 0.12)
        _show(panel, view, rock, (), title)
    _key(figure, {"seen by the scan": ROCK, "added": ADDED}, source)
    return figure


@style.styled
def seat(prepared: Prepared, source: str) -> Figure:
    """Draw the ground without the rock, and sections through both."""
    terrain = prepared.terrain
    colours = np.where(prepared.seat[:, None], to_rgb(ADDED), GROUND)
    ground = Painted(terrain.vertices, terrain.faces, colours)
    rock = _rock_points(prepared)
    near = ground.within(_near(ground, rock))
    under = terrain.vertices[np.unique(terrain.faces[prepared.seat])]
    figure, panels = _panels(1, 4)
    place, axes = _best_eye(near, under, rock)
    for panel, view_axes, title in ((panels[0], ABOVE, "from above"), (panels[1], axes, place)):
        view = fitted(view_axes, _widened(under, 0.6), (SMOOTH * PANEL, SMOOTH * PANEL))
        _show(panel, view, near, (), title)
    for panel, across in ((panels[2], 1), (panels[3], 0)):
        _section(panel, prepared, across)
    _key(figure, {"rock": ROCK, "ground, black in sections": GROUND, "added": ADDED}, source)
    return figure


@style.styled
def tippings(prepared: Prepared, source: str) -> Figure:
    """Draw the static tipping angle against direction for every closing that stands."""
    chosen = prepared.steps[-1].after.tipping
    angles = {f"{prepared.closing} (chosen)": chosen}
    angles |= {t.closing: t.measure.tipping for t in prepared.trials if t.measure is not None}
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    polar = figure.add_subplot(1, 2, 1, projection="polar")
    lines = figure.add_subplot(1, 2, 2)
    turn = np.append(DIRECTIONS, 2.0 * np.pi)
    for (name, angle), colour in zip(angles.items(), style.SERIES, strict=False):
        if np.isnan(angle).any():
            lines.plot([], [], color=colour, label=f"{name}: does not stand")
            continue
        around = np.degrees(np.append(angle, angle[0]))
        wide = 2.2 if angle is chosen else 1.3
        polar.plot(turn, around, color=colour, lw=wide, gid="tipping")
        change = around - np.degrees(np.append(chosen, chosen[0]))
        lines.plot(np.degrees(turn), change, color=colour, lw=wide, label=name, gid="change")
    polar.set_ylim(bottom=0.0)
    polar.set_title("static tipping angle [°]")
    lines.set_xlim(0.0, 360.0)
    lines.set_xticks(np.arange(0.0, 361.0, 60.0))
    lines.set_xlabel("direction of tipping, counter-clockwise from +x [°]")
    lines.set_ylabel("difference from the closing chosen [°]")
    lines.grid(visible=True)
    lines.legend(loc="best")
    figure.suptitle(source, size=8.0, color=style.FAINT)
    return figure


def _scan(prepared: Prepared) -> tuple[Painted, list[Array]]:
    """The scan in the site's frame, and its seams, shape (n, 3) [m] each."""
    found = prepared.separation
    colours = np.where(found.rock[:, None], to_rgb(ROCK), GROUND)
    scan = Painted(found.vertices + prepared.shift, found.faces, colours)
    return scan, [seam.points + prepared.shift for seam in found.seams]


def _rock_points(prepared: Prepared) -> Array:
    return np.array(prepared.rock.vertices)


def _near(surface: Painted, rock: Array) -> Mask:
    """Faces around a rock, by their middles."""
    low, high = rock.min(axis=0), rock.max(axis=0)
    reach = _AROUND * float((high - low).max())
    middle = surface.vertices[surface.faces].mean(axis=1)
    return ((middle > low - reach) & (middle < high + reach)).all(axis=1)


def _widened(points: Array, share: float) -> Array:
    """Corners of a box around points, wider on every side by a share of its longest side."""
    low, high = points.min(axis=0), points.max(axis=0)
    reach = share * float((high - low).max())
    ends = np.stack([low - reach, high + reach])
    ends[0, 2], ends[1, 2] = low[2], high[2]
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i, j, k in product((0, 1), repeat=3)])


def _eyes(near: Painted, rock: Array, seam: Array) -> list[tuple[str, Array]]:
    """Titles and axes of the views of a seam: above, its best side, and the best of the rest."""
    first, axes = _best_eye(near, seam, rock)
    view = fitted(axes, rock, (PANEL // 2, PANEL // 2), 0.16)
    hidden = ~_visible(view, near, seam)
    second = _best_eye(near, seam[hidden] if hidden.any() else seam, rock, axes)
    return [("from above", ABOVE), (first, axes), second]


def _best_eye(
    near: Painted, points: Array, rock: Array, other: Array | None = None
) -> tuple[str, Array]:
    """Title and axes of the side from which most of the points are seen, low if possible.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m], on the surface
    other : ndarray, shape (3, 3), axes of a view that is to be another
    """
    best, found = -np.inf, ("", ABOVE)
    for azimuth, elevation in product(range(0, 360, 30), (12, 25, 40)):
        axes = axes_of(math.radians(azimuth), math.radians(elevation))
        if other is not None and axes[2, :2] @ other[2, :2] > 0.3 * np.linalg.norm(other[2, :2]):
            continue
        view = fitted(axes, rock, (PANEL // 2, PANEL // 2), 0.16)
        worth = float(_visible(view, near, points).mean()) - 0.006 * elevation
        if worth > best:
            title = f"from {azimuth}°, {elevation}° up"
            best, found = worth, (title, axes)
    return found


def _visible(view: View, surface: Painted, points: Array) -> Mask:
    """Whether points on a surface are seen."""
    buffer = drawn(view, surface.vertices, surface.faces)
    return in_sight(view, buffer, points + _LIFT * view.pixel * view.axes[2])


def _panels(rows: int, columns: int) -> tuple[Figure, list[Axes]]:
    side = WIDTH / columns
    figure = Figure(figsize=(WIDTH, rows * (side + 0.28) + 0.5))
    grid = figure.add_gridspec(
        rows, columns, left=0.005, right=0.995, top=1.0 - 0.25 / figure.get_figheight(),
        bottom=0.5 / figure.get_figheight(), wspace=0.02, hspace=0.28 / side,
    )  # fmt: skip
    return figure, [
        figure.add_subplot(grid[place]) for place in product(range(rows), range(columns))
    ]


def _show(
    panel: Axes, view: View, surface: Painted, loops: tuple[()] | list[Array], title: str
) -> None:
    """Paint a surface, lines on it, the axes and a scale."""
    rows, columns = (side // SMOOTH for side in view.shape)
    panel.imshow(_picture(view, surface), extent=(0, columns, rows, 0), gid="picture")
    panel.set_title(title)
    panel.set_axis_off()
    panel.autoscale(False)
    for loop in loops:
        _line(panel, view, surface, loop)
    _triad(panel, view, rows)
    _scale(panel, SMOOTH * view.pixel)


def _scale(panel: Axes, metres: float) -> None:
    """Draw a bar of a round length in the lower right corner; a unit of the axes is ``metres``."""
    (left, right), (bottom, top) = panel.get_xlim(), panel.get_ylim()
    length = round_number(0.3 * (right - left) * metres)
    start, end = right - 0.03 * (right - left) - length / metres, right - 0.03 * (right - left)
    panel.plot([start, end], [bottom + 0.03 * (top - bottom)] * 2, color=style.INK, lw=1.6)
    panel.text(
        0.5 * (start + end), bottom + 0.04 * (top - bottom), f"{length:g} m", ha="center",
        va="bottom", size=7.5, path_effects=_HALO, gid="scale",
    )  # fmt: skip


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


def _line(panel: Axes, view: View, surface: Painted, loop: Array) -> None:
    """Draw a closed line on a surface, dotted where it is hidden."""
    points = view.project(loop)[:, :2] / SMOOTH
    parts = np.stack([points, np.roll(points, -1, axis=0)], axis=1)
    visible = _visible(view, surface, loop)
    visible &= np.roll(visible, -1)
    for keep, name, width, dashes in (
        (~visible, "hidden seam", 1.0, (0, (1, 1.6))),
        (visible, "seam", 1.8, "solid"),
    ):
        panel.add_collection(
            LineCollection(
                list(parts[keep]), colors=SEAM, linewidths=width, linestyles=[dashes], gid=name
            )
        )


def _triad(panel: Axes, view: View, rows: int) -> None:
    """Directions of the site's axes in the lower left corner; none that points at the eye."""
    foot, size = np.array([44.0, rows - 44.0]), 34.0
    for name, along in zip("xyz", view.axes[:2].T * (1.0, -1.0), strict=True):
        if np.linalg.norm(along) > 0.25:
            panel.plot(*np.stack([foot, foot + size * along]).T, color=style.INK, lw=0.9)
            tip = foot + (size + 9.0 / np.linalg.norm(along)) * along
            panel.text(
                float(tip[0]), float(tip[1]), name, ha="center", va="center", size=7.5,
                path_effects=_HALO,
            )  # fmt: skip


def _ring(panel: Axes, view: View, rock: Array) -> None:
    """Show where the rock is in a wide view."""
    points = view.project(rock)[:, :2] / SMOOTH
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = max(1.3 * float(np.linalg.norm(points - middle, axis=1).max()), 16.0)
    turn = np.linspace(0.0, 2.0 * np.pi, 61)
    panel.plot(
        middle[0] + radius * np.cos(turn), middle[1] + radius * np.sin(turn), color=style.INK,
        lw=1.0, gid="ring",
    )  # fmt: skip


def _section(panel: Axes, prepared: Prepared, across: int) -> None:
    """Cut rock and ground by the vertical plane through the centre of mass along x or y."""
    terrain = prepared.terrain
    ground = trimesh.Trimesh(terrain.vertices, terrain.faces, process=False)
    rock, along = prepared.rock, 1 - across
    for mesh, keep, colour, width in (
        (ground, ~prepared.seat, style.INK, 1.2),
        (rock, ~prepared.added, ROCK, 1.6),
        (rock, prepared.added, ADDED, 1.6),
        (ground, prepared.seat, ADDED, 1.2),
    ):
        lines = _cut(mesh, keep, across)[..., [along, 2]]
        panel.add_collection(LineCollection(list(lines), colors=colour, linewidths=width))
    low, high = rock.bounds[:, [along, 2]]
    half = 0.65 * float((high - low).max())
    middle = 0.5 * (low + high)
    panel.plot(0.0, float(rock.center_mass[2]), "+", color=style.INK, ms=7.0)
    panel.set_xlim(middle[0] - half, middle[0] + half)
    panel.set_ylim(middle[1] - half, middle[1] + half)
    panel.set_title(f"section along {'xy'[along]}")
    panel.set_axis_off()
    _scale(panel, 1.0)


def _cut(mesh: trimesh.Trimesh, keep: Mask, across: int) -> Array:
    """Segments, shape (k, 2, 3) [m], of some faces in the plane where a coordinate is 0."""
    part = mesh.submesh([np.flatnonzero(keep)], append=True, repair=False)
    return np.asarray(mesh_plane(part, np.eye(3)[across], np.zeros(3)))


def _key(figure: Figure, colours: dict[str, object], source: str) -> None:
    """Write what the colours mean, and the source, at the foot."""
    handles = [Patch(facecolor=colour, label=name) for name, colour in colours.items()]  # type: ignore[arg-type]
    figure.legend(
        handles=handles, loc="lower left", ncols=len(handles), bbox_to_anchor=(0.005, 0.0),
        handlelength=1.2, columnspacing=1.2,
    )  # fmt: skip
    figure.text(
        0.995, 0.12 / figure.get_figheight(), source, ha="right", size=7.5, color=style.FAINT
    )
