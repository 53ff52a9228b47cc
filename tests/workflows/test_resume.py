"""Done once is done: a second call, a wider grid, an interrupt: only what is missing is run."""

from __future__ import annotations

import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline import ROOT
from pipeline.stages.runs import overturning_runs, runner
from pipeline.workflow.datasets import read
from pipeline.workflow.keys import digest_file
from pipeline.workflow.run_store import RUNS
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import Response
from vsr_core.run.cases import Case, Settings

GRID = "motion: {pga: [0.2, 0.4, 0.6], pgv_pga: [0.2, 0.4]}\n"


class Counter:
    """Counts the runs simulated in this process, and can stop them at one of them."""

    def __init__(self) -> None:
        self.runs = 0
        self.stop_at: int | None = None
        self._simulate = overturning_runs.simulate_all

    def __call__(
        self, case: Case, motions: Sequence[GroundMotion], settings: Settings
    ) -> list[Response]:
        return [self._one(case, motion, settings) for motion in motions]

    def _one(self, case: Case, motion: GroundMotion, settings: Settings) -> Response:
        if self.runs == self.stop_at:
            raise KeyboardInterrupt
        self.runs += 1
        return self._simulate(case, [motion], settings)[0]

    def take(self) -> int:
        """Runs since the last call."""
        taken, self.runs = self.runs, 0
        return taken


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter:
    counter = Counter()
    monkeypatch.setattr(overturning_runs, "simulate_all", counter)
    return counter


@pytest.fixture
def responses(vsr: Callable[..., object], write_site: Callable[..., str]) -> Callable[..., Path]:
    """Make responses of a small site with settings; returns their file."""

    def make(*settings: str, into: Path | None = None, code: int = 0, product="responses") -> Path:
        options = [part for item in settings for part in ("--set", item)]
        site = write_site(GRID)
        ran = vsr("run", product, "--site", site, "--workers", "0", *options, into=into)
        assert ran.code == code, ran.err
        return Path(into or Path(site).parent / "derived") / "rock" / "responses.nc"

    return make


def stored(folder: Path) -> int:
    with closing(sqlite3.connect(folder / RUNS)) as database:
        return int(database.execute("SELECT count(*) FROM runs").fetchone()[0])


def between(folder: Path) -> int:
    """Runs between the cells of the grid, which a fragility needs."""
    number = read(folder / "boundary.nc").sizes["run"]
    assert number > 6
    return number


def stamps(folder: Path) -> dict[Path, tuple[int, str]]:
    found = [path for path in folder.rglob("*") if path.is_file()]
    return {path: (path.stat().st_mtime_ns, digest_file(path)) for path in found}


def test_second_call_makes_nothing(
    responses: Callable[..., Path],
    vsr: Callable[..., object],
    write_site: Callable[..., str],
    counted: Counter,
) -> None:
    folder = responses(product="fragility").parent
    assert counted.take() == 6 + between(folder)
    assert (folder / "report.html").is_file()
    before = stamps(folder)
    for product in ("fragility", "report", "responses", "rock"):
        responses(product=product)
    assert counted.take() == 0
    assert stamps(folder) == before
    said = vsr("why", "--site", write_site(GRID)).out.splitlines()
    stages = (
        "rock",
        "time_step",
        "motions",
        "runs",
        "responses",
        "boundary",
        "bullet_sample",
        "fragility",
        "report",
    )
    assert said[:9] == [f"{stage}: up to date" for stage in stages]
    assert said[9].startswith("runs: 6 of 6 are stored")
    assert "stages to make: none" in vsr("plan", "--site", write_site(GRID)).out
    status = vsr("status", "--site", write_site(GRID)).out
    assert "to do" not in status
    assert "6 of 6 runs stored" in status
    assert counted.take() == 0
    assert set(stamps(folder)) - set(before) <= {folder / f"{RUNS}-{end}" for end in ("wal", "shm")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setting", "new"),
    [
        ("motion.pga=[0.1, 0.2, 0.3, 0.4, 0.6]", 4),
        pytest.param("motion.pga={start: 0.2, stop: 1.0, num: 5}", 4, marks=pytest.mark.slow),
        ("motion.pgv_pga=[0.2, 0.3, 0.4]", 3),
        ("yaw=[0, 90]", 6),
        pytest.param("yaw=[90]", 6, marks=pytest.mark.slow),
        ("contact.friction=[0.6, 0.8]", 6),
        ("motion.pga=[0.2, 0.6]", 0),
        ("rock.density=2110.0", 0),
        ("simulation.time_step=0.0005", 6),
        pytest.param("simulation.reduce=off", 6, marks=pytest.mark.slow),
        pytest.param("contact.restitution=0.1", 6, marks=pytest.mark.slow),
        pytest.param("rock.size=[0.5, 1.0, 2.1]", 6, marks=pytest.mark.slow),
    ],
)
def test_only_new_cells_are_simulated(
    responses: Callable[..., Path], counted: Counter, setting: str, new: int
) -> None:
    first = responses().read_bytes()
    assert counted.take() == 6
    file = responses(setting)
    assert counted.take() == new
    assert stored(file.parent) == 6 + new
    assert responses().read_bytes() == first
    assert counted.take() == 0


