"""How a rock left its seat, where mechanics leaves one answer only."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import grounds

from vsr_core.judge.on_terrain import DROPPED_SHARE
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Movement, Outcome
from vsr_core.rock import solid
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.displacement import displace
from vsr_core.run.movement import air_share, movements, no_return_tilt
from vsr_core.run.time_step import step_unit
from vsr_core.scene import State
from vsr_core.terrain.surface import Terrain

SLAB, TOWER = (0.5, 0.5, 0.2), (0.2, 0.2, 0.8)


def on(
    ground: Terrain, size: tuple[float, float, float], friction: float, lean: float = 0.0
) -> TerrainCase:
    """A block on a ground that falls by ``lean`` [rad] towards +x where it stands."""
    rock = solid.box(size, 2000.0).rock
    turn = np.array(
        [[math.cos(lean), 0.0, math.sin(lean)], [0, 1, 0], [-math.sin(lean), 0.0, math.cos(lean)]]
    )
    start = State(turn @ [0.0, 0.0, 0.5 * size[2]], turn, np.zeros(3), np.zeros(3))
    return grounds.site(rock, ground, 1.0, friction=friction, start=start)


def moved(
    case: TerrainCase, size: tuple[float, float, float], pga: float, ratio: float
) -> set[Movement]:
    """Movement of a run followed to its end, and of one up to where its outcome is decided."""
    settings = Settings(0.004 * step_unit(case.seat.rock), True, "nonsmooth")
    angles = np.arctan([size[0] / size[2], math.hypot(*size[:2]) / size[2]])  # edge and corner
    found = set()
    for follow in (True, False):
        run = displace(case, CosinePulse.from_g(pga, ratio), settings, follow=follow)
        assert run.response.outcome is Outcome.OVERTURNED
        path = run.trajectory
        of_one = (np.array([part]) for part in (
            int(run.response.outcome), run.response.peak_tilt,
            air_share(path.position[:, 2], path.contact, case.seat.rock.radius),
        ))  # fmt: skip
        found.add(Movement(int(movements(*of_one, no_return_tilt(angles, case.toppled_tilt))[0])))
    return found


def test_a_slab_that_a_slope_carries_down_slides() -> None:
    """It would tip at 68 deg only, and friction of 0.3 holds it on a slope of 10 deg."""
    slope = math.radians(10.0)
    case = on(grounds.incline(slope), SLAB, 0.3, slope)
    assert moved(case, SLAB, 0.6, 0.3) == {Movement.SLID}


def test_a_tower_on_rough_level_ground_rolls_over() -> None:
    case = on(grounds.level(), TOWER, 0.8)
    assert moved(case, TOWER, 0.9, 0.2) == {Movement.ROLLED_OVER}


def test_a_slab_pulled_from_under_falls() -> None:
    """Without friction the ground moves off beneath it, by 3.6 m: it drops from a step of 0.15 m.

    It turns little meanwhile: the second half of its base is past the edge within a tenth of a
    second.
    """
    case = on(grounds.cliff(0.15, 0.3), SLAB, 0.0)
    assert moved(case, SLAB, -1.5, 0.35) == {Movement.FELL}


@given(
    drops=st.lists(st.tuples(st.floats(0.001, 0.1), st.booleans()), min_size=1, max_size=8),
    later=st.lists(st.tuples(st.floats(-0.1, 0.5), st.booleans()), max_size=3),
    parts=st.integers(1, 3),
)
def test_the_share_is_that_of_the_way_down_off_the_seat(
    drops: list[tuple[float, bool]], later: list[tuple[float, bool]], parts: int
) -> None:
    """However finely sampled, and whatever comes later."""
    way = sum(drop for drop, _ in drops)
    air = sum(drop for drop, touched in drops if not touched)
    steps = [(drop / parts, touched) for drop, touched in drops for _ in range(parts)] + later
    height = 3.0 - np.cumsum([0.0, *(drop for drop, _ in steps)])
    touched = np.array([True, *(touched for _, touched in steps)])
    radius = (way - 0.5 * drops[-1][0] / parts) / DROPPED_SHARE  # passed in the last part
    assert air_share(height, touched, radius) == pytest.approx(air / way, abs=1e-9)


def test_a_rock_that_stays_as_high_made_no_way_down() -> None:
    height, touched = np.array([1.0, 1.2, 0.95]), np.array([True, False, True])
    assert math.isnan(air_share(height, touched, 0.5))
    assert air_share(height, touched, 0.4) == pytest.approx(-4.0)  # it rose by 0.2, sank by 0.25
    assert math.isnan(air_share(np.empty(0), np.empty(0, bool), 0.5))


def test_only_overturned_rocks_rolled_over_or_fell() -> None:
    for outcome, tilt, share in itertools.product(Outcome, (0.1, 2.0), (0.0, 1.0, math.nan)):
        (found,) = movements(np.array([outcome]), np.array([tilt]), np.array([share]), 0.5)
        if outcome is Outcome.OVERTURNED:
            assert found == (1 if tilt > 1.0 else 2 if share == 1.0 else 3)
        else:
            assert found == {Outcome.BALANCED: 0, Outcome.DISPLACED: 3}.get(outcome, -1)


def test_the_angle_of_no_return_is_past_every_edge() -> None:
    assert no_return_tilt(np.array([0.2, 0.5, 0.3]), 1.0) == 0.5
    assert no_return_tilt(np.array([0.2, 1.2]), 1.0) == 1.0
