"""The three-dimensional page: what is packed into it, and what it does in a real browser."""

from __future__ import annotations

import base64
import io
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation, Slerp
from support import tumbling
from support.browser import Opened, settle, until

from pipeline.stages.displacement import scene3d
from pipeline.stages.displacement.timelapse import SPEEDS

Array = NDArray[np.float64]
SUPPORT = Path(tumbling.__file__).parent

HOSTILE = "</script><img src=x onerror=alert(1)>&{{ 7 * 7 }}"
WIDE, PHONE = {"width": 1100, "height": 700}, {"width": 360, "height": 640}
TOPPLED = 3
READOUT = {"speed": "m/s", "height": "m", "distance": "m"}


@pytest.fixture(scope="module")
def displacement() -> xr.Dataset:
    return tumbling.displacement(runs=TOPPLED, samples=120)


@pytest.fixture(scope="module")
def text(displacement: xr.Dataset) -> str:
    return scene3d.page(displacement, tumbling.terrain(40), tumbling.rock(), "A rock", "surrogate")


def packed(text: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def numbers(text: str, kind: str) -> Array:
    return np.frombuffer(base64.b64decode(text), kind)


# ---- What is packed


def test_positions_are_kept_to_a_share_of_their_run(text: str, displacement: xr.Dataset) -> None:
    data = packed(text)["samples"]
    assert data["count"] == [120] * TOPPLED  # the run that stayed is left out
    run = np.repeat(np.arange(TOPPLED), 120)
    low, step = (numbers(data[name], "<f4").reshape(-1, 3) for name in ("low", "step"))
    place = low[run] + step[run] * numbers(data["place"], "<u2").reshape(-1, 3)
    true = np.stack([displacement[name].values[-120 * TOPPLED :] for name in "xyz"], axis=-1)
    extent = np.ptp(true.reshape(TOPPLED, 120, 3), axis=1)[run]
    assert (np.abs(place - true) <= 0.6 * np.maximum(extent, 1e-6) / 65_535 + 1e-6).all()
    turn = numbers(data["turn"], "<i2").reshape(-1, 4) / 32_767
    np.testing.assert_allclose(turn, displacement["quaternion"].values[-360:], atol=2e-5)


def fall(samples: int, seed: int) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """Time, place, turn and run of two runs, each of straight pieces that meet in kinks."""
    random = np.random.default_rng(seed)
    kinks = np.sort(random.choice(np.arange(1, samples - 1), 4, replace=False))
    at = np.concatenate([[0], kinks, [samples - 1]])
    time = np.tile(np.linspace(0.0, 3.0, samples), 2)
    place = np.column_stack(
        [np.tile(np.interp(np.arange(samples), at, random.normal(size=6)), 2) for _ in range(3)]
    )
    run = np.repeat([0, 1], samples)
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (2 * samples, 1))
    return time, place, turn, run


@pytest.mark.parametrize("seed", range(5))
def test_samples_that_their_neighbours_foretell_go_first(seed: int) -> None:
    time, place, turn, run = fall(200, seed)
    kept = scene3d.fewer(time, place, turn, run, 1.0, 100)
    assert len(kept) <= 100
    assert (np.diff(kept) > 0).all()
    assert {0, 199, 200, 399} <= set(kept)
    assert scene3d._error(time, place, run, kept) < 1e-9  # all kinks are there still
    assert len(scene3d.fewer(time, place, turn, run, 1.0, 400)) == 400


def test_a_turn_counts_as_much_as_a_way() -> None:
    time, place, run = np.linspace(0.0, 1.0, 101), np.zeros((101, 3)), np.zeros(101, dtype=int)
    angle = np.interp(time, [0.0, 0.41, 1.0], [0.0, 2.0, 1.0])
    turn = Rotation.from_euler("z", angle[:, None]).as_quat()
    turn[::3] *= -1.0  # the same rotations
    kept = scene3d.fewer(time, place, turn, run, 1.0, 20)
    between = Slerp(time[kept], Rotation.from_quat(turn[kept]))(time)
    assert (between.inv() * Rotation.from_quat(turn)).magnitude().max() < 0.01


