"""The time step that the scene itself asks for: what is measured, and what is chosen from it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import grounds
from support.sliding import rigid_plastic_slip

from vsr_core import GRAVITY
from vsr_core.engines import load
from vsr_core.judge import proofs
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import DecidedBy, Outcome, Response
from vsr_core.rock import solid
from vsr_core.run import displacement, time_step
from vsr_core.run.agreement import OFFSETS, WORST, Answer, rocking_block
from vsr_core.run.cases import Case, Settings, TerrainCase, prepare
from vsr_core.run.rocking_block import Block, first_overturning_pga, rocking_response
from vsr_core.run.time_step import (
    Boundary,
    Front,
    Row,
    choose,
    enough,
    front,
    lots,
    measure,
    measure_on_seat,
)
from vsr_core.scene import Contact, Scene
from vsr_core.table import servo
from vsr_core.verification import work_precision
from vsr_core.verification.work_precision import Score, Target


def box(size: tuple[float, float, float], contact: Contact, yaw: float = 0.0) -> Case:
    rock = solid.box(size, 2110.0).rock
    return prepare(Scene(rock, contact, yaw), proofs.barrier(rock), reduce=True)


SLENDER = box((1.0, 1.0, 3.0), Contact(0.6))

LADDER = load("bullet").LADDER
SHARES = LADDER.shares


def hull(still: float) -> Case:
    """A case that no equation answers; ``still`` [m/s^2] is what it bears for certain."""
    shapes = replace(SLENDER.full.rock, shape="hull")
    return replace(SLENDER, full=replace(SLENDER.full, rock=shapes), static_limits=(-still, still))


def ending(outcome: Outcome) -> Response:
    return Response(outcome, DecidedBy.SIMULATION, 0.0, 0.0, 0.0, 5)


@pytest.mark.slow
def test_error_stated_holds_on_pulses_that_were_not_tried() -> None:
    """Beyond the error of a step, up to its window, outcomes are Housner's: one swing decides."""
    ratio = 0.45 * time_step.step_unit(SLENDER.full.rock)
    row = measure(SLENDER, ratio, Settings(1.0))
    assert row.exact
    block = Block(0.5, 1.5)
    rng = np.random.default_rng(3)
    checked = 0
    for share, error in zip(SHARES, row.error, strict=True):
        settings = Settings(share * time_step.step_unit(SLENDER.full.rock))
        test = work_precision.project(SLENDER, settings)
        for offset in rng.uniform(error, 0.08, 4) * rng.choice((-1.0, 1.0), 4):
            pga = row.reference * (1.0 + offset)
            checked += 1
            assert test(CosinePulse(pga, ratio)) is rocking_response(block, pga, ratio).overturned
    assert checked == 4 * len(SHARES)


def test_on_level_terrain_the_error_is_that_of_housners_block() -> None:
    """A terrain knows nothing of Housner's equation, and its reference finds it all the same."""
    rock = solid.box((0.5, 0.4, 1.0), 2110.0).rock
    made = grounds.site(rock, grounds.level(), yaw=0.0, restitution=0.0)
    rest = displacement.settled(made.seat, 0.006 * time_step.step_unit(rock), "nonsmooth")
    scene = replace(made.seat, start=rest)
    site = TerrainCase(scene, scene, proofs.barrier(rock).toppled_tilt)
    for ratio in time_step.periods(rock)[:2]:
        row = measure_on_seat(site, ratio, Settings(1.0, engine="nonsmooth"))
        exact = first_overturning_pga(Block(0.25, 0.5), ratio, 4.0 * GRAVITY, 0.005 * GRAVITY)
        assert not row.exact
        assert row.reference == pytest.approx(exact, rel=0.01)
        assert (row.error < 0.02).all()


@pytest.mark.slow
@pytest.mark.parametrize("bias", [-0.02, 0.02])
def test_a_biased_simulation_is_found_out(monkeypatch: pytest.MonkeyPatch, bias: float) -> None:
    """Pulses that arrive 2 % too strong or weak: an error of about 2 % that no step removes.

    Of pulses so short that one swing decides, on which the engine's own is small beside it.
    """
    honest = time_step.simulate

    def biased(case: Case, motion: CosinePulse, settings: Settings) -> Response:
        return honest(case, replace(motion, pga=motion.pga * (1.0 + bias)), settings)

    monkeypatch.setattr(time_step, "simulate", biased)
    row = measure(SLENDER, 0.45 * time_step.step_unit(SLENDER.full.rock), Settings(1.0))
    fine = row.error[np.array(SHARES) <= 0.004]
    assert ((fine >= 0.015) & (fine <= 0.03)).all()


