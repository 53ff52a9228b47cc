"""What each reduction gains, one at a time, and how many outcomes it changes.

    python -m benchmarks.reductions [--cells N] [--write]

Every row takes the same random cells twice, once as the program runs them and once without that
one reduction, in turn, and compares CPU time and outcomes. A few minutes. ``--write`` writes the
page, docs/reductions.md, and the gains that a site's report states.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from pipeline import ROOT
from pipeline.stages.reports.report import GAINS
from vsr_core import GRAVITY, engines
from vsr_core.engines import bullet
from vsr_core.engines.interface import Solver, World
from vsr_core.judge import proofs
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import overturning, sampling
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.run.reductions import Reduction
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene, State
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.table.servo import Servo

Array = NDArray[np.float64]

STEP_SHARE = {"box": 0.003, "hull": 0.006}
"""Time steps, in units of sqrt(radius / g), at which the boundary is right to about 1 %."""

PAGE = ROOT / "docs" / "reductions.md"

FRICTION, YAWS = 0.6, 12

REST, NEXT_TO_NOTHING = 0.5, 1e-12  # s, m/s^2

NEARBY = (-0.04, -0.02, -0.01, -0.005, -0.002, 0.002, 0.005, 0.01, 0.02, 0.04)
"""Changes of PGA, as shares, tried on a cell that ends otherwise: is it beside the boundary?"""

PROOF = "`vsr_core/judge/proofs.py`"


@dataclass(frozen=True)
class Run:
    """One run to be timed: what ``simulate`` takes, and what is changed around it."""

    case: Case
    motion: GroundMotion
    settings: Settings
    around: Callable[[], AbstractContextManager[None]] = nullcontext


Pair = Callable[[Run], tuple[Run, Run] | None]
"""From a run as the program does it: with and without a reduction; None where it has no part."""


@dataclass(frozen=True)
class Row:
    """A reduction: what is left out, why that is harmless, and the two runs to compare.

    ``reduction`` is what a scene says that it leaves out, if it does.
    """

    what: str
    why: str
    pair: Pair
    reduction: Reduction | None = None


@dataclass(frozen=True)
class Gain:
    """CPU of a run without and with a reduction [s], runs, and those that end otherwise."""

    without: float
    reduced: float
    runs: int
    differing: list[str]

    def __str__(self) -> str:
        return f"{self.without / self.reduced:.2f}"


# ------------------------------------------------------------------- one reduction undone


def slab(run: Run) -> tuple[Run, Run] | None:
    """The pedestal as drawn in place of a plane."""
    if run.case.scene.pedestal != "plane":
        return None
    return run, replace(run, case=_scenes(run.case, pedestal="box"))


def driven(run: Run) -> tuple[Run, Run]:
    """A joint and a controller that move the pedestal; neither run uses a proof or a plane.

    The pedestal is so heavy that the rock cannot push it back, and the controller takes all of an
    error away in one period: it is the prescribed motion, a period's resolution apart.
    """
    case = _scenes(replace(run.case, static_limits=(0.0, 0.0)), pedestal="box")
    mass, period = 1e4 * case.full.rock.mass, 1e-3
    servo = Servo(mass, mass / period, 0.0, 0.0, period)
    settings = replace(run.settings, time_step=period, reduce=False)
    prescribed = replace(run, case=case, settings=settings)
    return prescribed, replace(prescribed, case=_scenes(case, drive=servo))


def all_vertices(run: Run) -> tuple[Run, Run] | None:
    """Every vertex of the hull."""
    if run.case.scene.rock is run.case.full.rock:
        return None
    return run, replace(run, case=_complete(run.case))


def no_proof_before(run: Run) -> tuple[Run, Run]:
    """Runs that provably cannot move are simulated."""
    return (run, _from_the_start(run)) if _cannot_move(run) else (run, run)


def whole_motion(run: Run) -> tuple[Run, Run]:
    """All other runs start with their motion, and not at its first push."""
    return (run, run) if _cannot_move(run) else (run, _from_the_start(run))


def to_rest(run: Run) -> tuple[Run, Run]:
    """Every run goes on until the rock lies or stands at rest; both with all vertices."""
    case = _complete(replace(run.case, static_limits=(0.0, 0.0)))
    known = replace(run, case=case)
    return known, replace(known, settings=replace(run.settings, reduce=False))


def settling(run: Run) -> tuple[Run, Run]:
    """Rest before the pulse, on the same grid of samples; neither run uses the proof of rest."""
    case = replace(run.case, static_limits=(0.0, 0.0))
    grid = sampling.sampling(run.motion, None, run.settings.time_step)
    step = grid.interval / grid.substeps * (1.0 + 1e-9)
    rest = math.ceil(REST / grid.interval) * grid.interval
    at_once = replace(run, case=case, settings=replace(run.settings, time_step=step))
    return at_once, replace(at_once, motion=Delayed(run.motion, rest))


def rebuilt(run: Run) -> tuple[Run, Run]:
    """A new world for each run."""
    return run, replace(run, around=forgetting_worlds)


def single_steps(run: Run) -> tuple[Run, Run]:
    """A sample of the motion, and so a call to the engine, for each step."""
    return run, replace(run, around=singly)


def all_iterations(run: Run) -> tuple[Run, Run]:
    """All fifty iterations of the solver in every step."""
    solver = Solver(bullet.SOLVER.iterations, 0.0)
    return run, replace(run, settings=replace(run.settings, solver=solver))


def trajectory(run: Run) -> tuple[Run, Run]:
    """Position, orientation and velocity read and kept at every sample of the motion."""
    return run, replace(run, around=recorded)


def everything(run: Run) -> tuple[Run, Run]:
    """The table's own frame and nothing else: all other rows undone."""
    at_once, late = settling(replace(run, settings=all_iterations(run)[1].settings))
    case = _complete(_scenes(replace(run.case, static_limits=(0.0, 0.0)), pedestal="box"))
    plain = replace(late, case=case, settings=replace(late.settings, reduce=False), around=plainly)
    as_run = replace(at_once, case=run.case, settings=replace(at_once.settings, solver=None))
    return as_run, plain


