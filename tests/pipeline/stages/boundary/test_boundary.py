"""The boundary between the cells of a grid: runs like others, and what they say of a rock."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Ran
from support import ways

from pipeline.stages.boundary import boundary
from pipeline.stages.runs import overturning_runs
from pipeline.workflow.datasets import read
from pipeline.workflow.run_store import RUNS
from vsr_core import GRAVITY
from vsr_core.outcome import Outcome
from vsr_core.run.rocking_block import Block, first_overturning_pga

GRID = "motion: {pga: [0.2, 0.4, 0.6, 0.8], pgv_pga: [0.2, 0.4]}\n"
BLOCK = "rock: {shape: box, size: [1.0, 1.0, 2.0], density: 2110}\nyaw: 0\n"

Make = Callable[..., Path]


@pytest.fixture
def make(vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path) -> Make:
    """Make boundary.nc of a small site with settings; returns its folder."""

    def run(text: str = GRID, *settings: str, workers: str = "0", into: Path | None = None) -> Path:
        options = [part for item in settings for part in ("--set", item)]
        told = ["--workers", workers] if workers else []
        ran = vsr("run", "boundary", "--site", write_site(text), *told, *options, into=into)
        assert ran.code == 0, ran.err
        return (into or derived) / "rock"

    return run


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Largest accelerations [g] of runs that this process has done; it is ended in the 15th.

    Those that were simulated together with the 15th are not done.
    """
    peaks: list[float] = []
    simulate = overturning_runs.simulate_all

    def counting(case: Any, motions: Sequence[Any], settings: Any) -> Any:
        if len(peaks) <= 14 < len(peaks) + len(motions):
            raise KeyboardInterrupt
        found = simulate(case, motions, settings)
        peaks.extend(motion.peak_acceleration / GRAVITY for motion in motions)
        return found

    monkeypatch.setattr(overturning_runs, "simulate_all", counting)
    return peaks


def stored(folder: Path) -> set[bytes]:
    with closing(sqlite3.connect(folder / RUNS)) as database:
        return {key for (key,) in database.execute("SELECT key FROM runs")}


@pytest.mark.slow
def test_the_boundary_of_a_block_is_that_of_its_equation(make: Make) -> None:
    """In an interval of half a per cent, from a grid of steps of a tenth to a half."""
    fine = "simulation: {engine: nonsmooth, time_step: 0.0005}\n"
    data = read(make(BLOCK + GRID + fine) / "boundary.nc")
    lower, upper = (data[f"first_overturning_pga_{end}"].values[0, 0] for end in ("lower", "upper"))
    assert (upper / lower <= 1.005 * (1 + 1e-9)).all()
    first = data["first_overturning_pga"].values[0, 0]
    np.testing.assert_allclose(first, np.sqrt(lower * upper), rtol=1e-12)
    block = Block(0.5, 1.0)
    exact = [first_overturning_pga(block, r, 4 * GRAVITY, 0.05, 1e-5) for r in (0.2, 0.4)]
    np.testing.assert_allclose(first, np.array(exact) / GRAVITY, rtol=0.006)


@pytest.mark.slow
def test_runs_of_a_bisection_are_stored_and_done_once(make: Make, counted: list[float]) -> None:
    """A run that is interrupted goes on where it was, and no finished run is repeated."""
    with pytest.raises(AssertionError, match="goes on from there"):
        make()
    first = list(counted)
    counted[:] = [0.0] * 20  # past the interruption
    folder = make()
    again = counted[20:]
    data = read(folder / "boundary.nc")
    grid = 8
    assert len(stored(folder)) == grid + data.sizes["run"]
    between = sorted(data["run_pga"].values.tolist())
    done = sorted([*first[grid:], *again])
    assert done == pytest.approx(sorted(between))
    assert min(len(first[grid:]), len(again)) > 0
    before = (folder / "boundary.nc").read_bytes()
    (folder / "boundary.nc").unlink()
    counted[:] = [0.0] * 20
    make()
    assert len(counted) == 20
    assert (folder / "boundary.nc").read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["nonsmooth", "bullet", "mujoco"])
def test_workers_change_no_bit(make: Make, tmp_path: Path, engine: str) -> None:
    text = f"{BLOCK}{GRID}simulation: {{engine: {engine}, time_step: 0.001}}\n"
    alone = make(text)
    shared = make(text, workers="2", into=tmp_path / "shared")
    assert stored(alone) == stored(shared)
    assert (alone / "boundary.nc").read_bytes() == (shared / "boundary.nc").read_bytes()


