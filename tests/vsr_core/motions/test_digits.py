"""What the digits of numbers tell of how exact they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import record_files as files

from vsr_core.errors import InvalidInput
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


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("short", [False, True])
@pytest.mark.parametrize("backwards", [False, True])
def test_shaking_whose_end_is_held_is_refused_and_one_that_rests_is_not(
    backwards: bool, short: bool, far: bool
) -> None:
    """To the end, or to a few samples before it."""
    values = files.shaking(7, 100.0, 8.0, 4.0, 0.6)
    at = int(np.abs(values).argmax()) + 3
    held, rests = values.copy(), np.concatenate([values, np.zeros(200)])
    held[at : -5 if short else None] = held[at] if far else 0.007 * np.abs(values).max()
    for one in (rests, np.repeat([0.0, 1.0, -1.0], 40)):
        digits.refuse_still(one[::-1] if backwards else one, "EW", 0.01)
    with pytest.raises(InvalidInput, match="at an end; the last or first of the shaking is held"):
        digits.refuse_still(held[::-1] if backwards else held, "EW", 0.01)
