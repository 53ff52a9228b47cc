"""The table of faults fits the code, and says of a fault that does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline import ROOT
from scripts import mutants

FAULTS = mutants.faults()


def test_every_fault_fits_the_code_once() -> None:
    """A changed line takes its fault along: mend or replace it in ``scripts/mutants.yaml``."""
    assert [f"{fault}: {why}" for fault in FAULTS if (why := fault.misfit(ROOT))] == []


def test_there_are_a_hundred_each_by_itself() -> None:
    assert len(FAULTS) >= 100
    assert len({(fault.file, fault.before, fault.after) for fault in FAULTS}) == len(FAULTS)
    assert not [fault for fault in FAULTS if fault.before == fault.after]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"before": "no such line"}, "has its text 0 times, not once"),
        ({"before": "\n"}, "times, not once"),
        ({"file": "pipeline/nowhere.py"}, "pipeline/nowhere.py is not there"),
        ({"after": "("}, "is no Python with it"),
        ({"stages": (("tests/nowhere.py",),)}, "tests/nowhere.py, which tests it, is not there"),
    ],
)
def test_a_fault_that_does_not_fit_is_told(change: dict[str, object], why: str) -> None:
    assert why in replace(FAULTS[0], **change).misfit(ROOT)


def test_words_choose_faults() -> None:
    chosen = mutants.faults(["keys", "Brier"])
    assert {fault.area for fault in chosen} == {"keys", "validation"}
    assert mutants.main(["no such words"]) == 2
