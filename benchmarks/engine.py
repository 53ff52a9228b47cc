"""The compiled engine against Bullet on the same runs, and commands as a whole."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.speed import case_of, cells, plain_loop, timed_command
from benchmarks.table import Row, say
from vsr_core import GRAVITY
from vsr_core.engines import load
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.rock import solid
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.input_checks import longest_step
from vsr_core.run.overturning import COMPILED, simulate_all
from vsr_core.run.proofs import barrier
from vsr_core.scene import Contact, Scene
from vsr_core.verification.time_step import step_unit

RUNS = 200


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
    start = time.monotonic()
    subprocess.run([sys.executable, "-c", "import xarray, distributed"], check=True)
    bare = time.monotonic() - start
    one, _ = timed_command(site, folder / "one yaw", "yaw=0")
    yield "fragility of one yaw, whole command [s]", f"{one:.1f}", ""
    yield "  over `import xarray, distributed`", f"{one / bare:.1f}", "5"
    twelve, _ = timed_command(site, folder / "twelve")
    yield "fragility of twelve yaws, 30,000 runs, whole command [s]", f"{twelve:.1f}", "25"


def _timed(case: Case, pulses: Sequence[CosinePulse], engine: str) -> tuple[float, list[object]]:
    """CPU time of runs [s] at the step of the engine's boundary error of 1 %, and outcomes."""
    ladder, unit = load(engine).LADDER, step_unit(case.full.rock)
    step = min(ladder.coarse * unit, longest_step(case.full, engine))
    settings = Settings(step, engine=engine)
    simulate_all(case, pulses[:1], settings)
    start = time.process_time()
    found = simulate_all(case, pulses, settings)
    return time.process_time() - start, [response.outcome for response in found]
