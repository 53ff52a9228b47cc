"""Files of a table's motion: what is read, and what is refused."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from support.suites import slow_but

from pipeline.stages.motions.table_motions import _doubts, _rough, load
from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.motions.six_axes import AXES
from vsr_core.rock import solid
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene

TIME = np.linspace(0.0, 2.0, 81)
SWELL = np.sin(np.pi * TIME / 2.0) ** 2
KEPT = np.r_[:30, 50:81]
SIZES = dict(zip(AXES, (0.1, 0.2, -0.3, 0.4, -0.5, 0.6), strict=True))


def write(path: Path, head: str, *columns: np.ndarray) -> Path:
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())
    path.write_text(f"# made by a test\n{head}\n{rows}\n", encoding="utf-8")
    return path


def test_a_table_in_other_units_and_another_order(tmp_path: Path) -> None:
    head = "yaw [rad], pitch [deg], time [ms], x [mm], z [m], y [m], roll [rad]"
    columns = (
        SIZES["yaw"] * SWELL,
        np.degrees(SIZES["pitch"] * SWELL),
        1e3 * TIME,
        1e3 * SIZES["x"] * SWELL,
        SIZES["z"] * SWELL,
        SIZES["y"] * SWELL,
        SIZES["roll"] * SWELL,
    )
    motion = load(write(tmp_path / "table.csv", head, *columns))
    expected = np.outer(SWELL, list(SIZES.values()))
    np.testing.assert_allclose(motion.samples, expected, atol=1e-15)
    np.testing.assert_allclose(motion.time, TIME)


def test_netcdf_and_csv_are_the_same_motion(tmp_path: Path) -> None:
    data = xr.Dataset(
        {
            "x": ("time", 100.0 * SIZES["x"] * SWELL, {"units": "cm"}),
            "roll": ("time", np.degrees(SIZES["roll"] * SWELL), {"units": "degrees"}),
        },
        {"time": ("time", TIME, {"units": "s"})},
    )
    data.to_netcdf(tmp_path / "table.nc")
    one = load(tmp_path / "table.nc")
    columns = (TIME, SIZES["x"] * SWELL, SIZES["roll"] * SWELL)
    other = load(write(tmp_path / "table.csv", "time [s],x [m],roll [rad]", *columns))
    np.testing.assert_allclose(one.samples, other.samples, atol=1e-15)
    assert one.turns
    assert not one.samples[:, [1, 2, 4, 5]].any()


FREQUENT = np.arange(0.0, 3.0, 0.01)
PULSE = 0.1 * np.sin(np.pi * np.clip(FREQUENT - 0.5, 0.0, 1.5) / 1.5) ** 4


@pytest.mark.parametrize("digits", ["{:.7f}", "{:.8f}", "{:.10e}"])
def test_the_pga_of_rounded_positions_is_that_of_exact_ones(digits: str, tmp_path: Path) -> None:
    """Or else they are refused: see the next test."""
    rounded = [float(digits.format(one)) for one in PULSE]
    motion = load(write(tmp_path / "table.csv", "time [s],x [m]", FREQUENT, rounded))
    phase = np.linspace(0.0, np.pi, 10_001)  # (sin^4)'' = 4 sin^2 (3 cos^2 - sin^2)
    exact = np.abs(4.0 * np.sin(phase) ** 2 * (3.0 - 4.0 * np.sin(phase) ** 2)).max()
    exact *= 0.1 * (np.pi / 1.5) ** 2
    assert motion.peak_acceleration == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize(
    ("kept", "unit"),
    [
        (lambda way: np.round(way, 4), "m"),
        (lambda way: np.round(1e3 * way), "mm"),
        (lambda way: [float(f"{one:.3e}") for one in way], "m"),
        (lambda way: np.round(np.degrees(way), 2), "degree"),
    ],
)
def test_positions_whose_last_digit_shakes_the_table_are_refused(
    kept: Callable[[np.ndarray], np.ndarray], unit: str, tmp_path: Path
) -> None:
    axis = "roll" if unit == "degree" else "x"
    path = write(tmp_path / "table.csv", f"time [s],{axis} [{unit}]", FREQUENT, kept(PULSE))
    with pytest.raises(InvalidInput, match="last digits alone make"):
        load(path)


def test_a_long_rest_does_not_hide_that_positions_are_rounded(tmp_path: Path) -> None:
    often = np.arange(0.0, 30.0, 0.01)
    way = np.interp(often, FREQUENT, PULSE) + 1e-6 * np.exp(-often) * (1.0 - np.exp(-often)) ** 4
    path = write(tmp_path / "t.csv", "time [s],x [m]", often, [float(f"{one:.2e}") for one in way])
    with pytest.raises(InvalidInput, match="last digits"):
        load(path)


def test_positions_of_single_precision_shake_a_table_that_is_told_of_often(tmp_path: Path) -> None:
    often = np.arange(0.0, 3.0, 0.0001)
    way = 0.1 * np.sin(np.pi * np.clip(often - 0.5, 0.0, 1.5) / 1.5) ** 4
    for kind, taken in (("f8", True), ("f4", False)):
        columns = {"x": ("time", way.astype(kind), {"units": "m"})}
        data = xr.Dataset(columns, {"time": ("time", often, {"units": "s"})})
        data.to_netcdf(tmp_path / f"{kind}.nc")
        if taken:
            load(tmp_path / f"{kind}.nc")
        else:
            with pytest.raises(InvalidInput, match="last digits"):
                load(tmp_path / f"{kind}.nc")


@pytest.mark.parametrize(
    "kept",
    [
        lambda way: np.round(way, 3) - way.mean(),
        lambda way: 0.0254 * np.round(way / 0.0254, 2),
        lambda way: np.round(way, 3).astype("f4"),
    ],
)
def test_noise_that_no_digit_shows_is_refused(
    kept: Callable[[np.ndarray], np.ndarray], tmp_path: Path
) -> None:
    path = write(tmp_path / "table.csv", "time [s],x [m]", FREQUENT, kept(PULSE))
    with pytest.raises(InvalidInput, match=r"straight|jump to and fro"):
        load(path)


@pytest.mark.parametrize("step", [2.54e-6, 0.2 / 2**16])
def test_steps_of_an_encoder_are_told_or_refused(step: float, tmp_path: Path) -> None:
    """By known peaks: what passes says how much of its PGA is too much."""
    told = []
    for size in (0.003, 0.01, 0.02, 0.3):
        way = size * (1.0 - np.cos(np.pi * FREQUENT / FREQUENT[-1] * 2.0)) ** 2
        path = write(tmp_path / "table.csv", "time [s],x [m]", FREQUENT, step * np.rint(way / step))
        exact = 4.0 * size * (2.0 * np.pi / FREQUENT[-1]) ** 2
        if size == 0.003:
            with pytest.raises(InvalidInput, match=r"straight|of the PGA"):
                load(path)
        else:
            motion = load(path)
            share, from_on = _rough(motion)
            assert share == pytest.approx(1.0 - exact / motion.peak_acceleration, abs=0.06)
            assert from_on == pytest.approx(25.0)
            assert (share > 0.05) == (f"{share:.0%} of its PGA" in "".join(_doubts(motion)))
            told.append(any(_doubts(motion)))
    assert set(told) == {False, True}


def test_what_is_sampled_six_times_a_period_is_no_noise(tmp_path: Path) -> None:
    way = 0.01 * np.sin(np.pi * FREQUENT / FREQUENT[-1]) ** 4 * np.sin(FREQUENT / 0.01 * np.pi / 3)
    load(write(tmp_path / "table.csv", "time [s],x [m]", FREQUENT, way))


@pytest.mark.parametrize("mark", [-999.0, -9999.999, -32768.0, 99.99])
@pytest.mark.parametrize("places", [[290], [40, 280], [289, 290]])
def test_a_mark_of_a_missing_sample_is_no_position(
    mark: float, places: list[int], tmp_path: Path
) -> None:
    way = 0.5e3 * PULSE
    way[places] = mark
    path = write(tmp_path / "table.csv", "time [s],x [mm]", FREQUENT, way)
    when = "|".join(f"{place / 100:g}" for place in places)
    with pytest.raises(InvalidInput, match=rf"{re.escape(f'{mark:.10g}')} \(x\) at ({when}) s"):
        load(path)


def test_a_lone_position_is_none(tmp_path: Path) -> None:
    way = 1e3 * PULSE
    way[290] = 500.0
    path = write(tmp_path / "table.csv", "time [s],x [mm]", FREQUENT, way)
    with pytest.raises(InvalidInput, match=r"500 \(x\) at 2\.9 s, where the table shakes"):
        load(path)


@pytest.mark.parametrize(
    "out", [slice(160, 161), slice(160, 162), slice(160, 163), slice(160, 168)]
)
@pytest.mark.parametrize("away", [0.0, 0.7])
def test_what_is_not_on_the_way_is_no_motion(away: float, out: slice, tmp_path: Path) -> None:
    """The table swings 20 mm at 2 Hz, and some samples are less or none."""
    way = 20.0 * np.sin(np.pi * FREQUENT / FREQUENT[-1]) ** 4 * np.sin(4.0 * np.pi * FREQUENT)
    way[out] *= away
    path = write(tmp_path / "table.csv", "time [s],x [mm]", FREQUENT, way)
    with pytest.raises(InvalidInput, match=r"1\.(5|6)\d* s(, where| \(x\))"):
        load(path)


@pytest.mark.parametrize("rate", slow_but([100, 1000], [100, 200, 500, 1000]))
@pytest.mark.parametrize("share", slow_but([0.0, 0.29, 1.0], [0.0, 1e-3, 0.25, 0.29, 1.0]))
def test_one_sample_makes_no_pga(rate: int, share: float, tmp_path: Path) -> None:
    """Any sample, the first and the last ones, too: what passes shakes as hard as all others."""
    time = np.arange(0.0, 4.0 + 0.5 / rate, 1.0 / rate)
    way = 30.0 * np.sin(np.pi * np.clip(time - 1.0, 0.0, 2.0)) ** 4
    pga, path = 0.03 * 8.0 * np.pi**2, tmp_path / "table.csv"
    assert load(write(path, "time [s],x [mm]", time, way)).peak_acceleration < 1.01 * pga
    taken = 0
    for off in np.geomspace(1e-4, 3.0, 12):
        other = way.copy()
        other[round(share * (len(way) - 1))] += off
        write(path, "time [s],x [mm]", time, other)
        try:
            assert load(path).peak_acceleration < 2.6 * pga
            taken += 1
        except InvalidInput:
            pass
    assert 0 < taken < 12


@pytest.mark.parametrize("rate", [28.0, 40.0, 50.0, 66.7, 80.0, 100.0])
@pytest.mark.parametrize("lag", [0.0, 0.3])
def test_positions_that_lines_join_are_no_motion(rate: float, lag: float, tmp_path: Path) -> None:
    """Told of at 200 Hz in place of their rate: corners shook the table 2 to 10 times as hard."""
    time = np.arange(0.0, 6.0, 0.005)
    way = 20.0 * np.sin(np.pi * time / 6.0) ** 4 * np.sin(4.0 * np.pi * time)
    path = write(tmp_path / "table.csv", "time [s],x [mm]", time, way)
    exact = load(path).peak_acceleration
    knots = (np.arange(6.0 * rate + 2.0) - lag) / rate
    write(path, "time [s],x [mm]", time, np.interp(time, knots, np.interp(knots, time, way)))
    if (rate, lag) == (100.0, 0.3):  # half as hard again
        motion = load(path)
        share = 1.0 - exact / motion.peak_acceleration
        assert _rough(motion)[0] == pytest.approx(share, abs=0.03)
        assert any(_doubts(motion))
    else:
        with pytest.raises(InvalidInput, match=r"to and fro|straight|shakes"):
            load(path)


@pytest.mark.parametrize("flicker", [0.0, 1e-4, 0.02, 0.1])
@pytest.mark.parametrize("lowest", [-35.0, -99.0])
def test_a_way_that_is_cut_off_is_no_motion(lowest: float, flicker: float, tmp_path: Path) -> None:
    """At 70 % of its range, on one side or both: corners shook the table 5 times as hard."""
    time = np.arange(0.0, 6.0, 0.005)
    way = 50.0 * np.sin(np.pi * time / 6.0) ** 4 * np.sin(2.0 * np.pi * time)
    path = write(tmp_path / "table.csv", "time [s],x [mm]", time, way)
    load(path)
    noise = np.random.default_rng(0).choice([0.0, flicker], len(time))
    way = np.where((way < lowest) | (way > 35.0), np.clip(way, lowest, 35.0) + noise, way)
    write(path, "time [s],x [mm]", time, way)
    with pytest.raises(
        InvalidInput, match=r"stand still from or to \d\.|where the table shakes|jump to and fro"
    ):
        load(path)


def test_a_way_that_is_cut_off_where_its_last_digit_flickers_is_no_motion(tmp_path: Path) -> None:
    """At 70 % of its range on one side, in steps so long that no corner stands out of them."""
    time = np.arange(0.0, 6.0, 0.01)
    way = 20.0 * np.sin(np.pi * time / 6.0) ** 4 * np.sin(2.0 * np.pi * time)
    noise = np.random.default_rng(0).choice([0.0, 0.02], len(time))
    path = write(tmp_path / "table.csv", "time [s],x [mm]", time, way)
    load(path)
    write(path, "time [s],x [mm]", time, np.where(way > 14.0, 14.0 + noise, way))
    with pytest.raises(InvalidInput, match=r"stand still from or to \d\."):
        load(path)


def test_a_way_may_rest_between_pulses(tmp_path: Path) -> None:
    """From rest it starts as hard as it bends later: acceleration in steps, then rest aside."""
    time = np.arange(0.0, 4.0, 0.005)
    pushed = 5.0 * np.select(
        [(time > 1.0) & (time < 1.2), (time > 1.2) & (time < 1.4)], [1.0, -1.0]
    )
    pushed -= np.roll(pushed, 300)
    way = 0.005**2 * np.cumsum(np.cumsum(pushed))
    assert way[-1] == pytest.approx(0.0, abs=1e-9)
    way[way < 1e-9] = 0.0
    assert load(write(tmp_path / "table.csv", "time [s],x [m]", time, way)).duration > 1.5


def test_times_are_those_of_the_file(tmp_path: Path) -> None:
    way = 20.0 * np.sin(np.pi * FREQUENT / FREQUENT[-1]) ** 4 * np.sin(4.0 * np.pi * FREQUENT)
    way[150] += 10.0
    path = write(tmp_path / "table.csv", "time [s],x [mm]", 100.0 + FREQUENT, way)
    with pytest.raises(InvalidInput, match=rf"\(x\) at {100.0 + FREQUENT[150]:g} s, where"):
        load(path)


def test_the_sample_that_is_off_is_named_and_no_other(tmp_path: Path) -> None:
    """It bends the way a little less than the swing does, five times as long after it."""
    time = np.arange(0.0, 10.0, 0.002)
    way = 60.0 * np.exp(-((time - 5.0) ** 2)) * np.cos(2.0 * np.pi * (time - 5.0))
    peak = np.abs(np.diff(way, 2)).max()
    off = int(np.abs(time - 2.0).argmin())
    way[off] += 0.45 * peak
    path = write(tmp_path / "table.csv", "time [s],x [mm]", time, way)
    with pytest.raises(InvalidInput, match=r"\(x\) at 2 s, where the table shakes"):
        load(path)
    smooth = 60.0 * np.exp(-((time - 5.0) ** 2)) * np.cos(2.0 * np.pi * (time - 5.0))
    load(write(path, "time [s],x [mm]", time, smooth))


SWAY = np.round(3.0 * np.sin(np.pi * FREQUENT / 3.0) ** 4)  # micrometres
LONE = 1e-6 * (FREQUENT[150] == FREQUENT)


@pytest.mark.parametrize("sway", [SWAY, LONE])
def test_an_axis_that_hardly_moves_is_no_matter(sway: np.ndarray, tmp_path: Path) -> None:
    """It steps far off its way in its last digits, which is little beside what shakes."""
    path, header = tmp_path / "table.csv", "time [s],x [mm],y [mm]"
    load(write(path, header, FREQUENT, 1e3 * PULSE, 1e-3 * sway))


def test_a_lone_sample_of_an_axis_that_bends_little_is_named(tmp_path: Path) -> None:
    """By 4 % of what x bends in samples, and by more of what its spline does."""
    path, header = tmp_path / "table.csv", "time [s],x [m],yaw [rad]"
    yaw = 0.02 * np.abs(np.diff(PULSE, 2)).max() * (FREQUENT[20] == FREQUENT)
    for share in (1.0, 1.5, 2.0):
        with pytest.raises(InvalidInput, match=r"\(yaw\) at 0\.2 s, where the table shakes"):
            load(write(path, header, FREQUENT, PULSE, share * yaw))


@pytest.mark.parametrize("every", [3, 10, 17])
@pytest.mark.parametrize("axis", ["x [mm]", "yaw [mrad]"])
def test_what_a_tracker_loses_again_and_again_is_no_motion(
    axis: str, every: int, tmp_path: Path
) -> None:
    """The others of it are not far off the way of those beside them."""
    way = 20.0 * np.sin(np.pi * FREQUENT / FREQUENT[-1]) ** 4 * np.sin(4.0 * np.pi * FREQUENT)
    path = write(tmp_path / "table.csv", f"time [s],{axis}", FREQUENT, way)
    load(path)
    way[::every] = 0.0
    write(path, f"time [s],{axis}", FREQUENT, way)
    with pytest.raises(InvalidInput, match=r"to and fro|straight|shakes"):
        load(path)


def test_without_an_angle_it_does_not_turn(tmp_path: Path) -> None:
    motion = load(write(tmp_path / "table.csv", "time [s],x [m],z [m]", TIME, SWELL, -SWELL))
    assert not motion.turns
    peak = motion.acceleration(np.linspace(0.0, 2.0, 2001))[:, 0].max()
    assert peak == pytest.approx(0.5 * math.pi**2, rel=1e-4)


@pytest.mark.parametrize(
    ("head", "columns", "words"),
    [
        ("time,x,tilt", (TIME, SWELL, SWELL), "'tilt'.*x, y, z, roll"),
        ("t,x", (TIME, SWELL), "'t'"),
        ("x,y", (SWELL, SWELL), "without time"),
        ("time", (TIME,), "without an axis"),
        ("time,x,x", (TIME, SWELL, SWELL), "twice"),
        ("time,x [m]", (TIME, SWELL), "time without a unit.*s, ms"),
        ("time [s],x", (TIME, SWELL), r"x without a unit.*m, cm, mm.*x \[m\]"),
        ("time [s],x [m],pitch", (TIME, SWELL, SWELL), "pitch without a unit.*rad, degree"),
        ("time [s],x [inch]", (TIME, SWELL), "x in 'inch'.*m, cm, mm"),
        ("time [s],roll [m]", (TIME, SWELL), "roll in 'm'.*degree"),
        ("time,x", (TIME, SWELL, SWELL), "3 values in row 2"),
        ("time [s],pitch [rad]", (TIME, 30.0 * SWELL), r"rad.*roll \[degree\]"),
        ("time [s],x [m]", (TIME[::-1], SWELL), "times ascend"),
        ("time [s],x [m]", (TIME[KEPT], SWELL[KEPT]), "20 times left out, after 0.725 s.*25 ms"),
        ("time [s],x [m]", (TIME + 0.007 * (TIME == 1.5), SWELL), "28% of a step of 25 ms"),
        ("time [s],x [m]", (TIME, np.where(SWELL > 0.99, np.nan, SWELL)), "not numbers"),
        ("time [s],y [m]", (TIME, TIME), "y moving at 1 a second"),
    ],
)
def test_files_that_are_no_motion(
    tmp_path: Path, head: str, columns: tuple[np.ndarray, ...], words: str
) -> None:
    with pytest.raises(InvalidInput, match=words):
        load(write(tmp_path / "table.csv", head, *columns))


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("table.csv", b"\xff\xfe\x00", "cannot be read"),
        ("table.csv", b"", "without time"),
        ("table.csv", b"time,x\n0,a\n", "values are numbers"),
        ("table.nc", b"no file of that kind", "cannot be read"),
    ],
)
def test_files_that_are_none(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInput, match=words):
        load(tmp_path / name)
    with pytest.raises(InvalidInput, match="cannot be read"):
        load(tmp_path / f"absent-{name}")


# Through the pipeline

SITE = """rock: {shape: box, size: [0.5, 0.5, 1.2], density: 2110}
motion: {kind: table, files: [tilting.csv, shaking.csv], pga: [0.1, 1.2]}
"""


@pytest.fixture
def site(tmp_path: Path, write_site: Callable[..., str]) -> str:
    wave = 0.2 * SWELL * np.sin(8.0 * TIME)
    write(
        tmp_path / "shaking.csv", "time [s],x [m],y [m],z [m]", TIME, wave, -0.5 * wave, 0.2 * wave
    )
    write(tmp_path / "tilting.csv", "time [s],x [m],pitch [degree]", TIME, 0.3 * wave, 40.0 * wave)
    return write_site(SITE)


@pytest.mark.parametrize(
    ("head", "scale", "said"),
    [
        ("time [s],x [m],pitch [degree]", 0.5, "one motion at two scales"),
        ("time [s],x [mm],pitch [mrad]", [1000.0, np.pi / 0.18], "the same motion"),
        ("time [s],x [m],pitch [degree]", -0.5, ""),
        ("time [s],x [m],pitch [degree]", [0.5, 0.51], ""),
        ("time [s],x [m],yaw [degree]", 0.5, ""),
    ],
)
@pytest.mark.parametrize("zero", slow_but([2.0], [0.0, 2.0]))
def test_one_motion_at_two_scales_is_refused(
    head: str,
    zero: float,
    scale: list[float] | float,
    said: str,
    site: str,
    tmp_path: Path,
    refused: Callable[..., str],
    vsr: Callable[..., Ran],
) -> None:
    """Of a tilting table PGV/PGA is not the same at every scale."""
    wave = 0.2 * SWELL * np.sin(8.0 * TIME)
    columns = np.column_stack([zero + 0.3 * wave, 40.0 * wave]) * scale
    write(tmp_path / "again.csv", head, TIME, *columns.round(9).T)
    given = ("plan", "--site", site, "--set", "motion.files=[again.csv, shaking.csv, tilting.csv]")
    if said:
        refused(*given, words=("motion.files", "again.csv", said))
    else:
        assert vsr(*given).code == 0


@pytest.mark.parametrize("zero", [0.0, 0.3])
@pytest.mark.parametrize("turning", [0.0, 20.0])
def test_a_table_that_stands_or_turns_about_its_middle_shakes_nothing(
    zero: float, turning: float, site: str, tmp_path: Path, refused: Callable[..., str]
) -> None:
    """Wherever it stands: a spline through what is constant has accelerations of rounding."""
    columns = np.full(len(TIME), zero), turning * SWELL
    write(tmp_path / "again.csv", "time [s],x [m],yaw [degree]", TIME, *columns)
    given = ("plan", "--site", site, "--set", "motion.files=[again.csv]")
    refused(*given, words=("motion.files", "again.csv", "a table that never moves"))


def test_noise_of_positions_is_told(
    site: str, vsr: Callable[..., Ran], derived: Path, tmp_path: Path
) -> None:
    way = 0.02 * (1.0 - np.cos(np.pi * FREQUENT / FREQUENT[-1] * 2.0)) ** 2
    write(tmp_path / "again.csv", "time [s],x [m]", FREQUENT, 2.54e-6 * np.rint(way / 2.54e-6))
    ran = vsr("run", "motions", "--site", site, "--set", "motion.files=[again.csv, tilting.csv]")
    data = xr.load_dataset(derived / "rock" / "motions.nc")
    told = dict(zip(data["record"].values, data["repairs"].values, strict=True))
    assert "of its PGA" in told["again"]
    assert told["tilting"] == ""
    assert f"motions: again: {told['again']}" in ran.out + ran.err


@pytest.mark.parametrize(
    ("head", "factors", "told"),
    [
        ("time [s]", (40.0, 1.0, 1.0), ["time in steps of 1 s: numbers of samples?"]),
        ("time [s]", (1.0, 100.0, 1.0), ["x to 50 m: cm?"]),
        ("time [s]", (1.0, 1.0, 57.0), ["pitch to 0.855 rad, 49 degrees: degrees?"]),
        ("time [ms]", (40.0, 1e-3, 1e-3), []),
        ("time [s]", (1.0, 10.0, 40.0), []),
    ],
)
def test_samples_in_other_units_than_stated_are_told(
    head: str, factors: tuple[float, float, float], told: list[str], tmp_path: Path
) -> None:
    columns = np.array(factors)[:, None] * [TIME, 0.5 * SWELL, 0.015 * SWELL]
    path = write(tmp_path / "table.csv", f"{head},x [m],pitch [rad]", *columns)
    assert list(_doubts(load(path))) == told


@pytest.mark.slow
def test_runs_of_motions_in_several_axes(
    site: str, vsr: Callable[..., Ran], derived: Path, tmp_path: Path
) -> None:
    """Products have a row for each file; the outcome is that of the same run by hand."""
    bullet = ("--set", "simulation.engine=bullet")
    assert vsr("run", "fragility", "--site", site, *bullet, "--workers", "0").code == 0
    data = xr.load_dataset(derived / "rock" / "responses.nc")
    assert data["outcome"].dims == ("yaw", "friction", "record", "pga")
    assert sorted(data["record"].values) == ["shaking", "tilting"]
    assert (np.diff(data["pgv_pga"].values) > 0.0).all()
    rock = solid.box((0.5, 0.5, 1.2), 2110.0).rock
    case = prepare(Scene(rock, Contact(0.6)), barrier(rock), reduce=True)
    own = Settings(float(data["time_step"][0]))
    for name in ("shaking", "tilting"):
        motion = load(tmp_path / f"{name}.csv")
        for pga in (0.1, 1.2):
            factor = pga * GRAVITY / motion.peak_acceleration
            response = simulate(case, motion.scaled(factor), own)
            found = data.sel(record=name, pga=pga).squeeze()
            assert int(found["outcome"]) == response.outcome
            assert float(found["tilt_until_decided"]) == pytest.approx(response.peak_tilt)
    assert (data["overturned"].sel(pga=0.1) == 0).all()
    assert (data["overturned"].sel(record="shaking", pga=1.2) == 1).all()
    page = (derived / "rock" / "report.html").read_text()
    assert "2 table motions in several axes" in " ".join(page.split())
    assert "0 to do" in vsr("plan", "--site", site, *bullet).out


@pytest.mark.slow
def test_another_file_is_another_motion(
    site: str, vsr: Callable[..., Ran], derived: Path, tmp_path: Path
) -> None:
    """Its runs are done again, and no others."""
    assert vsr("run", "responses", "--site", site, "--workers", "0").code == 0
    wave = 0.2 * SWELL * np.sin(8.0 * TIME)
    write(tmp_path / "shaking.csv", "time [s],x [m],y [m]", TIME, wave, -0.4 * wave)
    assert "shaking.csv edited" in vsr("why", "responses", "--site", site).out
    assert "2 runs done" in vsr("run", "responses", "--site", site, "--workers", "0").err


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (("drive=servo",), ("drive", "moves along x only", "table_frame")),
        (("motion.files=[absent.csv]",), ("motion.files", "absent.csv", "not found")),
        (("motion.pgv_pga=0.2",), ("motion.pgv_pga", "has its own PGV/PGA", "remove")),
        (("motion.pgv=0.2",), ("motion.pgv", "unknown key", "did you mean")),
    ],
)
def test_what_a_table_cannot_do(
    site: str, refused: Callable[..., str], settings: tuple[str, ...], words: tuple[str, ...]
) -> None:
    chosen = [part for setting in settings for part in ("--set", setting)]
    refused("run", "responses", "--site", site, "--workers", "0", *chosen, words=words)


def test_a_file_that_is_no_motion_is_refused_with_its_name(
    site: str, refused: Callable[..., str], tmp_path: Path
) -> None:
    write(tmp_path / "shaking.csv", "time [s],x [m]", TIME, TIME)
    words = ("motion.files", "shaking.csv", "x moving", "start and end at rest")
    refused("plan", "--site", site, words=words)
