"""What is kept of a run over a terrain, in compiled code; the rules of ``trajectory.Recorder``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.run.trajectory import IMPACT_SHARE, KEPT_TIME, TOUCH_SHARE, Trajectory

SAMPLE = np.dtype(
    [
        ("time", float),
        ("place", float, 3),
        ("quaternion", float, 4),
        ("velocity", float, 6),
        ("touched", bool),
    ]
)
"""A state [s, m, m/s, rad/s]; the quaternion is w x y z, and takes principal axes to the site's."""

Track = Any
"""Array of ``SAMPLE``: those kept, then one of now, the last but one, and one of before."""

AHEAD = 2
"""Places at the end of a track for the states of now and of before."""


def room(intervals: int) -> Track:
    """Room for a run of so many monitoring intervals, which keeps two states in each at most."""
    return np.zeros(2 * intervals + 4 + AHEAD, SAMPLE)


@compiled
def note(track: Track, kept: int, given: Array, duration: float, radius: float) -> int:
    """Note contact in a monitoring interval, and keep the state of now if its time has come.

    Parameters
    ----------
    kept : int, states kept so far, at least one
    given : ndarray, shape (3,) [m/s], change of velocity in it by weight and shaking
    duration : float [s], of the interval
    radius : float [m], of the rock

    Returns
    -------
    int, states kept now
    """
    now, before = track[len(track) - 2], track[len(track) - 1]
    change = 0.0
    for k in range(3):
        change += (now.velocity[k] - before.velocity[k] - given[k]) ** 2
    change = math.sqrt(change)
    weight = GRAVITY * duration
    now.touched = before.touched or change > TOUCH_SHARE * weight
    impact = change > weight + IMPACT_SHARE * math.sqrt(GRAVITY * radius)
    if impact and track[kept - 1].time < before.time:
        track[kept] = before
        kept += 1
    if impact or now.time >= track[kept - 1].time + KEPT_TIME - 1e-9:
        track[kept] = now
        kept += 1
        now.touched = False
    track[len(track) - 1] = now
    return kept


@compiled
def end(track: Track, kept: int) -> int:
    """Keep the state of now as the last one, unless it is kept; the number of states.

    Parameters
    ----------
    kept : int, states kept so far
    """
    now = track[len(track) - 1]
    if track[kept - 1].time < now.time:
        track[kept] = now
        kept += 1
    return kept


def trajectory(track: Track, axes: Array) -> Trajectory:
    """A trajectory of the states kept.

    Parameters
    ----------
    axes : ndarray, shape (3, 3), principal axes of the rock in its rest pose, as columns
    """
    from_axes = Rotation.from_matrix(axes).inv()
    turns = Rotation.from_quat(track["quaternion"], scalar_first=True) * from_axes
    return Trajectory(
        track["time"].copy(),
        track["place"].copy(),
        turns.as_quat(),
        track["velocity"][:, :3].copy(),
        track["velocity"][:, 3:].copy(),
        track["touched"].copy(),
    )
