"""`vsr run hazard` of rocks with all that they may have, against their histories by brute force."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Ran
from support import histories
from support.hazard_site import CURVES, levels_and_rates

from pipeline.workflow.datasets import read

GRID = """
motion: {pga: {start: 0.1, stop: 1.0, num: 13}, pgv_pga: [0.05, 0.1, 0.2, 0.4]}
simulation: {engine: nonsmooth, time_step: 0.0015}
uncertainty: {members: 16, centre_of_mass: 0.02}
"""
ROCK = "rock: {{shape: box, size: {}, density: 2110}}\nyaw: {}\n" + GRID.replace("{", "{{").replace(
    "}", "}}"
)
TABLE = "{pga: [0.1, 1.0], median: [0.08, 0.12], log_sd: [0.4, 0.5]}"
HAZARD = f"""
hazard:
  curves: {CURVES}
  pgv_pga: {TABLE}
  compare: []
  age: {{kind: normal, mean: 1500, sd: 200}}
  history: [{{site: buried.yaml, until: {{kind: bounds, low: 300, high: 600}}}}]
  rocks: [{{site: other.yaml, age: {{kind: bounds, low: 400, high: 2500}}}}]
"""
NUMBER = 40_000


@pytest.mark.slow
def test_survival_of_two_rocks_with_draws_and_a_stage_is_that_of_their_histories(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """Their ages overlap, the stage ended at a time that is not known, the draws are paired."""
    write_site(ROCK.format("[0.4, 0.5, 1.2]", "[0, 30]"), name="buried")
    write_site(ROCK.format("[0.3, 0.4, 0.9]", "[0, 45]"), name="other")
    site = write_site(ROCK.format("[0.25, 0.5, 1.2]", "[0, 30]") + HAZARD)
    ran = vsr("run", "hazard", "--site", site)
    assert ran.code == 0, ran.err
    stage = {
        name: histories.of_ensemble(read(derived / name / "uncertainty.nc"))
        for name in ("rock", "buried", "other")
    }
    rng = np.random.default_rng(2)
    ended, age = rng.uniform(300.0, 600.0, 100_000), rng.normal(1500.0, 200.0, 100_000)
    rocks = (
        histories.Rock((stage["rock"], stage["buried"]), np.column_stack([ended, age])),
        histories.Rock((stage["other"],), rng.uniform(400.0, 2500.0, (100_000, 1))),
    )
    table = np.array([[0.1, 1.0], [0.08, 0.12], [0.4, 0.5]])
    levels, rates = levels_and_rates("PGA")
    found = read(derived / "rock" / "hazard.nc")["survival"].values
    for place, rate in enumerate(rates):
        known = rate > 0.0
        shaking = histories.Shaking(levels[known], rate[known], table)
        expected, error = histories.survival(shaking, rocks, NUMBER, place)
        assert abs(found[place] - expected) < 4.0 * error + 0.01 * expected
