"""The compiled engine against Bullet on the same runs, and commands as a whole."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.speed import case_of, cells, fragility_command, plain_loop, timed_command
from benchmarks.table import Row, say
from pipeline.cli import DONE, UNRESOLVED
from vsr_core import GRAVITY
from vsr_core.engines import load
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock import solid
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.input_checks import longest_step
from vsr_core.run.overturning import COMPILED, simulate_all
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Contact, Scene

RUNS = 200

REPEATS = 3
"""Times that one yaw is measured; the quickest counts, as the least disturbed."""


def against_bullet(site: Path, folder: Path) -> Iterator[Row]:
    """CPU of a run in Bullet over that here, and outcomes that differ, at their usual steps."""
    say("runs in Bullet and in the compiled engine")
    rock = solid.box((1.0, 1.0, 2.0), 2110.0).rock
    block = prepare(Scene(rock, Contact(0.6)), barrier(rock), reduce=True)
    hull, _ = case_of(site, folder)
    pulses = [CosinePulse(pga * GRAVITY, pgv_pga) for pga, pgv_pga in cells(RUNS)]
    for name, case, goal in (("hull", hull, "25"), ("box", block, "10")):
        bullet, expected = _timed(case, pulses, "bullet")
        own, found = _timed(case, pulses, COMPILED)
        differ = sum(a is not b for a, b in zip(found, expected, strict=True))
        yield f"CPU of a run, Bullet / this, {name} on flat", f"{bullet / own:.1f}", goal
        yield f"  outcomes of {RUNS} that differ", str(differ), ""
        if name == "hull":
            plain = plain_loop(case) * RUNS
            yield "plain fixed 1 kHz loop in Bullet / this, hull", f"{plain / own:.0f}", "120"


def command(site: Path, folder: Path) -> Iterator[Row]:
    """One yaw and twelve, as commands, against the bare start of two libraries."""
    say("one yaw and twelve")
    bare, ones = [], []
    for number in range(REPEATS):  # in turn, so that both find the machine as busy
        start = time.monotonic()
        subprocess.run([sys.executable, "-c", "import xarray, distributed"], check=True)
        bare.append(time.monotonic() - start)
        ones.append(_timeline(site, folder / f"one yaw {number}", "yaw=0"))
    one = min(ones, key=lambda times: times["end"][0])
    began, chosen = one["time_step"]
    whole = one["end"][0]
    yield "calibration: `import xarray, distributed` [s]", f"{min(bare):.2f}", ""
    yield "fragility of one yaw, whole command [s]", f"{whole:.1f}", ""
    yield "  over the calibration", f"{whole / min(bare):.1f}", "5"
    yield "  choosing the step, share of it [%]", f"{100 * (chosen - began) / whole:.0f}", "10"
    yield "  all outcomes after [s]", f"{one['runs'][0]:.1f}", "first ones within 5"
    twelve, _ = timed_command(site, folder / "twelve")
    yield "fragility of twelve yaws, 30,000 runs, whole command [s]", f"{twelve:.1f}", "25"


def validation(tests: Path | None, folder: Path) -> Iterator[Row]:
    """Predictions of recorded shake-table tests, as a command."""
    what = "validation of recorded shake-table tests, whole command [s]"
    if tests is None:
        yield what, "not measured", "90; give their folder: --tests FOLDER"
        return
    say("the validation")
    command = [sys.executable, "-m", "pipeline", "run", "validation", "--table", str(tests)]
    start = time.monotonic()
    command += ["--derived", str(folder)]
    code = subprocess.run(command, check=False, stderr=subprocess.DEVNULL).returncode
    if code not in (DONE, UNRESOLVED):  # unresolved runs are run all the same
        raise subprocess.CalledProcessError(code, command)
    yield what, f"{time.monotonic() - start:.0f}", "90"


def _timeline(site: Path, derived: Path, *settings: str) -> dict[str, list[float]]:
    """Times [s] since a fragility command at which it told of each stage, and of its end."""
    times: dict[str, list[float]] = {}
    start = time.monotonic()
    with subprocess.Popen(
        fragility_command(site, derived, *settings), stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            times.setdefault(line.partition(":")[0], []).append(time.monotonic() - start)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args)
    times["end"] = [time.monotonic() - start]
    return times


def _timed(case: Case, pulses: Sequence[CosinePulse], engine: str) -> tuple[float, list[object]]:
    """CPU time of runs [s] at the step of the engine's boundary error of 1 %, and outcomes."""
    ladder, unit = load(engine).LADDER, step_unit(case.full.rock)
    step = min(ladder.coarse * unit, longest_step(case.full, engine))
    settings = Settings(step, engine=engine)
    simulate_all(case, pulses[:1], settings)
    start = time.process_time()
    found = simulate_all(case, pulses, settings)
    return time.process_time() - start, [response.outcome for response in found]
