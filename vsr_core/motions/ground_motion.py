"""What a motion of the table offers to a run, along one axis or in up to six."""

from __future__ import annotations

from abc import abstractmethod
from typing import Protocol

from vsr_core.arrays import Array


class GroundMotion(Protocol):
    """Motion of the table, along +x or in several axes; it rests outside ``[0, duration]``."""

    @property
    def columns(self) -> int:
        """Numbers in a sample of the acceleration.

        1 is along +x, 3 are along x, y and z. 9 are of a table that turns: the acceleration as of
        one in translation, the angular velocity [rad/s] and its rate [rad/s^2].
        """
        return 1

    @property
    @abstractmethod
    def duration(self) -> float:
        """Length of the motion [s]."""

    @property
    @abstractmethod
    def shortest_time(self) -> float:
        """Time scale [s] that a time step has to resolve."""

    @property
    @abstractmethod
    def peak_acceleration(self) -> float:
        """Largest absolute acceleration [m/s^2]."""

    @abstractmethod
    def acceleration(self, t: Array) -> Array:
        """Acceleration [m/s^2] at times ``t`` [s], in the table's axes.

        Returns
        -------
        ndarray, shape of ``t``, with a last axis of ``columns`` if there are several
        """

    @abstractmethod
    def velocity(self, t: Array) -> Array:
        """Velocity [m/s] at times ``t`` [s], shape of ``t``; with several axes (n, 3)."""
