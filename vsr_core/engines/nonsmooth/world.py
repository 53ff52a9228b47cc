"""One rock in the engine, stepped from outside: what the reference cases and all tests see."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core.arrays import Array
from vsr_core.engines.interface import Solver
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth import plane
from vsr_core.engines.nonsmooth.body import Body, Motion, Points
from vsr_core.engines.nonsmooth.compiling import compiled
from vsr_core.engines.nonsmooth.stepping import drift, step
from vsr_core.engines.nonsmooth.vectors import inertia_turned
from vsr_core.scene import Scene, State, resting


class NonsmoothWorld:
    """One rock on a level pedestal."""

    def __init__(self, scene: Scene, time_step: float, substeps: int, solver: Solver) -> None:
        self._axes = scene.rock.axes
        self._body = bodies.body(scene.rock, scene.contact)
        self._points = bodies.points(max(1, len(self._body.points)))
        self._motion = bodies.motion()
        self._step, self._substeps, self._solver = time_step, substeps, solver
        self._gravity = scene.gravity
        self._on_ground = scene.pedestal != "none"
        self.put(scene.start or resting(scene))

    def put(self, state: State) -> None:
        """Have the rock go on from a state."""
        set_state(self._motion, state, self._axes)
        begin(self._body, self._motion, self._step)

    def advance(self, acceleration: Iterable[float]) -> None:
        """Step through samples of the table's acceleration along +x [m/s^2]."""
        along = np.fromiter(acceleration, dtype=np.float64)
        pushes = np.zeros((len(along), 3))
        pushes[:, 0] = along
        self.shake(pushes)

    def shake(self, acceleration: Sequence[Sequence[float]] | Array) -> None:
        """Step through samples of the table's acceleration along x, y and z [m/s^2]."""
        advance(
            self._body,
            self._motion,
            self._points,
            np.ascontiguousarray(acceleration, dtype=np.float64).reshape(-1, 3),
            self._substeps,
            self._step,
            self._gravity,
            self._on_ground,
            self._solver.iterations,
            self._solver.residual,
        )

    def state(self) -> State:
        """Present state in SI units."""
        return state_of(self._motion, self._step, self._axes)


@compiled
def advance(
    body: Body,
    rock: Motion,
    points: Points,
    acceleration: Array,
    substeps: int,
    time_step: float,
    gravity: float,
    on_ground: bool,
    sweeps: int,
    residual: float,
) -> None:
    """Step a rock on a level pedestal through samples of the table's acceleration.

    Parameters
    ----------
    body, rock, points : of the rock
    acceleration : ndarray, shape (n, 3) [m/s^2]
    substeps : int, steps for which a sample is held
    time_step : float [s]
    gravity : float [m/s^2]
    on_ground : bool, whether there is a pedestal
    sweeps, residual : of the impulses
    """
    push = np.empty(3)
    for n in range(len(acceleration)):
        push[0], push[1] = -acceleration[n, 0], -acceleration[n, 1]
        push[2] = -gravity - acceleration[n, 2]
        speed = (abs(push[0]) + abs(push[1]) + abs(push[2])) * time_step
        for _ in range(substeps):
            if on_ground:
                plane.find(body, rock, points, time_step, speed)
            step(body, rock, points, push, time_step, gravity, sweeps, residual)


@compiled
def begin(body: Body, rock: Motion, time_step: float) -> None:
    """Bring a state from the start of a step to the middle of its path, without any contacts."""
    rock.found = rock.near = rock.active = rock.kept = 0
    rock.reserve = -1.0
    inertia_turned(rock.rotation, body.moments, rock.inertia)
    for k in range(3):
        rock.momentum[k] = 0.0
        for j in range(3):
            rock.momentum[k] += rock.inertia[k, j] * rock.velocity[3 + j]
    drift(rock, 0.5 * time_step)


def set_state(motion: Motion, state: State, axes: Array) -> None:
    """Write a state into the engine's.

    Parameters
    ----------
    motion : Motion, changed
    state : State
    axes : ndarray, shape (3, 3), principal axes of the rock
    """
    x, y, z, w = Rotation.from_matrix(state.rotation @ axes).as_quat()
    motion["place"][:] = state.position
    motion["quaternion"][:] = w, x, y, z
    motion["rotation"][:] = state.rotation @ axes
    motion["velocity"][:3], motion["velocity"][3:] = state.velocity, state.angular_velocity


def state_of(motion: Motion, time_step: float, axes: Array) -> State:
    """State now, half a step before the place that the engine knows.

    Parameters
    ----------
    motion : Motion
    time_step : float [s]
    axes : ndarray, shape (3, 3), principal axes of the rock

    Returns
    -------
    State
    """
    now = motion.copy()
    drift(now, -0.5 * time_step)
    return State(now["place"], now["rotation"] @ axes.T, now["velocity"][:3], now["velocity"][3:])
