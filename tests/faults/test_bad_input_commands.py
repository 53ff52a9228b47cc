"""What is typed wrongly, and what stops a command: one line, the right exit code, nothing left."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline import ROOT, cli
from pipeline.commands import COMMANDS
from pipeline.config.problems import Problem
from pipeline.workflow import cluster
from tests.support.bad_input import ODD_TEXTS, see_that_it_is_one_line
from tests.support.suites import slow_but

Refused = Callable[..., str]
Vsr = Callable[..., Any]

SITE = ("--site", "cuboid_1x1x2")


def start(*arguments: object, folder: Path = ROOT, **environment: str) -> subprocess.Popen[str]:
    """A command in a session of its own, as a terminal would have it."""
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        start_new_session=True,
        # a shell has what it starts in the background ignore Ctrl-C, these tests among it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


LINES = {
    "no command": ((), "required: COMMAND"),
    "unknown command": (("go",), "invalid choice: 'go'"),
    "no site": (("plan",), "--site: no site given", "e.g. --site", "SITE="),
    "an empty site": (("run", "fragility", "--site", ""), "--site: no site given"),
    "no study": (("run", "study", *SITE), "--study: no study given", "STUDY=friction"),
    "an empty study": (("plan", *SITE, "--study", ""), "--study: no study given", "STUDY="),
    "an empty study of all": (("status", "--study", ""), "--site: no site given"),
    "no limits": (("feasible", *SITE, "--table", ""), "--table: no table", "make LIMITS=mini_sh"),
    "no folder of commands": (("feasible", *SITE, "--export", ""), "--export: got ''", "empty"),
    "no such study": (("plan", *SITE, "--study", "frictoin"), "--study", "did you mean friction?"),
    "no sweep": (("run", "study", *SITE, "--study", "records"), "records has no sweep"),
    "no table": (("run", "validation"), "--table: no folder", "TABLE="),
    "no original": (("fetch", ""), "NAME: got ''", "double_rock"),
    "no figure": (("figures", "--fig", "99"), "--fig: got '99'", "table_1"),
    "a comma in an age": (("run", "hazard", *SITE, "--age", "20,000"), "--age", "'20,000'"),
    "an age twice": (
        ("run", "hazard", *SITE, "--age", "9e3", "--age", "2e3"),
        "--age: got it twice; an option has one value; leave out the others",
    ),
    "two sites": (("plan", *SITE, "--site", "double_rock"), "--site: got it twice"),
    "an age below zero": (("run", "hazard", *SITE, "--age", "-5"), "hazard.age.mean: got -5"),
    "two ages": (
        ("run", "hazard", *SITE, "--age", "9e3", "--set", "hazard.age.mean=2000"),
        "--age: hazard.age: got --set hazard.age beside it; one of them is given; leave out --age",
    ),
    "two ages in a section": (
        ("run", "hazard", *SITE, "--age", "9e3", "--set", " hazard={age: {mean: 2000}}"),
        "--age: hazard.age: got --set hazard.age beside it",
    ),
    "two errors of an age": (
        ("run", "hazard", *SITE, "--age-sd", "9", "--set", "hazard.age={mean: 2000, sd: 8}"),
        "--age-sd: hazard.age.sd: got --set hazard.age.sd beside it",
    ),
    "events beside curves": (
        ("run", "hazard", *SITE, "--curves", "a", "--set", "hazard.events=b", "--age", "9e3"),
        "--curves: hazard.events: got --set hazard.events beside it",
    ),
    "no curves": (("run", "hazard", *SITE, "--curves", "", "--age", "9e3"), "--curves: got ''"),
    "no curves of a fragility": (("run", "fragility", *SITE, "--curves", ""), "--curves: got ''"),
    "no tests of a fragility": (("plan", *SITE, "--table", ""), "--table: ", "takes no --table"),
    "no scheduler": (("run", "rock", *SITE, "--scheduler", ""), "--scheduler: got ''", "ADDRESS"),
    "no scheduler's file": (("run", "rock", *SITE, "--scheduler-file="), "--scheduler-file: got"),
    "no scheduler to try": (("doctor", "--scheduler", ""), "--scheduler: got ''", "leave it out"),
    "no record": (("figures", "--fig", "7", "--record", ""), "--record: got ''", "Fig. 7"),
    "no name of a figure": (("figures", "--fig", ""), "--fig: got ''", "e.g. 12"),
    "no direction": (("replay", *SITE, "--yaw", ""), "--yaw: got ''", "[degree]"),
    "no address": (("fetch", "double_rock", "--url", ""), "--url: got ''", "leave it out"),
    "no licence": (("export", "x", "--to", "x.zip", "--licence", ""), "--licence: got ''", "URL"),
    "off the grid": (("replay", *SITE, "--pgv-pga", "0.3"), "--pgv-pga: got 0.3", "0.292857"),
    "unknown option": (("plan", *SITE, "--fast"), "unrecognized arguments: --fast"),
    "unknown product": (("plan", "toppling", *SITE), "invalid choice: 'toppling'"),
    "option without its value": (("plan", "--site"), "expected one argument"),
    "two places": (
        ("run", "rock", "--scheduler", "h:1", "--cluster", "slurm", *SITE),
        "not allowed",
    ),
    "workers in words": (("run", "rock", *SITE, "--workers", "two"), "--workers: got 'two'"),
    "workers below none": (("run", "rock", *SITE, "--workers", "-1"), "--workers: got '-1'"),
    "many workers": (("run", "rock", *SITE, "--workers", "1" + "0" * 5000), "0 to 10000"),
    "other digits": (("run", "rock", *SITE, "--workers", "\u0663"), "number of workers"),
    "no folder to keep things in": (("plan", *SITE, "--derived", ""), "--derived", "empty name"),
    "a folder that cannot be": (("plan", *SITE, "--derived", "x" * 300), "--derived", "too long"),
    "a file for a folder": (("plan", *SITE, "--derived", __file__), "--derived", "a file"),
    "a folder that is a device": (("plan", *SITE, "--derived", "/dev/null/x"), "Not a directory"),
}


@pytest.mark.parametrize("case", LINES)
def test_command_line_is_refused_in_a_line(capsys: pytest.CaptureFixture[str], case: str) -> None:
    arguments, *words = LINES[case]
    assert cli.main(list(arguments)) == cli.REFUSED
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    see_that_it_is_one_line(line.removeprefix("vsr: "))
    assert [word for word in words if word not in line] == []


def test_a_backslash_in_the_name_of_the_output_is_told(vsr: Vsr, tmp_path: Path) -> None:
    ran = vsr("run", "rock", "--site", "cuboid_1x1x2", into=tmp_path / "back\\slash")
    told = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert (ran.code, len(told)) == (cli.REFUSED, 1)
    assert "takes a backslash in a name for a slash; rename it" in told[0]


@pytest.mark.parametrize("length", [200, 251, 255, 256])
def test_a_refused_new_site_leaves_nothing(vsr: Vsr, tmp_path: Path, length: int) -> None:
    ran = vsr("init", tmp_path / "mine" / ("x" * length))
    assert ran.code == (0 if length == 200 else 2)
    assert len(ran.err.splitlines()) == 1
    assert (tmp_path / "mine").exists() == (length == 200)


def test_a_new_site_whose_name_is_no_text_is_refused(vsr: Vsr, tmp_path: Path) -> None:
    ran = vsr("init", os.fsdecode(os.fsencode(tmp_path) + b"/mine/\xff"))
    assert (ran.code, len(ran.err.splitlines())) == (cli.REFUSED, 1)
    assert "a name is text in UTF-8; give another" in ran.err
    assert not (tmp_path / "mine").exists()


def test_a_new_site_with_two_lines_in_its_name_is_told_in_one(vsr: Vsr, tmp_path: Path) -> None:
    ran = vsr("init", tmp_path / "two\nlines")
    assert ran.err == f"-> {tmp_path}/two\\nlines/two\\nlines.yaml\n"


@pytest.mark.parametrize("name", ["", ".", "..", "../raw", "/", "a/b", "nowhere"])
def test_clean_takes_the_name_of_a_folder(refused: Refused, name: str) -> None:
    refused("clean", "--yes", "--site", name, words=("--site", repr(name), "omit it"))


def test_clean_of_what_is_not_made_yet_has_nothing_to_do(vsr: Vsr) -> None:
    ran = vsr("clean", "--yes", *SITE)
    assert (ran.code, ran.out) == (cli.DONE, "nothing derived to remove\n")


def test_folder_that_is_a_loop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    assert cli.main(["plan", *SITE, "--derived", str(loop)]) == cli.REFUSED
    assert "--derived: got" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "given", "words"),
    [
        ("--scheduler", "tcp://127.0.0.1:1", "imed out"),
        ("--scheduler", "nonsense://x", "unknown address scheme"),
        ("--scheduler", "tcp://127.0.0.1:99999999", "99999999"),
        ("--scheduler-file", "nowhere.json", "No such file"),
    ],
)
def test_scheduler_that_is_not_there(
    refused: Refused, monkeypatch: pytest.MonkeyPatch, option: str, given: str, words: str
) -> None:
    assert cluster.CONNECTING <= 5.0
    monkeypatch.setattr(cluster, "CONNECTING", 0.5)
    refused("run", "responses", *SITE, option, given, words=(option, given, words, "Dask"))


WORDS = st.sampled_from(
    [
        *("plan", "status", "why", "prep", "list", "rock", "responses", "validation", *SITE),
        *("--study", "--set", "--table", "--workers", "--scheduler", "--cluster", "slurm", "--"),
        *("records", "yaw=1", "/", "/dev/null", "x.yaml", "-1", *ODD_TEXTS),
    ]
)


@settings(
    max_examples=120,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(
    verb=st.sampled_from(("plan", "status", "why", "prep", "list", "zzz")),
    more=st.lists(WORDS | st.text(max_size=5), max_size=5),
)
def test_any_words_are_done_or_refused(vsr: Vsr, derived: Path, verb: str, more: list[str]) -> None:
    ran = vsr(verb, *more)
    if ran.code == cli.DONE:
        return
    assert ran.code == cli.REFUSED, ran.err
    lines = ran.err.splitlines()
    assert lines
    for line in lines:
        assert line.startswith("vsr: ")
        see_that_it_is_one_line(line.removeprefix("vsr: "))
    assert not [path for path in derived.rglob("*") if path.is_file()]


def test_long_parts_and_controls_are_shown_in_short() -> None:
    line = str(Problem("a" * 5000, "k\x1b[2J", "x" * 5000 + "end", "rule\nin two", "\u202eremedy"))
    see_that_it_is_one_line(line)
    assert "\\x1b[2J" in line
    assert "\\u202e" in line
    assert "xend; rule in two" in line
    assert len(line) < 800


@pytest.mark.slow
def test_libraries_are_silent_before_the_line(tmp_path: Path) -> None:
    """A flat scan makes trimesh divide by its volume, and say so."""
    flat = trimesh.creation.box((1.0, 1.0, 2.0))
    flat.vertices[:, 2] = 0.0
    (tmp_path / "flat.obj").write_text(flat.export(file_type="obj"))
    site = tmp_path / "site.yaml"
    site.write_text("rock: {shape: mesh, mesh: flat.obj, density: 2000}\n")
    process = start("run", "rock", "--site", site, "--derived", tmp_path / "derived")
    *before, line = process.communicate(timeout=60)[0].splitlines()
    assert process.returncode == cli.REFUSED
    assert "a flat mesh" in line
    assert all(one.endswith("s so far") for one in before)  # our own progress, where it is slow


@pytest.mark.slow
@pytest.mark.parametrize(
    ("environment", "code"),
    [
        ({"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}, cli.REFUSED),
        ({"COLUMNS": "many", "HOME": "/nowhere", "TMPDIR": "/nowhere"}, cli.REFUSED),
    ],
)
def test_surroundings_change_nothing(
    tmp_path: Path, environment: dict[str, str], code: int
) -> None:
    process = start("plan", "--site", "é.yaml", "--derived", tmp_path / "é", **environment)
    (line,) = process.communicate(timeout=60)[0].splitlines()
    assert process.returncode == code
    assert "file not found" in line


@pytest.mark.slow
def test_a_date_of_sources_that_is_none_changes_nothing(tmp_path: Path) -> None:
    """On which some libraries fail; nothing that is made has a date."""
    words = "plan", "--site", "cuboid_1x1x2", "--derived", tmp_path
    process = start(*words, SOURCE_DATE_EPOCH="today")
    said = process.communicate(timeout=60)[0]
    assert process.returncode == cli.DONE, said


OF_DASK = [
    ("DASK_CONFIG", "a.yaml"),
    ("HOME", "a.json"),
    ("HOME", "a.yaml"),
    ("DASK_ROOT_CONFIG", "a.yml"),
]


@pytest.mark.parametrize(("place", "name"), slow_but(OF_DASK[:2], OF_DASK))
def test_settings_of_dask_that_are_no_yaml(tmp_path: Path, place: str, name: str) -> None:
    bad = tmp_path / ".config" / "dask" / name
    bad.parent.mkdir(parents=True)
    bad.write_text("# of mine\n{[")
    site, into = "cuboid_1x1x2", tmp_path / "derived"
    found = {"DASK_CONFIG": bad, "HOME": tmp_path, "DASK_ROOT_CONFIG": bad.parent}[place]
    process = start("run", "rock", "--site", site, "--derived", into, **{place: str(found)})
    (line,) = process.communicate(timeout=60)[0].splitlines()
    assert process.returncode == cli.REFUSED
    assert str(bad) in line
    assert not into.exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(
            pytest.param(name, value, marks=pytest.mark.slow)
            for name, value in (
                ("DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "nonsense"),
                ("DISTRIBUTED__NANNY__PRELOAD", "nonsense"),
                ("DISTRIBUTED__WORKER__MULTIPROCESSING_METHOD", "nonsense"),
                ("DISTRIBUTED__CLIENT__PRELOAD", "['nonsense']"),
                ("DISTRIBUTED__CLIENT__HEARTBEAT", "nonsense"),
                ("DISTRIBUTED__DASHBOARD__LINK", "{nonsense}"),
                ("TEMPORARY_DIRECTORY", "/proc/nonsense"),
            )
        ),
        ("DISTRIBUTED__LOGGING__DISTRIBUTED", "bogus"),
    ],
)
def test_settings_of_dask_that_it_does_not_take(tmp_path: Path, name: str, value: str) -> None:
    given = ("run", "stability", *SITE, "--workers", 2, "--derived", tmp_path)
    process = start(*given, **{f"DASK_{name}": value})
    *_, line = process.communicate(timeout=60)[0].splitlines()
    assert process.returncode == cli.REFUSED
    assert line.startswith("vsr: settings of Dask: got what it cannot read")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("SCHEDULER__IDLE_TIMEOUT", "1s"),
        ("SCHEDULER__PICKLE", "False"),
        ("SCHEDULER__BLOCKED_HANDLERS", "['register-client']"),
        ("WORKER__LIFETIME__DURATION", "2s"),
    ],
)
def test_our_own_workers_stay_whatever_is_said_of_others(
    tmp_path: Path, name: str, value: str
) -> None:
    given = ("run", "stability", *SITE, "--workers", 2, "--derived", tmp_path)
    process = start(*given, **{f"DASK_DISTRIBUTED__{name}": value})
    said = process.communicate(timeout=300)[0]
    assert process.returncode == cli.DONE, said
    assert "Traceback" not in said


UNCOMPILED: list[tuple[str, dict[str, str], str]] = [
    ("DISABLE_JIT: true\n", {}, "disable_jit; runs are compiled"),
    ("# nothing\n", {"NUMBA_NUM_THREADS": "0"}, "what it cannot read"),
    ("", {"NUMBA_DISABLE_JIT": "1"}, "disable_jit; runs are compiled"),
    ("a: b: c\n", {}, "what it cannot read"),
    ("1: 2\n", {}, "what it cannot read"),
]


@pytest.mark.parametrize(("text", "variables", "words"), slow_but(UNCOMPILED[:2], UNCOMPILED))
def test_settings_with_which_nothing_is_compiled(
    tmp_path: Path, text: str, variables: dict[str, str], words: str
) -> None:
    (tmp_path / ".numba_config.yaml").write_text(text)
    into = tmp_path / "derived"
    process = start("run", "rock", *SITE, "--derived", into, folder=tmp_path, **variables)
    (line,) = process.communicate(timeout=60)[0].splitlines()
    assert process.returncode == cli.REFUSED
    assert line.startswith(f"vsr: settings of Numba: got {words}")
    assert ".numba_config.yaml" in line
    assert not into.exists()


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "memory: got too little of it"),
        (OSError(errno.EMFILE, "Too many open files"), "open files: got too few"),
    ],
)
def test_what_the_machine_has_too_little_of(
    refused: Refused, monkeypatch: pytest.MonkeyPatch, error: Exception, words: str
) -> None:
    def lacks(options: object) -> int:
        raise error

    monkeypatch.setitem(COMMANDS, "status", lacks)
    refused("status", words=(words, "ulimit"))


def stop(process: subprocess.Popen[str], how: signal.Signals) -> tuple[int, str, float]:
    """Stop a command; its exit code, what it said, and how long it took to end [s]."""
    began = time.monotonic()
    if how == signal.SIGINT:
        os.killpg(process.pid, how)  # a terminal tells all of them
    else:
        process.send_signal(how)
    said = process.communicate(timeout=30)[0]
    return process.returncode, said, time.monotonic() - began


def wait_for(path: Path) -> None:
    for _ in range(600):
        if path.exists():
            return
        time.sleep(0.05)
    raise TimeoutError(path)


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_stopped_while_a_scan_is_cut(tmp_path: Path, how: signal.Signals) -> None:
    process = start("run", "rock", "--site", "double_rock_terrain", "--derived", tmp_path)
    wait_for(tmp_path / "double_rock_terrain")
    time.sleep(2.0)  # until trimesh is loaded, which takes a stop for a library that is not there
    code, said, took = stop(process, how)
    assert code in (cli.STOPPED, -how)  # Python ends by SIGINT where that met it in an import
    assert said.splitlines()[-1].startswith("stopped; finished stages and the runs in runs.sqlite")
    assert "Traceback" not in said
    assert took < 5.0
    assert not list(tmp_path.rglob(".part-*"))


STOPPED_IN_A_CALLBACK = """
import os, signal, sys, time, weakref
from pipeline import __main__ as command
class Lock: pass
def main():
    try:
        lock = Lock()
        kept = weakref.ref(lock, lambda _: os.kill(os.getpid(), signal.SIGTERM))
        del lock
        time.sleep(30)
    except KeyboardInterrupt:
        return 130
