"""Trajectories as they are stored: packed by the workers, unpacked into one ragged dataset."""

from __future__ import annotations

import zlib

import numpy as np

from vsr_core.run.trajectory import Trajectory

SAMPLE = np.dtype(
    [
        ("time", "<f8"),
        ("position", "<f4", 3),
        ("quaternion", "<f4", 4),
        ("velocity", "<f4", 3),
        ("angular_velocity", "<f4", 3),
        ("contact", "i1"),
    ]
)
"""A sample of ``vsr_core.run.trajectory.Trajectory``: micrometres and microradians are enough."""


def pack(trajectory: Trajectory) -> bytes:
    """Compressed samples of a trajectory."""
    samples = np.empty(len(trajectory.time), SAMPLE)
    samples["time"], samples["position"] = trajectory.time, trajectory.position
    samples["quaternion"], samples["velocity"] = trajectory.quaternion, trajectory.velocity
    samples["angular_velocity"], samples["contact"] = (
        trajectory.angular_velocity,
        trajectory.contact,
    )
    return zlib.compress(samples.tobytes(), 1)


def unpack(packed: bytes) -> np.ndarray:
    """Samples of a trajectory, shape (n,) of ``SAMPLE``.

    Returns
    -------
    ndarray, shape (n,)
    """
    return np.frombuffer(zlib.decompress(packed), SAMPLE)
