"""Motion of one rock, from the dataset of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.colors import LinearSegmentedColormap
from scipy.spatial.transform import Rotation, Slerp

from pipeline.stages.datasets.displaced_runs import chosen
from vsr_core.arrays import Array

SPEEDS = LinearSegmentedColormap.from_list(
    "speed", ["#3f51c7", "#8e44b8", "#d4518a", "#f58a49", "#f9d43c"]
)
"""From slow to fast: lighter with speed, and no colour of the ground."""


@dataclass(frozen=True, eq=False)
class Track:
    """Motion of one rock.

    Attributes
    ----------
    time : ndarray, shape (n,) [s]
    position : ndarray, shape (n, 3) [m], centre of mass
    turn : Rotation, n of them, from the rest pose
    speed : ndarray, shape (n,) [m/s]
    """

    time: Array
    position: Array
    turn: Rotation
    speed: Array

    def places(self, times: Array) -> Array:
        """Centre of mass at times.

        Parameters
        ----------
        times : ndarray, shape (k,) [s]

        Returns
        -------
        ndarray, shape (k, 3) [m]
        """
        return np.stack([np.interp(times, self.time, part) for part in self.position.T], axis=-1)

    def poses(self, times: Array, vertices: Array) -> Array:
        """Vertices of the rock at times.

        Parameters
        ----------
        times : ndarray, shape (k,) [s]
        vertices : ndarray, shape (n, 3) [m], at rest, from the centre of mass

        Returns
        -------
        ndarray, shape (k, n, 3) [m]
        """
        matrices = Slerp(self.time, self.turn)(times).as_matrix()
        return vertices @ np.swapaxes(matrices, 1, 2) + self.places(times)[:, None]


def track(displacement: xr.Dataset, run: int) -> Track:
    """Motion of one run."""
    own = chosen(displacement, np.arange(displacement.sizes["run"]) == run)
    return Track(
        own["time"].values,
        np.stack([own[name].values for name in "xyz"], axis=-1),
        Rotation.from_quat(own["quaternion"].values),
        own["speed"].values,
    )


def pose_times(motion: Track, radius: float) -> Array:
    """Times of poses that are about the size of the rock apart.

    Parameters
    ----------
    radius : float [m], of the rock

    Returns
    -------
    ndarray, shape (n,) [s], start and end among them
    """
    length = float(np.linalg.norm(np.diff(motion.position, axis=0), axis=1).sum())
    apart = max(length / 11.0, min(1.6 * radius, length / 3.0))
    chosen = [0]
    for number, place in enumerate(motion.position):
        if np.linalg.norm(place - motion.position[chosen[-1]]) > apart:
            chosen.append(number)
    last = motion.position[-1]
    if len(chosen) > 1 and np.linalg.norm(last - motion.position[chosen[-1]]) < 0.6 * apart:
        chosen.pop()
    return np.unique(motion.time[[*chosen, -1]])
