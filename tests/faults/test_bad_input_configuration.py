"""Configurations that nobody can mean are refused in a line, at once, with nothing written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

from pipeline import status
from pipeline.config.layers import load_file, load_site
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.schema import Config, TableConfig
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.stage import Job
from pipeline.workflow.store import Store
from tests.support.bad_input import bounded, like, settings_of, taken_or_refused

Refused = Callable[..., str]

BOX = "rock: {shape: box, size: [1, 1, 2], density: 2000}\n"
DOUBLING = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{after}: &{after} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, after in zip("abcdefgh", "bcdefghi", strict=True)
)

TEXTS = {
    "aliases of aliases": (DOUBLING + "yaw: *i", "more than 20000 values"),
    "merged aliases": ("contact: {<<: [{friction: 1}]}", "contact.<<", "unknown"),
    "a section in itself": ("rock: &r {shape: box, mesh: *r}", "recursive"),
    "a list in itself": ("yaw: &y [1, *y]", "recursive"),
    "lists in lists": ("yaw: " + "[" * 3000 + "]" * 3000, "more than 20 sections"),
    "sections in sections": ("yaw: " + "{a: " * 2000 + "1" + "}" * 2000, "more than 20 sections"),
    "many digits": ("yaw: " + "9" * 5000, "a number of 5000 digits, line"),
    "more digits than a float has": ("yaw: " + "9" * 400, "a number of 400 digits"),
    "a long text": ("yaw: " + "x" * 300_000, "it has at most 256 KiB"),
    "many values": ("yaw: [" + "1, " * 30_000 + "1]", "more than 20000 values"),
    "a date": ("yaw: 2020-01-01", "'2020-01-01'", "number"),
    "an escape for the terminal": ('"\\e[2J": 1', r"\x1b[2J"),
}


@pytest.mark.parametrize("case", TEXTS)
def test_text_is_bounded(tmp_path: Path, refused: Refused, case: str) -> None:
    text, *words = TEXTS[case]
    site = tmp_path / "rock.yaml"
    site.write_text(text if text.startswith("rock:") else BOX + text)
    with bounded(seconds=2.0, mebibytes=100.0):
        refused("plan", "--site", site, words=(site.name, *words))


def test_a_short_alias_is_welcome(tmp_path: Path) -> None:
    site = tmp_path / "rock.yaml"
    site.write_text(BOX + "motion: {pga: &grid [0.1, 0.2], pgv_pga: *grid}")
    assert load_site(str(site)).config.motion.pga == (0.1, 0.2)


SETTINGS = {
    "rock.size=[1e308, 1e308, 1e308]": ("rock.size", "30 m", "metres"),
    "rock.size=[1e9, 1e9, 1e9]": ("rock.size", "30 m"),
    "rock.size=[1e-300, 1e-300, 1e-300]": ("rock.size", "0.005"),
    "rock.size=[1e-320, 1, 1]": ("rock.size", "thick"),
    "rock.size=[1, 1, 1e6]": ("rock.size", "30 m"),
    "yaw={start: 7, stop: 90, num: 1}": ("yaw", "'num': 1", "both ends", "a number alone"),
    "rock.size=[true, 1, 2]": ("rock.size.0", "True", "number"),
    "rock.density=1e-308": ("rock.density", "1e-308", "10"),
    "rock.density=2.7": ("rock.density", "2.7", "kg m-3"),
    "rock.density=true": ("rock.density", "True", "number"),
    "rock.density='2000'": ("rock.density", "'2000'", "number"),
    "rock.density=1_000": ("rock.density", "'1_000'", "number"),
    "rock.density=" + "1" * 100_000: ("rock.density", "100000 digits"),
    "yaw=true": ("yaw.0", "True", "number"),
    'yaw="0"': ("yaw.0", "'0'", "number"),
    "yaw={start: 0, stop: 90, num: 20000}": ("yaw", "at most 10000"),
    "motion.pga=[1e-12]": ("motion.pga", "1e-06"),
    "motion.pga.num=1e3": ("motion.pga.num", "integer"),
    "motion.pgv_pga=1e-9": ("motion.pgv_pga", "1e-09", "0.001 s"),
    "simulation.time_step=1e-12": ("simulation.time_step", "1e-12", "0.000001"),
    "simulation.time_step=1e-300": ("simulation.time_step", "1e-300"),
    "simulation.time_step=0.02": ("simulation.time_step", "20 ms", "rocks too fast"),
    "contact.rolling_friction=1e308": ("contact.rolling_friction", "1e+308"),
    "servo.kp=1e308": ("servo.kp", "1e+308"),
    ".".join("a" * 2000) + "=1": ("key=value",),
    "a..b=1": ("'a..b=1'", "key=value"),
    "yaw=" + "[" * 3000: ("yaw", "more than 20 sections"),
}


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: str(setting)[:40])
def test_number_has_bounds(refused: Refused, setting: str) -> None:
    with bounded(seconds=3.0, mebibytes=150.0):
        said = refused(
            *("plan", "responses", "--site", "cuboid_1x1x2", "--set", setting),
            words=SETTINGS[setting],
        )
    assert len(said) < 700


def test_run_refuses_a_long_step_before_any_work(
    refused: Refused, derived: Path, write_site: Callable[..., str]
) -> None:
    site = write_site("simulation: {time_step: 0.02}")
    refused("run", "responses", "--site", site, words=(site, "simulation.time_step", "20 ms"))


def test_plan_of_many_runs_is_arithmetic(vsr: Callable[..., Any]) -> None:
    grid = (
        *("--set", "motion.pga={start: 0.00001, stop: 1, num: 100000}"),
        *("--set", "motion.pgv_pga={start: 0.01, stop: 1, num: 10000}"),
    )
    vsr("plan", "--site", "cuboid_1x1x2")  # what is loaded once is no part of it
    with bounded(seconds=2.0, mebibytes=200.0):
        ran = vsr("plan", "responses", "--site", "cuboid_1x1x2", *grid)
    assert ran.code == 0, ran.err
    # its rocking starts at 0.5 g, as it is 1 m wide and 2 m high
    assert "runs: 1000000000; 0 stored, 1000000000 to do, 499990000 of them proved" in ran.out


RECORDS = "motion: {kind: record, files: nowhere, pga: 1, processing: "
RECORDS += "{order: none, highpass: null, lowpass: null}}"

STANDS = {
    "records in the site": (RECORDS, "", "", "site.yaml", "motion.files"),
    "records in the study": ("", RECORDS, "", "study.yaml", "motion.files"),
    "records in a setting": (RECORDS, RECORDS, "motion.files=none", "--set", "motion.files"),
    "another key of records": (RECORDS, "motion: {pga: 2}", "", "site.yaml", "motion.files"),
    "a scan": ("", "rock: {shape: mesh, mesh: a.ply}", "", "study.yaml", "rock.mesh"),
    "a replica": ("", "uncertainty: {scan: {replica: a.ply}}", "", "study.yaml", "scan.replica"),
    "a servo": ("drive: servo", "servo: {kp: 1.0e+9}", "", "study.yaml", "servo"),
    "a step": ("", "simulation: {time_step: 0.02}", "", "study.yaml", "simulation.time_step"),
    "a key of the base": ("", "yaw: 3", "", "site.yaml", "pedestal.shape"),
}


@pytest.mark.parametrize("case", STANDS)
def test_problem_names_the_file_in_which_the_key_stands(
    tmp_path: Path, refused: Refused, case: str
) -> None:
    site, study, setting, file, key = STANDS[case]
    (tmp_path / "site.yaml").write_text(BOX + site)
    (tmp_path / "study.yaml").write_text(f"# a study\n{study}")
    product = {
        "a scan": "rock",
        "a replica": "uncertainty",
        "a step": "responses",
        "a key of the base": "displacement",
    }.get(case, "motions")
    given = ("--set", setting) if setting else ()
    layers = ("--site", tmp_path / "site.yaml", "--study", tmp_path / "study.yaml", *given)
    said = refused("run", product, *layers, "--workers", 0, words=(key,))
    assert said.split(": ")[1].endswith(file), said


@pytest.mark.parametrize("name", ["x" * 300 + ".yaml", "x" * 5000, "a\0b.yaml", "...yaml", ""])
def test_name_of_a_site_is_a_name(refused: Refused, name: str) -> None:
    said = refused("plan", f"--site={name}", words=())
    assert len(said) < 1000


def test_site_file_that_cannot_be_one(tmp_path: Path, refused: Refused) -> None:
    loop, missing = tmp_path / "loop.yaml", tmp_path / "gone.yaml"
    loop.symlink_to(loop.name)
    missing.symlink_to("nowhere.yaml")
    refused("plan", "--site", loop, words=("loop.yaml", "links", "path"))
    refused("plan", "--site", missing, words=("gone.yaml", "file not found", "path"))
    refused("plan", "--site", loop / "in.yaml", words=("in.yaml", "path"))
    device = tmp_path / "device.yaml"
    device.symlink_to("/dev/zero")
    refused("plan", "--site", device, words=("device.yaml", "is no regular file"))
    os.mkfifo(tmp_path / "pipe.yaml")
    study = ("--site", "cuboid_1x1x2", "--study", tmp_path / "pipe.yaml")
    refused("plan", *study, words=("--study", "pipe.yaml", "is no regular file"))
    table = ("plan", "validation", "--table")
    refused(*table, tmp_path / "pipe.yaml", words=("pipe.yaml", "no folder"))
    refused(*table, tmp_path / "tests", words=("--table", "file not found"))


SOME = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
MANY = settings(SOME, max_examples=3000, derandomize=False, print_blob=True)


def write(path: Path, content: dict[str, Any]) -> str:
    path.write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("model", [Config, TableConfig, ShakeTableConfig])
@SOME
@given(data=st.data())
def test_anything_is_taken_or_refused(tmp_path: Path, model: type[BaseModel], data: Any) -> None:
    file = write(tmp_path / "any.yaml", data.draw(like(model)))
    if model is Config:
        taken_or_refused(lambda: load_site(file))
    else:
        taken_or_refused(lambda: load_file(file, tmp_path, "file", model))


@pytest.mark.slow
@SOME
@given(text=st.text(max_size=60) | st.text("[]{}:,-&*!|>?'\"% \n\tab0.<=", max_size=60))
def test_any_text_is_taken_or_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "any.yaml").write_bytes(text.encode("utf-8", "surrogatepass"))
    taken_or_refused(lambda: load_site(str(tmp_path / "any.yaml")))
    taken_or_refused(lambda: load_site(text))
    taken_or_refused(lambda: load_site("cuboid_1x1x2", None, (text, f"yaw={text}")))


def planned(folder: Path, given: tuple[str, ...]) -> list[str]:
    site = load_site("cuboid_1x1x2", None, given)
    store = Store(folder / site.name)
    return status.plan("responses", Job(site, store, Cluster(0), lambda line: None))


@settings(SOME, max_examples=25)
@given(given_settings=settings_of(Config))
def test_any_setting_is_planned_or_refused(tmp_path: Path, given_settings: tuple[str, ...]) -> None:
    with bounded(seconds=4.0, mebibytes=300.0):
        taken_or_refused(lambda: planned(tmp_path, given_settings))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@MANY
@given(given_settings=settings_of(Config))
def test_hunt_of_settings(tmp_path: Path, given_settings: tuple[str, ...]) -> None:
    with bounded(seconds=6.0, mebibytes=300.0):
        taken_or_refused(lambda: planned(tmp_path, given_settings))
    assert not list(tmp_path.iterdir())
