"""Compiled runs: alone or among others, judged as any engine's runs, and refused what they lack."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.suites import slow_but

from vsr_core import GRAVITY, engines
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock import solid
from vsr_core.run import overturning
from vsr_core.run.agreement import rocking_block
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.rocking_block import rocking_response
from vsr_core.scene import Contact, Scene
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.table import servo
from vsr_core.verification.rocks import box, frustum, upright
from vsr_core.verification.stability import coarse_steps

OWN = Settings(0.008, engine="nonsmooth")
RNG = np.random.default_rng(11)
PULSES = [
    CosinePulse(pga * GRAVITY, ratio)
    for pga, ratio in zip(RNG.uniform(0.3, 1.2, 40), RNG.uniform(0.1, 0.6, 40), strict=True)
]


def case_of(scene: Scene) -> Case:
    return prepare(scene, barrier(scene.rock), reduce=True)


BLOCK = case_of(Scene(box(1.0, 1.0, 2.0), Contact(0.6)))
TAPERED = case_of(Scene(frustum((0.5, 0.4), (0.9, 0.8), 1.6), Contact(0.6), yaw=0.3))


@pytest.mark.parametrize("case", [BLOCK, TAPERED], ids=["block", "tapered"])
def test_a_run_is_the_same_bits_alone_in_any_order_and_in_any_thread(case: Case) -> None:
    together = overturning.simulate_all(case, PULSES, OWN)
    assert {response.outcome for response in together} >= {Outcome.BALANCED, Outcome.OVERTURNED}
    assert overturning.simulate_all(case, PULSES[::-1], OWN)[::-1] == together
    with ThreadPoolExecutor(4) as pool:
        alone = list(pool.map(lambda pulse: overturning.simulate(case, pulse, OWN), PULSES))
    assert alone == together


def test_outcomes_are_housners() -> None:
    block = rocking_block(BLOCK)
    assert block is not None
    found = overturning.simulate_all(BLOCK, PULSES, OWN)
    expected = [rocking_response(block, p.pga, p.pgv_pga).overturned for p in PULSES]
    assert [response.outcome is Outcome.OVERTURNED for response in found] == expected


def test_a_mirrored_pulse_is_a_mirrored_run() -> None:
    for pulse in PULSES[:10]:
        one = overturning.simulate(BLOCK, pulse, OWN)
        other = overturning.simulate(BLOCK, replace(pulse, pga=-pulse.pga), OWN)
        assert one.outcome is other.outcome
        if one.outcome is Outcome.BALANCED:
            assert other.peak_tilt == pytest.approx(one.peak_tilt, rel=1e-3, abs=1e-6)


def test_similar_rocks_rock_alike() -> None:
    """Lengths by s, times by sqrt(s): the same tilts."""
    share = 0.01
    small = case_of(Scene(box(0.01, 0.01, 0.02), Contact(0.6)))
    for pulse in PULSES[:10]:
        like = CosinePulse(pulse.pga, math.sqrt(share) * pulse.pgv_pga)
        one = overturning.simulate(BLOCK, pulse, Settings(0.004, engine="nonsmooth"))
        other = overturning.simulate(
            small, like, Settings(math.sqrt(share) * 0.004, engine="nonsmooth")
        )
        assert one.outcome is other.outcome


def test_a_rock_inside_its_pedestal_is_unstable() -> None:
    rock = box(1.0, 1.0, 2.0)
    start = upright((0.0, 0.0, rock.height - 0.1 * rock.radius))
    case = case_of(Scene(rock, Contact(0.6), start=start))
    found = overturning.simulate(case, PULSES[0], OWN)
    assert found.outcome is Outcome.UNSTABLE


@pytest.mark.parametrize(
    "change",
    [
        {"drive": servo.PUBLISHED},
        {"contact": Contact(0.6, stiffness=1e9)},
        {"contact": Contact(0.6, rolling_friction=0.01)},
    ],
    ids=["servo", "springs", "rolling friction"],
)
def test_what_it_cannot_hold_is_refused_with_a_remedy(change: dict[str, object]) -> None:
    scene = replace(BLOCK.full, **change)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="bullet"):
        engines.load("nonsmooth").build(scene, 1e-3, 1)


def test_a_surrogate_of_a_scan_topples_as_in_bullet() -> None:
    """Away from the boundary, where the engines' errors decide nothing."""
    rock = solid.from_mesh(trimesh.Trimesh(*double_rock(), process=False), 2110.0).rock
    case = case_of(Scene(rock, Contact(0.6)))
    pulses = [CosinePulse.from_g(pga, 0.3) for pga in (0.12, 0.5, 0.8)]
    own = overturning.simulate_all(case, pulses, Settings(0.004, engine="nonsmooth"))
    bullet = overturning.simulate_all(case, pulses, Settings(0.0018))
    assert [r.outcome for r in own] == [r.outcome for r in bullet]
    assert {r.outcome for r in own} == {Outcome.BALANCED, Outcome.OVERTURNED}


SHARES = np.geomspace(0.0022, 0.012, 12).tolist()


@pytest.mark.parametrize("share", slow_but(SHARES[::4], SHARES))
@pytest.mark.parametrize("slenderness", [2.0, 10.0, 20.0])
def test_a_block_swings_back_alike_wherever_in_a_step_it_lands(
    slenderness: float, share: float
) -> None:
    """It may touch just where a step ends."""
    assert coarse_steps._swing(slenderness, share, "nonsmooth").error < 1e-3