command.main = main
sys.exit(command.program())
"""


def test_a_stop_in_a_callback_whose_errors_python_ignores() -> None:
    """As the callbacks of an import's locks are."""
    command = [sys.executable, "-c", STOPPED_IN_A_CALLBACK]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=20, check=False)
    assert (done.returncode, done.stderr) == (cli.STOPPED, b"")


@pytest.mark.slow
@pytest.mark.parametrize(
    "delay", [0.5, *(pytest.param(0.1 * k, marks=pytest.mark.slow) for k in (1, 2, 3, 4, 6, 8, 12))]
)
def test_stopped_while_workers_start(tmp_path: Path, delay: float) -> None:
    grid = ("--set", "simulation.engine=bullet", "--set", "simulation.time_step=0.001")
    process = start("run", "responses", *SITE, *grid, "--workers", "2", "--derived", tmp_path)
    wait_for(tmp_path / "cuboid_1x1x2" / "runs.sqlite")  # from here on workers are wanted
    time.sleep(delay)
    code, said, _ = stop(process, signal.SIGINT)
    assert code in (cli.STOPPED, -signal.SIGINT)
    assert said.splitlines()[-1].startswith("stopped; finished stages and the runs in runs.sqlite")
    assert "Traceback" not in said


LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
from pipeline.cli import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize("room", [0, pytest.param(30_000, marks=pytest.mark.slow)])
def test_no_room_is_told_as_that(tmp_path: Path, room: int) -> None:
    """The system's limit of a file's size stands for the end of the disk."""
    arguments = ["run", "rock", *SITE, "--workers", "0", "--derived", str(tmp_path)]
    ran = subprocess.run(
        [sys.executable, "-c", LIMITED, str(room), *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    (line,) = ran.stderr.splitlines()
    assert ran.returncode == cli.REFUSED
    assert "File too large" in line
    assert "ermission denied" not in line
    assert not list(tmp_path.rglob(".part-*"))
    assert not list(tmp_path.rglob("*.nc"))
