"""Runs and their scene as a page holds them: `scene3d_scripts/stage.js` unpacks and draws them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from pipeline.drawing.rendering import packed, packed_mesh, thinned
from pipeline.drawing.view import contour_step, reach, round_number
from pipeline.stages.motions.motion_grid import Shaking
from pipeline.stages.replay.choice import Choice
from pipeline.stages.replay.played import Played
from pipeline.workflow.pages import source as text_of
from vsr_core import GRAVITY
from vsr_core.arrays import Array, Indices

SCRIPTS = tuple(
    f"{part}.js" for part in ("geometry", "samples", "drawing", "controls", "playing", "stage")
)
"""Scripts that play a run, in the order in which they depend on each other."""

SHOWN_AFTER = 1.5
"""Time [s] after the decision that the first view still holds."""

_TURNS = 32_767  # steps of a part of a quaternion
_MOST_BEARING = 255  # points of contact of one state
_ELEVATION = math.radians(17.0)
_ASIDE = math.radians(25.0)  # of the eye, from square to the shaking

CURVES = ("tilt", "kinetic", "potential", "acceleration", "velocity")
"""Numbers of a film over its time: [degree], [J], [J], [g] and [m/s]."""


def film(run: Played, shaking: Shaking) -> dict[str, Any]:
    """A run in few bytes."""
    replay, response = run.replay, run.replay.response
    axes = np.flatnonzero(np.abs(replay.acceleration).max(axis=0) > 0.0)
    table = axes if len(axes) else np.array([0])
    bearing = [points[:_MOST_BEARING] for points in replay.bearing]
    speed = np.linalg.norm(np.gradient(replay.position, replay.time, axis=0), axis=1)
    return {
        "name": named(run.choice, shaking),
        "engine": run.choice.engine,
        "outcome": response.outcome.name.lower(),
        "how": response.decided_by.how,
        "simulated": response.steps > 0,
        "decided": replay.decided,
        "along": run.along,
        "curves": CURVES,
        "axes": ["xyz"[axis] for axis in table],
        "time": packed(replay.time, "<f4"),
        "place": packed(replay.position, "<f4"),
        "turn": packed(np.rint(replay.quaternion * _TURNS), "<i2"),
        "speed": packed(speed, "<f4"),
        "tilt": packed(np.degrees(replay.tilt), "<f4"),
        "kinetic": packed(replay.kinetic, "<f4"),
        "potential": packed(replay.potential, "<f4"),
        "acceleration": packed(replay.acceleration[:, table] / GRAVITY, "<f4"),
        "velocity": packed(replay.velocity[:, table], "<f4"),
        "count": packed([len(points) for points in bearing], "<u1"),
        "bearing": packed(np.concatenate(bearing), "<f4"),
    }


def named(choice: Choice, shaking: Shaking) -> str:
    """A run in words."""
    row = shaking.pgv_pga[choice.cell.row]
    parts = [f"yaw {choice.group.yaw:g}°", f"PGA {choice.cell.pga:.4g} g"]
    if shaking.dimension == "record":
        parts.append(f"record {shaking.rows[choice.cell.row]}")
    parts.append(f"PGV/PGA {row:.4g} s")
    return ", ".join([*parts, f"friction {choice.group.friction:g}"])


def scene(
    rock: xr.Dataset, terrain: xr.Dataset | None, runs: Sequence[Played], most_faces: int
) -> dict[str, Any]:
    """The scene of the replay: the surface of the rock, and the ground.

    Parameters
    ----------
    most_faces : int, of the rock, and of a terrain four times as many
    """
    radius = float(np.linalg.norm(rock["vertex"].values, axis=1).max())
    surface = (rock["surface_vertex"].values.astype(float), rock["surface_face"].values)
    path = np.concatenate([run.replay.position for run in runs])
    if terrain is None:
        ground, grid = _slab(path, radius), round_number(0.5 * radius)
    else:
        faces = terrain["terrain_face"].values.astype(np.int64)
        ground, grid = thinned(terrain["terrain_vertex"].values, faces, 4 * most_faces), 0.0
    return {
        "terrain": packed_mesh(*ground),
        "rock": packed_mesh(*thinned(*surface, most_faces)),
        "radius": radius,
        "contour": contour_step(reach(path, radius)),
        "grid": grid,
        "shown_after": SHOWN_AFTER,
        "view": {"azimuth": runs[0].along - 0.5 * math.pi + _ASIDE, "elevation": _ELEVATION},
    }


def scripts() -> list[str]:
    """Text of the scripts that play a run."""
    return [text_of(name) for name in SCRIPTS]


def _slab(path: Array, radius: float) -> tuple[Array, Indices]:
    """A level slab whose upper side is at zero, as wide as the rock needs it."""
    low = np.minimum(path[:, :2].min(axis=0) - 1.2 * radius, -2.2 * radius)
    high = np.maximum(path[:, :2].max(axis=0) + 1.2 * radius, 2.2 * radius)
    corners = np.array([[x, y] for y in (low[1], high[1]) for x in (low[0], high[0])])
    top, bottom = np.zeros((4, 1)), np.full((4, 1), -0.12 * radius)
    vertices = np.concatenate([np.hstack([corners, top]), np.hstack([corners, bottom])])
    sides = [(0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))]
    return vertices, np.array(faces)
