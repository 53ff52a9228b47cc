"""Largest tilts and slips of runs to their end, against Housner's block and Newmark's."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from vsr_core import GRAVITY
from vsr_core.compiled import records
from vsr_core.engines.nonsmooth import peaks as watched
from vsr_core.engines.nonsmooth.body import RockState
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import DecidedBy, Outcome, Response, ran_whole
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate, simulate_all
from vsr_core.run.rocking_block import Block, rocking_response
from vsr_core.run.sliding_block import farthest
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box

STEP = 0.02
"""Coarse step of the engine, in units of sqrt(radius / g)."""


def whole(rock: Rock, friction: float, pulses: list[CosinePulse], step: float) -> list[Response]:
    case = prepare(Scene(rock, Contact(friction)), barrier(rock), reduce=False)
    settings = Settings(step * step_unit(rock), reduce=False, engine="nonsmooth")
    return simulate_all(case, pulses, settings)


def pulses(seed: int, number: int, pga: tuple[float, float]) -> list[CosinePulse]:
    rng = np.random.default_rng(seed)
    return [
        CosinePulse.from_g(a, r)
        for a, r in zip(rng.uniform(*pga, number), rng.uniform(0.05, 0.8, number), strict=True)
    ]


def rocking_errors(step: float) -> NDArray[np.float64]:
    """Of largest tilts of a block that stands, relative to Housner's or a hundredth of alpha."""
    block, shaken = Block(0.5, 1.0), pulses(1, 400, (0.5, 1.2))
    exact = [rocking_response(block, p.pga, p.pgv_pga) for p in shaken]
    found = whole(box(1.0, 1.0, 2.0), GRIPPING, shaken, step)
    stands = [
        (own.peak_tilt, right.peak_angle)
        for own, right in zip(found, exact, strict=True)
        if own.outcome is Outcome.BALANCED and not right.overturned
    ]
    tilt, right = np.array(stands).T
    assert len(tilt) > 80
    return np.abs(tilt - right) / np.maximum(right, 0.01 * block.alpha)


def sliding_errors(step: float) -> NDArray[np.float64]:
    """Of largest slips of a squat block, relative to Newmark's or a thousandth of the radius."""
    rock, shaken = box(2.0, 2.0, 0.5), pulses(2, 200, (0.45, 3.0))
    slip = [response.slip for response in whole(rock, 0.4, shaken, step)]
    right = np.array([farthest(pulse, 0.4 * GRAVITY) for pulse in shaken])
    return np.abs(slip - right) / np.maximum(right, 1e-3 * rock.radius)


@pytest.mark.slow
@pytest.mark.parametrize("errors", [rocking_errors, sliding_errors])
def test_peaks_are_those_of_the_exact_block(errors: Callable[[float], NDArray[np.float64]]) -> None:
    """Median and four in five at the coarse step; 95 % at a third of it."""
    coarse, fine = errors(STEP), errors(STEP / 3.0)
    assert np.median(coarse) < 0.003
    assert np.quantile(coarse, 0.8) < 0.01
    assert np.median(fine) < 0.001
    assert np.quantile(fine, 0.95) < 0.02


@pytest.mark.parametrize(
    ("step", "error"), [(STEP, 0.05), (STEP / 4.0, 0.01), (STEP / 16.0, 0.002)]
)
def test_a_block_that_slides_back_and_forth_comes_to_its_turning_point(
    step: float, error: float
) -> None:
    """Where it turns within a step it is held to the end of that: of first order in the step."""
    rock, pulse = box(1.0, 1.0, 0.5), CosinePulse.from_g(2.6, 0.1)
    right = farthest(pulse, 0.6 * GRAVITY)
    assert right == pytest.approx(0.337, abs=1e-3)
    (found,) = whole(rock, 0.6, [pulse], step)
    assert found.slip == pytest.approx(right, rel=error)


@pytest.mark.parametrize("shift", [0.0, 0.2, -0.4])
def test_the_top_of_a_parabola_is_found_between_steps(shift: float) -> None:
    """A rock thrown sideways with a constant acceleration back, looked at in whole steps."""
    rock = records.room(RockState)
    rock.rotation[:] = np.eye(3)
    peaks = watched.room(box(1.0, 1.0, 2.0), np.array([0.0, 0.0, 1.0]))
    times = np.arange(-4.0, 5.0) + shift
    for n, t in enumerate(times):
        rock.place[0] = 3.0 - 0.1 * t * t
        if not n:
            begin = rock.place[0]
            watched.begin(peaks, rock)
        watched.look(peaks, rock)
    tilt, slip = watched.tilt_and_slip(peaks)
    assert slip == pytest.approx(3.0 - begin, rel=1e-12)
    assert tilt == 0.0


def test_a_run_that_was_ended_early_has_no_peaks_and_others_have_those_of_the_whole() -> None:
    rock, shaken = box(1.0, 1.0, 2.0), pulses(3, 60, (0.3, 1.2))
    scene, settings = Scene(rock, Contact(0.6)), Settings(0.007, engine="nonsmooth")
    reduced = prepare(scene, barrier(rock), reduce=True)
    ended, complete = [], []
    for pulse, run in zip(shaken, whole(rock, 0.6, shaken, STEP), strict=True):
        early = simulate(reduced, pulse, settings)
        known = ran_whole(
            np.array([early.outcome]), np.array([early.decided_by]), on_terrain=False
        ).item()
        (complete if known else ended).append((early, run))
    assert {early.decided_by for early, _ in ended} == {DecidedBy.ENERGY_BOUND, DecidedBy.NO_RETURN}
    assert any(early.peak_tilt < 0.9 * run.peak_tilt for early, run in ended)
    assert complete
    for early, run in complete:
        assert early.peak_tilt == pytest.approx(run.peak_tilt, rel=1e-3, abs=1e-5)
        assert math.isclose(early.slip, run.slip, rel_tol=1e-3, abs_tol=1e-4 * rock.radius)
