"""Runs against Housner's block, Coulomb's law, and the symmetries of mechanics."""

from __future__ import annotations

import math
import types
from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support.sliding import rigid_plastic_slip

from vsr_core import GRAVITY, engines
from vsr_core.engines.bullet import SOLVER
from vsr_core.engines.interface import Solver
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome, Response
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import rocking_block
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.loop import HALVINGS
from vsr_core.run.overturning import simulate
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene, State, resting
from vsr_core.surrogates.double_rock import double_rock

Array = NDArray[np.float64]
GRIPPING, PAPER = 10.0, 0.6

# First overturning PGAs of PHYSICS.md by PGV/PGA [s]; those where four or more impacts decide
# apart, and those that 1.5 g does not overturn.
BLOCKS = {
    "1x1x2": ((1.0, 1.0, 2.0), (0.15, 0.20, 0.25)),
    "0.5x0.5x1": ((0.5, 0.5, 1.0), (0.10, 0.15)),
    "1x1x3": ((1.0, 1.0, 3.0), (0.15, 0.20, 0.25)),
    "11x55 cm": ((0.11, 0.11, 0.55), (0.05, 0.10)),
}
TABLE = [(name, ratio) for name, (_, ratios) in BLOCKS.items() for ratio in ratios]
MANY_IMPACTS = {
    "1x1x2": {0.35: 0.59, 0.50: 0.57, 0.80: 0.54},
    "0.5x0.5x1": {0.20: 0.61, 0.25: 0.59, 0.35: 0.57, 0.50: 0.55, 0.80: 0.53},
    "1x1x3": {0.35: 0.40, 0.50: 0.38, 0.80: 0.37},
    "11x55 cm": {0.15: 0.235, 0.20: 0.225, 0.35: 0.215},
}


@cache
def rock_of(
    size: tuple[float, float, float] | str, density: float = 2110.0
) -> tuple[Rock, Barrier]:
    if isinstance(size, str):
        mesh = trimesh.Trimesh(*double_rock(), process=False)
        rock = solid.from_mesh(mesh, density).rock
    else:
        rock = solid.box(size, density).rock
    return rock, barrier(rock)


@cache
def case_of(
    size: tuple[float, float, float] | str,
    friction: float = PAPER,
    yaw: float = 0.0,
    density: float = 2110.0,
    restitution: float = 0.0,
) -> Case:
    rock, limits = rock_of(size, density)
    return prepare(Scene(rock, Contact(friction, restitution), yaw), limits, reduce=True)


def run(case: Case, pga_g: float, ratio: float, *, reduce: bool = True) -> Response:
    step = 0.002 * step_unit(case.full.rock)
    return simulate(case, CosinePulse.from_g(pga_g, ratio), Settings(step, reduce=reduce))


def first_overturned(case: Case, ratio: float, levels: Array) -> float:
    """The first of ``levels`` [g] that overturns."""
    return next(
        (float(a) for a in levels if run(case, float(a), ratio).outcome is Outcome.OVERTURNED),
        math.inf,
    )


def housner(size: tuple[float, float, float], ratio: float) -> float:
    block = rocking_block.Block(0.5 * size[0], 0.5 * size[2])
    step = 0.0025 * GRAVITY
    return rocking_block.first_overturning_pga(block, ratio, 1.5 * GRAVITY, step) / GRAVITY


def against_housner(name: str, ratio: float, friction: float, steps: int) -> float:
    """Ratio of the first overturning PGAs, scanned from 3 % below the reference to 2 % above."""
    size = BLOCKS[name][0]
    expected = housner(size, ratio)
    levels = expected * np.linspace(0.97, 1.02, steps)
    return first_overturned(case_of(size, friction), ratio, levels) / expected


