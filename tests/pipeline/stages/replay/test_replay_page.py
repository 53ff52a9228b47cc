"""Replays of a small study: which run is meant, what is refused, and the page in a browser."""

from __future__ import annotations

import base64
import json
import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from scipy.spatial.transform import Rotation, Slerp
from support.browser import PHONE, Opened, settle, until
from support.jobs import built

from pipeline import cli
from pipeline.config.layers import load_site
from pipeline.config.problems import InputError
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Cell
from pipeline.stages.replay import choice, replay_page
from pipeline.stages.replay.choice import chosen, neighbour, other
from pipeline.stages.replay.film import Played, played
from pipeline.stages.runs.study import Study
from pipeline.workflow.datasets import read
from vsr_core.outcome import DecidedBy, Outcome

SITE = """
rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: [0.2, 0.4, 0.6, 0.8], pgv_pga: [0.1, 0.2, 0.3, 0.4]}
yaw: [0, 40]
"""
CELL = {"yaw": "40", "pgv_pga": "0.3", "pga": "0.6"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("site") / "small.yaml"
    path.write_text(SITE)
    return path


def vsr(site: Path, *more: str) -> list[str]:
    cell = {f"--{name.replace('_', '-')}": value for name, value in CELL.items()}
    given = [part for name in cell.keys() - {*more} for part in (name, cell[name])]
    derived = str(site.parent / "derived")
    return ["replay", "--site", str(site), "--derived", derived, "--workers", "0", *given, *more]


def page_of(site: Path, *more: str) -> Path:
    """The page of a run, as its command makes it."""
    folder = site.parent / "derived" / "small" / "replays"
    before = set(folder.glob("*.html"))
    assert cli.main(vsr(site, *more)) == cli.DONE
    (new,) = set(folder.glob("*.html")) - before
    return new


@pytest.fixture(scope="module")
def alone(site: Path, quick_time_step: None) -> Path:
    return page_of(site)


@pytest.fixture(scope="module")
def pair(site: Path, alone: Path) -> Path:
    return page_of(site, "--and", "engine=bullet")


def config_of(study: Study) -> Any:
    """As much of the configuration as tells a cell."""
    settings = study.settings
    return SimpleNamespace(yaw=study.yaw, contact=settings.contact, engine=settings.engine)


@pytest.fixture(scope="module")
def study(site: Path, alone: Path) -> Study:
    return built(Study, str(site), alone.parents[1])


@pytest.fixture(scope="module")
def responses(site: Path, alone: Path) -> xr.Dataset:
    derived = str(site.parent / "derived")
    run = ["run", "responses", "--site", str(site), "--derived", derived, "--workers", "0"]
    assert cli.main(run) == cli.DONE
    return read(alone.parents[1] / "responses.nc")


def again(study: Study, responses: xr.Dataset, given: dict[str, str]) -> Played:
    """A run of the study done once more."""
    choice = chosen(config_of(study), study.motions, given)
    return played(study, choice, choice.among(responses))


def films(page: Path) -> list[dict[str, Any]]:
    text = page.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    packed: list[dict[str, Any]] = json.loads(found[1])["films"]
    return packed


def numbers(text: str, kind: str = "<f4") -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), kind)


# ---- Which run


