"""Stored runs of a study as one table, and how many came to which outcome."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.stages.mesh.products import RockData
from pipeline.stages.runs import runner
from pipeline.stages.runs.runner import Kind
from pipeline.stages.runs.study import Study
from vsr_core.arrays import Array, Indices
from vsr_core.outcome import Outcome
from vsr_core.run.movement import movements, no_return_tilt


def stored(database: Path, kind: Kind[Any], study: Study) -> pd.DataFrame:
    """All runs of a study.

    Parameters
    ----------
    database : Path, of the folder with the database of runs

    Returns
    -------
    DataFrame
        Fields of the rows but their keys, with ``yaw`` [degree], ``friction``, number of the
        ``motion`` and ``pga`` [g] of each run, PGA running fastest and yaw slowest.
    """
    parts = [
        pd.DataFrame(rows, columns=kind.row._fields).drop(columns="key").assign(**group._asdict())
        for group, rows in runner.stored(database, kind, study.groups, study.wanted)
    ]
    runs, motions = pd.concat(parts, ignore_index=True), study.motions
    pga = np.tile(motions.pga, len(runs) // len(motions.pga))
    motion = np.repeat(np.arange(len(motions.rows)), len(motions.pga))
    return runs.assign(motion=np.tile(motion, len(study.groups)), pga=pga)


def moved(rock: RockData, runs: pd.DataFrame, air_share: Array) -> Indices:
    """How the rock of a site moved in each of its runs.

    Returns
    -------
    ndarray of int, see ``vsr_core.run.movement.movements``
    """
    angles = np.radians(rock.data["tipping_angle"].values)
    limit = no_return_tilt(angles, float(rock.data.attrs["barrier_toppled_tilt"]))
    return movements(
        runs["outcome"].to_numpy(), runs["peak_tilt"].to_numpy(float), air_share, limit
    )


def tally(outcome: pd.Series) -> tuple[str, int]:
    """Count runs by outcome.

    >>> tally(pd.Series([Outcome.BALANCED, Outcome.OVERTURNED, Outcome.BALANCED]))
    ('2 balanced, 1 overturned', 0)
    """
    counts = np.bincount(outcome, minlength=len(Outcome))
    words = ", ".join(f"{counts[o]} {o.name.lower()}" for o in Outcome if counts[o])
    return words, int(sum(counts[o] for o in Outcome if o.overturned == -1))
