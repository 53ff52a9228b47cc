"""Runs on a terrain that end out of it, or of which a world breaks the guards."""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest
from support import grounds

from tests.support.rocks_on_ground import Array, ground_of, run, site_of, usual
from vsr_core import GRAVITY, engines
from vsr_core.engines.interface import Solver
from vsr_core.judge import on_terrain
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome, StopReason
from vsr_core.rock import solid
from vsr_core.run import displacement
from vsr_core.run.cases import Settings
from vsr_core.run.displacement import DisplacementRun
from vsr_core.run.loop import HALVINGS
from vsr_core.scene import Scene, State


@pytest.mark.parametrize(("engine", "pga"), [("bullet", 0.6), ("nonsmooth", 1.8)])
def test_leaves_a_small_terrain(engine: str, pga: float) -> None:
    """Sliding off a table top is no toppling, and falling off its end is no rest.

    In compiled runs a border holds nothing: the block has to be fast not to sink meanwhile.
    """
    block = solid.box((0.6, 0.6, 0.3), 2000.0).rock
    small = grounds.level(0.8, 4)
    for yaw in (0.0, 1.2):
        found = run(grounds.site(block, small, friction=0.02, yaw=yaw), pga, 0.5, engine)
        path = found.trajectory
        assert found.stop is StopReason.LEFT_TERRAIN
        assert found.response.outcome is Outcome.UNSETTLED
        over = np.abs(path.position[-1, :2]).max() - 0.8
        late = (on_terrain.BORDER_INTERVALS + 1) * on_terrain.MONITORING_TIME
        assert 0.0 < over < path.largest_speed * late


def test_slides_on_until_time_is_up() -> None:
    block = solid.box((0.6, 0.6, 0.3), 2000.0).rock
    start = replace(grounds.at_rest(block.height), velocity=np.array([0.2, 0.0, 0.0]))
    site = grounds.site(block, ground_of("level parts"), friction=0.0, start=start)
    found = displacement.displace(site, CosinePulse.from_g(1e-6, 0.05), Settings(0.002))
    assert (found.stop, found.response.outcome) == (StopReason.TIME, Outcome.UNSETTLED)
    path = found.trajectory
    assert path.time[-1] == pytest.approx(on_terrain.LONGEST_TIME + 0.1 * math.pi, abs=0.05)
    assert path.velocity[-1] == pytest.approx([0.2, 0.0, 0.0], abs=0.01)


class Fake:
    """A ground world told where its rock is at each look."""

    VERSION = "0"

    def __init__(self, story: Callable[[Fake], dict[str, Array | float]]) -> None:
        self.story = story
        self.time_steps: list[float] = []

    def build(
        self, scene: Scene, time_step: float, substeps: int, solver: Solver | None = None
    ) -> Fake:
        self.time_steps.append(time_step)
        self.interval, self.time = time_step * substeps, 0.0
        assert scene.start is not None
        self.start = scene.start
        return self

    def advance(self, acceleration: Iterable[float]) -> None:
        self.time += len(list(acceleration)) * self.interval

    def now(self) -> dict[str, Array | float]:
        return self.story(self) if self.time > 0.5 else {}

    def state(self) -> State:
        return replace(self.start, **{k: v for k, v in self.now().items() if k != "deep"})

    def put(self, state: State) -> None:
        raise AssertionError

    def contacts(self) -> tuple[int, float]:
        return 4, float(self.now().get("deep", 0.0))


STORIES: dict[str, Callable[[Fake], dict[str, Array | float]]] = {
    "x is no number": lambda world: {"position": np.array([math.nan, 0.0, 0.5])},
    "z is no number": lambda world: {"position": np.array([0.0, 0.0, math.nan])},
    "no rotation": lambda world: {"rotation": np.full((3, 3), math.nan)},
    "infinite angular velocity": lambda world: {"angular_velocity": np.array([math.inf, 0.0, 0.0])},
    "gained speed": lambda world: {"velocity": np.array([0.0, 0.0, 50.0])},
    "gained height": lambda world: {"position": np.array([0.0, 0.0, 9.0])},
    "through the ground": lambda world: {"position": np.array([0.0, 0.0, -0.1])},
    "deep in the ground": lambda world: {"deep": 0.1},
}


