"""Samples that lost their order, signs or exponents are told; whole ones are not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from support.record_files import shaking

from vsr_core.motions import order

SIGNS = np.array([0.4, 1.0, 0.8, 0.6, 0.2])
"""Mantissas of a line that lost its exponents."""


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda values: values, []),
        (lambda values: values + 2.0 * np.abs(values).max(), []),  # an offset
        (lambda values: values - 0.98 * values.min(), []),
        (lambda values: values - 1.02 * values.min(), []),
        (lambda values: values + 0.15 * values.max(), []),
        (np.sort, ["EW hardly turns: its samples may be sorted"]),
        (
            lambda values: np.array([float(one) for one in sorted(map(repr, values.tolist()))]),
            ["EW hardly turns: its samples may be sorted"],
        ),
        (np.abs, ["EW is on one side of zero and reaches it: minus signs may be lost"]),
        (
            lambda values: np.abs(values + 0.1 * np.abs(values).max()),
            ["EW is on one side of zero and reaches it: minus signs may be lost"],
        ),
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
        (
            lambda values: np.concatenate([values[:300], values[250:300], values[350:]]),
            ["EW has 50 samples a second time: lines of its file may stand there twice"],
        ),
        (
            lambda values: np.concatenate([values[:310], values[295:310], values[310:-15]]),
            ["EW has 15 samples a second time: lines of its file may stand there twice"],
        ),
        (lambda values: np.tile(values[:200], 4), ["EW has "]),
        (lambda values: np.concatenate([values[:330], np.tile(values[325:330], 94)]), ["EW has "]),
        (lambda values: np.round(values, 2), []),
        (
            lambda values: np.interp(
                np.arange(800), np.r_[:235, 275:800], values[np.r_[:235, 275:800]]
            ),
            ["EW goes straight for 42 samples: a gap may have been filled"],
        ),
        (
            lambda values: np.where(np.arange(len(values)) > 100, np.abs(values), values),
            ["EW shakes "],
        ),
        (lambda values: np.concatenate([values[:640], 9.0 * SIGNS, values[645:]]), ["EW peaks "]),
        (lambda values: np.where(np.arange(len(values)) == 200, np.nan, values), []),
    ],
)
def test_shaking_that_was_sorted_or_lost_signs_or_exponents_is_told(
    change: Callable[[np.ndarray], np.ndarray], told: list[str]
) -> None:
    values = shaking(7, 100.0, 8.0, 4.0, 0.6)
    found = list(order.doubts(change(values), "EW"))
    assert len(found) == len(told)
    assert all(map(str.startswith, found, told))
