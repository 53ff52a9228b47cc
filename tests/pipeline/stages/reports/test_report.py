"""The report of a small site, and its figures by what their artists hold."""

from __future__ import annotations

import base64
import html
import io
import re
import shlex
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from PIL import Image
from support.jobs import built, work

from pipeline import cli
from pipeline.config.layers import load_site
from pipeline.drawing import style
from pipeline.stages.fragility import fragility_figures, summary
from pipeline.stages.fragility.fragility_figures import (
    OVERTURNED,
    PROVED,
    UNDECIDED,
    cell_borders,
    fragility_by_yaw,
    overturning_diagram,
)
from pipeline.stages.fragility.rock_views import rock_views
from pipeline.stages.reports import report, report_tables
from pipeline.workflow.datasets import read
from vsr_core.outcome import DecidedBy, Outcome

pytestmark = pytest.mark.usefixtures("small_pictures")

SITE = """
rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: {start: 0.15, stop: 0.9, num: 6}, pgv_pga: {start: 0.1, stop: 0.6, num: 6}}
yaw: [0, 90]
"""
HOSTILE = 'a"><img src=x onerror=alert(1)>&b'


class Page(HTMLParser):
    """What a page shows and what it would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))

    def handle_data(self, data: str) -> None:
        self.text += data

    @property
    def images(self) -> list[str]:
        return [attrs["src"] for tag, attrs in self.tags if tag == "img"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, quick_time_step: None) -> Path:
    """Folder of products, by the command, of a site with a hostile name."""
    folder = tmp_path_factory.mktemp("site")
    site = folder / f"{HOSTILE}.yaml"
    site.write_text(SITE)
    derived = folder / "derived"
    command = ["run", "fragility", "--site", str(site), "--derived", str(derived), "--workers", "0"]
    assert cli.main(command) == cli.DONE
    return derived / HOSTILE


@pytest.fixture
def products(made: Path) -> dict[str, xr.Dataset]:
    return {name: read(made / f"{name}.nc") for name in ("rock", "responses", "fragility")}


def remade(folder: Path, site: Path) -> str:
    parts, out = built(report.Parts, str(site), folder), folder / "again.html"
    report.make(work(str(site), folder), parts, lambda: None).files["report.html"](out)
    return out.read_text(encoding="utf-8")


def artist(figure, gid, panel=0):
    found = [a for a in figure.axes[panel].get_children() if a.get_gid() == gid]
    assert len(found) == 1, gid
    return found[0]


def labels(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_page_holds_all_it_shows(made: Path) -> None:
    text = (made / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    loaded = [
        value
        for tag, attrs in page.tags
        for name, value in attrs.items()
        if name in ("src", "srcset", "data", "poster") or (name == "href" and tag != "a")
    ]
    assert loaded
    assert all(value.startswith("data:image/") for value in loaded)
    assert "url(" not in text
    assert "@import" not in text
    scripts = [attrs for tag, attrs in page.tags if tag == "script"]
    assert scripts[0]["type"] == "application/json"
    assert not any(scripts[1:])  # all of them are in the page
    assert len(page.images) == 2 + 2  # diagrams of two yaws, the rock, the polar plot
    for image in page.images:
        kind, _, data = image.removeprefix("data:image/").partition(";base64,")
        content = base64.b64decode(data, validate=True)
        if kind == "png":
            Image.open(io.BytesIO(content)).verify()
        else:
            assert ET.fromstring(content).tag == "{http://www.w3.org/2000/svg}svg"


def test_page_answers_first(made: Path, products: dict[str, xr.Dataset]) -> None:
    page = Page((made / "report.html").read_text(encoding="utf-8"))
    head = page.text[: page.text.index("The rock\n")]
    share = products["fragility"]["toppled_share"].values[:, 0]
    assert share[0] > share[1] > 0.0
    told = f"the largest share of the grid's runs at yaw 0 deg: {100 * share[0]:.0f}\xa0%"
    assert told in head
    assert "Shape of the rock: box." in head
    assert "All runs are resolved" in head
    for yaw in ("yaw 0 deg", "yaw 90 deg"):
        assert head.count(yaw) >= 1
    for model in products["fragility"]["recommended"].values.ravel():
        assert f"{model} (recommended)" in page.text
    for line in products["responses"].attrs["left_out"].splitlines():
        assert line.partition(": ")[2] in page.text
    assert "num: 6" in page.text


def test_yaws_with_an_equal_share_of_runs_are_not_called_equally_fragile(
    made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One topples at .25 g, one at .5 g: the cells of the grid alone do not tell them apart."""
    of = report_tables.by_yaw
    monkeypatch.setattr(
        report_tables, "by_yaw", lambda *data: [{**row, "share": 0.5} for row in of(*data)]
    )
    text = Page(remade(made, made.parent.parent / f"{HOSTILE}.yaml")).text
    assert "in an equal share of the grid's runs at all 2 yaws: 50\xa0% (first over" in text
    assert "equally fragile" not in text


