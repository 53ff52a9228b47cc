"""Where PyBullet is not installed: MuJoCo repeats the sample, and what needs Bullet is refused."""

from __future__ import annotations

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


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """A command in a Python that does not find PyBullet."""
    (tmp_path / "sitecustomize.py").write_text('import sys\nsys.modules["pybullet"] = None\n')
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}

    def go(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pipeline", *arguments, "--derived", str(tmp_path / "out")]
        return subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True,
                              text=True, check=False)  # fmt: skip

    return go


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


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (("plan", "--set", "drive=servo"), "drive"),
        (("plan", "--set", "contact.rolling_friction=0.001"), "contact.rolling_friction"),
        (("plan", "--set", "simulation.engine=bullet"), "simulation.engine"),
        (("run", "stability"), "run"),
        (("run", "accuracy"), "run"),
    ],
)
def test_what_needs_bullet_is_refused_in_a_line(
    run: Run, arguments: tuple[str, ...], key: str
) -> None:
    done = run(*arguments, *SITE)
    assert done.returncode == cli.REFUSED
    (line,) = done.stderr.splitlines()
    assert f"{key}: got" in line
    assert "pip install 'vsr[bullet]'" in line
