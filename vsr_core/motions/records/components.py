"""A recorded motion along several axes: the components of one instrument, up to three."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.records.directions import check_directions
from vsr_core.motions.records.record import Record
from vsr_core.motions.records.trace import RecordedMotion, Trace


@dataclass(frozen=True, eq=False)
class Components:
    """A recorded motion along x, y and z, the first two horizontal.

    Attributes
    ----------
    acceleration : ndarray, shape (n, 3) [m/s^2], as recorded; zero where nothing was
    interval : float [s]
    azimuth : float [rad], of x as recorded, counter-clockwise from the table's +x
    """

    acceleration: Array
    interval: float
    azimuth: float = 0.0

    def level(self) -> Components:
        """The same without its vertical component."""
        return replace(self, acceleration=self.acceleration * [1.0, 1.0, 0.0])

    def scaled(self, pga: float) -> GroundMotion:
        """The motion of a table, all components by one factor; of one axis if that is along x.

        Parameters
        ----------
        pga : float [g], that of the larger horizontal component as recorded
        """
        factor = pga * GRAVITY / float(np.abs(self.acceleration[:, :2]).max())
        x, y, z = factor * self.acceleration.T
        cos, sin = math.cos(self.azimuth), math.sin(self.azimuth)
        along = cos * x - sin * y, sin * x + cos * y, z
        one, two, three = (RecordedMotion(Trace(values, self.interval)) for values in along)
        if not (along[1].any() or z.any()):
            return one
        return ComponentMotion((one, two, three))


@dataclass(frozen=True, eq=False)
class ComponentMotion(GroundMotion):
    """Recorded motion along x, y and z of a table that does not turn.

    Two motions are the same only if they are one object.
    """

    along: tuple[RecordedMotion, RecordedMotion, RecordedMotion]

    @property
    def columns(self) -> int:
        """Along x, y and z."""
        return 3

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return self.along[0].duration

    @property
    def shortest_time(self) -> float:
        """Ten samples [s]: a time step then skips none."""
        return self.along[0].shortest_time

    @cached_property
    def peak_acceleration(self) -> float:
        """Largest length of the acceleration [m/s^2]."""
        samples = [one.trace.acceleration for one in self.along]
        return float(np.linalg.norm(samples, axis=0).max())

    def acceleration(self, t: Array) -> Array:
        """Acceleration [m/s^2] at times ``t`` [s], shape (n, 3); zero outside the record."""
        return np.column_stack([one.acceleration(t) for one in self.along])

    def velocity(self, t: Array) -> Array:
        """Velocity [m/s] at times ``t`` [s], shape (n, 3); zero outside the record."""
        return np.column_stack([one.velocity(t) for one in self.along])


def check_together(components: Mapping[str, Record]) -> None:
    """Refuse components that are not of one instrument and one time, each with its own direction.

    Parameters
    ----------
    components : records of one channel as read, by their axes

    Raises
    ------
    InvalidInput
        With what differs.
    """
    _check_instruments(components)
    _check_samples(components)
    check_directions(components)
    first, one = next(iter(components.items()))
    for name, other in components.items():
        apart = {
            "length": (len(one.acceleration), len(other.acceleration), 0.0, "samples"),
            "time step": (one.interval, other.interval, 1e-6 * one.interval, "s"),
            "start": (one.start, other.start, 0.5 * one.interval, "s"),
        }
        for what, (a, b, near, unit) in apart.items():
            if abs(a - b) > near:
                given = f"a {what} of {a:.10g} {unit} in {first} and of {b:.10g} {unit} in {name}"
                raise _apart(given)
        if other.cut:
            raise _apart(f"channels of one file of which {other.cut} samples are not in all")
        if not np.isfinite(other.acceleration[[0, -1]]).all():
            raise _apart(f"{name} without its first or last sample")


def _check_instruments(components: Mapping[str, Record]) -> None:
    named = [(axis, one.instruments[0]) for axis, one in components.items() if one.instruments]
    for (first, one), (axis, other) in pairwise(named):
        if one != other:
            given = f"{first} of {one!r} and {axis} of {other!r}"
            rule = "the components of a record are of one instrument and event"
            raise InvalidInput(given, rule, "name those that belong together")


def _check_samples(components: Mapping[str, Record]) -> None:
    for (first, one), (axis, other) in combinations(components.items(), 2):
        if np.array_equal(one.acceleration, other.acceleration, equal_nan=True):
            given = f"the same samples along {first} and {axis}"
            remedy = "name another channel or file"
            raise InvalidInput(given, "each component has its own", remedy)


def _apart(given: str) -> InvalidInput:
    rule = "the components of a record share length, time step and start"
    return InvalidInput(given, rule, "cut or resample them to what all have")
