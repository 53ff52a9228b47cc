"""Speed of large displacement: a whole grid, what a larger terrain costs, what reductions gain."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.speed import WORKERS, cells
from benchmarks.table import Row, say
from pipeline.config.layers import load_site
from pipeline.config.schema import COMPILED
from pipeline.stages.mesh.products import Ground, Standing
from pipeline.stages.runs.scenes import Group, Scenes, terrain_case
from pipeline.workflow.store import Store
from vsr_core.engines import load
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.displacement import displace
from vsr_core.run.time_step import step_unit

SITE = "double_rock_terrain"

STEP = 0.0018
"""Time step [s] of the comparisons, about what this site measures for itself."""

RUNS = 12
"""Runs compared with Bullet, of which one takes a sixth of a second there."""

TRIANGLE_STEP = 1e-3
"""Time step of Bullet on triangles [s], of which one run takes 5 to 10 s of CPU."""

TILTS = [(0.3, 0.32), (0.34, 0.48), (0.46, 0.88), (0.94, 0.02)]
"""PGA [g] and PGV/PGA [s] of runs that stand, whose peak tilts are compared on triangles."""

CELLS = [(0.5, 0.3), (0.7, 0.5), (0.8, 0.7), (0.9, 0.4), (1.0, 0.6), (1.0, 0.9)]
"""PGA [g] and PGV/PGA [s] of the runs compared."""


def grid(folder: Path) -> Iterator[Row]:
    """The site from its raw scan to the report, 2,500 runs with trajectories."""
    say("a raw scan to rock and terrain")
    prepared = _command(folder, "prep")
    yield "raw scan to rock and terrain [s]", f"{prepared:.0f}", ""
    say("2,500 displacement runs with trajectories, statistics and pages")
    whole = _command(folder, "run", "displacement", "--workers", str(WORKERS))
    log = (folder / SITE / "log.jsonl").read_text(encoding="utf-8").splitlines()
    note = next(
        fact for fact in map(json.loads, reversed(log)) if fact["stage"] == "displacement_runs"
    )
    wall, cpu = note["seconds"], note["cpu_seconds"]
    yield "2,500 runs with trajectories on the terrain [s]", f"{wall:.0f}", "40"
    yield "  CPU of a run [ms]", f"{1e3 * cpu / note['runs']:.0f}", ""
    yield "  workers and store beyond that [%]", f"{100 * (wall * WORKERS / cpu - 1):.0f}", ""
    yield "  time step, statistics, figures and pages [s]", f"{whole - wall:.0f}", ""
    say("the same command again")
    again = _command(folder, "run", "displacement", "--workers", str(WORKERS))
    yield "  the second call [s]", f"{again:.1f}", "at most 3"


def against_bullet(folder: Path) -> Iterator[Row]:
    """CPU of a run with its trajectory in Bullet over that here; ``grid`` goes first."""
    say("trajectories in Bullet and in the compiled engine")
    scenes = _scenes(folder)
    site = terrain_case(scenes, Group(0.0, scenes.settings.contact.friction[0]))
    pulses = [CosinePulse.from_g(pga, pgv_pga) for pga, pgv_pga in cells(RUNS)]
    (own, found), (bullet, expected) = (_followed(site, pulses, e) for e in (COMPILED, "bullet"))
    differ = sum(a is not b for a, b in zip(found, expected, strict=True))
    what = "CPU of a run, Bullet / this, terrain with trajectory"
    yield what, f"{bullet / own:.1f}", "10"
    yield f"  outcomes of {RUNS} that differ", str(differ), ""
    say("the same triangles in both")
    yield from _on_triangles(site)


def _on_triangles(site: TerrainCase) -> Iterator[Row]:
    """Bullet on all triangles, in place of its convex parts, at a step fine enough for them."""
    assert site.seat.terrain is not None
    seat = replace(site.seat, terrain=replace(site.seat.terrain, parts=()))
    whole = replace(site, seat=seat, flight=seat)
    own_step = load(COMPILED).LADDER.coarse * step_unit(seat.rock)
    tilts, spent = [], []
    for case, settings in (
        (site, Settings(own_step, engine=COMPILED)),
        (whole, Settings(TRIANGLE_STEP, engine="bullet")),
    ):
        start = time.process_time()
        runs = [displace(case, CosinePulse.from_g(*at), settings, follow=False) for at in TILTS]
        spent.append(time.process_time() - start)
        tilts.append(np.array([run.response.peak_tilt for run in runs]))
    yield "  on all triangles, Bullet at 1 ms / this", f"{spent[1] / spent[0]:.0f}", ""
    apart = 100.0 * np.abs(tilts[0] / tilts[1] - 1.0).max()
    yield f"  largest difference of {len(TILTS)} peak tilts there [%]", f"{apart:.0f}", ""


def _followed(
    site: TerrainCase, pulses: Sequence[CosinePulse], engine: str
) -> tuple[float, list[Outcome]]:
    """CPU time of runs [s] at the step of the engine's boundary error of 1 %, and outcomes."""
    unit = step_unit(site.seat.rock)
    settings = Settings(load(engine).LADDER.coarse * unit, engine=engine)
    displace(site, pulses[0], settings)  # builds the worlds
    start = time.process_time()
    found = [displace(site, pulse, settings).response.outcome for pulse in pulses]
    return time.process_time() - start, found


