"""Power fails: the disk has what was synced, and of later changes of names any or none."""

from __future__ import annotations

import logging
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from pipeline import ROOT
from pipeline.workflow.datasets import read

CUTS = 200
COMMAND = (
    *("run", "fragility", "--site", "cuboid_1x1x2", "--workers", "0"),
    *("--set", "motion.pga={start: 0.1, stop: 1.0, num: 12}"),
    *("--set", "motion.pgv_pga={start: 0.05, stop: 0.5, num: 4}"),
    *("--set", "simulation.time_step=0.002"),
)
DATASETS = ("responses.nc", "fragility.nc")
SOURCE = Path(__file__).parents[1] / "support" / "forgetful.c"


class Note(NamedTuple):
    """What was synced (F, D), or changed (R)."""

    kind: str
    inode: str
    copy: Path


class Disk:
    """What a disk may have of a folder, note by note."""

    def __init__(self, folder: Path, notes: Path) -> None:
        self._top = str(folder.stat().st_ino)
        lines = (notes / "notes").read_text().splitlines()
        self.notes = [Note(*line.split(" ", 2)[:2], Path(line.split(" ", 2)[2])) for line in lines]

    def restore(self, cut: int, into: Path, chance: random.Random) -> None:
        """What is there after so many notes."""
        contents, names = {}, {}
        for note in self.notes[:cut]:
            if note.kind == "F":
                contents[note.inode] = note.copy
            elif note.kind == "D" or chance.random() < 0.5:
                names[note.inode] = note.copy
        self._restore(self._top, into, contents, names)

    def _restore(
        self, inode: str, into: Path, contents: dict[str, Path], names: dict[str, Path]
    ) -> None:
        into.mkdir()
        folders = {note.inode for note in self.notes if note.kind != "F"}
        for line in names[inode].read_text().splitlines() if inode in names else ():
            below, name = line.split(" ", 1)
            if below in folders:
                self._restore(below, into / name, contents, names)
            elif below in contents:
                shutil.copyfile(contents[below], into / name)
            else:
                (into / name).touch()  # its name is there, and nothing of what was in it


@pytest.fixture
def forgetful(tmp_path: Path) -> Path:
    """The library that notes what is synced."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no compiler of C")
    built = tmp_path / "forgetful.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", built, SOURCE, "-ldl"], check=True)
    return built


@pytest.mark.slow
def test_power_cuts_lose_what_was_in_flight_and_nothing_else(
    tmp_path: Path, forgetful: Path, vsr: Callable[..., Any]
) -> None:
    folder, notes = tmp_path / "disk", tmp_path / "notes"
    folder.mkdir()
    notes.mkdir()
    keep = {"LD_PRELOAD": str(forgetful), "KEEP_OF": str(folder), "KEEP_IN": str(notes)}
    arguments = [sys.executable, "-m", "pipeline", *COMMAND, "--derived", str(folder / "into")]
    subprocess.run(arguments, check=True, cwd=ROOT, env={**os.environ, **keep})
    undisturbed = folder / "into" / "cuboid_1x1x2"
    disk = Disk(folder, notes)

    def resumed(cut: int, chance: random.Random) -> str:
        there = tmp_path / "after"
        disk.restore(cut, there, chance)
        ran = vsr(*COMMAND, into=there / "into")
        assert ran.code == 0, f"cut {cut}: {ran.err}"
        for name in DATASETS:
            found = read(there / "into" / "cuboid_1x1x2" / name)
            assert found.drop_attrs().identical(read(undisturbed / name).drop_attrs()), cut
        shutil.rmtree(there)
        return str(ran.err)

    class Never(random.Random):
        """Nothing is on the disk that was not synced."""

        def random(self) -> float:
            return 1.0

    assert "runs done" not in resumed(len(disk.notes), Never())
    for seed in range(CUTS):
        chance = random.Random(seed)
        resumed(chance.randrange(len(disk.notes) + 1), Never() if seed % 4 == 0 else chance)
    logging.getLogger(__name__).info("%d cuts in %d notes", CUTS, len(disk.notes))
