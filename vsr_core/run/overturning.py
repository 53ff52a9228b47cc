"""One run: a scene, a motion, and the rules that end it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.cosine_pulse import GroundMotion
from vsr_core.motions.six_axes import TableMotion
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome, Response
from vsr_core.rock.body import Rock
from vsr_core.rock.hull import convex_hull, settle
from vsr_core.run import bounds
from vsr_core.run.reductions import Reduction
from vsr_core.run.reductions import reduce as reduce_scene
from vsr_core.run.sampling import MOST_SUBSTEPS, first_step, samples, sampling
from vsr_core.scene import Contact, Scene, State
from vsr_core.table import servo

LOOK_EVERY = 48
"""Time steps between two looks at the rock."""

HALVINGS = 5
"""A run that fails its guards is repeated at half the step, this many times."""

PENETRATION_SHARE = 0.01
"""Deepest penetration allowed, as a share of the rock's radius."""

ENERGY_SLACK = 0.02
"""Numerical excess allowed over the energy the table can give, as a share of g times radius."""

REST_SHARE, REST_OF_BARRIER = 1e-6, 1e-3
"""Kinetic energy of a rock at rest, as a share of g times its radius, and of what it has to climb
to topple: a needle that hesitates on its edge is not at rest."""

REST_TIME = 0.28
"""Time with that little energy that makes a rest, in units of sqrt(radius / g)."""

CREEP_SHARE = 1e-4
"""Farthest way of a rock in that time, as a share of its radius: even in the longest wait it would
not creep a sixth of the way that counts as displaced."""

STANDING_TURN = 3e-3
"""Farthest turn [rad] of a rock at rest from the face that it stands on."""

LEAD = 8
"""Samples before a push with which a run goes on after a rest, so that the engine has its contacts:
without them a block rises 7 % less."""

STILL_SHARE = 0.95
"""Share of the range in which nothing moves a rock that is used once it has moved."""

DRIFT_SHARE = 0.01
"""Farthest way of a rock that nothing has moved yet, as a share of its radius."""

WAITING_TIMES = 40.0
"""Longest wait after the motion, in units of sqrt(radius / g); 4 s at the least, as the seed."""


@dataclass(frozen=True)
class Settings:
    """How a run is computed.

    Attributes
    ----------
    time_step : float [s], the largest allowed; a whole number of steps fills the motion, or the
        control period of a drive
    reduce : bool, whether to leave out what cannot change the outcome
    engine : str, name of a module in ``vsr_core.engines``
    solver : Solver, effort of the engine's solver where it is not the engine's own
    """

    time_step: float
    reduce: bool = True
    engine: str = "bullet"
    solver: engines.Solver | None = None


@dataclass(frozen=True)
class Case:
    """A scene with all that its runs share, computed once.

    Attributes
    ----------
    full : Scene, with all vertices of the rock
    scene : Scene, as simulated; ``full`` itself if its rock was not reduced
    reductions : tuple of Reduction, what was left out
    limits : Barrier of the rock
    still : tuple of float, lowest and highest table acceleration [m/s^2] that move nothing; zeros
        for springs, for a start on the move, and for a drive, whose table overshoots a little
    """

    full: Scene
    scene: Scene
    reductions: tuple[Reduction, ...]
    limits: bounds.Barrier
    still: tuple[float, float]


def prepare(described: Scene, limits: bounds.Barrier, *, reduce: bool) -> Case:
    """Reduce a scene, or take it as it is; ``limits`` is the ``barrier`` of its rock.

    Raises
    ------
    InvalidInput
        For a drive whose sampled loop is unstable.
    """
    still = (0.0, 0.0)
    if described.drive is not None:
        servo.check(described.drive)
    elif described.contact.stiffness is None and described.start is None:
        still = bounds.still_range(described.rock, described.contact, described.yaw)
    reduced, reductions = reduce_scene(described) if reduce else (described, ())
    full = replace(reduced, rock=described.rock, kept_tilt=described.kept_tilt)
    return Case(full, reduced, reductions, limits, still)


