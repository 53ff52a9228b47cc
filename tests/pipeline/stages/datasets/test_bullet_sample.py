"""The sample repeated in Bullet: each run in its own scene, and what may explain a difference."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.jobs import built, work

from pipeline.stages.datasets import bullet_sample
from pipeline.stages.datasets.bullet_sample import BulletSample
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.reports import report_tables
from pipeline.stages.runs.scenes import Group
from pipeline.stages.runs.study import Study
from pipeline.workflow.datasets import read
from pipeline.workflow.store import Store

SITE = """
motion: {pga: [0.2, 0.6], pgv_pga: [0.2]}
yaw: [0, 90]
contact: {friction: [0.1, 0.8]}
simulation: {time_step: 0.002}
"""


def test_each_run_is_repeated_at_its_own_yaw_and_friction(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path
) -> None:
    """A block of 0.5 m x 1 m x 2 m at 0.6 g topples over its short side only, and with grip only.

    Its friction of 0.1 is less than both slendernesses, 1/4 and 1/2.
    """
    site = write_site(SITE)
    assert vsr("run", "responses", "--site", site, "--workers", 0).code == 0
    folder = derived / "rock"
    study, responses = built(Study, site, folder), Responses.load(Store(folder))
    made = bullet_sample.make(work(site, folder), study, responses, "bullet")
    made.files[BulletSample.FILE](derived / BulletSample.FILE)
    sample = read(derived / BulletSample.FILE)
    toppled = sample["overturned_in_other_engine"].values == 1
    assert sample.sizes["sample"] == 8
    expected = (sample["friction"] == 0.8) & (sample["yaw"] == 0) & (sample["pga"] == 0.6)
    np.testing.assert_array_equal(toppled, expected.values)
    assert np.isnan(sample["explained"].values[toppled]).all()  # a step given by hand


def test_the_error_of_a_run_is_that_of_its_friction() -> None:
    """Errors of 1 and 3 % and Bullet's of 1 %, of 0.18 g below 0.4 g and 0.02 g above 0.2 g."""
    contact = SimpleNamespace(friction=(0.5, 0.6, 0.7))
    study: Any = SimpleNamespace(
        settings=SimpleNamespace(contact=contact), motions=SimpleNamespace(pga=(0.2, 0.22, 0.4))
    )
    responses = xr.Dataset({"boundary_error": ("friction", [0.01, 0.03, np.nan])})
    groups = tuple(Group(0.0, friction) for friction in (0.5, 0.6, 0.6, 0.6, 0.7))
    pga, near = np.array([0.4, 0.4, 0.2, 0.2, 0.2]), np.array([1, 1, 1, 0, 1], dtype=bool)
    found = bullet_sample._explained(study, responses, groups, pga, near)
    np.testing.assert_allclose(found, [0.4 / 9, 0.8 / 9, 0.4, 0.0, np.nan])


@pytest.mark.slow
def test_a_disagreement_that_no_error_explains_is_shown_by_a_quiet_command(
    write_site: Callable[..., str],
    vsr: Callable[..., Any],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        bullet_sample, "_repeated", lambda work, study, places, engine: [1 for _ in places]
    )
    given = ("run", "fragility", "--site", write_site(SITE), "--workers", 0, "--quiet")
    for _ in ("made", "found made"):
        ran = vsr(*given, "--set", "simulation.engine=nonsmooth")
        assert ran.code == 0
        (line,) = ran.err.splitlines()
        assert line.startswith(
            f"vsr: warning: {derived / 'rock'}: 7 of 8 runs end otherwise in Bullet, which"
        )


@pytest.mark.parametrize(("explained", "odd"), [(0.1, True), (3.0, False), (np.nan, False)])
def test_what_may_differ_is_not_told_where_an_error_was_not_measured(
    explained: float, odd: bool
) -> None:
    """Four of six runs next to the boundary differ; two deviations above 0.1, and one, are 1.7."""
    ones = np.ones(6, dtype=int)
    sample = xr.Dataset(
        {
            "overturned": ("sample", ones),
            "overturned_in_other_engine": ("sample", np.array([0, 0, 0, 0, 1, 1])),
            "next_to_boundary": ("sample", ones),
            "explained": ("sample", np.array([explained, *np.zeros(5)])),
        },
        {name: ("sample", np.zeros(6)) for name in ("yaw", "friction", "row", "pga")},
        {"other_engine": "Bullet"},
    )
    told = report_tables.other_engine(sample)
    assert (told["same"], told["odd"]) == (2, odd)
    np.testing.assert_equal(told["expected"], explained)
