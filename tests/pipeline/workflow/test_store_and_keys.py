"""What is on disk is whole or not there; a key changes with what decides a result, and only so."""

from __future__ import annotations

import ast
import errno
import json
import math
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import Ran
from support import grounds
from support.following import compiled_beneath, following

from pipeline import ROOT
from pipeline.config.layers import load_site
from pipeline.config.problems import InputError
from pipeline.stages.runs.runner import Run, missing
from pipeline.stages.runs.scenes import code as run_code
from pipeline.workflow import graph, keys, store
from pipeline.workflow.graph import FINDERS, Identity, Values, identities, identity, why
from pipeline.workflow.owner import LOCK
from pipeline.workflow.registry import BY_NAME, STAGES, inputs_of
from pipeline.workflow.rows import DisplacementRow, RunRow
from pipeline.workflow.run_store import RUNS, RunStore
from pipeline.workflow.stage import Input
from pipeline.workflow.store import Store, manifest_text, read_manifest
from pipeline.workflow.writers import text
from vsr_core.outcome import Outcome
from vsr_core.run.displacement import displace
from vsr_core.source import tracing

SMALL = "motion: {pga: [0.2, 0.6], pgv_pga: [0.2, 0.5]}\n"
FACTS = {"key": "k", "facts": {}, "unresolved": 0, "retry": 0}


def files(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def shelf(tmp_path: Path) -> Store:
    shelf = Store(tmp_path / "site")
    shelf.open()
    return shelf


def row(i: int, outcome: int = 1) -> RunRow:
    return RunRow(i.to_bytes(16, "big"), outcome, 0, 0.5, 0.25, 0.125 * i, i)


@dataclass(frozen=True)
class Named(Input):
    """An input of one file, by its name."""

    digest: str

    def digests(self) -> dict[str, str]:
        return {"rock.ply": self.digest}


def test_files_of_one_name_in_two_inputs_both_count() -> None:
    stage, values = BY_NAME["exclusion"], Values(load_site("double_rock").settings)
    first, second, *_ = FINDERS
    told = {
        identity(stage, values, {first: Named(one), second: Named(other)}, {}).key
        for one, other in (("1", "2"), ("1", "3"), ("3", "2"), ("2", "1"))
    }
    assert len(told) == 4


# Products


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), OSError("no")])
def test_failed_writer_leaves_the_old_product(shelf: Store, error: BaseException) -> None:
    shelf.publish("stage", FACTS, {"a.txt": lambda path: path.write_text("old")})
    before = files(shelf.folder)

    def half(path: Path) -> None:
        path.write_text("ne")
        raise error

    with pytest.raises((ValueError, KeyboardInterrupt, InputError)):
        shelf.publish("stage", {**FACTS, "key": "new"}, {"a.txt": half})
    assert files(shelf.folder) == before
    assert shelf.damage("stage") == ""


def test_manifest_is_written_last(shelf: Store) -> None:
    seen = []

    def second(path: Path) -> None:
        seen.append(((shelf.folder / "a.txt").read_text(), shelf.manifest("stage")))
        path.write_text("two")

    shelf.publish("stage", FACTS, {"a.txt": lambda path: path.write_text("one"), "b.txt": second})
    assert seen == [("one", None)]
    assert shelf.manifest("stage")["key"] == "k"


def test_half_of_the_products_is_damage(shelf: Store) -> None:
    writers = {name: (lambda path: path.write_text("old")) for name in ("a.txt", "b.txt")}
    shelf.publish("stage", FACTS, writers)

    def fails(path: Path) -> None:
        raise ValueError

    with pytest.raises(ValueError, match=r"^$"):
        shelf.publish("stage", FACTS, {"a.txt": lambda p: p.write_text("new"), "b.txt": fails})
    assert shelf.damage("stage") == "a.txt is not what was written"


