"""Runs on level ground of triangles do as those on a flat pedestal."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support import grounds

from tests.support.rocks_on_ground import Array, cells, ground_of, rock_of, run, site_of, usual
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import DISPLACED_SHARE, Outcome, StopReason
from vsr_core.rock import solid
from vsr_core.run import displacement
from vsr_core.run.cases import prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene


def squarely(chosen: Array) -> Array:
    """The same cells, shaken along x or y: on one corner a box has no boundary, but a fringe."""
    quarter = 0.5 * math.pi
    return np.column_stack([chosen[:, :2], np.round(chosen[:, 2] / quarter) * quarter])


def like_the_plane(rock: str, ground: str, chosen: Array, shift: float = 0.03) -> None:
    """Same side as on the plane, but for cells whose own neighbours are on both sides of it."""
    body, limits = rock_of(rock)
    settings = usual(body)
    sides = []
    beside = 0
    for pga, ratio, yaw in chosen.tolist():
        case = prepare(Scene(body, Contact(0.6), yaw), limits, reduce=True)

        def flat(share: float, case=case, pga=pga, ratio=ratio) -> int:  # type: ignore[no-untyped-def]
            return simulate(
                case, CosinePulse.from_g(share * pga, ratio), settings
            ).outcome.overturned

        site = site_of(rock, ground)
        site = replace(site, seat=replace(site.seat, yaw=yaw))
        found = displacement.respond(site, CosinePulse.from_g(pga, ratio), settings)
        if found.outcome.overturned != flat(1.0):
            around = [flat(1.0 + way * shift * part) for way in (-1, 1) for part in (0.3, 0.6, 1.0)]
            assert len({*around, flat(1.0)}) == 2, (pga, ratio, yaw, found)
            beside += 1
        sides.append(found.outcome.overturned)
    assert set(sides) == {0, 1}
    assert beside <= 0.1 * len(chosen)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rock", "ground", "count"),
    [("box", "level", 5), ("box", "level parts", 5), ("double rock", "level parts", 6)],
)
def test_level_ground_is_a_flat_pedestal(rock: str, ground: str, count: int) -> None:
    """After the first impacts: many of them magnify any difference."""
    if rock == "box":
        like_the_plane(rock, ground, squarely(cells(1, count, 0.4, 1.2, 0.2)))
    else:
        like_the_plane(rock, ground, cells(1, count, 0.08, 0.5, 0.15))


@pytest.mark.slow
@pytest.mark.parametrize("ground", ["level", "level parts"])
@pytest.mark.parametrize("rock", ["box", "double rock"])
def test_level_ground_is_a_flat_pedestal_on_a_grid(rock: str, ground: str) -> None:
    if rock == "box":
        like_the_plane(rock, ground, squarely(cells(2, 60, 0.3, 1.2, 0.3)))
    else:
        like_the_plane(rock, ground, cells(2, 60, 0.08, 0.5, 0.3))


def boundary(over: Callable[[float], bool], low: float, high: float) -> float:
    """The least PGA [g] that topples, to 0.2 %."""
    assert over(high)
    assert not over(low)
    while high - low > 0.002 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if over(middle) else (middle, high)
    return high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rock", "ground", "shift"),
    [
        ("box", "level", 0.02),
        ("box", "level parts", 0.02),
        ("double rock", "level", 0.03),  # it settles with a lean of 0.02 deg
        ("double rock", "level parts", 0.02),
    ],
)
def test_boundary_on_level_ground(rock: str, ground: str, shift: float) -> None:
    """Of few impacts, against that on the plane."""
    body, limits = rock_of(rock)
    case = prepare(Scene(body, Contact(0.6)), limits, reduce=True)
    settings, site = usual(body), site_of(rock, ground)
    low, high = (0.5, 1.0) if rock == "box" else (0.1, 0.4)

    def flat(pga: float) -> bool:
        return simulate(case, CosinePulse.from_g(pga, 0.15), settings).outcome.overturned == 1

    def terrain(pga: float) -> bool:
        return (
            displacement.respond(site, CosinePulse.from_g(pga, 0.15), settings).outcome.overturned
            == 1
        )

    assert boundary(terrain, low, high) == pytest.approx(boundary(flat, low, high), rel=shift)


def test_slip_on_level_ground_is_that_on_the_plane() -> None:
    """A squat block that slides and does not rock."""
    squat = solid.box((0.8, 0.8, 0.3), 2000.0).rock
    limits = barrier(squat)
    for pga, ratio, yaw in [(0.8, 0.2, 0.0), (0.6, 0.3, 1.0)]:
        case = prepare(Scene(squat, Contact(0.3), yaw), limits, reduce=False)
        flat = simulate(case, CosinePulse.from_g(pga, ratio), usual(squat, reduce=False))
        for ground in ("level", "level parts"):
            site = grounds.site(
                squat, ground_of(ground), limits.toppled_tilt, yaw=yaw, friction=0.3
            )
            found = displacement.displace(site, CosinePulse.from_g(pga, ratio), usual(squat))
            assert found.response.outcome is flat.outcome is Outcome.DISPLACED
            assert found.response.slip == pytest.approx(flat.slip, rel=0.02)
            assert found.stop is StopReason.REST
            # A positive pulse pushes first away from where the table starts to, whatever the yaw.
            early = found.trajectory.position[found.trajectory.time < 0.2][-1, :2]
            way = np.array([math.cos(yaw), -math.sin(yaw)])
            assert early @ way < -0.9 * np.linalg.norm(early) < -1e-3


def test_outcomes_that_stand() -> None:
    squat = solid.box((0.8, 0.8, 0.3), 2000.0).rock
    site = grounds.site(squat, ground_of("level parts"), 1.0, friction=0.3)
    for pga, outcome in [(0.4, Outcome.BALANCED), (0.5, Outcome.DISPLACED)]:
        response = run(site, pga, 0.2).response
        assert response.outcome is outcome
        assert 0.4 < response.slip / (DISPLACED_SHARE * squat.radius) < 2.0