def test_the_error_said_is_that_of_the_samples_left_out() -> None:
    random = np.random.default_rng(2)
    time, run = np.tile(np.cumsum(random.random(60)), 2), np.repeat([0, 1], 60)
    place = np.cumsum(random.normal(size=(120, 3)), axis=0)
    kept = scene3d.fewer(time, place, np.tile([0.0, 0, 0, 1], (120, 1)), run, 1.0, 50)
    worst = 0.0
    for number in (0, 1):
        own, some = run == number, kept[run[kept] == number]
        between = [np.interp(time[own], time[some], part[some]) for part in place.T]
        worst = max(worst, float(np.linalg.norm(np.stack(between, -1) - place[own], axis=1).max()))
    assert worst > 0.1
    assert scene3d._error(time, place, run, kept) == pytest.approx(worst)


def test_a_page_of_700_runs_stays_small() -> None:
    few = tumbling.displacement(runs=7, samples=500)
    fallen = few.isel(run=slice(1, None), sample=slice(2, None))
    many = xr.Dataset(
        {name: (v.dims, np.concatenate([v.values] * 100)) for name, v in fallen.items()}
    )
    many["yaw"] = ("run", np.linspace(0.0, 359.9, 700))
    text = scene3d.page(many, tumbling.terrain(200), tumbling.rock(), "Many", "surrogate")
    assert len(text) < 8_000_000
    assert sum(packed(text)["samples"]["count"]) == scene3d.MOST_SAMPLES
    said = re.search(r"to within ([\d.e-]+) mm", text)
    assert said
    assert 0.0 < float(said[1]) < 5.0


def test_names_are_escaped(displacement: xr.Dataset) -> None:
    text = scene3d.page(displacement, tumbling.terrain(10), tumbling.rock(), HOSTILE, HOSTILE)
    assert "<img" not in text
    assert "49" not in re.search(r"<title>(.*?)</title>", text)[1]  # type: ignore[index]


# ---- In a browser


@pytest.fixture
def opened(opened: Opened, text: str, tmp_path: Path) -> Opened:
    """Open a page from its text, and wait until it is drawn."""

    def open_text(html: str = text, script: str = "", **options: Any) -> Any:
        file = tmp_path / "page.html"
        file.write_text(html, encoding="utf-8")
        page = opened(file, script, **{"viewport": WIDE, **options})
        if not script:
            until(page, "window.vsr.triangles > 0")
        return page

    return open_text


def vsr(page: Any, name: str) -> Any:
    return page.evaluate(f"window.vsr.{name}")


def pixels(page: Any) -> NDArray[np.uint8]:
    """What the canvas shows, with nothing over it."""
    page.add_style_tag(content=".over { visibility: hidden }")
    settle(page)
    picture = Image.open(io.BytesIO(page.locator("#scene").screenshot()))
    return np.array(picture.convert("RGB"))


def motion(displacement: xr.Dataset, run: int) -> tuple[Array, Array, Rotation, Array]:
    """Time, place, turn and speed of the run of that place among those that toppled."""
    start = int(displacement["row_size"].values[: run + 1].sum())
    own = displacement.isel(sample=slice(start, start + int(displacement["row_size"][run + 1])))
    place = np.stack([own[name].values for name in "xyz"], axis=-1)
    turn = Rotation.from_quat(own["quaternion"].values)
    return own["time"].values, place, turn, own["speed"].values


def on_screen(page: Any, point: Array) -> Array:
    """Where a point [m] is seen, in pixels of the canvas: a pinhole of 32 degrees up and down."""
    view = vsr(page, "view")
    size = page.evaluate("[scene.clientWidth, scene.clientHeight]")
    c, s = math.cos(view["elevation"]), math.sin(view["elevation"])
    back = np.array([c * math.cos(view["azimuth"]), c * math.sin(view["azimuth"]), s])
    right = np.array([-math.sin(view["azimuth"]), math.cos(view["azimuth"]), 0.0])
    from_eye = np.asarray(point) - (np.array(view["target"]) + view["distance"] * back)
    scale = 0.5 * size[1] / math.tan(math.radians(16.0)) / -(from_eye @ back)
    seen = scale * np.array([from_eye @ right, -(from_eye @ np.cross(back, right))])
    return seen + 0.5 * np.array(size)


