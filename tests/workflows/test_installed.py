"""The project installed from its wheel, in an environment of its own and away from the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from pipeline import ROOT

GRID = "motion={pga: [0.4, 0.9], pgv_pga: [0.3]}"
SHORT = """
import sys, vsr
block = vsr.box(0.5, 1.0, 2.0, density=2110)
made = vsr.fragility(block, vsr.pulses([0.4, 0.9], [0.3]), name="block", yaw=[0, 90],
                     simulation={"time_step": 0.001}, workers=0)
print(vsr.__file__, dict(made.sizes)["yaw"], float(made.first_overturning_pga.min()))
try:
    vsr.responses(block, yow=3)
except vsr.InputError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the wheel holds, made of the tracked files."""
    source, into = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT,
                            capture_output=True, text=True, check=True)  # fmt: skip
    for name in listed.stdout.splitlines():
        if name.startswith(("vsr", "pipeline", "configs", "data", "pyproject", "setup.py")):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, source / name)
    for name in ("README.md", "LICENSE"):
        shutil.copyfile(ROOT / name, source / name)
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation"]
    subprocess.run([*build, "-w", str(into), str(source)], check=True)
    (wheel,) = into.glob("vsr-*.whl")
    zipfile.ZipFile(wheel).extractall(into)
    assert (into / "vsr_core" / "scene.py").is_file()
    assert (into / "pipeline" / "inspection" / "answers.schema.json").is_file()
    shutil.copytree(ROOT / "vsr_core", into / "vsr_core", dirs_exist_ok=True)  # with machine code
    return into


def ran(installed: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Python in a folder, with the installed packages before any other."""
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    return subprocess.run([sys.executable, *arguments], cwd=folder, env=environment,
                          capture_output=True, text=True, check=False)  # fmt: skip


@pytest.mark.slow
def test_it_works_in_any_folder(installed: Path, tmp_path: Path) -> None:
    vsr = ("-m", "pipeline")
    assert ran(installed, tmp_path, *vsr, "init", "my_rock").returncode == 0
    written = sorted(path.name for path in (tmp_path / "my_rock").iterdir())
    assert written == ["README.md", "my_rock.yaml", "schema.json"]
    assert "NAME" not in (tmp_path / "my_rock" / "README.md").read_text(encoding="utf-8")
    done = ran(installed, tmp_path / "my_rock", *vsr, "run", "fragility", "--workers", "0",
               "--site", "my_rock.yaml", "--set", GRID, "--set", "yaw=0",
               "--set", "simulation.time_step=0.001")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "my_rock" / "data" / "derived" / "my_rock" / "report.html").is_file()
    again = ran(installed, tmp_path, *vsr, "init", "my_rock")
    assert again.returncode == 2
    assert "the folder exists" in again.stderr


@pytest.mark.slow
def test_what_is_shipped_is_found(installed: Path, tmp_path: Path) -> None:
    """Samples of records and of curves lie in the wheel; a scan is looked for where the user is."""
    records = ("plan", "--site", "double_rock", "--study", "records", "--set", "yaw=0")
    planned = ran(installed, tmp_path, "-m", "pipeline", *records)
    assert planned.returncode == 0, planned.stderr
    scan = tmp_path / "data" / "raw" / "double_rock"
    scan.mkdir(parents=True)
    (scan / "mine.ply").write_text("no mesh")
    refused = ran(installed, tmp_path, "-m", "pipeline", "run", "rock", "--site", "double_rock")
    assert refused.returncode == 2
    assert "data/raw/double_rock/mine.ply" in refused.stderr


@pytest.mark.slow
def test_the_short_way_in_from_python(installed: Path, tmp_path: Path) -> None:
    done = ran(installed, tmp_path, "-c", SHORT)
    assert done.returncode == 0, done.stderr
    first, problem = done.stdout.splitlines()
    assert first.startswith(f"{installed}/vsr.py 2 ")
    assert 0.2 < float(first.split()[2]) < 0.9
    assert problem.startswith("--set: yow: unknown key; did you mean yaw?")
    assert (tmp_path / "data" / "derived" / "block" / "fragility.nc").is_file()