@pytest.mark.parametrize(
    ("name", "ratio", "friction"),
    [
        ("1x1x2", 0.15, PAPER),
        ("1x1x2", 0.25, GRIPPING),
        ("0.5x0.5x1", 0.10, PAPER),
        ("1x1x3", 0.20, PAPER),
        ("11x55 cm", 0.10, PAPER),
    ],
)
def test_first_overturning_pga_is_housners(name: str, ratio: float, friction: float) -> None:
    assert against_housner(name, ratio, friction, 13) == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [PAPER, GRIPPING])
@pytest.mark.parametrize(("name", "ratio"), TABLE)
def test_first_overturning_pga_over_the_table(name: str, ratio: float, friction: float) -> None:
    """And nothing below it: none of 60 levels from the uplift on."""
    size = BLOCKS[name][0]
    expected = housner(size, ratio)
    assert against_housner(name, ratio, friction, 101) == pytest.approx(1.0, abs=0.01)
    below = np.linspace(size[0] / size[2], 0.97 * expected, 60)
    assert first_overturned(case_of(size, friction), ratio, below) == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("friction", [PAPER, GRIPPING])
@pytest.mark.parametrize(
    ("name", "ratio"), [(name, ratio) for name, row in MANY_IMPACTS.items() for ratio in row]
)
def test_first_overturning_pga_after_many_impacts(name: str, ratio: float, friction: float) -> None:
    """To 0.03 g, on the table's own grid."""
    levels = np.arange(0.3 if name != "11x55 cm" else 0.18, 0.8, 0.005)
    found = first_overturned(case_of(BLOCKS[name][0], friction), ratio, levels)
    assert found == pytest.approx(MANY_IMPACTS[name][ratio], abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["1x1x2", "1x1x3"])
def test_short_pulses_do_not_overturn_large_blocks(name: str) -> None:
    levels = np.arange(0.3, 1.5, 0.01)
    assert first_overturned(case_of(BLOCKS[name][0], GRIPPING), 0.10, levels) == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("friction", [GRIPPING])
def test_safe_island_inside_the_toppled_zone(friction: float) -> None:
    """1x1x2 m at 0.30 s is safe on [1.26, 1.36) g, to 1 % of either end."""
    case = case_of((1.0, 1.0, 2.0), friction)
    levels = np.linspace(1.22, 1.40, 46)
    over = np.array([run(case, a, 0.30).outcome is Outcome.OVERTURNED for a in levels])
    block = rocking_block.Block(0.5, 1.0)
    pieces = rocking_block.overturning_intervals(block, 0.30, 1.4 * GRAVITY, 0.02 * GRAVITY)
    begin, end = pieces[-2][1] / GRAVITY, pieces[-1][0] / GRAVITY
    assert 1.25 < begin <= 1.26
    assert 1.35 < end <= 1.36
    safe = levels[~over]
    assert over[0]
    assert over[-1]
    assert safe.size == np.ptp(np.nonzero(~over)[0]) + 1
    assert safe[0] == pytest.approx(begin, rel=0.01)
    assert safe[-1] == pytest.approx(end, rel=0.01)


def grid(seed: int, count: int, low: float, high: float) -> list[tuple[float, float]]:
    """Random PGA [g] and PGV/PGA [s]."""
    rng = np.random.default_rng(seed)
    pga, ratio = rng.uniform(low, high, count), np.exp(rng.uniform(np.log(0.08), 0.0, count))
    return list(zip(pga.tolist(), ratio.tolist(), strict=True))


def test_similar_blocks_move_alike() -> None:
    """Half the size in 1/sqrt(2) of the time: equal to rounding, whatever the engine's scale."""
    large, small = case_of((1.0, 1.0, 2.0)), case_of((0.5, 0.5, 1.0))
    ended = set()
    for pga, ratio in grid(1, 40, 0.5, 1.2):
        one, other = run(large, pga, ratio), run(small, pga, ratio / math.sqrt(2.0))
        assert one.outcome is other.outcome
        assert one.steps == other.steps
        assert one.peak_tilt == pytest.approx(other.peak_tilt, abs=1e-6)
        assert one.slip == pytest.approx(2.0 * other.slip, abs=1e-6)
        ended.add(one.outcome)
    assert Outcome.OVERTURNED in ended
    assert len(ended) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.15, pytest.param(0.25, marks=pytest.mark.slow)])
