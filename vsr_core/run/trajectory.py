"""The trajectory of a run over a terrain: what is kept of it, and when the rock touched ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.arrays import Array, Mask
from vsr_core.run.loop import Run
from vsr_core.scene import State

KEPT_TIME = 0.02
"""Time between two samples of a trajectory [s]: 50 Hz."""

IMPACT_SHARE = 0.1
"""Change of velocity by contact in one monitoring interval, beyond what bears the weight, that
makes an impact, in units of sqrt(g radius). The states before and after it are kept too."""

TOUCH_SHARE = 0.01
"""Change of velocity by contact that shows that the rock touched, as a share of what gravity adds
in the same time."""


@dataclass(frozen=True)
class Trajectory:
    """Motion of a rock relative to the terrain, in the site's frame.

    Attributes
    ----------
    time : ndarray, shape (n,) [s], since the start of the shaking
    position : ndarray, shape (n, 3) [m], centre of mass
    quaternion : ndarray, shape (n, 4), x y z w, takes the rest pose to the present one
    velocity : ndarray, shape (n, 3) [m/s]
    angular_velocity : ndarray, shape (n, 3) [rad/s], in the site's axes
    contact : ndarray of bool, shape (n,), whether it touched the ground since the sample before
    """

    time: Array
    position: Array
    quaternion: Array
    velocity: Array
    angular_velocity: Array
    contact: Mask

    @property
    def length(self) -> float:
        """Length of the path of the centre of mass [m]."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())

    @property
    def distance(self) -> float:
        """Straight distance from its start to its end [m]."""
        return float(np.linalg.norm(self.position[-1] - self.position[0]))

    @property
    def largest_speed(self) -> float:
        """Largest speed of the centre of mass [m/s]."""
        return float(np.linalg.norm(self.velocity, axis=1).max())


class Recorder:
    """Keeps states of a run: evenly in time, and besides before and after each impact.

    Parameters
    ----------
    along : ndarray, shape (3,), unit vector of the shaking
    """

    def __init__(self, start: State, along: Array) -> None:
        self._along = along
        self._kept: list[tuple[float, State, bool]] = [(0.0, start, True)]
        self._before, self._touched = start, True

    def keep(self, time: float, state: State) -> None:
        """Keep a state at which the rock touches the ground, at a time [s]."""
        self._kept.append((time, state, True))

    def note(self, run: Run, since: int) -> None:
        """Note contact since the sample ``since``, and keep the state if its time has come."""
        before, state = self._before, run.state
        start, duration = since * run.sampled.interval, (run.sample - since) * run.sampled.interval
        given = -run.values[since : run.sample].sum() * run.sampled.interval * self._along
        given[2] -= GRAVITY * duration
        change = float(np.linalg.norm(state.velocity - before.velocity - given))
        touched_before = self._touched
        self._touched |= change > TOUCH_SHARE * GRAVITY * duration
        weight = GRAVITY * duration
        impact = change > weight + IMPACT_SHARE * math.sqrt(GRAVITY * run.rock.radius)
        if impact and self._kept[-1][0] < start:
            self._kept.append((start, before, touched_before))
        if impact or run.time >= self._kept[-1][0] + KEPT_TIME - 1e-9:
            self._kept.append((run.time, state, self._touched))
            self._touched = False
        self._before = state

    def go_on_from(self, state: State) -> None:
        """The rock was set into another state, which is no contact."""
        self._before = state

    def trajectory(self, run: Run) -> Trajectory:
        """What was kept, with the present state as its end."""
        if self._kept[-1][0] < run.time:
            self._kept.append((run.time, run.state, self._touched))
        return joined(self._kept)


def joined(kept: Sequence[tuple[float, State, bool]]) -> Trajectory:
    """A trajectory of times [s], states, and whether the rock touched the ground up to each.

    Parameters
    ----------
    kept : sequence of (float, State, bool), at least one, times ascending
    """
    times, states, contact = zip(*kept, strict=True)
    return Trajectory(
        np.array(times),
        np.array([state.position for state in states]),
        Rotation.from_matrix([state.rotation for state in states]).as_quat(),
        np.array([state.velocity for state in states]),
        np.array([state.angular_velocity for state in states]),
        np.array(contact),
    )
