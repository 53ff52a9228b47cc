"""What the digits of numbers tell of how exact they are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import record_files as files

from vsr_core.motions import digits

NUMBERS = st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=40)


@given(NUMBERS, st.integers(0, 7))
def test_of_fixed_decimals_it_is_that_decimal(numbers: list[float], decimals: int) -> None:
    written = [f"{1e3 * one:.{decimals}f}" for one in [*numbers, 1.0 + 1e-3 * 10.0**-decimals]]
    found = digits.last(np.array(written, float))
    assert found == pytest.approx(np.full(len(found), 10.0**-decimals))


@given(NUMBERS, st.integers(2, 6))
def test_of_fixed_digits_it_is_no_finer_than_they_are(numbers: list[float], places: int) -> None:
    written = [f"{one:.{places}e}" for one in [*numbers, 0.123456789] if abs(one) > 1e-6]
    found = digits.last(np.array(written, float))
    units = [10.0 ** (int(one.partition("e")[2]) - places) for one in written]
    assert (found >= 0.999 * np.array(units)).all()


def test_of_numbers_that_were_never_rounded_it_is_nothing() -> None:
    values = np.random.default_rng(1).normal(size=100)
    assert (digits.last(values) < 1e-10 * np.abs(values).max()).all()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda values: values, []),
        (lambda values: values + 2.0 * np.abs(values).max(), []),  # an offset
        (np.sort, ["EW never turns: its samples may be sorted"]),
        (np.abs, ["EW is on one side of zero and of where it begins: minus signs may be lost"]),
        (
            lambda values: np.array([float(f"{one:.4e}".split("e")[0]) for one in values]),
            ["EW has numbers of one power of ten alone: their exponents may be lost"],
        ),
        (
            lambda values: 0.1 * np.array([float(f"{one:.6e}".split("e")[0]) for one in values]),
            ["EW has numbers of one power of ten alone: their exponents may be lost"],
        ),
        (
            lambda values: np.array([float(repr(one).split("e")[0]) for one in values.tolist()]),
            ["EW jumps to and fro by "],
        ),
        (
            lambda values: np.where(np.arange(len(values)) % 5, values, np.abs(values)),
            ["EW jumps to and fro by "],
        ),
        (lambda values: values[: len(values) // 8 * 8].reshape(-1, 8)[::-1].ravel(), ["EW steps "]),
    ],
)
def test_shaking_that_was_sorted_or_lost_signs_or_exponents_is_told(
    change: Callable[[np.ndarray], np.ndarray], told: list[str]
) -> None:
    values = files.shaking(7, 100.0, 8.0, 4.0, 0.6)
    found = list(digits.disfigured(change(values), "EW"))
    assert len(found) == len(told)
    assert all(map(str.startswith, found, told))