@pytest.mark.parametrize("damage", ["other text", None])
def test_a_damaged_product_is_not_lent(tmp_path: Path, damage: str | None) -> None:
    lenders: dict[tuple[str, str], Store] = {}
    lender, borrower = (Store(tmp_path / name, None, lenders) for name in ("lender", "borrower"))
    for each in (lender, borrower):
        each.open()
    lender.publish("stage", FACTS, {"a.txt": lambda path: path.write_text("whole")})
    lender.lends(["stage"])
    assert borrower.borrow("stage", "k") == "lender"
    borrower.forget("stage")
    (borrower.folder / "a.txt").unlink()
    lender.lends(["stage"])
    if damage is None:
        (lender.folder / "a.txt").unlink()
    else:
        (lender.folder / "a.txt").write_text(damage)
    assert borrower.borrow("stage", "k") == ""
    assert borrower.manifest("stage") is None
    assert not (borrower.folder / "a.txt").exists()


@pytest.mark.parametrize("stage", ["runs", "displacement_runs"])
def test_runs_without_their_database_are_not_fresh(shelf: Store, stage: str) -> None:
    identity = Identity({"config": {}})
    shelf.publish(stage, {**FACTS, "key": identity.key}, {})
    assert list(why(BY_NAME[stage], identity, shelf)) != []
    with closing(RunStore(shelf.folder, RunRow)) as runs:
        runs.add([row(1)])
    assert list(why(BY_NAME[stage], identity, shelf)) == []


def test_left_parts_go_when_the_store_opens(shelf: Store) -> None:
    with shelf:
        (shelf.folder / ".part-1-a.nc").write_bytes(b"half")
    assert shelf.open()
    assert [path.name for path in files(shelf.folder)] == [LOCK]


def test_unreadable_manifest_counts_as_none(shelf: Store) -> None:
    shelf.publish("stage", FACTS, {})
    (shelf.folder / ".stages" / "stage.json").write_text('{"key": "k", "fac')
    assert shelf.manifest("stage") is None


@pytest.mark.parametrize("changed", [("unresolved", 4), ("warning", "none"), ("key", "k2")])
def test_changed_manifest_counts_as_none(shelf: Store, changed: tuple[str, object]) -> None:
    shelf.publish("stage", FACTS, {"a.txt": text("a")})
    path = shelf.folder / ".stages" / "stage.json"
    found = json.loads(path.read_text())
    path.write_text(json.dumps(found))
    assert shelf.manifest("stage") is not None
    path.write_text(json.dumps(found | dict([changed])))
    assert shelf.manifest("stage") is None
    assert shelf.names() == {"a.txt"}  # which go with all else, or when it is made again


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rock.nc", "responses.nc", "config.yaml"])
def test_flipped_byte_is_seen_and_mended(
    write_site: Callable[..., str], vsr: Callable[..., object], derived: Path, name: str
) -> None:
    site = write_site(SMALL)
    command = ("run", "responses", "--site", site, "--workers", "0")
    assert vsr(*command).code == 0
    path = derived / "rock" / name
    whole = path.read_bytes()
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :])
    assert f"{name} is not what was written" in vsr("why", "responses", "--site", site).out
    assert vsr(*command).code == 0
    assert path.read_bytes() == whole
    assert "is not what was written" not in vsr("why", "responses", "--site", site).out


def test_stages_of_crashed_runs_are_forgotten(shelf: Store) -> None:
    """And those that need them, but none beside."""
    for stage in ("rock", "motions", "runs", "responses"):
        shelf.publish(stage, FACTS | {"retry": int(stage == "runs")}, {})
    graph._forget_crashed("responses", shelf)
    kept = [stage for stage in ("rock", "motions", "runs", "responses") if shelf.manifest(stage)]
    assert kept == ["rock", "motions"]


def test_a_warning_of_a_stage_is_shown_by_a_quiet_command(
    write_site: Callable[..., str], vsr: Callable[..., Ran], derived: Path
) -> None:
    command = ("run", "rock", "--site", write_site(SMALL), "--workers", "0", "--quiet")
    assert vsr(*command).err == ""
    manifest = derived / "rock" / ".stages" / "rock.json"
    facts = read_manifest(manifest)
    assert facts is not None
    manifest.write_text(manifest_text(facts | {"warning": "mind this"}))
    assert vsr(*command).err.splitlines() == [f"vsr: warning: {derived / 'rock'}: mind this"]


