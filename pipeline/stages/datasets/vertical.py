"""What the vertical components of records do: the runs of a study with and without them."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pipeline.stages.datasets.stored_runs import stored
from pipeline.stages.runs.overturning_runs import LevelRuns, kind
from pipeline.stages.runs.study import LevelStudy, Study
from vsr_core.outcome import Outcome

VARIABLE = "overturned_without_vertical"


def without(level: LevelRuns, study: Study) -> np.ndarray:
    """Whether each run overturns without them, -1 undecided, shape (runs,) of int8."""
    runs = stored(level.database, kind(on_terrain=study.settings.on_terrain), LevelStudy.of(study))
    return np.array([outcome.overturned for outcome in Outcome], "i1")[runs["outcome"]]


def effect(runs: xr.Dataset) -> dict[str, int] | None:
    """How many runs were decided both ways, and how many overturn in one of them only.

    Parameters
    ----------
    runs : Dataset, with ``outcome``; None comes of one without vertical components
    """
    if VARIABLE not in runs:
        return None
    overturned = np.array([outcome.overturned for outcome in Outcome])[runs["outcome"].values]
    level = runs[VARIABLE].values
    decided = (overturned >= 0) & (level >= 0)
    more, fewer = (int((decided & (overturned - level == sign)).sum()) for sign in (1, -1))
    return {"decided": int(decided.sum()), "changed": more + fewer, "more": more, "fewer": fewer}
