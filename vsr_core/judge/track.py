"""What is kept of a run over a terrain: states evenly in time, and before and after each impact."""

from __future__ import annotations

import math

from vsr_core import GRAVITY
from vsr_core.compiled import records
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.records import Matrix, Records, Vector
from vsr_core.compiled.vectors import assign, assign_matrix
from vsr_core.judge.record import RunRecord

KEPT_TIME = 0.02
"""Time between two samples of a trajectory [s]: 50 Hz."""

IMPACT_SHARE = 0.1
"""Change of velocity by contact in one monitoring interval, beyond what bears the weight, that
makes an impact, in units of sqrt(g radius). The states before and after it are kept too."""

TOUCH_SHARE = 0.01
"""Change of velocity by contact that shows that the rock touched, as a share of what gravity adds
in the same time."""


class Sample:
    """A state of a rock, and whether it touched the ground since the sample before."""

    time: float  # s
    position: Vector  # m, of the centre of mass
    rotation: Matrix  # from the rest pose
    velocity: Vector  # m/s
    spin: Vector  # rad/s
    touched: bool


Track = Records[Sample]
"""Those kept, then the state of now as the last but one, and that of before."""


def room(intervals: int) -> Track:
    """Room for a run of so many monitoring intervals, which keeps two states in each at most."""
    return records.rows(Sample, 2 * intervals + 6)


@compiled
def begin(track: Track, record: RunRecord, time: float) -> None:
    """Keep the start, and where the run begins if that is later.

    Parameters
    ----------
    time : float [s], when it begins
    """
    now = track[len(track) - 1]
    _write(now, record, 0.0)
    now.touched = True
    track[0] = now
    record.kept = 1
    if time > 0.0:
        now.time = time
        track[1] = now
        record.kept = 2


@compiled
def note(track: Track, record: RunRecord, time: float, radius: float) -> None:
    """Note contact in a monitoring interval, and keep the state of now if its time has come.

    Parameters
    ----------
    time : float [s]
    radius : float [m], of the rock
    """
    now, before = track[len(track) - 2], track[len(track) - 1]
    _write(now, record, time)
    square = 0.0
    for k in range(3):
        square += (now.velocity[k] - before.velocity[k] - record.change[k]) ** 2
    change, weight = math.sqrt(square), GRAVITY * (time - before.time)
    now.touched = before.touched or change > TOUCH_SHARE * weight
    impact = change > weight + IMPACT_SHARE * math.sqrt(GRAVITY * radius)
    if impact and track[record.kept - 1].time < before.time:
        track[record.kept] = before
        record.kept += 1
    if impact or time >= track[record.kept - 1].time + KEPT_TIME - 1e-9:
        track[record.kept] = now
        record.kept += 1
        now.touched = False
    track[len(track) - 1] = now


@compiled
def end(track: Track, record: RunRecord) -> None:
    """Keep the state of now as the last one, unless it is kept."""
    now = track[len(track) - 1]
    if track[record.kept - 1].time < now.time:
        track[record.kept] = now
        record.kept += 1


@compiled
def _write(sample: Sample, record: RunRecord, time: float) -> None:
    sample.time = time
    assign(sample.position, record.position)
    assign_matrix(sample.rotation, record.rotation)
    assign(sample.velocity, record.velocity)
    assign(sample.spin, record.spin)