def test_depth_does_not_matter(ratio: float) -> None:
    """1x1x3 m and 1x2x3 m overturn at the same PGA."""
    expected = housner((1.0, 1.0, 3.0), ratio)
    levels = expected * np.linspace(0.97, 1.03, 31)
    one = first_overturned(case_of((1.0, 1.0, 3.0)), ratio, levels)
    other = first_overturned(case_of((1.0, 2.0, 3.0)), ratio, levels)
    assert one == pytest.approx(other, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "low", "high"), [((1.0, 1.0, 2.0), 0.5, 1.2), ("surrogate", 0.05, 0.6)]
)
def test_mirrored_motion_is_a_rock_turned_round(
    size: tuple[float, float, float] | str, low: float, high: float
) -> None:
    ahead, turned = case_of(size, PAPER, 0.4), case_of(size, PAPER, 0.4 + math.pi)
    assert ahead.static_limits == pytest.approx(
        (-turned.static_limits[1], -turned.static_limits[0])
    )
    ended = []
    for pga, ratio in grid(2, 16, low, high):
        one, other = run(ahead, pga, ratio), run(turned, -pga, ratio)
        assert one.outcome is other.outcome, (pga, ratio, one, other)
        ended.append(one.outcome.overturned)
    assert 2 <= sum(ended) <= 14


@pytest.mark.slow
def test_opposite_directions_of_an_asymmetric_rock_differ() -> None:
    ahead = case_of("surrogate", PAPER, 0.0)
    cells = grid(3, 30, 0.05, 0.4)
    forth = [run(ahead, pga, ratio).outcome.overturned for pga, ratio in cells]
    back = [run(ahead, -pga, ratio).outcome.overturned for pga, ratio in cells]
    assert forth != back


def test_a_run_knows_nothing_of_the_runs_before() -> None:
    """Bit for bit the same in any order, after other scenes, and at another step between."""
    cases = [case_of((1.0, 1.0, 2.0)), case_of("surrogate", PAPER, 0.4), case_of((0.3, 0.4, 1.0))]
    cells = [(case, pga, ratio) for case in cases for pga, ratio in grid(4, 4, 0.2, 0.9)]
    inorder = [run(*cell) for cell in cells]
    order = np.random.default_rng(4).permutation(len(cells))
    shuffled = {int(i): run(*cells[i]) for i in order}
    assert [shuffled[i] for i in range(len(cells))] == inorder
    for case in cases:
        simulate(case, CosinePulse.from_g(1.0, 0.3), Settings(0.002, reduce=False))
    assert [run(*cell) for cell in reversed(cells)] == inorder[::-1]
    assert {response.outcome.overturned for response in inorder} == {0, 1}


@pytest.mark.parametrize("ratio", [0.15, 0.3, 0.8])
def test_a_block_slides_where_friction_is_below_its_slenderness(ratio: float) -> None:
    """Friction 0.3 is less than tan(alpha) = 1/2: no PGA to 1.1 g topples it, strong ones slide."""
    case = case_of((1.0, 1.0, 2.0), 0.3)
    for pga in (0.35, 0.6, 0.85, 1.1):
        response = run(case, pga, ratio)
        assert response.outcome.overturned == 0
        assert response.peak_tilt < 0.02
    assert response.outcome is Outcome.DISPLACED
    assert response.slip > DISPLACED_SHARE * case.full.rock.radius


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_sliding_starts_at_friction_times_gravity(friction: float) -> None:
    case = case_of((1.0, 1.0, 2.0), friction)
    assert case.static_limits == pytest.approx((-friction * GRAVITY, friction * GRAVITY))
    below = run(case, 0.99 * friction, 0.5, reduce=False)
    above = run(case, 1.05 * friction, 0.5, reduce=False)
    # Bullet solves friction to a share of the speed that gravity gives in a step: it may creep.
    step = 0.002 * step_unit(case.full.rock)
    assert below.slip < SOLVER.residual * GRAVITY * step * CosinePulse(1.0, 0.5).duration
    assert above.slip > 1e-3
    proved = run(case, 0.99 * friction, 0.5)
    assert (proved.outcome, proved.decided_by, proved.steps) == (
        Outcome.BALANCED,
        DecidedBy.NO_UPLIFT_BOUND,
        0,
    )