def test_hostile_name_is_escaped(made: Path) -> None:
    page = Page((made / "report.html").read_text(encoding="utf-8"))
    assert HOSTILE in page.text
    assert all("onerror" not in attrs for _, attrs in page.tags)


@pytest.mark.slow
def test_undecided_runs_cannot_be_missed(made: Path, tmp_path: Path) -> None:
    shutil.copytree(made, tmp_path / "copy")
    file = tmp_path / "copy" / "responses.nc"
    data = read(file)
    data["outcome"][1, 0, 2, 3] = Outcome.UNSTABLE
    data["overturned"][1, 0, 2, 3] = -1
    data.to_netcdf(file)
    text = remade(tmp_path / "copy", made.parents[1] / f"{HOSTILE}.yaml")
    page = Page(text)
    assert "1 of 72 runs is UNRESOLVED" in page.text
    assert "All runs are resolved" not in page.text
    alarm = text[text.index('id="unresolved"') :]
    row = Page(alarm[: alarm.index("</section>")]).text
    assert [word in row for word in ("unstable", "90", "0.3", "0.6")] == [True] * 4
    assert page.text.index("UNRESOLVED") < page.text.index("Overturning diagrams")


def test_cells_are_the_outcomes(products: dict[str, xr.Dataset]) -> None:
    responses = products["responses"]
    figure = overturning_diagram(responses, products["fragility"], (0, 0))
    shown = np.asarray(artist(figure, "cells").get_array())
    runs = responses.isel(yaw=0, friction=0)
    np.testing.assert_array_equal(shown == OVERTURNED, runs["overturned"].values == 1)
    proved = runs["decided_by"].values == DecidedBy.NO_UPLIFT_BOUND
    assert proved.any()
    np.testing.assert_array_equal(shown == PROVED, proved)
    red = artist(figure, "cells").get_cmap()(OVERTURNED / 3)
    assert red[0] > 2 * red[2]


def test_axes_of_a_diagram_are_those_of_its_cells(products: dict[str, xr.Dataset]) -> None:
    responses = products["responses"]
    figure = overturning_diagram(responses, products["fragility"], (0, 0))
    (axes,) = figure.axes
    said = (axes.get_xlabel(), axes.get_ylabel())
    assert said == ("peak ground acceleration [g]", "PGV/PGA [s]")
    x, y = np.moveaxis(np.asarray(artist(figure, "cells").get_coordinates()), -1, 0)
    for borders, name in ((x[0], "pga"), (y[:, 0], "pgv_pga")):
        assert (borders[:-1] < responses[name].values).all()
        assert (responses[name].values < borders[1:]).all()


def test_undecided_and_displaced_cells_are_marked(products: dict[str, xr.Dataset]) -> None:
    responses = products["responses"].copy(deep=True)
    for column, outcome in enumerate((Outcome.UNSETTLED, Outcome.CRASHED, Outcome.DISPLACED)):
        responses["outcome"][1, 0, 4, column] = outcome
        responses["overturned"][1, 0, 4, column] = outcome.overturned
        responses["decided_by"][1, 0, 4, column] = DecidedBy.SIMULATION
    figure = overturning_diagram(responses, products["fragility"], (1, 0))
    pga, ratio = responses["pga"].values, responses["pgv_pga"].values
    crosses = artist(figure, "undecided")
    np.testing.assert_array_equal(crosses.get_xydata(), [[pga[0], ratio[4]], [pga[1], ratio[4]]])
    assert crosses.get_marker() == "x"
    assert (crosses.get_color(), crosses.get_markersize() >= 5) == ("black", True)
    dots = artist(figure, "displaced").get_xydata()
    assert [pga[2], ratio[4]] in dots.tolist()
    shown = np.asarray(artist(figure, "cells").get_array())
    assert (shown[4, :2] == UNDECIDED).all()
    assert (shown == UNDECIDED).sum() == 2
    assert "UNRESOLVED (2)" in labels(figure)