def simulate(case: Case, motion: GroundMotion, settings: Settings) -> Response:
    """Outcome of one run.

    Never raises for physics: a run that fails its guards at every step tried is ``UNSTABLE``. Steps
    are as fine as the motion needs; ``precheck.check`` says if they are too coarse for the rock.

    Parameters
    ----------
    case : Case, from ``prepare`` with the same ``reduce`` as in ``settings``
    motion : GroundMotion, a TableMotion for several axes
    settings : Settings
    """
    along_x = not isinstance(motion, TableMotion)
    still = min(-case.still[0], case.still[1])
    if settings.reduce and along_x and motion.peak_acceleration < still:
        return Response(Outcome.BALANCED, DecidedBy.NO_UPLIFT_BOUND, 0.0, 0.0, 0.0, 0)
    simulated = case.scene
    time_step = first_step(motion, simulated.drive, settings.time_step)
    for _ in range(HALVINGS + 1):
        response = _Run(case, simulated, motion, settings, time_step).to_the_end()
        if response.peak_tilt > simulated.kept_tilt:
            simulated = case.full
            response = _Run(case, simulated, motion, settings, time_step).to_the_end()
        if response.outcome is not Outcome.UNSTABLE:
            break
        time_step /= 2.0
    return response


class _Run:
    """One attempt at one time step."""

    def __init__(
        self,
        case: Case,
        simulated: Scene,
        motion: GroundMotion,
        settings: Settings,
        time_step: float,
    ) -> None:
        self.motion, self.limits = motion, case.limits
        rock, contact = simulated.rock, simulated.contact
        # The proofs assume the prescribed motion; a servo's table moves a little differently. And
        # they know nothing of energy kept in springs.
        # And a table that tilts has not gravity along z.
        self.turns = isinstance(motion, TableMotion) and motion.turns
        self.early = settings.reduce and simulated.drive is None and contact.stiffness is None
        self.early = self.early and not self.turns
        self.rock, self.contact = rock, contact
        self.radius = rock.radius
        self.vertices = rock.vertices
        self.kept_tilt = math.pi if simulated is case.full else simulated.kept_tilt
        self.foot = np.array([0.0, 0.0, -rock.height])
        self.inertia = rock.axes * (rock.inertia / rock.mass) @ rock.axes.T
        self.drive = simulated.drive
        # Where the table turns, what the rock feels depends on its state in every step.
        sampled = sampling(motion, self.drive, time_step, 1 if self.turns else MOST_SUBSTEPS)
        self.interval, self.substeps = sampled.interval, sampled.substeps
        self.pulse_samples = sampled.pulse_samples
        self.look_every = max(1, LOOK_EVERY // self.substeps)
        unit = math.sqrt(self.radius / GRAVITY)
        wait = max(4.0, WAITING_TIMES * unit)
        self.last_sample = self.pulse_samples + math.ceil(wait / self.interval)
        engine = engines.load(settings.engine)
        self.world = engine.build(
            simulated, self.interval / self.substeps, self.substeps, settings.solver
        )
        self.driven = cast(engines.DrivenWorld, self.world) if simulated.drive else None
        self.sample = self.begin = self.passed = 0
        self.time = 0.0
        self.tilt = self.peak_tilt = self.slip = 0.0
        climb = max(case.limits.edge_height - case.limits.upright_floor, 0.0)
        self.rest_energy = GRAVITY * min(REST_SHARE * self.radius, REST_OF_BARRIER * climb)
        self.rest_time = REST_TIME * unit
        self.still_since: tuple[float, State] | None = None
        self.energy = GRAVITY * rock.height
        self.start = self.world.state()
        self.foot_start = self.start.position + self.start.rotation @ self.foot
        self.values = samples(motion, self.drive, self.interval, self.last_sample)
        # A rock on the move from its start is never at rest before the motion.
        self.first_push = self._first_push(case.still) if simulated.start is None else -1

    def to_the_end(self) -> Response:
        if not self._look():
            return self._ended(Outcome.UNSTABLE, DecidedBy.SIMULATION)
        if self.kinetic > ENERGY_SLACK * GRAVITY * self.radius:
            return self._ended(Outcome.UNSETTLED, DecidedBy.SIMULATION)
        values = self.values.tolist()
        if self.early:  # until the first push nothing moves the rock: the theorem of still_range
            self.sample = self.begin = max(0, min(self.first_push, self.pulse_samples))
            self.time = self.sample * self.interval
        steps = self._steps()
        while self.sample < self.last_sample:
            until = self._next_look()
            steps(values[self.sample : until])
            self.sample, self.time = until, until * self.interval
            if not self._look():
                return self._ended(Outcome.UNSTABLE, DecidedBy.SIMULATION)
            if self.peak_tilt > self.kept_tilt:  # to be repeated with all vertices
                break
            decided = self._decided()
            if decided:
                return self._ended(*decided)
            if self.early and self.values.ndim == 1 and until < self.pulse_samples:
                self._pass_over_rest()
        # By now a driven table stands as still as the motion wants it.
        side = self._side() if self._proved() else Outcome.UNSETTLED
        return self._ended(side, DecidedBy.SIMULATION)

    def _first_push(self, still: tuple[float, float]) -> int:
        """Number of the first sample that moves the rock; the first of all in several axes."""
        if self.values.ndim > 1:
            return 0
        lowest, highest = still  # what is not a number is a push
        moved = ~((lowest <= self.values) & (self.values <= highest))
        return int(np.argmax(np.append(moved, True)))

    def _pass_over_rest(self) -> None:
        """Go on at the next push if the rock rests: until then nothing moves it."""
        if self.tilt > self.limits.toppled_tilt or not self._rests():
            return
        turn = self.state.rotation
        upright = _upright(turn[2])
        heading = turn @ upright.T
        yaw = round(math.degrees(math.atan2(heading[1, 0], heading[0, 0])))
        up = tuple(np.round(turn[2], 3).tolist())
        lowest, highest = _still_range(self.rock, self.contact, up, yaw)
        ahead = self.values[self.sample : self.pulse_samples]
        moved = ~((STILL_SHARE * lowest <= ahead) & (ahead <= STILL_SHARE * highest))
        passed = max(0, int(np.argmax(np.append(moved, True))) - LEAD)
        self.sample += passed
        self.passed += passed
        self.time = self.sample * self.interval

    def _steps(self) -> Callable[[Any], None]:
        """How the world takes samples of this motion."""
        if self.turns:
            return cast(engines.TurningWorld, self.world).turn
        return self.world.advance if self.values.ndim == 1 else self.world.shake

    def _next_look(self) -> int:
        """Looks are evenly spaced, and one falls on the end of the motion."""
        until = self.sample + self.look_every
        if self.sample < self.pulse_samples < until:
            return self.pulse_samples
        return min(until, self.last_sample)

    def _look(self) -> bool:
        """Read the rock; false if a guard fails."""
        state = self.world.state()
        rotation, velocity, angular_velocity = (
            state.rotation,
            state.velocity,
            state.angular_velocity,
        )
        height = float(state.position[2])
        body_spin = rotation.T @ angular_velocity
        self.kinetic = 0.5 * float(velocity @ velocity + body_spin @ self.inertia @ body_spin)
        self.energy = self.kinetic + GRAVITY * height
        self.state = state
        if self.kinetic + self._table_kinetic() >= self.rest_energy:
            self.still_since = None
        elif self.still_since is None:
            self.still_since = (self.time, state)
        if not math.isfinite(self.energy):
            return False
        self.tilt = math.acos(max(-1.0, min(1.0, float(rotation[2, 2]))))
        self.peak_tilt = max(self.peak_tilt, self.tilt)
        slip = state.position + rotation @ self.foot - self.foot_start
        self.slip = max(self.slip, math.hypot(slip[0], slip[1]))
        self.heights = self.vertices @ rotation[2]
        deepest = height + float(self.heights.min())
        if deepest < -PENETRATION_SHARE * self.radius:
            return False
        drift = max(self.slip, self.tilt * self.radius)
        if self.sample <= self.first_push and drift > DRIFT_SHARE * self.radius:
            return False
        floor = GRAVITY * self.limits.floor
        start = GRAVITY * float(self.start.position[2]) - floor
        given = bounds.reachable_energy(start, self._impulse_so_far())
        return self.energy - floor <= given + ENERGY_SLACK * GRAVITY * self.radius

    def _impulse_so_far(self) -> float:
        """Integral of the table's absolute acceleration [m/s], as measured if driven or turning."""
        if self.driven is not None:
            return self.driven.impulse()
        if self.turns:
            return cast(engines.TurningWorld, self.world).impulse()
        return self.motion.remaining_impulse(0.0) - self.motion.remaining_impulse(self.time)

    def _table_kinetic(self) -> float:
        """Half the square of a driven table's velocity [m^2/s^2]: a rest is no common motion."""
        return 0.5 * self.driven.table()[1] ** 2 if self.driven is not None else 0.0

    def _decided(self) -> tuple[Outcome, DecidedBy] | None:
        if self.sample >= self.pulse_samples and self._rests():
            return self._side(), DecidedBy.SIMULATION
        if not self.early:
            return None
        if self.tilt > self.limits.toppled_tilt and self._falls_on():
            return Outcome.OVERTURNED, DecidedBy.NO_RETURN
        if self._proved() and (self.tilt > self.limits.toppled_tilt or self._slip_is_known()):
            return self._side(), DecidedBy.ENERGY_BOUND
        return None

    def _rests(self) -> bool:
        """Whether the rock has stood still for ``REST_TIME`` and does not creep."""
        if self.still_since is None or self.time - self.still_since[0] < self.rest_time:
            return False
        before, self.still_since = self.still_since[1], (self.time, self.state)
        way = float(np.linalg.norm(self.state.position - before.position))
        turn = float(np.linalg.norm(self.state.rotation - before.rotation)) / math.sqrt(2.0)
        return way + turn * self.radius <= CREEP_SHARE * self.radius

    def _proved(self) -> bool:
        impulse = self.motion.remaining_impulse(self.time)
        return bounds.cannot_topple(
            self.limits, self.tilt, self.energy, impulse
        ) or bounds.cannot_return(self.limits, self.tilt, self.energy, impulse)

    def _falls_on(self) -> bool:
        lowest = int(np.argmin(self.heights))
        turn = self.state.rotation
        lever = -(turn @ self.vertices[lowest])
        inertia = turn @ self.inertia @ turn.T
        return bounds.cannot_be_stopped(lever, self.state.angular_velocity, inertia, self.contact)

    def _slip_is_known(self) -> bool:
        """Whether the rest of the energy can no longer slide an upright rock past the limit.

        Friction takes mu g per unit length of sliding; one and a half times that path is allowed
        for a contact that is unloaded while the rock rocks.
        """
        limit = DISPLACED_SHARE * self.radius
        if self.slip > limit:
            return True
        if self.sample < self.pulse_samples or self.contact.friction == 0.0:
            return False
        spare = self.energy - GRAVITY * self.limits.upright_floor
        return self.slip + 1.5 * spare / (self.contact.friction * GRAVITY) <= limit

    def _side(self) -> Outcome:
        if self.tilt > self.limits.toppled_tilt:
            return Outcome.OVERTURNED
        if self.slip > DISPLACED_SHARE * self.radius:
            return Outcome.DISPLACED
        return Outcome.BALANCED

    def _ended(self, outcome: Outcome, decided_by: DecidedBy) -> Response:
        steps = (self.sample - self.begin - self.passed) * self.substeps
        return Response(outcome, decided_by, self.peak_tilt, self.tilt, self.slip, steps)


def _upright(up: Array) -> Array:
    """Smallest rotation, shape (3, 3), that takes a direction of the rock, shape (3,), upward."""
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, float(up[2]))
    return Rotation.from_rotvec(axis * (angle / sine if sine else 0.0)).as_matrix()


@lru_cache(maxsize=1024)
def _still_range(
    rock: Rock, contact: Contact, up: tuple[float, float, float], degrees: int
) -> tuple[float, float]:
    """``bounds.still_range`` of a rock that stands with ``up`` upward, turned by whole degrees."""
    hull = convex_hull(rock.vertices @ _upright(np.array(up)).T)
    try:
        settled, _ = settle(hull, STANDING_TURN)
    except InvalidInput:
        return 0.0, 0.0
    standing = replace(rock, vertices=hull.turned(settled).vertices)
    return bounds.still_range(standing, contact, math.radians(degrees))
