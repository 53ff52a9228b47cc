"""The rock from three sides, with its base, its centre of mass and how it would tip."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from pipeline.drawing import style
from pipeline.stages.fragility.summary import weak_directions
from vsr_core.arrays import Array

_MOST_FACES = 60_000
"""A finer surface is thinned: more is not seen, and costs seconds."""

_VIEWS = (
    # title, axis to the right, axis up, axis towards the eye and its sign
    ("front, seen along +y", 0, 2, 1, -1.0),
    ("side, seen along -x", 1, 2, 0, 1.0),
    ("plan, seen from above", 0, 1, 2, 1.0),
)
_ARROW = {"arrowstyle": "-|>", "color": style.INK, "lw": 1.3, "shrinkA": 0, "shrinkB": 0}
_LIGHT = np.array([-0.45, 0.65, 0.62])  # right, up, towards the eye


@style.styled
def rock_views(rock: xr.Dataset) -> Figure:
    """Draw front, side and plan of the rock at rest."""
    vertices = rock["surface_vertex"].values.astype(float)
    vertices, faces = _thinned(vertices, rock["surface_face"].values)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = high - low
    reach = 0.62 * max(size[0], size[1])  # of the arrows, from the centre of the plan
    figure = Figure(figsize=(9.4, 3.9))
    widths = [max(size[0], 0.42 * size[2]), max(size[1], 0.42 * size[2]), 0.98 * size[2]]
    panels = figure.subplots(
        1, 3, width_ratios=widths, gridspec_kw={"left": 0.06, "right": 0.985, "wspace": 0.3}
    )
    figure.subplots_adjust(top=0.93, bottom=0.2)
    for axes, (title, right, up, eye, sign) in zip(panels, _VIEWS, strict=True):
        _surface(axes, vertices, faces, (right, up, eye), sign)
        axes.set_title(title)
        axes.set_xlabel(f"{'xyz'[right]} [m]")
        axes.set_ylabel(f"{'xyz'[up]} [m]")
        axes.set_aspect("equal")
        axes.locator_params(nbins=5)
        axes.locator_params(axis="x", nbins=4 if up == 2 else 6)
        if up == 2 and size[right] < 0.4 * size[2]:  # no room for two labels
            axes.set_xticks([0.0])
    for axes, across in zip(panels[:2], (0, 1), strict=True):
        _pedestal(axes, rock["base_polygon"].values[:, across], low, high, across)
    _plan(panels[2], rock, low, high, reach)
    for axes in panels:
        axes.plot(0, 0, "o", ms=7, mfc="white", mec=style.INK, label="centre of mass", zorder=5)
        axes.plot(0, 0, "+", ms=7, color=style.INK, zorder=6)
    style.legend_below(figure, panels[2], 3)
    return figure


def _surface(
    axes: Axes, vertices: Array, faces: Any, axis: tuple[int, int, int], sign: float
) -> None:
    """Shaded faces that look at the eye, the nearest drawn last."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    facing = normal[:, axis] * [1.0, 1.0, sign]
    seen = facing[:, 2] > 0.0
    corners, facing = corners[seen], facing[seen]
    order = np.argsort(sign * corners[:, :, axis[2]].mean(axis=1))
    light = 0.5 + 0.5 * np.clip(facing @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    colour = light[:, None] * np.array([[0.86, 0.81, 0.73]])
    axes.add_collection(
        PolyCollection(
            corners[order][:, :, axis[:2]],
            facecolors=colour[order],
            edgecolors="face",  # else seams show between faces
            linewidths=0.3,
            rasterized=True,
            gid="surface",
        )
    )
    axes.autoscale_view()


def _pedestal(axes: Axes, base: Array, low: Array, high: Array, across: int) -> None:
    margin = 0.15 * (high[across] - low[across])
    axes.set_xlim(low[across] - margin, high[across] + margin)
    axes.set_ylim(low[2] - 0.06 * (high[2] - low[2]), high[2] + 0.04 * (high[2] - low[2]))
    axes.axhspan(axes.get_ylim()[0], low[2], color="#dddddd", zorder=0)
    axes.axhline(low[2], color=style.INK, lw=0.8)
    ends = [base.min(), base.max()]
    axes.plot(ends, [low[2]] * 2, color=style.BASE, lw=3.5, solid_capstyle="butt")


def _plan(axes: Axes, rock: xr.Dataset, low: Array, high: Array, reach: float) -> None:
    base = Polygon(
        rock["base_polygon"].values,
        facecolor=style.BASE,
        edgecolor=style.INK,
        alpha=0.75,
        lw=0.8,
        label="base polygon",
        gid="base",
        zorder=3,
    )
    axes.add_patch(base)
    weakest = weak_directions(rock)
    turns = np.radians([weak.direction for weak in weakest])
    tips = reach * np.column_stack([np.cos(turns), np.sin(turns)])
    for number, (weak, tip) in enumerate(zip(weakest, tips, strict=True)):
        axes.annotate("", tip, (0.0, 0.0), arrowprops=_ARROW, zorder=4)
        axes.text(
            1.06 * tip[0],
            1.06 * tip[1],
            f"{weak.angle:.1f}°",
            ha=("right", "center", "left")[int(np.sign(np.round(tip[0] / reach, 1))) + 1],
            va=("top", "center", "bottom")[int(np.sign(np.round(tip[1] / reach, 1))) + 1],
            weight="bold" if number == 0 else "normal",
            gid="weak",
        )
    text = "weak direction, static tipping angle"
    axes.plot([], [], color=style.INK, marker=">", ms=4, label=text)
    room = 0.3 * reach * np.array([1.5, 1.0])  # for the angles
    axes.set_xlim(*_span(low[0], high[0], tips[:, 0], room[0]))
    axes.set_ylim(*_span(low[1], high[1], tips[:, 1], room[1]))


def _span(low: float, high: float, tips: Array, room: float) -> tuple[float, float]:
    return min(low, tips.min()) - room, max(high, tips.max()) + room


def _thinned(vertices: Array, faces: Any) -> tuple[Array, Any]:
    """Thin a surface: the vertices of one cell of a fine lattice become one."""
    if len(faces) <= _MOST_FACES:
        return vertices, faces
    cell = np.ptp(vertices, axis=0).max() / 120.0
    _, first, merged = np.unique(
        np.round(vertices / cell).astype(int), axis=0, return_index=True, return_inverse=True
    )
    faces = merged.reshape(-1)[faces]
    real = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return vertices[first], np.unique(faces[real], axis=0)