@pytest.mark.slow
def test_widened_grid_equals_one_made_at_once(
    responses: Callable[..., Path], tmp_path: Path
) -> None:
    wide = ("motion.pga=[0.1, 0.2, 0.3, 0.4, 0.6]", "yaw=[90, 0]", "contact.friction=[0.6, 0.9]")
    for i in range(len(wide) + 1):
        grown = responses(*wide[:i])
    fresh = responses(*wide, into=tmp_path / "fresh")
    assert grown.read_bytes() == fresh.read_bytes()
    assert read(fresh)["outcome"].shape == (2, 2, 2, 5)


def test_edited_code(
    responses: Callable[..., Path],
    vsr: Callable[..., object],
    write_site: Callable[..., str],
    counted: Counter,
    edit_function: Callable[[str, str, str], None],
) -> None:
    folder = responses(product="fragility").parent
    assert counted.take() == 6 + between(folder)
    before = stamps(folder)

    edit_function("pipeline/stages/fragility/rock_views.py", "rock_views", "str(1)")
    said = vsr("why", "--site", write_site(GRID)).out
    assert "report: code pipeline.stages.fragility.rock_views:rock_views edited" in said
    assert "runs: up to date" in said
    assert "fragility: up to date" in said
    responses(product="fragility")
    after = stamps(folder)
    changed = {path.name for path in after if after[path] != before.get(path)}
    assert changed == {"report.html", "report.json"}
    assert after[folder / "report.html"][1] == before[folder / "report.html"][1]
    assert counted.take() == 0

    edit_function("vsr_core/judge/proofs.py", "cannot_topple", "# why this is so")
    edit_function("vsr_core/fragility/cross_validation.py", "cross_validate", "str(1)")
    responses(product="fragility")
    assert counted.take() == 0

    edit_function("vsr_core/judge/proofs.py", "cannot_topple", "str(1)")
    said = vsr("why", "--site", write_site(GRID)).out
    assert "runs: code vsr_core.judge.proofs:cannot_topple edited" in said
    assert "runs: 0 of 6 are stored and stay; 6 to do" in said
    responses(product="fragility")
    assert counted.take() == 6 + between(folder)


def test_why_names_the_changed_key(
    responses: Callable[..., Path], vsr: Callable[..., object], write_site: Callable[..., str]
) -> None:
    responses()
    site = write_site(GRID)

    def why(setting: str) -> list[str]:
        return vsr("why", "responses", "--site", site, "--set", setting).out.splitlines()

    said = why("motion.pga=[0.2, 0.3, 0.4, 0.6]")
    assert "runs: motion.pga changed: 1 value added, 0 removed" in said
    assert "rock: up to date" in said
    assert "runs: 6 of 8 are stored and stay; 2 to do" in said
    said = why("contact.restitution=0.1")
    assert "runs: contact.restitution changed: 0.0 is now 0.1" in said
    assert "rock: up to date" in said
    assert "runs: 0 of 6 are stored and stay; 6 to do" in said
    assert "rock: rock.density changed: 2110.0 is now 2600.0" in why("rock.density=2600")
    assert not any("contact" in line for line in why("yaw=3"))


def test_deleted_product_is_rebuilt_without_runs(
    responses: Callable[..., Path], counted: Counter
) -> None:
    file = responses()
    whole = file.read_bytes()
    counted.take()
    file.unlink()
    assert responses().read_bytes() == whole
    (file.parent / ".stages" / "responses.json").unlink()
    assert responses().read_bytes() == whole
    (file.parent / ".stages" / "runs.json").unlink()
    assert responses().read_bytes() == whole
    assert counted.take() == 0


def test_deleted_runs_are_done_again(responses: Callable[..., Path], counted: Counter) -> None:
    file = responses()
    whole = file.read_bytes()
    counted.take()
    file.unlink()
    (file.parent / RUNS).unlink()
    assert responses().read_bytes() == whole
    assert counted.take() == 6


@pytest.mark.slow
@pytest.mark.parametrize(
    "stop_at", [0, 11, *(pytest.param(runs, marks=pytest.mark.slow) for runs in (1, 7, 23))]
)
def test_interrupt_keeps_whole_batches(
    responses: Callable[..., Path],
    vsr: Callable[..., object],
    write_site: Callable[..., str],
    counted: Counter,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stop_at: int,
) -> None:
    monkeypatch.setattr(overturning_runs, "KIND", replace(overturning_runs.KIND, batch=4))
    monkeypatch.setattr(runner, "LARGEST_BATCH", 4)
    settings = ("yaw=[0, 45]", "contact.friction=[0.5, 0.8]")
    whole = responses(*settings, into=tmp_path / "whole")
    assert counted.take() == 24

    counted.stop_at = stop_at
    file = responses(*settings, code=130)
    kept = stored(file.parent)
    # Six cells a group: batches of 4 and 2, in turn.
    ends = [0, 4, 6, 10, 12, 16, 18, 22, 24]
    assert kept == max(end for end in ends if end <= stop_at)
    assert not file.exists()
    assert not list(file.parent.glob(".part-*"))
    options = [part for item in settings for part in ("--set", item)]
    said = vsr("why", "responses", "--site", write_site(GRID), *options).out
    assert f"runs: {kept} of 24 are stored and stay; {24 - kept} to do" in said

    counted.stop_at = None
    counted.take()
    file = responses(*settings)
    assert counted.take() == 24 - kept
    assert file.read_bytes() == whole.read_bytes()


