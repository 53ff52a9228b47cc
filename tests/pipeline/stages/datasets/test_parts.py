"""Products made and read by parts: the same as of a whole, in memory that does not follow cells."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.jobs import built, job, work

from pipeline.stages.datasets import responses
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.mesh.products import RockData
from pipeline.stages.motions.motion_grid import Cell
from pipeline.stages.reports import report_tables, teaching_runs
from pipeline.stages.runs import runner
from pipeline.stages.runs.overturning_runs import KIND, Runs
from pipeline.stages.runs.runner import run_missing
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.workflow import datasets, graph
from pipeline.workflow.datasets import read
from pipeline.workflow.store import Store
from vsr_core.outcome import DecidedBy, Movement, Outcome

GRID = """
motion: {pga: {start: 0.2, stop: 0.9, num: 5}, pgv_pga: {start: 0.05, stop: 0.4, num: 4}}
yaw: [0, 90]
contact: {friction: [0.3, 0.8]}
simulation: {time_step: 0.002}
"""


@pytest.mark.slow
def test_parts_of_any_size_give_the_same_products(
    write_site: Callable[..., str],
    vsr: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Parts of a row of 5 runs, and of all of a direction."""
    site, found = write_site(GRID), []
    monkeypatch.setattr(datasets, "LARGE", 0)
    for number in (3, 65_536):
        monkeypatch.setattr(runner, "AT_ONCE", number)
        into = tmp_path / f"{number}"
        assert vsr("run", "fragility", "--site", site, "--workers", 0, into=into).code == 0
        found.append(into / "rock")
    whole = found[-1]
    data = read(whole / "responses.nc")
    assert 0 < (data["overturned"].values == 1).mean() < 1
    assert data["slip"].encoding["chunksizes"] == (1, 1, 4, 5)
    assert read(found[0] / "responses.nc")["slip"].encoding["chunksizes"] == (1, 1, 1, 5)
    for other in found[:-1]:
        for name in ("responses.nc", "boundary.nc", "fragility.nc", "bullet_sample.nc"):
            assert read(other / name).identical(read(whole / name)), name
        table = (whole / "fragility.csv").read_bytes()
        assert (other / "fragility.csv").read_bytes() == table


def ends(shared: Any, cells: tuple[Cell, ...]) -> list[tuple[Any, ...]]:
    """Ends as a weak and a strong motion have them, an island and unresolved runs among them."""
    rows = []
    for cell in cells:
        outcome = Outcome.OVERTURNED if cell.pga > 0.5 else Outcome.BALANCED
        if 0.695 < cell.pga < 0.705:
            outcome = Outcome.UNSETTLED if cell.row == 7 else Outcome.BALANCED
        by = DecidedBy.NO_UPLIFT_BOUND if cell.pga < 0.1 else DecidedBy.SIMULATION
        rows.append((int(outcome), int(by), cell.pga, cell.row * 1e-3, 0.01, cell.row))
    return rows


def looked_at(folder: Path, write_site: Callable[..., str], yaws: int) -> tuple[int, Any]:
    """Peak of memory [bytes] while responses of 6,400 runs a yaw are made and looked at."""
    grid = (
        "motion: {pga: {start: 0.01, stop: 1, num: 100}, pgv_pga: {start: 0.1, stop: 1, num: 64}}"
    )
    yaw = f"yaw: {{start: 0, stop: 350, num: {yaws}}}\nsimulation: {{time_step: 0.002}}"
    site = write_site(f"{grid}\n{yaw}\n", f"of_{yaws}")
    with Store(folder) as store:
        store.open()
        asked = job(site, store)
        for stage in ("rock", "motions", "time_step"):
            graph.make(stage, asked)
        study = built(Study, site, store)
        kind = replace(KIND, function=ends, batch=1000)
        own = work(site, store)
        run_missing(own, kind, study.groups, study.wanted, lambda group: None)
        rock, step = RockData.load(store), StepData.load(store)
        rock.data.load(), step.data.load()
        tracemalloc.start()
        made = responses.make(own, study, Runs.load(store), None, rock, step)
        made.files[Responses.FILE](folder / Responses.FILE)
        data = Responses.load(store).data
        said = {
            "counts": report_tables.counts(data),
            "unresolved": report_tables.unresolved(data, 3),
            "chosen": teaching_runs.chosen(data),
        }
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return peak, (made, read(folder / Responses.FILE), said)


@pytest.mark.slow
def test_memory_does_not_follow_the_number_of_cells(
    write_site: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The values of ten more directions take 48 bytes a cell; all that was done with them does not.

    What is said of them by parts is what arrays of them all say.
    """
    monkeypatch.setattr(runner, "AT_ONCE", 800)
    monkeypatch.setattr(datasets, "LARGE", 0)
    few, _ = looked_at(tmp_path / "few", write_site, 2)
    many, (made, data, said) = looked_at(tmp_path / "many", write_site, 12)
    values = sum(data[name].nbytes for name in responses.TYPES if name in data)
    assert many - few < 0.2 * values * 10 / 12
    outcome = data["outcome"].values
    lost = (outcome == Outcome.UNSETTLED).sum()
    assert made.unresolved == said["unresolved"]["total"] == lost > 0
    places = np.argwhere(outcome == Outcome.UNSETTLED)[:3]
    for one, place in zip(said["unresolved"]["listed"], places, strict=True):
        axes = ("yaw", "friction", "pgv_pga", "pga")
        assert [one[a] for a in axes] == [
            data[a].values[n] for a, n in zip(axes, place, strict=True)
        ]
    assert said["counts"]["total"] == outcome.size == 12 * 6400
    assert said["counts"]["peaks"] == np.isfinite(data["peak_tilt"].values).sum()
    rolled = (data["movement"].values == Movement.ROLLED_OVER).sum()
    assert f"{rolled:,} rolled over" in said["counts"]["ways"]
    proved = (data["decided_by"].values == DecidedBy.NO_UPLIFT_BOUND).sum()
    assert said["counts"]["proved"] == proved > 0
    below, above, *_ = (data["overturned"].values[place.at] for place in said["chosen"])
    assert (below, above) == (0, 1)