def faked(
    monkeypatch: pytest.MonkeyPatch, story: str | Callable[..., object]
) -> tuple[Fake, DisplacementRun]:
    fake = Fake(STORIES[story] if isinstance(story, str) else story)  # type: ignore[arg-type]
    site = site_of("box", "level")
    monkeypatch.setattr(engines, "load", lambda name: types.SimpleNamespace(build=fake.build))
    return fake, displacement.displace(site, CosinePulse.from_g(0.5, 0.3), usual(site.seat.rock))


@pytest.mark.parametrize("story", STORIES)
def test_a_world_that_breaks_the_guards_is_unstable(
    monkeypatch: pytest.MonkeyPatch, story: str
) -> None:
    """Tried at half the step five times, then said so; what was sound before stays to be seen."""
    fake, found = faked(monkeypatch, story)
    assert (found.response.outcome, found.stop) == (Outcome.UNSTABLE, StopReason.UNDONE)
    assert len(fake.time_steps) == HALVINGS + 1
    ratios = np.array(fake.time_steps[:-1]) / np.array(fake.time_steps[1:])
    np.testing.assert_allclose(ratios, 2.0, rtol=0.02)
    path = found.trajectory
    for array in (path.time, path.position, path.quaternion, path.velocity, path.angular_velocity):
        assert np.isfinite(array).all()


@pytest.mark.parametrize("look", range(4))
def test_what_sinks_into_the_ground_has_not_toppled(
    monkeypatch: pytest.MonkeyPatch, look: int
) -> None:
    """At whatever look: only every eighth is a close one."""

    def sunk(world: Fake) -> dict[str, Array]:
        down = world.time > 0.6 + look * on_terrain.MONITORING_TIME
        return {"position": np.array([0.0, 0.0, -0.1])} if down else {}

    _, found = faked(monkeypatch, sunk)
    assert (found.response.outcome, found.stop) == (Outcome.UNSTABLE, StopReason.UNDONE)
    site = site_of("box", "level")
    alone = displacement.respond(site, CosinePulse.from_g(0.5, 0.3), usual(site.seat.rock))
    assert alone.outcome is Outcome.UNSTABLE


def test_creeping_is_no_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slow enough for the kinetic energy of a rest, and yet under way."""
    site = site_of("box", "level")
    start = site.seat.start
    assert start is not None

    def creeps(world: Fake) -> dict[str, Array]:
        velocity = np.array([0.01, 0.0, 0.0])
        return {"position": start.position + velocity * world.time, "velocity": velocity}

    _, found = faked(monkeypatch, creeps)
    assert (found.response.outcome, found.stop) == (Outcome.UNSETTLED, StopReason.TIME)


def test_a_guard_that_holds_at_a_finer_step_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    def until_fine(world: Fake) -> dict[str, Array]:
        coarse = len(world.time_steps) < 3
        return {"velocity": np.array([0.0, 0.0, 99.0 if coarse else 0.0])}

    fake, found = faked(monkeypatch, until_fine)
    assert len(fake.time_steps) == 3
    assert (found.response.outcome, found.stop) == (Outcome.BALANCED, StopReason.REST)


def test_what_a_shake_can_give_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """As fast as the table may have made it: PGV forth and back, twice."""
    most = 4.0 * 0.5 * GRAVITY * 0.3

    def fast(world: Fake) -> dict[str, Array]:
        over = world.time > 0.98 * 2.0 * math.pi * 0.3
        return {"velocity": np.array([0.97 * most if over else 0.0, 0.0, 0.0])}

    _, found = faked(monkeypatch, fast)
    assert (found.response.outcome, found.stop) == (Outcome.UNSETTLED, StopReason.TIME)
