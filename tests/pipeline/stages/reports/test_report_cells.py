"""The cells of a report's diagrams tell what the study found, and some of its runs are played."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.browser import PHONE, Opened, settle, until

from pipeline import cli
from pipeline.stages.fragility.fragility_figures import (
    cell_borders,
    in_letters,
    overturning_diagram,
)
from pipeline.stages.reports import teaching_runs
from pipeline.workflow.datasets import read
from vsr_core.outcome import DecidedBy, Outcome

SITE = """
rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: {start: 0.15, stop: 0.9, num: 6}, pgv_pga: {start: 0.1, stop: 0.6, num: 5}}
yaw: [0, 40]
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, quick_time_step: None) -> Path:
    folder = tmp_path_factory.mktemp("site")
    site = folder / "small.yaml"
    site.write_text(SITE)
    command = ["run", "fragility", "--site", str(site), "--derived", str(folder), "--workers", "0"]
    assert cli.main(command) == cli.DONE
    return folder / "small"


@pytest.fixture(scope="module")
def responses(made: Path) -> xr.Dataset:
    return read(made / "responses.nc")


@pytest.fixture(scope="module")
def data(made: Path) -> dict[str, Any]:
    text = (made / "report.html").read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    packed: dict[str, Any] = json.loads(found[1])
    return packed


def told(responses: xr.Dataset, diagram: int, row: int, column: int) -> str:
    """What a cell has to tell, from the dataset alone."""
    run = responses.isel(yaw=diagram, friction=0, pgv_pga=row, pga=column)
    flags = dict(
        zip(run["outcome"].attrs["flag_values"], run["outcome"].flag_meanings.split(), strict=True)
    )
    how = DecidedBy(int(run["decided_by"])).how  # type: ignore[call-arg]
    motion = f"PGA {float(run['pga']):.6g} g, PGV/PGA {float(run['pgv_pga']):.6g} s"
    return f"{motion}: {flags[int(run['outcome'])]}; {how}"


# ---- Data


def test_the_cells_lie_where_they_are_painted(made: Path, responses: xr.Dataset) -> None:
    figure = overturning_diagram(responses, read(made / "fragility.nc"), (1, 0), "")
    figure.canvas.draw()
    across, down = cell_borders(figure, responses.isel(yaw=1, friction=0))
    (axes,) = figure.axes
    width, height = figure.canvas.get_width_height()
    for row, column in ((0, 0), (4, 5), (2, 3)):
        pga, ratio = float(responses["pga"][column]), float(responses["pgv_pga"][row])
        x, y = axes.transData.transform((pga, ratio))
        assert across[column] < x / width < across[column + 1]
        assert down[row + 1] < 1.0 - y / height < down[row]
        middle = 0.5 * (across[column] + across[column + 1])
        assert middle == pytest.approx(x / width, abs=1e-6)  # an even grid


def test_a_letter_is_an_outcome_and_a_rule() -> None:
    outcomes = np.array([[int(o) for o in Outcome for _ in DecidedBy]])
    rules = np.array([[int(r) for _ in Outcome for r in DecidedBy]])
    letters = in_letters(outcomes, rules)
    assert len(set(letters)) == outcomes.size
    assert letters.isalpha()
    assert in_letters(np.ones((2, 12)), np.full((2, 12), 3)) == "H24"


def test_the_runs_that_teach_are_chosen_by_their_rule() -> None:
    overturned = np.array([[0, 0, 1, 1, 1, 1], [0, 1, 1, 0, 1, 1], [1, 1, 1, 1, 1, 0]])
    tilt = np.where(overturned == 1, 1.0, 0.1)
    tilt[0, 1], tilt[1, 0] = 0.2, 0.3
    responses = xr.Dataset(
        {
            "overturned": (("yaw", "friction", "pgv_pga", "pga"), overturned[None, None]),
            "tilt_until_decided": (("yaw", "friction", "pgv_pga", "pga"), tilt[None, None]),
        },
        {"pgv_pga": [0.25, 0.3, 0.4]},
    )
    places = {place.why: place.at for place in teaching_runs.chosen(responses)}
    assert places == {
        "just below the boundary": (0, 0, 1, 0),
        "just above the boundary": (0, 0, 1, 1),
        "an island above the boundary": (0, 0, 1, 3),
    }
    never = responses.assign(overturned=xr.zeros_like(responses["overturned"]))
    assert teaching_runs.chosen(never) == []


