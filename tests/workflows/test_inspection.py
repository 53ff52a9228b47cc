"""`vsr list`, `plan`, `status` and `why`, from nothing to a finished product."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
from conftest import Ran

from pipeline import ROOT
from pipeline.workflow.command_line import ANSWERS
from pipeline.workflow.products import DELIVERABLES
from pipeline.workflow.registry import BY_NAME
from vsr_core.compiled import compiling

GRID = "motion: {pga: [0.2, 0.6], pgv_pga: [0.2, 0.4, 0.5]}\nyaw: [0, 90]\n"


def test_list_names_all_that_there_is(vsr: Callable[..., Ran]) -> None:
    said = vsr("list").out
    for kind in ("sites", "studies", "tables"):
        for path in (ROOT / "configs" / kind).glob("*.yaml"):
            assert path.stem in said
    for product in DELIVERABLES:
        assert product in said


def test_every_deliverable_ends_with_a_stage_that_is_there() -> None:
    for wanted in DELIVERABLES.values():
        assert wanted.stage in BY_NAME


def test_draws_and_compared_settings_are_planned_too(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    """12 cells, and 6 of a setting with one direction; 3 runs for each level of 3 draws.

    These levels are found by 8 runs, and run at 16 PGAs and 2 time steps before.
    """
    curves = ROOT / "data" / "raw" / "hazard" / "made_up"
    age, compared = "{kind: samples, values: [900]}", "[{name: one way, set: ['yaw=[0]']}]"
    hazard = f"hazard: {{curves: {curves}, age: {age}, compare: {compared}}}\n"
    site = write_site(GRID + "uncertainty: {members: 3}\n" + hazard)
    own = vsr("plan", "uncertainty", "--site", site).out
    assert "draws: 3, each with 6 first overturnings" in own
    assert f"about {3 * 18 + 18 * (8 + 16 * 2)} runs beside" in own
    planned = vsr("plan", "hazard", "--site", site).out
    whole, one_way = planned.split(f"{derived / 'rock' / 'compared' / 'one_way' / 'rock'}:\n")
    assert "runs: 12;" in whole
    assert re.search(r"boundary: about \d+ runs beside, \d in each of 6 levels", whole)
    assert f"about {3 * 18 + 18 * (8 + 16 * 2)} runs beside" in whole
    assert "runs: 6;" in one_way
    assert "draws" not in one_way
    assert "draws" not in vsr("plan", "fragility", "--site", site).out
    assert not derived.exists()


def test_before_between_and_after(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    site = write_site(GRID)
    planned = vsr("plan", "--site", site)
    assert planned.code == 0
    assert "12" in planned.out  # 2 yaws x 3 x 2 runs
    assert not derived.exists()
    assert "to do" in vsr("status", "--site", site).out
    assert "rock: up to date" not in vsr("why", "--site", site).out

    assert vsr("run", "rock", "--site", site, "--workers", "0").code == 0
    said = vsr("why", "--site", site).out.splitlines()
    assert "rock: up to date" in said
    assert "motions: up to date" not in said
    assert "runs: 0 of 12 are stored and stay; 12 to do" in said
    for product in ("rock", "accuracy", "drive"):  # which do none of them
        for ask in ("why", "status"):
            assert "stored" not in vsr(ask, product, "--site", site).out

    assert vsr("run", "responses", "--site", site, "--workers", "0").code == 0
    assert "12 of 12 runs stored" in vsr("status", "responses", "--site", site).out
    planned = vsr("plan", "responses", "--site", site).out
    assert "runs: 12; 12 stored, 0 to do" in planned
    assert "stages to make: none" in planned
    wider = vsr("why", "responses", "--site", site, "--set", "yaw=[0, 45, 90]").out
    assert "runs: 12 of 18 are stored and stay; 6 to do" in wider


def read(ran: Ran) -> dict[str, Any]:
    """What a command tells a program, which is as the schema in the docs has it."""
    assert ran.code == 0
    told: dict[str, Any] = json.loads(ran.out)
    schema = json.loads(ANSWERS.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(told)
    return told


def test_programs_are_told_the_same(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, tmp_path: Path
) -> None:
    assert set(DELIVERABLES) == set(read(vsr("list", "--json"))["products"])
    assert read(vsr("status", "--json"))["results"] == []
    site = ("--site", write_site(GRID))
    (planned,) = read(vsr("plan", "responses", *site, "--json"))["answers"]
    assert (planned["runs"]["wanted"], planned["runs"]["to_do"]) == (12, 12)
    assert planned["folder"] == str(derived / "rock")
    assert vsr("run", "responses", *site, "--workers", "0").code == 0
    (done,) = read(vsr("status", "responses", *site, "--json"))["answers"]
    assert [stage["stage"] for stage in done["stages"] if stage["reasons"]] == []
    assert done["runs"]["stored"] == sum(done["runs"]["outcomes"].values()) == 12
    wider = (*site, "--set", "yaw=[0, 45, 90]", "--json")
    (again,) = read(vsr("why", "responses", *wider))["answers"]
    assert (again["runs"]["wanted"], again["runs"]["stored"]) == (18, 12)
    stale = {stage["stage"] for stage in again["stages"] if stage["reasons"]}
    assert "responses" in stale
    assert "rock" not in stale

    (tmp_path / "study.yaml").write_text("sweep: {bounce: {contact.restitution: [0, 0.2]}}")
    swept = read(vsr("plan", *site, "--study", str(tmp_path / "study.yaml"), "--json"))
    assert swept["comparison"]["members"] == ["bounce=0", "bounce=0.2"]
    assert [one["runs"]["stored"] for one in swept["answers"]] == [12, 0]


def test_a_program_that_has_read_enough_ends_it_quietly(tmp_path: Path) -> None:
    for words in (["list", "--json"], ["plan", "--site", "cuboid_1x1x2", "--json"]):
        read_end, write_end = os.pipe()
        os.close(read_end)
        command = [sys.executable, "-m", "pipeline", *words, "--derived", str(tmp_path)]
        done = subprocess.run(command, cwd=ROOT, stdout=write_end, stderr=subprocess.PIPE)
        os.close(write_end)
        assert (done.returncode, done.stderr) == (0, b"")


def test_the_version_names_the_code_that_outcomes_come_from(vsr: Callable[..., Ran]) -> None:
    first, *engines, machine_code, libraries = vsr("--version").out.strip().splitlines()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert first.startswith(f"vsr {project['version']}, Python 3.")
    digests = dict(re.fullmatch(r"engine (\w+): code of a run (\w+)", line).groups()  # type: ignore[union-attr]
                   for line in engines)  # fmt: skip
    assert set(digests) == {"bullet", "mujoco", "nonsmooth"}
    assert len(set(digests.values())) == 3
    folder = re.fullmatch(r"machine code: (compiled-\w+)", machine_code)
    assert folder is not None
    assert folder[1] == compiling.name()
    assert f"numpy {np.__version__}" in libraries
