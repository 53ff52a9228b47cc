"""Errors of tilts, slips and travels: exact where there is an answer, and honest elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import grounds

from vsr_core import GRAVITY
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import AT_REST, QUANTITIES, DecidedBy, Outcome, Response
from vsr_core.rock.body import Rock
from vsr_core.run import displacement, quantities
from vsr_core.run.cases import Case, Settings, TerrainCase, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.run.quantities import Error, exact, measure, pulses, summed_up
from vsr_core.run.sliding_block import farthest, slide
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box


def case_of(rock: Rock, friction: float, *, reduce: bool = True) -> Case:
    return prepare(Scene(rock, Contact(friction)), barrier(rock), reduce=reduce)


BLOCK, SQUAT = case_of(box(1.0, 1.0, 2.0), GRIPPING), case_of(box(2.0, 2.0, 0.5), 0.4)
NUMBER = 160


def at(share: float, case: Case = BLOCK) -> Settings:
    return Settings(share * step_unit(case.full.rock), engine="nonsmooth")


def error(case: Case, share: float, name: str) -> Error:
    return summed_up(measure(case, at(share, case), NUMBER)[QUANTITIES.index(name)])


@pytest.mark.slow
def test_a_shorter_step_keeps_a_tolerance_for_tilt_and_slip() -> None:
    """Housner's block: at a third of the usual step, not at one half longer than it."""
    assert exact(BLOCK) == ("peak_tilt",)
    assert not error(BLOCK, 0.03, "peak_tilt").within(0.01)
    for name in AT_REST:
        found = error(BLOCK, 0.007, name)
        assert found.within(0.01)
        assert found.runs > 40


@pytest.mark.slow
def test_the_slip_of_a_squat_block_is_newmarks() -> None:
    assert exact(SQUAT) == ("slip",)
    found = error(SQUAT, 0.02, "slip")
    assert found.runs == NUMBER
    assert found.within(0.01)


def test_the_farthest_place_of_a_slide_is_that_of_its_path() -> None:
    for pga, ratio in ((0.5, 0.4), (0.9, 0.1), (2.6, 0.1)):
        pulse = CosinePulse.from_g(pga, ratio)
        path = slide(pulse, 0.4 * GRAVITY, np.linspace(0.0, 4.0 * pulse.duration, 40_001))
        assert farthest(pulse, 0.4 * GRAVITY) == pytest.approx(np.abs(path).max(), rel=1e-6)
    assert farthest(CosinePulse.from_g(0.3, 0.4), 0.4 * GRAVITY) == 0.0


@pytest.mark.slow
def test_a_bias_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tilts that are told 5 % too large, at any step."""

    def biased(*given: object) -> list[Response]:
        found = simulate_all(*given)  # type: ignore[arg-type]
        return [replace(one, peak_tilt=1.05 * one.peak_tilt) for one in found]

    monkeypatch.setattr(quantities, "simulate_all", biased)
    assert error(BLOCK, 0.005, "peak_tilt").median == pytest.approx(0.05, abs=0.003)


@pytest.mark.slow
def test_rocks_that_topple_have_no_largest_tilt() -> None:
    found = measure(BLOCK, at(0.02), NUMBER)
    runs = simulate_all(BLOCK, pulses(BLOCK, NUMBER), at(0.02))
    upright = np.array([run.outcome is Outcome.BALANCED for run in runs])
    assert upright.any()
    assert not upright.all()
    assert np.isnan(found[:, ~upright]).all()
    # but for runs so near the boundary that Housner's block topples
    assert np.isfinite(found[0, upright]).sum() >= upright.sum() - 2


def test_too_few_runs_have_no_error_and_keep_no_tolerance() -> None:
    few = summed_up(np.array([0.0] * 7 + [math.nan] * 90))
    assert few.runs == 7
    assert not few.within(0.1)


@pytest.mark.parametrize("friction", [0.6, 1.5])
def test_a_run_followed_to_rest_has_the_outcome_and_the_peaks_of_one_not_reduced(
    friction: float,
) -> None:
    rock = box(1.0, 1.0, 2.0)
    reduced, plain = (case_of(rock, friction, reduce=reduce) for reduce in (True, False))
    shaken, settings = pulses(reduced, NUMBER), at(0.02)
    early = simulate_all(reduced, shaken, settings)
    whole = simulate_all(reduced, shaken, replace(settings, whole=True))
    every = simulate_all(plain, shaken, replace(settings, reduce=False))
    assert [run.outcome for run in whole] == [run.outcome for run in early]
    upright = [n for n, run in enumerate(whole) if run.outcome is not Outcome.OVERTURNED]
    assert any(early[n].decided_by is DecidedBy.ENERGY_BOUND for n in upright)
    assert all(whole[n].decided_by is not DecidedBy.ENERGY_BOUND for n in upright)
    for n in upright:
        assert whole[n].peak_tilt == pytest.approx(every[n].peak_tilt, rel=1e-6, abs=1e-5)
        assert whole[n].slip == pytest.approx(every[n].slip, rel=1e-6, abs=1e-4)


def test_travels_over_a_terrain_are_compared_where_the_rock_leaves_its_place() -> None:
    """A block that stands rests where it stood; one that topples ends half its height away."""
    rock = box(0.5, 0.4, 1.0)
    made = grounds.site(rock, grounds.level(), yaw=0.0, restitution=0.0)
    rest = displacement.settled(made.seat, 0.006 * step_unit(rock), "nonsmooth")
    scene = replace(made.seat, start=rest)
    place = TerrainCase(scene, scene, barrier(rock).toppled_tilt)
    found = measure(place, Settings(0.004, engine="nonsmooth"), 16)
    tilt, travel = found[0], found[len(AT_REST) :]
    stands, leaves = np.isfinite(tilt), np.isfinite(travel).all(axis=0)
    assert stands.any()
    assert leaves.any()
    assert not (stands & leaves).any()
    assert np.nanmedian(tilt) < 0.01
    assert np.nanmedian(travel, axis=1) == pytest.approx([0.0, 0.0], abs=0.1)
