"""Stored runs of a study as one table, and how many came to which outcome."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.stages.mesh.products import RockData
from pipeline.stages.runs import lines, runner
from pipeline.stages.runs.overturning_runs import grid_runs
from pipeline.stages.runs.runner import Kind
from pipeline.stages.runs.study import Study
from pipeline.workflow.rows import LineRow
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.outcome import Movement, Outcome, ran_whole
from vsr_core.run.movement import movements

SIDES = np.array([outcome.overturned for outcome in Outcome], "i1")
"""Whether a run overturned, by its outcome: 1, 0, or -1 unresolved."""


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


def parts(database: Path, study: Study) -> Iterator[tuple[tuple[int, int, slice], pd.DataFrame]]:
    """The runs of a grid by parts of its whole rows, as many runs as ``runner.at_once`` says.

    Yields
    ------
    (place, runs), numbers of yaw and friction, and which rows; with the fields of the rows, or
    ``lines.columns``
    """
    kind, wanted = grid_runs(study)
    columns, frictions = len(study.motions.pga), len(study.settings.contact.friction)
    numbers, start = {group: number for number, group in enumerate(study.groups)}, 0
    for group, rows in runner.stored(database, kind, study.groups, wanted, columns):
        if kind.row is LineRow:
            table = pd.DataFrame(lines.columns(rows, columns))
        else:
            table = pd.DataFrame(rows, columns=kind.row._fields).drop(columns="key")
        end = start + len(table) // columns
        yield (*divmod(numbers[group], frictions), slice(start, end)), table
        start = end % len(study.motions.rows)


def moved(rock: RockData, runs: pd.DataFrame, air_share: Array) -> Indices:
    """How the rock of a site moved in each of its runs.

    Returns
    -------
    ndarray of int, see ``vsr_core.run.movement.movements``
    """
    return movements(
        runs["outcome"].to_numpy(), runs["peak_tilt"].to_numpy(float), air_share, rock.no_return
    )


def with_peaks(runs: pd.DataFrame, *, on_terrain: bool) -> pd.DataFrame:
    """Runs with largest tilt and slip where they are the run's, and beside them those known of all.

    A run that was ended once its outcome was decided might have tilted or slid further.
    """
    whole = ran_whole(
        runs["outcome"].to_numpy(), runs["decided_by"].to_numpy(), on_terrain=on_terrain
    )
    tilt, slip = (runs[name].astype(float) for name in ("peak_tilt", "slip"))
    known = {"peak_tilt": tilt.where(whole), "slip": slip.where(whole)}
    return runs.assign(tilt_until_decided=tilt, slip_until_decided=slip, **known)


def tally(counts: Indices) -> tuple[str, int]:
    """How many runs came to which outcome, and how many to no verdict.

    >>> tally(np.array([2, 1, 0, 0, 0, 0]))
    ('2 balanced, 1 overturned', 0)
    """
    words = ", ".join(f"{counts[o]} {o.name.lower()}" for o in Outcome if counts[o])
    return words, int(sum(counts[o] for o in Outcome if o.overturned == -1))


OFF_ITS_SEAT = (Movement.ROLLED_OVER, Movement.FELL, Movement.SLID)


def kinds(outcome: Indices, movement: Indices) -> dict[str, Mask]:
    """Name the kinds of ends that occur, and find the runs of each.

    Overturned runs are parted where not all of them rolled over.

    Examples
    --------
    >>> import numpy as np
    >>> found = kinds(np.array([0, 1, 1, 2]), np.array([0, 1, 3, 3]))
    >>> {name: int(runs.sum()) for name, runs in found.items()}
    {'balanced': 1, 'overturned: rolled over': 1, 'overturned: slid': 1, 'displaced': 1}
    """
    found: dict[str, Mask] = {}
    for one in Outcome:
        runs = outcome == one
        name = one.name.lower()
        if one is Outcome.OVERTURNED and (movement[runs] != Movement.ROLLED_OVER).any():
            found |= {f"{name}: {way.words}": runs & (movement == way) for way in OFF_ITS_SEAT}
        else:
            found[name] = runs
    return {name: runs for name, runs in found.items() if runs.any()}


def ways(outcome: Indices, movement: Indices, number: Indices | int = 1) -> dict[Movement, int]:
    """Count the overturned runs by how the rock left its seat.

    Parameters
    ----------
    number : ndarray of int, runs of each of these ends
    """
    left = number * (outcome == Outcome.OVERTURNED)
    return {way: int((left * (movement == way)).sum()) for way in OFF_ITS_SEAT}


def in_words(counts: dict[Movement, int]) -> str:
    """Counts of ``ways`` in words.

    Examples
    --------
    >>> in_words({Movement.ROLLED_OVER: 30, Movement.FELL: 2, Movement.SLID: 1200})
    '30 rolled over, 2 fell, 1,200 slid'
    """
    return ", ".join(f"{count:,} {way.words}" for way, count in counts.items())
