"""Largest tilt and slip of a rock, looked at in every step, and between steps where they turn.

Places are known in the middle of each step. Where one is farther than those before and after it, a
parabola through the three has its top between them: as the step, of second order.
"""

from __future__ import annotations

import math
from typing import Annotated

from vsr_core.arrays import Array
from vsr_core.compiled import records
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.records import Vector
from vsr_core.engines.nonsmooth.body import RockState
from vsr_core.rock.body import Rock


class Peaks:
    """Largest tilt and slip so far, as squares: of tilt t, 1 - cos(t) = 2 sin(t / 2)^2."""

    upward: Vector  # direction of the rock that is up where its tilt is zero, in principal axes
    foot: Vector  # m, from the centre of mass to the middle of the base, likewise
    start: Annotated[Array, (2,)]  # m, where that was at the start
    lean: Annotated[Array, (3,)]  # at the last place, the one before, and the largest
    way: Annotated[Array, (3,)]  # m^2, likewise


def room(rock: Rock, upward: Array) -> Peaks:
    """Room for the peaks of a rock.

    Parameters
    ----------
    upward : ndarray, shape (3,), direction of the rock that is up where its tilt is zero
    """
    peaks = records.room(Peaks)
    peaks.upward[:] = (rock.axes * upward[:, None]).sum(axis=0)
    peaks.foot[:] = -rock.height * rock.axes[2]
    return peaks


@compiled
def begin(peaks: Peaks, rock: RockState) -> None:
    """Begin where a rock is that has not been stepped yet."""
    x, y = _foot(peaks, rock)
    peaks.start[0], peaks.start[1] = x, y
    lean, way = _lean(peaks, rock), 0.0
    for k in range(3):
        peaks.lean[k], peaks.way[k] = lean, way


@compiled
def look(peaks: Peaks, rock: RockState) -> None:
    """Look where a rock is after a step."""
    x, y = _foot(peaks, rock)
    x, y = x - peaks.start[0], y - peaks.start[1]
    _take(peaks.lean, _lean(peaks, rock))
    _take(peaks.way, x * x + y * y)


@compiled
def tilt_and_slip(peaks: Peaks) -> tuple[float, float]:
    """Largest so far [rad], [m]."""
    return math.acos(max(-1.0, 1.0 - peaks.lean[2])), math.sqrt(peaks.way[2])


@compiled
def _lean(peaks: Peaks, rock: RockState) -> float:
    upward, rotation = peaks.upward, rock.rotation
    x, y, z = rotation[2, 0] * upward[0], rotation[2, 1] * upward[1], rotation[2, 2] * upward[2]
    return max(0.0, 1.0 - (x + y + z))


@compiled
def _foot(peaks: Peaks, rock: RockState) -> tuple[float, float]:
    """Where the middle of the base is along x and y [m]."""
    foot, place, rotation = peaks.foot, rock.place, rock.rotation
    x = rotation[0, 0] * foot[0] + rotation[0, 1] * foot[1] + rotation[0, 2] * foot[2]
    y = rotation[1, 0] * foot[0] + rotation[1, 1] * foot[1] + rotation[1, 2] * foot[2]
    return place[0] + x, place[1] + y


@compiled
def _take(known: Array, now: float) -> None:
    """Take a square: the one before it counts, as a rock is now between both, or the top there."""
    top, before = known[0], known[1]
    known[0], known[1] = now, top
    if top > before and top > now:
        a, b, c = math.sqrt(before), math.sqrt(top), math.sqrt(now)
        crest = b + (a - c) ** 2 / (8.0 * (2.0 * b - a - c))
        top = crest * crest
    known[2] = max(known[2], top)
