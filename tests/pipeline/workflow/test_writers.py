"""Texts, tables and pages, and what a dataset says of its making."""

from __future__ import annotations

import csv
import json
import math
from importlib.metadata import version
from pathlib import Path

import jinja2
import pandas as pd
import pytest
import xarray as xr
from support.jobs import work

from pipeline.config.layers import load_site
from pipeline.workflow import datasets, keys, pages, writers


def test_text_and_bytes_as_given(tmp_path: Path) -> None:
    writers.text("é\n\r\nü")(tmp_path / "text")
    writers.binary(b"\x00\xff\r\n")(tmp_path / "bytes")
    assert (tmp_path / "text").read_bytes() == "é\n\r\nü".encode()
    assert (tmp_path / "bytes").read_bytes() == b"\x00\xff\r\n"


def test_table_is_written_with_six_digits(tmp_path: Path) -> None:
    frame = pd.DataFrame(
        {"b": [1.23456789e-9, math.nan], "a": ['x, "y"\nz', ""], "c": [0, 12], "d": [math.inf, ""]}
    )
    writers.table(frame)(tmp_path / "table")
    with (tmp_path / "table").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert rows == [
        ["b", "a", "c", "d"],
        ["1.23457e-09", 'x, "y"\nz', "0", "inf"],
        ["nan", "", "12", ""],
    ]
    writers.table(pd.DataFrame(columns=["a", "b"]))(tmp_path / "empty")
    assert (tmp_path / "empty").read_bytes() == b"a,b\r\n"


FORMULAS = (
    *(
        "=HYPERLINK(1)",
        "@SUM(1)",
        "+cmd|calc",
        "-1+1",
        "\t=1",
        "\r1",
        "\t1",
        " =1",
        "\n=1",
        "\xa0 @a",
    ),
    *("\uff1d1", "\uff0b1", " \uff0d1", "\uff20a", "\u3000=1", "\ufeff=1"),
)
"""As OWASP lists them under "CSV Injection", and after blanks, which spreadsheets leave out."""


@pytest.mark.parametrize("formula", FORMULAS)
def test_a_formula_is_text_in_cells_and_headings(tmp_path: Path, formula: str) -> None:
    writers.table(pd.DataFrame({formula: [formula, "a=1", -1.5, -2]}))(tmp_path / "table")
    with (tmp_path / "table").open(newline="", encoding="utf-8") as file:
        found = [row for (row,) in csv.reader(file)]
    assert found == [f"'{formula}", f"'{formula}", "a=1", "-1.5", "-2"]


def test_a_page_with_a_place_left_empty_is_an_error() -> None:
    with pytest.raises(jinja2.UndefinedError, match="site"):
        pages.filled("report.html", {})


@pytest.mark.parametrize(("engine", "library"), [("bullet", "PyBullet"), ("mujoco", "MuJoCo")])
def test_a_dataset_names_the_engine_in_use(tmp_path: Path, engine: str, library: str) -> None:
    pytest.importorskip("mujoco")
    site = load_site("cuboid_1x1x2", None, (f"simulation.engine={engine}",))
    attributes = datasets.described(xr.Dataset(), work(site, tmp_path), "Nothing").attrs
    assert attributes["source"].endswith(f", {library} {version(library)}")
    versions = json.loads(attributes["vsr_versions_json"])
    assert versions[engine.replace("bullet", "pybullet")] == version(library)
    assert len({"pybullet", "mujoco"} & set(versions)) == 1


def test_a_library_that_is_absent_has_no_version() -> None:
    assert keys.installed_version("absent") == "not installed"