def test_of_more_cells_than_pixels_some_are_drawn_and_all_unresolved(
    products: dict[str, xr.Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    responses = products["responses"].copy(deep=True)
    responses["overturned"][0, 0, 0, 0] = -1
    whole = overturning_diagram(responses, products["fragility"], (0, 0))
    monkeypatch.setattr(fragility_figures, "_MOST_DRAWN", 4)
    thin = overturning_diagram(responses, products["fragility"], (0, 0))
    cells, fewer = (np.asarray(artist(one, "cells").get_array()) for one in (whole, thin))
    np.testing.assert_array_equal(fewer, cells[1::2, 1::2])
    corners, few = (artist(one, "cells").get_coordinates() for one in (whole, thin))
    np.testing.assert_array_equal(few, corners[::2, ::2])
    marks = [artist(one, "undecided").get_xydata().tolist() for one in (whole, thin)]
    assert marks[0] == marks[1] != []
    runs = responses.isel(yaw=0, friction=0)
    for one, other in zip(cell_borders(whole, runs), cell_borders(thin, runs), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_contours_stay_inside_the_tested_range(products: dict[str, xr.Dataset]) -> None:
    fragility = products["fragility"].copy(deep=True)
    grid = fragility["pga"].values
    fragility["recommended"][0, 0] = "smooth"
    fragility["median_pga"].loc[{"model": "smooth"}] = np.nan
    fragility["median_pga"][0, 0, 2] = [np.inf, 0.5, 0.4, 0.3, 0.0, 0.05]
    fragility["median_pga_interval"][0, 0, 2] = [
        [0.8, np.inf],
        *[[0.2, 0.6]] * 3,
        *[[0.0, 0.0]] * 2,
    ]
    figure = overturning_diagram(products["responses"], fragility, (0, 0))
    x = np.asarray(artist(figure, "median").get_xdata(), dtype=float)
    np.testing.assert_array_equal(x, [np.nan, 0.5, 0.4, 0.3, np.nan, np.nan])
    corners = artist(figure, "interval").get_paths()[0].vertices
    assert grid[0] <= corners[:, 0].min()
    assert corners[:, 0].max() == grid[-1]
    fragility["median_pga"][0, 0, 2] = np.inf
    fragility["median_pga_interval"][0, 0, 2] = [2 * grid[-1], np.inf]
    figure = overturning_diagram(products["responses"], fragility, (0, 0))
    assert not any("median" in text for text in labels(figure))  # neither line nor band
    fragility["recommended"][0, 0] = "none"
    assert not any(
        "model" in text
        for text in labels(overturning_diagram(products["responses"], fragility, (0, 0)))
    )


def test_boundary_stands_between_last_upright_and_first_overturned(
    products: dict[str, xr.Dataset],
) -> None:
    """As high as the cells of its row, at the first overturning of the runs between them."""
    fragility = products["fragility"]
    figure = overturning_diagram(products["responses"], fragility, (0, 0))
    grid = products["responses"]["overturned"].values[0, 0]
    pga, ratio = fragility["pga"].values, fragility["pgv_pga"].values
    strokes = artist(figure, "boundary").get_segments()
    rows = [n for n, row in enumerate(grid == 1) if row.any() and not row[0]]
    assert len(strokes) >= len(rows) > 0
    by_height = {np.searchsorted(ratio, stroke[:, 1].mean() - 1e-9): stroke for stroke in strokes}
    for n in rows:
        (left, low), (right, high) = by_height[n]
        assert left == right == fragility["first_overturning_pga"].values[0, 0, n]
        first = grid[n].argmax()
        assert pga[first - 1] < left < pga[first]
        assert low < ratio[n] < high


def test_rock_views(products: dict[str, xr.Dataset]) -> None:
    rock = products["rock"]
    figure = rock_views(rock)
    size = np.array([0.5, 1.0, 2.0])
    for panel, across in enumerate(([0, 2], [1, 2], [0, 1])):
        corners = np.concatenate([p.vertices for p in artist(figure, "surface", panel).get_paths()])
        np.testing.assert_allclose(np.ptp(corners, axis=0), size[across], rtol=1e-6)
        assert figure.axes[panel].get_aspect() == 1.0
    base = artist(figure, "base", 2).get_xy()
    np.testing.assert_allclose(np.ptp(base, axis=0), [0.5, 1.0])
    angles = [a.get_text() for a in figure.axes[2].texts if a.get_gid() == "weak"]
    assert angles == ["14.0°", "14.0°", "26.6°", "26.6°"]


def test_weak_directions(products: dict[str, xr.Dataset]) -> None:
    weak = summary.weak_directions(products["rock"])
    assert [w.direction for w in weak] == [0.0, 180.0, 90.0, 270.0]
    assert [w.yaw for w in weak] == [180.0, 0.0, 90.0, 270.0]
    assert weak[0].pga == pytest.approx(0.25, rel=1e-3)
    flat = xr.Dataset(
        {name: ("direction", np.full(360, 1.0)) for name in ("tipping_pga", "tipping_angle")}
    )
    assert len(summary.weak_directions(flat.assign_coords(direction=np.arange(360.0)))) == 1


def test_polar_plot(products: dict[str, xr.Dataset]) -> None:
    fragility = products["fragility"].copy(deep=True)
    figure = fragility_by_yaw(fragility, products["rock"])
    share = artist(figure, "share", 0)
    np.testing.assert_allclose(share.get_xdata(), np.radians([0.0, 90.0]))
    np.testing.assert_allclose(share.get_ydata(), 100 * fragility["toppled_share"].values[:, 0])
    for axes in figure.axes:
        assert (axes.get_theta_offset(), axes.get_theta_direction()) == (0.0, 1)
    assert "First-overturning PGA [g]" in figure.axes[1].get_title()
    first, _, _ = summary.typical_pga(fragility)
    np.testing.assert_allclose(artist(figure, "first", 1).get_ydata(), first[:, 0])
    static = artist(figure, "static", 1)
    np.testing.assert_allclose(static.get_ydata()[[0, 90, 180]], [0.25, 0.5, 0.25], rtol=1e-3)
    for end, value in (("", np.inf), ("_lower", 4.0), ("_upper", np.inf)):
        fragility[f"first_overturning_pga{end}"][1] = value
    figure = fragility_by_yaw(fragility, products["rock"])
    assert np.isnan(artist(figure, "first", 1).get_ydata()[1])
    np.testing.assert_allclose(artist(figure, "above", 1).get_xdata(), [np.pi / 2])
    assert "above 4 g" in labels(figure)


def test_a_boundary_below_all_that_was_run_is_drawn_as_such(
    products: dict[str, xr.Dataset],
) -> None:
    """In neither figure where it is assumed to lie, a step below the lowest PGA tried."""
    fragility = products["fragility"].copy(deep=True)
    for end, value in (("", 0.31), ("_lower", np.nan), ("_upper", 0.35)):
        fragility[f"first_overturning_pga{end}"][1] = value
    fragility["first_overturning_pga_upper"][1, :, -1] = 0.4
    figure = fragility_by_yaw(fragility, products["rock"])
    assert np.isnan(artist(figure, "first", 1).get_ydata()[1])
    below = artist(figure, "below", 1)
    np.testing.assert_allclose(below.get_xdata(), [np.pi / 2])
    assert f"below {below.get_ydata()[0]:.4g} g" in labels(figure)
    fragility["first_overturning_pga_upper"][0], fragility["first_overturning_pga_lower"][0] = (
        0.2,
        np.nan,
    )
    figure = fragility_by_yaw(fragility, products["rock"])
    assert f"below 0.2 g to below {below.get_ydata()[0]:.4g} g" in labels(figure)
    figure = overturning_diagram(products["responses"], fragility, (1, 0))
    assert not [a for a in figure.axes[0].get_children() if a.get_gid() == "boundary"]


def test_static_pga_takes_the_weaker_way() -> None:
    pga = np.full(360, 1.0)
    pga[30] = 0.1
    rock = xr.Dataset({"tipping_pga": ("direction", pga)})
    yaw = np.array([150.0, 330.0, 30.0])  # 30 deg of the rock to -x, to +x, and neither
    np.testing.assert_allclose(summary.static_pga(rock, yaw), [0.1, 0.1, 1.0])


def test_typical_pga_counts_long_pulses_only() -> None:
    dims, name = ("yaw", "friction", "pgv_pga"), "first_overturning_pga"
    fragility = xr.Dataset(
        {
            name: (dims, [[[np.inf, 0.35, 0.25, 0.15]]]),
            f"{name}_lower": (dims, [[[0.9, 0.3, 0.2, np.nan]]]),
            f"{name}_upper": (dims, [[[np.inf, 0.4, 0.3, 0.2]]]),
        },
        {"pgv_pga": [0.1, 0.2, 0.3, 0.4]},
    )
    assert summary.typical_pga(fragility).ravel().tolist() == [0.25, 0.2, 0.3]


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([(np.inf, 4.0, np.inf), (0.3, 0.2, 0.4)], "above 0.2 g"),  # half of them never topple
        ([(0.05, np.nan, 0.1), (0.3, 0.2, 0.4)], "below 0.4 g"),
        ([(0.05, np.nan, 0.1), (np.inf, 4.0, np.inf)], "not known"),
        ([(0.2, 0.1, 0.3), (0.3, 0.2, 0.4)], "0.2500 [0.1500, 0.3500] g"),
        ([(np.inf, 4.0, np.inf), (0.3, 0.2, 0.4), (0.4, 0.3, 0.5)], "0.4000 [0.3000, 0.5000] g"),
        ([(np.inf, 4.0, np.inf), (0.3, 0.2, 0.4), (np.inf, 4.0, np.inf)], "above 4 g"),
    ],
)
def test_typical_pga_is_no_mean_of_what_is_open(rows: list[tuple[float, ...]], words: str) -> None:
    dims, name = ("yaw", "friction", "pgv_pga"), "first_overturning_pga"
    ends = zip(("", "_lower", "_upper"), zip(*rows, strict=True), strict=True)
    fragility = xr.Dataset(
        {name + end: (dims, [[values]]) for end, values in ends},
        {"pgv_pga": 0.2 + 0.1 * np.arange(len(rows))},
    )
    typical = summary.typical_pga(fragility)[:, 0, 0]
    assert summary.with_interval(*typical) == words
    known = {"above": np.inf, "below": 0.0, "not": np.nan}.get(words.split()[0], typical[0])
    assert typical[0] == pytest.approx(known, nan_ok=True)


@pytest.mark.parametrize(
    ("boundary", "words"),
    [
        ((0.14, 0.1, 0.2), "0.1400 [0.1000, 0.2000] g"),
        ((np.inf, 0.9, np.inf), "above 0.9 g"),
        ((0.05, 0.0, 0.1), "below 0.1 g"),
        ((0.05, np.nan, 0.1), "below 0.1 g"),
        ((np.nan, np.nan, np.nan), "not known"),
    ],
)
def test_boundaries_in_words(boundary: tuple[float, ...], words: str) -> None:
    assert summary.with_interval(*boundary) == words


def test_counts_leave_out_what_is_undecided(products: dict[str, xr.Dataset]) -> None:
    responses = products["responses"].copy(deep=True)
    before = report_tables.counts(responses)
    assert before["proved"] + before["early"] + before["simulated"] == before["total"] == 72
    responses["outcome"][:] = Outcome.UNSETTLED
    responses["overturned"][:] = -1
    after = report_tables.counts(responses)
    assert after["proved"] + after["early"] + after["simulated"] == 0
    lost = report_tables.unresolved(responses, most=5)
    assert (lost["total"], len(lost["listed"])) == (72, 5)


def test_command_names_what_was_set() -> None:
    plain = load_site("cuboid_1x1x2")
    assert report.command(plain, plain.config.model_dump(mode="json")) == ["cuboid_1x1x2"]
    changed = load_site("cuboid_1x1x2", None, ("yaw=[0, 90]", "motion.pga.num=11"))
    name, *settings = report.command(changed, changed.config.model_dump(mode="json"))
    again = load_site(name, None, tuple(text.strip("'") for text in settings))
    assert again.config == changed.config


RECORDED = (
    "motion={kind: record, files: plus.csv, pga: [0.1, 0.2], processing: {order: none, "
    "highpass: null, lowpass: null}}"
)
ON_Y = "motion={kind: table, pulses: [{axis: y}], pga: [0.1, 0.2], pgv_pga: [0.1, 0.3]}"
PULSES = "motion={kind: sine_pulse, pga: [0.1, 0.2], pgv_pga: [0.1, 0.3]}"


@pytest.mark.parametrize("own", [RECORDED, ON_Y, PULSES])
@pytest.mark.parametrize(
    "given",
    [
        *((RECORDED,), (ON_Y,), (PULSES,), ("motion.pga=[0.1, 0.3]", "contact.friction=0")),
        ("rock={shape: mesh, mesh: 'my  rock a=1.ply'}",),
    ],
)
def test_the_printed_command_has_all_settings(
    tmp_path: Path, own: str, given: tuple[str, ...]
) -> None:
    """Also those that equal the site's, where a motion of another kind forgets them."""
    site = tmp_path / "tor.yaml"
    rock = "rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}\n"
    site.write_text(rock + own.replace("=", ": ", 1))
    changed = load_site(str(site), None, given)
    name, *settings = report.command(changed, changed.config.model_dump(mode="json"))
    again = load_site(name, None, tuple(shlex.split(text)[0] for text in settings))
    assert again.config == changed.config


@pytest.mark.slow
def test_the_printed_command_makes_the_boundary_that_is_shown(
    vsr: Callable[..., Ran], write_site: Callable[..., str], tmp_path: Path
) -> None:
    """Also one that was searched for in another range than the site's."""
    grid = "motion: {pga: [0.2, 0.3], pgv_pga: [0.2]}\nsimulation: {time_step: 0.004}\n"
    search = ("--set", "fragility.highest=0.5", "--set", "fragility.resolution=0.1")
    ran = vsr("run", "fragility", "--site", write_site(grid), *search, into=tmp_path / "one")
    assert ran.code == cli.DONE
    page = (tmp_path / "one" / "rock" / "report.html").read_text()
    (printed,) = re.findall(r"<pre>vsr (run fragility [^<]*)</pre>", page)
    again = vsr(*shlex.split(html.unescape(printed)), into=tmp_path / "other")
    assert again.code == cli.DONE
    one, other = (read(tmp_path / name / "rock" / "boundary.nc") for name in ("one", "other"))
    assert one.identical(other)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "along_x", "pushing"),
    [
        ("{kind: cosine_pulse, ", True, True),
        ("{kind: ricker_pulse, ", True, False),
        ("{kind: table, pulses: [{axis: y}], ", False, False),
    ],
)
def test_what_holds_of_shaking_along_x_is_said_of_no_other(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    derived: Path,
    motion: str,
    along_x: bool,
    pushing: bool,
) -> None:
    site = write_site(f"motion: {motion}pga: [0.3, 0.5], pgv_pga: [0.2]}}")
    assert vsr("run", "fragility", "--site", site).code == cli.DONE
    page = (derived / "rock" / "report.html").read_text()
    (circle,) = re.findall(r'alt="Polar plot of fragility against yaw" src="[^,]*,([^"]*)"', page)
    assert ('id="static"' in base64.b64decode(circle).decode()) == along_x
    assert ("Dashed: the static overturning" in page) == along_x
    assert ("first push points there" in page) == pushing
    assert ("pushes the rock towards" in page) == pushing