@pytest.mark.parametrize(("pga", "ratio"), [(0.5, 0.3), (0.9, 0.2), (0.4, 0.8)])
def test_slip_of_a_squat_block(pga: float, ratio: float) -> None:
    case = case_of((2.0, 2.0, 0.5), 0.3)
    response = run(case, pga, ratio, reduce=False)
    expected = rigid_plastic_slip(CosinePulse.from_g(pga, ratio), 0.3)
    assert response.slip == pytest.approx(expected, rel=0.02)
    assert response.peak_tilt < 0.01


@pytest.mark.parametrize("engine", ["nonsmooth", "bullet"])
@pytest.mark.parametrize(("pga", "ratio"), [(0.5, 0.22), (0.9, 0.12)])
def test_a_block_is_displaced_beyond_a_tenth_of_its_radius(
    engine: str, pga: float, ratio: float
) -> None:
    """Blocks of two sizes, of whose radius a sliding mass slides 9 and 11 %."""
    slip = rigid_plastic_slip(CosinePulse.from_g(pga, ratio), 0.3)
    for share, outcome in ((0.09, Outcome.BALANCED), (0.11, Outcome.DISPLACED)):
        width = 2.0 * slip / share / math.sqrt(2.0 + 0.25**2)  # its radius: half the diagonal
        case = case_of((width, width, 0.25 * width), 0.3)
        settings = Settings(0.002 * step_unit(case.full.rock), engine=engine)
        response = simulate(case, CosinePulse.from_g(pga, ratio), settings)
        assert response.outcome is outcome


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["nonsmooth", "bullet"])
def test_a_block_that_hesitates_on_its_edge_is_not_at_rest(engine: str) -> None:
    """Let go 4 mrad before its balance, its angle to that grows as cosh(p t), p^2 = 3 g / (4 R).

    For 0.4 sqrt(R/g) it has less energy than a rock at rest may have, but creeps: by 1.2 times
    what that may by 0.2 sqrt(R/g), and by 2.4 times by the 0.28 for which it is watched.
    """
    case = case_of((1.0, 1.0, 3.0))
    lean = math.atan(1.0 / 3.0) - 0.004
    turn = Rotation.from_euler("y", lean).as_matrix()
    place = np.array([0.5, 0.0, 0.0]) + turn @ [-0.5, 0.0, 1.5]
    start = State(place, turn, np.zeros(3), np.zeros(3))
    leaning = prepare(replace(case.full, start=start), case.limits, reduce=False)
    settings = Settings(0.002 * step_unit(case.full.rock), reduce=False, engine=engine)
    response = simulate(leaning, CosinePulse(1e-6, 5e-4), settings)
    assert response.outcome is Outcome.BALANCED
    assert response.peak_tilt == pytest.approx(lean, abs=1e-3)
    assert response.final_tilt < 0.001


def test_density_does_not_matter() -> None:
    light, heavy = case_of((1.0, 1.0, 2.0), density=30.0), case_of((1.0, 1.0, 2.0), density=9000.0)
    for pga, ratio in grid(6, 20, 0.5, 1.2):
        one, other = run(light, pga, ratio), run(heavy, pga, ratio)
        assert one.outcome is other.outcome
        assert one.peak_tilt == pytest.approx(other.peak_tilt, abs=1e-4)


