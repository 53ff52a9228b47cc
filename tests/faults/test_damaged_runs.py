"""Bits flipped, pages torn, files cut: no wrong number is read, and what is sound stays."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from pipeline.workflow import run_store
from pipeline.workflow.datasets import read
from pipeline.workflow.rows import DisplacementRow, RunRow
from pipeline.workflow.run_store import DAMAGED, RUNS, RunsLost, RunStore

ROWS = [
    RunRow(random.Random(k).randbytes(16), k % 3, k % 4, 0.1 * k, 1.0 / (k + 1), 1e-3 * k, k)
    for k in range(400)
]
CRASHED = RunRow(b"c" * 16, 5)
TRAVELS = [
    DisplacementRow(random.Random(1000 + k).randbytes(16), 2, 0.1, 0.2 * k, k, 1, bytes([k]) * 900)
    for k in range(1, 30)
]
TRUTH = {row.key: row for row in (*ROWS, CRASHED, *TRAVELS)}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("whole")
    with closing(RunStore(folder, RunRow)) as runs:
        runs.add([*ROWS, CRASHED])
    with closing(RunStore(folder, DisplacementRow)) as travelled:
        travelled.add(TRAVELS)
    assert [path.name for path in folder.iterdir()] == [RUNS]
    return (folder / RUNS).read_bytes()


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is shown of damage, of a quiet command too."""
    lines: list[str] = []
    monkeypatch.setattr(run_store, "complain", lines.append)
    return lines


def rows_of(folder: Path, **how: Any) -> dict[bytes, Any]:
    """All rows that a store reads, with the outcomes that it reads alone."""
    found: dict[bytes, Any] = {}
    for row, wanted in ((RunRow, [*ROWS, CRASHED]), (DisplacementRow, TRAVELS)):
        with closing(RunStore(folder, row, **how)) as runs:
            rows = runs.get(one.key for one in wanted)
            outcomes = runs.outcomes(one.key for one in wanted)
        assert {key: one.outcome for key, one in rows.items()} == outcomes
        found |= rows
    return found


def add(folder: Path, rows: Iterable[Any]) -> None:
    for kind, some in groupby(rows, type):
        with closing(RunStore(folder, kind)) as runs:
            runs.add(some)


def test_what_was_cut_short_is_taken_back_before_it_is_read(tmp_path: Path, whole: bytes) -> None:
    """As power or a kill leaves a transaction: half in the database, the rest in its journal."""
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    after.mkdir()
    (before / RUNS).write_bytes(whole)
    with closing(sqlite3.connect(before / RUNS, isolation_level=None)) as database:
        database.execute("PRAGMA cache_size=1")  # pages are written before the end
        database.execute("BEGIN IMMEDIATE")
        for (table,) in database.execute("SELECT name FROM sqlite_master").fetchall():
            database.execute(f"DELETE FROM {table}")
        shutil.copytree(before, after, dirs_exist_ok=True)
        database.execute("ROLLBACK")
    assert (after / f"{RUNS}-journal").stat().st_size
    assert (after / RUNS).read_bytes() != whole
    assert rows_of(after, reads=True) == TRUTH


@pytest.mark.parametrize("name", [b"outcome", b"checksum"])
def test_a_column_whose_name_is_no_text_is_no_crash(
    tmp_path: Path, whole: bytes, name: bytes, said: list[str]
) -> None:
    damaged = whole.replace(name + b" ", b"\xe3" + name[1:] + b" ")
    assert damaged != whole
    (tmp_path / RUNS).write_bytes(damaged)
    found = rows_of(tmp_path)
    assert found.items() <= TRUTH.items()
    assert said
    add(tmp_path, [row for key, row in TRUTH.items() if key not in found])
    assert rows_of(tmp_path, reads=True) == TRUTH


@pytest.fixture
def in_memory(tmp_path: Path) -> Iterator[Path]:
    """A folder that waits for no disk, where there is one."""
    memory = Path("/dev/shm")
    with TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else tmp_path) as folder:
        yield Path(folder)


@pytest.mark.parametrize(
    ("flips", "seed"), [(150, 12), pytest.param(2500, 77, marks=pytest.mark.slow)]
)
def test_no_flipped_bit_gives_a_wrong_number(
    whole: bytes, in_memory: Path, flips: int, seed: int, said: list[str]
) -> None:
    """Read as ``status`` does, then opened to write, with what is missing done again."""
    chance = random.Random(seed)
    told = refused = most = 0
    for number in range(flips):
        place = chance.randrange(100) if number < 60 else chance.randrange(len(whole))
        flipped = bytearray(whole)
        flipped[place] ^= 1 << chance.randrange(8)
        folder = in_memory / str(number)
        folder.mkdir()
        (folder / RUNS).write_bytes(flipped)
        try:
            assert rows_of(folder, reads=True).items() <= TRUTH.items(), place
        except RunsLost:
            refused += 1
        assert (folder / RUNS).read_bytes() == flipped, place
        said.clear()
        found = rows_of(folder)
        assert found.items() <= TRUTH.items(), place
        lost = [row for key, row in TRUTH.items() if key not in found]
        aside = [path for path in folder.iterdir() if DAMAGED in path.name]
        assert len(aside) == len(said) <= 1, place
        assert said or not lost, place
        told, most = told + len(said), max(most, len(lost))
        add(folder, lost)
        assert rows_of(folder, reads=True) == TRUTH, place
        shutil.rmtree(folder)
    assert told > flips / 2
    assert refused > 10
    assert most == len(TRUTH)  # where the header was hit; else few


