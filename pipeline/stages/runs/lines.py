"""Lines: the runs of a row of the grid at every PGA, kept as changes of outcome and a sample.

That is what ``simulation.keep: boundary`` asks for. Outcome, rule and movement of every run come
back of the PGAs at which they change; all else that is known of a run is kept of a random sample
and of those that are unresolved.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pipeline.workflow import keys
from pipeline.workflow.rows import LineRow
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.outcome import DecidedBy, Outcome
from vsr_core.run.movement import movements, no_return_tilt
from vsr_core.source import tracing

SHARE, SEED = 0.01, 1
"""Probability that a run is in the sample, and what the numbers that decide it begin with."""

CODES, NUMBERS = ("outcome", "decided_by", "movement"), ("peak_tilt", "final_tilt", "slip", "steps")
"""What is kept of every run, and of those of the sample; in columns as they stand in a row."""

_LENGTHS = struct.Struct("<2I")


class Line(NamedTuple):
    """Number of the row of motions, and what its sample is drawn with besides ``SEED``."""

    row: int
    seed: int


def sampled(line: Line, cells: int) -> Mask:
    """Which cells of a line are in the sample, shape (cells,)."""
    return np.random.default_rng((SEED, line.seed, line.row)).random(cells) < SHARE


def rule() -> tuple[float, int, str]:
    """What decides what is kept of a line, besides its runs."""
    code = tracing.reached(f"{one.__module__}:{one.__name__}" for one in (packed, no_return_tilt))
    return SHARE, SEED, keys.digest(code)


def packed(runs: Array, sample: Mask, no_return: float) -> bytes:
    """The changes along a line, and its sample.

    Parameters
    ----------
    runs : ndarray, shape (cells, 6 or 7), fields of ``RunRow`` or ``TerrainRow`` but the key
    no_return : float [rad], as ``vsr_core.run.movement`` says
    """
    outcome, peak = runs[:, 0].astype(int), runs[:, 2]
    in_air = runs[:, 6] if runs.shape[1] > 6 else np.full(len(runs), np.nan)
    moved = movements(outcome, peak, in_air, no_return)
    codes = np.stack([outcome, runs[:, 1], moved]).astype("i1")
    starts = np.flatnonzero(np.append(True, (codes[:, 1:] != codes[:, :-1]).any(axis=0)))
    places = np.flatnonzero(sample | (outcome >= Outcome.UNSETTLED))
    parts = (starts.astype("<u4"), codes[:, starts], places.astype("<u4"), runs[places, 2:6] + 0.0)
    return _LENGTHS.pack(len(starts), len(places)) + b"".join(part.tobytes() for part in parts)


def _unpacked(row: LineRow, cells: int) -> tuple[Indices, Indices, Array]:
    """Codes, shape (3, cells), and places and numbers, shape (k, 4), of the sample."""
    if not row.packed:
        lost = np.array([[row.outcome], [int(DecidedBy.SIMULATION)], [-1]])
        return np.repeat(lost, cells, axis=1), np.zeros(0, int), np.zeros((0, len(NUMBERS)))
    pieces, number = _LENGTHS.unpack_from(row.packed)
    at, found = _LENGTHS.size, []
    for count, dtype in ((pieces, "<u4"), (3 * pieces, "i1"), (number, "<u4"), (4 * number, "<f8")):
        found.append(np.frombuffer(row.packed, dtype, count, at))
        at += found[-1].nbytes
    starts, codes, places, numbers = found
    each = np.diff(np.append(starts, cells).astype(int))
    return np.repeat(codes.reshape(3, -1), each, axis=1), places, numbers.reshape(-1, len(NUMBERS))


def outcomes(row: Sequence[Any], cells: int) -> list[int]:
    """Outcome of each run of a line, of the fields of its row but the key."""
    found: list[int] = _unpacked(LineRow(b"", *row), cells)[0][0].tolist()
    return found


def columns(rows: Sequence[LineRow], cells: int) -> dict[str, Array]:
    """Codes and numbers of the runs of some lines; NaN, or -1 steps, outside the sample."""
    codes, numbers = [], np.full((len(rows), cells, len(NUMBERS)), np.nan)
    numbers[..., -1] = -1
    for line, row in zip(numbers, rows, strict=True):
        found, places, known = _unpacked(row, cells)
        codes.append(found)
        line[places] = known
    values = (*np.concatenate(codes, axis=1), *numbers.reshape(-1, len(NUMBERS)).T)
    return dict(zip((*CODES, *NUMBERS), values, strict=True))


def worst(runs: Array) -> int:
    """Largest code of the outcomes of a line."""
    return int(runs[:, 0].max(initial=int(Outcome.BALANCED)))