@pytest.mark.slow
def test_what_was_made_from_crashed_runs_is_made_again(
    write_site: Callable[..., str], vsr: Callable[..., Ran], derived: Path
) -> None:
    command = ("run", "responses", "--site", write_site(SMALL), "--workers", "0")
    assert vsr(*command).code == 0
    manifest = derived / "rock" / ".stages" / "runs.json"
    facts = read_manifest(manifest)
    assert facts is not None
    manifest.write_text(manifest_text(facts | {"retry": 1}))
    again = vsr(*command).err.splitlines()
    assert {line.split(":")[0] for line in again} >= {"runs", "responses"}
    assert "rock" not in {line.split(":")[0] for line in again}


# Runs

WRITER = """
import sys, time
from pathlib import Path
from pipeline.workflow.rows import RunRow
from pipeline.workflow.run_store import RunStore

def rows(batch):
    for i in range(10):
        if batch == 7 and i == 5:
            print("in the middle", flush=True)
            time.sleep(600)
        yield RunRow((10 * batch + i).to_bytes(16, "big"), 1, 0, 0.5, 0.25, 0.125 * i, batch)

runs = RunStore(Path(sys.argv[1]), RunRow)
for batch in range(9):
    runs.add(rows(batch))
"""


def test_killed_writer_loses_its_open_batch_only(tmp_path: Path) -> None:
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path)], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert writer.stdout is not None
    with writer.stdout as said:
        assert said.readline() == "in the middle\n"
        writer.send_signal(signal.SIGKILL)
    assert writer.wait() == -signal.SIGKILL
    with closing(RunStore(tmp_path, RunRow)) as runs:
        found = runs.get(row(i).key for i in range(100))
        assert sorted(found) == [row(i).key for i in range(70)]
        assert found[row(63).key] == RunRow(row(63).key, 1, 0, 0.5, 0.25, 0.375, 6)
        runs.add([row(70)])
        assert row(70).key in runs.get([row(70).key])
    with closing(sqlite3.connect(tmp_path / RUNS)) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_rows_are_added_all_or_none(tmp_path: Path, error: type[BaseException]) -> None:
    def rows() -> Iterator[RunRow]:
        yield row(1, outcome=2)  # also replaces one that is there
        yield row(2)
        raise error

    with closing(RunStore(tmp_path, RunRow)) as runs:
        runs.add([row(1)])
        with pytest.raises(error):
            runs.add(rows())
        wanted = [row(1).key, row(2).key]
        assert runs.get(wanted) == {row(1).key: row(1)}
        runs.add([row(2)])
        assert set(runs.get(wanted)) == set(wanted)


@pytest.mark.parametrize("reads", [False, True])
@pytest.mark.parametrize("ending", ["", "-wal", "-shm", "-journal"])
def test_a_pipe_beside_the_runs_is_not_waited_for(tmp_path: Path, ending: str, reads: bool) -> None:
    if ending:
        RunStore(tmp_path, RunRow).close()
    os.mkfifo(tmp_path / f"runs.sqlite{ending}")
    with pytest.raises(InputError, match=f"runs.sqlite{ending}: got a pipe, a device or a folder"):
        RunStore(tmp_path, RunRow, reads=reads)


def test_rows_come_back_as_they_went(tmp_path: Path) -> None:
    lost = RunRow(b"x" * 16, 5)
    odd = RunRow(b"y" * 16, 1, 3, math.pi, math.nextafter(1.0, 2.0), 5e-324, 2**31 - 1)
    with closing(RunStore(tmp_path, RunRow)) as runs:
        runs.add([lost, odd])
    with closing(RunStore(tmp_path, RunRow)) as runs:
        assert runs.get([b"x" * 16, b"y" * 16, b"z" * 16]) == {lost.key: lost, odd.key: odd}
        assert runs.get([]) == {}


