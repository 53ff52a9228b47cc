"""Other ways of doing the same, to compare accuracy and cost with: one module each.

Each uses its library plainly, as someone who knows it would write the experiment: a world with a
rock at rest, the pulse, and ``AFTER`` seconds more. None proves an outcome or scales the rock; that
is what they are compared with.

A module imports its library only inside ``build``, so that methods whose library is not installed
can still be named and listed.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
import pkgutil
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, cast

import numpy as np

from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock.body import Rock, touching
from vsr_core.scene import Scene

Setting = dict[str, float]
Test = Callable[[CosinePulse], float]

AFTER = 4.0
"""Time simulated after the pulse [s], as in the scripts of the published set-up."""

LYING = 1.3
"""Tilt at which a run may end [rad]: beyond it a rock lies."""

SLAB = (40.0, 40.0, 2.0)
"""Size of the pedestal where it is a slab [m]; no rock gets to its edges."""

MONITOR_EVERY = 10
"""Monitoring interval of the tilt, in time steps."""


class Method(Protocol):
    """What a method's module offers."""

    LABEL: str
    NEEDS: tuple[str, ...]
    SWEEP: tuple[Setting, ...]

    def build(self, scene: Scene, setting: Setting) -> Test:
        """Prepare a box or hull on a level pedestal for shaking tests.

        Returns
        -------
        Test
            Runs one pulse from rest and returns the largest tilt [rad], nan if it diverged.
        """


def names() -> list[str]:
    """Names of the methods there are, installed or not."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__))


def load(name: str) -> Method:
    """Method by name; does not import its libraries."""
    return cast(Method, importlib.import_module(f"{__name__}.{name}"))


def missing(name: str) -> tuple[str, ...]:
    """What a method needs and is not installed."""
    return tuple(need for need in load(name).NEEDS if importlib.util.find_spec(need) is None)


def accelerations(pulse: CosinePulse, time_step: float) -> Array:
    """Mean acceleration of the table in each step of a run.

    Means give the table its exact velocity after every step, whether or not steps fill the pulse.

    Parameters
    ----------
    time_step : float [s]

    Returns
    -------
    ndarray, shape (steps,) [m/s^2]
    """
    steps = math.ceil((pulse.duration + AFTER) / time_step)
    times: Array = time_step * np.arange(steps + 1, dtype=np.float64)
    return np.diff(pulse.velocity(times)) / time_step


def largest_tilt(
    advance: Callable[[Iterable[float]], None],
    tilt: Callable[[], float],
    drive: Array,
    until: float = LYING,
) -> float:
    """Run to the end of ``drive``, or to the tilt ``until``.

    Parameters
    ----------
    tilt : reads the present tilt [rad], nan if the method diverged
    drive : ndarray, shape (steps,), what the method drives its table by, one value a step
    until : float [rad]

    Returns
    -------
    float [rad]
        The largest tilt read; nan if the method diverged.
    """
    values, largest = drive.tolist(), 0.0
    for first in range(0, len(values), MONITOR_EVERY):
        advance(values[first : first + MONITOR_EVERY])
        now = tilt()
        if math.isnan(now):
            return now
        largest = max(largest, now)
        if largest > until:
            break
    return largest


def tilt_of(quaternion: Sequence[float]) -> float:
    """Tilt of a rock from the vertical.

    Parameters
    ----------
    quaternion : four numbers, the real part first

    Returns
    -------
    float [rad]
        nan if one of x and y is.

    Examples
    --------
    >>> tilt_of((0.0, 1.0, 0.0, 0.0)) == math.pi, tilt_of((1.0, math.nan, 0.0, 0.0))
    (True, nan)
    """
    _, x, y, _ = quaternion
    # In this order: of nan and a number, max returns the first.
    return math.acos(max(1.0 - 2.0 * (x * x + y * y), -1.0))


def inertia(rock: Rock) -> Array:
    """Inertia tensor in the axes of the rest pose.

    Returns
    -------
    ndarray, shape (3, 3) [kg m^2]
    """
    return rock.axes * rock.inertia @ rock.axes.T


def touching_corners(rock: Rock) -> Array:
    """Corners that can touch a level pedestal up to a tilt of ``LYING``.

    Returns
    -------
    ndarray, shape (n, 3) [m]
    """
    return rock.hull.vertices[touching(rock.hull, LYING)]