def lifted(scene: Scene, step: float, height: float):  # type: ignore[no-untyped-def]
    """A world whose rock hangs ``height`` [m] above its rest pose."""
    world = engines.load("bullet").build(scene, step, 1)
    rest = resting(scene)
    world.put(replace(rest, position=rest.position + np.array([0.0, 0.0, height])))
    return world


@pytest.mark.parametrize("restitution", [0.0, 0.38, 0.8])
@pytest.mark.parametrize("height", [0.4, 0.40009, 0.40018])
def test_falls_freely_and_bounces_to_the_square_of_the_restitution(
    restitution: float, height: float
) -> None:
    """From heights that differ by a third of a step's fall: at any phase of a step."""
    rock, _ = rock_of((1.0, 1.0, 0.5))
    step = 1e-4
    world = lifted(Scene(rock, Contact(0.6, restitution)), step, height)
    duration = math.sqrt(2.0 * height / GRAVITY)
    steps = int(0.9 * duration / step)
    world.advance([0.0] * steps)
    fallen = 0.5 * GRAVITY * (steps * step) ** 2
    start = rock.height + height
    # Bullet's step is symplectic Euler: late by half a step.
    assert start - world.state().position[2] == pytest.approx(fallen, rel=1.5 * step / duration)
    assert world.state().velocity[2] == pytest.approx(-GRAVITY * steps * step, rel=1e-6)
    impact, rising, heights = 0.0, False, []
    for _ in range(int(2.0 * duration / step)):
        world.advance([0.0])
        state = world.state()
        impact, rising = min(impact, state.velocity[2]), rising or state.velocity[2] > 1e-6
        if rising and state.velocity[2] < 0.0:
            break
        if rising or state.position[2] <= rock.height:
            heights.append(state.position[2] - rock.height)
    assert impact == pytest.approx(-math.sqrt(2.0 * GRAVITY * height), rel=step / duration)
    # Bullet mends what the impact penetrated, at most a step's fall, by speed: 0.005 of the impact
    # speed where contacts bounce, 0.08 where they do not, which lifts by 0.6 % of the height.
    more = 0.005 if restitution else 0.08
    assert max(heights) >= restitution**2 * height - 2.0 * abs(impact) * step
    assert max(heights) <= (restitution + more) ** 2 * height + abs(impact) * step


@pytest.mark.parametrize("friction", [0.0, 0.25, 0.6])
def test_pair_friction_arrives_in_the_engine(friction: float) -> None:
    """Steady shaking beyond mu g leaves (a - mu g) t; the mass of the rock does not matter."""
    rock, _ = rock_of((2.0, 2.0, 0.5))
    step, duration, push = 5e-4, 0.5, 1.5 * GRAVITY
    world = engines.load("bullet").build(Scene(rock, Contact(friction)), step, 1)
    world.advance([push] * round(duration / step))
    expected = -(push - friction * GRAVITY) * duration
    assert world.state().velocity[0] == pytest.approx(expected, rel=0.005)


@pytest.mark.parametrize("offset", [0.0, 0.05, 0.1])
@pytest.mark.parametrize("size", [(1.0, 1.0, 2.0), (0.1, 0.1, 0.2)])
def test_rolling_friction_is_a_length(size: tuple[float, float, float], offset: float) -> None:
    """It shifts the contact force outwards: a block lifts at (b + offset) / h, at any mass."""
    rock, _ = rock_of(size)
    offset *= size[0]
    lifts = (0.5 * size[0] + offset) / (0.5 * size[2])
    step = 0.002 * step_unit(rock)
    tilts = []
    for share in (0.98, 1.02):
        scene = Scene(rock, Contact(GRIPPING, 0.0, offset))
        world = engines.load("bullet").build(scene, step, 1)
        world.advance([share * lifts * GRAVITY] * 300)
        tilts.append(math.acos(min(1.0, world.state().rotation[2, 2])))
    assert tilts[0] < 1e-5
    assert tilts[1] > 1e-3


