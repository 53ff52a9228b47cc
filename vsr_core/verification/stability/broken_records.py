"""Broken records: holes, jumps, spikes, and far too many samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse
from vsr_core.run.cases import Settings
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import box
from vsr_core.verification.stability import ExtremeCase, Measured
from vsr_core.verification.stability._trial import (
    BOTH,
    decided,
    prepared,
    respond,
    same,
    slip,
    step_of,
)

FRICTION = 0.3

REFERENCE = "farthest slip [m] of a squat block; a sliding mass under the same record; relative"
NONE = "an outcome without the checks before a run; there must be none"


@dataclass(frozen=True)
class BrokenRecord(GroundMotion):
    """Samples of an acceleration, straight between them.

    Attributes
    ----------
    interval : float [s]
    samples : ndarray, shape (n,) [m/s^2], the first at t = 0
    """

    interval: float
    samples: Array

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return self.interval * (len(self.samples) - 1)

    @property
    def shortest_time(self) -> float:
        """Ten samples [s]: one is the longest hold that takes in all of them."""
        return 10.0 * self.interval

    @property
    def peak_acceleration(self) -> float:
        """Largest absolute acceleration [m/s^2]."""
        return float(np.abs(self.samples).max())

    def acceleration(self, t: Array) -> Array:
        """Acceleration [m/s^2] at times ``t`` [s]; zero outside the record."""
        times = self.interval * np.arange(len(self.samples))
        found: Array = np.interp(t, times, self.samples, left=0.0, right=0.0)
        return found

    def velocity(self, t: Array) -> Array:
        """Velocity [m/s] at times ``t`` [s], by the trapezoidal rule."""
        middle = 0.5 * (self.samples[1:] + self.samples[:-1]) * self.interval
        times = self.interval * np.arange(len(self.samples))
        found: Array = np.interp(t, times, np.concatenate([[0.0], np.cumsum(middle)]))
        return found


def _whole(rate: float, pga_g: float = 0.6) -> BrokenRecord:
    """Pulse of 0.3 s PGV/PGA, sampled at ``rate`` [1/s], with half a second around it."""
    pulse, interval = CosinePulse.from_g(pga_g, 0.3), 1.0 / rate
    times = np.arange(0.0, pulse.duration + 1.0, interval)
    return BrokenRecord(interval, pulse.acceleration(times - 0.5))


def _with(record: BrokenRecord, where: slice, value: float) -> BrokenRecord:
    samples = record.samples.copy()
    samples[where] = value
    return replace(record, samples=samples)


def _slips(make: Callable[[], BrokenRecord], engine: str = "bullet") -> Measured:
    rock, record = box(2.0, 2.0, 0.5), make()
    scene = Scene(rock, Contact(FRICTION))
    response = respond(scene, record, step_of(rock), engine, reduce=False)
    expected = slip(record, FRICTION)
    return same(response.slip, expected, expected)


def _unchecked(make: Callable[[], BrokenRecord], engine: str) -> Measured:
    """What ``simulate`` itself makes of it: never an outcome."""
    rock = box(1.0, 1.0, 2.0)
    case = prepared(Scene(rock, Contact(0.6)))
    outcome = decided(simulate(case, make(), Settings(step_of(rock), engine=engine))).outcome
    return Measured(float(outcome), -1.0, math.inf, outcome.name.lower())


def _broken(value: float, count: int, first: int = 200) -> BrokenRecord:
    return _with(_whole(200.0), slice(first, first + count), value)


class _Unaware(BrokenRecord):
    """A record whose integrals and peaks leave out what is not a number."""

    @property
    def peak_acceleration(self) -> float:
        """Largest absolute acceleration [m/s^2]."""
        return float(np.nanmax(np.abs(self.samples)))


def _unaware(first: int) -> BrokenRecord:
    whole = _broken(math.nan, 50, first)
    return _Unaware(whole.interval, whole.samples)


def _slip(
    name: str,
    parameter: str,
    value: float,
    unit: str,
    make: Callable[[], BrokenRecord],
    engine: str = "bullet",
) -> ExtremeCase:
    measure = partial(_slips, make, engine)
    return ExtremeCase(name, parameter, value, unit, REFERENCE, 0.02, measure)


def _lasting_jump() -> BrokenRecord:
    return _with(_whole(200.0), slice(300, None), 0.4 * GRAVITY)


def _offset() -> BrokenRecord:
    return BrokenRecord(0.005, _whole(200.0).samples + 0.2 * GRAVITY)


CASES = (
    *(
        _slip(what, "samples", float(n), "1", partial(_broken, value, n))
        for what, value, n in (
            ("one sample is not a number", math.nan, 1),
            ("a hole of 50 samples", math.nan, 50),
            ("one sample is infinite", math.inf, 1),
            ("a hole filled with zeros", 0.0, 50),
            ("a spike of 50 g", 50.0 * GRAVITY, 1),
        )
    ),
    *(
        ExtremeCase(f"{what}, unchecked in {engine}", "samples", float(n), "1", NONE, 0.0,
                    partial(_unchecked, partial(_broken, value, n), engine))
        for engine in BOTH
        for what, value, n in (("a hole", math.nan, 50), ("an infinite sample", math.inf, 1))
    ),
    *(
        ExtremeCase(f"a hole {where} the motion, hidden from its bounds", "samples", 50.0, "1",
                    NONE, 0.0, partial(_unchecked, partial(_unaware, first), "bullet"))
        for where, first in (("before", 20), ("in", 200))
    ),
    _slip("a jump to 0.4 g that stays", "offset", 0.4, "g", _lasting_jump),
    _slip("an offset below friction", "offset", 0.2, "g", _offset),
    *(
        _slip(f"{rate:g} samples a second", "rate", rate, "1/s", partial(_whole, rate))
        for rate in (20.0, 200.0, 20000.0)
    ),
    _slip("20,000 samples a second in mujoco", "rate", 2e4, "1/s", partial(_whole, 2e4), "mujoco"),
    _slip("no samples but one", "samples", 1.0, "1", partial(BrokenRecord, 0.005, np.zeros(1))),
)  # fmt: skip
