"""Runs of draws, and searches for their boundaries by them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pipeline.stages.datasets.stored_runs import SIDES
from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs import overturning_runs
from pipeline.stages.runs.runner import Kind, Run, run_missing
from pipeline.stages.runs.study import run_keys, scene_digest, shared_identity
from pipeline.stages.uncertainty.draws import Draw
from pipeline.workflow.rows import RunRow, TerrainRow
from pipeline.workflow.run_store import RunStore
from pipeline.workflow.stage import Work
from vsr_core.arrays import Array, Indices
from vsr_core.fragility.bisection import OUTWARD, Known
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.uncertainty import search

Table: TypeAlias = NDArray[np.int8]
"""Outcomes or flags of cells."""


class Place(NamedTuple):
    """A run of a draw: number of the direction, and the cell with the gain in its PGA."""

    yaw: int
    cell: Cell


def simulate_draw(
    shared: tuple[tuple[Case | TerrainCase, ...], Settings, Shaking], places: tuple[Place, ...]
) -> list[tuple[Any, ...]]:
    """Simulate some runs of one draw, on a worker."""
    cases, settings, motions = shared
    found: dict[Place, tuple[Any, ...]] = {}
    for yaw in sorted({place.yaw for place in places}):
        here = [place for place in places if place.yaw == yaw]
        cells = tuple(place.cell for place in here)
        case = cases[yaw]
        if isinstance(case, TerrainCase):
            responses = overturning_runs.respond_batch((case, settings, motions), cells)
        else:
            responses = overturning_runs.simulate_batch((case, settings, motions), cells)
        found.update(zip(here, responses, strict=True))
    return [found[place] for place in places]


KIND = Kind("uncertainty", "runs of draws", RunRow, simulate_draw, batch=40)
ON_TERRAIN = Kind("uncertainty", "runs of draws", TerrainRow, simulate_draw, batch=20)


@dataclass(frozen=True, eq=False)
class Search:
    """What is asked for: the first overturning of all draws.

    Attributes
    ----------
    given : ndarray, shape (5, yaws), static scales of the site's own rock
    nominal : ndarray of int, shape (yaws, rows, pga), outcomes of the site as it is
    boundary : ndarray, shape (yaws, rows) [g], its first-overturning PGA
    width : float, relative, of a bracket
    bounds : tuple of float [g], between which a boundary is looked for
    """

    work: Work
    draws: Sequence[Draw]
    given: Array
    motions: Shaking
    settings: Settings
    nominal: Table
    boundary: Array
    width: float
    bounds: tuple[float, float]

    @property
    def kind(self) -> Kind[Any]:
        """Runs on a flat pedestal or on a terrain."""
        return ON_TERRAIN if self.draws[0].seat else KIND

    def ln(self, boundary: Array) -> Array:
        """Boundaries as they guide a search, finite [ln g]."""
        lowest, highest = self.bounds
        known = np.where(np.isnan(boundary), highest, boundary)
        return np.asarray(np.log(np.clip(known, lowest / OUTWARD, highest * OUTWARD)))


class Runner:
    """Runs of some draws, done or read from the store."""

    def __init__(self, wanted: Search, store: RunStore[Any], draws: Sequence[Draw]) -> None:
        self._wanted, self._store, self.draws = wanted, store, draws
        self._scenes: dict[int, list[bytes]] = {}
        self.crashed = 0

    def run(self, draw: Indices, yaw: Indices, row: Indices, pga: Array) -> NDArray[np.int8]:
        """Outcomes at some PGAs of the site [g], of draws and directions by their numbers."""
        token, every = self._wanted.motions.token, []
        for number, *place, peak in zip(
            *(part.tolist() for part in (draw, yaw, row, pga)), strict=True
        ):
            one = self.draws[number]
            cell = Cell(place[1], one.member.amplitude * peak)
            key = next(run_keys(self._digests(one)[place[0]], [token(cell)]))
            every.append((one, Run(key, Place(place[0], cell))))
        wanted: dict[Draw, list[Run]] = {}
        for one, run in every:
            wanted.setdefault(one, []).append(run)
        work, kind = self._wanted.work, self._wanted.kind
        done = run_missing(work, kind, list(wanted), wanted.__getitem__, self._shared, self._store)
        self.crashed += done.crashed
        known = self._store.outcomes(run.key for _, run in every)
        return SIDES[[known[run.key] for _, run in every]]

    def bracketed(
        self, draw: Indices, yaw: Indices, row: Indices, expected: Array, scale: Array
    ) -> Known:
        """All runs of a search for the first overturning of some levels.

        Parameters
        ----------
        expected, scale : ndarray, shape (levels,) [ln g], where it is expected, and how far off
        """
        width = float(np.log1p(self._wanted.width))
        brackets = search.Brackets(expected, scale, width, self._wanted.bounds)
        while len((asked := brackets.next_runs())[0]):
            level, pga = asked
            side = self.run(draw[level], yaw[level], row[level], pga)
            brackets.add(level, pga, side)
        return brackets.known

    def _digests(self, draw: Draw) -> list[bytes]:
        if draw.number not in self._scenes:
            shared = shared_identity(draw.identified, self._wanted.motions)
            step = self._wanted.settings.time_step
            self._scenes[draw.number] = [
                scene_digest(shared, draw.group(yaw), step) for yaw in draw.yaw
            ]
        return self._scenes[draw.number]

    def _shared(self, draw: Draw) -> tuple[tuple[Case | TerrainCase, ...], Settings, Shaking]:
        return draw.cases, self._wanted.settings, self._wanted.motions
