"""Faults and ground-motion models as tables: what no fault, or no model, can be is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.config.problems import InputError
from pipeline.stages.hazard import fault_files
from tests.support.outside_files import EXPECTED, FAULTS

NAMES = "magnitude,distance_km,pga_g,pga_log_sd,pgv_cm_s,pgv_log_sd\n"


def model(*medians: tuple[float, float]) -> str:
    """A model of two magnitudes and two distances."""
    places = ("5,10", "5,30", "7,10", "7,30")
    rows = (f"{at},{pga},0.5,{pgv},0.5\n" for at, (pga, pgv) in zip(places, medians, strict=True))
    return NAMES + "".join(rows)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return tmp_path / "table.csv"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (FAULTS.replace("mechanism", "rate_sd"), "rate_sd: got a column of no meaning"),
        (FAULTS.replace("mechanism", "Mechanism"), "Mechanism: got a column of no meaning"),
        (FAULTS.replace("0.012", "5"), "rate_per_year: got 5 in row 3; a fault has at most 0.13"),
        (FAULTS.replace("7.4,25,0.012", "9.9,0,0.1"), "rate_per_year: got 0.1 in row 3"),
        (FAULTS.replace("\n", "\n#2 ", 1), "name: got '#2 .*, a row or a comment"),
        (FAULTS.replace("\n", "\n #(2) ", 1), "name: got ' #.2. .*, a row or a comment"),
    ],
)
def test_what_no_table_of_faults_has_is_refused(table: Path, text: str, words: str) -> None:
    table.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        fault_files._faults(table)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "\n".join(f"{line},0.2" for line in EXPECTED.splitlines()).replace("_sd,0.2", "_sd,T"),
            "T: got a column of no meaning",
        ),
        (
            model((0.05, 5), (0.2, 20), (0.1, 10), (0.4, 40)),
            "pga_g: got medians that go the other way by 4 times; from the nearest",
        ),
        (
            model((0.1, 10), (0.1, 5), (0.2, 20), (0.2, 10)),
            "pga_g: got medians that stay the same; from the nearest",
        ),
        (
            model((0.1, 10), (0.05, 5), (0.2, 10), (0.1, 5)),
            "pgv_cm_s: got medians that stay the same; from the least",
        ),
        (
            model((0.1, 50), (0.05, 20), (0.2, 10), (0.1, 4)),
            "pgv_cm_s: got medians that go the other way by 5 times; from the least",
        ),
        (
            f"{model((0.2, 10), (0.1, 5), (0.4, 20), (0.2, 10))}5,20,0.04,0.5,2,0.5\n"
            "7,20,0.3,0.5,15,0.5\n",
            "pga_g: got medians that go the other way by 2.5 times; from the nearest",
        ),
        (
            f"{model((0.1, 10), (0.1, 10), (0.15, 15), (0.15, 15))}6,10,0.3,0.5,30,0.5\n"
            "6,30,0.1,0.5,10,0.5\n",
            "pga_g: got medians that go the other way by 2 times; from the least",
        ),
        (
            model((0.2, 10), (0.1, 5), (0.4, 20), (0.2, 10)).replace("20,0.5", "20,3"),
            "pgv_log_sd: got '3' in row 3",
        ),
        (
            model((0.2, 10), (0.1, 5), (0.4, 20), (0.2, 10)).replace("0.2,0.5", "0.2,0.005"),
            "pga_log_sd: got '0.005' in row 1",
        ),
    ],
)
def test_what_no_ground_motion_model_has_is_refused(table: Path, text: str, words: str) -> None:
    table.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        fault_files._model(table)


@pytest.mark.parametrize(
    "medians",
    [
        ((0.4, 20), (0.2, 10), (0.38, 40), (0.3, 30)),  # saturates near the rupture
        ((0.10, 5), (0.11, 5), (0.3, 30), (0.2, 25)),  # a reflection
    ],
)
def test_models_that_saturate_or_have_reflections_are_taken(
    table: Path, medians: tuple[tuple[float, float], ...]
) -> None:
    table.write_text(model(*medians), encoding="utf-8")
    assert fault_files._model(table).magnitudes.tolist() == [5.0, 7.0]


def test_a_row_behind_a_sign_and_a_blank_is_a_comment(table: Path) -> None:
    table.write_text(FAULTS.replace("\n", "\n# ", 1), encoding="utf-8")
    assert len(fault_files._faults(table)) == 2
    table.write_text(FAULTS.replace("\n", '\n"#2 Hosgri",7.4,2,0.01,\n', 1), encoding="utf-8")
    assert fault_files._faults(table)[0].name == "#2 Hosgri"


def test_an_empty_column_at_the_end_of_a_table_is_none(table: Path) -> None:
    table.write_text("".join(f"{line},\n" for line in FAULTS.splitlines()), encoding="utf-8")
    assert len(fault_files._faults(table)) == 3
