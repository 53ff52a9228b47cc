"""Results with one assumption changed, and verdicts that turn with the PGV/PGA of the runs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.config.hazard_schema import BoundedAge, EarlierStage
from pipeline.stages.hazard import exclusion
from pipeline.stages.hazard.fault_files import Fault, Faults
from pipeline.stages.hazard.rock_ages import back_to
from pipeline.stages.hazard.rock_fragility import OTHER_ROWS
from pipeline.stages.hazard.sensitivity import BASE_CASE, cases, too_coarse
from pipeline.stages.hazard.survival_analysis import DatedRock
from tests.support.standing_rocks import SLOPE, ensemble, model, of_curves, rows_from


@pytest.mark.parametrize(("thresholds", "told"), [([99.0, 0.05], 1), ([0.05, 0.05], 0)])
def test_a_verdict_on_a_fault_that_turns_with_every_second_row_is_told(
    thresholds: list[float], told: int
) -> None:
    """By 0.03 s alone the rock stands, by 0.15 s alone it topples in each of 20 earthquakes."""
    rock, ages = rows_from([0.03, 0.15], thresholds), np.array([1e3])
    fault = Fault(name="A", magnitude=6.5, distance_km=5.0, rate_per_year=0.02)
    faults = Faults((), {}, (fault,), None)
    words = exclusion.too_coarse(rock, faults, ages, exclusion.of_faults(rock, faults, ages), 0.05)
    assert ["another verdict on 1 of 1 fault:" in one for one in words] == [True] * told


def test_every_second_row_is_a_case_and_a_verdict_that_turns_with_it_is_told() -> None:
    ratios, thresholds, age = [0.05, 0.08, 0.125, 0.2], [3.0, 2.0, 0.3, 0.3], np.array([1e3])
    found = {}
    for pick in (slice(None), slice(0, None, 2), slice(1, None, 2)):
        rows = rows_from(ratios[pick], thresholds[pick])
        analysis = of_curves(model(4e-4, 1e-4), DatedRock("rock", rows, age))
        found[pick.start, pick.step] = cases(analysis, {}, {})
    whole = found[None, None]
    halves = [one.results for one in whole if "every second" in one.name]
    for half, alone in zip(halves, (found[0, 2], found[1, 2]), strict=True):
        np.testing.assert_allclose(half.survival, alone[0].results.survival, rtol=1e-3)
    assert halves[0].survival[0] < 0.05 < whole[0].results.survival[0] < halves[1].survival[0]
    (told,) = too_coarse(whole)
    assert "gives another verdict on 1 of 2 branches" in told
    alike = of_curves(model(1e-4), DatedRock("rock", rows_from(ratios, [0.5] * 4), age))
    assert {one.name for one in cases(alike, {}, {})} > {*OTHER_ROWS}
    assert too_coarse(cases(alike, {}, {})) == ()


def test_a_verdict_that_turns_where_rows_are_moved_is_told() -> None:
    """It topples from 0.02 s / (PGV/PGA) on. Rows of a factor of 2, and halves of them, have more
    that topples, so that 0.04 survive by them of 0.0508."""
    ratios, age = np.geomspace(0.0125, 0.8, 7), np.array([1e3])
    rows = rows_from(ratios.tolist(), (0.02 / ratios).tolist())
    exact = 0.02**-2.0 * 0.1**2 * math.exp(2.0 * 0.4**2)  # E[threshold^-2] of a lognormal PGV/PGA
    rate = -math.log(0.0508) / (age[0] * exact)
    found = cases(of_curves(model(rate), DatedRock("rock", rows, age)), {}, {})
    survived = {one.name: one.results.survival[0] for one in found}
    half, other, shorter, longer = (survived[name] for name in OTHER_ROWS)
    assert max(half, other, shorter, survived[BASE_CASE]) < 0.05 < 0.0508 < longer
    (told,) = too_coarse(found)
    assert "another verdict on 1 of 1 branch:" in told


def test_rows_in_pairs_are_as_far_apart_as_the_pairs() -> None:
    """Every second of them is the whole again; moved, they show what single ones do."""
    ratios, age = np.geomspace(0.0125, 0.8, 7), np.array([1e3])
    ratios = np.sort([*ratios, *(1.01 * ratios)])
    rows = rows_from(ratios.tolist(), (0.02 / ratios).tolist())
    exact = 0.02**-2.0 * 0.1**2 * math.exp(2.0 * 0.4**2)
    analysis = of_curves(model(-math.log(0.0508) / (age[0] * exact)), DatedRock("rock", rows, age))
    (told,) = too_coarse(cases(analysis, {}, {}))
    assert "another verdict on 1 of 1 branch:" in told


def test_of_one_pgv_pga_no_half_is_a_case() -> None:
    one = of_curves(model(1e-4), DatedRock("rock", rows_from([0.1], [0.5]), np.array([1e3])))
    assert not {case.name for case in cases(one, {}, {})} & {*OTHER_ROWS}


def test_of_several_rocks_the_first_is_shaken_in_one_direction() -> None:
    """Each has the yaw of its own scan: the others, weaker from one side, keep all of theirs."""
    weak, strong = ensemble([0.3], 2000), ensemble([0.6], 2000)
    sides = replace(strong, by_yaw={0.0: weak.mean, 90.0: strong.mean})
    rocks = (DatedRock(name, sides, np.array([1000.0])) for name in ("one", "other"))
    analysis = of_curves(model(1e-4), *rocks)
    found = {one.name: one.analysis.rocks for one in cases(analysis, {}, {})}
    for name, yaw in (("yaw 0°, the most", 0.0), ("yaw 90°, the least", 90.0)):
        one, other = found[f"direction: all shaking of one at {name} fragile"]
        assert one.fragility.mean is sides.by_yaw[yaw]
        assert other is analysis.rocks[1]


def test_the_direction_and_the_age_of_a_rock_are_those_of_its_stages_too() -> None:
    """Both fragilities have one in all directions; young and old rocks are of the same stages."""
    rate, spread = 1e-4, BoundedAge(kind="bounds", low=1000.0, high=3000.0)
    stage = EarlierStage(site="buried", until=BoundedAge(kind="bounds", low=500.0, high=1500.0))
    until, reached = back_to(spread, (stage,), ()).T
    assert (until < reached).all()
    weak, strong = ensemble([0.3] * 2, 2000), ensemble([0.6] * 2, 2000)
    analysis = of_curves(model(rate), DatedRock("rock", weak, reached, ((strong, until),)))
    found = {case.name: case.results.survival[0] for case in cases(analysis, {}, {})}
    for name, chance in found.items():
        if name.startswith("direction"):
            assert chance == pytest.approx(found[BASE_CASE], rel=1e-9)
    ages = {name: chance for name, chance in found.items() if name.startswith("age")}
    assert len(ages) == 2
    for share, chance in zip((5.0, 95.0), ages.values(), strict=True):
        age = np.percentile(reached, share)
        ended = until[until < age]
        lasted = np.exp(-rate * (0.3**-SLOPE * ended + 0.6**-SLOPE * (age - ended)))
        assert chance == pytest.approx(lasted.mean(), rel=0.01)