ROWS = (
    Row(
        "joint and controller of the table",
        "prescribed motion: the table's own frame is exact, with gravity minus its acceleration",
        driven,
        Reduction.MOVING_PEDESTAL,
    ),
    Row(
        "pedestal slab, replaced by a plane",
        "the top is flat, and its edges are out of reach",
        slab,
        Reduction.PEDESTAL_SLAB,
    ),
    Row(
        "hull vertices that touch only beyond 80 deg",
        "shown by the normals of their facets; a run that tilts further is repeated with all",
        all_vertices,
        Reduction.HULL_VERTICES,
    ),
    Row(
        "runs that cannot move",
        f"`static_limits` in {PROOF}: contact forces exist that hold the rock",
        no_proof_before,
        Reduction.STATIC_RUNS,
    ),
    Row(
        "the motion before its first push",
        "nothing moves until it exceeds `static_limits`",
        whole_motion,
        Reduction.LEAD_IN,
    ),
    Row(
        "time after the outcome is certain",
        f"`cannot_topple`, `cannot_return` and `cannot_be_stopped` in {PROOF}",
        to_rest,
        Reduction.CERTAIN_END,
    ),
    Row(
        f"{REST:g} s of rest before the pulse",
        "the rest pose is known from the hull's geometry",
        settling,
        Reduction.SETTLING,
    ),
    Row(
        "building a world for each run",
        "a world is reset to the same bits, and its contact cache is emptied",
        rebuilt,
    ),
    Row(
        "a call to the engine for each step",
        "a sample is held for at most a tenth of PGV/PGA, which changes it by 0.04 %",
        single_steps,
    ),
    Row(
        "iterations of a solver that has converged",
        "the residual is 5e-4 of gravity's impulse in a step; the time step's error is far larger",
        all_iterations,
    ),
    Row("the trajectory", "only outcomes are needed", trajectory, Reduction.TRAJECTORY),
    Row("all of these at once, except the joint", "as above", everything),
)


def _scenes(case: Case, **changes: Any) -> Case:
    """The case with both its scenes changed."""
    full, scene = replace(case.full, **changes), replace(case.scene, **changes)
    return replace(case, full=full, scene=scene)


def _complete(case: Case) -> Case:
    return replace(case, scene=case.full)


def _cannot_move(run: Run) -> bool:
    """Whether ``simulate`` itself leaves the run out."""
    return run.motion.peak_acceleration < min(-run.case.static_limits[0], run.case.static_limits[1])


def _from_the_start(run: Run) -> Run:
    return replace(run, case=replace(run.case, static_limits=(0.0, 0.0)))


@dataclass(frozen=True)
class Delayed(GroundMotion):
    """A motion after ``rest`` [s] of next to nothing: of nothing ``simulate`` would skip."""

    motion: GroundMotion
    rest: float

    @property
    def duration(self) -> float:
        return self.rest + self.motion.duration

    @property
    def shortest_time(self) -> float:
        return self.motion.shortest_time

    @property
    def peak_acceleration(self) -> float:
        return self.motion.peak_acceleration

    def acceleration(self, t: Array) -> Array:
        return np.where(t < self.rest, NEXT_TO_NOTHING, self.motion.acceleration(t - self.rest))

    def velocity(self, t: Array) -> Array:
        return self.motion.velocity(t - self.rest)