def test_two_kinds_of_rows_in_one_file(tmp_path: Path) -> None:
    """Runs and displacement runs of the same cells and keys know nothing of each other."""
    one, other = row(1, outcome=2), row(2)
    moved = [
        DisplacementRow(one.key, 1, 0.5, math.nextafter(0.1, 1.0), 12, 0, bytes(range(256)) * 300),
        DisplacementRow(other.key, 5),
    ]
    with (
        closing(RunStore(tmp_path, RunRow)) as runs,
        closing(RunStore(tmp_path, DisplacementRow)) as travelled,
    ):
        runs.add([one])
        assert travelled.get([one.key]) == {}
        travelled.add(moved)
        assert runs.get([one.key, other.key]) == {one.key: one}
        runs.add([other])
    with closing(RunStore(tmp_path, DisplacementRow)) as travelled:
        found = travelled.get([one.key, other.key, b"z" * 16])
        assert found == {row.key: row for row in moved}
        assert isinstance(found[one.key].trajectory, bytes)
        assert travelled.outcomes([one.key, other.key, b"z" * 16]) == {one.key: 1, other.key: 5}
        travelled.add([moved[1]._replace(outcome=1)])  # a crashed one that was tried again
        assert travelled.outcomes([other.key]) == {other.key: 1}
    with closing(RunStore(tmp_path, RunRow)) as runs:
        assert runs.outcomes([one.key, other.key]) == {one.key: 2, other.key: 1}


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_displacement_runs_are_added_all_or_none(
    tmp_path: Path, error: type[BaseException]
) -> None:
    whole = DisplacementRow(b"a" * 16, 1, 0.5, 0.1, 9, 0, b"way")

    def rows() -> Iterator[DisplacementRow]:
        yield whole._replace(trajectory=b"other")
        raise error

    with closing(RunStore(tmp_path, DisplacementRow)) as travelled:
        travelled.add([whole])
        with pytest.raises(error):
            travelled.add(rows())
        assert travelled.get([whole.key]) == {whole.key: whole}


def test_only_runs_that_are_not_stored_or_crashed_are_missing(tmp_path: Path) -> None:
    keys_of = tuple(bytes([k]) * 16 for k in range(1, 5))
    wanted = [Run(key, 0.1 * k) for k, key in enumerate(keys_of)]
    with closing(RunStore(tmp_path, DisplacementRow)) as travelled:
        assert missing(wanted, travelled) == bytes([1, 1, 1, 1])
        done = DisplacementRow(keys_of[1], 1, 0.5, 0.1, 9, 0, b"way")
        travelled.add([done, DisplacementRow(keys_of[2], int(Outcome.CRASHED))])
        assert missing(wanted, travelled) == bytes([1, 0, 1, 1])
    with closing(RunStore(tmp_path, RunRow)) as runs:
        assert missing(wanted, runs) == bytes([1, 1, 1, 1])


# Folders that cannot be written to