def _scenes(folder: Path) -> Scenes:
    store = Store(folder / SITE)
    return Scenes(load_site(SITE).config.scene, Standing.load(store), Ground.load(store))


def reductions(folder: Path) -> Iterator[Row]:
    """CPU on a terrain four times as large, and without one reduction each; ``grid`` goes first."""
    scenes = _scenes(folder)
    group = Group(0.0, scenes.settings.contact.friction[0])
    site, rock = terrain_case(scenes, group), scenes.rock
    say("a step on the terrain as it is")
    usual = _cost(site)
    others = (
        ("CPU of a step on a terrain four times as large", _larger(site), "about 1"),
        ("CPU of a step with the seat's hull to the end", replace(site, flight=site.seat), ""),
        ("CPU of a step with all corners of the hull", _with(site, rock=rock), ""),
    )
    for what, other, target in others:
        say(what)
        yield f"{what} / as it is", f"{_cost(other) / usual:.2f}", target


def _larger(site: TerrainCase) -> TerrainCase:
    """The site with three more copies of its terrain around it, out of the rock's reach."""
    terrain = site.seat.terrain
    assert terrain is not None
    extent = np.append(np.ptp(terrain.vertices[:, :2], axis=0), 0.0)
    shifts = [extent * way for way in ([0, 0, 0], [-1, 0, 0], [0, 1, 0], [-1, 1, 0])]
    count = len(terrain.vertices)
    larger = replace(
        terrain,
        vertices=np.concatenate([terrain.vertices + shift for shift in shifts]),
        faces=np.concatenate([terrain.faces + k * count for k in range(len(shifts))]),
        parts=tuple(part + shift for shift in shifts for part in terrain.parts),
    )
    return replace(
        site, seat=replace(site.seat, terrain=larger), flight=replace(site.flight, terrain=larger)
    )


def _with(site: TerrainCase, **changes: object) -> TerrainCase:
    seat = replace(site.seat, **changes)  # type: ignore[arg-type]
    return replace(site, seat=seat, flight=seat)


def _cost(site: TerrainCase) -> float:
    """CPU time of a step [s], over the cells."""
    displace(site, CosinePulse.from_g(0.2, 0.1), Settings(STEP))  # builds the worlds
    start, steps = time.process_time(), 0
    for pga, pgv_pga in CELLS:
        steps += displace(site, CosinePulse.from_g(pga, pgv_pga), Settings(STEP)).response.steps
    return (time.process_time() - start) / steps


def _command(folder: Path, *words: str) -> float:
    """Wall time of a command [s]."""
    command = [sys.executable, "-m", "pipeline", *words, "--site", SITE, "--derived", str(folder)]
    start = time.monotonic()
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    return time.monotonic() - start
