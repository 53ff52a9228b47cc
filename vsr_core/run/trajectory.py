"""The trajectory of a run over a terrain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core.arrays import Array, Mask
from vsr_core.compiled import records
from vsr_core.judge.track import Track


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