class Fake:
    """A world told where its rock is at each look; counts the worlds built."""

    VERSION = "0"

    def __init__(self, story) -> None:  # type: ignore[no-untyped-def]
        self.story = story
        self.time_steps: list[float] = []

    def build(
        self, scene: Scene, time_step: float, substeps: int, solver: Solver | None = None
    ) -> Fake:
        self.time_steps.append(time_step)
        self.steps, self.height = 0, scene.rock.height
        return self

    def advance(self, acceleration: Iterable[float]) -> None:
        self.steps += len(list(acceleration))

    def state(self) -> State:
        rest = State(np.array([0.0, 0.0, self.height]), np.eye(3), np.zeros(3), np.zeros(3))
        return replace(rest, **self.story(self)) if self.steps > 100 else rest


def with_engine(monkeypatch: pytest.MonkeyPatch, story) -> tuple[Fake, Response, Case]:  # type: ignore[no-untyped-def]
    fake = Fake(story)
    monkeypatch.setattr(engines, "load", lambda name: types.SimpleNamespace(build=fake.build))
    case = case_of((1.0, 1.0, 2.0))
    return fake, run(case, 0.8, 0.3), case


@pytest.mark.filterwarnings("ignore:invalid value encountered")
@pytest.mark.parametrize(
    "story",
    [
        lambda world: {"position": np.array([0.0, 0.0, math.nan])},
        lambda world: {"angular_velocity": np.array([math.inf, 0.0, 0.0])},
        lambda world: {"velocity": np.array([0.0, 0.0, 50.0])},
        lambda world: {"position": np.array([0.0, 0.0, 9.0])},
        lambda world: {"position": np.array([0.0, 0.0, 0.9])},
    ],
    ids=[
        "nan",
        "infinite angular velocity",
        "gained speed",
        "gained height",
        "sunk into the pedestal",
    ],
)
def test_a_world_that_breaks_the_guards_is_unstable(monkeypatch: pytest.MonkeyPatch, story) -> None:  # type: ignore[no-untyped-def]
    """Tried at half the step five times, then said so; never counted as balanced."""
    fake, response, _ = with_engine(monkeypatch, story)
    assert response.outcome is Outcome.UNSTABLE
    assert response.outcome.overturned == -1
    assert len(fake.time_steps) == HALVINGS + 1 == 6
    ratios = np.array(fake.time_steps[:-1]) / np.array(fake.time_steps[1:])
    np.testing.assert_allclose(ratios, 2.0, rtol=0.02)  # a whole number of steps fills the pulse


def test_a_guard_that_holds_at_a_finer_step_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    def until_fine(world: Fake) -> dict[str, Array]:
        coarse = len(world.time_steps) < 3
        return {"velocity": np.array([0.0, 0.0, 99.0 if coarse else 0.0])}

    fake, response, _ = with_engine(monkeypatch, until_fine)
    assert len(fake.time_steps) == 3
    assert response.outcome is Outcome.BALANCED


def test_a_rock_still_rocking_when_time_is_up_is_undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enough energy to cross the barrier, at every look, to the end."""
    _, response, case = with_engine(
        monkeypatch, lambda world: {"velocity": np.array([0.0, 2.0, 0.0])}
    )
    assert GRAVITY * (case.limits.edge_height - case.full.rock.height) < 0.5 * 2.0**2
    assert response.outcome is Outcome.UNSETTLED
    assert response.outcome.overturned == -1


def test_outcome_codes() -> None:
    """Stored values: never renumbered; only three of them say which side the rock is on."""
    assert [int(outcome) for outcome in Outcome] == [0, 1, 2, 3, 4, 5]
    sides = {outcome.name: outcome.overturned for outcome in Outcome}
    assert sides == {
        "BALANCED": 0,
        "OVERTURNED": 1,
        "DISPLACED": 0,
        "UNSETTLED": -1,
        "UNSTABLE": -1,
        "CRASHED": -1,
    }
