"""What a run on a terrain depends on is in its identity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import trimesh
from support import grounds

from pipeline.config.layers import load_site
from pipeline.stages.mesh.products import Ground, Standing
from pipeline.stages.motions.motion_grid import MotionData
from pipeline.stages.runs import scenes
from pipeline.stages.runs.scenes import Scenes
from pipeline.stages.runs.step_choice import TimeSteps
from pipeline.stages.runs.study import Study
from pipeline.workflow.engine_input import Engine
from vsr_core.judge.proofs import barrier
from vsr_core.rock import solid
from vsr_core.scene import State

ROCK = solid.box((0.3, 0.3, 0.6), 2000.0).rock
SEAT = grounds.bumpy(1, 0.1, 1.0, 2.0, 6)
CONFIG = load_site("double_rock_terrain").config


def standing(height: float, lean: float = 0.0) -> State:
    return grounds.at_rest(height, grounds.turn_z(lean))


def told(ground: Ground) -> object:
    return scenes.identity(Scenes(CONFIG.scene, Standing(ROCK, barrier(ROCK)), ground))["pedestal"]


def shifted(points: np.ndarray) -> np.ndarray:
    """The points, the last one moved by a micrometre."""
    moved = points.copy()
    moved[-1, 2] += 1e-6
    return moved


CHANGES: dict[str, Callable[[Ground], Ground]] = {
    "place of rest": lambda g: replace(g, starts=(g.starts[0], standing(0.300001))),
    "pose of rest": lambda g: replace(g, starts=(g.starts[0], standing(0.3, 1e-6))),
    "rest at another friction": lambda g: replace(g, starts=(standing(0.300001), g.starts[1])),
    "a corner": lambda g: replace(
        g, terrain=replace(g.terrain, vertices=shifted(g.terrain.vertices))
    ),
    "a seam that bears": lambda g: replace(g, whole_seam=True),
    "a triangle": lambda g: replace(
        g, terrain=replace(g.terrain, faces=np.roll(g.terrain.faces, 1, axis=1))
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_runs_on_other_ground_are_other_runs(change: str) -> None:
    known = Ground(SEAT, (standing(0.3), standing(0.3)))
    again = Ground(replace(SEAT), (standing(0.3), standing(0.3)))
    assert told(again) == told(known)
    assert told(CHANGES[change](known)) != told(known)


def test_a_friction_more_leaves_the_runs_of_another_as_they_are(tmp_path: Path) -> None:
    """Of rests on the ground only that at a run's own friction is told."""
    found = []
    for friction, rests in (("[0.4, 0.6]", (0.301, 0.3)), ("[0.6]", (0.3,)), ("[0.6]", (0.302,))):
        settings = (f"contact.friction={friction}", "simulation.time_step=0.002")
        config = load_site("double_rock_terrain", None, settings).config
        ground = Ground(SEAT, tuple(map(standing, rests)))
        steps, nothing = TimeSteps((0.002,) * len(rests)), MotionData(tmp_path)
        own = Scenes(config.scene, Standing(ROCK, barrier(ROCK)), ground)
        study = Study(own, cast(Engine, None), config.yaw, config.motion, nothing, steps)
        found.append(study.scene(study.groups[-1]))
    assert found[0] == found[1] != found[2]


@pytest.mark.slow
@pytest.mark.parametrize("whole", [False, True])
def test_all_of_a_rock_touches_a_seam_all_of_which_bears(whole: bool) -> None:
    """A light hull stands off the ground beside its base, where points do not bear."""
    ball = solid.from_mesh(trimesh.creation.icosphere(3, 0.5), 2000.0).rock
    ground = Ground(SEAT, (standing(0.5), standing(0.5)), whole)
    found = Scenes(CONFIG.scene, Standing(ball, None), ground).seated_rock
    assert (len(found.vertices) == len(ball.vertices)) == whole


def test_a_rock_of_pieces_is_another_one_where_they_touch() -> None:
    """On a plane its hull touches, whatever it is made of."""
    lower, upper = (ROCK.vertices[(ROCK.vertices[:, 2] < 0.0) == low] for low in (True, False))
    whole, parted = Standing(ROCK, None), Standing(replace(ROCK, pieces=(lower, upper)), None)
    other = Standing(replace(ROCK, pieces=(upper, lower)), None)
    ground = Ground(SEAT, (standing(0.3), standing(0.3)))
    keys = [
        str(scenes.identity(Scenes(CONFIG.scene, rock, ground))) for rock in (whole, parted, other)
    ]
    assert len(set(keys)) == len(keys)
    level = load_site("double_rock").config.scene
    found = [scenes.identity(Scenes(level, rock, None)) for rock in (whole, parted)]
    assert found[0] == found[1]