SLOW = """
import signal, sys, time
from dataclasses import replace

from pipeline.cli import main
from pipeline.stages.runs import overturning_runs, runner

signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
overturning_runs.KIND = replace(overturning_runs.KIND, batch=4)
runner.LARGEST_BATCH = 4
simulate_all, done = overturning_runs.simulate_all, []

def slow(case, motions, settings):
    found = []
    for motion in motions:
        if len(done) == 9:
            print("now", flush=True)
            time.sleep(600)
        done.append(1)
        found += simulate_all(case, [motion], settings)
    return found

overturning_runs.simulate_all = slow
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    "number", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)]
)
def test_killed_process_goes_on_from_there(
    responses: Callable[..., Path],
    write_site: Callable[..., str],
    counted: Counter,
    derived: Path,
    tmp_path: Path,
    number: signal.Signals,
) -> None:
    settings = ("yaw=[0, 45]", "simulation.time_step=0.001")
    whole = responses(*settings, into=tmp_path / "whole")
    assert counted.take() == 12
    command = ["run", "responses", "--site", write_site(GRID), "--workers", "0"]
    command += [part for setting in settings for part in ("--set", setting)]
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW, *command, "--derived", str(derived)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    assert process.stdout is not None
    lines = iter(process.stdout.readline, "")
    assert any(line == "now\n" for line in lines)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert "Traceback" not in said
        assert "the same command goes on from there" in said.splitlines()[-1]
    else:
        assert process.returncode == -signal.SIGKILL
    file = responses(*settings)
    assert counted.take() == 12 - 6
    assert file.read_bytes() == whole.read_bytes()


@pytest.mark.slow
def test_killed_while_writing_a_product(
    responses: Callable[..., Path], counted: Counter, derived: Path, tmp_path: Path
) -> None:
    """What a kill between two renames leaves: one product new, its manifest old, a part beside."""
    file = responses()
    counted.take()
    narrow = file.read_bytes()
    wide = responses("motion.pga=[0.2, 0.3, 0.4, 0.6]", into=tmp_path / "wide").read_bytes()
    counted.take()
    file.write_bytes(wide)
    (file.parent / ".part-1-config.yaml").write_text("half")
    assert responses().read_bytes() == narrow
    assert counted.take() == 0
    assert not list(derived.rglob(".part-*"))


# clean


@pytest.fixture
def project(
    responses: Callable[..., Path], write_site: Callable[..., str], derived: Path
) -> dict[str, Path]:
    """Products of a site, and things beside them that are not derived."""
    product = responses(product="rock").parent
    raw = derived.parent / "raw"
    for path in (raw / "scan.ply", derived / "notes" / "mine.txt", derived / "loose.txt"):
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    return {"product": product, "raw": raw / "scan.ply", "mine": derived / "notes" / "mine.txt"}


@pytest.mark.parametrize("answer", ["n", "", "no", "yess"])
def test_clean_asks(
    project: dict[str, Path],
    vsr: Callable[..., object],
    monkeypatch: pytest.MonkeyPatch,
    answer: str,
) -> None:
    asked = []
    monkeypatch.setattr("builtins.input", lambda text: asked.append(text) or answer)
    assert vsr("clean").code == 0
    assert str(project["product"]) in asked[0]
    assert (project["product"] / "rock.nc").is_file()


@pytest.mark.parametrize("options", [(), ("--site", "rock"), ("--yes",)])
def test_clean_removes_derived_data_only(
    project: dict[str, Path],
    vsr: Callable[..., object],
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[str, ...],
) -> None:
    def answer(text: str) -> str:
        assert "--yes" not in options
        return "y"

    monkeypatch.setattr("builtins.input", answer)
    assert vsr("clean", *options).code == 0
    assert not project["product"].exists()
    assert project["raw"].read_text() == project["mine"].read_text() == "mine"


@pytest.mark.parametrize("name", ["notes", "elsewhere"])
def test_clean_leaves_what_is_no_site(
    project: dict[str, Path], vsr: Callable[..., object], name: str
) -> None:
    ran = vsr("clean", "--site", name, "--yes")
    assert ran.code == 2
    assert ran.err.startswith(f"vsr: --site: got '{name}'; ")
    assert (project["product"] / "rock.nc").is_file()
    assert project["raw"].is_file()
    assert project["mine"].is_file()


def test_clean_without_anyone_to_ask(
    project: dict[str, Path], vsr: Callable[..., object], monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody(text: str) -> str:
        raise EOFError

    monkeypatch.setattr("builtins.input", nobody)
    ran = vsr("clean")
    assert ran.code == 0
    assert ran.out.splitlines()[-1] == "kept"
    assert (project["product"] / "rock.nc").is_file()