def test_the_runs_played_are_those_of_the_study(
    data: dict[str, Any], responses: xr.Dataset
) -> None:
    places, films = data["watched"]["places"], data["watched"]["films"]
    assert [place["why"].split()[1] for place in places[:2]] == ["below", "above"]
    for place, film in zip(places, films, strict=True):
        run = responses.isel(
            yaw=place["diagram"], friction=0, pgv_pga=place["row"], pga=place["column"]
        )
        assert film["outcome"] == Outcome(int(run["outcome"])).name.lower()
        assert f"PGA {float(run['pga']):.4g} g" in place["name"]
    below, above = places[:2]
    assert (above["row"], above["column"]) == (below["row"], below["column"] + 1)
    assert [film["outcome"] for film in films[:2]] == ["balanced", "overturned"]


def test_the_report_stays_small(made: Path, data: dict[str, Any]) -> None:
    assert len(json.dumps(data["watched"])) < 200_000
    assert len(json.dumps([data["axes"], data["diagrams"]])) < 10_000


# ---- In a browser


@pytest.mark.slow
def test_every_cell_tells_what_the_study_found(
    opened: Opened, made: Path, responses: xr.Dataset
) -> None:
    page = opened(made / "report.html")
    for diagram in (0, 1):
        area = page.locator(".cells").nth(diagram)
        area.focus()
        for key in ["ArrowLeft"] * 6 + ["ArrowDown"] * 5:
            page.keyboard.press(key)
        seen = []
        for row in range(5):
            for column in range(6):
                seen.append(area.locator(".told").inner_text())
                assert seen[-1] == told(responses, diagram, row, column)
                page.keyboard.press("ArrowRight")
            for key in ["ArrowLeft"] * 6 + ["ArrowUp"]:
                page.keyboard.press(key)
        assert len(set(seen)) == 30


@pytest.mark.slow
def test_a_cell_tells_under_the_pointer_and_a_finger(
    opened: Opened, made: Path, responses: xr.Dataset, data: dict[str, Any]
) -> None:
    for options in ({}, {"viewport": PHONE, "has_touch": True}):
        page = opened(made / "report.html", **options)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        area = page.locator(".cells").nth(1)
        assert not area.locator(".told").is_visible()
        area.scroll_into_view_if_needed()
        box = area.bounding_box()
        row, column = 3, 1
        across, down = data["diagrams"][1]["across"], data["diagrams"][1]["down"]
        x = box["x"] + 0.5 * (across[column] + across[column + 1]) * box["width"]
        y = box["y"] + 0.5 * (down[row] + down[row + 1]) * box["height"]
        (page.touchscreen.tap if options else page.mouse.move)(x, y)
        assert area.locator(".told").inner_text() == told(responses, 1, row, column)


PAUSE = "(document.getElementById('play').click(), true)"


@pytest.mark.slow
def test_a_run_is_played_in_its_diagram(opened: Opened, made: Path, data: dict[str, Any]) -> None:
    page = opened(made / "report.html", viewport=PHONE)
    assert not page.locator("#player").is_visible()
    for number, place in enumerate(data["watched"]["places"]):
        page.locator(".spot").nth(0).wait_for()
        page.locator(f'[data-watch="{number}"]').press("Enter")
        until(page, f"window.vsr.time > 0.05 && {PAUSE}")
        assert page.evaluate("window.vsr.run") == number
        until(page, "window.vsr.triangles > 0")
        assert page.evaluate("window.vsr.error") == 0
        assert page.locator(".diagram").nth(place["diagram"]).locator("#player").is_visible()
        now = page.evaluate("window.vsr.time")
        page.wait_for_timeout(100)
        assert page.evaluate("window.vsr.time") == now
        before = page.evaluate("window.vsr.position")
        page.locator("#time").fill("1.2")
        settle(page)
        assert page.evaluate("window.vsr.position") != before
        assert page.locator("#state").inner_text().startswith("tilt ")
    assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]


@pytest.mark.slow
def test_a_run_chosen_again_goes_at_the_pace_of_the_clock(opened: Opened, made: Path) -> None:
    page = opened(made / "report.html")
    frame = "(done) => requestAnimationFrame((now) => done([now / 1000, window.vsr.time]))"
    at = f"new Promise({frame})"  # both of one frame: a busy machine draws few of them
    for _ in range(3):
        page.locator('[data-watch="0"]').press("Enter")
    first = page.evaluate(at)
    page.wait_for_timeout(300)
    later = page.evaluate(at)
    assert 0.0 < later[1] - first[1] < 1.3 * (later[0] - first[0])
