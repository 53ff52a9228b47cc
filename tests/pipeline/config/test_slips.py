"""Usual slips of unit or typing are warned of; what is shipped, or usual, is not."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from pipeline import cli
from pipeline.config.layers import SITES, STUDIES, Site, known, load_site
from pipeline.config.problems import InputError
from pipeline.config.schema import TableConfig
from pipeline.config.slips import SLIPS, warnings, warnings_of_table
from pipeline.config.sweep import load_sweep

SITE = "cuboid_1x1x2"
AGE = "hazard.age={kind: normal, mean: 20, sd: 1}"
FILTERED = "motion={kind: record, files: x, pga: 1, processing: {order: paper, "

SUSPECT = {
    "yaw=[0.785, 1.57]": "45 for 0.785",
    "yaw=[0, 1.5708, 3.1416, 4.7124]": "radians?",
    "uncertainty.azimuth.sd=0.087": "radians?",
    "motion={kind: record, pga: 1, records: [{file: a, azimuth: 0.5236}], "
    "processing: {order: none, highpass: null, lowpass: null}}": "radians?",
    "observations=[{kind: tilt, direction: 1.57, angle: 9, sd: 1, outcome: stood}]": "radians?",
    "motion.pga=9.81": "m/s2?",
    "motion.pga={start: 0.5, stop: 5, num: 10}": "m/s2?",
    "motion.pgv_pga={start: 1, stop: 5, num: 5}": "Hz?",
    "hazard.pgv_pga={pga: [0.1, 1.0], median: [0.785, 0.5], log_sd: [0.5, 0.5]}": "m/s per g?",
    "contact.friction=35": "degrees?",
    "uncertainty.friction=[24, 37]": "degrees?",
    "contact.friction=[0, 6]": "decimal comma?",
    "contact.friction=[0, 20, 35]": "degrees?",
    "rock.density=26": "kN/m3?",
    "rock.density=165": "lb/ft3?",
    "rock.size=[10, 10, 20]": "cm?",
    "uncertainty.scan.error=0.5": "cm?",
    FILTERED + "highpass: 10, lowpass: null}}": "a period in seconds?",
    FILTERED + "highpass: null, lowpass: 0.04}}": "a period in seconds?",
    AGE: "20 ka",
    "hazard.age={kind: samples, values: [18202105]}": "two ages in one line?",
    "hazard.history=[{site: buried, until: {kind: bounds, low: 2, high: 3}}]": "20 ka",
    "hazard.rocks=[{site: a, age: {kind: samples, values: [9e3]}}, {site: b, age: {kind: normal, "
    "mean: 20}}]": "20 ka",
}


def told(setting: str) -> list[str]:
    return [str(one) for one in warnings(load_site(SITE, None, (setting,)))]


@pytest.mark.parametrize("setting", SUSPECT)
def test_a_usual_slip_is_warned_of_once(setting: str) -> None:
    (line,) = told(setting)
    assert line.startswith(f"--set: {setting.partition('=')[0]}")
    assert SUSPECT[setting] in line


def test_each_slip_has_a_case() -> None:
    said = "\n".join(line for setting in SUSPECT for line in told(setting))
    assert [slip.remedy for slip in SLIPS if slip.remedy not in said] == []


@pytest.mark.parametrize(
    "setting",
    [
        *("yaw=[0, 1, 2]", "yaw=[22.5, 45]", "yaw=0", "yaw=[-30, 30]"),
        *("motion.pga={start: 0.02, stop: 2.5, num: 9}", "motion.pgv_pga=[0.02, 1]"),
        *(
            "contact.friction=[0, 0.6]",
            "contact.friction=0",
            "contact.friction=[0, 0.5, 1]",
            "contact.friction=[0.4, 10]",
        ),
        *("rock.density=1050", "rock.density=450", "rock.size=[0.05, 0.05, 0.12]"),
        *(AGE.replace("20", "2000"), FILTERED + "highpass: 0.1, lowpass: 25}}"),
    ],
)
def test_what_is_usual_is_taken_without_a_word(setting: str) -> None:
    assert told(setting) == []


@pytest.mark.parametrize(
    "setting",
    [
        *("rock.scale=0.1", "rock.mesh=a.ply", "pedestal.mesh=hill.ply"),
        "pedestal.cut={kind: plane, point: [0, 0, 1], normal: [0, 0, 1]}",
        "pedestal.point_on_rock=[1, 1, 1]",
    ],
)
def test_what_has_no_part_in_a_block_on_level_ground_is_told(setting: str) -> None:
    (line,) = told(setting)
    assert line.startswith(f"--set: {setting.partition('=')[0]}: got ")
    assert "leave it out" in line


@pytest.mark.parametrize(
    ("of_site", "of_study", "settings", "idle"),
    [
        ("shape: mesh, fallback: sine_hills", "{}", ("pedestal.shape=flat",), False),
        ("shape: mesh, fallback: sine_hills", "pedestal: {shape: flat}", (), False),
        ("shape: flat, fallback: sine_hills", "{}", (), True),
        ("shape: flat, fallback: sine_hills", "rock: {pose: {position: [0, 0, 1]}}", (), True),
        ("shape: flat, fallback: sine_hills", "{}", ("rock.pose.drop=true",), True),
        (
            "shape: mesh, fallback: sine_hills",
            "{}",
            ("pedestal.shape=flat rock.pose.drop=true",),
            True,
        ),
    ],
)
def test_a_shape_that_is_set_over_a_site_leaves_what_was_for_another(
    of_site: str, of_study: str, settings: tuple[str, ...], idle: bool, tmp_path: Path
) -> None:
    """The program itself says so to who wants draws of a rock on a terrain of another file."""
    rock = "{shape: mesh, mesh: a, density: 2700, pose: {position: [3, 0, 1]}}"
    (tmp_path / "a.yaml").write_text(f"rock: {rock}\npedestal: {{{of_site}}}\n")
    (tmp_path / "study.yaml").write_text(f"{of_study}\n")
    site = load_site(str(tmp_path / "a.yaml"), str(tmp_path / "study.yaml"), settings)
    assert ["rock.pose: got" in str(one) for one in warnings(site)] == [True] * idle


def members(site: str, study: str | None) -> list[Site]:
    """Configurations of a study of a site; none where it is not for this site."""
    try:
        sweep = load_sweep(site, study, (), gridded=True)
        return [one.site for one in sweep.members] if sweep else [load_site(site, study)]
    except InputError:
        return []


def test_no_site_and_no_study_that_is_shipped_is_suspect() -> None:
    """A study by the first site that it is for."""
    of_sites = [members(site, None) for site in known(SITES)]
    of_studies = [
        next(filter(None, (members(site, study) for site in known(SITES))))
        for study in known(STUDIES)
    ]
    assert [str(one) for some in of_sites + of_studies for s in some for one in warnings(s)] == []


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        ({"velocity": 500.0}, "mine.yaml: velocity: got 500; velocities are in m/s; mm/s?"),
        ({"stroke": 300.0}, "mine.yaml: stroke: got 300; strokes are in metres; mm?"),
        ({"pulley_diameter": 53.98}, "mine.yaml: pulley_diameter: got 53.98; diameters are in"),
    ],
)
def test_limits_of_a_table_in_millimetres_are_warned_of(limit: dict[str, float], said: str) -> None:
    usual = {"velocity": 0.5, "stroke": 0.3, "pulley_diameter": 0.054}
    others = {"acceleration": 1.2, "payload": 2.0, "steps_per_turn": 1600, "command_rate": 200}
    table = TableConfig.model_validate(others | usual | limit)
    (line,) = map(str, warnings_of_table(table, "mine.yaml"))
    assert line.startswith(said)
    table = TableConfig.model_validate(others | usual)
    assert list(warnings_of_table(table, "mine.yaml")) == []


@pytest.mark.slow
def test_no_study_of_any_site_that_is_shipped_is_suspect() -> None:
    every = (members(*one) for one in product(known(SITES), known(STUDIES)))
    assert [str(one) for some in every for site in some for one in warnings(site)] == []


def test_a_warning_is_a_line_and_changes_no_exit_code(vsr: Callable[..., Any]) -> None:
    ran = vsr("plan", "--site", SITE, "--set", "motion.pga=9.81")
    assert ran.code == cli.DONE
    (line,) = ran.err.splitlines()
    assert line.startswith("vsr: warning: --set: motion.pga: got 9.81; PGA is in g")


def test_a_sweep_is_warned_of_once(vsr: Callable[..., Any]) -> None:
    ran = vsr("plan", "study", "--site", SITE, "--study", "yaw", "--set", "motion.pga=9.81")
    assert ran.code == cli.DONE, ran.err
    assert ran.err.count("warning") == 1
