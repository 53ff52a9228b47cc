"""What reductions gain: the page, the numbers in reports, and that rows undo what they name."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
import yaml

from benchmarks import reductions
from pipeline.config.layers import load_site
from pipeline.stages.reports import report_tables
from pipeline.stages.reports.report import GAINS
from pipeline.stages.runs import scenes
from vsr_core.judge import proofs
from vsr_core.rock.body import Rock
from vsr_core.run.cases import prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene

STATED = yaml.safe_load(GAINS.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def rock() -> Rock:
    return next(iter(reductions.rocks().values()))


def left_out(rock: Rock) -> list[scenes.LeftOut]:
    """What a run of the rock leaves out, as a report is told."""
    case = prepare(Scene(rock, Contact(0.6)), proofs.barrier(rock), reduce=True)
    settings = load_site("double_rock", settings=("simulation.engine=bullet",)).config.scene
    return scenes.left_out(settings, case, one_way=True)


def test_reports_state_what_the_page_says() -> None:
    lines = reductions.PAGE.read_text(encoding="utf-8").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "|" in line]
    page = {what: gain for what, _, gain, *_ in cells}
    named = {row.reduction.name.lower(): row for row in reductions.ROWS if row.reduction}
    assert {name: float(page[row.what]) for name, row in named.items()} == STATED
    assert len(STATED) == len(named) == 8


def test_every_gain_is_of_one_reduction(rock: Rock) -> None:
    dropped = left_out(rock)
    names, lines = [one.reduction.name.lower() for one in dropped], list(map(str, dropped))
    told = {"left_out": "\n".join(lines), "left_out_names": " ".join(names)}
    rows = report_tables.left_out(xr.Dataset(attrs=told), STATED)
    assert [f"{row['what']}: {row['why']}" for row in rows] == lines
    every = len(rock.vertices)
    assert sum(row["what"].endswith(f" of {every} hull vertices") for row in rows) == 1
    found = [row["gain"] for row in rows if row["gain"] is not None]
    assert sorted(found) == sorted(STATED.values())
    for name, gain in STATED.items():
        assert rows[names.index(name)]["gain"] == gain


def test_a_run_is_left_out_or_starts_late_and_each_row_undoes_its_own(rock: Rock) -> None:
    runs = reductions.cells(rock, 40)
    proved = 0
    for run in runs:
        _, simulated = reductions.no_proof_before(run)
        _, whole = reductions.whole_motion(run)
        is_proved = simulate(run.case, run.motion, run.settings).steps == 0
        assert (simulated.case.static_limits == (0.0, 0.0), whole is run) == (is_proved, is_proved)
        assert (whole.case.static_limits == (0.0, 0.0), simulated is run) == (
            not is_proved,
            not is_proved,
        )
        proved += is_proved
    assert 0 < proved < len(runs)


def test_one_step_a_sample_is_more_samples_of_the_same_motion(rock: Rock) -> None:
    run = reductions.cells(rock, 1)[0]
    grids = []
    sampling = reductions.overturning.sampling
    with reductions.patched(
        reductions.overturning,
        "sampling",
        lambda *given: grids.append(sampling(*given)) or grids[-1],
    ):
        simulate(run.case, run.motion, run.settings)
    with reductions.singly():
        single = reductions.overturning.sampling(run.motion, None, run.settings.time_step, 9)
    assert grids[0].substeps > 1
    assert single.substeps == 1
    np.testing.assert_allclose(
        [single.interval * single.pulse_samples, grids[0].interval * grids[0].pulse_samples],
        run.motion.duration,
    )