class Recording:
    """Bullet, with the state of the rock read and kept at every sample."""

    VERSION, SOLVER = bullet.VERSION, bullet.SOLVER

    def __init__(self, world: World) -> None:
        self._world = world
        self._kept: list[State] = []

    @classmethod
    def build(cls, *arguments: Any) -> Recording:
        return cls(bullet.build(*arguments))

    def advance(self, values: list[float]) -> None:
        for value in values:
            self._world.advance([value])
            self._kept.append(self._world.state())

    def state(self) -> State:
        return self._world.state()


@contextmanager
def patched(module: Any, name: str, value: Any) -> Iterator[None]:
    """A module's attribute changed for a while."""
    kept = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, kept)


def recorded() -> AbstractContextManager[None]:
    """Runs keep their trajectory."""
    return patched(engines, "load", lambda name: Recording)


def singly() -> AbstractContextManager[None]:
    """A sample of the motion is held for one step only."""
    return patched(
        overturning,
        "sampling",
        lambda motion, drive, time_step, most: sampling.sampling(motion, drive, time_step, 1),
    )


@contextmanager
def plainly() -> Iterator[None]:
    """A new world, a call for each step, and a trajectory."""
    with forgetting_worlds(), singly(), recorded():
        yield


@contextmanager
def forgetting_worlds() -> Iterator[None]:
    """No world is left from an earlier run."""
    while bullet._worlds:
        bullet._worlds.popitem()[1].close()
    yield


# ------------------------------------------------------------------- measuring


def rocks() -> dict[str, Rock]:
    """The rocks measured, by name."""
    import trimesh

    surrogate = trimesh.Trimesh(*double_rock(), process=False)
    return {
        "Double Rock (surrogate)": solid.from_mesh(surrogate, 2110.0).rock,
        "1x1x2 m box": solid.box((1.0, 1.0, 2.0), 2110.0).rock,
    }


def cells(rock: Rock, number: int) -> list[Run]:
    """Runs as the program does them: random PGA, PGV/PGA and yaw, one yaw after another."""
    rng = np.random.default_rng(1)
    limits = proofs.barrier(rock)
    settings = Settings(STEP_SHARE[rock.shape] * step_unit(rock))
    case = {
        yaw: prepare(
            Scene(rock, Contact(FRICTION), 2.0 * math.pi * yaw / YAWS), limits, reduce=True
        )
        for yaw in range(YAWS)
    }
    pga, ratio = rng.uniform(0.02, 1.0, (2, number))
    return [
        Run(case[yaw], CosinePulse(float(a) * GRAVITY, float(r)), settings)
        for yaw, a, r in zip(np.sort(rng.integers(0, YAWS, number)), pga, ratio, strict=True)
    ]


def measure(row: Row, runs: list[Run]) -> Gain | None:
    """CPU with and without, in turn. Cases that a pair makes are made once a yaw."""
    made: dict[int, tuple[Case, Case]] = {}
    spent = [0.0, 0.0]
    differing = []
    for number, run in enumerate(runs):
        pair = row.pair(run)
        if pair is None:
            return None
        cases = made.setdefault(id(run.case), (pair[0].case, pair[1].case))
        outcomes = [Outcome.CRASHED] * 2
        for which in (0, 1) if number % 2 else (1, 0):
            outcomes[which], seconds = _timed(replace(pair[which], case=cases[which]))
            spent[which] += seconds
        if outcomes[0] is not outcomes[1]:
            differing.append(_in_words(replace(pair[0], case=cases[0]), *outcomes))
    return Gain(spent[1] / len(runs), spent[0] / len(runs), len(runs), differing)


def _timed(run: Run) -> tuple[Outcome, float]:
    start = time.process_time()
    with run.around():
        response = simulate(run.case, run.motion, run.settings)
    return response.outcome, time.process_time() - start


def _in_words(run: Run, with_it: Outcome, without: Outcome) -> str:
    """The cell, both outcomes, and how little more or less PGA gives the one without."""
    assert isinstance(run.motion, CosinePulse)
    pulse, yaw = run.motion, math.degrees(run.case.full.yaw)
    near = "no change of PGA up to 4 % has the same effect"
    for share in sorted(NEARBY, key=abs):
        nearby = replace(run, motion=replace(pulse, pga=pulse.pga * (1.0 + share)))
        if _timed(nearby)[0] is without:
            near = f"a change of PGA of {share:+.1%} has the same effect"
            break
    cell = f"{pulse.pga / GRAVITY:.4f} g, {pulse.pgv_pga:.4f} s, {yaw:.0f} deg"
    return f"{cell}: {with_it.name.lower()} ({without.name.lower()} without the reduction); {near}"


