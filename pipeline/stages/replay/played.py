"""A run of a study done once more, and held against what the study stored of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import xarray as xr

from pipeline.config.problems import InputError, Problem
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.replay.choice import Choice
from pipeline.stages.runs.scenes import Scenes, flat_case, terrain_case
from pipeline.stages.runs.study import Study
from vsr_core import GRAVITY, engines
from vsr_core.errors import InvalidInput
from vsr_core.outcome import Response
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.input_checks import longest_step
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
    responses: xr.Dataset,
    choice: Choice,
    *,
    spacing: float | None = None,
    longest: float = math.inf,
) -> Played:
    """Do a run once more.

    Parameters
    ----------
    spacing : float [s], longest time between two states; by default as many as a page holds
    longest : float [s], for which it goes on at most after its outcome was decided
    """
    scenes = study.scenes
    own = choice.engine == scenes.settings.engine
    motion = study.motions.motion(choice.cell)
    try:
        place, settings = (_own if own else _elsewhere)(study, choice)
        if spacing is None:
            unit = math.sqrt(scenes.rock.radius / GRAVITY)
            spacing = (motion.duration + _SEEN * unit) / MOST_FRAMES
        replay = do_again(place, motion, settings, spacing=spacing, longest=longest)
    except InvalidInput as error:
        raise InputError.from_invalid(choice.engine, "", error) from None
    if own:
        _compare(replay.response, choice.among(responses))
    along = -math.radians(choice.group.yaw) if isinstance(place, TerrainCase) else 0.0
    return Played(choice, replay, along, own)


def _own(study: Study, choice: Choice) -> tuple[Case | TerrainCase, Settings]:
    return _place(study.scenes, choice), study.how(choice.group)


def _elsewhere(study: Study, choice: Choice) -> tuple[Case | TerrainCase, Settings]:
    """The run in another engine: at its usual step, and with the impacts that it knows."""
    engines.load(choice.engine)
    scenes = study.scenes.with_contact(restitution_law="newton")
    step = longest_step(flat_case(scenes, choice.group).full, choice.engine)
    return _place(scenes, choice), Settings(step, scenes.settings.simulation.reduce, choice.engine)


def _place(scenes: Scenes, choice: Choice) -> Case | TerrainCase:
    case = terrain_case if scenes.settings.on_terrain else flat_case
    return case(scenes, choice.group)


def _compare(found: Response, stored: xr.Dataset) -> None:
    """Refuse a run that is not the one of the study, number by number."""
    names = ("outcome", "decided_by", "steps", "peak_tilt", "final_tilt", "slip")
    differs = [name for name in names if getattr(found, name) != stored[name].item()]
    if differs:
        given = f"{found.outcome.name.lower()}, {found.decided_by.how}"
        rule = f"the run stored for this cell has another {', '.join(differs)}"
        remedy = "make the study anew: vsr clean, then vsr run fragility"
        raise InputError(Problem(Responses.FILE, "", given, rule, remedy))