def test_a_cell_is_told_as_it_is_printed(site: Path) -> None:
    config = load_site(str(site)).config
    shaking = motion_grid.of_site(load_site(str(site)))
    choice = chosen(config, shaking, CELL | {"pga": "0.6001", "yaw": "4e1"})
    assert (choice.group.yaw, choice.cell.row, choice.cell.pga) == (40.0, 2, 0.6)
    assert choice.engine == "nonsmooth"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"pga": "0.5"}, ("--pga", "got 0.5", "0.2, 0.4, 0.6, 0.8 g", "nearest is 0.")),
        ({"yaw": "45"}, ("--yaw", "got 45", "0, 40 deg", "nearest is 40")),
        ({"pgv_pga": "9"}, ("--pgv-pga", "got 9", "nearest is 0.4")),
        ({"pga": "much"}, ("--pga", "'much'", "is a number")),
        ({"pga": "nan"}, ("--pga", "'nan'", "is a number")),
        ({"yaw": None}, ("--yaw", "nothing", "0, 40 deg", "choose one")),
        ({"record": "northridge"}, ("--record", "northridge", "selected by pgv_pga")),
    ],
)
def test_a_cell_outside_the_grid(site: Path, given: dict[str, Any], words: tuple[str, ...]) -> None:
    known = load_site(str(site))
    with pytest.raises(InputError) as refused:
        chosen(known.config, motion_grid.of_site(known), CELL | given)
    line = str(refused.value)
    assert "\n" not in line
    assert [word for word in words if word not in line] == [], line


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--pga", "0.5"), ("--pga", "the nearest is")),
        (("--and", "pga=7"), ("--pga", "the nearest is 0.8")),
        (("--and", "engine=abacus"), ("abacus", "bullet, mujoco, nonsmooth")),
        (("--and", "colour=red"), ("--and", "neighbour", "engine")),
        (("--and", "pga=0.6"), ("--and", "differs")),
        (("--and", "pga=0.2,pga=0.8"), ("--and", "pga=0.2,pga=0.8")),
        (("--and", ""), ("--and", "neighbour")),
    ],
)
def test_what_is_refused_is_refused_before_any_work(
    site: Path, refused: Callable[..., str], arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    cell = {f"--{name.replace('_', '-')}": value for name, value in CELL.items()}
    given = [part for name in cell.keys() - {*arguments} for part in (name, cell[name])]
    refused("replay", "--site", site, *given, *arguments, words=words)


def test_a_direction_is_the_same_a_turn_away() -> None:
    assert [choice._at("yaw", (-90.0, 90.0), given) for given in ("270", "-90", "450")] == [0, 0, 1]
    with pytest.raises(InputError, match="the nearest is -90"):
        choice._at("yaw", (-90.0, 90.0), "268")


def test_the_neighbour_is_the_nearest_that_ends_otherwise(
    site: Path, study: Study, responses: xr.Dataset
) -> None:
    for yaw in ("0", "40"):
        for pga in ("0.2", "0.4", "0.6", "0.8"):
            given = CELL | {"yaw": yaw, "pga": pga}
            first = chosen(config_of(study), study.motions, given)
            of_yaw = responses["overturned"].sel(yaw=float(yaw))[0].values
            second = neighbour(of_yaw, study.motions.pga, first)
            both = [
                Outcome(choice.among(responses)["outcome"]).overturned for choice in (first, second)
            ]
            assert sorted(both) == [0, 1]
            row = responses["overturned"].sel(yaw=float(yaw))[0, first.cell.row]
            others = row["pga"].values[row.values != both[0]]
            assert second.cell.row == first.cell.row
            assert abs(second.cell.pga - first.cell.pga) == pytest.approx(
                np.abs(others - first.cell.pga).min()
            )


def test_without_one_in_its_row_the_neighbour_is_of_the_nearest_row(study: Study) -> None:
    """As docs/replay.md says: beside a nearer one of another row goes one of its own."""
    pga = study.motions.pga
    first = chosen(config_of(study), study.motions, CELL | {"pga": "0.2"})
    overturned = np.zeros((len(study.motions.rows), len(pga)), dtype=int)
    overturned[0, 0] = overturned[first.cell.row - 1, 1] = 1
    assert neighbour(overturned, pga, first).cell == Cell(first.cell.row - 1, pga[1])
    overturned[first.cell.row, -1] = 1
    assert neighbour(overturned, pga, first).cell == Cell(first.cell.row, pga[-1])


def test_the_neighbour_is_near_in_pga_where_levels_are_not_as_far_apart(study: Study) -> None:
    """Beside 0.6 g, 0.8 g is two cells away and 0.1 g one."""
    first = chosen(config_of(study), study.motions, CELL | {"pga": "0.6"})
    pga = (0.1, 0.6, 0.7, 0.8)
    overturned = np.zeros((len(study.motions.rows), len(pga)), dtype=int)
    overturned[first.cell.row, [0, 3]] = 1
    assert neighbour(overturned, pga, first).cell == Cell(first.cell.row, 0.8)


# ---- The run of the study


@pytest.mark.slow
def test_only_the_run_that_is_shown_is_done(site: Path, tmp_path: Path) -> None:
    given = [word if word != str(site.parent / "derived") else str(tmp_path) for word in vsr(site)]
    assert cli.main(given) == cli.DONE
    with closing(sqlite3.connect(tmp_path / "small" / "runs.sqlite")) as database:
        assert database.execute("SELECT COUNT(*) FROM runs").fetchone() == (1,)
    assert not (tmp_path / "small" / "responses.nc").exists()
    assert cli.main([*given, "--and", "neighbour"]) == cli.DONE
    with closing(sqlite3.connect(tmp_path / "small" / "runs.sqlite")) as database:
        assert database.execute("SELECT COUNT(*) FROM runs").fetchone() == (16,)  # of its yaw


@pytest.mark.slow
def test_every_cell_ends_again_as_it_is_stored(study: Study, responses: xr.Dataset) -> None:
    for cell in motion_grid.cells(study.motions)[::3]:
        row = repr(study.motions.pgv_pga[cell.row])
        given = {"yaw": "40", "pgv_pga": row, "pga": repr(cell.pga)}
        run = again(study, responses, given)
        stored = responses.sel(yaw=40.0, pga=cell.pga).isel(friction=0, pgv_pga=cell.row)
        assert run.own
        assert int(stored["outcome"]) == run.replay.response.outcome
        assert float(np.abs(stored["final_tilt"] - run.replay.response.final_tilt)) == 0.0


def test_a_run_that_ends_otherwise_is_refused(study: Study, responses: xr.Dataset) -> None:
    choice = chosen(config_of(study), study.motions, CELL)
    changed = responses.copy(deep=True)
    changed["outcome"].loc[{"yaw": 40.0, "pga": 0.6}] = int(Outcome.DISPLACED)
    with pytest.raises(InputError, match=r"runs\.sqlite: got .*; .* another outcome; "):
        played(study, choice, choice.among(changed))


def test_what_is_packed_is_the_run(alone: Path, study: Study, responses: xr.Dataset) -> None:
    (film,) = films(alone)
    run = again(study, responses, CELL).replay
    np.testing.assert_allclose(numbers(film["time"]), run.time, rtol=1e-6)
    np.testing.assert_allclose(numbers(film["place"]).reshape(-1, 3), run.position, atol=1e-6)
    np.testing.assert_allclose(
        numbers(film["turn"], "<i2").reshape(-1, 4) / 32_767, run.quaternion, atol=2e-5
    )
    np.testing.assert_allclose(numbers(film["tilt"]), np.degrees(run.tilt), rtol=1e-5)
    assert numbers(film["count"], "u1").tolist() == [len(points) for points in run.bearing]
    np.testing.assert_allclose(
        numbers(film["acceleration"]).max(), 0.6, rtol=1e-5
    )  # of the table, in g


def test_the_page_tells_what_the_study_found(alone: Path, responses: xr.Dataset) -> None:
    text = alone.read_text(encoding="utf-8")
    stored = responses.sel(yaw=40.0, pga=0.6, pgv_pga=0.3).isel(friction=0)
    outcome = Outcome(int(stored["outcome"])).name.lower()
    how = DecidedBy(int(stored["decided_by"])).how  # type: ignore[call-arg]
    for said in ("small", "yaw 40°", "PGA 0.6 g", "PGV/PGA 0.3 s", outcome, how):
        assert said in text
    assert len(text) < 1_000_000


def test_the_index_leads_to_every_page(alone: Path, pair: Path) -> None:
    derived = alone.parents[2]
    text = (derived / "index.html").read_text(encoding="utf-8")
    for page in (alone, pair):
        assert f'href="{page.relative_to(derived).as_posix()}"' in text


def test_records_of_long_names_have_pages_of_their_own(
    study: Study, responses: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_page, "LONGEST_NAME", 20)
    cells = (CELL, CELL | {"pga": "0.8"})
    choices = [chosen(config_of(study), study.motions, cell) for cell in cells]
    runs = [played(study, choice, choice.among(responses)) for choice in choices]
    names = {replay_page._slug([run], study.motions) for run in runs}
    assert len(names) == 2


def test_an_engine_that_has_no_terrain_plays_none() -> None:
    """What the schema says of an engine holds for the second run, too."""
    few = ("motion.pga=[0.3]", "motion.pgv_pga=[0.2]", "yaw=0")
    site = load_site("double_rock_terrain", None, few)
    shaking = motion_grid.of_site(site)
    first = chosen(site.config, shaking, {})
    with pytest.raises(InputError, match=r"--and: simulation\.engine: .*convex hull"):
        other(site.config, shaking, first, "engine=mujoco")


@pytest.mark.slow
def test_an_engine_whose_table_turns_not_plays_no_such_motion(
    vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path
) -> None:
    pytest.importorskip("mujoco")
    motion = "{kind: table, pulses: [{axis: x}, {axis: roll, pga_ratio: 0.01}], "
    site = write_site(f"motion: {motion}pga: [0.3], pgv_pga: [0.2]}}\nyaw: 0\n")
    command = ("replay", "--site", site, "--workers", "0", "--and", "engine=mujoco")
    ran = vsr(*command)
    assert ran.code == cli.REFUSED
    assert "a table that turns in mujoco" in ran.err.splitlines()[-1]
    assert not list(derived.rglob("replays/*"))


def test_directions_to_both_sides_have_pages_of_their_own() -> None:
    shaking = SimpleNamespace(dimension="record", rows=("RSN316_FN", "RSN316-FN", "RSN316 FN"))
    names = {
        replay_page._slug(
            [SimpleNamespace(choice=SimpleNamespace(
                group=SimpleNamespace(yaw=yaw, friction=0.6),
                cell=SimpleNamespace(row=row, pga=pga), engine="nonsmooth"))],
            shaking,
        )
        for yaw in (-90.0, 90.0)
        for row in range(3)
        for pga in (0.3, 0.3000001)
    }  # fmt: skip
    assert len(names) == 12


# ---- In a browser


def drawn(page: Any) -> Any:
    until(page, "window.vsr.runs.every((run) => run.triangles > 0)")
    assert page.evaluate("window.vsr.runs.map((run) => run.error)").count(0) == len(
        page.evaluate("window.vsr.runs")
    )
    return page


def go_to(page: Any, time: float) -> float:
    page.locator("#time").fill(str(time))
    settle(page)
    now: float = page.evaluate("window.vsr.time")
    assert now == pytest.approx(time, abs=1e-3)
    return now


@pytest.mark.slow
def test_one_cursor_moves_all_views(
    opened: Opened, alone: Path, study: Study, responses: xr.Dataset
) -> None:
    page = drawn(opened(alone))
    run = again(study, responses, CELL).replay
    turns = Slerp(run.time, Rotation.from_quat(run.quaternion))
    cursors = []
    for time in (0.25, 0.6, 1.1):
        now = go_to(page, time)
        (shown,) = page.evaluate("window.vsr.runs")
        expected = [np.interp(now, run.time, part) for part in run.position.T]
        np.testing.assert_allclose(shown["position"], expected, atol=1e-4)
        assert (Rotation.from_quat(shown["quaternion"]).inv() * turns(now)).magnitude() < 1e-3
        at = int(np.searchsorted(run.time, now, side="right")) - 1
        np.testing.assert_allclose(
            np.reshape(shown["bearing"], (-1, 3)), run.bearing[at].reshape(-1, 3), atol=1e-5
        )
        values = page.locator("#panels .value").all_inner_texts()
        tilt, whole, kinetic, potential, points = (float(v.split()[-1]) for v in values[:5])
        assert tilt == pytest.approx(np.degrees(np.interp(now, run.time, run.tilt)), abs=0.051)
        sums = np.interp(now, run.time, run.kinetic + run.potential)
        assert whole == pytest.approx(sums, abs=0.51)
        assert kinetic + potential == pytest.approx(whole, abs=1.01)
        assert points == len(run.bearing[at])
        push = float(values[6].split()[-1])
        assert push == pytest.approx(
            np.interp(now, run.time, run.acceleration[:, 0]) / 9.80665, abs=2e-3
        )
        places = page.locator("#panels .cursor").evaluate_all(
            "all => all.map(x => x.x1.baseVal.value)"
        )
        assert len(places) == 5
        cursors.append(places)
        assert page.locator(".after").is_visible() == (now > run.decided)
    assert (np.diff(np.array(cursors), axis=0) > 10.0).all()


@pytest.mark.slow
def test_keys_play_and_step(opened: Opened, alone: Path) -> None:
    page = drawn(opened(alone))
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("window.vsr.time") == pytest.approx(0.1)
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("window.vsr.time") == pytest.approx(0.05)
    page.keyboard.press("End")
    settle(page)
    assert (
        page.locator("#now").inner_text().split()[0] == page.locator("#now").inner_text().split()[2]
    )
    page.keyboard.press("Home")
    page.keyboard.press("Shift+ArrowRight")
    first = float(numbers(films(alone)[0]["time"])[1])
    assert page.evaluate("window.vsr.time") == pytest.approx(first, abs=1e-6)
    page.keyboard.press(" ")
    until(page, "window.vsr.time > 0.1")
    page.keyboard.press(" ")
    assert not page.evaluate("window.vsr.playing")
    page.locator("canvas").focus()
    before = page.locator("canvas").screenshot()
    page.keyboard.press("ArrowLeft")  # turns the view, and not the time
    now = page.evaluate("window.vsr.time")
    settle(page)
    assert page.locator("canvas").screenshot() != before
    assert page.evaluate("window.vsr.time") == now


def test_a_click_in_a_diagram_goes_to_its_time(opened: Opened, alone: Path) -> None:
    page = drawn(opened(alone))
    picture = page.locator("svg.curves").first
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    page.mouse.click(box["x"] + 46 + 0.5 * (box["width"] - 54), box["y"] + 40)
    end = float(page.locator("#now").inner_text().split()[2])
    assert page.evaluate("window.vsr.time") == pytest.approx(0.5 * end, abs=0.02 * end)


def test_two_runs_at_one_time(opened: Opened, pair: Path) -> None:
    page = drawn(opened(pair))
    assert page.locator("canvas").count() == 2
    assert "engine bullet" in page.locator("header").inner_text()
    assert "not part of the study" in page.locator("header").inner_text()
    go_to(page, 0.4)
    one, two = page.evaluate("window.vsr.runs")
    # two engines that share no code show nearly the same before the rock has rocked often
    np.testing.assert_allclose(one["position"], two["position"], atol=0.02)
    assert one["position"] != two["position"]


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("alone", marks=pytest.mark.slow), "pair"])
def test_a_phone_needs_no_sideways_scrolling(
    opened: Opened, name: str, request: pytest.FixtureRequest
) -> None:
    page = drawn(opened(request.getfixturevalue(name), viewport=PHONE, has_touch=True))
    assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
    page.locator("#play").tap()
    until(page, "window.vsr.time > 0.05")
    wide = page.locator("svg, canvas, button, select, input, output").evaluate_all(
        "all => Math.max(...all.map(x => x.getBoundingClientRect().right))"
    )
    assert wide <= PHONE["width"]