@pytest.mark.slow
def test_the_ground_and_the_rock_are_seen(opened: Opened) -> None:
    page = opened()
    assert vsr(page, "error") == 0
    faces = 2 * 40 * 40 + 12
    assert vsr(page, "triangles") > faces + 2 * 100
    page.locator("#others").uncheck()
    settle(page)
    assert vsr(page, "triangles") == faces + 2 * 2 * 119  # the path and its casing
    page.locator("#others").check()
    shown = pixels(page).astype(int)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 500
    red, green, blue = shown.reshape(-1, 3).T
    ground = (red >= green) & (green > blue) & (red - blue < 50) & (red > 60)
    assert ground.mean() > 0.2
    column, row = on_screen(page, np.array(vsr(page, "position"))).astype(int)
    at = shown[row + 4, column - 4]  # beside the path, which starts there
    assert at[0] > 1.4 * at[1] > 1.4 * 1.4 * at[2]  # the rock's orange


@pytest.mark.slow
def test_the_page_is_dark_where_its_reader_wants_it(opened: Opened) -> None:
    """The sky, too; ground and lines keep their colours."""
    lit, dark = (opened(color_scheme=scheme) for scheme in ("light", "dark"))
    for page in (lit, dark):
        assert page.evaluate((SUPPORT / "page_checks.js").read_text(encoding="utf-8")) == []
    paper = "getComputedStyle(document.body).backgroundColor"
    assert (lit.evaluate(paper), dark.evaluate(paper)) == ("rgb(255, 255, 255)", "rgb(26, 26, 25)")
    before, after = pixels(lit), pixels(dark)
    assert before[2, -3].min() > 200
    assert after[2, -3].max() < 80
    same = (before == after).all(axis=-1)
    assert same[before.shape[0] // 2 :].mean() > 0.5


@pytest.mark.slow
def test_z_is_up_and_the_way_runs_to_the_right(opened: Opened, displacement: xr.Dataset) -> None:
    page = opened()
    target = np.array(vsr(page, "view")["target"])
    middle, above = on_screen(page, target), on_screen(page, target + np.eye(3)[2])
    assert above[0] == pytest.approx(middle[0])
    assert above[1] < middle[1]
    compass = [float(page.locator("#z").get_attribute(name)) for name in ("x2", "y2")]
    assert compass[0] == pytest.approx(0.0, abs=1e-6)
    assert compass[1] < -20.0
    size = page.evaluate("[scene.clientWidth, scene.clientHeight]")
    for run in range(TOPPLED):
        place = motion(displacement, run)[1]
        seen = np.array([on_screen(page, point) for point in place[::10]])
        assert (seen > 0.0).all()
        assert (seen < size).all()
        assert seen[-1, 0] > seen[0, 0]


@pytest.mark.slow
def test_the_slider_puts_the_rock_where_the_dataset_has_it(
    opened: Opened, displacement: xr.Dataset
) -> None:
    page = opened()
    for run in (0, 2):
        page.select_option("#run", str(run))
        time, place, turn, speed = motion(displacement, run)
        assert vsr(page, "time") == pytest.approx(time[0])
        flipped = 0.5 * (time[62] + time[63]) / time[-1]  # between quaternions of unlike sign
        for share in (0.0, 0.137, flipped, 0.8123, 1.0):
            page.locator("#time").fill(str(round(share * time[-1], 4)))
            settle(page)
            now = vsr(page, "time")
            assert now == pytest.approx(share * time[-1], abs=1e-3)
            expected = [np.interp(now, time, part) for part in place.T]
            np.testing.assert_allclose(vsr(page, "position"), expected, atol=1e-3)
            shown = Rotation.from_quat(vsr(page, "quaternion"))
            assert (shown.inv() * Slerp(time, turn)(now)).magnitude() < 1e-3
            away = np.linalg.norm(np.array(expected) - place[0])
            read = {name: page.locator(f"#{name}").inner_text().split() for name in READOUT}
            for name, value in zip(
                READOUT, (np.interp(now, time, speed), expected[2], away), strict=True
            ):
                assert float(read[name][0]) == pytest.approx(value, abs=0.0061)
                assert read[name][1] == READOUT[name]
            assert page.locator("#now").inner_text() == f"{now:.2f} of {time[-1]:.2f} s"


@pytest.mark.slow
def test_another_run_is_another_path(opened: Opened, displacement: xr.Dataset) -> None:
    page = opened()
    assert page.locator("#run option").count() == TOPPLED
    assert vsr(page, "run") == TOPPLED - 1  # the longest
    page.locator("#others").uncheck()
    before = pixels(page)
    page.select_option("#run", "0")
    settle(page)
    assert vsr(page, "run") == 0
    named = page.locator("#run option").nth(0).inner_text()
    for said in ("PGA 0.4 g", "PGV/PGA 0.25 s", "yaw 0°", "friction 0.6", "rest"):
        assert said in named
    assert f"{float(displacement['trajectory_length'][1]):.2f} m" in named
    after = pixels(page)
    assert (np.abs(after.astype(int) - before).max(axis=-1) > 30).sum() > 300
    end = motion(displacement, TOPPLED - 1)[1][-8]  # where only the longest path goes
    column, row = on_screen(page, end).astype(int)
    near = (slice(row - 2, row + 3), slice(column - 2, column + 3))
    assert np.abs(after[near].astype(int) - before[near]).max() > 60


@pytest.mark.slow
def test_the_path_has_the_colour_of_the_speed(opened: Opened, displacement: xr.Dataset) -> None:
    page = opened()
    page.locator("#others").uncheck()
    page.select_option("#run", "1")
    shown = pixels(page).astype(float)
    _, place, _, speed = motion(displacement, 1)
    largest = float(displacement["speed"].max())
    for sample in (60, 70, 80, 90, 100):  # away from the rock at its start
        column, row = on_screen(page, place[sample]).astype(int)
        own = 255.0 * np.array(SPEEDS(speed[sample] / largest)[:3])
        line = shown[row - 1 : row + 2, column - 1 : column + 2]  # three pixels wide
        assert np.abs(line - own).max(axis=-1).min() < 15.0, (sample, line, own)
        beside = shown[row - 8 : row + 9, column].min(axis=1).max()
        assert beside > 225.0  # its white casing, lighter than the ground
    assert page.locator("#largest").text_content() == f"{largest:.2g}"


@pytest.mark.slow
def test_mouse_and_keys_change_the_view(opened: Opened) -> None:
    page = opened()
    box = page.locator("#scene").bounding_box()
    middle = (box["x"] + 0.5 * box["width"], box["y"] + 0.7 * box["height"])
    first, picture = vsr(page, "view"), pixels(page)

    def drag(button: str) -> Any:
        page.mouse.move(*middle)
        page.mouse.down(button=button)
        page.mouse.move(middle[0] + 90, middle[1] + 40, steps=4)
        page.mouse.up(button=button)
        settle(page)
        return vsr(page, "view")

    turned = drag("left")
    assert turned["azimuth"] == pytest.approx(first["azimuth"] - 0.54)
    assert turned["elevation"] == pytest.approx(first["elevation"] + 0.24)
    assert turned["target"] == first["target"]
    assert (pixels(page) != picture).any(axis=-1).mean() > 0.2
    moved = drag("right")
    assert moved["azimuth"] == turned["azimuth"]
    shifted = np.linalg.norm(np.subtract(moved["target"], turned["target"]))
    pixel = 2.0 * math.tan(math.radians(16.0)) * moved["distance"] / box["height"]
    assert shifted == pytest.approx(pixel * math.hypot(90, 40), rel=0.01)
    page.mouse.wheel(0, -300)
    settle(page)
    assert vsr(page, "view")["distance"] < 0.8 * moved["distance"]
    page.locator("#scene").focus()
    page.keyboard.press("0")
    assert vsr(page, "view") == first
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("+")
    keyed = vsr(page, "view")
    assert keyed["azimuth"] > first["azimuth"]
    assert keyed["elevation"] < first["elevation"]
    assert keyed["distance"] < first["distance"]


def test_the_wheel_comes_closer_to_what_is_under_it(
    opened: Opened, displacement: xr.Dataset
) -> None:
    page = opened()
    view = vsr(page, "view")
    right = np.array([-math.sin(view["azimuth"]), math.cos(view["azimuth"]), 0.0])
    point = np.array(view["target"]) + 2.0 * right
    before = on_screen(page, point)
    box = page.locator("#scene").bounding_box()
    page.mouse.move(box["x"] + before[0], box["y"] + before[1])
    page.mouse.wheel(0, -400)
    settle(page)
    assert vsr(page, "view")["distance"] < 0.7 * view["distance"]
    np.testing.assert_allclose(on_screen(page, point), before, atol=2.0)


@pytest.mark.slow
def test_two_fingers_pinch(opened: Opened) -> None:
    page = opened(viewport=PHONE, has_touch=True, is_mobile=True)
    before = vsr(page, "view")
    touch = page.context.new_cdp_session(page)
    box = page.locator("#scene").bounding_box()
    middle = (box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])

    def fingers(kind: str, apart: float) -> None:
        points = [] if kind == "touchEnd" else [
            {"x": middle[0] + side * apart, "y": middle[1], "id": number}
            for number, side in enumerate((-1, 1))
        ]  # fmt: skip
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    fingers("touchStart", 40)
    for apart in (50, 60, 70, 80):
        fingers("touchMove", apart)
    fingers("touchEnd", 80)
    settle(page)
    after = vsr(page, "view")
    assert after["distance"] == pytest.approx(0.5 * before["distance"], rel=0.1)
    assert after["azimuth"] == before["azimuth"]


