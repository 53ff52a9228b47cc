"""What no sound run does, and how a rock at rest is known. Both kinds of runs are judged by these.

A run that breaks a guard is repeated at half the time step, up to ``HALVINGS`` times.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array, matrix_product
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.rock.body import Rock
from vsr_core.run import proofs
from vsr_core.scene import State

HALVINGS = 5
"""A run that breaks its guards is repeated at half the step, this many times."""

ENERGY_SLACK = 0.02
"""Numerical excess allowed over the energy the table can give, as a share of g times radius."""

Found = TypeVar("Found")


def at_halved_steps(
    time_step: float, attempt: Callable[[float], Found], unstable: Callable[[Found], bool]
) -> Found:
    """Result of the first attempt that keeps its guards, or of the last one.

    Parameters
    ----------
    time_step : float [s], of the first attempt
    attempt : function of a time step [s]

    Examples
    --------
    >>> at_halved_steps(1.0, lambda step: step, lambda step: step > 0.3)
    0.25
    """
    for _ in range(HALVINGS):
        found = attempt(time_step)
        if not unstable(found):
            return found
        time_step /= 2.0
    return attempt(time_step)


def finite(state: State) -> bool:
    """Whether all numbers of a state are finite."""
    total = state.position.sum() + state.rotation.sum()
    total += state.velocity.sum() + state.angular_velocity.sum()
    return math.isfinite(float(total))


def inertia_of(rock: Rock) -> Array:
    """Inertia about the centre of mass per unit mass, in the rock's axes, shape (3, 3) [m^2].

    Returns
    -------
    ndarray, shape (3, 3) [m^2]
    """
    return matrix_product(rock.axes * (rock.inertia / rock.mass), rock.axes.T)


def kinetic_energy(inertia: Array, state: State) -> float:
    """Kinetic energy per unit mass [m^2/s^2] for ``inertia`` of ``inertia_of``.

    Parameters
    ----------
    inertia : ndarray, shape (3, 3) [m^2], of ``inertia_of``

    Returns
    -------
    float [m^2/s^2]
    """
    turning = state.rotation.T @ state.angular_velocity
    return 0.5 * float(state.velocity @ state.velocity + turning @ inertia @ turning)


@compiled
def gained_too_much(
    energy: float, start_height: float, floor: float, impulse: float, radius: float
) -> bool:
    """Whether a rock has more energy than its table can have given.

    Parameters
    ----------
    energy : float [m^2/s^2], kinetic plus g z, per unit mass
    start_height : float [m], of the centre of mass at rest before the shaking
    floor : float [m], lowest height that the centre of mass can have
    impulse : float [m/s], integral of the table's absolute acceleration so far
    radius : float [m], of the rock

    Returns
    -------
    bool, also true for an energy that is not a number
    """
    start = GRAVITY * start_height - GRAVITY * floor
    most = proofs.reachable_energy(start, impulse) + ENERGY_SLACK * GRAVITY * radius
    return not energy - GRAVITY * floor <= most


class Rest:
    """Whether a rock has stood still for a while and does not creep.

    Parameters
    ----------
    energy : float [m^2/s^2], below which the kinetic energy per unit mass has to stay
    duration : float [s], for which it has to
    creep : float [m], farthest path allowed in that time
    radius : float [m], of the rock
    """

    def __init__(self, energy: float, duration: float, creep: float, radius: float) -> None:
        self._energy, self._duration = energy, duration
        self._creep, self._radius = creep, radius
        self._since: tuple[float, State] | None = None

    def note(self, time: float, state: State, kinetic: float) -> None:
        """Take note of a state.

        Parameters
        ----------
        time : float [s]
        kinetic : float [m^2/s^2], its kinetic energy per unit mass
        """
        if not kinetic < self._energy:
            self._since = None
        elif self._since is None:
            self._since = time, state

    def reached(self, time: float, state: State) -> bool:
        """Whether the rock rests in the state noted last; begins to watch anew if it creeps.

        Parameters
        ----------
        time : float [s]
        """
        if self._since is None or time - self._since[0] < self._duration:
            return False
        before, self._since = self._since[1], (time, state)
        path = float(np.linalg.norm(state.position - before.position))
        turn = float(np.linalg.norm(state.rotation - before.rotation)) / math.sqrt(2.0)
        return path + turn * self._radius <= self._creep