Measured = list[tuple[Row, list[Gain | None]]]


def table(names: list[str], measured: Measured) -> str:
    """Aligned text."""
    lines = [f"{'left out: gain, ms a run without -> with':<46}"]
    lines[0] += "".join(f"{name:>28}" for name in names) + "   outcomes that differ"
    for row, gains in measured:
        cost = [
            f"{gain}  {1e3 * gain.without:7.2f} -> {1e3 * gain.reduced:6.2f}" if gain else "-"
            for gain in gains
        ]
        lines.append(f"{row.what:<46}" + "".join(f"{c:>28}" for c in cost) + f"   {_count(gains)}")
    return "\n".join([*lines, "", "cells that end otherwise", _cells(names, measured)])


def page(names: list[str], measured: Measured, number: int) -> str:
    """The table as Markdown, with what it shows and the command that makes it."""
    head = ["what is left out", "why that is harmless", *(f"gain, {name}" for name in names)]
    rows = [[*head, "outcomes that differ"], ["---"] * (len(head) + 1)]
    for row, gains in measured:
        cost = [str(gain) if gain else "-" for gain in gains]
        rows.append([row.what, row.why, *cost, _count(gains)])
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return TEXT.format(number=number, table="\n".join(lines), cells=_cells(names, measured))


def stated(measured: Measured) -> str:
    """Gains on the first rock, by the names of what scenes leave out, as YAML."""
    found = {
        row.reduction.name.lower(): float(str(own[0]))
        for row, own in measured
        if row.reduction and own[0]
    }
    head = "# Made by `python -m benchmarks.reductions --write`; do not edit.\n"
    return head + yaml.safe_dump(found, sort_keys=False)


def _count(own: list[Gain | None]) -> str:
    done = [gain for gain in own if gain]
    return f"{sum(len(gain.differing) for gain in done)} of {sum(gain.runs for gain in done)}"


def _cells(names: list[str], measured: Measured) -> str:
    """The cells that end otherwise, one a line."""
    lines = [
        f"- {row.what}; {name}: {cell}"
        for row, gains in measured
        for name, gain in zip(names, gains, strict=True)
        if gain
        for cell in gain.differing
    ]
    return "\n".join(lines) or "- none"


TEXT = """# What a run leaves out, and what that gains

Made by `python -m benchmarks.reductions --write`; do not edit.

A gain is the CPU time of a run without the one reduction divided by that with it, all else being
equal. Each rock has {number} random cells on a flat pedestal, the same in every row (PGA 0.02-1 g,
PGV/PGA 0.02-1 s, twelve yaws, friction 0.6). Runs with and without the reduction alternate, so
that other load on the machine slows both. Gains do not multiply, because several reductions can
leave out the same work. A dash means that a reduction is not used for that rock.

{table}

These cells end otherwise without the reduction. Each line also gives the smallest change of PGA
that has the same effect with the reduction: an outcome that so small a change reverses lies on the
boundary, or depends on many impacts.

{cells}

Some reductions would hide the effect of another; both runs of a row do without them:

- the joint: no proofs, and the slab in place of the plane, since a driven table allows neither.
  The table is ten thousand times as heavy as the rock, and its controller removes an error
  completely in one period of 1 ms;
- time after the outcome is certain: all vertices, since runs that go on to the end would otherwise
  be repeated with all of them, and no proof of rest;
- rest before the pulse: no proof of rest.
"""


def main() -> int:
    """Print the table, and write the page if asked."""
    parser = argparse.ArgumentParser(prog="benchmarks.reductions")
    parser.add_argument("--cells", type=int, default=150, help="runs of each rock in each row")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name} and {GAINS.name}")
    options = parser.parse_args()
    named = rocks()
    measured: Measured = [(row, []) for row in ROWS]
    # A row has up to four scenes a yaw; with fewer worlds kept, both sides would build anew.
    with patched(bullet, "WORLDS_KEPT", 4):
        for name, rock in named.items():
            runs = cells(rock, options.cells)
            for row, gains in measured:
                gains.append(measure(row, runs))
                print(f"{name}: {row.what}: {gains[-1] or '-'}", file=sys.stderr, flush=True)
    print(table([*named], measured))
    if options.write:
        PAGE.write_text(page([*named], measured, options.cells), encoding="utf-8")
        GAINS.write_text(stated(measured), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
