"""A folder has one owner at a time; who only reads needs neither a lock nor the right to write."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import trimesh
import xarray as xr
from conftest import Ran

from pipeline import ROOT
from pipeline.config.problems import InputError
from pipeline.inspection import disk
from pipeline.stages.mesh import mesh_files
from pipeline.workflow import graph, owner
from pipeline.workflow.owner import LOCK, Ownership
from pipeline.workflow.run_store import RUNS
from pipeline.workflow.store import LOG

GRID = "motion: {pga: [0.2, 0.4, 0.6], pgv_pga: [0.2, 0.4]}\n"

HOLDS = """
import sys, time
from pathlib import Path
from pipeline.workflow.owner import Ownership

with Ownership(Path(sys.argv[1])):
    print("mine", flush=True)
    time.sleep(600)
"""


@contextmanager
def held(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that owns a folder; killed in the end."""
    command = [sys.executable, "-c", HOLDS, str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "mine\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def stamps(folder: Path) -> dict[Path, tuple[int, bytes]]:
    found = [path for path in folder.rglob("*") if path.is_file()]
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in found}


@pytest.fixture
def made(vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path) -> Path:
    """The folder of a site whose responses are made."""
    command = ("run", "responses", "--site", write_site(GRID), "--workers", "0")
    assert vsr(*command).code == 0
    assert not (derived / "rock" / LOCK).exists()
    return derived / "rock"


@pytest.mark.slow
def test_second_command_says_who_is_at_work(
    made: Path, vsr: Callable[..., Any], write_site: Callable[..., str]
) -> None:
    site = write_site(GRID)
    wider = ("run", "responses", "--site", site, "--workers", "0", "--set", "yaw=[0, 90]")
    before = stamps(made)
    with held(made) as process:
        for command in (wider, ("clean", "--site", "rock", "--yes"), ("clean", "--yes")):
            ran = vsr(*command)
            assert ran.code == 2, command
            assert len(ran.err.splitlines()) == 1
            for word in (str(made), f"process {process.pid} on {socket.gethostname()}", "wait"):
                assert word in ran.err
        for reading in (("run", "responses"), ("status",), ("why",), ("plan",)):
            assert vsr(*reading, "--site", site).code == 0, reading
        after = stamps(made)
        assert after.pop(made / LOCK)
        assert after == before
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert (made / LOCK).exists()
        assert vsr(*wider).code == 0  # the dead one is recognised at once
    assert not (made / LOCK).exists()
    assert vsr("clean", "--yes").code == 0
    assert not made.exists()


@pytest.mark.slow
def test_a_variant_is_not_removed_while_its_site_has_an_owner(
    made: Path, vsr: Callable[..., Any], write_site: Callable[..., str]
) -> None:
    """A command that makes a variant owns the folder of its site."""
    assert vsr("run", "responses", "--site", write_site(GRID), "--name", "rough").code == 0
    variant = made.with_name("rock@rough")
    with held(made):
        before = stamps(variant)
        for command in (("clean", "--site", "rock@rough", "--yes"), ("clean", "--yes")):
            assert vsr(*command).code == 2, command
            assert stamps(variant) == before
    assert vsr("clean", "--site", "rock@rough", "--yes").code == 0
    assert not variant.exists()
    assert stamps(made).keys() >= {made / "responses.nc"}


def test_what_a_killed_owner_left_goes_though_nothing_is_to_do(
    made: Path, vsr: Callable[..., Any], write_site: Callable[..., str]
) -> None:
    """Killed when all was made, and before the folder was given back."""
    before = stamps(made)
    with held(made) as process:
        process.send_signal(signal.SIGKILL)
        process.wait()
        for name in (".part-1-rock.nc", ".try-abc"):
            (made / name).write_text("x")
        assert vsr("status", "--site", write_site(GRID)).code == 0
        assert (made / LOCK).exists()
        assert vsr("run", "responses", "--site", write_site(GRID)).code == 0
    assert stamps(made) == before


