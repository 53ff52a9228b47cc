"""Where PyBullet is not installed: MuJoCo repeats the sample, and what needs Bullet is refused."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline import ROOT, cli
from pipeline.workflow.datasets import read

SITE = ("--site", "cuboid_1x1x2", "--set", "motion={pga: [0.3, 0.5, 0.9], pgv_pga: [0.2, 0.4]}")

LINES = """
import contextlib, io, json, sys
from pipeline import cli
for arguments in json.load(sys.stdin):
    with contextlib.redirect_stderr(io.StringIO()) as said:
        code = cli.main(arguments)
    print(json.dumps((code, said.getvalue())))
"""

RUN = ("run", "fragility", "--workers", "0")
REFUSED = {
    ("plan", "--set", "drive=servo"): "drive",
    ("plan", "--set", "contact.rolling_friction=0.001"): "contact.rolling_friction",
    ("plan", "--set", "simulation.engine=bullet"): "simulation.engine",
    ("run", "stability"): "run",
    ("run", "accuracy"): "run",
}


@dataclass(frozen=True)
class Done:
    """What commands did, one after the other, in a Python that does not find PyBullet."""

    folder: Path
    said: list[tuple[int, str]]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Done:
    folder = tmp_path_factory.mktemp("without")
    (folder / "sitecustomize.py").write_text('import sys\nsys.modules["pybullet"] = None\n')
    lines = [
        [*RUN, *SITE, "--derived", str(folder / "with a sample")],
        [*RUN, *SITE, "--derived", str(folder / "without"), "--set", "contact.restitution=0.2"],
        *([*line, *SITE, "--derived", str(folder / "none")] for line in REFUSED),
    ]
    ran = subprocess.run(
        [sys.executable, "-c", LINES],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)])},
        cwd=folder, capture_output=True, text=True, check=False, input=json.dumps(lines),
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    return Done(folder, [json.loads(line) for line in ran.stdout.splitlines()])


@pytest.mark.slow
def test_mujoco_repeats_the_sample_and_the_report_says_so(done: Done) -> None:
    code, said = done.said[0]
    assert code == cli.DONE, said
    assert "in MuJoCo as here" in said
    made = done.folder / "with a sample" / "cuboid_1x1x2"
    sample = read(made / "bullet_sample.nc")
    assert sample.attrs["other_engine"] == "MuJoCo"
    assert sample.sizes["sample"] > 1
    assert (sample["overturned_in_other_engine"].values >= 0).all()
    assert "was repeated in MuJoCo" in (made / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_scene_that_mujoco_cannot_hold_has_no_sample(done: Done) -> None:
    code, said = done.said[1]
    assert code == cli.DONE, said
    made = done.folder / "without" / "cuboid_1x1x2"
    assert not (made / "bullet_sample.nc").exists()
    page = (made / "report.html").read_text(encoding="utf-8")
    assert "No run was repeated in a second engine: PyBullet is not installed" in page


@pytest.mark.slow
def test_what_needs_bullet_is_refused_in_a_line(done: Done) -> None:
    for key, (code, said) in zip(REFUSED.values(), done.said[2:], strict=True):
        assert code == cli.REFUSED
        (line,) = said.splitlines()
        assert f"{key}: got" in line
        assert "pip install 'vsr[bullet]'" in line