def test_command_finds_the_records_of_a_study_in_another_folder(tmp_path: Path) -> None:
    for folder in ("rocks", "studies/quakes"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "rocks" / "tor.yaml").write_text(
        "rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}"
    )
    (tmp_path / "studies" / "mine.yaml").write_text(
        "motion: {kind: record, files: quakes, pga: 0.3, "
        "processing: {order: none, highpass: null, lowpass: null}}"
    )
    study = load_site(str(tmp_path / "rocks/tor.yaml"), str(tmp_path / "studies/mine.yaml"))
    name, *settings = report.command(study, study.config.model_dump(mode="json"))
    again = load_site(name, None, tuple(shlex.split(text)[0] for text in settings))
    (file,) = again.config.motion.files
    assert (again.folder_of("motion.files") / file).resolve() == tmp_path / "studies" / "quakes"


def test_command_finds_the_terrain_of_a_study_in_another_folder(tmp_path: Path) -> None:
    for folder in ("rocks", "studies"):
        (tmp_path / folder).mkdir()
    (tmp_path / "rocks" / "tor.yaml").write_text(
        "rock: {shape: mesh, mesh: rock.ply, density: 2110}"
    )
    (tmp_path / "studies" / "mine.yaml").write_text("pedestal: {shape: mesh, mesh: ground.ply}")
    study = load_site(str(tmp_path / "rocks/tor.yaml"), str(tmp_path / "studies/mine.yaml"))
    name, *settings = report.command(study, study.config.model_dump(mode="json"))
    again = load_site(name, None, tuple(shlex.split(text)[0] for text in settings))
    found = again.folder_of("pedestal.mesh") / again.config.pedestal.mesh
    assert found.resolve() == tmp_path / "studies" / "ground.ply"


@pytest.mark.slow
def test_same_bytes_every_time(products: dict[str, xr.Dataset]) -> None:
    images = [
        (
            style.png_uri(rock_views(products["rock"])),
            style.svg_uri(fragility_by_yaw(products["fragility"], products["rock"])),
        )
        for _ in range(2)
    ]
    assert images[0] == images[1]
