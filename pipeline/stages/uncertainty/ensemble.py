"""Outcomes of all draws on the grid of motions, most cells of which need no run.

Each draw's boundary is searched from where those of the draws before it lie, by the rule of
``vsr_core.uncertainty.search``; of the cells that the rule spares, some are run all the same, to
count how often it is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pipeline.config import in_si
from pipeline.stages.motions.motion_grid import Cell, Pulses, Shaking, TablePulses
from pipeline.stages.runs import overturning_runs
from pipeline.stages.runs.runner import Kind, Run, run_missing
from pipeline.stages.runs.study import run_keys, scene_digest, shared_identity
from pipeline.stages.uncertainty.draws import Draw
from pipeline.workflow.rows import RunRow, TerrainRow
from pipeline.workflow.run_store import RunStore
from pipeline.workflow.stage import Work
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.fragility.boundary import interval, middle
from vsr_core.outcome import FoundBy, Outcome
from vsr_core.run.cases import Case, Settings, TerrainCase, never_starts
from vsr_core.uncertainty import search
from vsr_core.uncertainty.search import UNKNOWN, Table

TOGETHER = 8
"""Draws that are searched at once, as many as the engine keeps rocks of; the first of them from the
boundary of the site as it is, the others from those of all draws before."""

CHECKED = 0.005
"""Share of the inferred cells that are run all the same."""


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
class Ensemble:
    """What was found of all draws.

    Attributes
    ----------
    overturned : ndarray of int, shape (draws, yaws, rows, pga), 1, 0, or -1 unresolved
    non_monotonic : ndarray of bool, shape (rows,), those in which the site as it is may be ragged
    checked, wrong : ndarray of int, shape (2,)
        Spared cells that were run all the same, and those that the rule had wrong: of other rows,
        and of non-monotonic ones.
    crashed : int, runs that killed their worker
    """

    overturned: Table
    found_by: Table
    non_monotonic: Mask
    checked: Indices
    wrong: Indices
    crashed: int


@dataclass(frozen=True, eq=False)
class Search:
    """What is asked for: all draws on the grid of motions.

    Attributes
    ----------
    given : ndarray, shape (4, yaws), static scales of the site's own rock
    nominal : ndarray of int, shape (yaws, rows, pga), outcomes of the site as it is
    """

    work: Work
    draws: Sequence[Draw]
    given: Array
    motions: Shaking
    settings: Settings
    nominal: Table

    @property
    def kind(self) -> Kind[Any]:
        """Runs on a flat pedestal or on a terrain."""
        return ON_TERRAIN if self.draws[0].seat else KIND

    @property
    def ln_pga(self) -> Array:
        """Levels of the grid [ln g]."""
        return np.log(self.motions.pga)

    def boundaries(self, tables: Table) -> Array:
        """Boundaries of completed tables, no further than a step beyond the grid.

        Parameters
        ----------
        tables : ndarray of int, shape (..., rows, pga)

        Returns
        -------
        ndarray, shape (..., rows) [ln g]
        """
        pga = np.array(self.motions.pga)
        found = np.log(middle(pga, *interval(pga, tables)))
        return np.fmin(found, 2.0 * self.ln_pga[-1] - self.ln_pga[-2:][0])


def outcomes(wanted: Search) -> Ensemble:
    """Find the outcomes of all draws, with runs near their boundaries only."""
    non_monotonic = _non_monotonic(wanted)
    shape = (len(wanted.draws), *wanted.nominal.shape)
    table = np.full(shape, UNKNOWN, dtype=np.int8)
    found_by = np.full(shape, FoundBy.INFERRED, dtype=np.int8)
    known = [wanted.boundaries(wanted.nominal)]
    scales = [wanted.given]
    log_gain = np.log([draw.member.amplitude for draw in wanted.draws])
    tested, crashed = np.zeros((2, 2), dtype=np.int64), 0
    with closing(RunStore(wanted.work.runs, wanted.kind.row, wanted.work.log)) as store:
        for start in range(0, len(wanted.draws), TOGETHER):
            part, runner = slice(start, start + TOGETHER), _Runner(wanted, store)
            draws, own = wanted.draws[part], table[part]
            scale = np.array([draw.scales() for draw in draws])
            chosen, offset = search.offsets(np.array(known), np.array(scales))
            own[_proved(wanted, draws)] = 0
            found_by[part][own == 0] = FoundBy.PROVED
            base = np.take_along_axis(scale, chosen[None, None], axis=1)[:, 0]
            expected = base[..., None] + offset - log_gain[part, None, None]
            _search(wanted, runner, draws, own, expected, non_monotonic)
            tested += _tested(runner, draws, own, non_monotonic)
            found_by[part][(own != UNKNOWN) & (found_by[part] == FoundBy.INFERRED)] = 0
            own[...] = search.completed(own)
            crashed += runner.crashed
            known += list(wanted.boundaries(own) + log_gain[part, None, None])
            scales += list(scale)
    return Ensemble(table, found_by, non_monotonic, tested[0], tested[1], crashed)


def _non_monotonic(wanted: Search) -> Mask:
    """Rows that may be ragged: where the site is in some direction, and the rows next to them."""
    own: Mask = np.asarray(search.ragged(wanted.nominal).any(axis=0))
    if wanted.motions.dimension != "pgv_pga":
        return own
    return np.asarray(np.convolve(own, np.ones(3))[1:-1] > 0)


def _proved(wanted: Search, draws: Sequence[Draw]) -> Mask:
    """Cells in which a draw provably stands, shape (draws, yaws, rows, pga)."""
    shape = (len(draws), *wanted.nominal.shape)
    along_x = isinstance(wanted.motions, Pulses) and not isinstance(wanted.motions, TablePulses)
    if (
        not along_x or draws[0].settings.drive == "servo"
    ):  # the peak of what the rock feels is not the PGA
        return np.zeros(shape, dtype=bool)
    still = np.zeros((len(draws), shape[1], shape[3]), dtype=bool)
    for at, draw in enumerate(draws):
        peaks = in_si.acceleration(draw.member.amplitude * np.array(wanted.motions.pga))
        for yaw, limits in enumerate(draw.static_limits()):
            still[at, yaw] = [never_starts(limits, peak, wanted.settings) for peak in peaks]
    return np.broadcast_to(still[:, :, None], shape)


def _search(
    wanted: Search,
    runner: _Runner,
    draws: Sequence[Draw],
    table: Table,
    expected: Array,
    non_monotonic: Mask,
) -> None:
    """Find the boundary of some rows of each draw, then of all, in place."""
    ordered = wanted.motions.dimension == "pgv_pga"
    first = search.first_rows(table.shape[2], ordered=ordered)
    for rows in (first, np.arange(table.shape[2])):
        column = search.expected_columns(expected[:, :, rows], wanted.ln_pga).ravel()
        may = np.broadcast_to(non_monotonic[rows], expected[:, :, rows].shape).ravel()
        while True:
            here = table[:, :, rows]
            ask = np.zeros(table.shape, dtype=bool)
            flat = here.reshape(-1, table.shape[3])
            ask[:, :, rows] = search.next_cells(flat, column, may).reshape(here.shape)
            if not ask.any():
                break
            runner.run(draws, table, ask)
        found = wanted.boundaries(table[:, :, rows])
        expected = search.from_own_rows(expected, found, rows)


def _tested(runner: _Runner, draws: Sequence[Draw], table: Table, non_monotonic: Mask) -> Indices:
    """Run some inferred cells; count them and the wrong ones, non-monotonic levels last, (2, 2)."""
    ask = np.zeros(table.shape, dtype=bool)
    for at, draw in enumerate(draws):
        chance = np.random.default_rng(draw.member.seed).random(table.shape[1:])
        ask[at] = (table[at] == UNKNOWN) & (chance < CHECKED)
    taken = search.completed(table)
    runner.run(draws, table, ask)
    wrong = ask & (table != taken)
    kinds = np.array([~non_monotonic, non_monotonic])
    return np.array([[(part[:, :, kind]).sum() for kind in kinds] for part in (ask, wrong)])


class _Runner:
    """Runs of draws by their cells, done or read from the store."""

    def __init__(self, wanted: Search, store: RunStore[Any]) -> None:
        self._wanted, self._store = wanted, store
        self._scenes: dict[int, list[bytes]] = {}
        self.crashed = 0

    def run(self, draws: Sequence[Draw], table: Table, ask: Mask) -> None:
        """Put the outcomes of the cells asked for into the table."""
        wanted = {draw: self._runs(draw, cells) for draw, cells in zip(draws, ask, strict=True)}
        groups = [draw for draw, runs in wanted.items() if runs]
        work, kind = self._wanted.work, self._wanted.kind
        done = run_missing(work, kind, groups, wanted.__getitem__, self._shared, self._store)
        self.crashed += done.crashed
        sides = [outcome.overturned for outcome in Outcome]
        for own, cells, runs in zip(table, ask, wanted.values(), strict=True):
            known = self._store.outcomes(run.key for run in runs)
            own[cells] = [sides[known[run.key]] for run in runs]

    def _runs(self, draw: Draw, cells: Mask) -> list[Run]:
        """Runs of the cells of a draw, in the order of a mask."""
        pga = [draw.member.amplitude * level for level in self._wanted.motions.pga]
        places = [
            Place(yaw, Cell(row, pga[column])) for yaw, row, column in np.argwhere(cells).tolist()
        ]
        scenes, token = self._digests(draw), self._wanted.motions.token
        return [
            Run(next(run_keys(scenes[place.yaw], [token(place.cell)])), place) for place in places
        ]

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