@pytest.mark.slow
def test_play_goes_in_real_time_and_stops(opened: Opened, displacement: xr.Dataset) -> None:
    page = opened()
    page.select_option("#run", "0")
    page.locator("#play").click()
    assert vsr(page, "playing")
    assert page.locator("#play").inner_text() in ("Play", "Pause")
    first = page.evaluate("[performance.now() / 1000, window.vsr.time]")
    page.wait_for_timeout(700)
    later = page.evaluate("[performance.now() / 1000, window.vsr.time]")
    assert later[1] > 0.2
    assert later[1] - first[1] == pytest.approx(later[0] - first[0], abs=0.35)
    page.locator("#play").click()
    stopped = vsr(page, "time")
    page.wait_for_timeout(150)
    assert vsr(page, "time") == stopped
    end = motion(displacement, 0)[0][-1]
    page.locator("#time").fill(str(end - 0.05))
    page.locator("#scene").focus()
    page.keyboard.press("Space")
    until(page, "!window.vsr.playing")
    assert vsr(page, "time") == pytest.approx(end)
    settle(page)
    assert page.locator("#play").inner_text() == "Play"
    page.locator("#time").focus()
    page.keyboard.press("ArrowLeft")
    assert vsr(page, "time") == pytest.approx(end - 0.05)


