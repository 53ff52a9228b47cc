"""What the vertical components of records do: the runs of a study with and without them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from pipeline.stages.datasets.stored_runs import SIDES, parts, stored
from pipeline.stages.runs.overturning_runs import LevelRuns, kind
from pipeline.stages.runs.study import LevelStudy, Study

VARIABLE = "overturned_without_vertical"


def without(level: LevelRuns, study: Study) -> np.ndarray:
    """Whether each run overturns without them, -1 undecided, shape (runs,) of int8."""
    runs = stored(level.database, kind(on_terrain=study.settings.on_terrain), LevelStudy.of(study))
    return SIDES[runs["outcome"]]


def by_parts(level: LevelRuns, study: Study) -> Iterator[np.ndarray]:
    """The same part by part."""
    for _, runs in parts(level.database, LevelStudy.of(study)):
        yield SIDES[runs["outcome"]]


def effect(runs: xr.Dataset) -> dict[str, int] | None:
    """How many runs were decided both ways, and how many overturn in one of them only.

    Parameters
    ----------
    runs : Dataset, with ``outcome``; None comes of one without vertical components
    """
    if VARIABLE not in runs:
        return None
    more = fewer = number = 0
    both = runs[["outcome", VARIABLE]]
    yaws = [{"yaw": number} for number in range(runs.sizes["yaw"])] if "yaw" in runs.dims else [{}]
    for own in map(both.isel, yaws):
        overturned, level = SIDES[own["outcome"].values], own[VARIABLE].values
        decided = (overturned >= 0) & (level >= 0)
        more += int((decided & (overturned > level)).sum())
        fewer += int((decided & (overturned < level)).sum())
        number += int(decided.sum())
    return {"decided": number, "changed": more + fewer, "more": more, "fewer": fewer}
