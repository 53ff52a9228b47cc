"""A displacement run: on a terrain, from the first shake until the rock rests, with its trajectory.

Everything is in the site's frame, relative to the terrain, in which the table's acceleration acts
as a body force. While the rock is on its seat its base is complete; once it has toppled it goes on
in a second scene, in which it is as detailed as a tumbling rock needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array
from vsr_core.engines.interface import GroundWorld
from vsr_core.errors import InvalidInput
from vsr_core.motions.cosine_pulse import GroundMotion
from vsr_core.motions.six_axes import TableMotion
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome, Response, StopReason
from vsr_core.run import loop, static_limits
from vsr_core.run.cases import Settings, TerrainCase, never_starts
from vsr_core.run.guards import Rest, at_halved_steps, gained_too_much, inertia_of, kinetic_energy
from vsr_core.run.loop import LEAD, Run, first_push
from vsr_core.run.sampling import Sampling, first_step, sampling
from vsr_core.run.trajectory import Recorder, Trajectory, joined
from vsr_core.scene import Scene, State

MONITORING_TIME = 0.0075
"""Longest monitoring interval [s]."""

BORDER_INTERVALS = 8
"""Monitoring intervals from one check of where the ground is to the next."""

DROPPED_SHARE = 0.116
"""A rock has also toppled once its centre is this share of its radius lower than at the start:
0.1 m for Double Rock, as in the published set-up."""

PENETRATION_SHARE = 0.03
"""Deepest penetration allowed, as a share of the rock's radius: what a rock of 1 m falls into the
ground in a step of 2 ms at 15 m/s, before any engine sees it."""

REST_SHARE, REST_TIME, REST_PATH = 2e-5, 1.5, 2e-3
"""A rock rests if for ``REST_TIME`` sqrt(radius / g) its kinetic energy stays below ``REST_SHARE``
g radius and it moves by less than ``REST_PATH`` radius."""

LONGEST_TIME, LONGEST_TIMES = 20.0, 80.0
"""Longest wait after the motion: seconds, and units of sqrt(radius / g), whichever is more."""

QUIET_STEPS = 100
"""Steps in which the engine finds what a rock at rest stands on."""

Ending = tuple[Outcome, StopReason]

_UNSTABLE = Outcome.UNSTABLE, StopReason.UNDONE


@dataclass(frozen=True)
class DisplacementRun:
    """Result of a displacement run.

    Attributes
    ----------
    response : Response, with ``slip`` up to toppling
    stop : StopReason
    trajectory : Trajectory
    """

    response: Response
    stop: StopReason
    trajectory: Trajectory


def displace(
    case: TerrainCase, motion: GroundMotion, settings: Settings, *, follow: bool = True
) -> DisplacementRun:
    """Shake the rock and follow it until it rests.

    Never raises for physics: a run that breaks its guards at every step tried is ``UNSTABLE``.

    Parameters
    ----------
    case : TerrainCase
    motion : GroundMotion, along (cos yaw, -sin yaw)
    settings : Settings; ``reduce`` lets the run begin shortly before the first push, and go on in
        the lighter scene once the rock toppled
    follow : bool
        Whether to go on after toppling; without, only the outcome and the path up to there are
        wanted.

    Returns
    -------
    DisplacementRun

    Raises
    ------
    InvalidInput
        For a motion in several axes.
    """
    if isinstance(motion, TableMotion):
        raise InvalidInput(
            "a table in several axes under a terrain",
            "a rock on a terrain is shaken in one direction",
            "take a motion along one axis, or a flat pedestal",
        )

    def attempt(time_step: float) -> DisplacementRun:
        sampled = _sampling(motion, time_step)
        run = _set_up(case.seat, motion, settings, sampled)
        rules = DisplacementRules(case, run, settings, follow=follow)
        outcome, stop = loop.complete(run, rules)
        response = Response(
            outcome, DecidedBy.SIMULATION, run.peak_tilt, run.tilt, run.slip, run.steps
        )
        return DisplacementRun(response, stop, rules.recorder.trajectory(run))

    if never_starts(case.static_limits, motion.peak_acceleration, settings):
        return _stays(case)
    step = first_step(motion, None, settings.time_step)
    return at_halved_steps(step, attempt, lambda found: found.response.outcome is Outcome.UNSTABLE)


def respond(case: TerrainCase, motion: GroundMotion, settings: Settings) -> Response:
    """Outcome of one run on a terrain, without what follows when the rock has toppled.

    Parameters and errors are those of ``displace``.

    Parameters
    ----------
    case : TerrainCase
    motion : GroundMotion, along (cos yaw, -sin yaw)
    settings : Settings

    Returns
    -------
    Response
    """
    return displace(case, motion, settings, follow=False).response


def limits_on_seat(scene: Scene, time_step: float) -> tuple[float, float]:
    """Range of table accelerations [m/s^2] in which a rock on its seat stays at rest.

    Parameters
    ----------
    scene : Scene, on a terrain, with the rock at rest as its start
    time_step : float [s]

    Returns
    -------
    (float, float), lowest and highest; zeros where the rock does not rest by its points of contact
    """
    world = cast(GroundWorld, engines.load("bullet").build(scene, time_step, 1))
    world.advance([0.0] * QUIET_STEPS)
    centre = world.state().position
    return static_limits.on_points(*world.footing(), centre, scene.contact.friction, _along(scene))


def settled(scene: Scene, time_step: float) -> State:
    """Where a rock comes to rest that is set on its terrain as scanned, unshaken.

    Parameters
    ----------
    scene : Scene, on a terrain; the rock's ``start`` is its pose in the scan
    time_step : float [s]

    Returns
    -------
    State, at rest

    Raises
    ------
    InvalidInput
        If it does not come to rest there, or not near where it was scanned.
    """
    assert scene.start is not None
    radius = scene.rock.radius
    world = engines.load("bullet").build(scene, time_step, 1)
    rest, inertia = _rest(radius), inertia_of(scene.rock)
    for interval in range(math.ceil(LONGEST_TIME / MONITORING_TIME)):
        world.advance([0.0] * math.ceil(MONITORING_TIME / time_step))
        state, time = world.state(), interval * MONITORING_TIME
        rest.note(time, state, kinetic_energy(inertia, state))
        if rest.reached(time, state):
            break
    else:
        raise InvalidInput(
            f"a rock that still moves after {LONGEST_TIME:g} s on its seat",
            "it stands where it was scanned",
            "look at the closing of the scan and its cut (`vsr prep`)",
        )
    shift = float(np.linalg.norm(state.position - scene.start.position))
    turn = _angle(state.rotation @ scene.start.rotation.T)
    if shift > 0.1 * radius or turn > math.radians(15.0):
        raise InvalidInput(
            f"a rock that unshaken moves by {shift:.3g} m and turns by "
            f"{math.degrees(turn):.1f} deg",
            "it stands where it was scanned, to a tenth of its radius and 15 deg",
            "look at the closing of the scan and its cut (`vsr prep`)",
        )
    return replace(state, velocity=np.zeros(3), angular_velocity=np.zeros(3))


def clear(world: GroundWorld, state: State) -> State:
    """Raise a rock until it is no deeper in the ground than a touch.

    Parameters
    ----------
    world : GroundWorld, which is left in the state returned
    state : State

    Returns
    -------
    State
    """
    for _ in range(4):
        world.advance([0.0])
        deepest = world.contacts()[1]
        world.put(state)
        if deepest == 0.0:
            break
        above = np.array([0.0, 0.0, 1.2 * deepest])
        state = replace(state, position=state.position + above)
        world.put(state)
    return state


def _sampling(motion: GroundMotion, time_step: float) -> Sampling:
    most = sampling(motion, None, time_step, max(1, int(MONITORING_TIME / time_step))).substeps
    # Bullet finds the steps in a sample by division, and one less where that is not exact.
    return sampling(motion, None, time_step, 1 << (most.bit_length() - 1))


def _set_up(seat: Scene, motion: GroundMotion, settings: Settings, sampled: Sampling) -> Run:
    assert seat.start is not None
    run = loop.set_up(
        seat,
        motion,
        settings,
        sampled,
        monitored=max(1, int(MONITORING_TIME / sampled.interval)),
        wait=max(LONGEST_TIME, LONGEST_TIMES * math.sqrt(seat.rock.radius / GRAVITY)),
        start=seat.start,
    )
    run.upward = seat.start.rotation[2]
    return run


class DisplacementRules:
    """When a rock on a terrain rests, leaves it, or shows no sound run."""

    def __init__(self, case: TerrainCase, run: Run, settings: Settings, *, follow: bool) -> None:
        assert case.seat.terrain is not None
        self.case, self.settings, self.follow = case, settings, follow
        self.terrain, self.radius = case.seat.terrain, case.seat.rock.radius
        self.floor = self.terrain.lowest - self.radius
        self.rest = _rest(self.radius)
        self.recorder = Recorder(run.start, _along(case.seat))
        self.intervals = 0
        self.toppled = False

    def begin(self, run: Run) -> Ending | None:
        """Start shortly before the first push: until then the rock stays where it stands."""
        lowest, highest = self.case.static_limits
        if self.settings.reduce and lowest < 0.0 < highest:
            shaken = run.values[: run.sampled.pulse_samples]
            run.skip(max(0, first_push(shaken, self.case.static_limits) - LEAD))
            if run.sample:
                self.recorder.keep(run.time, run.state)
        return None

    def judge(self, run: Run, since: int) -> Ending | None:
        """End a run that is not sound, has left the ground, has toppled or rests."""
        if not run.monitor():
            run.sample = since
            return _UNSTABLE
        self.recorder.note(run, since)
        self.intervals += 1
        closely = self.intervals % BORDER_INTERVALS == 0
        if not self._sound(run, closely=closely):
            return _UNSTABLE
        if closely and self.terrain.depth(run.state.position) is None:
            outcome = Outcome.OVERTURNED if self.toppled else Outcome.UNSETTLED
            return outcome, StopReason.LEFT_TERRAIN
        return self._decided(run)

    def out_of_time(self, run: Run) -> Ending:
        """Overturned, or without a verdict."""
        return Outcome.OVERTURNED if self.toppled else Outcome.UNSETTLED, StopReason.TIME

    def _decided(self, run: Run) -> Ending | None:
        """What ends a sound run: it toppled and is not followed, or it rests."""
        if not self.toppled and self._topples(run):
            if not self._sound(run, closely=True):  # it may have sunk into the ground
                return _UNSTABLE
            self.toppled = True
            if not self.follow:
                return Outcome.OVERTURNED, StopReason.UNDONE
            if self.settings.reduce:
                self._go_on_in(run, self.case.flight)
        self.rest.note(run.time, run.state, run.kinetic)
        at_rest = self.rest.reached(run.time, run.state)
        return (self._side(run), StopReason.REST) if at_rest and not run.shaken else None

    def _go_on_in(self, run: Run, scene: Scene) -> None:
        """Change to another scene of the same rock, raised so that it does not start inside it."""
        world = cast(GroundWorld, loop.enter(scene, self.settings, run.sampled))
        world.put(run.state)
        run.world, run.state = world, clear(world, run.state)
        self.recorder.go_on_from(run.state)

    def _topples(self, run: Run) -> bool:
        drop = float(run.start.position[2] - run.state.position[2])
        return run.tilt > self.case.toppled_tilt or drop > DROPPED_SHARE * self.radius

    def _side(self, run: Run) -> Outcome:
        if self.toppled:
            return Outcome.OVERTURNED
        return Outcome.DISPLACED if run.slip > DISPLACED_SHARE * self.radius else Outcome.BALANCED

    def _sound(self, run: Run, *, closely: bool) -> bool:
        """Whether the guards hold: no energy from nowhere, not inside the ground."""
        run.note_tilt()
        if not self.toppled:
            run.note_slip()
        height, start = float(run.state.position[2]), float(run.start.position[2])
        energy = run.kinetic + GRAVITY * height
        if gained_too_much(energy, start, self.floor, run.prescribed_impulse, self.radius):
            return False
        if not closely:
            return True
        depth = self.terrain.depth(run.state.position) or 0.0
        deepest = cast(GroundWorld, run.world).contacts()[1]
        return max(depth, deepest) <= PENETRATION_SHARE * self.radius


def _stays(case: TerrainCase) -> DisplacementRun:
    """Result of a run that never starts."""
    assert case.seat.start is not None
    stands = Response(Outcome.BALANCED, DecidedBy.NO_UPLIFT_BOUND, 0.0, 0.0, 0.0, 0)
    trajectory = joined([(0.0, case.seat.start, True)])
    return DisplacementRun(stands, StopReason.REST, trajectory)


def _rest(radius: float) -> Rest:
    return Rest(
        energy=REST_SHARE * GRAVITY * radius,
        duration=REST_TIME * math.sqrt(radius / GRAVITY),
        creep=REST_PATH * radius,
        radius=radius,
    )


def _along(scene: Scene) -> Array:
    """Direction of the shaking in the site's frame, shape (3,)."""
    return np.array([math.cos(scene.yaw), -math.sin(scene.yaw), 0.0])


def _angle(rotation: Array) -> float:
    return math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(rotation)) - 1.0))))
