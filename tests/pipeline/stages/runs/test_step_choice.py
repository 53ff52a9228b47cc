"""The time step of each friction: what was measured stays known, and only that."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.config.layers import load_site
from pipeline.stages.runs import step_choice
from pipeline.stages.runs.scenes import Scenes
from pipeline.workflow.datasets import read
from pipeline.workflow.store import Store
from vsr_core.rock import solid
from vsr_core.run.proofs import barrier

GRID = """
motion: {pga: [0.01, 0.02], pgv_pga: 0.3}
contact: {friction: [0.6]}
simulation: {time_step: auto}
"""


def test_a_friction_more_keeps_what_was_measured(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path, tmp_path: Path
) -> None:
    site, two = write_site(GRID), ("--set", "contact.friction=[0.6, 0.7]")
    assert vsr("run", "responses", "--site", site, "--workers", 0).code == 0
    config = load_site(site, settings=two[1:]).config
    known = step_choice.time_steps(config, Store(derived / "rock"))
    assert known[0.6] > 0.0
    assert math.isnan(known[0.7])
    more = vsr("run", "responses", "--site", site, "--workers", 0, *two)
    assert "measuring 2 boundaries" in more.err  # of the new friction only
    whole = tmp_path / "whole"
    assert vsr("run", "responses", "--site", site, "--workers", 0, *two, into=whole).code == 0
    made, anew = (read(folder / "rock" / step_choice.FILE) for folder in (derived, whole))
    assert made.drop_attrs().equals(anew.drop_attrs())
    steps = step_choice.time_steps(config, Store(derived / "rock"))
    assert list(steps.values()) == made["time_step"].values.tolist()


def test_code_of_terrains_decides_no_time_step(
    edit_function: Callable[[str, str, str], None],
) -> None:
    """It is measured on a flat pedestal, and its stage is not made again for a terrain's sake."""
    rock = solid.box((0.5, 1.0, 2.0), 2000.0).rock
    scenes = Scenes(load_site("double_rock_terrain").config, rock, barrier(rock), None)
    scenes.__dict__["level_rock"] = rock
    before = step_choice._names(scenes)
    edit_function("vsr_core/run/displacement.py", "displace", "str(1)")
    assert step_choice._names(scenes) == before
    edit_function("vsr_core/run/proofs.py", "cannot_topple", "str(1)")
    assert step_choice._names(scenes) != before
