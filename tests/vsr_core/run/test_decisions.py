"""One judge for all engines: their decisions on random cells, with and without reductions."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support import grounds
from support.suites import slow_but

from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome, Response
from vsr_core.run import displacement, input_checks, overturning
from vsr_core.run.cases import Case, Settings, TerrainCase, prepare
from vsr_core.run.overturning import simulate, simulate_all
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import box, frustum

ROCKS = {
    "cube on end": box(1.0, 1.0, 2.0),
    "slab on end": box(0.3, 0.4, 1.0),
    "squat": box(1.0, 1.0, 1.2),
    "tapered": frustum((0.5, 0.4), (0.9, 0.8), 1.6),
    "pillar": frustum((0.3, 0.25), (0.2, 0.15), 1.1),
}
SHARES = {"nonsmooth": 0.02, "bullet": 0.003, "mujoco": 0.003}
"""Time steps, in units of sqrt(radius / g)."""

APART = 0.1
"""Share of a PGA by which the boundary of a pulse has to be away from it for engines to agree, and
of the friction at which a rock slides rather than tips."""


@cache
def case(name: str, yaw: float, friction: float, *, reduce: bool) -> Case:
    rock = ROCKS[name]
    return prepare(Scene(rock, Contact(friction), yaw), barrier(rock), reduce=reduce)


def settings(engine: str, name: str, *, reduce: bool = True) -> Settings:
    return Settings(SHARES[engine] * step_unit(ROCKS[name]), reduce=reduce, engine=engine)


def cells(name: str, number: int, seed: int) -> list[tuple[Case, Case, CosinePulse]]:
    """A case as reduced and as described, and a pulse, from standing to lying rocks."""
    rng = np.random.default_rng([seed, list(ROCKS).index(name)])
    found = []
    for _ in range(number):
        yaw, friction = rng.choice([0.0, 0.5, 1.2, math.pi]), rng.choice([0.3, 0.6, 1.5])
        unit = step_unit(ROCKS[name])
        pulse = CosinePulse.from_g(rng.uniform(0.1, 1.3), unit * rng.uniform(0.3, 2.0))
        both = (case(name, float(yaw), float(friction), reduce=reduce) for reduce in (True, False))
        found.append((*both, pulse))
    return found


def same(one: Response, other: Response) -> bool:
    """The same decision, by the same rule, in the same step."""
    near = (one.peak_tilt, one.final_tilt, one.slip) == pytest.approx(
        (other.peak_tilt, other.final_tilt, other.slip), rel=1e-6, abs=1e-9
    )
    decided = (one.outcome, one.decided_by, one.steps)
    return near and decided == (other.outcome, other.decided_by, other.steps)


def stepped_differently(name: str, number: int, *, reduce: bool) -> list[str]:
    """Cells in which a run is decided otherwise if it is stepped from outside."""
    given = settings("nonsmooth", name, reduce=reduce)
    differing = []
    for reduced, described, pulse in cells(name, number, 1):
        chosen = reduced if reduce else described
        chosen = replace(chosen, scene=chosen.full)
        compiled, stepped = (
            simulate(chosen, pulse, given),
            overturning._stepped(chosen, pulse, given),
        )
        if compiled.steps and not same(compiled, stepped):
            differing.append(f"{name} {pulse} {compiled} {stepped}")
    return differing


def holds(engine: str, scene: Scene, pulse: CosinePulse) -> bool:
    """Whether an engine takes a scene, away from the friction between sliding and tipping."""
    try:
        input_checks.check_engine(scene, engine, pulse)
    except InvalidInput:
        return False
    return abs(scene.contact.friction / input_checks._slenderness(scene) - 1.0) > APART


def decided_differently(engine: str, name: str, number: int) -> tuple[list[str], int]:
    """Cells away from a boundary in which an engine decides otherwise; and how many were compared.

    Away is where ours, that is right to less than that, has one outcome around the PGA, and where
    the friction is not about that at which a rock tips. What an engine refuses is not compared.
    """
    differing, compared = [], 0
    held = [cell for cell in cells(name, 5 * number, 2) if holds(engine, cell[1].full, cell[2])]
    for reduced, described, pulse in held[:number]:
        around = [
            replace(pulse, pga=share * pulse.pga) for share in (1.0 - APART, 1.0, 1.0 + APART)
        ]
        own = {run.outcome for run in simulate_all(reduced, around, settings("nonsmooth", name))}
        if len(own) > 1:
            continue
        compared += 1
        whole = simulate(described, pulse, settings("nonsmooth", name, reduce=False))
        other = [
            simulate(chosen, pulse, settings(engine, name, reduce=chosen is reduced))
            for chosen in (reduced, described)
        ]
        if {whole.outcome, *(run.outcome for run in other)} != own:
            differing.append(f"{name} {pulse} {own} {whole.outcome} {other}")
    return differing, compared


@pytest.fixture
def through_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only a run that is stepped from outside passes over rests within its motion."""
    monkeypatch.setattr(overturning, "_pass_over_rest", lambda run: None)