def test_file_in_place_of_the_folder(
    write_site: Callable[..., str], vsr: Callable[..., object], derived: Path
) -> None:
    derived.write_text("mine")
    ran = vsr("run", "responses", "--site", write_site(SMALL), "--workers", "0")
    assert ran.code == 2
    assert len(ran.err.splitlines()) == 1
    for word in (str(derived), "a file", "give another"):
        assert word in ran.err
    assert derived.read_text() == "mine"


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_disk_that_fills_up(
    write_site: Callable[..., str],
    vsr: Callable[..., object],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    command = ("run", "responses", "--site", write_site(SMALL), "--workers", "0")
    with monkeypatch.context() as patch:
        patch.setattr(store.os, "fsync", full)
        ran = vsr(*command)
    assert ran.code == 2
    assert len(ran.err.splitlines()) == 1
    assert "No space left on device" in ran.err
    assert "free space" in ran.err
    assert files(derived) == {}
    assert vsr(*command).code == 0


LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
from pipeline import cli
sys.exit(cli.main(sys.argv[2:]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("limit", [pytest.param(20_000, marks=pytest.mark.slow), 66_000])
def test_no_room_for_a_large_file(
    write_site: Callable[..., str], derived: Path, limit: int
) -> None:
    """The kernel refuses to let any file grow past ``limit``: at the probe, or in the runs."""
    grid = "{start: 0.005, stop: 0.15, num: 40}"  # all proved not to move: many runs, no time
    site = write_site(f"motion: {{pga: {grid}, pgv_pga: {grid}}}\n")
    command = ["run", "responses", "--site", site, "--workers", "0", "--derived", str(derived)]
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(limit), *command],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert done.returncode == 2, done.stderr
    refusals = [line for line in done.stderr.splitlines() if line.startswith("vsr: ")]
    assert len(refusals) == 1
    assert "cannot be written" in refusals[0]
    assert "Traceback" not in done.stderr
    assert not (derived / "rock" / "responses.nc").exists()
    assert not list(derived.rglob(".part-*"))
    assert not list(derived.rglob("vsr-fault.txt"))


def test_full_disk(write_site: Callable[..., str], tmp_path: Path) -> None:
    """A file system of 100 kB: NetCDF's own complaint becomes the same line."""
    small = tmp_path / "small"
    small.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=100k", "tmpfs", str(small)]
    if shutil.which("mount") is None or subprocess.run(mount, check=False).returncode:
        pytest.skip("no right to mount a small file system")
    try:
        site = write_site(SMALL)
        command = ["-m", "pipeline", "run", "responses", "--site", site, "--workers", "0"]
        done = subprocess.run(
            [sys.executable, *command, "--derived", str(small)],
            capture_output=True,
            text=True,
            check=False,
            cwd=ROOT,
        )
        left = {path.name for path in files(small)}
    finally:
        subprocess.run(["umount", str(small)], check=True)
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert sum("cannot be written" in line for line in done.stderr.splitlines()) == 1
    assert left & {"rock.nc", "motions.nc"}  # made side by side: whichever had room
    assert "responses.nc" not in left
    assert not any(name.startswith(".part") for name in left)


# Keys of values


def test_digest_takes_no_nan_and_no_objects() -> None:
    for value in (float("nan"), float("inf"), {"a": [1.0, float("nan")]}):
        with pytest.raises(ValueError, match="not JSON compliant"):
            keys.digest(value)
    with pytest.raises(TypeError):
        keys.digest({"a": np.float32(1.0)})


def test_digest_knows_values_and_not_their_order() -> None:
    one = keys.digest({"a": 1.0, "b": [1, 2]})
    assert keys.digest({"b": [1, 2], "a": 1.0}) == one
    others = [{"a": 1.0, "b": [2, 1]}, {"a": -1.0, "b": [1, 2]}, {"a": 1.0, "b": [1, 2, 3]}]
    assert len({one, *map(keys.digest, others)}) == 4
    assert keys.digest_bytes(b"ab", b"c") != keys.digest_bytes(b"a", b"bc")


def test_key_does_not_depend_on_the_order_or_spelling_in_yaml(
    write_site: Callable[..., str],
) -> None:
    one = write_site("motion:\n  pga: [0.2, 0.6]\n  pgv_pga: 0.3\ncontact: {friction: 0.5}\n", "a")
    two = write_site(
        "contact:\n  friction: [5e-1]\nmotion:\n  pgv_pga: {start: 0.3, stop: 0.3, num: 1}\n"
        "  pga: {start: 0.2, stop: 0.6, num: 2}  # g\n",
        "b",
    )
    other = write_site("motion: {pga: [0.2, 0.61], pgv_pga: 0.3}\ncontact: {friction: 0.5}\n", "c")
    keyed = [identities("report", load_site(site)) for site in (one, two, other)]
    for stage in keyed[0]:
        assert keyed[0][stage].key == keyed[1][stage].key
        changed = keyed[0][stage].key != keyed[2][stage].key
        assert changed == (stage not in ("rock", "time_step"))


# Keys of code

DECIDES = {
    "vsr_core.judge.proofs:barrier": {"rock"},  # which runs take from the rock
    "vsr_core.rock.tipping:rest_tilts": {"rock"},
    "vsr_core.rock.triangles:self_intersections": {"rock"},
    "pipeline.stages.runs.overturning_runs:simulate_batch": {"runs"},
    "pipeline.stages.runs.overturning_runs:make": {"runs"},
    "pipeline.stages.fragility.fragility_figures:fragility_by_yaw": {"report"},
    "pipeline.workflow.dispatch:_next": {"rock", "runs"},  # by annotations
}
"""Functions, and which of the stages of rock, runs and report they have to decide."""


@pytest.mark.slow
def test_stages_decided_by_a_function(edit_function: Callable[[str, str, str], None]) -> None:
    site = load_site("cuboid_1x1x2")

    def codes() -> dict[str, dict[str, str]]:
        return {name: i.facts["code"] for name, i in identities("report", site).items()}

    def edit_each(line: str) -> None:
        for name in DECIDES:
            module, _, function = name.partition(":")
            edit_function(f"{module.replace('.', '/')}.py", function, line)

    before = codes()
    edit_each("# a comment, and nothing else\n")
    assert codes() == before
    edit_each("str(1)")
    after = codes()
    for function, decided in DECIDES.items():
        changed = {s for s in after if after[s].get(function) != before[s].get(function)}
        assert decided <= changed, function
        assert not ({"rock", "runs"} - decided) & changed, function
    touched = {name for stage in after for name in after[stage].items() - before[stage].items()}
    assert {name for name, _ in touched} <= set(DECIDES)


@cache
def names_in(module: str) -> dict[str, set[str]]:
    """Names in each definition of a module."""
    path = ROOT.joinpath(*module.split("."))
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    found: dict[str, set[str]] = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        own = {one for one in ast.walk(node) if isinstance(one, ast.Name)}
        given = {one.id for one in own if isinstance(one.ctx, ast.Store)}
        for name in {node.name} if hasattr(node, "name") else given:
            found[name] = found.get(name, set()) | {one.id for one in own}
    return found


@pytest.mark.slow
def test_libraries_that_shape_rock_and_ground_are_in_the_keys_of_what_they_shape() -> None:
    using = set()
    for stage in STAGES:
        finders = [FINDERS[path].find for path in inputs_of(stage.make)]
        for definition in tracing.reached([stage.make, *stage.code, *finders]):
            module, _, name = definition.partition(":")
            for library in ("coacd", "fast_simplification", "shapely"):
                if library in names_in(module).get(name, ()):
                    using.add((stage.name, library))
                    assert library.replace("_", "-") in stage.versions, (stage.name, definition)
    assert {("scan", "coacd"), ("terrain", "fast_simplification"), ("rock", "shapely")} <= using


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["bullet", "mujoco", "nonsmooth"])
def test_every_function_that_a_run_enters_is_in_its_key(engine: str) -> None:
    """Followed while it runs, so that a call the syntax does not show would be found."""
    from vsr_core import GRAVITY
    from vsr_core.judge import proofs
    from vsr_core.motions.pulses import CosinePulse
    from vsr_core.rock import solid
    from vsr_core.run.cases import Settings, prepare
    from vsr_core.run.overturning import simulate
    from vsr_core.run.time_step import step_unit
    from vsr_core.scene import Contact, Scene

    rock = solid.box((0.5, 1.0, 2.0), 2000.0).rock
    cells = [(0.1, 0.3), (0.6, 0.3), (0.3, 1.0)]
    step = 0.01 * step_unit(rock)
    with following() as entered:
        for reduce in (True, False):
            case = prepare(Scene(rock, Contact(0.6), 0.3), proofs.barrier(rock), reduce=reduce)
            settings = Settings(step, reduce, engine)
            for ratio, pga in cells:
                simulate(case, CosinePulse(pga * GRAVITY, ratio), settings)
    entered |= (beneath := compiled_beneath(entered))
    assert len(entered) > 15
    assert ("vsr_core.engines.nonsmooth.stepping:step" in beneath) == (engine == "nonsmooth")
    assert entered - set(tracing.reached(run_code(engine, terrain=False))) == set()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["bullet", "nonsmooth"])
