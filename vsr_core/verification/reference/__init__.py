"""The reference suite: cases whose answer is exact, or computed without a physics engine.

A module holds one family of cases and offers them as ``CASES``; modules are found by their name,
those with an underscore are shared parts. A case is run in an engine at a time step and returns
its relative error, so that any engine, solver or build can be judged, and its order of convergence
in the time step measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from vsr_core.verification import modules

BOTH = ("bullet", "mujoco", "nonsmooth")
"""Engines that can hold a case without restitution and without a drive."""

REBOUNDS = ("bullet", "nonsmooth")
"""Engines that know a coefficient of restitution, and ground of triangles."""

BULLET = ("bullet",)

OWN = ("nonsmooth",)


@dataclass(frozen=True)
class Reference:
    """A case with a known answer.

    Attributes
    ----------
    answer : str, what it is compared with and the source; where an engine is known to be off, why
    tolerance : float, relative error kept at ``step`` by every one of ``engines``
    measure : callable (engine, time step [s]) -> relative error, at least 0; nan if it diverged
        Steps are shortened a little where a whole number of them has to fill a motion.
    step : float [s], time step at which the tolerance is promised
    order : float, order of convergence in the time step; None where the error is not smooth in it
    """

    name: str
    answer: str
    quantity: str
    tolerance: float
    measure: Callable[[str, float], float]
    step: float
    order: float | None
    engines: tuple[str, ...]


def case(
    name: str,
    answer: str,
    tolerance: float,
    error: Callable[..., float],
    *given: Any,
    step: float = 1e-3,
    order: float | None = None,
    engines: tuple[str, ...] = BOTH,
) -> Reference:
    """A case whose quantity is described by the first line of a function's docstring.

    Parameters
    ----------
    error : callable (*given, engine, time step [s]) -> relative error
    """
    quantity = (error.__doc__ or "").partition("\n")[0]
    measure = partial(error, *given)
    return Reference(name, answer, quantity, tolerance, measure, step, order, engines)


def cases() -> tuple[Reference, ...]:
    """All cases, family by family."""
    return tuple(case for module in modules(__name__).values() for case in module.CASES)
