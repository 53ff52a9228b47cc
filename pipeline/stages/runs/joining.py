"""Runs of one study that several clients did in folders of their own, brought together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions.motion_grid import ComponentRecords
from pipeline.stages.runs.runner import parts
from pipeline.stages.runs.study import LevelStudy, Study
from pipeline.workflow import graph
from pipeline.workflow.grammar import counted
from pipeline.workflow.log import complain
from pipeline.workflow.registry import needs
from pipeline.workflow.rows import DisplacementRow, LineRow, RunRow, TerrainRow
from pipeline.workflow.run_store import RUNS, RunStore, check, is_there
from pipeline.workflow.stage import Job
from vsr_core.outcome import Outcome

KINDS: tuple[Any, ...] = (RunRow, TerrainRow, LineRow, DisplacementRow)


def make(job: Job, folders: Sequence[Path]) -> list[str]:
    """Take the stored runs of a study from other folders.

    Runs of its scenes are taken, at whatever PGA: those of its grid, and those between its cells.
    All folders are looked through before the first run is taken.

    Returns
    -------
    list of str, a line for each folder

    Raises
    ------
    InputError
        If a folder is no other one with runs that can be read, has none of the study, or has
        another result of a run than this one or one before it.
    """
    _require_others(job.store.runs, folders)
    _tell_damaged(folders)
    for stage in needs("runs"):
        graph.make(stage, job)
    study = graph.built(Study, job)
    scenes = sorted(_scenes(study))
    job.store.open()
    with ExitStack() as opened:
        own = [opened.enter_context(closing(RunStore(job.store.runs, kind)))
               for kind in KINDS]  # fmt: skip
        theirs = [[opened.enter_context(closing(RunStore(folder, kind, reads=True)))
                   for kind in KINDS] for folder in folders]  # fmt: skip
        places = (job.store.runs, *folders)
        counts, crashed = [0] * len(folders), [0] * len(folders)
        for n, stores in enumerate(theirs):
            for kind, store in enumerate(stores):
                before = [own[kind], *(others[kind] for others in theirs[:n])]
                for rows in parts(_of(store, scenes)):
                    runs = len(study.motions.pga) if KINDS[kind] is LineRow else 1
                    lost = sum(row.outcome == Outcome.CRASHED for row in rows)
                    counts[n] += runs * (len(rows) - lost)
                    crashed[n] += runs * lost
                    for place, other in zip(places, before, strict=False):
                        _require_same(rows, other, folders[n], place)
            _require_some(counts[n] + crashed[n], folders[n], job)
        for stores in theirs:
            for mine, store in zip(own, stores, strict=True):
                for rows in parts(_of(store, scenes)):
                    mine.add(row for row in rows if row.outcome != Outcome.CRASHED)
    return [
        f"{folder}: {counted(count, 'run')}" + (f"; {lost} crashed, not taken" if lost else "")
        for folder, count, lost in zip(folders, counts, crashed, strict=True)
    ]


def _scenes(study: Study) -> set[bytes]:
    """What the keys of a study's runs begin with."""
    studies = [study]
    if isinstance(study.motions, ComponentRecords):
        studies.append(LevelStudy.of(study))
    return {one.scene(group)[:4] for one in studies for group in one.groups}


def _require_others(own: Path, folders: Sequence[Path]) -> None:
    """Check that there are folders with runs, each another one."""
    seen = {own.resolve()}
    for folder in folders:
        if not is_there(folder):
            rule, remedy = f"there is a {RUNS} in it", "name a site's folder of results"
            raise InputError(Problem(str(folder), "", "a folder without runs", rule, remedy))
        if folder.resolve() in seen:
            rule, remedy = "runs are taken from other folders, once from each", "leave it out"
            raise InputError(Problem(str(folder), "", "the same folder again", rule, remedy))
        seen.add(folder.resolve())


def _tell_damaged(folders: Sequence[Path]) -> None:
    """Tell how many rows are damaged; refused where a whole database is."""
    for folder in folders:
        if damaged := check(folder):
            lost = f"{counted(damaged, 'row')} of runs damaged on disk and left out"
            complain(f"vsr: warning: {folder / RUNS}: {lost}")


def _of(store: RunStore[Any], scenes: Sequence[bytes]) -> Iterator[Any]:
    for scene in scenes:
        yield from store.starting(scene)


def _require_same(rows: Sequence[Any], other: RunStore[Any], folder: Path, place: Path) -> None:
    """Check that no run has another result elsewhere; what crashed has none."""
    there = other.get(row.key for row in rows)
    pairs = [(row, there[row.key]) for row in rows if row.key in there]
    crashed = Outcome.CRASHED
    differ = sum(a != b and crashed not in (a.outcome, b.outcome) for a, b in pairs)
    if differ:
        given = f"{counted(differ, 'run')} with other results than in {place}"
        rule = "a run of a study has one result"
        remedy = "leave one of the folders out, or do its runs again"
        raise InputError(Problem(str(folder), "", given, rule, remedy))


def _require_some(count: int, folder: Path, job: Job) -> None:
    """Check that a folder has runs of the study."""
    if not count:
        rule = f"they are of this study of {job.site.name}, and of this version"
        remedy = "give the --site, --study and --set that they were made with"
        raise InputError(Problem(str(folder), "", "no run that is wanted here", rule, remedy))
