"""A few runs of a study from which one learns most, chosen by rule and packed to be played."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from pipeline.stages.fragility.summary import groups, long_rows
from pipeline.stages.motions.motion_grid import Cell
from pipeline.stages.replay.choice import Choice
from pipeline.stages.replay.film import film, named, played, scene
from pipeline.stages.runs.scenes import Group
from pipeline.stages.runs.study import Study
from vsr_core.arrays import Array, Indices, Mask

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
    most, furthest = -1.0, 0
    below: tuple[int, ...] = ()
    island: tuple[int, ...] = ()
    for at, _ in groups(responses):
        own = responses.isel(yaw=at[0], friction=at[1])
        tilt, place = _most_tilted(own)
        if tilt > most:
            most, below = tilt, (*at, *place)
        above, place = _furthest_island(own["overturned"].values)
        if above > furthest:
            furthest, island = above, (*at, *place)
    places: list[Place] = []
    if below:
        *row, column = below
        places = [
            Place(below, "just below the boundary"),
            Place((*row, column + 1), "just above the boundary"),
        ]
    if island:
        places.append(Place(island, "an island above the boundary"))
    return places


def _most_tilted(runs: xr.Dataset) -> tuple[float, tuple[int, ...]]:
    """Largest tilt of the last runs that stay upright, and place; -1 where there is none.

    Where none is kept, it is the first of those runs.
    """
    overturned, tilt = runs["overturned"].values, runs["tilt_until_decided"].values
    first, known = _first(overturned)
    rows, last = np.arange(len(first)), np.maximum(first - 1, 0)
    upright = overturned[rows, last] == 0
    candidates = known & upright & long_rows(runs["pgv_pga"].values)
    tilted = np.where(candidates, np.nan_to_num(tilt[rows, last]), -1.0)
    row = int(np.argmax(tilted))
    return float(tilted[row]), (row, int(last[row]))


def _furthest_island(overturned: Array) -> tuple[int, tuple[int, ...]]:
    """Columns from the first run that topples to the island furthest above it, and place."""
    first, known = _first(overturned)
    columns = np.arange(overturned.shape[-1])
    last = columns[-1] - np.argmax(overturned[:, ::-1] == 1, axis=-1)
    above = columns - first[:, None]
    island = (overturned == 0) & known[:, None] & (above > 0) & (columns < last[:, None])
    row, column = np.unravel_index(int(np.argmax(np.where(island, above, 0))), above.shape)
    return int(above[row, column] * island[row, column]), (int(row), int(column))


def _first(overturned: Array) -> tuple[Indices, Mask]:
    """Column of the first run of each row that topples, and whether one below it does not."""
    toppled = overturned == 1
    first = np.argmax(toppled, axis=-1)
    return first, toppled.any(axis=-1) & (first > 0)


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