def test_a_simulation_without_verdicts_is_never_right(monkeypatch: pytest.MonkeyPatch) -> None:
    lost = Response(Outcome.UNSTABLE, DecidedBy.SIMULATION, math.nan, math.nan, math.nan, 7)
    monkeypatch.setattr(time_step, "simulate", lambda *arguments: lost)
    row = measure(SLENDER, 0.2, Settings(1.0))
    assert (row.error == WORST).all()


def test_where_the_reference_changes_its_mind_no_error_is_smaller(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A hull whose finer runs differ between 10 and 10.5 m/s^2: they know it to 5 %."""
    case = hull(5.0)
    unit = time_step.step_unit(case.full.rock)

    def fake(case: Case, motion: CosinePulse, settings: Settings) -> Response:
        share = settings.time_step / unit
        second = math.isclose(share, LADDER.second)
        limit = 10.5 if second else 10.2 if share > 0.01 else 10.0
        return ending(Outcome.OVERTURNED if motion.pga > limit else Outcome.BALANCED)

    monkeypatch.setattr(time_step, "simulate", fake)
    row = measure(case, 0.3, Settings(1.0))
    assert not row.exact
    assert row.reference == pytest.approx(10.0, rel=0.002)
    assert (row.error == 0.06).all()  # the first of the offsets beyond that


def test_where_outcomes_alternate_the_boundary_found_is_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A coarse run topples between 10 and 10.1 m/s^2, as it should, and again from 10.4 on only."""
    case = hull(5.0)
    unit = time_step.step_unit(case.full.rock)

    def fake(case: Case, motion: CosinePulse, settings: Settings) -> Response:
        falls = motion.pga > 10.0
        if settings.time_step / unit > 0.01:
            falls = 10.0 < motion.pga < 10.1 or motion.pga > 10.4
        return ending(Outcome.OVERTURNED if falls else Outcome.BALANCED)

    monkeypatch.setattr(time_step, "simulate", fake)
    row, coarse = measure(case, 0.3, Settings(1.0)), np.array(SHARES) > 0.01
    assert coarse.any()
    np.testing.assert_array_equal(row.error, OFFSETS[0])
    np.testing.assert_allclose(row.shift[coarse], 0.04, atol=0.003)
    np.testing.assert_allclose(row.shift[~coarse], 0.0, atol=0.003)


def test_a_lowest_band_that_a_step_loses_is_an_error_of_a_block(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It topples between 10 and 10.1 m/s^2 and from 10.4 on; a coarse run from there on only."""
    unit = time_step.step_unit(SLENDER.full.rock)

    def falls(pga: float) -> bool:
        return 10.0 < pga < 10.1 or pga > 10.4

    def fake(case: Case, motion: CosinePulse, settings: Settings) -> Response:
        fell = motion.pga > 10.4 if settings.time_step / unit > 0.01 else falls(motion.pga)
        return ending(Outcome.OVERTURNED if fell else Outcome.BALANCED)

    right = Answer(10.0, lambda pga: frozenset({falls(pga)}), exact=True, spread=0.0)
    monkeypatch.setattr(time_step, "simulate", fake)
    monkeypatch.setattr(time_step, "answer", lambda *given: right)
    row, coarse = measure(SLENDER, 0.3, Settings(1.0)), np.array(SHARES) > 0.01
    np.testing.assert_allclose(row.error[coarse], 0.04, atol=0.003)
    np.testing.assert_allclose(row.shift[~coarse], 0.0, atol=0.003)


@pytest.mark.parametrize("moved", [0.0, 0.015])
def test_a_band_too_narrow_to_be_found_is_no_error_of_a_block(
    monkeypatch: pytest.MonkeyPatch, moved: float
) -> None:
    """It topples for .02 m/s^2 about 10.06, where the first look finds it, or just does not."""
    unit = time_step.step_unit(SLENDER.full.rock)

    def falls(pga: float, by: float = 0.0) -> bool:
        return 10.05 < pga - by < 10.07 or pga > 10.4

    def fake(case: Case, motion: CosinePulse, settings: Settings) -> Response:
        fell = falls(motion.pga, moved if settings.time_step / unit > 0.01 else 0.0)
        return ending(Outcome.OVERTURNED if fell else Outcome.BALANCED)

    right = Answer(10.4, lambda pga: frozenset({falls(pga)}), exact=True, spread=0.0)
    monkeypatch.setattr(time_step, "simulate", fake)
    monkeypatch.setattr(time_step, "answer", lambda *given: right)
    assert measure(SLENDER, 0.3, Settings(1.0)).error.max() < 0.006


@pytest.mark.parametrize(("true", "least"), [(12.0, OFFSETS[0]), (7.5, OFFSETS[0]), (0.0, WORST)])
def test_a_reference_far_from_the_coarsest_step_is_found_or_speaks_for_no_step(
    monkeypatch: pytest.MonkeyPatch, true: float, least: float
) -> None:
    """One that topples at all pulses has no boundary with which a step could agree."""
    case = hull(5.0)
    unit = time_step.step_unit(case.full.rock)

    def fake(case: Case, motion: CosinePulse, settings: Settings) -> Response:
        limit = true if settings.time_step / unit < 0.5 * LADDER.coarse else 10.0
        return ending(Outcome.OVERTURNED if motion.pga > limit else Outcome.BALANCED)

    monkeypatch.setattr(time_step, "simulate", fake)
    error = measure(case, 0.3, Settings(1.0)).error
    assert (error.max(), error.min()) == (WORST, least)


@pytest.mark.parametrize("limit", [9.5, 10.5])
def test_a_boundary_between_the_pulses_nearest_to_what_was_found_hides_no_error(
    monkeypatch: pytest.MonkeyPatch, limit: float
) -> None:
    """The middle of its bracket is up to 0.16 % off: both pulses at 0.125 % may end alike."""
    case, unsure = hull(5.0), []
    unit = time_step.step_unit(case.full.rock)
    for boundary in 10.0 * (1.0 + 0.0002 * np.arange(18)):

        def fake(
            case: Case, motion: CosinePulse, settings: Settings, at: float = boundary
        ) -> Response:
            fine = settings.time_step / unit <= LADDER.second * 1.01
            from_ = at if fine else limit
            return ending(Outcome.OVERTURNED if motion.pga > from_ else Outcome.BALANCED)

        monkeypatch.setattr(time_step, "simulate", fake)
        unsure.append(measure(case, 0.3, Settings(1.0)).error.max())
    assert min(unsure) >= 0.04


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        (SLENDER, Block(0.5, 1.5)),
        (box((1.0, 2.0, 3.0), Contact(0.8), math.pi / 2), Block(1.0, 1.5)),
        (box((1.0, 2.0, 3.0), Contact(0.8), math.pi), Block(0.5, 1.5)),
        (box((1.0, 1.0, 3.0), Contact(0.6), 0.3), None),
        (box((1.0, 1.0, 2.0), Contact(0.5)), None),
        (box((2.0, 1.0, 2.0), Contact(5.0)), None),
        (box((1.0, 1.0, 3.0), Contact(0.6, 0.2)), None),
        (box((1.0, 1.0, 3.0), Contact(0.6, 0.0, 0.01)), None),
    ],
)
def test_housners_block_is_the_reference_only_where_it_applies(
    case: Case, expected: Block | None
) -> None:
    assert rocking_block(case) == expected


def test_housners_block_is_no_reference_for_a_servo() -> None:
    full = replace(SLENDER.full, drive=servo.PUBLISHED)
    assert rocking_block(replace(SLENDER, full=full)) is None


@pytest.mark.slow
def test_a_squat_block_is_displaced_where_a_sliding_mass_is() -> None:
    """It topples at no PGA; from a tenth of its radius on it is displaced: a mass on a plane."""
    case, friction, ratio = box((2.0, 2.0, 0.5), Contact(0.3)), 0.3, 0.2
    limit = 0.1 * math.sqrt(1.0 + 1.0 + 0.0625)
    low, high = friction * GRAVITY, 2.0 * GRAVITY
    for _ in range(12):
        middle = 0.5 * (low + high)
        slid = rigid_plastic_slip(CosinePulse(middle, ratio), friction) > limit
        low, high = (low, middle) if slid else (middle, high)
    settings = Settings(math.nan, engine="nonsmooth")
    row = measure(case, ratio, settings, Boundary.DISPLACED)
    assert row.reference == pytest.approx(low, rel=0.01)
    assert row.error[-1] <= 0.01
    toppled = measure(case, ratio, settings)
    assert toppled.reference == math.inf
    assert np.isnan(toppled.error).all()


def test_rows_that_are_tried_in_turn() -> None:
    """Longer pulses and ways between before displacement, which has the usual rows again."""
    rock = hull(5.0).full.rock
    usual, more, displaced = lots(rock)
    assert [place[:2] for place in displaced] == [place[:2] for place in usual]
    assert {place.boundary for place in (*usual, *more)} == {Boundary.TOPPLED}
    assert {place.boundary for place in displaced} == {Boundary.DISPLACED}
    assert min(place.pgv_pga for place in more) > max(place.pgv_pga for place in usual)
    assert not {place.yaw for place in more} & {place.yaw for place in usual}


def test_two_rows_are_not_enough_for_an_error() -> None:
    nothing = np.full(len(SHARES), math.nan)
    rows = [Row(0.3, 5.0, False, nothing, nothing, nothing)] * 2 + [
        Row(0.3, none, False, nothing, nothing, nothing) for none in (math.inf, math.nan)
    ]
    assert not enough(rows)
    assert enough([*rows, rows[0]])
    error = np.full((4, len(SHARES)), 0.001)
    error[2:] = math.nan
    assert np.isnan(front(SHARES, error, error, error).error).all()
    error[2] = 0.001
    assert (front(SHARES, error, error, error).error == 0.001).all()


def test_front_keeps_what_four_rows_in_five_keep() -> None:
    error = np.outer([1.0, 2.0, 3.0, 4.0, 50.0, math.nan], np.linspace(2.0, 1.0, len(SHARES)))
    steps = np.outer([1.0, 1.0, 1.0, 3.0, 4.0, math.nan], np.arange(len(SHARES)) + 1.0)
    shift = np.outer([0.0, 0.0, 10.0, 0.0, 0.0, math.nan], np.ones(len(SHARES)))
    found = front(SHARES, error, shift, steps)
    assert found.agreement == pytest.approx(np.linspace(8.0, 4.0, len(SHARES)))
    assert (found.error == 10.0).all()
    assert found.worst == pytest.approx(np.linspace(100.0, 50.0, len(SHARES)))
    assert found.steps == pytest.approx(2.0 * (np.arange(len(SHARES)) + 1.0))


def test_an_error_far_below_those_of_coarser_steps_is_luck() -> None:
    """Of the first order but for one step that is right by chance, and a coarse one far off."""
    shares = np.array(SHARES)
    law = np.outer([1.0, 0.5, 0.2], 0.3 * shares)
    lucky, poor = (law.copy() for _ in range(2))
    lucky[:, 4], poor[:, 0] = 0.0, 1.0
    nothing = np.zeros_like(law)
    found = front(SHARES, lucky, nothing, nothing)
    for told in (found.agreement, found.error, found.worst):
        assert told == pytest.approx(0.3 * shares)
    found = front(SHARES, nothing, poor, nothing)
    assert found.error[3:] == pytest.approx(0.3 * shares[3:])
    assert (found.agreement == 0.0).all()


@pytest.mark.parametrize(
    ("error", "tolerance", "step", "within"),
    [
        ((0.08, 0.04, 0.02, 0.01), 0.04, 4.0, True),
        ((0.08, 0.04, 0.02, 0.01), 0.02, 2.0, True),
        ((0.01, 0.04, 0.02, 0.01), 0.02, 2.0, True),  # good by luck above a bad one
        ((0.08, 0.04, 0.02, 0.01), 0.005, 1.0, False),
    ],
)
def test_choice_is_the_coarsest_from_which_on_all_keep_the_tolerance(
    error: tuple[float, ...], tolerance: float, step: float, within: bool
) -> None:
    chosen = choose(front_of(*error), UNKNOWN, tolerance, 0.5, 99.0)
    assert chosen.within is within
    assert chosen.time_step == 0.5 * step
    assert chosen.error == error[TRIED.index(step)]
    assert math.isnan(chosen.displaced)


TRIED = [8.0, 4.0, 2.0, 1.0]

COLUMNS = "error", "shift", "steps"


def front_of(*error: float) -> Front:
    own = np.array(error)
    return Front(np.array(TRIED), own, own, own, np.array(TRIED))


UNKNOWN = front_of(*[math.nan] * 4)


def test_where_nothing_was_measured_the_step_is_the_finest_and_nothing_is_claimed() -> None:
    chosen = choose(UNKNOWN, UNKNOWN, 0.5, 0.5, 99.0)
    assert chosen.time_step == 0.5 * TRIED[-1]
    assert not chosen.within
    assert math.isnan(chosen.error)
    assert math.isnan(chosen.displaced)


def test_where_outcomes_alternate_the_step_goes_by_agreement_and_the_error_told_is_larger() -> None:
    tried, agreement = np.array(TRIED), np.array([0.04, 0.01, 0.01, 0.01])
    shift = np.array([0.03, 0.05, 0.002, 0.03])
    toppled = Front(tried, agreement, np.fmax(agreement, shift), shift, tried)
    chosen = choose(toppled, UNKNOWN, 0.02, 0.5, 99.0)
    assert (chosen.time_step, chosen.within) == (2.0, True)
    assert (chosen.agreement, chosen.error) == (0.01, 0.05)


def test_displacement_stands_in_for_toppling_and_is_not_taken_for_it() -> None:
    """With both, the coarsest step is that at which both are right."""
    slid = front_of(0.08, 0.02, 0.01, 0.01)
    chosen = choose(UNKNOWN, slid, 0.02, 0.5, 99.0)
    assert (chosen.time_step, chosen.displaced, chosen.within) == (2.0, 0.02, True)
    assert math.isnan(chosen.error)
    chosen = choose(front_of(0.01, 0.01, 0.04, 0.01), slid, 0.02, 0.5, 99.0)
    assert (chosen.time_step, chosen.error, chosen.displaced) == (0.5, 0.01, 0.01)


@pytest.mark.parametrize(
    ("tolerance", "step", "within"),
    [(0.02, 8.0, True), (0.01, 4.0, True), (0.005, 2.0, True), (0.001, 1.0, False)],
)
def test_the_longest_step_goes_with_the_tolerance(
    tolerance: float, step: float, within: bool
) -> None:
    """It is 2.4 s for 1 % here: steps of 4, 2, 1 and 0.5 s are tried. 0.24 s is none of them."""
    chosen = choose(front_of(*[0.001] * 4), UNKNOWN, tolerance, 0.5, 2.4)
    assert (chosen.time_step, chosen.within) == (0.5 * step, within)


@pytest.mark.slow
def test_doubled_tolerance_is_cheaper() -> None:
    rows = [measure(SLENDER, r, Settings(1.0)) for r in time_step.periods(SLENDER.full.rock)]
    columns = [np.array([getattr(row, what) for row in rows]) for what in COLUMNS]
    measured, nothing = front(SHARES, *columns), front(SHARES, *(one[:0] for one in columns))
    unit = time_step.step_unit(SLENDER.full.rock)
    rock = SLENDER.full.rock
    steps = [
        choose(measured, nothing, wanted, unit, time_step.longest(rock, "bullet")).time_step
        for wanted in (0.005, 0.01, 0.02)
    ]
    assert steps == sorted(steps)
    assert steps[2] >= 1.5 * steps[1] >= 1.5 * steps[0]


@pytest.mark.slow
@pytest.mark.parametrize("size", [(0.4, 0.8, 1.6), (0.2, 0.2, 1.0), (0.5, 0.9, 1.7)])
def test_the_step_chosen_keeps_to_the_tolerance_at_levels_that_were_not_measured(
    size: tuple[float, float, float],
) -> None:
    """Of a slender box after some impacts: lowest boundaries by Housner's equation, and by runs.

    On each face, as a study may shake one alone: together 1.86 % on one passed for 0.79 %.
    """
    blocks = [Block(0.5 * width, 0.5 * size[2]) for width in size[:2]]
    cases = {yaw: box(size, Contact(0.6), yaw) for yaw in (0.0, 0.5 * math.pi)}
    rock, ladder = cases[0.0].full.rock, load("nonsmooth").LADDER
    unit, how = time_step.step_unit(rock), Settings(math.nan, engine="nonsmooth")
    rows = [measure(cases[yaw], ratio, how) for yaw, ratio, _ in lots(rock)[0]]
    columns = [np.array([getattr(row, what) for row in rows]) for what in COLUMNS]
    measured = front(ladder.shares, *columns)
    none = front(ladder.shares, *(column[:0] for column in columns))
    chosen = choose(measured, none, 0.01, unit, time_step.longest(rock, "nonsmooth"))
    assert chosen.within
    settings = replace(how, time_step=chosen.time_step)

    def by_housner(block: Block, _: Case, pulse: CosinePulse) -> bool:
        return rocking_response(block, pulse.pga, pulse.pgv_pga).overturned

    def by_run(_: Block, case: Case, pulse: CosinePulse) -> bool:
        return time_step.simulate(case, pulse, settings).outcome is Outcome.OVERTURNED

    for block, case in zip(blocks, cases.values(), strict=True):
        off = []
        for ratio in unit * np.arange(0.6, 2.2, 0.25):
            near = first_overturning_pga(block, ratio, 4.0 * GRAVITY, 0.005 * GRAVITY)
            pulses = [CosinePulse(pga, ratio) for pga in near * np.arange(0.95, 1.1, 0.002)]
            lowest = [
                next(pulse.pga for pulse in pulses if topples(block, case, pulse))
                for topples in (by_housner, by_run)
            ]
            off.append(abs(lowest[1] / lowest[0] - 1.0))
        assert np.quantile(off, time_step.KEPT_BY) <= min(chosen.error + 0.002, 0.01)


@pytest.mark.parametrize("sides", [(1.0, 2.0), (2.0, 1.0)])
def test_a_box_topples_over_its_narrow_face_and_slides_over_both(
    sides: tuple[float, float],
) -> None:
    usual, more, displaced = lots(box((*sides, 3.0), Contact(0.6)).full.rock)
    narrow = 0.0 if sides[0] < sides[1] else 0.5 * math.pi
    assert {place.yaw for place in (*usual, *more)} == {narrow}
    assert {place.yaw for place in displaced} == {0.0, 0.5 * math.pi}


def test_score_of_a_way_of_running_against_a_target() -> None:
    """A way that is right from 1.5 % on above the boundary, and everywhere below it."""
    passing = {
        10.0 * (1.0 + side * offset): frozenset({side > 0.0})
        for offset in OFFSETS
        for side in (-1.0, 1.0)
    }
    wanted = Target(0.3, 10.0, True, 0.0, (), passing)
    found = work_precision.score(lambda pulse: pulse.pga > 10.12, wanted)
    assert found.error == 0.015
    assert found.lost == 0
    assert found.seconds >= 0.0
    diverging = work_precision.score(lambda pulse: None, wanted)
    assert diverging == Score(WORST, diverging.seconds, diverging.lost)
    assert diverging.lost > 0


def test_target_of_a_block_is_housners_equation() -> None:
    wanted = work_precision.target(SLENDER, 0.2, ())
    assert wanted.exact
    assert len(wanted.passing) == 2 * len(OFFSETS)
    block = Block(0.5, 1.5)
    for pga, passing in wanted.passing.items():
        assert passing == {rocking_response(block, pga, 0.2).overturned}
    assert (wanted.references, wanted.least) == ((), OFFSETS[0])
    assert wanted.boundary / GRAVITY == pytest.approx(0.52, abs=0.01)  # Housner, 1x1x3 m at 0.20 s


@pytest.mark.parametrize("lost", [Outcome.UNSETTLED, Outcome.UNSTABLE, Outcome.CRASHED])
def test_runs_without_verdicts_are_not_right_for_being_as_lost_as_the_reference(
    monkeypatch: pytest.MonkeyPatch, lost: Outcome
) -> None:
    monkeypatch.setattr(time_step, "simulate", lambda *arguments: ending(lost))
    assert (measure(hull(5.0), 0.3, Settings(1.0)).error == WORST).all()


def engines_that_topple_from(
    monkeypatch: pytest.MonkeyPatch, limits: dict[str, float], stands_again: float = math.inf
) -> Target:
    """Target of engines whose boundaries are given [m/s^2]; none topples just at the other PGA."""

    def fake(case: Case, motion: CosinePulse, settings: Settings) -> Response:
        again = math.isclose(motion.pga, stands_again)
        over = motion.pga > limits[settings.engine] and not again
        return ending(Outcome.OVERTURNED if over else Outcome.DISPLACED)

    monkeypatch.setattr(work_precision, "simulate", fake)
    return work_precision.target(hull(5.0), 0.3, tuple(limits))


@pytest.mark.parametrize(
    ("limits", "right", "off"),
    [
        ({"bullet": 9.8, "mujoco": 10.0, "nonsmooth": 10.24}, (0.02, 0.03), 0.04),
        ({"bullet": 10.0, "mujoco": 10.0, "nonsmooth": 10.0}, (0.00125, 0.0025), 0.04),
    ],
)
def test_no_error_is_told_below_what_references_know(
    monkeypatch: pytest.MonkeyPatch, limits: dict[str, float], right: tuple[float, ...], off: float
) -> None:
    """Of references 4.4 % apart, and of ones that agree: who topples always or never is wrong."""
    wanted = engines_that_topple_from(monkeypatch, limits)

    def error(factor: float) -> float:
        return work_precision.score(lambda p: p.pga > factor * wanted.boundary, wanted).error

    assert error(math.inf) == error(0.0) == WORST
    assert wanted.least == error(1.0)
    assert wanted.least in right
    assert wanted.least >= 0.5 * wanted.spread
    assert 0.03 <= error(1.03 - 1e-9) <= error(1.03 + 1e-9) == off
    assert 0.03 <= error(0.97 + 1e-9) <= error(0.97 - 1e-9) == off
    steps = {name: load(name).LADDER.reference for name in limits}
    assert dict(wanted.references) == steps


def test_a_pulse_beyond_which_references_stand_again_speaks_for_no_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Both stand at 0.5 % above the boundary, too: who never topples is not right for that."""
    limits = {"bullet": 10.0, "mujoco": 10.0}
    at = engines_that_topple_from(monkeypatch, limits).boundary
    wanted = engines_that_topple_from(monkeypatch, limits, stands_again=1.005 * at)
    assert wanted.boundary == at
    assert wanted.passing[at * 1.005] == frozenset()
    assert work_precision.score(lambda pulse: False, wanted).error == WORST


def test_one_engine_is_its_own_reference_at_two_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = engines_that_topple_from(monkeypatch, {"nonsmooth": 10.0})
    ladder = load("nonsmooth").LADDER
    assert wanted.references == (("nonsmooth", ladder.reference), ("nonsmooth", ladder.second))


def test_target_of_two_engines_is_what_both_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """They topple from 10 and 10.4 m/s^2 on: 10.2 on average, and no answer between them."""
    wanted = engines_that_topple_from(monkeypatch, {"bullet": 10.0, "mujoco": 10.4})
    assert not wanted.exact
    assert wanted.boundary == pytest.approx(10.2, rel=0.002)
    assert wanted.spread == pytest.approx(0.4 / 10.2, abs=0.004)
    assert len(wanted.passing) == 2 * len(OFFSETS)
    for pga, passing in wanted.passing.items():
        assert passing == ({pga > 10.4} if abs(pga - 10.2) > 0.2 else frozenset())
    assert work_precision.score(lambda pulse: pulse.pga > 10.2, wanted).error == 0.02
    assert work_precision.score(lambda pulse: None, wanted).error == WORST


def test_no_target_where_nothing_topples_the_rock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work_precision, "simulate", lambda *arguments: ending(Outcome.BALANCED))
    wanted = work_precision.target(hull(5.0), 0.3, ("bullet", "mujoco"))
    assert math.isnan(wanted.boundary)
    assert wanted.passing == {}
