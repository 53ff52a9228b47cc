"""Figures of a scan's preparation: rock and ground, what was added, and what that changes."""

from __future__ import annotations

import math
from itertools import cycle

import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch
from trimesh.intersections import mesh_plane

from pipeline.drawing import style
from pipeline.drawing.painting import GROUND
from pipeline.drawing.view import View, axes_of, fitted
from pipeline.stages.mesh.scan_views import (
    ABOVE,
    BELOW,
    PANEL,
    SEAM,
    SMOOTH,
    Painted,
    best_eye,
    fit,
    scale,
    show,
    visible,
)
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.scan.preparation import Prepared
from vsr_core.scan.weighing import DIRECTIONS, Seen, Trial
from vsr_core.terrain.surface import Terrain

ROCK, ADDED, EARTH = "#7fa8d6", "#f0a030", to_hex(GROUND.tolist())
"""Colours of the rock, of what no scan saw, and of the ground."""

WIDTH = 9.6  # inches

NOTHING = "#c4c4c4"
"""Colour of what is neither rock nor ground."""

_SIDES = {
    "above": ("from above", ABOVE),
    "+y": ("along +y", axes_of(math.radians(-90.0), math.radians(12.0))),
    "-x": ("along -x", axes_of(0.0, math.radians(12.0))),
    "oblique": ("from below, oblique", axes_of(math.radians(-60.0), math.radians(-40.0))),
    "below": ("from below", BELOW),
}
"""Titles and axes of views."""

_AROUND = 1.5  # widths of a rock, from its middle, of the ground that is drawn with it

_BOTH = np.array([-1.0, 1.0])


@style.styled
def separation(prepared: Prepared, source: str) -> Figure:
    """Draw the scan with rock and ground told apart, and the seam, from above and two sides."""
    found = prepared.separation
    colours = np.where(found.rock[:, None], to_rgb(ROCK), GROUND)
    scan = Painted(found.vertices + prepared.shift, found.faces, colours)
    loops = [seam.points + prepared.shift for seam in found.seams]
    rock = np.array(prepared.rock.vertices)
    near = scan.around(rock)
    figure, panels = _panels(2, 2)
    whole = fit(ABOVE, scan.vertices, 0.03)
    show(panels[0], whole, scan, loops, "the whole scan, from above")
    _ring(panels[0], whole, rock)
    for panel, (title, axes) in zip(
        panels[1:], _eyes(near, rock, np.concatenate(loops)), strict=True
    ):
        show(panel, fit(axes, rock, 0.16), near, loops, title)
    _key(figure, {"rock": ROCK, "ground": GROUND, "seam, dotted where hidden": SEAM}, source)
    return figure


def closed_rock(prepared: Prepared, source: str) -> Figure:
    """Draw the closed rock, what the scan saw and what was added, from the sides and below."""
    return rock_from_sides(
        np.array(prepared.rock.vertices),
        np.array(prepared.rock.faces),
        prepared.added,
        np.empty((0, 3)),
        source,
    )


@style.styled
def rock_from_sides(
    vertices: Array, faces: Indices, added: Mask, marks: Array, source: str
) -> Figure:
    """Draw a closed rock, what the scan saw and what was added, from the sides and below.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    added : ndarray of bool, shape (m,)
    marks : ndarray, shape (k, 3) [m], places to ring, with their numbers
    """
    parts = {"seen by the scan": (~added, ROCK), "added": (added, ADDED)}
    return _from_sides(vertices, faces, parts, marks, source, ("+y", "-x", "oblique", "below"))


@style.styled
def scan_from_sides(seen: Seen, marks: Array, source: str) -> Figure:
    """Draw a scan that was refused, its parts by colour, from above and two sides.

    Parameters
    ----------
    marks : ndarray, shape (k, 3) [m], places to ring, with their numbers
    """
    known = {"rock": ROCK, "ground": EARTH, "added": ADDED}
    rest = np.ones(len(seen.faces), dtype=bool)
    parts: dict[str, tuple[Mask, str]] = {}
    for (name, mask), colour in zip(seen.parts.items(), cycle(style.SERIES), strict=False):
        parts[name] = mask, known.get(name, colour)
        rest &= ~mask
    if rest.any():
        parts = {"not yet identified": (rest, NOTHING), **parts}
    return _from_sides(seen.vertices, seen.faces, parts, marks, source, ("above", "+y", "-x"))


@style.styled
def on_its_ground(rock: trimesh.Trimesh, terrain: Terrain, source: str) -> Figure:
    """Draw a rock and the ground around it, from above and two sides."""
    middle, width = rock.bounds.mean(axis=0), float(rock.extents.max())
    away = np.abs(terrain.vertices[:, :2] - middle[:2]).max(axis=1)
    around = terrain.faces[(away < _AROUND * width)[terrain.faces].any(axis=1)]
    used, ground = np.unique(around, return_inverse=True)
    vertices = np.concatenate([rock.vertices, terrain.vertices[used]])
    faces = np.concatenate([rock.faces, len(rock.vertices) + ground.reshape(-1, 3)])
    own = np.arange(len(faces)) < len(rock.faces)
    parts = {"rock": (own, ROCK), "ground": (~own, EARTH)}
    return _from_sides(vertices, faces, parts, np.empty((0, 3)), source, ("above", "+y", "-x"))


