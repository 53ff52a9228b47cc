"""What commands tell: on the screen, and in a file."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline import ROOT, cli
from pipeline.workflow.log import begin, is_log, log


@pytest.fixture(autouse=True)
def told_again() -> Iterator[None]:
    """No log of one test in another."""
    yield
    begin(quiet=False, file=None)


def asked(*words: str, derived: Path) -> int:
    return cli.main(["run", "rock", "--site", "cuboid_1x1x2", "--derived", str(derived), *words])


def test_a_log_file_holds_what_the_screen_shows_with_its_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rock.log"
    file.write_text("before\n", encoding="utf-8")
    assert asked("--log-file", str(file), derived=tmp_path / "derived") == cli.DONE
    shown = capsys.readouterr().err.splitlines()
    first, *lines = file.read_text(encoding="utf-8").splitlines()
    assert first == "before"
    assert shown
    assert [re.sub(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} ", "", line) for line in lines] == shown


def test_a_quiet_command_shows_nothing_but_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rock.log"
    quiet = ("--quiet", "--log-file", str(file))
    assert asked(*quiet, derived=tmp_path / "derived") == cli.DONE
    assert capsys.readouterr() == ("", "")
    assert " rock: box; " in file.read_text(encoding="utf-8")
    assert (
        asked(*quiet, "--set", "contact.friction=-1", derived=tmp_path / "derived") == cli.REFUSED
    )
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert told.strip() in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("place", ["nowhere/rock.log", "."])
def test_a_log_that_cannot_be_written_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    assert asked("--log-file", str(tmp_path / place), derived=tmp_path / "derived") == cli.REFUSED
    assert capsys.readouterr().err.startswith("vsr: --log-file: ")
    assert not (tmp_path / "derived").exists()


def test_a_pipe_that_nobody_reads_is_no_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert asked("--log-file", str(tmp_path / "pipe"), derived=tmp_path) == cli.REFUSED
    assert "a pipe or a device" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["rock.yaml", "scan.ply"])
def test_lines_are_added_to_no_file_of_another_kind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """Such as the site that the same command reads."""
    file = tmp_path / name
    file.write_text("rock: {shape: box}\n", encoding="utf-8")
    words = ("run", "rock", "--site", str(file), "--log-file", str(file))
    assert cli.main([*words, "--derived", str(tmp_path / "derived")]) == cli.REFUSED
    told = capsys.readouterr().err
    assert told.startswith(f"vsr: --log-file: got {file}: ")
    assert told.count("\n") == 1
    assert file.read_text(encoding="utf-8") == "rock: {shape: box}\n"


def test_a_log_of_any_name_is_added_to(tmp_path: Path) -> None:
    file = tmp_path / "messages"
    for _ in range(2):
        begin(quiet=False, file=file)
        log("a line")
        assert is_log(file)
    assert file.read_text(encoding="utf-8").count(" a line") == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
def test_answers_that_cannot_be_printed_are_refused_in_a_line(tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        ran = subprocess.run(
            [sys.executable, "-m", "pipeline", "list", "--derived", str(tmp_path)],
            stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT, check=False,
        )  # fmt: skip
    assert (ran.returncode, len(ran.stderr.splitlines())) == (cli.REFUSED, 1), ran.stderr


CLOSED = "list --json >&-", "run rock --site nowhere 2>&-"
FULL = ("run rock --site nowhere 2>/dev/full",) if Path("/dev/full").exists() else ()


@pytest.mark.parametrize("words", [*CLOSED, *FULL])
def test_a_stream_that_takes_nothing_changes_no_exit_code(words: str) -> None:
    ran = subprocess.run(f"{sys.executable} -m pipeline {words}", shell=True, cwd=ROOT, check=False)
    assert ran.returncode == cli.REFUSED


@pytest.mark.slow
def test_a_run_whose_lines_nobody_reads_any_more_goes_on(tmp_path: Path) -> None:
    """As before `2>&1 | head -2`, in a folder whose name a shell has left as it is."""
    words = "run rock --site cuboid_1x1x2 --derived=~/derived 2>&1 >&-"
    with subprocess.Popen(
        f"exec {sys.executable} -m pipeline {words}",
        shell=True,
        stdout=subprocess.PIPE,
        cwd=ROOT,
        env={**os.environ, "HOME": str(tmp_path)},
    ) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.wait() == cli.DONE
    assert (tmp_path / "derived" / "cuboid_1x1x2" / "rock.nc").is_file()
    assert not Path("~").exists()


def test_a_current_folder_that_was_removed_is_refused_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    ran = subprocess.run(
        f"cd here && rmdir ../here && {sys.executable} -m pipeline list",
        shell=True,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert (ran.returncode, ran.stderr.count("\n")) == (cli.REFUSED, 1), ran.stderr
    assert "a folder that was removed" in ran.stderr


@pytest.mark.slow
def test_a_log_that_takes_no_more_is_told_once_and_the_command_goes_on(tmp_path: Path) -> None:
    words = ("run", "rock", "--site", "cuboid_1x1x2", "--derived", str(tmp_path / "derived"))
    most, full = 1 << 30, tmp_path / "full.log"
    with full.open("wb") as file:
        file.truncate(most)  # of holes, which take no room
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))"
    run = f"{limited}; import sys; from pipeline import cli; sys.exit(cli.main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", run, *words, "--log-file", str(full)],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    assert done.stderr.count("takes no more lines") == 1
    assert "Traceback" not in done.stderr
    assert (tmp_path / "derived" / "cuboid_1x1x2" / "rock.nc").is_file()


@pytest.mark.parametrize("place", ["rock.log", "config.yaml", ".stages/rock.json", "mine/rock.log"])
def test_a_log_in_a_folder_of_results_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    """Also by a link."""
    results = tmp_path / "derived" / "rock"
    for name in (".stages", "mine"):
        (results / name).mkdir(parents=True)
    (tmp_path / "link").symlink_to(results)
    for file in (results / place, tmp_path / "link" / place):
        assert asked("--log-file", str(file), derived=tmp_path / "derived") == cli.REFUSED
        told = capsys.readouterr().err
        assert told.startswith(f"vsr: --log-file: got {file}, which is in {results}; ")
        assert told.count("\n") == 1
    assert not [path for path in results.rglob("*") if path.is_file()]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
@pytest.mark.parametrize("words", ["--version", "--help", "run --help", "list", "clean"])
def test_what_cannot_be_printed_is_refused(tmp_path: Path, words: str) -> None:
    own = ["--derived", str(tmp_path)] if words == "clean" else []
    command = [sys.executable, "-m", "pipeline", *words.split(), *own]
    with Path("/dev/full").open("w") as full:
        ran = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    assert ran.returncode == cli.REFUSED
    assert ran.stderr.startswith("vsr: output: got what is printed, not taken (")
    assert ran.stderr.count("\n") == 1
