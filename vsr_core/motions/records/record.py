"""A recorded acceleration as read, and the units in which files state it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.named_columns import MOST_SAMPLES

_FACTORS = {
    1.0: ("m/s2", "m/s/s", "ms-2", "m*s-2", "meter/second2"),
    0.01: ("cm/s2", "cm/s/s", "cms-2", "cm*s-2", "gal", "gals"),
    0.001: ("mm/s2", "mm/s/s", "mms-2", "mm*s-2"),
    GRAVITY: ("g", "standard_gravity"),
    0.001 * GRAVITY: ("mg",),
}
_KNOWN = {name: factor for factor, names in _FACTORS.items() for name in names}

_RAW = ("counts", "count", "v", "volt", "volts", "mv")

SHORTEST_INTERVAL, LONGEST_INTERVAL = 1e-6, 1.0
"""Time steps of a record [s]: no instrument is faster, and no shaking is told by slower ones."""


@dataclass(frozen=True, eq=False)
class Record:
    """Acceleration at evenly spaced times, from one instrument.

    Attributes
    ----------
    acceleration : ndarray, shape (n,) or (n, channels) [m/s^2], nan where a sample is missing
    interval : float [s]
    source : str, format and origin in words
    """

    acceleration: Array
    interval: float
    channels: tuple[str, ...]
    station: str
    source: str
    unit: str
    repairs: tuple[str, ...] = ()

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
            raise InvalidInput(
                f"{len(self.channels)} channels ({listed})",
                "a rock is shaken along one",
                "name one of them as motion.component",
            )
        if name is not None and name not in self.channels:
            raise InvalidInput(
                f"no channel {name!r}", f"the channels are {listed}", "name one of them"
            )
        if len(self.channels) == 1:
            return self
        at = self.channels.index(str(name))
        return replace(self, acceleration=self.acceleration[:, at], channels=(str(name),))


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
        raise InvalidInput(
            f"a record in {unit}",
            "only the instrument's response makes an acceleration of it",
            "give the response (motion.response), or convert the record to m/s2",
        )
    if name not in _KNOWN:
        raise InvalidInput(
            f"the unit {unit!r}", "it is m/s2, cm/s2, mm/s2, gal, g or mg", "correct motion.unit"
        )
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
        raise InvalidInput(
            "a record without a unit",
            "a number alone is no acceleration",
            "state it as motion.unit",
        )
    if in_file is not None and given is not None and factor(in_file) != factor(given):
        raise InvalidInput(
            f"motion.unit {given} for a file in {in_file}",
            "the two agree where a file states its unit",
            "leave motion.unit out, or correct the file",
        )
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
    if not SHORTEST_INTERVAL <= interval <= LONGEST_INTERVAL:
        raise InvalidInput(
            f"time steps of {interval:.3g} s",
            f"they are from {SHORTEST_INTERVAL:g} to {LONGEST_INTERVAL:g} s",
            "correct the times, which are in seconds",
        )
    if not number <= MOST_SAMPLES:
        raise InvalidInput(
            f"times that span {number:.3g} samples",
            f"a record has at most {MOST_SAMPLES}",
            "correct the times, or cut the record to the shaking",
        )


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


def _plain(unit: str) -> str:
    name = unit.strip().lower().replace("sec", "s").replace("^", "").replace("**", "")
    return name.replace(" ", "").replace("·", "*")