@pytest.mark.parametrize(
    ("ground", "motion"),
    [
        ("mesh", "record"),
        pytest.param("terrain", "cosine", marks=pytest.mark.slow),
        pytest.param("terrain", "record", marks=pytest.mark.slow),
    ],
)
def test_on_terrain_and_with_records(
    vsr: Callable[..., Ran], tmp_path: Path, derived: Path, ground: str, motion: str
) -> None:
    ways.write_scans(tmp_path)
    site = tmp_path / "rock.yaml"
    site.write_text(ways.site({"ground": ground, "motion": motion, "engine": "auto"}, "0.002"))
    bound = ("--set", "fragility.highest=0.8")
    ran = vsr("run", "boundary", "--site", site, "--workers", "0", *bound)
    assert ran.code == 0, ran.err
    data = read(derived / "rock" / "boundary.nc")
    lower, upper = (data[f"first_overturning_pga_{end}"].values for end in ("lower", "upper"))
    width = data["boundary_resolution"].values
    never = np.isinf(upper) & (lower == 0.8)
    assert (never | (upper / lower <= (1 + width) * (1 + 1e-9))).all()
    assert data.sizes["run"] > 0


@pytest.mark.slow
def test_beyond_the_grid_the_bounds_are_told(make: Make) -> None:
    short = "motion: {pga: [0.3, 0.4], pgv_pga: [0.002, 0.15]}\n"
    data = read(make(BLOCK + short) / "boundary.nc")
    assert data.attrs["searched_to_g"] == 4.0
    lower, upper = (data[f"first_overturning_pga_{end}"].values[0, 0] for end in ("lower", "upper"))
    assert (lower[0], upper[0]) == (4.0, np.inf)
    assert upper[1] / lower[1] < 1.006
    above = read(make(BLOCK + "motion: {pga: [1.3, 1.6], pgv_pga: 0.15}\n") / "boundary.nc")
    found = above["first_overturning_pga"].values.item()
    assert found == pytest.approx(data["first_overturning_pga"].values[0, 0, 1], rel=0.006)
    settings = ("fragility.lowest=1.2",)
    bounded = read(
        make(BLOCK + "motion: {pga: [1.3, 1.6], pgv_pga: 0.15}\n", *settings) / "boundary.nc"
    )
    assert np.isnan(bounded["first_overturning_pga_lower"].values).all()
    assert bounded["first_overturning_pga_upper"].values.item() == 1.2


def test_a_resolution_finer_than_the_error_is_refused(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    site = write_site(BLOCK + GRID + "simulation: {engine: nonsmooth, tolerance: 0.03}\n")
    ran = vsr("run", "boundary", "--site", site, "--set", "fragility.resolution=0.0001")
    assert ran.code == 2
    (line,) = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert "fragility.resolution: got 0.0001; an interval is no narrower than" in line
    assert re.search(r"time step of [\d.]+ ms", line)
    assert not (derived / "rock" / "boundary.nc").exists()


def test_probes_that_end_otherwise_than_the_cells_below_them_are_told() -> None:
    cells, grid = np.array([[[[0, 0, 1, 1]]]], "i1"), np.array([0.1, 0.2, 0.3, 0.4])
    ends = [Outcome.BALANCED, Outcome.OVERTURNED, Outcome.OVERTURNED, Outcome.UNSETTLED]
    pga = np.array([0.15, 0.15, 0.35, 0.35])
    found = boundary._wrong(cells, grid, np.zeros(4, int), pga, np.array(ends))
    assert found.tolist() == [False, True, False, False]


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("fragility.lowest=5", "lowest must be below highest"),
        ("fragility.resolution=0", "greater than or equal to 0.0001"),
        ("fragility.resolution=fine", "should be a valid number"),
        ("fragility.highest=50", "less than or equal to 10"),
        ("motion.pga=automatic", "should be a valid number"),
        ("fragility.width=0.01", "unknown key"),
    ],
)
def test_what_cannot_be_resolved_is_refused_in_one_line(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, setting: str, words: str
) -> None:
    ran = vsr("run", "boundary", "--site", write_site(BLOCK + GRID), "--set", setting)
    assert ran.code == 2
    assert ran.err.count("\n") == 1
    assert words in ran.err
    assert not derived.exists()


@pytest.mark.parametrize(
    ("motion", "bounds", "told"),
    [
        ("{pga: [0.8, 0.9], pgv_pga: 2.0}", "{lowest: 0.6}", "below 0.6 g"),
        ("{pga: [0.1, 0.2], pgv_pga: 0.05}", "{highest: 0.3}", "above 0.3 g"),
    ],
)
def test_what_lies_beyond_the_bounds_is_said_so(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path, motion: str,
    bounds: str, told: str
) -> None:  # fmt: skip
    """A range that always topples, and one that never does."""
    text = f"{BLOCK}motion: {motion}\nfragility: {bounds}\n"
    ran = vsr("run", "fragility", "--site", write_site(text), "--workers", "0")
    assert ran.code == 0, ran.err
    assert told in (derived / "rock" / "report.html").read_text(encoding="utf-8")
