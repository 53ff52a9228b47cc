"""A few runs of a study from which one learns most, chosen by rule and packed to be played."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pipeline.stages.fragility.summary import long_rows
from pipeline.stages.motions.motion_grid import Cell
from pipeline.stages.replay.choice import Choice
from pipeline.stages.replay.film import film, named, played, scene
from pipeline.stages.runs.scenes import Group
from pipeline.stages.runs.study import Study
from vsr_core.arrays import Array

SPACING, AFTERWARDS = 0.02, 1.5
"""Time between two states of such a run, and for which it goes on once it is decided [s]."""

MOST_ROCK_FACES = 1500


class Place(NamedTuple):
    """Where a run is on (yaw, friction, row, PGA) in ``responses.nc``, and why it teaches."""

    at: tuple[int, ...]
    why: str


def chosen(responses: xr.Dataset) -> list[Place]:
    """The last run that stays upright and the first that topples, and one of an island.

    Of all rows with a long pulse it is the one whose rock tilts most without toppling. An island
    is a run that stays upright between a weaker and a stronger motion of its row that topple the
    rock; the one chosen lies furthest above the weakest that does.
    """
    overturned, tilt = responses["overturned"].values, responses["tilt_until_decided"].values
    first = np.argmax(overturned == 1, axis=-1)
    known = (overturned == 1).any(axis=-1) & (first > 0)
    below = np.maximum(first - 1, 0)[..., None]
    upright = np.take_along_axis(overturned, below, -1)[..., 0] == 0
    tilted = np.take_along_axis(tilt, below, -1)[..., 0]
    candidates = known & upright & long_rows(responses["pgv_pga"].values)
    places = []
    if candidates.any():
        *at, row = _largest(np.where(candidates, tilted, -1.0))
        column = int(first[(*at, row)])
        places = [
            Place((*at, row, column - 1), "just below the boundary"),
            Place((*at, row, column), "just above the boundary"),
        ]
    columns = np.arange(overturned.shape[-1])
    last = columns[-1] - np.argmax(overturned[..., ::-1] == 1, axis=-1)
    above = columns - first[..., None]
    island = (overturned == 0) & known[..., None] & (above > 0) & (columns < last[..., None])
    if island.any():
        places.append(Place(_largest(np.where(island, above, -1)), "an island above the boundary"))
    return places


def packed(
    study: Study, responses: xr.Dataset, rock: xr.Dataset, terrain: xr.Dataset | None
) -> dict[str, Any] | None:
    """Those runs and what they are played in."""
    places = chosen(responses)
    if not places:
        return None
    shaking = study.motions
    choices = [_choice(responses, place, study.settings.engine) for place in places]
    runs = [
        played(study, choice, choice.among(responses), spacing=SPACING, longest=AFTERWARDS)
        for choice in choices
    ]
    return {
        "scene": scene(rock, terrain, runs, MOST_ROCK_FACES),
        "films": [film(run, shaking) for run in runs],
        "places": [
            {
                "diagram": place.at[0] * responses.sizes["friction"] + place.at[1],
                "row": place.at[2],
                "column": place.at[3],
                "why": place.why,
                "name": named(choice, shaking),
            }
            for place, choice in zip(places, choices, strict=True)
        ],
    }


def _choice(responses: xr.Dataset, place: Place, engine: str) -> Choice:
    yaw, friction, row, column = place.at
    run = responses.isel(yaw=yaw, friction=friction, pga=column)
    group = Group(float(run["yaw"]), float(run["friction"]))
    return Choice(group, Cell(row, float(run["pga"])), engine)


def _largest(values: Array) -> tuple[int, ...]:
    """Place of the largest value, the first of several."""
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(values)), values.shape))
