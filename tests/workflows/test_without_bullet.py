"""Where PyBullet is not installed: MuJoCo repeats the sample, and what needs Bullet is refused."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline import ROOT, cli
from pipeline.workflow.datasets import read

SITE = ("--site", "cuboid_1x1x2", "--set", "motion={pga: [0.3, 0.5, 0.9], pgv_pga: [0.2, 0.4]}")

Run = Callable[..., subprocess.CompletedProcess[str]]


LINES = """
import contextlib, io, json, sys
from pipeline import cli
for arguments in json.load(sys.stdin):
    with contextlib.redirect_stderr(io.StringIO()) as said:
        code = cli.main(arguments)
    print(json.dumps((code, said.getvalue())))
"""


@pytest.fixture
def python(tmp_path: Path) -> Run:
    """A Python that does not find PyBullet."""
    (tmp_path / "sitecustomize.py").write_text('import sys\nsys.modules["pybullet"] = None\n')
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}
    return lambda *arguments, given=None: subprocess.run(
        [sys.executable, *arguments], env=environment, cwd=tmp_path, capture_output=True,
        text=True, check=False, input=given,
    )  # fmt: skip


@pytest.fixture
def run(python: Run, tmp_path: Path) -> Run:
    """A command in that Python."""
    return lambda *arguments: python(
        "-m", "pipeline", *arguments, "--derived", str(tmp_path / "out")
    )


def test_mujoco_repeats_the_sample_and_the_report_says_so(run: Run, tmp_path: Path) -> None:
    done = run("run", "fragility", "--workers", "0", *SITE)
    assert done.returncode == cli.DONE, done.stderr
    assert "in MuJoCo as here" in done.stderr
    made = tmp_path / "out" / "cuboid_1x1x2"
    sample = read(made / "bullet_sample.nc")
    assert sample.attrs["other_engine"] == "MuJoCo"
    assert sample.sizes["sample"] > 1
    assert (sample["overturned_in_other_engine"].values >= 0).all()
    assert "was repeated in MuJoCo" in (made / "report.html").read_text(encoding="utf-8")


def test_a_scene_that_mujoco_cannot_hold_has_no_sample(run: Run, tmp_path: Path) -> None:
    done = run("run", "fragility", "--workers", "0", *SITE, "--set", "contact.restitution=0.2")
    assert done.returncode == cli.DONE, done.stderr
    made = tmp_path / "out" / "cuboid_1x1x2"
    assert not (made / "bullet_sample.nc").exists()
    page = (made / "report.html").read_text(encoding="utf-8")
    assert "No run was repeated in a second engine: PyBullet is not installed" in page


def test_what_needs_bullet_is_refused_in_a_line(python: Run, tmp_path: Path) -> None:
    keys = {
        ("plan", "--set", "drive=servo"): "drive",
        ("plan", "--set", "contact.rolling_friction=0.001"): "contact.rolling_friction",
        ("plan", "--set", "simulation.engine=bullet"): "simulation.engine",
        ("run", "stability"): "run",
        ("run", "accuracy"): "run",
    }
    lines = [[*line, *SITE, "--derived", str(tmp_path / "out")] for line in keys]
    done = python("-c", LINES, given=json.dumps(lines))
    assert done.returncode == 0, done.stderr
    for key, told in zip(keys.values(), done.stdout.splitlines(), strict=True):
        code, said = json.loads(told)
        assert code == cli.REFUSED
        (line,) = said.splitlines()
        assert f"{key}: got" in line
        assert "pip install 'vsr[bullet]'" in line