def test_every_function_that_a_displacement_run_enters_is_in_its_key(engine: str) -> None:
    from vsr_core.motions.pulses import CosinePulse
    from vsr_core.run.cases import Settings

    rock = grounds.lump()
    triangles = grounds.perch(cells=6)
    places = [grounds.site(rock, triangles), grounds.site(rock, grounds.cliff(1.0, 0.3))]
    places.append(grounds.site(rock, grounds.in_parts(triangles, 0.01, 0.04)))
    with following() as entered:
        for place in places:
            motion, follow = CosinePulse.from_g(0.7, 0.15), place is places[0]
            displace(place, motion, Settings(0.004, engine=engine), follow=follow)
    entered |= (beneath := compiled_beneath(entered))
    assert len(entered) > 15
    assert ("vsr_core.engines.nonsmooth.terrain_runs:_run" in beneath) == (engine == "nonsmooth")
    assert entered - set(tracing.reached(run_code(engine, terrain=True))) == set()


def test_every_function_that_a_recorded_test_enters_is_in_its_key() -> None:
    """The draw of a specimen, its limits, and each kind of motion of a table."""
    import trimesh

    from vsr_core import GRAVITY
    from vsr_core.judge.proofs import barrier
    from vsr_core.motions.pulses import CosinePulse
    from vsr_core.motions.records.components import ComponentMotion
    from vsr_core.motions.records.trace import RecordedMotion, Trace
    from vsr_core.table.stepper import SteppedPulse, Stepper
    from vsr_core.validation import priors, specimen

    pulse = CosinePulse(0.5 * GRAVITY, 0.2)
    record = RecordedMotion(Trace(4.0 * np.sin(np.arange(200) / 10.0), 0.005))
    along = ComponentMotion((record, record, record))
    given = [pulse, record, along, SteppedPulse(pulse, Stepper(100.0, 1e-4, 1e-4))]
    box = specimen.form(trimesh.creation.box([0.1, 0.1, 0.25]).subdivide(), None)
    member = priors.best_guess(priors.Priors())
    with following() as entered:
        rock = specimen.drawn(box, member, 2700.0)
        case = specimen.standing_case(rock, barrier(rock), member)
        specimen.shaken(case, [specimen.amplified(motion, 1.1) for motion in given])
    entered |= compiled_beneath(entered)
    assert "vsr_core.table.stepper:SteppedPulse" in entered
    assert entered - set(tracing.reached(keys.VALIDATION_CODE)) == set()


