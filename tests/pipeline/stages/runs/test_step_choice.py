"""The time step of each friction: what was measured stays known, and only that."""

from __future__ import annotations

import math
import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support import grounds

from pipeline.config.layers import load_site
from pipeline.config.schema import Config
from pipeline.stages.mesh.products import Ground, Standing
from pipeline.stages.runs import step_choice
from pipeline.stages.runs.scenes import Scenes, alone_at
from pipeline.workflow import progress
from pipeline.workflow.datasets import read
from pipeline.workflow.run_store import RUNS
from pipeline.workflow.store import Store
from vsr_core import GRAVITY
from vsr_core.judge.proofs import barrier
from vsr_core.rock import solid
from vsr_core.run import time_step
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.scene import State

GRID = """
motion: {pga: [0.01, 0.02], pgv_pga: 0.3}
contact: {friction: [0.6]}
simulation: {time_step: auto}
"""


def stored(config: Config, derived: Path) -> tuple[float, ...]:
    """Time steps that are known in the database."""
    scenes = Scenes(config.scene, Standing.load(Store(derived / "rock")))
    return step_choice.stored_steps(scenes, derived / "rock").steps


def test_measuring_that_lasts_is_told_and_done_once(
    write_site: Callable[..., str],
    vsr: Callable[..., Any],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(progress, "_SILENT_SECONDS", 0.0)
    command = ("run", "responses", "--site", write_site(GRID), "--workers", 0)
    assert re.search(r"time_step: measuring 1 boundary .*, \d+ s so far", vsr(*command).err)
    product = derived / "rock" / step_choice.StepData.FILE
    made = product.read_bytes()
    product.unlink()
    again = vsr(*command)
    assert (again.code, "measuring 1" in again.err) == (0, False), again.err
    assert product.read_bytes() == made


@pytest.mark.slow
def test_a_friction_more_keeps_what_was_measured(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path, tmp_path: Path
) -> None:
    site, two = write_site(GRID), ("--set", "contact.friction=[0.6, 0.7]")
    assert vsr("run", "responses", "--site", site, "--workers", 0).code == 0
    config = load_site(site, settings=two[1:]).config
    known = stored(config, derived)
    assert known[0] > 0.0
    assert math.isnan(known[1])
    more = vsr("run", "responses", "--site", site, "--workers", 0, *two)
    assert "measuring 1 boundary" in more.err  # of the new friction only
    whole = tmp_path / "whole"
    assert vsr("run", "responses", "--site", site, "--workers", 0, *two, into=whole).code == 0
    made, anew = (read(folder / "rock" / step_choice.StepData.FILE) for folder in (derived, whole))
    assert made.drop_attrs().equals(anew.drop_attrs())
    assert list(stored(config, derived)) == made["time_step"].values.tolist()


def test_code_of_terrains_decides_no_time_step(
    edit_function: Callable[[str, str, str], None],
) -> None:
    """On a flat pedestal it is not measured again for a terrain's sake."""
    rock = solid.box((0.5, 1.0, 2.0), 2000.0).rock
    scenes = Scenes(load_site("double_rock_terrain").config.scene, Standing(rock, barrier(rock)))
    scenes.__dict__["level_rock"] = rock
    wanted = [step_choice.Wanted(0, place) for place in time_step.lots(rock)[0]]
    before = step_choice._keys(scenes, wanted)
    edit_function("vsr_core/run/displacement.py", "displace", "str(1)")
    assert step_choice._keys(scenes, wanted) == before
    edit_function("vsr_core/judge/proofs.py", "cannot_topple", "str(1)")
    assert step_choice._keys(scenes, wanted) != before


def test_a_friction_more_keeps_what_was_measured_on_a_seat() -> None:
    """A key tells of the ground, and of the rock's rest on it at its own friction alone."""
    rock = solid.box((0.5, 0.4, 1.0), 2110.0).rock
    rests = [State(np.array([0.0, 0.0, z]), np.eye(3), *np.zeros((2, 3))) for z in (0.5, 0.501)]
    chosen = ("contact.friction=[0.6, 0.7]", "simulation.engine=nonsmooth")
    config = load_site("double_rock_terrain", settings=chosen).config
    both = Scenes(
        config.scene, Standing(rock, barrier(rock)), Ground(grounds.level(), tuple(rests))
    )
    (place, *_), *_ = time_step.lots(rock)
    rows = [step_choice._rows_of(both, step_choice.Wanted(at, place)) for at in (0, 1)]
    assert [row.group.friction for row in rows] == [0.6, 0.7]
    keys = step_choice._keys(both, [step_choice.Wanted(at, place) for at in (0, 1)])
    alone = alone_at(both, 1)
    own = step_choice._keys(alone, [step_choice.Wanted(0, place)])
    assert list(own.values()) == [keys[step_choice.Wanted(1, place)]]
    flat = step_choice._keys(replace(alone, ground=None), [step_choice.Wanted(0, place)])
    assert list(flat.values()) != list(own.values())


def test_a_reference_is_told_in_g() -> None:
    rock = solid.box((0.5, 1.0, 2.0), 2000.0).rock
    scenes = Scenes(load_site("cuboid_1x1x2").config.scene, Standing(rock, barrier(rock)))
    (place, *_), *_ = time_step.lots(rock)
    shares = np.zeros(len(step_choice._shares(scenes)))
    row = time_step.Row(0.3, 0.5 * GRAVITY, True, shares, shares, shares)
    told = step_choice._dataset(scenes, [{place: row}])
    assert told["row_reference"].values == pytest.approx(0.5)


@pytest.mark.slow
def test_a_reference_is_told_in_g_and_a_tighter_tolerance_takes_a_shorter_step(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path
) -> None:
    """Housner's block of 0.5 m and 1 m; half the tolerance, at most half the longest step."""
    block = "rock: {shape: box, size: [1.0, 1.0, 2.0], density: 2110}"
    site = write_site(block + GRID)
    assert vsr("run", "responses", "--site", site, "--workers", 0).code == 0
    made = read(derived / "rock" / step_choice.StepData.FILE).isel(friction=0)
    first = made.isel(row=0)
    assert (first["row_yaw"].item(), first["row_displaced"].item()) == (0.0, 0)
    exact = first_overturning_pga(
        Block(0.5, 1.0), first["row_pgv_pga"].item(), 4.0 * GRAVITY, 0.005 * GRAVITY
    )
    assert first["row_reference"].item() == pytest.approx(exact / GRAVITY, rel=1e-9)
    longest = made.attrs["longest_step_s"]
    assert made["time_step"].item() <= longest
    tight = load_site(site, settings=("simulation.tolerance=0.005",)).config
    (step,) = stored(tight, derived)
    assert 0.0 < step <= 0.5 * longest * (1.0 + 1e-9)
    assert step < made["time_step"].item()


@pytest.mark.slow
def test_a_measurement_that_was_damaged_is_not_believed(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path
) -> None:
    """A row with another number in it is no row."""
    site = write_site(GRID)
    assert vsr("run", "responses", "--site", site, "--workers", 0).code == 0
    path, config = derived / "rock" / step_choice.StepData.FILE, load_site(site).config
    made = read(path)
    assert stored(config, derived)[0] > 0.0
    with closing(sqlite3.connect(derived / "rock" / RUNS)) as database, database:
        database.execute("UPDATE time_step_rows SET reference = reference + 0.1")
    assert math.isnan(stored(config, derived)[0])
    path.unlink()
    again = vsr("run", "responses", "--site", site, "--workers", 0)
    assert again.code == 0
    assert "measuring 1 boundary" in again.err
    assert read(path).drop_attrs().equals(made.drop_attrs())


@pytest.mark.slow
def test_a_rock_that_nothing_moves_has_no_measured_error(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path
) -> None:
    """A slab of 4 m x 4 m x 0.5 m, whose tan(alpha) and friction are 8: it stays at 3.6 g."""
    slab = "rock: {shape: box, size: [4.0, 4.0, 0.5], density: 2110}\n"
    site = write_site(slab + GRID.replace("0.6", "8.0"))
    ran = vsr("run", "fragility", "--site", site, "--workers", 0)
    assert ran.code == 0
    made = read(derived / "rock" / step_choice.StepData.FILE).isel(friction=0)
    assert np.isposinf(made["row_reference"].values).all()
    assert set(made["row_displaced"].values.tolist()) == {0, 1}
    assert made["within_tolerance"].item() == 0
    assert np.isnan(made["boundary_error"].item())
    assert np.isnan(made["displaced_error"].item())
    finest = made["step_share"].values.min() * made.attrs["step_unit_s"]
    assert made["time_step"].item() == pytest.approx(finest)
    told = f"vsr: warning: {derived / 'rock'}: the error of the boundary was not measured"
    assert told in ran.err
    quiet = vsr("run", "fragility", "--site", site, "--workers", 0, "--quiet").err.splitlines()
    assert [line for line in quiet if "contact.friction: got 8" not in line] == [
        line for line in ran.err.splitlines() if line.startswith(told)
    ]
    page = (derived / "rock" / "report.html").read_text(encoding="utf-8")
    assert "the numerical error of the overturning boundary was not measured" in page
    assert "the finest time step was taken" in page
    assert "error of the boundary is at most" not in page


@pytest.mark.slow
def test_a_rock_that_slides_is_measured_by_its_sliding(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path
) -> None:
    """Friction 0.1 is below both slendernesses of the block, 1/4 and 1/2: nothing topples it."""
    site = write_site(GRID.replace("0.6", "0.1"))
    ran = vsr("run", "fragility", "--site", site, "--workers", 0)
    assert ran.code == 0
    made = read(derived / "rock" / step_choice.StepData.FILE).isel(friction=0)
    slides = made["row_displaced"].values == 1
    assert np.isposinf(made["row_reference"].values[~slides]).all()
    assert (made["row_reference"].values[slides] > 0.1).all()
    assert np.isnan(made["boundary_error"].item())
    assert 0.0 < made["displaced_error"].item() <= 0.01
    assert made["within_tolerance"].item() == 1
    assert np.isnan(read(derived / "rock" / "responses.nc")["boundary_error"].item())
    page = (derived / "rock" / "report.html").read_text(encoding="utf-8")
    assert "the numerical error of the overturning boundary was not measured" in page
    assert "lowest PGA that displaces the rock" in page


@pytest.mark.parametrize(
    ("errors", "stated", "counts"),
    [
        ([0.001, 0.002, 0.02], 0.02, (3, 3)),  # four in five of three are all
        ([0.001, 0.002, 0.02], 0.002, (0, 3)),  # all have moved by 0.003
        ([0.001, 0.002, 0.02, 0.003, 0.004], 0.004, (4, 5)),
        ([0.001, math.nan, 0.002, 0.003], 0.003, (3, 3)),  # one without a reference
    ],
)
@pytest.mark.parametrize("boundary", step_choice.Boundary)
def test_rows_that_keep_to_the_stated_error_are_counted(
    boundary: step_choice.Boundary, errors: list[float], stated: float, counts: tuple[int, int]
) -> None:
    """At the second of two steps; rows of the other boundary are none of it."""
    own = [[1.0 + error, error] for error in errors]
    kinds = [int(boundary)] * len(own) + [1 - int(boundary)] * 2
    measured = xr.Dataset(
        {
            "time_step": 0.02,
            "boundary_error": 1.0,
            "displaced_error": 1.0,
            "row_error": (("row", "step_share"), [*own, [0.0, 0.0], [0.0, 0.0]]),
            "row_shift": (("row", "step_share"), [[0.0, 0.003]] * len(kinds)),
            "row_displaced": ("row", kinds),
        },
        {"step_share": [0.4, 0.2]},
        {"step_unit_s": 0.1},
    )
    name = ("boundary_error", "displaced_error")[boundary]
    assert step_choice.kept(measured.assign({name: stated}), boundary) == counts


def test_a_finer_step_is_one_from_which_on_outcomes_agree() -> None:
    """The coarsest one agrees by luck: it was named as a finer one."""
    error = np.tile([0.005, 0.03, 0.008, 0.004], (3, 1))
    row = {"row_error": error, "row_shift": 0.0 * error, "row_steps": error}
    variables = {name: (("row", "step_share"), values) for name, values in row.items()}
    measured = xr.Dataset(
        variables | {"row_displaced": ("row", np.zeros(3, "i1")), "time_step": 0.4},
        {"step_share": [8.0, 4.0, 2.0, 1.0]},
        {"step_unit_s": 0.1},
    )
    assert step_choice.step_for(measured, 0.01) == pytest.approx(0.2)
    assert step_choice.step_for(measured, 0.005) == pytest.approx(0.1)
    assert step_choice.step_for(measured, 0.001) is None
