"""How a servo's table follows its motions, and the page of it."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support import record_files

from pipeline.config.layers import Site, load_site
from pipeline.stages.motions import motion_grid
from pipeline.stages.studies.servo import drive, drive_runs
from vsr_core import GRAVITY
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.trace import RecordedMotion
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene
from vsr_core.table.servo import PUBLISHED, Servo, loop, spectral_radius
from vsr_core.verification.tracking import TableHistory, disturbance, errors, push, synthetic, track

PULSE = CosinePulse.from_g(0.2, 0.8)
HELD = replace(PUBLISHED, hold=5)


@cache
def box(size: tuple[float, float, float] = (1.0, 1.0, 2.0)) -> Rock:
    return solid.box(size, 2110.0).rock


def followed(servo: Servo, rock: Rock, after: float = 0.5) -> tuple[Scene, TableHistory]:
    scene = Scene(rock, Contact(0.6), drive=servo)
    return scene, track(scene, PULSE, 1e-3, after)


@pytest.mark.parametrize(
    ("servo", "slips"), [(PUBLISHED, 1e-5), (HELD, 4e-4)], ids=["each period", "200 Hz"]
)
def test_a_track_is_the_sampled_loop_as_long_as_the_rock_stands(servo: Servo, slips: float) -> None:
    """The pulse of Fig. 7a tips no block of 1:2; in steps of five periods it slips a little."""
    scene, course = followed(servo, box())
    assert course.tilt.max() < 1e-3
    np.testing.assert_allclose(course.wanted, PULSE.velocity(course.time))
    whole = replace(servo, mass=servo.mass + scene.rock.mass)
    np.testing.assert_allclose(course.measured, loop(whole, course.command), atol=slips)
    assert np.abs(push(course, scene)).max() < slips
    # Newton: the force moves the table and the rock, but for what contact lets slip
    gained = np.diff(np.concatenate([[0.0], course.measured])) * whole.mass / servo.period
    np.testing.assert_allclose(course.force, gained, atol=0.08 * np.abs(course.force).max())


def test_errors_of_a_known_course() -> None:
    time = np.linspace(0.01, 2.0, 200)
    wanted = np.where(time <= 1.0, 3.0 * time, 0.0)
    measured = wanted + np.where(time <= 1.0, 0.1, 9.0) * np.where(np.arange(200) % 2, 1.0, -1.0)
    zero = np.zeros(200)
    found = errors(TableHistory(time, wanted, wanted, measured, zero, zero, zero))
    assert found.rms == pytest.approx(0.1)
    assert found.largest == pytest.approx(0.1)
    assert found.first == pytest.approx(-0.1)
    assert found.first_share == pytest.approx((0.03 - 0.1) / 0.03)


def test_a_rest_before_and_after_the_shaking_makes_no_error_smaller() -> None:
    """Nor do the first millionths of a filtered record, which lie in it."""
    time = np.linspace(0.01, 2.0, 200)
    wanted = np.sin(2.0 * np.pi * time)
    error = 0.1 * np.cos(9.0 * time)
    rest = 1e-6 * np.sin(time)
    courses = [(wanted, error), tuple(np.hstack([rest, one, rest]) for one in (wanted, error))]
    found = []
    for way, off in courses:
        of_all = np.zeros((7, len(way)))
        of_all[1:4] = way, way, way + off
        found.append(errors(TableHistory(*of_all)))
    assert found[0].rms == found[1].rms
    assert found[0].largest == found[1].largest


def test_disturbance_of_a_known_push() -> None:
    time = np.arange(0.0, 1.0, 0.001)
    pushed = np.where(time >= 0.4, -0.2 * np.exp(-(time - 0.4) / 0.01), 0.0)
    found = disturbance(time, pushed)
    assert (found.time, found.peak) == (pytest.approx(0.4), pytest.approx(0.2))
    assert found.recovery == pytest.approx(0.01 * math.log(10.0), abs=0.001)


def test_held_commands_err_by_the_stairs_they_are() -> None:
    """Within a command the velocity wanted changes by a T, of which the servo is in the middle."""
    plain, held = (errors(followed(servo, box())[1]) for servo in (PUBLISHED, HELD))
    assert plain.rms < 1e-3
    stairs = PULSE.pga * HELD.command_period / math.sqrt(12.0) / math.sqrt(2.0)
    assert math.sqrt(held.rms**2 - plain.rms**2) == pytest.approx(stairs, rel=0.1)
    # The first command is a (T + h) / 2, of which the rock's mass takes its share.
    share = PUBLISHED.mass / (PUBLISHED.mass + box().mass)
    assert held.first_share == pytest.approx(3.0 * share, rel=0.01)
    assert plain.first_share == pytest.approx(share, rel=0.01)


def test_a_made_motion_has_its_ratio_and_ends_at_rest() -> None:
    for ratio in (0.3, 1.2):
        trace = synthetic(ratio)
        motion = RecordedMotion.scaled(trace, 0.4)
        t = np.linspace(0.0, motion.duration, 40_001)
        peaks = [np.abs(part(t)).max() for part in (motion.acceleration, motion.velocity)]
        assert peaks[0] == pytest.approx(0.4 * GRAVITY, rel=1e-3)
        assert peaks[1] / peaks[0] == pytest.approx(ratio, rel=0.01)
        assert abs(float(trace.velocity[-1])) < 1e-3 * peaks[1]


def test_a_slab_that_turns_beside_the_pedestal_has_not_toppled() -> None:
    """It slid off, and lies lower than it can on it."""
    limits = barrier(solid.box((1.0, 1.0, 0.15), 2600.0).rock)
    time, zero = np.arange(4.0), np.zeros(4)
    tilt, height = np.array([0.0, 0.02, 0.8, 3.1]), np.array([0.075, 0.075, -1.0, 0.075])
    fallen = TableHistory(time, zero, zero, zero, zero, tilt, height)
    assert drive_runs.peak_tilt(fallen, limits) == 0.02
    assert drive_runs.peak_tilt(replace(fallen, height=zero + 0.075), limits) == 3.1


def test_the_shift_is_that_of_the_last_servo_and_of_the_rows_that_the_frame_topples() -> None:
    def said(*frame_and_servos: list[float]) -> str:
        rows = ("drive", "pgv_pga"), list(frame_and_servos)
        return drive._shift(xr.Dataset({"first_overturning_pga": rows}))

    shift = "shifted by +25.0 % in the median row and by +25.0 % at most"
    both, gap = "both with the servo and without it", np.nan
    assert said([0.4, 0.4], [0.4, 0.6], [0.5, 0.5]) == shift
    alone = "; in 2 rows there is one only with the servo; in 1 row there is one only without it"
    found = said([0.4, gap, gap, 0.5, gap], [0.4] * 5, [0.5, 0.6, 0.7, gap, gap])
    assert found == f"{shift}, over the 1 of 5 rows that have one {both}{alone}"
    assert said([gap], [0.4], [gap]) == f"known in no row {both}"


@pytest.mark.slow
def test_a_toppling_rock_disturbs_the_table_for_an_instant() -> None:
    """As in Fig. 7b; no longer than the loop needs, and in the ratio of the masses."""
    rock = box((0.6, 0.6, 2.0))
    peaks = []
    for mass in (5e4, 5e5):
        servo = replace(HELD, mass=mass, kp=mass * 1e3, ki=mass * 1e3)
        scene = Scene(rock, Contact(0.6), drive=servo)
        course = track(scene, RecordedMotion.scaled(synthetic(1.2), 0.5), 1e-3, 2.0)
        assert course.tilt.max() > barrier(rock).toppled_tilt
        found = disturbance(course.time, push(course, scene))
        assert found.recovery < 0.01
        peaks.append(found.peak)
    assert peaks[0] > 5e-3
    assert peaks[0] / peaks[1] == pytest.approx(10.0, rel=0.2)


# The product


SITE = """rock: {shape: box, size: [0.6, 0.6, 2.0], density: 2110}
motion: {pga: [0.1, 1.0], pgv_pga: [0.2, 0.5]}
"""


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drive_runs, "ROWS", 2)
    monkeypatch.setattr(drive_runs, "LEVELS", 6)
    monkeypatch.setattr(drive_runs, "HALVINGS", 2)


@pytest.mark.slow
def test_one_pgv_pga_is_one_row(
    small: None,
    monkeypatch: pytest.MonkeyPatch,
    write_site: Callable[..., str],
    vsr: Callable[..., object],
    derived: Path,
) -> None:
    monkeypatch.setattr(drive_runs, "ROWS", 8)
    site = write_site(SITE.replace("[0.2, 0.5]", "[0.3]"))
    assert vsr("run", "drive", "--site", site, "--workers", "0").code == 0  # type: ignore[attr-defined]
    with xr.open_dataset(derived / "rock" / "drive.nc") as found:
        assert found["pgv_pga"].values.tolist() == [0.3]


@pytest.mark.slow
def test_products(
    small: None, write_site: Callable[..., str], vsr: Callable[..., object], derived: Path
) -> None:
    site = write_site(SITE)
    assert vsr("run", "drive", "--site", site, "--workers", "0").code == 0  # type: ignore[attr-defined]
    folder = derived / "rock"
    rows = list(csv.DictReader((folder / "drive.csv").open()))
    notes = [row["note"] for row in rows]
    assert notes == ["", "", "unstable, so refused", ""]
    slow = replace(PUBLISHED, period=0.005)
    assert float(rows[2]["spectral_radius"]) == pytest.approx(spectral_radius(slow), rel=1e-5)
    assert [float(row["command_hz"]) for row in rows] == [1000.0, 200.0, 200.0, 200.0]
    assert float(rows[-1]["pgv_m_per_s"]) == pytest.approx(
        float(rows[-1]["pga_g"]) * GRAVITY * 1.2, rel=0.01
    )
    assert float(rows[-1]["peak_tilt_deg"]) > 80.0
    data = xr.load_dataset(folder / "drive.nc")
    assert data["row_size"].values.sum() == data.sizes["sample"]
    assert "infinite" not in data["first_overturning_pga"].attrs["long_name"]
    assert "infinite" not in data["first_overturning_pga_upper"].attrs["long_name"]
    middle = data["first_overturning_pga"].values
    assert middle.shape == (3, 2)
    # Housner's, of a block of 1:3.3, is above tan(alpha) and falls with PGV/PGA.
    assert (middle > 0.3).all()
    assert (middle[:, 0] > middle[:, 1]).all()
    np.testing.assert_allclose(middle[1:], middle[:1].repeat(2, axis=0), rtol=0.1)
    page = (folder / "drive.html").read_text()
    assert page.count("<img") == 3
    assert "unstable, so refused" in page
    planned = vsr("plan", "drive", "--site", site).out  # type: ignore[attr-defined]
    assert planned.splitlines() == ["stages to make: none"]
    again = vsr("why", "drive", "--site", site)
    assert "drive: up to date" in again.out  # type: ignore[attr-defined]
    other = vsr("why", "drive", "--site", site, "--set", "servo.kp=4e7")
    assert "servo" in other.out  # type: ignore[attr-defined]


@pytest.mark.slow
def test_a_rock_that_nothing_holds_is_tried_from_a_small_pga_on(
    small: None, write_site: Callable[..., str], vsr: Callable[..., object], derived: Path
) -> None:
    """Without friction its static limit is 0 (Coulomb), and no pulse topples what slides."""
    site = write_site(SITE.replace("[0.2, 0.5]", "[0.3]"))
    ran = vsr("run", "drive", "--site", site, "--workers", "0", "--set", "contact.friction=0")
    assert ran.code == 0, ran.err  # type: ignore[attr-defined]
    with xr.open_dataset(derived / "rock" / "drive.nc") as found:
        assert np.isnan(found["first_overturning_pga"].values).all()


def test_an_unstable_servo_is_refused_though_it_is_idle(
    write_site: Callable[..., str], refused: Callable[..., str]
) -> None:
    words = (": servo: got", "Kp h / M = 5", "1.998 ms", "shorten the period")
    line = ("run", "drive", "--site", write_site(SITE), "--set", "servo.period=0.005")
    refused(*line, words=words)


def test_a_servo_whose_force_does_not_do_is_refused_though_it_is_idle(
    vsr: Callable[..., object], write_site: Callable[..., str]
) -> None:
    """Rows in which nothing topples for want of a motion told of a boundary beyond the grid."""
    weak = ("--set", "servo.force_limit=6000")
    ran = vsr("run", "drive", "--site", write_site(SITE), "--workers", "0", *weak)
    assert ran.code == 2, ran.err  # type: ignore[attr-defined]
    assert "servo.force_limit: got 6000 N for" in ran.err  # type: ignore[attr-defined]


@pytest.mark.slow
def test_pulses_that_no_drive_follows_are_refused(
    vsr: Callable[..., object], write_site: Callable[..., str]
) -> None:
    """Commands every 0.2 s do not make a pulse of 0.04 s; those of 0.5 s and more are left."""
    site = write_site(SITE)
    short = ("--set", "motion.pgv_pga=[0.03, 0.04]", "--set", "servo.command_rate=5")
    ran = vsr("run", "drive", "--site", site, "--workers", "0", *short)
    assert ran.code == 2, ran.err  # type: ignore[attr-defined]
    assert "servo: got a command every 200 ms" in ran.err  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("own", "ways"), [(HELD, 3), (PUBLISHED, 3), (replace(PUBLISHED, kp=3e7), 4)]
)
def test_the_servo_of_the_site_is_the_last_and_one_more_if_it_is_another(
    own: Servo, ways: int
) -> None:
    """The last is told of: how the boundary shifts, and the falling rock."""
    drives = drive_runs.drives(own)
    assert len({drive.name for drive in drives}) == len(drives) == ways
    assert drives[0].servo is None
    assert drives[-1].servo == own
    assert {PUBLISHED, HELD} < {drive.servo for drive in drives}


def rough(site: Site) -> drive_runs.Rough:
    motion = site.config.motion
    return drive_runs.rough(motion, motion_grid.find(motion, site.origin))


def test_a_site_with_records_is_shaken_by_the_longest_and_others_by_a_made_motion() -> None:
    recorded = rough(load_site("cuboid_1x1x2", "recorded_motion"))
    assert (recorded.name, recorded.pga) == ("record long", 0.4)
    made = rough(load_site("cuboid_1x1x2"))
    assert (made.name, made.pga) == ("rough motion", 0.4)
    np.testing.assert_array_equal(made.trace.acceleration, synthetic(1.2).acceleration)


@pytest.mark.parametrize("main", ["x", "y"])
def test_of_several_components_the_one_that_shakes_the_table_is_named(
    main: str, tmp_path: Path, write_site: Callable[..., str]
) -> None:
    waves = {
        axis: size * np.cos(np.linspace(0.0, 2.0 * np.pi, 401))
        for axis, size in zip("xyz", (2.0, -1.0, 9.0), strict=True)
    }
    waves[main] *= 4.0
    for axis, wave in waves.items():
        (tmp_path / f"{axis}.csv").write_text(record_files.csv(wave, 0.005))
    whole = "{components: {x: x.csv, y: y.csv, z: z.csv}, azimuth: 30}"
    none = "processing: {order: none, highpass: null, lowpass: null}"
    motion = f"motion: {{kind: record, records: [{whole}], {none}, pga: [0.3]}}\n"
    found = rough(load_site(write_site(SITE.splitlines()[0] + "\n" + motion)))
    assert found.name == f"record x (component {main} alone)"
    np.testing.assert_allclose(found.trace.acceleration, waves[main], atol=1e-6)
    named = drive_runs.Followed(found.name, "servo")
    assert str(named).startswith(found.name)
