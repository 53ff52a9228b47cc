"""Products cut, emptied, dated wrongly, or without room: noticed, made again, never believed."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from pipeline.config.problems import InputError
from pipeline.stages.figures import making
from pipeline.workflow import owner
from pipeline.workflow.owner import LOCK, SILENCE, Ownership
from pipeline.workflow.run_store import RUNS
from pipeline.workflow.store import LOG, Store

GRID = "motion: {pga: [0.2, 0.4, 0.6], pgv_pga: [0.2, 0.4]}\n"

Command = Callable[..., Any]


@pytest.fixture
def run(vsr: Command, write_site: Callable[..., str]) -> Command:
    """Run a product of a small site, without workers."""
    return lambda product="responses", **how: vsr(
        "run", product, "--site", write_site(GRID), "--workers", "0", **how
    )


def contents(folder: Path) -> dict[str, bytes]:
    """All files but the log and the page, which hold times, and the database."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in (LOG, RUNS, "report.html", "report.json")
    }


# Cut


@pytest.mark.slow
@pytest.mark.parametrize(
    ("product", "sixteenths"),
    [
        ("responses", (0, 8)),
        pytest.param("responses", range(16), marks=pytest.mark.slow),
        ("fragility", (0, 7)),
        pytest.param("fragility", range(16), marks=pytest.mark.slow),
    ],
)
def test_cut_products_are_noticed_and_made_again(
    run: Command, derived: Path, product: str, sixteenths: Sequence[int]
) -> None:
    """Each alone is noticed; all together, manifests too, are made again to the same bits."""
    assert run(product).code == 0
    folder = derived / "rock"
    store, whole = Store(folder), contents(folder)
    files = {path.stem: json.loads(path.read_text())["files"] for path in folder.glob(".stages/*")}
    assert sum(map(len, files.values())) >= 3
    for sixteenth in sixteenths:
        for stage, made in files.items():
            for name in made:
                path = folder / name
                content = path.read_bytes()
                path.write_bytes(content[: len(content) * sixteenth // 16])
                assert store.damage(stage) == f"{name} is not what was written"
                path.write_bytes(content)
        for name, content in whole.items():
            (folder / name).write_bytes(content[: len(content) * sixteenth // 16])
        ran = run(product)
        assert ran.code == 0, ran.err
        assert contents(folder) == whole


NOTE = {"engine": "bullet", "runs": 12, "seconds": 0.5, "cpu_seconds": 0.25, "workers": 2}
LINE = json.dumps({"stage": "runs", **NOTE})
ODD = (None, [1], "12", -2, math.nan, 10**309)


@pytest.mark.parametrize("name", NOTE)
def test_damaged_line_of_the_log_is_passed_over(tmp_path: Path, name: str) -> None:
    """Each key by one letter, and each value; no number is NaN, or so negative or large."""
    damaged = [LINE.replace(f'"{name}":', f'"{chr(ord(name[0]) ^ 1)}{name[1:]}":')]
    damaged += [json.dumps({"stage": "runs", **NOTE, name: odd}) for odd in ODD]
    for line in (*damaged, "[]", "7", LINE.replace("12", "12,"), "[" * 10**5):
        (tmp_path / LOG).write_text(f"{LINE}\n{line}\n{LINE}\n")
        assert Store(tmp_path).notes("runs") == 2 * [{"stage": "runs", **NOTE}], line[:99]


def test_damaged_log_is_no_matter_to_a_plan_and_the_claims(
    write_site: Callable[..., str], derived: Path, vsr: Command
) -> None:
    for name in ("rock", "double_rock"):
        (derived / name).mkdir(parents=True)
        damaged = LINE.replace('"runs":', '"suns":')
        (derived / name / LOG).write_text(f"{LINE}\n{damaged}\n")
    ran = vsr("plan", "--site", write_site(GRID))
    assert ran.code == 0, ran.err
    speed, _ = making.speed_findings(derived)
    assert "(12 runs)" in speed.measured


@pytest.mark.slow
def test_damaged_log_is_no_matter(run: Command, derived: Path, vsr: Command) -> None:
    """A line that was never ended, as a kill or a full disk leaves it; a bit of a key."""
    assert run("fragility").code == 0
    folder = derived / "rock"
    log = (folder / LOG).read_bytes()
    cut = [log[:length] for length in range(0, len(log), len(log) // 2)]
    flipped = [log.replace(b'"runs": ', b'"suns": '), log.replace(b"_seconds", b"_secondr")]
    for damaged in (*cut, *flipped):
        assert damaged != log
        (folder / LOG).write_bytes(damaged)
        (folder / "report.html").unlink()
        ran = run("fragility")
        assert ran.code == 0, ran.err
        assert vsr("plan", "--site", str(folder.parent.parent / "rock.yaml")).code == 0
        assert (folder / LOG).read_bytes().startswith(damaged)


# A full disk


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 8 MB: HDF5 keeps files open that it cannot write, until its process ends."""
    place = tmp_path / "small"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, check=False).returncode:
        pytest.skip("no right to mount a small file system")
    try:
        yield place
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


@pytest.mark.parametrize("step", [23, pytest.param(1, marks=pytest.mark.slow)])
def test_disk_full_at_each_write(run: Command, small_disk: Path, tmp_path: Path, step: int) -> None:
    """The room is 0, 1, 2 ... pages, until it is enough: each write is once the one too many."""
    assert run(into=tmp_path / "calm").code == 0
    calm = contents(tmp_path / "calm" / "rock")
    page, into, filler = (
        os.statvfs(small_disk).f_frsize,
        small_disk / "derived",
        small_disk / "fill",
    )
    pages = 0
    while True:
        free = os.statvfs(small_disk).f_bavail
        filler.write_bytes(bytes(page * (free - pages)))
        ran = run(into=into)
        filler.unlink()
        if ran.code == 0:
            break
        refusals = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
        assert ran.code == 2, (pages, ran.err)
        assert len(refusals) == 1, (pages, ran.err)
        assert "got a full disk" in refusals[0], pages
        assert "free space" in refusals[0]
        left = contents(into / "rock") if into.exists() else {}
        for ending in ("-wal", "-shm"):  # runs that were done, and could not be moved
            left.pop(RUNS + ending, None)
        assert left.items() <= calm.items(), pages
        again = run(into=into)
        assert again.code == 0, (pages, again.err)
        assert contents(into / "rock") == calm, pages
        shutil.rmtree(into)
        pages += step
    assert pages > 20
    assert contents(into / "rock") == calm


# Clocks


@pytest.mark.slow
def test_dates_of_files_decide_nothing(run: Command, derived: Path) -> None:
    """As after a copy, or where a clock was set back."""
    assert run("fragility").code == 0
    files = [path for path in (derived / "rock").rglob("*") if path.is_file()]
    for shift in (-1e9, 1e6):
        then = time.time() + shift
        for number, path in enumerate(sorted(files)):
            os.utime(path, (then - number, then - number))
        before = {path: path.stat().st_mtime_ns for path in files}
        assert run("fragility").code == 0
        assert {path: path.stat().st_mtime_ns for path in files} == before


@pytest.mark.slow
def test_clock_that_runs_backwards(
    run: Command, derived: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(into=tmp_path / "calm").code == 0
    start, real = time.time(), time.time
    with monkeypatch.context() as patch:
        patch.setattr(time, "time", lambda: start - 10.0 * (real() - start))
        patch.setattr(time, "time_ns", lambda: int(1e9 * (start - 10.0 * (real() - start))))
        assert run().code == 0
    assert contents(derived / "rock") == contents(tmp_path / "calm" / "rock")


def test_dead_owner_from_the_future_is_given_two_minutes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a network: its last sign of life is later than the clock, which was set back since."""
    monkeypatch.setattr(owner, "is_local", lambda folder: False)
    lock, later = tmp_path / LOCK, time.time() + 1e6
    lock.write_text(json.dumps({"host": "node7", "process": 4711, "since": "2026-01-01T00:00:00"}))
    os.utime(lock, (later, later))
    with pytest.raises(InputError, match="process 4711 on node7"):
        Ownership(tmp_path)
    assert abs(lock.stat().st_mtime - time.time()) < 60.0
    ago = time.time() - SILENCE - 1.0
    os.utime(lock, (ago, ago))
    with Ownership(tmp_path):
        pass
