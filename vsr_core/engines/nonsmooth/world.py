"""One rock in the engine, stepped from outside: what the reference cases and all tests see."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from copy import copy

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core.arrays import Array, matrix_product
from vsr_core.compiled import records
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import assign, inertia_turned
from vsr_core.engines.interface import Solver
from vsr_core.engines.nonsmooth import body as bodies
from vsr_core.engines.nonsmooth import ground as grounds
from vsr_core.engines.nonsmooth import peaks as watched
from vsr_core.engines.nonsmooth import plane
from vsr_core.engines.nonsmooth.body import Body, Point, RockState, Stepping
from vsr_core.engines.nonsmooth.peaks import Peaks
from vsr_core.engines.nonsmooth.stepping import drift
from vsr_core.engines.nonsmooth.tree import MOST_POINTS, Ground, forget, ground
from vsr_core.judge import ground_lookup
from vsr_core.judge.ground_lookup import Lookup
from vsr_core.scene import Scene, State, in_site, resting


class NonsmoothWorld:
    """One rock on a level pedestal or on a terrain."""

    def __init__(self, scene: Scene, time_step: float, substeps: int, solver: Solver) -> None:
        self._axes, self._yaw = scene.rock.axes, scene.yaw
        self._body = bodies.body(scene.rock, scene.contact, on_level=scene.terrain is None)
        self._ground: Ground | None = None
        most = max(1, len(self._body.points))
        if scene.terrain is not None:
            self._ground, most = ground(scene.rock, scene.terrain), MOST_POINTS
        self._points = records.rows(Point, most)
        self._rock = records.room(RockState)
        self._peaks = watched.room(scene.rock, upward_of(scene))
        self._step, self._substeps = time_step, substeps
        effort = solver.iterations, solver.residual
        self._stepping, self._given = Stepping(time_step, scene.gravity, *effort), 0.0
        self._on_ground = scene.pedestal != "none"
        self.put(scene.start or resting(scene))

    def put(self, state: State) -> None:
        """Have the rock go on from a state."""
        set_state(self._rock, state, self._axes)
        begin(self._body, self._rock, self._peaks, self._step)
        if self._ground is not None:
            forget(self._ground)

    def go_on_in(self, scene: Scene) -> None:
        """Have the rock go on in another scene of it on its terrain, as in a compiled run."""
        assert scene.terrain is not None
        self._body = bodies.body(scene.rock, scene.contact, on_level=False)
        self._ground = ground(scene.rock, scene.terrain)
        put_on(self._body, self._ground, ground_lookup.lookup(scene.terrain), self._rock)

    def advance(self, acceleration: Iterable[float]) -> None:
        """Step through samples of the table's acceleration along the shaking [m/s^2].

        Parameters
        ----------
        acceleration : array, shape (n,) along +x, or (n, 3) [m/s^2]
        """
        along = np.fromiter(acceleration, dtype=np.float64)
        pushes = np.zeros((len(along), 3))
        pushes[:, 0] = along
        self.shake(pushes)

    def shake(self, acceleration: Sequence[Sequence[float]] | Array) -> None:
        """Step through samples of the table's acceleration along x, y and z [m/s^2].

        Parameters
        ----------
        acceleration : array, shape (n,) along +x, or (n, 3) [m/s^2]
        """
        along = np.asarray(acceleration, dtype=np.float64).reshape(-1, 3)
        if self._ground is None:
            self._step_on_level(along)
            return
        values = np.repeat(in_site(along, self._yaw), self._substeps, axis=0)
        own = self._body, self._ground, self._rock, self._points, self._peaks
        grounds.advance(*own, values, 0, len(values), self._stepping)
        if self._ground.search[0].full:
            self._rock.place[:] = math.nan  # a list of what touches was too short

    def turn(self, samples: Sequence[Sequence[float]] | Array) -> None:
        """Step through a motion that turns the table, one time step a sample.

        Parameters
        ----------
        samples : array, shape (n, 9), those of a ``TableMotion``
        """
        self._given += self._step_on_level(np.asarray(samples, dtype=np.float64).reshape(-1, 9))

    def _step_on_level(self, samples: Array) -> float:
        """How much that can have added to sqrt(2 e) [m/s]."""
        values = np.repeat(samples, self._substeps, axis=0)
        own = self._body, self._rock, self._points, self._peaks
        return plane.advance(*own, values, 0, len(values), self._stepping, self._on_ground)

    def impulse(self) -> float:
        """Upper bound of the growth of sqrt(2 e) by ``turn`` so far.

        Returns
        -------
        float [m/s]
        """
        return self._given

    def peaks(self) -> tuple[float, float]:
        """Largest tilt and slip since the start.

        Returns
        -------
        tuple of float [rad, m]
        """
        return watched.tilt_and_slip(self._peaks)

    def state(self) -> State:
        """Present state in SI units."""
        return state_of(self._rock, self._step, self._axes)

    def contacts(self) -> tuple[int, float]:
        """Number of points that bore the rock in the last step; the deepest in the ground [m].

        Returns
        -------
        tuple of int and float [m]
        """
        active = self._active()
        return sum(map(_bears, active)), max(0.0, *(-float(point.gap) for point in active), 0.0)

    def footing(self) -> tuple[Array, Array]:
        """Points that bore the rock in the last step, and the way the ground pushed there.

        Returns
        -------
        tuple of ndarray, shape (k, 3) [m], and ndarray, shape (k, 3)
        """
        bearing = [point for point in self._active() if _bears(point)]
        before = self._rock.place - self._step * self._rock.velocity[:3]
        levers = np.array([point.lever for point in bearing]).reshape(-1, 3)
        return before + levers, np.array([point.normal for point in bearing]).reshape(-1, 3)

    def _active(self) -> list[Point]:
        """Points of contact of the last step."""
        return [self._points[self._points[at].active] for at in range(self._rock.active)]


def _bears(point: Point) -> bool:
    """Whether a point of contact bears some of the rock."""
    return bool(point.impulse[0] + point.given[0] > 0.0)


@compiled
def begin(body: Body, rock: RockState, peaks: Peaks, time_step: float) -> None:
    """Bring a state told at the start of a step to the middle of its path; forget what was.

    Parameters
    ----------
    time_step : float [s]
    """
    rock.found = rock.near = rock.active = rock.kept = 0
    rock.reserve = -1.0
    rock.taken = 0.0
    assign(rock.before, rock.velocity)
    inertia_turned(rock.rotation, body.moments, rock.inertia)
    for k in range(3):
        rock.momentum[k] = 0.0
        for j in range(3):
            rock.momentum[k] += rock.inertia[k, j] * rock.velocity[3 + j]
    watched.begin(peaks, rock)
    drift(rock, 0.5 * time_step)


def put_on(body: Body, ground: Ground, surface: Lookup, rock: RockState) -> None:
    """Set a rock onto another ground, raised so far that it does not begin in it."""
    corners = rock.place + body.points @ rock.rotation.T
    deepest = max(ground_lookup.depth(surface, *corner) for corner in corners)
    rock.place[2] += max(0.0, deepest)
    rock.found = rock.near = rock.active = rock.kept = 0
    forget(ground)


def upward_of(scene: Scene) -> Array:
    """Direction of a scene's rock that is up where its tilt is zero.

    Returns
    -------
    ndarray, shape (3,)
    """
    if scene.terrain is None or scene.start is None:
        return np.array([0.0, 0.0, 1.0])
    return scene.start.rotation[2]


def set_state(rock: RockState, state: State, axes: Array) -> None:
    """Write a state into the engine's.

    Parameters
    ----------
    axes : ndarray, shape (3, 3), principal axes of the rock
    """
    turned = matrix_product(state.rotation, axes)
    x, y, z, w = Rotation.from_matrix(turned).as_quat()
    rock.place[:] = state.position
    rock.quaternion[:] = w, x, y, z
    rock.rotation[:] = turned
    rock.velocity[:3], rock.velocity[3:] = state.velocity, state.angular_velocity


def state_of(rock: RockState, time_step: float, axes: Array) -> State:
    """State now, half a step before the place that the engine knows.

    Parameters
    ----------
    time_step : float [s]
    axes : ndarray, shape (3, 3), principal axes of the rock
    """
    now = copy(rock)
    drift(now, -0.5 * time_step)
    rotation = matrix_product(now.rotation, axes.T)
    return State(now.place, rotation, now.velocity[:3], now.velocity[3:])
