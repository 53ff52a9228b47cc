"""What an engine offers to the rest of the program: its module, and the worlds that it builds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from vsr_core.arrays import Array
from vsr_core.scene import Scene, State


@dataclass(frozen=True)
class Solver:
    """How hard an engine's contact solver works in each step.

    Attributes
    ----------
    residual : float, in the engine's own measure, below which it stops earlier
    """

    iterations: int
    residual: float


@dataclass(frozen=True)
class Ladder:
    """Time steps at which an engine is measured, in units of sqrt(radius / g).

    Attributes
    ----------
    shares : tuple of float, those tried, coarsest first
    coarse : float, at which most scenes are right to 1 %
    reference, second : float, fine enough to be compared with; the second is no simple multiple
    longest : float, at which a released block or hull still swings back as it should
    """

    shares: tuple[float, ...]
    coarse: float
    reference: float
    second: float
    longest: float


class World(Protocol):
    """A scene under way, in the table's own frame.

    In a scene with a drive the samples that ``advance`` takes are velocity commands to the servo
    [m/s], one per control period, and the world is a ``DrivenWorld``.
    """

    def advance(self, samples: Iterable[float], /) -> None:
        """Step through a motion along +x.

        Parameters
        ----------
        samples : iterable of float [m/s^2], acceleration of the table in the middle of each hold
        """

    def shake(self, acceleration: Sequence[Sequence[float]], /) -> None:
        """Step through a motion along three axes.

        Parameters
        ----------
        acceleration : sequence of three numbers a sample [m/s^2], along x, y and z
        """

    def state(self) -> State:
        """Present state.

        Returns
        -------
        State
            Its entries are not finite if the engine diverged.
        """

    def footing(self) -> tuple[Array, Array]:
        """Points that bore the rock in the last step: relative to the table, or in a site's frame.

        Returns
        -------
        tuple of ndarray, shape (k, 3) [m], and ndarray, shape (k, 3)
            Places, and the direction in which the ground pushed there.
        """


class WatchingWorld(World, Protocol):
    """A scene under way whose rock is looked at in every step."""

    def peaks(self) -> tuple[float, float]:
        """Largest tilt and slip since the start.

        Returns
        -------
        tuple of float [rad, m]
            Slip is the way of the middle of the base along the pedestal or terrain.
        """


class TurningWorld(World, Protocol):
    """A scene under way on a table that turns too."""

    def turn(self, samples: Sequence[Sequence[float]], /) -> None:
        """Step through a motion that turns the table, one time step a sample."""

    def impulse(self) -> float:
        """Upper bound of the growth of sqrt(2 e) by ``turn`` so far.

        Returns
        -------
        float [m/s]
            e is the energy of the rock relative to the table, per unit mass, gravity along -z.
        """


class DrivenWorld(World, Protocol):
    """A scene under way on a table that a servo moves; ``state`` is relative to the table."""

    def table(self) -> tuple[float, float]:
        """Where the table is along +x.

        Returns
        -------
        tuple of float [m, m/s]
            Position and velocity, both zero at the start.
        """

    def force(self) -> float:
        """Force of the servo on the table.

        Returns
        -------
        float [N]
            That of the last control period.
        """

    def impulse(self) -> float:
        """Upper bound of the integral of the table's absolute acceleration so far.

        Returns
        -------
        float [m/s]
        """


class GroundWorld(World, Protocol):
    """A scene under way on a terrain; the table shakes along (cos yaw, -sin yaw)."""

    def put(self, state: State) -> None:
        """Have the rock go on from a state."""

    def contacts(self) -> tuple[int, float]:
        """How the rock touched the ground in the last step.

        Returns
        -------
        tuple of int and float [m]
            Number of points that bore it, and how deep the deepest was in the ground.
        """


class Engine(Protocol):
    """What an engine's module offers.

    Attributes
    ----------
    VERSION : str
        The library's, part of the identity of a run.
    SOLVER : Solver
        The effort that it takes if none is stated.
    SLENDER_SHARE : float
        Longest time step of a slender rock, as a share of tan(alpha) sqrt(radius / g).
    SLIDING_SHARE : float
        Friction, as a share of tan(alpha), from which on to 1 a rock topples that should slide.
    """

    VERSION: str
    SOLVER: Solver
    LADDER: Ladder
    SLENDER_SHARE: float
    SLIDING_SHARE: float

    def build(
        self, scene: Scene, time_step: float, substeps: int, solver: Solver | None = None
    ) -> World:
        """World with the rock at its start; ends earlier worlds of that scene.

        Parameters
        ----------
        time_step : float [s]
        substeps : int, steps for which a sample of the motion is held; with a drive they make up
            its control period
        solver : Solver, by default the engine's ``SOLVER``

        Raises
        ------
        InvalidInput
            For what the engine cannot represent.
        """
