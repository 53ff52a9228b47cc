"""Physics engines: one module each, found by its name.

A module offers ``build(scene, time_step) -> World`` and ``VERSION``, the engine's own version,
which goes into the identity of a run. ``build`` raises ``Unfit`` for what it cannot represent.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from vsr_core.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class State:
    """Motion of the rock relative to the table.

    Attributes
    ----------
    position : ndarray, shape (3,) [m], centre of mass; z above the pedestal
    rotation : ndarray, shape (3, 3), takes the rest pose at yaw 0 to the present pose
    velocity : ndarray, shape (3,) [m/s], of the centre of mass
    spin : ndarray, shape (3,) [rad/s], angular velocity in the table's axes
    """

    position: Array
    rotation: Array
    velocity: Array
    spin: Array


class World(Protocol):
    """A scene under way, in the table's own frame."""

    def advance(self, acceleration: Iterable[float]) -> None:
        """Step once per table acceleration along +x [m/s^2], each taken at mid-step."""

    def state(self) -> State:
        """Present state; entries are not finite if the engine diverged."""


class Engine(Protocol):
    """What an engine's module offers."""

    VERSION: str

    def build(self, scene: Scene, time_step: float) -> World:
        """World with the rock at rest; ``time_step`` in s. Ends earlier worlds of that scene."""


def names() -> list[str]:
    """Names of the engines there are."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__))


def load(name: str) -> Engine:
    """Engine by name; imports its library."""
    return cast(Engine, importlib.import_module(f"{__name__}.{name}"))
