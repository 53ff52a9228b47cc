"""How far a time step moves the boundaries of draws, and how wide their islands are.

A level is run at PGAs in even steps around a change of outcome, at some time steps and at a finer
reference. Where outcomes change many times, each change, the first one included, moves with the
smallest difference. The PGA below which as many of these runs topple as stand above it moves with
what a step does to all of them, and is what steps are compared by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array, Indices
from vsr_core.run.time_step import ENOUGH, KEPT_BY

SPACING = 0.0075
"""Between the PGAs of a level [ln g]."""

AROUND = (np.arange(16) - 7.5) * SPACING
"""Where they lie, from the change of outcome [ln g]."""

FEW, LEVELS = 8, 24
"""Draws that are measured, the first ones, and levels of all of them together."""

SEARCHED = 8
"""Runs that find the change of outcome of a level, as a rule."""

SHARES = (1.0, 0.5, 0.25)
"""Steps that are tried, in units of the site's own."""

REFERENCE = 0.125
"""What they are compared with, in the same unit."""

EVENLY = 0.5 * (5.0**0.5 - 1.0)
"""Between numbers on (0, 1) that fill it evenly, however many they are."""


def shares(*, chosen: bool) -> tuple[float, ...]:
    """Steps that are tried: several, of which one is chosen, or the one that is given."""
    return SHARES if chosen else SHARES[:1]


def levels(draws: int, yaws: int, rows: int) -> tuple[Indices, Indices, Indices]:
    """Draw, direction and row of the levels that are measured, spread over all."""
    each = _each(draws, yaws * rows)
    draw = np.repeat(np.arange(draws), each)
    place = (evenly(len(draw)) * yaws * rows).astype(np.int64)
    level = np.unique(np.ravel_multi_index((draw, place), (draws, yaws * rows)))
    draw, yaw, row = np.unravel_index(level, (draws, yaws, rows))
    return draw, yaw, row


def planned(draws: int, count: int, *, chosen: bool) -> int:
    """Runs that measuring takes, about.

    Parameters
    ----------
    count : int, levels of one draw
    """
    few, steps = min(draws, FEW), len(shares(chosen=chosen)) + 1
    return few * _each(few, count) * (SEARCHED + len(AROUND) * steps)


def _each(draws: int, count: int) -> int:
    """Levels of a draw that are measured, of so many."""
    return min(-(-LEVELS // draws), count)


def evenly(count: int) -> Array:
    """Numbers on (0, 1) that fill it."""
    return np.asarray((np.arange(count) + 0.5) * EVENLY % 1.0)


@dataclass(frozen=True, eq=False)
class StepErrors:
    """What was measured at some time steps; nan where fewer than ``ENOUGH`` levels have an answer.

    Attributes
    ----------
    shift : ndarray, shape (steps,), how far boundaries lie above the reference's in the mean [ln g]
    unsure : ndarray, shape (steps,), standard error of that
    kept : ndarray, shape (steps,), error of a boundary that ``KEPT_BY`` of the levels keep [ln g]
    islands : ndarray, shape (steps,)
        How far the highest run that stands lies above the lowest that topples, mean [ln g].
    levels : int, those with a verdict in all their runs
    """

    shift: Array
    unsure: Array
    kept: Array
    islands: Array
    levels: int

    def coarsest(self, tolerance: float) -> int:
        """Number of the first step from which on all shifts are within a tolerance, else the last.

        Without an answer it is the first one.

        >>> nothing = np.zeros(3)
        >>> found = StepErrors(np.array([0.02, -0.004, 0.003]), nothing, nothing, nothing, 9)
        >>> found.coarsest(0.01), found.coarsest(0.1), found.coarsest(0.001)
        (1, 0, 2)
        """
        if np.isnan(self.shift).any():
            return 0
        largest = np.maximum.accumulate(np.abs(self.shift)[::-1])[::-1]
        return int(np.append(np.flatnonzero(largest <= tolerance), len(largest) - 1)[0])


def measured(side: NDArray[np.int8]) -> StepErrors:
    """Compare time steps with the reference.

    Parameters
    ----------
    side : ndarray of int, shape (steps + 1, levels, runs), the reference last
        Of runs at ``AROUND``: 1 overturned, 0 not, -1 unresolved.

    Examples
    --------
    >>> side = np.array([[[0, 0, 0, 1, 1]] * 3, [[0, 1, 0, 1, 1]] * 3], np.int8)
    >>> found = measured(side)
    >>> found.shift.tolist(), found.kept.tolist(), found.islands.tolist(), found.levels
    ([0.0075], [0.0075], [0.0], 3)
    """
    known = side[:, (side >= 0).all(axis=(0, 2))]
    number = known.shape[1]
    if number < ENOUGH:
        nothing = np.full(len(side) - 1, np.nan)
        return StepErrors(nothing, nothing, nothing, nothing, number)
    stands = known == 0
    below = SPACING * stands.sum(axis=2)
    apart = below[:-1] - below[-1]
    runs = np.arange(known.shape[2])
    highest = np.where(stands, runs, -1).max(axis=2)
    lowest = np.where(stands, len(runs), runs).min(axis=2)
    wide = SPACING * np.maximum(highest - lowest, 0)[:-1]
    return StepErrors(
        apart.mean(axis=1),
        apart.std(axis=1, ddof=1) / np.sqrt(number),
        np.quantile(np.abs(apart), KEPT_BY, axis=1, method="inverted_cdf"),
        wide.mean(axis=1),
        number,
    )
