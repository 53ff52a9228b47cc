"""What a record must be before anything is made of it: it is repaired, or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Record
from vsr_core.motions.records.trace import Trace

LONGEST_GAP = 0.05
"""Longest gap [s] that a straight line may bridge: half a cycle of 10 Hz."""

FLAT_TOP = 3
"""Samples in a row at the very extreme that make a clipped record ..."""

ABRUPT = 10.0
"""... if the record gets there by this many of its smallest steps: a smooth top that was rounded
gets there by one or two."""

STRONGEST, WEAKEST = 5.0, 1e-6
"""PGA [g] beyond which a record is in another unit than it says. The strongest ever recorded on the
ground is near 4 g; the quietest noise of a strong-motion instrument is near 1e-6 g."""

DRIFT = 0.02
"""Largest final velocity, as a share of the PGV."""

OFFSET = 0.2
"""Largest final displacement, as a share of the PGD."""


def sound(record: Record) -> Record:
    """The record of one channel, repaired, or a refusal.

    Short gaps are bridged by a straight line; missing samples at the ends are cut.

    Raises
    ------
    InvalidInput
        For a record with no motion, long gaps, flat tops, or a PGA that shows another unit.
    """
    record = _bridged(record)
    values = record.acceleration
    if not len(values) or np.ptp(values) == 0.0:
        raise InvalidInput("a record whose samples are all alike", "it moves", "use another record")
    clipped = _flat_top(values)
    if clipped:
        raise InvalidInput(
            f"{clipped} samples in a row at the record's extreme",
            "an instrument that is not clipped passes its peak",
            "use another record or component",
        )
    pga = float(np.abs(values - np.median(values)).max()) / GRAVITY
    if not WEAKEST <= pga <= STRONGEST:
        raise InvalidInput(
            f"a PGA of {pga:.3g} g read in {record.unit}",
            f"it is between {WEAKEST:g} and {STRONGEST:g} g",
            "state the unit of its numbers as motion.unit: gal is 0.01 m/s2, and counts need the "
            "instrument's response (motion.response)",
        )
    return record


def settled(trace: Trace) -> None:
    """Refuse a processed motion that does not come to rest where it began.

    Raises
    ------
    InvalidInput
        With the drift, and what removes it.
    """
    velocity, displacement = trace.velocity, trace.displacement
    drift = abs(float(velocity[-1])) / float(np.abs(velocity).max())
    offset = abs(float(displacement[-1])) / float(np.abs(displacement).max())
    if drift > DRIFT or offset > OFFSET:
        raise InvalidInput(
            f"a motion that ends at {drift:.1%} of its PGV and {offset:.0%} of its PGD",
            f"it comes to rest, to {DRIFT:.0%} and {OFFSET:.0%}",
            "raise motion.processing.highpass, or set motion.processing.order to standard",
        )


def _bridged(record: Record) -> Record:
    values = record.acceleration
    known = np.isfinite(values)
    if known.all():
        return record
    if not known.any():
        raise InvalidInput(
            "a record without a number", "its samples are numbers", "use another record"
        )
    inside = np.flatnonzero(known)
    first, last = int(inside[0]), int(inside[-1])
    repairs = list(record.repairs)
    cut = first + len(values) - 1 - last
    if cut:
        repairs.append(f"{cut} missing samples at the ends were cut")
    values, known = values[first : last + 1], known[first : last + 1]
    for start, length in _runs(~known):
        if length * record.interval > LONGEST_GAP:
            raise InvalidInput(
                f"a gap of {length} samples, {length * record.interval:.3g} s, at "
                f"{(first + start) * record.interval:.4g} s",
                f"gaps up to {LONGEST_GAP:g} s are bridged",
                "cut the record before or after it",
            )
        at = (first + start) * record.interval
        repairs.append(f"{length} missing samples at {at:.4g} s were bridged by a straight line")
    places = np.arange(len(values), dtype=np.float64)
    whole = np.interp(places, places[known], values[known])
    return replace(record, acceleration=whole, repairs=tuple(repairs))


def _flat_top(values: Array) -> int:
    """Longest run of samples at an extreme that is reached abruptly; 0 if there is none."""
    steps = np.abs(np.diff(values))
    moves = steps[steps > 0.0]
    least = float(moves.min())
    longest = 0
    for extreme in (values.max(), values.min()):
        for start, length in _runs(values == extreme):
            if length < FLAT_TOP:
                continue
            before = steps[start - 1] if start else 0.0
            after = steps[start + length - 1] if start + length < len(values) else 0.0
            if max(before, after) > ABRUPT * least:
                longest = max(longest, length)
    return longest


def _runs(flags: Mask) -> list[tuple[int, int]]:
    """Start and length of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