def _from_sides(
    vertices: Array,
    faces: Indices,
    parts: dict[str, tuple[Mask, str]],
    marks: Array,
    source: str,
    sides: tuple[str, ...],
) -> Figure:
    """Draw a surface, its parts in their colours, from some sides; of overlaps the last is seen."""
    colours = np.empty((len(faces), 3))
    for mask, colour in parts.values():
        colours[mask] = to_rgb(colour)
    surface = Painted(vertices, faces, colours)
    figure, panels = _panels(1, len(sides))
    for panel, side in zip(panels, sides, strict=True):
        title, axes = _SIDES[side]
        view = fit(axes, vertices, 0.12)
        show(panel, view, surface, [], title)
        _number(panel, view, marks)
    _key(figure, {name: colour for name, (_, colour) in parts.items()}, source)
    return figure


def _number(panel: Axes, view: View, marks: Array) -> None:
    """Ring places in a view and number them."""
    for number, (x, y) in enumerate(view.project(marks)[:, :2] / SMOOTH, 1):
        panel.add_patch(Circle((x, y), 13.0, fill=False, ec=SEAM, lw=1.5, gid="ring"))
        panel.text(x + 16.0, y, str(number), color=SEAM, va="center", path_effects=style.HALO)


@style.styled
def seat(prepared: Prepared, source: str) -> Figure:
    """Draw the ground without the rock, and sections through both."""
    terrain = prepared.terrain
    colours = np.where(prepared.seat[:, None], to_rgb(ADDED), GROUND)
    rock = np.array(prepared.rock.vertices)
    near = Painted(terrain.vertices, terrain.faces, colours).around(rock)
    under = terrain.vertices[np.unique(terrain.faces[prepared.seat])]
    figure, panels = _panels(1, 4)
    eyes = ("from above", ABOVE), best_eye(near, under, rock)
    for panel, (title, axes) in zip(panels[:2], eyes, strict=True):
        show(panel, fit(axes, _widened(under, 0.6)), near, [], title)
    for panel, across in ((panels[2], 1), (panels[3], 0)):
        _section(panel, prepared, across)
    _key(figure, {"rock": ROCK, "ground, black in sections": GROUND, "added": ADDED}, source)
    return figure


@style.styled
def tippings(closing: str, chosen: Array, trials: tuple[Trial, ...], source: str) -> Figure:
    """Draw the static tipping angle against direction for every closing that stands.

    Parameters
    ----------
    chosen : ndarray, shape (72,) [rad], its static tipping angles in ``DIRECTIONS``
    """
    angles = {f"{closing} (chosen)": chosen}
    angles |= {t.closing: t.measure.tipping for t in trials if t.measure is not None}
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
    lines.set(xlim=(0.0, 360.0), xticks=np.arange(0.0, 361.0, 60.0),
              xlabel="direction of tipping, counter-clockwise from +x [°]",
              ylabel="difference from the closing chosen [°]")  # fmt: skip
    lines.grid(visible=True)
    lines.legend(loc="best")
    figure.suptitle(source, size=8.0, color=style.FAINT)
    return figure


def _eyes(near: Painted, rock: Array, seam: Array) -> list[tuple[str, Array]]:
    """Titles and axes of the views of a seam: above, its best side, and the best of the rest."""
    first, axes = best_eye(near, seam, rock)
    view = fitted(axes, rock, (PANEL // 2, PANEL // 2), 0.16)
    hidden = ~visible(view, near, seam)
    second = best_eye(near, seam[hidden] if hidden.any() else seam, rock, axes)
    return [("from above", ABOVE), (first, axes), second]


def _widened(points: Array, share: float) -> Array:
    """Corners of a box around points, wider on every side by a share of its longest side."""
    ends = np.array([points.min(axis=0), points.max(axis=0)])
    ends[:, :2] += share * np.ptp(ends, axis=0).max() * _BOTH[:, None]
    box: Array = trimesh.bounds.corners(ends)
    return box


def _panels(rows: int, columns: int) -> tuple[Figure, list[Axes]]:
    side = WIDTH / columns
    tall = rows * (side + 0.28) + 0.5
    figure = Figure(figsize=(WIDTH, tall))
    margins = {"left": 0.005, "right": 0.995, "top": 1.0 - 0.25 / tall, "bottom": 0.5 / tall,
               "wspace": 0.02, "hspace": 0.28 / side}  # fmt: skip
    return figure, list(figure.subplots(rows, columns, gridspec_kw=margins).ravel())


def _ring(panel: Axes, view: View, rock: Array) -> None:
    """Show where the rock is in a wide view."""
    points = view.project(rock)[:, :2] / SMOOTH
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = max(1.3 * float(np.linalg.norm(points - middle, axis=1).max()), 16.0)
    panel.add_patch(Circle(middle, radius, fill=False, ec=style.INK, lw=1.0, gid="ring"))


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
    panel.set(xlim=middle[0] + half * _BOTH, ylim=middle[1] + half * _BOTH)
    panel.set_title(f"section along {'xy'[along]}")
    panel.set_axis_off()
    scale(panel, 1.0)


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
