"""Physics engines: one module each, found by its name.

A module offers ``build(scene, time_step, substeps) -> World`` and ``VERSION``, the engine's own
version, which goes into the identity of a run. ``build`` raises ``Unfit`` for what it cannot
represent.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
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
        """Step through samples of the table's acceleration along +x [m/s^2], taken at mid-hold."""

    def state(self) -> State:
        """Present state; entries are not finite if the engine diverged."""


class Engine(Protocol):
    """What an engine's module offers."""

    VERSION: str

    def build(self, scene: Scene, time_step: float, substeps: int) -> World:
        """World with the rock at rest; ends earlier worlds of that scene.

        Each sample of the motion is held for ``substeps`` steps of ``time_step`` [s].
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
    """Engine by name; imports its library."""
    return cast(Engine, importlib.import_module(f"{__name__}.{name}"))