@pytest.mark.usefixtures("through_rests")
@pytest.mark.parametrize("reduce", [True, False])
@pytest.mark.parametrize("name", slow_but(["slab on end", "tapered"], ROCKS))
def test_a_run_is_decided_alike_as_a_whole_and_step_by_step(name: str, reduce: bool) -> None:
    assert stepped_differently(name, 12, reduce=reduce) == []


@pytest.mark.parametrize("name", ["cube on end", "tapered"])
@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_engines_decide_alike_away_from_the_boundary(engine: str, name: str) -> None:
    differing, compared = decided_differently(engine, name, 10)
    assert compared >= 5
    assert differing == []


@pytest.mark.parametrize("name", ["slab on end", "pillar"])
@pytest.mark.parametrize("yaw", [0.0, 1.2])
def test_a_rock_that_grips_less_than_it_tips_slides_flat(name: str, yaw: float) -> None:
    """Exact at any PGA: no friction below tan(alpha) can lift an edge. Bullet has it at 0.6."""
    rock = ROCKS[name]
    limit = input_checks._slenderness(Scene(rock, Contact(0.6), yaw))
    rng = np.random.default_rng(5)
    for engine, share in (("nonsmooth", 0.99), ("nonsmooth", 0.5), ("bullet", 0.6)):
        slides = case(name, yaw, share * limit, reduce=True)
        for _ in range(6):
            unit = step_unit(rock)
            pulse = CosinePulse.from_g(rng.uniform(0.6, 1.3), unit * rng.uniform(0.6, 2.0))
            run = simulate(slides, pulse, settings(engine, name))
            assert run.outcome is Outcome.DISPLACED
            assert run.peak_tilt < 0.05 * limit


@pytest.mark.slow
@pytest.mark.usefixtures("through_rests")
@pytest.mark.parametrize("reduce", [True, False])
@pytest.mark.parametrize("name", ROCKS)
def test_many_runs_are_decided_alike_as_a_whole_and_step_by_step(name: str, reduce: bool) -> None:
    assert stepped_differently(name, 150, reduce=reduce) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ROCKS)
@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_engines_decide_many_runs_alike(engine: str, name: str) -> None:
    """One in fifty may hang on more than a boundary: on which edge an engine lets the rock land."""
    differing, compared = decided_differently(engine, name, 100)
    assert compared >= 80
    assert len(differing) <= 0.02 * compared, differing


def terrain_cells(number: int, seed: int) -> list[tuple[TerrainCase, CosinePulse]]:
    rng = np.random.default_rng(seed)
    perch = grounds.perch(cells=6)
    sites = [grounds.site(grounds.lump(), perch, yaw=yaw) for yaw in (0.0, 1.0, 2.5)]
    return [
        (sites[rng.integers(3)], CosinePulse.from_g(rng.uniform(0.2, 1.2), rng.uniform(0.05, 0.3)))
        for _ in range(number)
    ]


def over_terrain_differently(number: int, *, follow: bool, reduce: bool) -> list[str]:
    """Cells of a rock on its perch that end otherwise if they are stepped from outside."""
    differing = []
    given = Settings(0.004, reduce=reduce, engine="nonsmooth")
    for site, pulse in terrain_cells(number, 3):
        alike = replace(site, flight=site.seat)
        compiled = displacement._compiled(alike, pulse, given, follow, given.time_step)
        stepped = displacement._stepped(alike, pulse, replace(given), follow, given.time_step)
        one, other = compiled.response, stepped.response
        ends = compiled.trajectory.position[-1], stepped.trajectory.position[-1]
        if compiled.stop is not stepped.stop or not (
            same(one, other) and np.allclose(*ends, atol=1e-6)
        ):
            differing.append(f"{pulse} {one} {other} {compiled.stop} {stepped.stop}")
    return differing


@pytest.mark.parametrize("reduce", [True, False])
def test_a_run_over_a_terrain_is_decided_alike_as_a_whole_and_step_by_step(reduce: bool) -> None:
    assert over_terrain_differently(10, follow=False, reduce=reduce) == []


@pytest.mark.slow
@pytest.mark.parametrize("reduce", [True, False])
def test_many_runs_over_a_terrain_are_decided_alike(reduce: bool) -> None:
    assert over_terrain_differently(120, follow=False, reduce=reduce) == []


def test_outcomes_of_the_cells_are_of_all_kinds() -> None:
    """Else the comparisons would say little."""
    found = {
        run.outcome
        for name in ROCKS
        for reduced, _, pulse in cells(name, 12, 1)
        for run in simulate_all(reduced, [pulse], settings("nonsmooth", name))
    }
    assert found >= {Outcome.BALANCED, Outcome.OVERTURNED, Outcome.DISPLACED}
