"""Error against run time as a product: its table, its page, and what it says of other engines."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from conftest import Ran

from pipeline import cli
from pipeline.config.schema import ContactConfig, PedestalConfig, SceneSettings, SimulationConfig
from pipeline.drawing.style import png
from pipeline.stages.studies.accuracy import accuracy, comparison, quantity_fronts, worker_tasks
from pipeline.stages.studies.accuracy.accuracy import _better, cheapest, measured, work_precision
from pipeline.workflow import pages
from pipeline.workflow.datasets import read
from vsr_core.rock import solid
from vsr_core.run import agreement, time_step
from vsr_core.verification import other_engines, reference, sensitivity
from vsr_core.verification.work_precision import Target

pytest.importorskip("mujoco")

SITE = (
    "rock: {shape: box, size: [1, 1, 3], density: 2110}\n"
    "motion: {pga: [0.2, 0.4, 0.6], pgv_pga: [0.2, 0.4]}\n"
    "simulation: {time_step: auto}\n"
)


def test_a_box_is_compared_on_all_rows_of_its_narrow_face() -> None:
    """On the broad one every way is right."""
    rock = solid.box((1.0, 0.5, 1.7), 2600.0).rock
    unit = time_step.step_unit(rock)
    places = comparison._places(rock)
    assert places == [(90.0, share * unit) for share in time_step.BOX_PERIODS]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, quick_time_step: None) -> Path:
    """Of two other engines, two steps, a few cells and cases: seconds instead of minutes."""
    folder = tmp_path_factory.mktemp("accuracy")
    (folder / "rock.yaml").write_text(SITE, encoding="utf-8")
    given = ["run", "accuracy", "--site", str(folder / "rock.yaml"), "--workers", "0"]
    missing, every = other_engines.missing, sensitivity.variations()
    few = tuple(
        v for v in every if v.what in ("as chosen", "pedestal") and v.value != "triangle mesh"
    )
    some = tuple(case for case in reference.cases() if "fall" in case.name or "slid" in case.name)
    names = ["dart", "mujoco_default", "published_setup"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(other_engines, "names", lambda: names)
        patch.setattr(
            other_engines, "missing", lambda n: ("dartpy",) if n == "dart" else missing(n)
        )
        patch.setattr(time_step, "BOX_PERIODS", (0.6,))
        patch.setattr(worker_tasks, "BUDGET", 0.2)
        patch.setattr(comparison, "CELLS", 6)
        patch.setattr(quantity_fronts, "PULSES", 60)
        patch.setattr(comparison, "STEPS", (1 / 500, 1 / 1000))
        patch.setattr(sensitivity, "variations", lambda: few)
        patch.setattr(reference, "cases", lambda: some)
        assert cli.main([*given, "--derived", str(folder / "derived")]) == cli.DONE
    return folder / "derived" / "rock"


@pytest.mark.slow
def test_table_page_picture_and_dataset(made: Path) -> None:
    with (made / "accuracy.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    parts = {row["part"] for row in rows}
    assert parts == {"method", "sweep", "cells", "quantity", "reference"}
    measured = [row for row in rows if row["part"] in ("method", "sweep") and row["cpu_s"]]
    methods = {row["method"] for row in measured if row["part"] == "method"}
    labels = {other_engines.load(name).LABEL for name in ("mujoco_default", "published_setup")}
    assert methods == {"project, bullet", "project, mujoco", "project, nonsmooth"} | labels
    for row in measured:
        assert float(row["cpu_s"]) > 0.0
        assert agreement.OFFSETS[0] <= float(row["error"]) <= float(row["worst"])
        assert float(row["worst"]) <= agreement.WORST
        assert row["rows"] == "1"
    own = {r["setting"]: float(r["error"]) for r in measured if r["method"] == "project, bullet"}
    assert own["0.003"] < 0.01  # against Housner's equation, at the finest of the steps
    absent = [row for row in rows if "not installed: dartpy" in row["note"]]
    assert [row["method"] for row in absent] == [other_engines.load("dart").LABEL]
    page = (made / "accuracy.html").read_text()
    assert page.count("<img src=") == 3
    for text in (*methods, "not installed: dartpy", "Housner", "tolerance: 1 %"):
        assert text.replace("'", "&#39;") in page
    assert (made / "work_precision.png").read_bytes().startswith(b"\x89PNG")
    assert (made / "work_precision.pdf").read_bytes().startswith(b"%PDF")
    cells = read(made / "accuracy.nc")
    assert cells.sizes["cell"] == 6
    assert set(cells["cell_pga"].values.round(6)) <= {0.2, 0.4, 0.6}
    assert {"outcome_bullet", "outcome_mujoco", "outcome_fine"} <= set(cells.data_vars)


@pytest.mark.slow
def test_every_quantity_has_its_front(made: Path) -> None:
    table = pd.read_csv(made / "accuracy.csv")
    lines = table[table["part"] == "quantity"]
    assert set(lines["method"]) == {"largest tilt", "final tilt", "slip"}
    for name, own in lines.groupby("method"):
        assert (own["error"] <= own["worst"]).all()
        assert (own["cpu_s"] > 0.0).all()
        exact = name == "largest tilt"
        assert own["note"].str.contains("Housner").all() == exact
    page = " ".join((made / "accuracy.html").read_text().split())
    assert page.count('<td>largest tilt</td><td class="soft">Housner&#39;s equation</td>') == 1


def record(method: str, step: float, error: float, seconds: float) -> dict[str, object]:
    return {
        "part": "method",
        "method": method,
        "setting": f"{step:g}",
        "own": method.startswith("project"),
        "step": step,
        "error": error,
        "worst": error,
        "cpu_s": seconds,
        "lost": 0,
    }


MEASURED = pd.DataFrame(
    [
        record("project, bullet", 0.01, 0.03, 1e-3),
        record("project, bullet", 0.005, 0.008, 2e-3),
        record("project, bullet", 0.002, 0.002, 5e-3),
        record("peer", 4.0, 0.01, 3e-3),
        record("peer", 2.0, 0.001, 6e-3),
        record("late", 4.0, 0.02, 9e-3),
    ]
)


def test_cheapest_setting_within_a_tolerance() -> None:
    found = cheapest(MEASURED, 0.01)[["method", "cpu_s"]].to_numpy().tolist()
    assert found == [["project, bullet", 2e-3], ["peer", 3e-3]]


def test_a_peer_that_does_better_is_named() -> None:
    """Less error than every setting of the project that costs no more; nothing else is better."""
    found = measured(MEASURED)
    assert len(_better(found)) == 1
    assert _better(found)[0].startswith("peer at 2: 0.1 %")
    assert _better(found[found["cpu_s"] != 6e-3]) == []


def test_settings_go_from_coarse_to_fine_and_the_project_comes_first() -> None:
    found = measured(MEASURED[::-1])
    assert found["method"].unique().tolist() == ["project, bullet", "late", "peer"]
    assert found["cpu_s"].tolist()[:3] == [1e-3, 2e-3, 5e-3]
    assert png(work_precision(MEASURED, 0.01, "x")).startswith(b"\x89PNG")


def test_a_diagram_without_a_setting_has_no_legend() -> None:
    """As where nothing topples; a warning of it would be an error here."""
    assert not work_precision(MEASURED[:0], 0.01, "x").legends
    assert work_precision(MEASURED, 0.01, "x").legends


@pytest.mark.slow
def test_page_and_log_say_what_references_of_a_scanned_rock_know(made: Path) -> None:
    """Three engines, told from the boundary by 3 % and more: no method's error can be 1 %."""
    references = (("bullet", 0.000375), ("mujoco", 0.000375), ("nonsmooth", 0.0025))
    passing = {
        5.0 * (1.0 + side * offset): frozenset({side > 0.0} if offset >= 0.03 else ())
        for offset in agreement.OFFSETS
        for side in (-1.0, 1.0)
    }
    targets = {
        (90.0, ratio): Target(ratio, 5.0, False, spread, references, passing)
        for ratio, spread in ((0.275, 0.044), (0.3, agreement.WINDOW))  # the last: none held all
    }
    table = MEASURED.assign(rows=1, note="", error=MEASURED["error"].clip(lower=0.03))
    config = SceneSettings(
        PedestalConfig(), ContactConfig(friction=(0.6,)), "table_frame", None, SimulationConfig()
    )
    chosen = read(made / "time_step.nc")
    diagram = work_precision(table, 0.01, "x")
    shown = accuracy.facts("scan", config, table, targets, chosen, diagram)
    page = " ".join(pages.filled(accuracy.PAGE, shown).split())
    assert "<td>bullet at 1/16, mujoco at 1/16 and nonsmooth at 1/8 of the usual step</td>" in page
    for text in (
        '<td class="n">4.4</td>',
        '<td class="n">10 or more</td>',
        "their references know the boundary to 3 % only, and no smaller error can be told.",
        "Engines of this project are both among the methods compared and, at finer steps,",
        "Errors below 3 % or above 12 % are not resolved",
        "No other method has a smaller error than this project at the same cost or less.",
    ):
        assert text in page
    told = accuracy._summary(table, 0.03)
    assert told.endswith("none can be told, the references know the boundary to 3 %")
    assert "Engines of this project are both" not in (made / "accuracy.html").read_text()
    assert "Errors below 0.125 % or" in (made / "accuracy.html").read_text()


@pytest.mark.parametrize(
    "key",
    [
        "motion.kind: got sine_pulse",
        "drive: got servo",
        "contact.restitution: got 0.3",
        "contact.rolling_friction: got 0.002",
    ],
)
def test_what_not_every_way_can_hold_is_refused_before_any_runs(
    key: str, write_site: Callable[..., str], vsr: Callable[..., Ran]
) -> None:
    site = write_site(
        SITE.replace("auto", "0.002").replace("motion: {", "motion: {kind: cosine_pulse, ")
    )
    told, value = key.split(": got ")
    ran = vsr("run", "accuracy", "--site", site, "--workers", 0, "--set", f"{told}={value}")
    assert ran.code == cli.REFUSED
    (line,) = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert f"{key}; " in line
    assert "references" not in ran.err