def test_a_file_that_goes_while_a_command_is_at_work_is_told_in_a_line(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As where the disk of the results is taken away; the folder is named from the current one."""
    monkeypatch.chdir(derived.parent)
    keep = graph.keep

    def kept(stage: str, *rest: Any) -> None:
        keep(stage, *rest)
        if stage == "responses":
            (derived / "rock" / "responses.nc").unlink()

    monkeypatch.setattr(graph, "keep", kept)
    own = Path("derived")
    ran = vsr("run", "boundary", "--site", write_site(GRID), "--workers", "0", into=own)
    assert ran.code == 2
    assert "files are gone since" in ran.err.splitlines()[-1]
    assert not (derived / "vsr-fault.txt").exists()


@pytest.mark.parametrize("name", [LOCK, LOG])
def test_no_link_of_another_is_written_through(
    made: Path, vsr: Callable[..., Any], write_site: Callable[..., str], tmp_path: Path, name: str
) -> None:
    own = tmp_path / "own.txt"
    own.write_text("mine")
    (made / name).unlink(missing_ok=True)
    (made / name).symlink_to(own)
    wider = ("run", "responses", "--site", write_site(GRID), "--set", "yaw=[0, 90]")
    ran = vsr(*wider, "--workers", "0")
    assert (ran.code, own.read_text()) == (2, "mine")
    assert name in ran.err.splitlines()[-1]


def test_two_commands_at_once_do_everything_once(
    write_site: Callable[..., str], derived: Path, vsr: Callable[..., Any], tmp_path: Path
) -> None:
    site = write_site(GRID)
    command = [sys.executable, "-m", "pipeline", "run", "responses", "--site", site]
    command += ["--workers", "0", "--derived", str(derived)]
    both = [
        subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=ROOT) for _ in range(2)
    ]
    said = [process.communicate(timeout=120)[1] for process in both]
    codes = sorted(process.returncode for process in both)
    assert codes in ([0, 0], [0, 2]), said
    notes = [json.loads(line) for line in (derived / "rock" / "log.jsonl").open()]
    assert sum(note["runs"] for note in notes if note["stage"] == "runs") == 6
    assert vsr(*command[3:-2], into=tmp_path / "alone").code == 0
    alone = tmp_path / "alone" / "rock" / "responses.nc"
    assert (derived / "rock" / "responses.nc").read_bytes() == alone.read_bytes()


TAKES_TURNS = """
import sys, time
from pathlib import Path
from pipeline.config.problems import InputError
from pipeline.workflow.owner import Ownership

folder, done = Path(sys.argv[1]), 0
while done < 15:
    try:
        with Ownership(folder):
            count = int((folder / "count").read_text())
            time.sleep(0.001)
            (folder / "count").write_text(str(count + 1))
            done += 1
    except InputError:
        time.sleep(0.001)
"""


def test_owners_take_turns(tmp_path: Path) -> None:
    """Four processes that count in one file: none overwrites what another counted."""
    (tmp_path / "count").write_text("0")
    command = [sys.executable, "-c", TAKES_TURNS, str(tmp_path)]
    processes = [subprocess.Popen(command, cwd=ROOT) for _ in range(4)]
    assert [process.wait(timeout=60) for process in processes] == [0] * 4
    assert (tmp_path / "count").read_text() == "60"
    assert [path.name for path in tmp_path.iterdir()] == ["count"]


# Network file systems, where locks of other machines may not be seen


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner, "is_local", lambda folder: False)


def left_by(folder: Path, host: str, process: int, seconds_ago: float) -> None:
    owned = {"host": host, "process": process, "since": "2026-01-01T00:00:00"}
    (folder / LOCK).write_text(json.dumps(owned))
    then = time.time() - seconds_ago
    os.utime(folder / LOCK, (then, then))


@pytest.mark.parametrize(("ago", "free"), [(1.0, False), (100.0, False), (200.0, True)])
def test_owner_on_another_machine_is_dead_when_silent(
    tmp_path: Path, network: None, ago: float, free: bool
) -> None:
    left_by(tmp_path, "node7", 4711, ago)
    if free:
        with Ownership(tmp_path):
            assert json.loads((tmp_path / LOCK).read_text())["process"] == os.getpid()
    else:
        with pytest.raises(InputError, match="process 4711 on node7"):
            Ownership(tmp_path)
        assert json.loads((tmp_path / LOCK).read_text())["process"] == 4711
    assert len(list(tmp_path.iterdir())) == (not free)


def test_machine_of_another_name_shares_no_local_disk(tmp_path: Path) -> None:
    left_by(tmp_path, "before-it-was-renamed", 1, 0.0)
    with Ownership(tmp_path):
        pass


def test_owner_gives_signs_of_life(
    tmp_path: Path, network: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(owner, "BEAT", 0.01)
    with Ownership(tmp_path):
        os.utime(tmp_path / LOCK, (1.0, 1.0))
        deadline = time.monotonic() + 10.0
        while (tmp_path / LOCK).stat().st_mtime == 1.0:
            assert time.monotonic() < deadline
            time.sleep(0.01)


@pytest.mark.parametrize("lives", [True, False])
def test_without_locks_the_process_is_looked_for(
    tmp_path: Path, network: None, monkeypatch: pytest.MonkeyPatch, lives: bool
) -> None:
    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, "no locks available")

    monkeypatch.setattr(owner.fcntl, "flock", none)
    monkeypatch.setattr(owner, "SETTLED", 0.01)
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    left_by(tmp_path, socket.gethostname(), os.getppid() if lives else gone.pid, 500.0)
    if lives:
        with pytest.raises(InputError, match=f"process {os.getppid()} on"):
            Ownership(tmp_path)
    else:
        with Ownership(tmp_path), pytest.raises(InputError, match=f"process {os.getpid()} on"):
            Ownership(tmp_path)


# Reading


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """The folder as one may read it and not write to it, even as root."""
    if os.geteuid():
        folders = [path for path in (folder, *folder.rglob("*")) if path.is_dir()]
        for path in folders:
            path.chmod(0o555)
        try:
            yield
        finally:
            for path in folders:
                path.chmod(0o755)
        return
    bind = ["mount", "--bind", str(folder), str(folder)]
    if subprocess.run(bind, check=False, capture_output=True).returncode:
        pytest.skip("no right to mount")
    try:
        subprocess.run(["mount", "-o", "remount,ro,bind", str(folder)], check=True)
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("left", ["closed", "killed", "killed and copied"])
def test_reading_needs_no_right_to_write(
    made: Path, vsr: Callable[..., Any], write_site: Callable[..., str], left: str
) -> None:
    site = write_site(GRID)
    if left != "closed":  # a database in the mode of a write-ahead log
        with closing(sqlite3.connect(made / RUNS)) as database:
            assert database.execute("PRAGMA journal_mode=WAL").fetchall() == [("wal",)]
            database.execute("CREATE TABLE t (a)")
            database.execute("DROP TABLE t")
            if left == "killed":
                for ending in ("-wal", "-shm"):
                    kept = made / f"kept{ending}"
                    kept.write_bytes((made / f"{RUNS}{ending}").read_bytes())
        for path in made.glob("kept-*"):
            path.rename(made / f"{RUNS}{path.name[4:]}")
    with read_only(made.parent):
        with pytest.raises(OSError, match=r"denied|Read-only"):
            (made / "x").touch()
        before = stamps(made)
        for command in ("status", "why", "plan"):
            ran = vsr(command, "responses", "--site", site)
            assert ran.code == 0, ran.err
            assert "6 of 6" in ran.out or command == "plan"
        assert vsr("run", "responses", "--site", site).code == 0
        assert vsr("list").code == 0
        assert stamps(made) == before
        ran = vsr("run", "responses", "--site", site, "--set", "yaw=[0, 90]")
        assert ran.code == 2
        assert len(ran.err.splitlines()) == 1
        assert "cannot be written" in ran.err


# Journals

MOUNTED = """\
22 1 254:0 / / rw,relatime shared:1 - ext4 /dev/vda rw
23 22 0:21 / /scratch rw - lustre 10.0.0.1@tcp:/fs rw
24 22 0:22 / /shared/with\\040blank rw,nosuid shared:2 master:1 - nfs4 server:/home rw
25 22 0:23 / /shared/with\\040blank/local rw - xfs /dev/vdb rw
26 22 0:24 / /shared rw - autofs systemd-1 rw
27 22 0:25 / /twice rw - ext4 /dev/vdc rw
28 22 0:26 / /twice rw - fuse.sshfs me@there: rw
"""


@pytest.mark.parametrize(
    ("folder", "kind", "mode"),
    [
        ("/derived", "ext4", "WAL"),
        ("/scratch", "lustre", "TRUNCATE"),
        ("/scratch/me/derived", "lustre", "TRUNCATE"),
        ("/scratchy", "ext4", "WAL"),
        ("/shared/with blank/derived", "nfs4", "TRUNCATE"),
        ("/shared/with blank/local/derived", "xfs", "WAL"),
        ("/shared/me", "autofs", "TRUNCATE"),
        ("/twice/over", "fuse.sshfs", "TRUNCATE"),
    ],
)
def test_journal_is_what_the_file_system_can_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, kind: str, mode: str
) -> None:
    mounts = tmp_path / "mountinfo"
    mounts.write_text(MOUNTED)
    assert owner.file_system(Path(folder), mounts) == kind
    monkeypatch.setattr(owner, "file_system", lambda _: kind)
    assert owner.journal_mode(Path(folder)) == mode


def test_unknown_system_has_no_shared_memory(tmp_path: Path) -> None:
    assert owner.file_system(tmp_path, tmp_path / "nothing") == ""
    assert "" not in owner.LOCAL


@pytest.mark.parametrize("kind", ["ext4", "nfs4"])
def test_database_never_has_a_log_in_shared_memory_on_a_network(
    made: Path,
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    kind: str,
) -> None:
    from pipeline.workflow import run_store

    with closing(sqlite3.connect(made / RUNS)) as database:  # as a kill on a local disk leaves it
        database.execute("PRAGMA journal_mode=WAL")
    seen: set[str] = set()
    add = run_store.RunStore.add

    def watched(store: Any, rows: Any) -> None:
        add(store, rows)
        ((mode,),) = store._database.execute("PRAGMA journal_mode").fetchall()
        seen.update({mode.decode(), *(path.name for path in made.glob(f"{RUNS}-*"))})

    monkeypatch.setattr(owner, "file_system", lambda folder: kind)
    monkeypatch.setattr(run_store.RunStore, "add", watched)
    site = write_site(GRID)
    wider = ("run", "responses", "--site", site, "--workers", "0", "--set", "yaw=[0, 90]")
    assert vsr(*wider).code == 0
    wal = {"wal", f"{RUNS}-wal", f"{RUNS}-shm"}
    assert seen == (wal if kind == "ext4" else {"truncate", f"{RUNS}-journal"})
    assert [path.name for path in made.glob(f"{RUNS}*")] == [RUNS]


def test_folder_is_settled_after_each_rename(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done: list[str] = []
    replace, fsync = Path.replace, os.fsync

    def renamed(path: Path, target: Path) -> Path:
        done.append(f"rename into {Path(target).parent.name}")
        return replace(path, target)

    def settled(handle: int) -> None:
        path = Path(f"/proc/self/fd/{handle}").readlink()
        done.append(f"settle {path.name}" if path.is_dir() else "write")
        fsync(handle)

    monkeypatch.setattr(Path, "replace", renamed)
    monkeypatch.setattr(os, "fsync", settled)
    assert vsr("run", "motions", "--site", write_site(GRID), "--workers", "0").code == 0
    renames = [at for at, what in enumerate(done) if what.startswith("rename")]
    assert len(renames) >= 2
    for at in renames:
        assert done[at - 1] == "write"
        assert done[at + 1] == done[at].replace("rename into", "settle")


@pytest.fixture
def scan_site(write_site: Callable[..., str]) -> str:
    return write_site("rock: {shape: mesh, mesh: scan.ply, density: 2000}\n")


def test_a_scan_that_is_written_while_it_is_read_makes_nothing(
    tmp_path: Path,
    vsr: Callable[..., Ran],
    scan_site: str,
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """After its digest and before it is read: the rock would have the other's key."""
    scan, scans = tmp_path / "scan.ply", []
    for height in (2.0, 3.0):
        trimesh.creation.box((1.0, 1.0, height)).export(scan)
        scans.append(scan.read_bytes())
    scan.write_bytes(scans[0])
    read = mesh_files.read

    def written_before(path: Path, *given: float) -> trimesh.Trimesh:
        path.write_bytes(scans[1])
        return read(path, *given)

    with monkeypatch.context() as patch:
        patch.setattr(mesh_files, "read", written_before)
        ran = vsr("run", "rock", "--site", scan_site)
    assert ran.code == 2
    assert "scan.ply: got what was edited while a command that reads it was at work" in ran.err
    assert not (derived / "rock" / "rock.nc").exists()
    scan.write_bytes(scans[0])
    assert vsr("run", "rock", "--site", scan_site).code == 0
    assert xr.load_dataset(derived / "rock" / "rock.nc").attrs["mass_kg"] == pytest.approx(4000.0)


def test_a_study_whose_scan_is_written_over_is_not_compared(
    tmp_path: Path,
    vsr: Callable[..., Ran],
    scan_site: str,
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Between its members, each of which is right by itself."""
    scan, study = tmp_path / "scan.ply", tmp_path / "study.yaml"
    study.write_text("sweep: {mass: {rock.density: [2000, 2500]}}\n")
    trimesh.creation.box((1.0, 1.0, 2.0)).export(scan)
    make, done = graph.make, []

    def made_and_written(stage: str, job: Any) -> int:
        unresolved = make(stage, job)
        done.append(stage)
        trimesh.creation.box((1.0, 1.0, 3.0)).export(scan)
        return unresolved

    monkeypatch.setattr(graph, "make", made_and_written)
    ran = vsr("run", "rock", "--site", scan_site, "--study", study)
    assert (ran.code, done) == (2, ["rock", "rock"])
    assert "while a command that reads it was at work" in ran.err
    assert not (derived / "rock" / "studies" / "study" / "study.nc").exists()


@pytest.mark.parametrize("variant", ["a@v", "a@b@v"])
def test_results_of_a_variant_stay_while_its_site_is_at_work(tmp_path: Path, variant: str) -> None:
    """The name of a site may have an @, too."""
    site, folder = tmp_path / variant.rpartition("@")[0], tmp_path / variant
    for one in (site, folder):
        (one / ".stages").mkdir(parents=True)
    with Ownership(site), pytest.raises(InputError, match=f"process {os.getpid()} on"):
        disk.remove(folder)
    assert folder.is_dir()
    disk.remove(folder)
    assert not folder.exists()