@pytest.mark.slow
def test_the_pointer_reads_a_path_and_chooses_it(opened: Opened, displacement: xr.Dataset) -> None:
    page = opened()
    time, place, _, speed = motion(displacement, 1)
    sample = len(time) - 30  # where the paths are apart
    box = page.locator("#scene").bounding_box()
    column, row = on_screen(page, place[sample])
    page.mouse.move(box["x"] + column, box["y"] + row)
    tip = page.locator("#tip").inner_text()
    away = np.linalg.norm(place[sample] - place[0])
    for said in (f"time {time[sample]:.2f} s", f"speed {speed[sample]:.2f} m/s", "yaw 30°",
                 f"height z {place[sample, 2]:.2f} m", f"from start {away:.2f} m"):  # fmt: skip
        assert said in tip
    page.mouse.down()
    page.mouse.up()
    assert vsr(page, "run") == 1
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + box["height"] - 5)
    assert page.locator("#tip").is_hidden()


@pytest.mark.slow
@pytest.mark.parametrize("size", [WIDE, PHONE, {"width": 700, "height": 360}])
def test_nothing_overlaps_or_sticks_out(opened: Opened, size: dict[str, int]) -> None:
    title = "Where a rock on a slope with a rather long name would go"
    html = scene3d.page(
        tumbling.displacement(runs=2, samples=40), tumbling.terrain(20), tumbling.rock(), title,
        "surrogate rock, made-up terrain",
    )  # fmt: skip
    page = opened(html, viewport=size)
    wide, high = page.evaluate("[document.documentElement.scrollWidth, document.body.scrollHeight]")
    assert (wide, high) == (size["width"], size["height"])

    def boxes(*names: str) -> list[Any]:
        return [box for name in names if (box := page.locator(name).bounding_box())]

    for group in (
        boxes("header", "main", "footer"),
        boxes("#readout", "#compass", "#key"),
        boxes("#run", "label", "#play", "#time", "#now", ".help"),
    ):
        for number, one in enumerate(group):
            assert one["x"] >= 0.0
            assert one["x"] + one["width"] <= size["width"] + 0.5
            assert one["y"] + one["height"] <= size["height"] + 0.5
            for other in group[number + 1 :]:
                assert (
                    one["x"] + one["width"] <= other["x"] + 0.5
                    or other["x"] + other["width"] <= one["x"] + 0.5
                    or one["y"] + one["height"] <= other["y"] + 0.5
                    or other["y"] + other["height"] <= one["y"] + 0.5
                ), (one, other)
    assert page.locator("#scene").bounding_box()["height"] > 0.35 * size["height"]
    assert page.locator(".source").is_visible()


