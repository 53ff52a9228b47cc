"""Stored runs of a study as one table, and how many came to which outcome."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pandas as pd

from pipeline.config.problems import InputError, Problem
from pipeline.stages.runs.running import groups
from pipeline.workflow.stage import Job
from pipeline.workflow.store import RUNS, DisplacementRow, RunRow, RunStore
from vsr_core.outcome import Outcome


def stored(job: Job, row: type[RunRow | DisplacementRow], stage: str) -> pd.DataFrame:
    """All runs of a study.

    Parameters
    ----------
    job : Job
    row : type of the stored rows
    stage : str
        The stage that did the runs; it is made again where some are not there.

    Returns
    -------
    DataFrame
        Fields of the rows, with ``yaw`` [degree], ``friction``, number of the ``motion`` and
        ``pga`` [g] of each run, PGA running fastest and yaw slowest.

    Raises
    ------
    InputError
        If runs are not there.
    """
    parts = []
    with closing(RunStore(job.store.folder, row)) as runs:
        for group in groups(job.config, job.store):
            rows = runs.get(group.keys)
            lost = sum(key not in rows for key in group.keys)
            if lost:
                job.store.forget(stage)
                given = f"{lost} {stage.replace('_', ' ')} fewer than were done"
                rule, remedy = "every run that was done is kept", "start again to redo them"
                raise InputError(Problem(str(job.store.folder / RUNS), "", given, rule, remedy))
            cells = pd.DataFrame(group.cells, columns=["motion", "pga"])
            found = pd.DataFrame([rows[key] for key in group.keys], columns=row._fields)
            parts.append(cells.join(found).assign(yaw=group.yaw, friction=group.friction))
    return pd.concat(parts, ignore_index=True)


def tally(outcome: pd.Series) -> tuple[str, int]:
    """Count runs by outcome.

    Parameters
    ----------
    outcome : Series of int

    Returns
    -------
    words : str
    unresolved : int
        Runs without a verdict.

    >>> tally(pd.Series([Outcome.BALANCED, Outcome.OVERTURNED, Outcome.BALANCED]))
    ('2 balanced, 1 overturned', 0)
    """
    counts = np.bincount(outcome, minlength=len(Outcome))
    words = ", ".join(f"{counts[o]} {o.name.lower()}" for o in Outcome if counts[o])
    return words, int(sum(counts[o] for o in Outcome if o.overturned == -1))
