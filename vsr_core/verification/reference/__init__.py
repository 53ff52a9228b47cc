"""The reference suite: cases whose answer is exact, or computed without a physics engine.

A module holds one family of cases and offers them as ``CASES``; modules are found by their name,
those with an underscore are shared parts. A case is run in an engine at a time step and returns
its relative error, so that any engine, solver or build can be judged, and its order of convergence
in the time step measured.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass

BOTH = ("bullet", "mujoco")
"""Engines that can hold a case without restitution and without a drive."""


@dataclass(frozen=True)
class Reference:
    """A case with a known answer.

    Attributes
    ----------
    name : str, unique
    family : str, name of its module
    answer : str, what it is compared with and the source; where an engine is known to be off, why
    quantity : str, what the error is of, and what it is relative to
    tolerance : float, relative error kept at ``step`` by every one of ``engines``
    step : float [s], time step at which the tolerance is promised
    order : float, order of convergence in the time step; None where the error is not smooth in it
    engines : tuple of str, the engines that can hold it
    measure : callable (engine, time step [s]) -> relative error, at least 0; nan if it diverged
        Steps are shortened a little where a whole number of them has to fill a motion.
    """

    name: str
    family: str
    answer: str
    quantity: str
    tolerance: float
    step: float
    order: float | None
    engines: tuple[str, ...]
    measure: Callable[[str, float], float]


def families() -> list[str]:
    """Names of the families there are."""
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    return sorted(name for name in modules if not name.startswith("_"))


def cases() -> tuple[Reference, ...]:
    """All cases, family by family."""
    modules = (importlib.import_module(f"{__name__}.{name}") for name in families())
    return tuple(case for module in modules for case in module.CASES)