def test_the_page_says_what_it_is(opened: Opened) -> None:
    page = opened()
    words = page.locator("body").inner_text()
    for said in ("A rock", "surrogate", f"In {TOPPLED} of {TOPPLED + 1} runs the rock left",
                 f"{TOPPLED} rolled over, 0 fell, 0 slid", "speed [m/s]",
                 "Metres, z up", "shaking"):  # fmt: skip
        assert said in words
    assert page.title() == "A rock"


def test_without_a_run_that_toppled_the_rock_stands(opened: Opened) -> None:
    still = tumbling.displacement(runs=1).isel(run=slice(0, 1), sample=slice(0, 2))
    page = opened(scene3d.page(still, tumbling.terrain(20), tumbling.rock(), "A rock", "surrogate"))
    assert vsr(page, "run") is None
    assert vsr(page, "error") == 0
    assert vsr(page, "position") == pytest.approx([0.0, 0.0, 0.5 * tumbling.SIZE[2]])
    assert page.locator("#play").is_disabled()
    assert "In 0 of 1 run the rock left its seat" in page.locator("header").inner_text()


def test_without_webgl_the_page_says_so(opened: Opened) -> None:
    page = opened(script="HTMLCanvasElement.prototype.getContext = () => null;")
    assert "WebGL" in page.locator("#trouble").inner_text()
    assert page.locator("#trouble").is_visible()


def test_a_hostile_name_stays_words(opened: Opened) -> None:
    few = tumbling.displacement(runs=1, samples=20)
    page = opened(scene3d.page(few, tumbling.terrain(10), tumbling.rock(), HOSTILE, HOSTILE))
    assert page.locator("h1").inner_text() == HOSTILE
    assert page.locator(".source").inner_text() == HOSTILE
    assert page.locator("img").count() == 0
