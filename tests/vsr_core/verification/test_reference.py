"""Every reference case in every engine that holds it; and that the suite sees a broken engine."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from vsr_core import GRAVITY, engines
from vsr_core.engines.interface import Engine, Solver, World
from vsr_core.motions.pulses import CosinePulse
from vsr_core.run import rocking_block
from vsr_core.scene import Scene
from vsr_core.verification import modules, reference
from vsr_core.verification.reference import Reference, cases, housner, overturning_block, sliding
from vsr_core.verification.rocks import sphere

Array = NDArray[np.float64]

CASES = {case.name: case for case in cases()}
GRIDS = [name for name in CASES if name.startswith("first-overturning")]
ORDERED = ("box COMPLEX, energy", "slide to rest", "rolling sphere")
"""Cases of which the order of other engines than the compiled one is in the quick suite."""

HELD = [
    pytest.param(
        case,
        engine,
        id=f"{name}, {engine}",
        marks=[pytest.mark.slow] * (engine != "nonsmooth" and at % 3 > 0),
    )
    for at, (name, case) in enumerate(CASES.items())
    for engine in case.engines
    if name not in GRIDS
]
SMOOTH = [
    pytest.param(
        case,
        engine,
        id=f"{name}, {engine}",
        marks=[pytest.mark.slow] * (engine != "nonsmooth" and name not in ORDERED),
    )
    for name, case in CASES.items()
    for engine in case.engines
    if case.order is not None
]


def test_every_case_is_found_and_says_what_it_is() -> None:
    assert len(CASES) == len(cases())
    assert all(module.CASES for module in modules(reference.__name__).values())
    for case in CASES.values():
        assert case.answer
        assert case.quantity
        assert "\n" not in case.answer + case.quantity
        assert case.tolerance > 0.0
        assert set(case.engines) <= set(engines.names())


@pytest.mark.parametrize(("case", "engine"), HELD)
def test_within_tolerance(case: Reference, engine: str) -> None:
    assert 0.0 <= case.measure(engine, case.step) <= case.tolerance


@pytest.mark.parametrize("case", [case for case in CASES.values() if "nonsmooth" in case.engines])
def test_the_compiled_engine_at_the_step_that_it_chooses(case: Reference) -> None:
    """0.02 sqrt(R / g) is 5 ms where the step of the tolerance is 1 ms."""
    assert 0.0 <= case.measure("nonsmooth", 5.0 * case.step) <= 0.025


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
@pytest.mark.parametrize("name", GRIDS)
def test_all_64_boundaries(name: str, engine: str) -> None:
    case = CASES[name]
    assert 0.0 <= case.measure(engine, case.step) <= case.tolerance


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_some_of_the_64_boundaries(engine: str) -> None:
    case = CASES["first-overturning PGA, worst of 64"]
    blocks, periods = overturning_block.BLOCKS[::5], overturning_block.PERIODS[::3]
    errors = overturning_block.boundaries(blocks, periods, engine, case.step)
    assert errors.shape == (2, 3)
    assert errors.max() <= case.tolerance


@pytest.mark.parametrize(("case", "engine"), SMOOTH)
def test_order_of_convergence(case: Reference, engine: str) -> None:
    steps = [1 / 500, 1 / 1000, 1 / 2000, 1 / 4000]
    errors = [case.measure(engine, step) for step in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    if engine == "nonsmooth":
        # One order more, down to where the errors of its impulses show.
        assert max(errors) < 1e-6 or slope > case.order + 0.65
    else:
        assert slope == pytest.approx(case.order, abs=0.35)


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_an_engine_with_wrong_gravity_fails(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class Heavy:
        """An engine in which everything weighs 5 % too much."""

        def __init__(self, right: Engine) -> None:
            self.right, self.VERSION, self.SOLVER = right, right.VERSION, right.SOLVER

        def build(
            self, scene: Scene, time_step: float, substeps: int, solver: Solver | None = None
        ) -> World:
            heavy = replace(scene, gravity=1.05 * scene.gravity)
            return self.right.build(heavy, time_step, substeps, solver)

    load = engines.load
    monkeypatch.setattr(engines, "load", lambda name: Heavy(load(name)))
    case = CASES["free fall"]
    assert case.measure(engine, case.step) == pytest.approx(0.05, abs=0.005)


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
@pytest.mark.parametrize(
    "name",
    [
        "box COMPLEX, orientation",
        pytest.param("sliding under a cosine pulse", marks=pytest.mark.slow),
        "tilt of a block that overturns after an impact",
        pytest.param("slender block, overturned at once", marks=pytest.mark.slow),
        pytest.param("similar blocks", marks=pytest.mark.slow),
    ],
)
def test_the_same_bits_again(name: str, engine: str) -> None:
    case = CASES[name]
    first = case.measure(engine, case.step)
    CASES["rolling sphere"].measure(engine, case.step)
    assert case.measure(engine, case.step) == first


@pytest.mark.parametrize(("pga_g", "ratio"), [(0.8, 0.15), (1.2, 0.15), (0.6, 0.3)])
def test_two_integrations_of_the_rocking_block_agree(pga_g: float, ratio: float) -> None:
    block, pulse = rocking_block.Block(0.5, 1.0), CosinePulse.from_g(pga_g, ratio)
    ended = rocking_block.rocking_response(block, pulse.pga, ratio)
    times = np.linspace(0.0, ended.time, 50)
    tilt = housner.rocking(block, pulse, times)
    assert np.isfinite(tilt).sum() > 10
    if abs(ended.theta) < block.alpha:
        assert tilt[-1] == pytest.approx(ended.theta, abs=1e-7)
    else:
        assert math.isnan(tilt[-1])


@pytest.mark.parametrize(("pga_g", "ratio"), [(0.8, 0.2), (0.35, 0.5), (2.0, 0.1), (0.25, 0.5)])
def test_sliding_in_closed_form_is_sliding_in_small_steps(pga_g: float, ratio: float) -> None:
    pulse, resisting, step = CosinePulse.from_g(pga_g, ratio), 0.3 * GRAVITY, 2e-5
    times: Array = step * np.arange(100_001, dtype=np.float64)
    place, speed, marched = 0.0, 0.0, [0.0]
    for push in pulse.acceleration(times[:-1] + 0.5 * step).tolist():
        if speed != 0.0 or abs(push) > resisting:
            side = math.copysign(1.0, speed if speed != 0.0 else -push)
            faster = speed - step * (push + side * resisting)
            faster = 0.0 if faster * side < 0.0 else faster
            place, speed = place + 0.5 * step * (speed + faster), faster
        marched.append(place)
    exact = sliding.slide(pulse, resisting, times)
    assert (pga_g > 0.3) == (np.abs(exact).max() > 0.01)
    assert exact == pytest.approx(np.array(marched), abs=1e-4)


def test_a_sphere_is_a_sphere() -> None:
    ball = sphere(0.5)
    assert ball.inertia == pytest.approx(0.1 * ball.mass * np.ones(3))
    assert (ball.radius, ball.height) == (0.5, 0.5)
