"""Physics engines: one module each, found by its name.

A module offers ``build(scene, time_step, substeps, solver) -> World``, ``SOLVER``, the effort it
takes if none is stated, ``SLENDER_SHARE`` and ``SLIDING_SHARE``, what it takes of a rock, and
``VERSION``, the engine's own version, which goes into the identity of a run. ``build`` raises
``InvalidInput`` for what it cannot represent.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, cast

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.scene import Scene, State


@dataclass(frozen=True)
class Solver:
    """How hard an engine's contact solver works in each step.

    Attributes
    ----------
    iterations : int, at most
    residual : float, in the engine's own measure, below which it stops earlier
    """

    iterations: int
    residual: float


class World(Protocol):
    """A scene under way, in the table's own frame.

    In a scene with a drive the samples that ``advance`` takes are velocity commands to the servo
    [m/s], one per control period, and the world is a ``DrivenWorld``.
    """

    def advance(self, samples: Iterable[float], /) -> None:
        """Step through samples of the table's acceleration along +x [m/s^2], taken at mid-hold."""

    def shake(self, acceleration: Sequence[Sequence[float]], /) -> None:
        """Step through samples of it along x, y and z [m/s^2], three numbers each."""

    def state(self) -> State:
        """Present state; entries are not finite if the engine diverged."""


class TurningWorld(World, Protocol):
    """A scene under way on a table that turns too."""

    def turn(self, samples: Sequence[Sequence[float]], /) -> None:
        """Step through samples of a ``TableMotion``, nine numbers each, one time step a sample."""

    def impulse(self) -> float:
        """Upper bound of the growth of sqrt(2 e) by that so far [m/s].

        e is the energy of the rock relative to the table, per unit mass, with gravity along -z.
        """


class DrivenWorld(World, Protocol):
    """A scene under way on a table that a servo moves; ``state`` is relative to the table."""

    def table(self) -> tuple[float, float]:
        """Position [m] and velocity [m/s] of the table along +x, both zero at the start."""

    def force(self) -> float:
        """Force of the servo on the table in the last control period [N]."""

    def impulse(self) -> float:
        """Upper bound of the integral of the table's absolute acceleration so far [m/s]."""


class GroundWorld(World, Protocol):
    """A scene under way on a terrain; the table shakes along (cos yaw, -sin yaw)."""

    def put(self, state: State) -> None:
        """Have the rock go on from a state."""

    def contacts(self) -> tuple[int, float]:
        """Number of points at which the rock touched in the last step, and the deepest [m]."""

    def footing(self) -> tuple[Array, Array]:
        """Points that bore the rock in the last step, and the way the ground pushed there.

        Both have shape (k, 3), in the site's frame, [m] and [1].
        """


class Engine(Protocol):
    """What an engine's module offers.

    Attributes
    ----------
    VERSION : str
    SOLVER : Solver
    SLENDER_SHARE : float
        Longest time step of a slender rock, as a share of tan(alpha) sqrt(radius / g).
    SLIDING_SHARE : float
        Friction, as a share of tan(alpha), from which on to 1 a rock topples that should slide.
    """

    VERSION: str
    SOLVER: Solver
    SLENDER_SHARE: float
    SLIDING_SHARE: float

    def build(
        self, scene: Scene, time_step: float, substeps: int, solver: Solver | None = None
    ) -> World:
        """World with the rock at its start; ends earlier worlds of that scene.

        Each sample of the motion is held for ``substeps`` steps of ``time_step`` [s]; with a drive
        that is its control period. Without a ``solver`` the engine's own ``SOLVER`` is used.
        """


@contextmanager
def silenced() -> Iterator[None]:
    """Keep a library from writing to standard error while it is imported."""
    sys.stderr.flush()
    kept = os.dup(2)
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123 (a descriptor, not a path)
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def names() -> list[str]:
    """Names of the engines there are."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__))


def load(name: str) -> Engine:
    """Engine by name; imports its library.

    Raises
    ------
    InvalidInput
        If the library is not installed.
    """
    try:
        return cast(Engine, importlib.import_module(f"{__name__}.{name}"))
    except ModuleNotFoundError as error:
        raise InvalidInput(
            f"the engine {name!r} without the library {error.name!r}",
            "an engine other than bullet is an extra",
            f"install it: .venv/bin/pip install -e '.[{name}]', or set simulation.engine: bullet",
        ) from None