@pytest.mark.parametrize("sixteenth", range(16))
def test_cut_database_is_told_and_redone(
    whole: bytes, tmp_path: Path, sixteenth: int, said: list[str]
) -> None:
    (tmp_path / RUNS).write_bytes(whole[: len(whole) * sixteenth // 16])
    found = rows_of(tmp_path)
    assert found.items() <= TRUTH.items()
    assert len(said) == 1
    assert f"set aside as {RUNS}{DAMAGED}1; what is sound of it stays, {len(found)} row" in said[0]
    add(tmp_path, [row for key, row in TRUTH.items() if key not in found])
    assert rows_of(tmp_path, reads=True) == TRUTH


def test_nothing_that_was_set_aside_is_lost(whole: bytes, tmp_path: Path) -> None:
    for number in (1, 2, 3):
        torn = whole[:5000] + bytes([number]) * 3000 + whole[8000:]
        (tmp_path / RUNS).write_bytes(torn)
        rows_of(tmp_path)
        assert (tmp_path / f"{RUNS}{DAMAGED}{number}").read_bytes() == torn


def test_sound_rows_stay_though_the_mending_is_cut_short(
    whole: bytes, tmp_path: Path, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / RUNS).write_bytes(whole[:-4000])
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", lambda *given: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            rows_of(tmp_path)
    for part in tmp_path.glob(".part-*"):  # as the next command does
        part.unlink()
    assert rows_of(tmp_path)
    assert len(said) == 1


def test_table_of_an_earlier_version_is_set_aside(tmp_path: Path, said: list[str]) -> None:
    with closing(sqlite3.connect(tmp_path / RUNS)) as database, database:
        database.execute("CREATE TABLE runs (key BLOB PRIMARY KEY, outcome INTEGER) WITHOUT ROWID")
        database.execute("INSERT INTO runs VALUES (?, 1)", (ROWS[0].key,))
    assert rows_of(tmp_path) == {}
    assert "tables of another version" in said[0]


GRID = "motion: {pga: [0.2, 0.4, 0.6], pgv_pga: [0.2, 0.4]}\n"


def spoil(file: Path, how: str) -> None:
    """Change a number of one row, or tear a page, as a failing disk would."""
    if how == "a row":
        with closing(sqlite3.connect(file)) as database, database:
            database.execute("UPDATE runs SET outcome = 0 WHERE outcome = 1")
    else:
        content = bytearray(file.read_bytes())
        content[4096:4200] = bytes(104)
        file.write_bytes(content)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["a row", "a page"])
@pytest.mark.parametrize("then", ["wider", "again", "products gone"])
def test_damaged_runs_are_told_set_aside_and_done_again(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    tmp_path: Path,
    how: str,
    then: str,
) -> None:
    wide = ("--set", "motion.pga=[0.2, 0.3, 0.4, 0.6]") if then == "wider" else ()
    command = ("run", "responses", "--site", write_site(GRID), "--workers", "0")
    assert vsr(*command, *wide, into=tmp_path / "whole").code == 0
    whole = (tmp_path / "whole" / "rock" / "responses.nc").read_bytes()
    assert vsr(*command).code == 0
    folder = derived / "rock"
    assert np.any(read(folder / "responses.nc")["outcome"] == 1)
    spoil(folder / RUNS, how)
    status = vsr("status", "responses", "--site", write_site(GRID))
    if how == "a page":
        assert status.code == 2
        assert len(status.err.splitlines()) == 1
        assert f"{RUNS}: got a damaged database" in status.err
    else:
        assert "6 of 6 runs stored" not in status.out
    if then == "products gone":
        (folder / "responses.nc").unlink()
    ran = vsr(*command, *wide)
    assert ran.code == 0, ran.err
    assert (folder / "responses.nc").read_bytes() == whole
    aside = list(folder.glob(f"{RUNS}{DAMAGED}*"))
    if then == "again":  # whose products are sound: the runs are not looked at
        assert not aside
    else:
        assert [path.name for path in aside] == [f"{RUNS}{DAMAGED}1"]
        assert sum(f"set aside as {RUNS}{DAMAGED}1" in line for line in ran.err.splitlines()) == 1
        assert "6 of 6 runs stored" in vsr("status", "responses", "--site", write_site(GRID)).out
