"""Equations of archives: their limit, their symmetries, and runs and equations of others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.stages.archive import shipped_equations
from vsr_core.archive import boundaries, profiles, shapes
from vsr_core.archive.equations import Equations
from vsr_core.archive.profiles import Profiles
from vsr_core.arrays import Array
from vsr_core.judge.proofs import barrier
from vsr_core.rock.body import Rock
from vsr_core.run.cases import prepare
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.scene import Contact, Scene
from vsr_core.verification import rocks

FRICTION = 0.7


@pytest.fixture(scope="module")
def equations() -> Equations:
    return shipped_equations.load().equations


def some(number: int, size: float = 1.0) -> Profiles:
    """Rocks within the range of the equations."""
    random = np.random.default_rng(5)
    tan_alpha = random.uniform(0.08, 0.6, (number, 2))
    radius = size * random.uniform(0.3, 3.0, number)[:, None] * np.hypot(1.0, tan_alpha)
    inertia = random.uniform(0.25, 0.4, number) * radius.prod(axis=1)
    roundness = random.uniform(0.0, 0.3, number)
    return Profiles(tan_alpha, radius, inertia, roundness, random.uniform(0.65, 1.0, number))


def by_hand() -> Rock:
    """A rock of eleven corners, none of them drawn."""
    foot = [[-0.22, -0.3, 0], [0.22, -0.3, 0], [0.22, 0.3, 0], [-0.22, 0.3, 0]]
    body = [[-0.35, -0.3, 0.6], [0.5, -0.35, 0.7], [0.45, 0.3, 0.8], [-0.3, 0.35, 0.5]]
    top = [[-0.1, -0.1, 1.4], [0.25, 0.0, 1.5], [0.1, 0.2, 1.3]]
    return rocks.hull(np.array([*foot, *body, *top]))


def runs_and_equations(
    rock: Rock, equations: Equations, ratio: Array, edge: float = 0.0
) -> tuple[Array, Array, Array]:
    """Boundaries by runs and by the equations in both directions [g], and the told error."""
    seen = profiles.of_rock(rock, FRICTION, edge)
    found = []
    for yaw, profile in ((0.0, seen), (math.pi, seen.mirrored())):
        case = prepare(Scene(rock, Contact(FRICTION), yaw), barrier(rock), reduce=True)
        run = boundaries.resolved(case, profile, ratio, "")
        by_equations = equations.boundary(profile, ratio)
        told, _ = equations.told_error(profile, ratio, by_equations)
        found.append((np.sqrt(run.stands * run.topples), by_equations, told))
    first, other = found
    return tuple(np.concatenate(pair) for pair in zip(first, other, strict=True))  # type: ignore[return-value]


def test_long_pulses_topple_at_housners_limit(equations: Equations) -> None:
    rocks = some(300)
    static = np.minimum(*rocks.tan_alpha.T)
    far, farther = (equations.boundary(rocks, np.array([x]))[:, 0] for x in (1e6, 1e9))
    assert (far > static).all()
    assert far == pytest.approx(static, rel=1e-4)
    assert farther == pytest.approx(static, rel=1e-7)


def test_a_rock_of_four_times_the_size_needs_pulses_of_twice_the_length(
    equations: Equations,
) -> None:
    ratio = np.geomspace(0.05, 0.8, 9)
    small, large = some(100), some(100, size=4.0)
    assert equations.boundary(large, 2.0 * ratio) == pytest.approx(
        equations.boundary(small, ratio), rel=1e-9
    )


def test_a_uniform_block_is_housners() -> None:
    block = Block(0.2, 0.6)
    seen = profiles.of_rock(rocks.box(0.4, 0.5, 1.2), FRICTION)
    assert np.arctan(seen.tan_alpha) == pytest.approx(block.alpha)
    assert seen.p == pytest.approx(block.p)
    assert float(seen.kept) == pytest.approx(block.impact_ratio**2)


def test_a_rock_turned_round_is_its_mirror_image() -> None:
    rock = by_hand()
    seen = profiles.of_rock(rock, FRICTION)
    round_about = profiles.of_rock(shapes.turned(rock, math.pi), FRICTION)
    assert round_about.tan_alpha == pytest.approx(seen.mirrored().tan_alpha)
    assert round_about.p == pytest.approx(seen.mirrored().p)
    assert float(round_about.kept) == pytest.approx(float(seen.kept))
    assert seen.tan_alpha[0] != pytest.approx(seen.tan_alpha[1])


@pytest.mark.slow
@pytest.mark.parametrize("half_width", [0.08, 0.2])
def test_the_equations_are_housners_equation_integrated(
    equations: Equations, half_width: float
) -> None:
    block = Block(half_width, 0.8)
    inertia = np.array(block.radius**2 / 3.0)
    both = np.full(2, half_width / 0.8)
    rock = Profiles(both, np.full(2, block.radius), inertia, np.array(0.0), np.array(1.0))
    ratio = np.array([0.15, 0.2, 0.3, 0.45, 0.7])
    exact = np.array(
        [first_overturning_pga(block, x, 6 * block.uplift, 0.02 * block.uplift) for x in ratio]
    )
    found = equations.boundary(rock, ratio)
    off = np.abs(np.log(found / (exact / block.gravity)))
    assert np.isfinite(exact).all()
    assert (off < equations.told_error(rock, ratio, found)[0]).all()


def test_a_box_of_known_size_topples_where_the_equations_say(equations: Equations) -> None:
    rock = rocks.box(0.45, 0.8, 1.5)
    run, found, told = runs_and_equations(rock, equations, np.array([0.12, 0.2, 0.3, 0.5]))
    assert (np.abs(np.log(found / run)) < told).all()
    assert np.median(np.abs(np.log(found / run))) < 0.05


def test_a_rock_that_was_not_drawn_topples_where_the_equations_say(equations: Equations) -> None:
    rock = by_hand()
    assert boundaries.is_within(profiles.of_rock(rock, FRICTION))
    run, found, told = runs_and_equations(rock, equations, np.array([0.15, 0.25, 0.4, 0.6]))
    assert (np.abs(np.log(found / run)) < told).mean() >= 0.75
    assert np.median(np.abs(np.log(found / run))) < 0.05


@pytest.mark.slow
def test_every_shape_that_is_drawn_stands_flat_and_is_drawn_again() -> None:
    one, other = (boundaries.of_number(2) for _ in range(2))
    assert [r.family for r in one] == ["hull", "hull"]
    for first, second in zip(one, other, strict=True):
        assert first.stands.tobytes() == second.stands.tobytes()
        resolved = np.isfinite(first.topples)
        assert (first.stands < first.topples)[resolved].all()
        width = np.log(first.topples / first.stands)[resolved]
        assert width.max() < 0.012
        # the first step of the ladder is below g tan(alpha), where nothing topples
        assert (first.stands > 0.97 * first.profile.weakest).all()


def test_the_shipped_covariance_is_one(equations: Equations) -> None:
    size = equations.coefficients.size
    assert equations.covariance.shape == (size, size)
    spread = np.sqrt(np.diag(equations.covariance))
    shape = equations.covariance / np.outer(spread, spread)
    assert np.linalg.eigvalsh(shape).min() > -1e-3  # written to four digits
    sd = equations.coefficient_sd(some(50), np.array([0.2, 0.4]))
    assert (sd > 0.0).all()
    assert sd.max() < 0.3