def test_manifest_holds_a_checksum_of_every_product(
    write_site: Callable[..., str], vsr: Callable[..., object], derived: Path
) -> None:
    assert vsr("run", "responses", "--site", write_site(SMALL), "--workers", "0").code == 0
    manifests = (derived / "rock" / ".stages").glob("*.json")
    listed: dict[str, str] = {}
    for path in manifests:
        listed |= json.loads(path.read_text())["files"]
    kept = {path.name for path in (derived / "rock").iterdir() if path.is_file()}
    assert set(listed) == kept - {RUNS, "log.jsonl"}
    for name, checksum in listed.items():
        assert keys.digest_file(derived / "rock" / name) == checksum


@pytest.mark.parametrize("content", [b"<body>999 kg", b"<body>\xff"])
def test_a_page_that_was_changed_on_disk_is_never_vouched_for(shelf: Store, content: bytes) -> None:
    shelf.publish("report", dict(FACTS), {"report.html": text("<body>527 kg")})
    for reason in ("rock.density changed", ""):
        shelf.mark("report", reason)
        assert shelf.damage("report") == ""
    (shelf.folder / "report.html").write_bytes(content)
    for reason in ("rock.density changed", ""):
        shelf.mark("report", reason)
        assert shelf.damage("report") == "report.html is not what was written"
    assert (shelf.folder / "report.html").read_bytes() == content
