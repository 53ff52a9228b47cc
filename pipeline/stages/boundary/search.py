"""Runs between the cells of a study's grid, round by round, until every change is resolved."""

from __future__ import annotations

import zlib
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.stages.datasets.stored_runs import SIDES
from pipeline.stages.motions.motion_grid import Cell
from pipeline.stages.runs.overturning_runs import kind
from pipeline.stages.runs.runner import Run, run_missing
from pipeline.stages.runs.scenes import Group
from pipeline.stages.runs.study import Study
from pipeline.workflow.run_store import RunStore
from pipeline.workflow.stage import Work
from vsr_core.arrays import Array, Indices
from vsr_core.fragility import bisection
from vsr_core.fragility.bisection import Known

PROBED = 0.25
"""Share of the levels in which a run between two cells of one outcome is tried."""


@dataclass
class Search:
    """The levels of a study, groups one after the other, and the runs done between the cells.

    Attributes
    ----------
    rows : list, of the runs between the cells as they are stored, in the order of ``places``
    places : list of (level, PGA [g], whether it is a probe)
    """

    work: Work
    study: Study
    rows: list[Any] = field(default_factory=list)
    places: list[tuple[int, float, bool]] = field(default_factory=list)
    rounds: int = 0
    crashed: int = 0

    @property
    def each(self) -> int:
        """Levels of a group."""
        return len(self.study.motions.rows)

    def resolved(self, overturned: Any, width: Array, bounds: tuple[float, float]) -> Known:
        """Run until all changes are as narrow as asked for.

        Parameters
        ----------
        overturned : ndarray of int, shape (levels, pga)
        width : ndarray, shape (levels,), of the logarithm of upper over lower end
        """
        pga = np.array(self.study.motions.pga)
        kept = kind(on_terrain=self.study.settings.on_terrain)
        with closing(RunStore(self.work.runs, kept.row)) as store:
            known, level, peaks = self._of_grid(pga, overturned)
            known = known.joined(level, peaks, self._run(store, level, peaks, probes=True))
            while True:
                level, peaks = bisection.next_runs(known, width, bounds)
                if not len(level):
                    return known
                known = known.joined(level, peaks, self._run(store, level, peaks, probes=False))

    def _of_grid(self, pga: Array, overturned: Any) -> tuple[Known, Indices, Array]:
        """Cells that tell of a change or lie beside a probe; levels and PGAs of the probes.

        What a level's probe is drawn from are numbers of its group, whatever the others are.
        """
        parts = []
        for number, group in enumerate(self.study.groups):
            start = number * self.each
            own = overturned[start : start + self.each]
            seed = zlib.crc32(repr(tuple(group)).encode())
            drawn = np.random.default_rng(seed).random((self.each, 3))
            level, peaks, gap = bisection.probes(pga, own, drawn, PROBED)
            beside = np.zeros((self.each, max(len(pga) - 1, 0)), dtype=bool)
            beside[level, gap] = True
            cells = bisection.of_grid(pga, own, beside)
            parts.append((cells.level + start, cells.pga, cells.side, level + start, peaks))
        levels, peaks, sides, probed, tried = map(np.concatenate, zip(*parts, strict=True))
        return Known(levels, peaks, sides), probed, tried

    def _run(self, store: RunStore[Any], level: Indices, pga: Array, *, probes: bool) -> Any:
        """Outcomes of some runs, done where they are not stored, shape (runs,) of int8."""
        if not len(level):
            return np.zeros(0, "i1")
        study, kept = self.study, kind(on_terrain=self.study.settings.on_terrain)
        runs: dict[Group, list[Run]] = {}
        for number, group in enumerate(study.groups):
            own = level // self.each == number
            cells = zip((level[own] % self.each).tolist(), pga[own].tolist(), strict=True)
            runs[group] = study.runs_of(group, [Cell(*cell) for cell in cells])
        groups = [group for group, own in runs.items() if own]
        done = run_missing(self.work, kept, groups, runs.__getitem__, study.shared, store)
        self.rounds, self.crashed = self.rounds + 1, self.crashed + done.crashed
        wanted = [run.key for own in runs.values() for run in own]
        found = store.get(wanted)
        rows = [found[key] for key in wanted]  # in the order of levels, as these ascend
        self.rows += rows
        self.places += [(int(n), float(peak), probes) for n, peak in zip(level, pga, strict=True)]
        return SIDES[[row.outcome for row in rows]]
