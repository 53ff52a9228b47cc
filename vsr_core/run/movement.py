"""How a rock left its seat: it rolled over, fell or slid.

The three are those of Cruden & Varnes (1996): what topples turns about a point below its centre of
mass, what falls descends mainly through the air, what slides keeps to the ground. The outcome says
whether a rock left its seat and is not changed by this. All is told from what is recorded of a run.

References
----------
Cruden, D. M. & Varnes, D. J. (1996). Landslide types and processes. Transportation Research Board
Special Report 247, 36-75.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.compiled import records
from vsr_core.judge.on_terrain import DROPPED_SHARE
from vsr_core.judge.track import Track
from vsr_core.outcome import Movement, Outcome

MAINLY = 0.5
"""Share of its way down off its seat that a rock which fell made through the air, at least."""


def no_return_tilt(tipping_angle: Array, toppled_tilt: float) -> float:
    """Tilt [rad] from which no rock comes back to the face that it stood on.

    Beyond its largest static tipping angle the centre of mass is past every edge of the base. A
    squat rock counts as overturned on a flat pedestal before that; then it is the tilt at which
    it does.

    Parameters
    ----------
    tipping_angle : ndarray [rad], in every direction, from the face that the rock stands on
    toppled_tilt : float [rad], beyond which the rock has overturned on a flat pedestal

    Returns
    -------
    float [rad]
    """
    return min(float(tipping_angle.max()), toppled_tilt)


def air_share(height: Array, touched: Mask, radius: float) -> float:
    """Share of a rock's way down off its seat that it made without touching the ground.

    The way is that to where its centre is ``DROPPED_SHARE`` of its radius lower than at the start,
    which makes a rock overturned on a terrain.

    Parameters
    ----------
    height : ndarray, shape (n,) [m], of the centre of mass, at the samples of a trajectory
    touched : ndarray of bool, shape (n,), whether it touched the ground since the sample before
    radius : float [m]

    Returns
    -------
    float, NaN for a rock that did not get so low

    Examples
    --------
    >>> height = np.array([1.0, 0.98, 0.91, 0.6, 0.1])
    >>> round(air_share(height, np.array([True, True, False, True, False]), 0.5), 2)
    0.78
    """
    lower = height[:1] - height > DROPPED_SHARE * radius
    if not lower.any():
        return math.nan
    steps = np.diff(height[: int(np.argmax(lower)) + 1].astype(np.float64))
    in_air = steps[~touched[1 : len(steps) + 1].astype(bool)]
    return float(in_air.sum() / steps.sum())


def movements(outcome: Indices, peak_tilt: Array, in_air: Array, no_return: float) -> Indices:
    """How the rock moved in each of many runs.

    A rock that overturned rolled over if it was tilted, from its pose of rest, beyond
    ``no_return``; else it fell if ``MAINLY`` of its way down off its seat was through the air, and
    slid if not. One that was displaced slid; one that is balanced stayed.

    Parameters
    ----------
    peak_tilt : ndarray of that shape [rad], largest tilt from the pose of rest
    no_return : float [rad], of ``no_return_tilt``

    Returns
    -------
    ndarray of int, of that shape, of ``Movement``; -1 unresolved

    Examples
    --------
    >>> one = int(Outcome.OVERTURNED)
    >>> found = movements(np.array([one, one, one, 0]), np.array([1.2, 0.2, 0.2, 0.2]),
    ...                   np.array([0.0, 0.9, 0.1, np.nan]), 0.6)
    >>> [Movement(kind).name for kind in found]
    ['ROLLED_OVER', 'FELL', 'SLID', 'STAYED']
    """
    overturned = outcome == Outcome.OVERTURNED
    rolled, fell = overturned & (peak_tilt > no_return), overturned & (in_air >= MAINLY)
    slid = overturned | (outcome == Outcome.DISPLACED)
    kinds = (Movement.ROLLED_OVER, Movement.FELL, Movement.SLID, Movement.STAYED)
    found: Indices = np.select([rolled, fell, slid, outcome == Outcome.BALANCED], kinds, -1)
    return found


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


def of_track(track: Track, number: int) -> Trajectory:
    """A trajectory of the first so many states of a track."""
    kept = records.columns(track)[:number]
    turns = Rotation.from_matrix(kept["rotation"]).as_quat()
    jumps = (turns[1:] * turns[:-1]).sum(axis=1) < 0.0  # q and -q are the same turn
    turns[1:] *= np.cumprod(np.where(jumps, -1.0, 1.0))[:, None]
    return Trajectory(
        kept["time"].copy(),
        kept["position"].copy(),
        turns,
        kept["velocity"].copy(),
        kept["spin"].copy(),
        kept["touched"].copy(),
    )
