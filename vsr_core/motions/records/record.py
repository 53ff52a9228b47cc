"""A recorded acceleration as read, the units of files, and its repair or refusal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions import digits
from vsr_core.motions.named_columns import MOST_SAMPLES
from vsr_core.motions.records.trace import Trace

_FACTORS = {
    1.0: ("m/s2", "m/s/s", "ms-2", "m*s-2", "meter/second2"),
    0.01: ("cm/s2", "cm/s/s", "cms-2", "cm*s-2", "gal", "gals"),
    0.001: ("mm/s2", "mm/s/s", "mms-2", "mm*s-2"),
    GRAVITY: ("g", "standard_gravity"),
    0.001 * GRAVITY: ("mg",),
}
_KNOWN = {name: factor for factor, names in _FACTORS.items() for name in names}

_RAW = ("counts", "count", "v", "volt", "volts", "mv")

SHORTEST_INTERVAL, LONGEST_INTERVAL = 1e-6, 0.1
"""Time steps of a record [s]: no instrument is faster, and no shaking is told by slower ones.
Of 1 s are milliseconds that were taken for seconds, or the numbers of the samples."""


class Direction(NamedTuple):
    """Where a channel points: azimuth clockwise from north and dip, positive down [degree]."""

    azimuth: float
    dip: float


UPWARD = Direction(0.0, -90.0)


@dataclass(frozen=True, eq=False)
class Record:
    """Acceleration at evenly spaced times, from one instrument.

    Attributes
    ----------
    acceleration : ndarray, shape (n,) or (n, channels) [m/s^2], nan where a sample is missing
    interval : float [s]
    source : str, format and origin in words
    start : float [s], time of the first sample by the file's clock, 0 where it has none
    cut : int, samples that were left out because not all channels of the file have them
    instruments : what recorded each channel; none where the file does not say
    directions : where each channel points; none, or None, where that is not said
    """

    acceleration: Array
    interval: float
    channels: tuple[str, ...]
    station: str
    source: str
    unit: str
    repairs: tuple[str, ...] = ()
    start: float = 0.0
    cut: int = 0
    instruments: tuple[str, ...] = ()
    directions: tuple[Direction | None, ...] = ()

    def channel(self, name: str | None) -> Record:
        """The record of one channel.

        Returns
        -------
        Record
            With an acceleration of shape (n,).

        Raises
        ------
        InvalidInput
            If there is no such channel, or several to choose from.
        """
        listed = ", ".join(self.channels)
        if name is None and len(self.channels) > 1:
            given, rule = f"{len(self.channels)} channels ({listed})", "a rock is shaken along one"
            raise InvalidInput(given, rule, "name one of them as motion.component")
        if name is not None and name not in self.channels:
            rule = f"the channels are {listed}"
            raise InvalidInput(f"no channel {name!r}", rule, "name one of them")
        if len(self.channels) == 1:
            return self
        at = self.channels.index(str(name))
        return replace(
            self,
            acceleration=self.acceleration[:, at],
            channels=(str(name),),
            instruments=self.instruments[at : at + 1],
            directions=self.directions[at : at + 1],
        )


def factor(unit: str) -> float:
    """What one of a unit is in m/s^2.

    Returns
    -------
    float [m/s^2]

    Raises
    ------
    InvalidInput
        For counts and volts, which only an instrument's response makes an acceleration, and for
        what is no unit of acceleration.

    Examples
    --------
    >>> factor("cm/sec^2"), factor("m s**-2"), factor("Gal")
    (0.01, 1.0, 0.01)
    """
    name = _plain(unit)
    if is_raw(unit):
        rule = "only the instrument's response makes an acceleration of it"
        remedy = "give miniSEED or SAC with its response (motion.response), or convert it to m/s2"
        raise InvalidInput(f"a record in {unit}", rule, remedy)
    if name not in _KNOWN:
        rule = "it is m/s2, cm/s2, mm/s2, gal, g or mg"
        raise InvalidInput(f"the unit {unit!r}", rule, "correct motion.unit")
    return _KNOWN[name]


def is_acceleration(unit: str) -> bool:
    """Whether a unit is one of acceleration.

    Examples
    --------
    >>> is_acceleration("cm/s^2"), is_acceleration("m")
    (True, False)
    """
    return _plain(unit) in _KNOWN


def is_raw(unit: str) -> bool:
    """Whether a unit is that of an instrument's output, such as counts.

    Examples
    --------
    >>> is_raw("Counts"), is_raw("g")
    (True, False)
    """
    return _plain(unit) in _RAW


def stated(in_file: str | None, given: str | None) -> str:
    """The unit of a file: what it states, or what is given where it states none.

    Raises
    ------
    InvalidInput
        If neither is there, or the two differ.
    """
    if in_file is None and given is None:
        rule = "a number alone is no acceleration"
        raise InvalidInput("a record without a unit", rule, "state it as motion.unit")
    if in_file is not None and given is not None and factor(in_file) != factor(given):
        rule = "the two agree where a file states its unit"
        remedy = "leave motion.unit out, or correct the file"
        raise InvalidInput(f"motion.unit {given} for a file in {in_file}", rule, remedy)
    return str(in_file if in_file is not None else given)


def check_sampling(interval: float, number: float) -> None:
    """Refuse times that no record has, before room is made for its samples.

    Parameters
    ----------
    interval : float [s]
    number : float, of samples, those that are missing included

    Raises
    ------
    InvalidInput
        If the steps or the number are beyond any instrument's.
    """
    if not 0.999 * SHORTEST_INTERVAL <= interval <= 1.001 * LONGEST_INTERVAL:  # rounded, or slow
        given = f"time steps of {interval:.4g} s"
        rule = f"they are from {SHORTEST_INTERVAL:g} to {LONGEST_INTERVAL:g} s"
        remedy = "are the times in seconds, not in samples? correct them, or leave the channel out"
        raise InvalidInput(given, rule, remedy)
    if not number <= MOST_SAMPLES:
        given = f"times that span {number:.3g} samples"
        rule = f"a record has at most {MOST_SAMPLES}"
        raise InvalidInput(given, rule, "correct the times, or cut or resample the record")


def side_by_side(columns: Sequence[Array]) -> Array:
    """Channels as the acceleration of a ``Record``.

    Parameters
    ----------
    columns : sequence of ndarray, shape (n,) each

    Returns
    -------
    ndarray, shape (n,) of one channel, else (n, channels)

    Examples
    --------
    >>> side_by_side([np.zeros(5)]).shape, side_by_side([np.zeros(5), np.ones(5)]).shape
    ((5,), (5, 2))
    """
    return columns[0] if len(columns) == 1 else np.column_stack(columns)


def is_near(said: float, peak: float) -> bool:
    """Whether a peak is the one that a file states, to the digits and offsets that differ."""
    return said / 1.1 <= peak <= 1.1 * said


_RAISED = str.maketrans("²⁻", "2-")


def _plain(unit: str) -> str:
    name = unit.strip().lower().translate(_RAISED).replace("sec", "s")
    return name.replace("^", "").replace("**", "").replace(" ", "").replace("·", "*")


LONGEST_GAP = 0.05
"""Longest gap [s] that a straight line may bridge: half a cycle of 10 Hz."""

FLAT_TOP = 3
"""Samples in a row at the very extreme that make a clipped record ..."""

FLAT, FLICKER = 8, np.geomspace(1e-4, 1e-2, 9)
"""... or so many within one of these shares of it, three of them in a row, as by digits that
flicker or a line taken off, ..."""

ABRUPT, DIGITS, BELOW = 10.0, 3.0, 1.3
"""... if at most 1.3 times as many are within ten times that share, or three of the smallest steps.
A smooth top has twice as many and more. Of 490 recorded shake-table motions, at 25 to 200 Hz, none
looks so, nor rounded to 50 steps from rest to peak or more (30 steps: 2 %); interpolated linearly
from 200 to 1000 Hz, 4 do."""

STRONGEST, WEAKEST = 5.0, 1e-6
"""PGA [g] beyond which a record is in another unit than it says. The strongest ever recorded on the
ground is near 4 g; the quietest noise of a strong-motion instrument is near 1e-6 g."""

DRIFT = 0.02
"""Largest final velocity, as a share of the PGV."""

OFFSET = 0.2
"""Largest final displacement, as a share of the PGD."""


def repaired(record: Record) -> Record:
    """The record of one channel, repaired, or a refusal.

    Short gaps are bridged by a straight line; missing samples at the ends are cut.

    Raises
    ------
    InvalidInput
        For a record with no motion, long gaps, samples that are none, or a PGA in another unit.
    """
    record = _bridged(record)
    values = record.acceleration
    if not len(values) or np.ptp(values) == 0.0:
        raise InvalidInput("a record whose samples are all alike", "it moves", "use another record")
    unit = record.unit if is_acceleration(record.unit) else "m/s2"
    check_samples(values / factor(unit), unit, record.interval)
    pga = float(np.abs(values - np.median(values)).max()) / GRAVITY
    if not WEAKEST <= pga <= STRONGEST:
        raise InvalidInput(
            f"a PGA of {pga:.3g} g read in {record.unit}",
            f"it is between {WEAKEST:g} and {STRONGEST:g} g",
            "state the unit of its numbers as motion.unit: gal is 0.01 m/s2, and counts need the "
            "instrument's response (motion.response)",
        )
    return record


def check_samples(values: Array, unit: str, step: float) -> None:
    """Refuse marks of missing samples, spikes, flat tops, few digits and filled gaps.

    Parameters
    ----------
    values : ndarray, shape (n,), as recorded, in the unit of the file or in counts
    step : float [s]

    Raises
    ------
    InvalidInput
    """
    digits.refuse_mark(values, unit, step)
    digits.refuse_spike(values, unit, step)
    if clipped := _flat_top(values):
        given = f"{clipped} samples in a row within 1 % of the record's extreme ({unit})"
        rule = "an instrument that is not clipped passes its peak"
        raise InvalidInput(given, rule, "use another record or component")
    digits.refuse_coarse(values, unit)
    digits.refuse_still(values, unit, step)


def check_rest(trace: Trace) -> None:
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
        given = f"a motion that ends at {drift:.1%} of its PGV and {offset:.0%} of its PGD"
        remedy = "raise motion.processing.highpass, or set motion.processing.order to standard"
        raise InvalidInput(given, f"it comes to rest, to {DRIFT:.0%} and {OFFSET:.0%}", remedy)


END = 0.1
"""Acceleration at the end of a motion that was made so, as a share of its PGA: the mean of this
share of its samples."""

TILTED = 0.02
"""The same from which on it is told."""


def check_end(trace: Trace) -> tuple[str, ...]:
    """Refuse a motion, taken as it was made, that is under way and accelerated at its end.

    Returns
    -------
    tuple of str, what is to be told of one that is so a little: it acts as a lasting tilt

    Raises
    ------
    InvalidInput
    """
    acceleration, velocity = trace.acceleration, trace.velocity
    last = float(acceleration[-max(1, int(END * len(acceleration))) :].mean())
    drifts = abs(float(velocity[-1])) > DRIFT * float(np.abs(velocity).max())
    share = abs(last) / float(np.abs(acceleration).max())
    if not drifts or share <= TILTED:
        return ()
    given = f"a motion that ends with {last / GRAVITY:.2g} g"
    remedy = "take off the instrument's offset"
    if share > END:
        remedy += ", or give the record to its end"
        raise InvalidInput(given, "the ground rests before and after", remedy)
    return (f"{given}, {share:.0%} of its PGA: as a lasting tilt; {remedy}, if it is one",)


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
    for start, length in digits.runs(~known):
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
    middle, steps = np.median(values), np.abs(np.diff(values))
    zero, ends = FLICKER[-1] * np.abs(values).max(), np.abs(values[[0, -1]]).max()
    written = digits.last(values[np.abs(values) > 0.5 * np.abs(values).max()]).max()
    for size in (values - middle, middle - values):
        top, extreme = float(size.max()), float(values[size.argmax()])
        coarse = min(written, top - size[size < top].max())  # 5.00 beside 0.00123
        least = DIGITS * max(steps[steps > 0.0].min(), coarse)
        for share in (0.0, *FLICKER) if max(abs(extreme), ends) > zero else ():  # rest is none
            at, near = size >= (1.0 - share) * top, size >= top - max(ABRUPT * share * top, least)
            longest = max(length for _, length in digits.runs(at))
            enough = longest >= FLAT_TOP and at.sum() >= (FLAT if share else FLAT_TOP)
            if enough and near.sum() <= BELOW * at.sum():
                return longest
    return 0
