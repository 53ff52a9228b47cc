"""Runs and their scene as a page holds them: `scene3d_scripts/stage.js` unpacks and draws them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.problems import InputError, Problem
from pipeline.drawing.rendering import packed, packed_mesh, thinned
from pipeline.drawing.view import contour_step, reach, round_number
from pipeline.stages.motions.motion_grid import Shaking
from pipeline.stages.replay.choice import RESULTS, Choice
from pipeline.stages.runs.scenes import Scenes, flat_case, terrain_case
from pipeline.stages.runs.study import Study
from pipeline.workflow.pages import source as text_of
from pipeline.workflow.run_store import RUNS
from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.outcome import Response
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.input_checks import check_engine, longest_step
from vsr_core.run.replay import Replay
from vsr_core.run.replay import replay as do_again

MOST_FRAMES = 4000
"""States of a run that a page holds, about; a long run is kept at longer intervals."""

_SEEN = 40.0
"""Time after the motion that is expected to be seen, in units of sqrt(radius / g)."""


@dataclass(frozen=True, eq=False)
class Played:
    """A run that can be played.

    Attributes
    ----------
    along : float [rad], direction of the shaking, counter-clockwise from +x
    own : bool, whether it is a run of the study, whose stored outcome it has
    """

    choice: Choice
    replay: Replay
    along: float
    own: bool


def played(
    study: Study,
    choice: Choice,
    stored: Mapping[str, Any] | None,
    *,
    spacing: float | None = None,
    longest: float = math.inf,
) -> Played:
    """Do a run once more.

    Parameters
    ----------
    stored : mapping, its results in the study (see ``Choice.among``); None of another engine's
    spacing : float [s], longest time between two states; by default as many as a page holds
    longest : float [s], for which it goes on at most after its outcome was decided
    """
    scenes = study.scenes
    motion = study.motions.motion(choice.cell)
    try:
        place, settings = (_own if stored else _elsewhere)(study, choice)
        if spacing is None:
            unit = math.sqrt(scenes.rock.radius / GRAVITY)
            spacing = (motion.duration + _SEEN * unit) / MOST_FRAMES
        replay = do_again(place, motion, settings, spacing=spacing, longest=longest)
    except InvalidInput as error:
        raise InputError.from_invalid(choice.engine, "", error) from None
    if stored:
        _compare(replay.response, stored)
    along = -math.radians(choice.group.yaw) if isinstance(place, TerrainCase) else 0.0
    return Played(choice, replay, along, stored is not None)


def _own(study: Study, choice: Choice) -> tuple[Case | TerrainCase, Settings]:
    return _place(study.scenes, choice), study.how(choice.group)


def _elsewhere(study: Study, choice: Choice) -> tuple[Case | TerrainCase, Settings]:
    """The run in another engine: at its usual step, and with the impacts that it knows."""
    engines.load(choice.engine)
    scenes = study.scenes.with_contact(restitution_law="newton")
    level = flat_case(scenes, choice.group).full
    check_engine(level, choice.engine, study.motions.motion(choice.cell))
    step = longest_step(level, choice.engine)
    return _place(scenes, choice), Settings(step, scenes.settings.simulation.reduce, choice.engine)


def _place(scenes: Scenes, choice: Choice) -> Case | TerrainCase:
    case = terrain_case if scenes.settings.on_terrain else flat_case
    return case(scenes, choice.group)


def _compare(found: Response, stored: Mapping[str, Any]) -> None:
    """Refuse a run that is not the one of the study, number by number."""
    known = [name for name in RESULTS if name in stored]
    if differs := [name for name in known if getattr(found, name) != stored[name]]:
        given = f"{found.outcome.name.lower()}, {found.decided_by.how}"
        rule = f"the run stored for this cell has another {', '.join(differs)}"
        remedy = "make the study anew: vsr clean, then vsr run fragility"
        raise InputError(Problem(RUNS, "", given, rule, remedy))


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
