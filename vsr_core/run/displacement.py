"""A run on a terrain: from the first shake until the rock rests, with its trajectory.

All is told in the site's frame, relative to the terrain, in which the table's acceleration acts as
a body force. While the rock is on its seat its base is complete; once it has toppled it goes on in
a second scene, in which it is as detailed as a tumbling rock needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput
from vsr_core.motions.cosine_pulse import GroundMotion
from vsr_core.motions.six_axes import TableMotion
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome, Response, StopReason
from vsr_core.rock.body import Rock
from vsr_core.run import bounds
from vsr_core.run.overturning import ENERGY_SLACK, HALVINGS, LEAD, Settings
from vsr_core.run.reductions import Reduction
from vsr_core.run.sampling import first_step, samples, sampling
from vsr_core.run.static_limit import still_range
from vsr_core.scene import Scene, State

LOOK_TIME = 0.0075
"""Longest time between two looks at the rock [s]."""

KEPT_TIME = 0.02
"""Time between two samples of a trajectory [s]: 50 Hz."""

IMPACT_SHARE = 0.1
"""Change of velocity by contact in one look, beyond what bears the weight, that makes an impact, in
units of sqrt(g radius). The looks before and after it are kept too."""

TOUCH_SHARE = 0.01
"""Change of velocity by contact that shows that the rock touched, as a share of what gravity adds
in the same time."""

DROPPED_SHARE = 0.116
"""A rock has also toppled once its centre is this share of its radius lower than at the start: the
seed's 0.1 m for Double Rock."""

PENETRATION_SHARE = 0.03
"""Deepest penetration allowed, as a share of the rock's radius: what a rock of 1 m falls into the
ground in a step of 2 ms at 15 m/s, before any engine sees it."""

REST_SHARE, REST_TIME, REST_WAY = 2e-5, 1.5, 2e-3
"""A rock rests if for ``REST_TIME`` sqrt(radius / g) its kinetic energy stays below ``REST_SHARE``
g radius and it moves by less than ``REST_WAY`` radius."""

LONGEST_TIME, LONGEST_TIMES = 20.0, 80.0
"""Longest wait after the motion: seconds, and units of sqrt(radius / g), whichever is more."""

QUIET_STEPS = 100
"""Steps in which the engine finds what a rock at rest stands on."""

BORDER_LOOKS = 8
"""Looks between two looks at where the ground is."""


REDUCTIONS = (
    Reduction(
        "joint, servo and moving terrain",
        "the motion is prescribed, so the table's own frame is exact: gravity minus the table's "
        "acceleration",
    ),
    Reduction(
        "runs below the uplift and sliding limits",
        "forces in the friction cones at the points of contact balance weight and inertia",
    ),
    Reduction(
        "triangles of the terrain",
        "convex parts that stand out of it by less than a stated tolerance take their place",
    ),
    Reduction(
        "ground out of reach", "only what is near the rock's surface is in the engine's world"
    ),
    Reduction(
        "corners of the rock's hull",
        "its base is complete while it is on its seat; what is left out lies within a stated "
        "distance of the rest, farther once the rock has toppled",
    ),
)
"""What runs on a terrain leave out."""


@dataclass(frozen=True)
class Trajectory:
    """Motion of a rock relative to the terrain, in the site's frame.

    Attributes
    ----------
    time : ndarray, shape (n,) [s], since the start of the shaking
    position : ndarray, shape (n, 3) [m], centre of mass
    quaternion : ndarray, shape (n, 4), x y z w, takes the rest pose to the present one
    velocity : ndarray, shape (n, 3) [m/s]
    spin : ndarray, shape (n, 3) [rad/s], in the site's axes
    contact : ndarray of bool, shape (n,), whether it touched the ground since the sample before
    """

    time: Array
    position: Array
    quaternion: Array
    velocity: Array
    angular_velocity: Array
    contact: Mask

    @property
    def length(self) -> float:
        """Length of the way of the centre of mass [m]."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())

    @property
    def distance(self) -> float:
        """Distance from its start to its end [m]."""
        return float(np.linalg.norm(self.position[-1] - self.position[0]))

    @property
    def largest_speed(self) -> float:
        """Largest speed of the centre of mass [m/s]."""
        return float(np.linalg.norm(self.velocity, axis=1).max())


@dataclass(frozen=True)
class Travel:
    """Result of a run on a terrain.

    Attributes
    ----------
    response : Response, with ``slip`` up to toppling
    stop : StopReason
    trajectory : Trajectory
    """

    response: Response
    stop: StopReason
    trajectory: Trajectory


@dataclass(frozen=True)
class Site:
    """A rock on its seat in a terrain, with what its runs share.

    Attributes
    ----------
    seat : Scene, on a terrain and with a start, as detailed as it is known
    flight : Scene, of the same rock on the same terrain, for the time after toppling
    toppled_tilt : float [rad], beyond which the rock has toppled
    still : tuple of float, lowest and highest table acceleration [m/s^2] that move nothing; zeros
        where that is not known
    """

    seat: Scene
    flight: Scene
    toppled_tilt: float
    still: tuple[float, float] = (0.0, 0.0)


def travel(site: Site, motion: GroundMotion, settings: Settings, *, follow: bool = True) -> Travel:
    """Shake the rock and follow it until it rests.

    Never raises for physics: a run that fails its guards at every step tried is ``UNSTABLE``.

    Parameters
    ----------
    site : Site
    motion : GroundMotion, along (cos yaw, -sin yaw)
    settings : Settings; ``reduce`` lets the run begin shortly before the first push, and go on in
        the lighter scene once the rock toppled
    follow : bool
        Whether to go on after toppling; without, only the outcome and the way up to there are
        wanted.

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
    if settings.reduce and motion.peak_acceleration < min(-site.still[0], site.still[1]):
        assert site.seat.start is not None
        stands = Response(Outcome.BALANCED, DecidedBy.NO_UPLIFT_BOUND, 0.0, 0.0, 0.0, 0)
        return Travel(stands, StopReason.REST, _trajectory([(0.0, site.seat.start, True)]))
    time_step = first_step(motion, None, settings.time_step)
    for _ in range(HALVINGS + 1):
        found = _Run(site, motion, settings, time_step).to_the_end(follow)
        if found.response.outcome is not Outcome.UNSTABLE:
            break
        time_step /= 2.0
    return found


def topple(site: Site, motion: GroundMotion, settings: Settings) -> Response:
    """Outcome of one run, without what follows when the rock has toppled."""
    return travel(site, motion, settings, follow=False).response


def still(scene: Scene, time_step: float) -> tuple[float, float]:
    """Range of table accelerations [m/s^2] in which a rock on its seat stays at rest.

    Parameters
    ----------
    scene : Scene, on a terrain, with the rock at rest as its start
    time_step : float [s]
    """
    world = cast(engines.GroundWorld, engines.load("bullet").build(scene, time_step, 1))
    world.advance([0.0] * QUIET_STEPS)
    along = np.array([math.cos(scene.yaw), -math.sin(scene.yaw), 0.0])
    centre = world.state().position
    return still_range(*world.footing(), centre, scene.contact.friction, along)


def settled(scene: Scene, time_step: float) -> State:
    """Where a rock comes to rest that is set on its terrain as scanned, unshaken.

    Parameters
    ----------
    scene : Scene, on a terrain; the rock's ``start`` is its pose in the scan
    time_step : float [s]

    Raises
    ------
    InvalidInput
        If it does not come to rest there, or not near where it was scanned.
    """
    assert scene.start is not None
    radius = scene.rock.radius
    world = engines.load("bullet").build(scene, time_step, 1)
    rest, inertia = _Rest(radius), _inertia(scene.rock)
    for look in range(math.ceil(LONGEST_TIME / LOOK_TIME)):
        world.advance([0.0] * math.ceil(LOOK_TIME / time_step))
        state = world.state()
        if rest.seen(look * LOOK_TIME, state, _kinetic(inertia, state)):
            break
    else:
        raise InvalidInput(
            f"a rock that still moves after {LONGEST_TIME:g} s on its seat",
            "it stands where it was scanned",
            "look at the closing of the scan and its cut (`vsr prep`)",
        )
    way = float(np.linalg.norm(state.position - scene.start.position))
    turn = _angle(state.rotation @ scene.start.rotation.T)
    if way > 0.1 * radius or turn > math.radians(15.0):
        raise InvalidInput(
            f"a rock that moves by {way:.3g} m and turns by {math.degrees(turn):.1f} deg unshaken",
            "it stands where it was scanned, to a tenth of its radius and 15 deg",
            "look at the closing of the scan and its cut (`vsr prep`)",
        )
    return replace(state, velocity=np.zeros(3), angular_velocity=np.zeros(3))


class _Run:
    """One attempt at one time step."""

    def __init__(
        self, site: Site, motion: GroundMotion, settings: Settings, time_step: float
    ) -> None:
        self.site, self.motion, self.settings = site, motion, settings
        scene = site.seat
        assert scene.start is not None
        assert scene.terrain is not None
        self.rock, self.radius = scene.rock, scene.rock.radius
        self.inertia = _inertia(scene.rock)
        self.terrain = scene.terrain
        most = sampling(motion, None, time_step, max(1, int(LOOK_TIME / time_step))).substeps
        # Bullet finds the steps in a sample by division, and one less where that is not exact.
        sampled = sampling(motion, None, time_step, 1 << (most.bit_length() - 1))
        self.interval, self.substeps = sampled.interval, sampled.substeps
        self.pulse_samples = sampled.pulse_samples
        wait = max(LONGEST_TIME, LONGEST_TIMES * math.sqrt(self.radius / GRAVITY))
        self.last_sample = self.pulse_samples + math.ceil(wait / self.interval)
        self.look_every = max(1, int(LOOK_TIME / self.interval))
        self.values = samples(motion, None, self.interval, self.last_sample)
        self.along = np.array([math.cos(scene.yaw), -math.sin(scene.yaw), 0.0])
        self.foot = np.array([0.0, 0.0, -self.rock.height])
        self.floor = GRAVITY * (self.terrain.lowest - self.radius)
        self.world = self._enter(scene)
        self.start = self.state = scene.start
        self.begin = self.sample = self._resting() if settings.reduce else 0
        self.looks = 0
        self.time = self.sample * self.interval
        self.tilt = self.peak_tilt = self.slip = 0.0
        self.toppled = False
        self.rest = _Rest(self.radius)
        self.kept: list[tuple[float, State, bool]] = [(0.0, self.state, True)]
        if self.begin:
            self.kept.append((self.time, self.state, True))
        self.touched = True

    def to_the_end(self, follow: bool) -> Travel:
        values = self.values.tolist()
        while self.sample < self.last_sample:
            until = min(self.sample + self.look_every, self.last_sample)
            if self.sample < self.pulse_samples < until:
                until = self.pulse_samples
            self.world.advance(values[self.sample : until])
            decided = self._look(until) or self._decided(follow)
            if decided:
                return self._ended(*decided)
        outcome = Outcome.OVERTURNED if self.toppled else Outcome.UNSETTLED
        return self._ended(outcome, StopReason.TIME)

    def _resting(self) -> int:
        """Number of samples that are left out: up to shortly before the first that moves the rock.

        Until then it stays where it stands.
        """
        lowest, highest = self.site.still
        if not lowest < 0.0 < highest:
            return 0
        shaken = self.values[: self.pulse_samples]  # what is not a number is a push
        push = int(np.argmax(np.append(~((lowest <= shaken) & (shaken <= highest)), True)))
        return max(0, push - LEAD)

    def _look(self, until: int) -> tuple[Outcome, StopReason] | None:
        """Read the rock; what ends the run if a guard fails or there is no ground any more."""
        before, state = self.state, self.world.state()
        if not _finite(state):
            return Outcome.UNSTABLE, StopReason.UNDONE
        self.state, self.kinetic = state, _kinetic(self.inertia, state)
        self._keep(before, until)
        self.sample, self.time = until, until * self.interval
        self.looks += 1
        closely = self.looks % BORDER_LOOKS == 0
        if not self._sound(closely):
            return Outcome.UNSTABLE, StopReason.UNDONE
        if closely and self.terrain.depth(state.position) is None:
            outcome = Outcome.OVERTURNED if self.toppled else Outcome.UNSETTLED
            return outcome, StopReason.LEFT_TERRAIN
        return None

    def _decided(self, follow: bool) -> tuple[Outcome, StopReason] | None:
        """What ends a sound run: it toppled and is not followed, or it rests."""
        if not self.toppled and self._topples():
            if not self._sound(closely=True):  # it may have sunk into the ground
                return Outcome.UNSTABLE, StopReason.UNDONE
            self.toppled = True
            if not follow:
                return Outcome.OVERTURNED, StopReason.UNDONE
            if self.settings.reduce:
                self._go_on_in(self.site.flight)
        at_rest = self.rest.seen(self.time, self.state, self.kinetic)
        if at_rest and self.sample >= self.pulse_samples:
            return self._side(), StopReason.REST
        return None

    def _enter(self, scene: Scene) -> engines.GroundWorld:
        engine = engines.load(self.settings.engine)
        step = self.interval / self.substeps
        return cast(
            engines.GroundWorld, engine.build(scene, step, self.substeps, self.settings.solver)
        )

    def _go_on_in(self, scene: Scene) -> None:
        """Change to another scene of the same rock; raised so that it does not start inside it."""
        self.world = self._enter(scene)
        self.world.put(self.state)
        self.state = clear(self.world, self.state)

    def _topples(self) -> bool:
        drop = float(self.start.position[2] - self.state.position[2])
        return self.tilt > self.site.toppled_tilt or drop > DROPPED_SHARE * self.radius

    def _side(self) -> Outcome:
        if self.toppled:
            return Outcome.OVERTURNED
        return Outcome.DISPLACED if self.slip > DISPLACED_SHARE * self.radius else Outcome.BALANCED

    def _keep(self, before: State, until: int) -> None:
        """Note contact since the look before, and keep the state if its time has come."""
        state, duration = self.state, (until - self.sample) * self.interval
        given = -self.values[self.sample : until].sum() * self.interval * self.along
        given[2] -= GRAVITY * duration
        change = float(np.linalg.norm(state.velocity - before.velocity - given))
        touched_before = self.touched
        self.touched |= change > TOUCH_SHARE * GRAVITY * duration
        impact = change > GRAVITY * duration + IMPACT_SHARE * math.sqrt(GRAVITY * self.radius)
        time = until * self.interval
        if impact and self.kept[-1][0] < self.time:
            self.kept.append((self.time, before, touched_before))
        if impact or time >= self.kept[-1][0] + KEPT_TIME - 1e-9:
            self.kept.append((time, state, self.touched))
            self.touched = False

    def _sound(self, closely: bool) -> bool:
        """Whether the guards hold: no energy from nowhere, not inside the ground."""
        state = self.state
        energy = self.kinetic + GRAVITY * float(state.position[2])
        upright = float(state.rotation[2] @ self.start.rotation[2])
        self.tilt = math.acos(max(-1.0, min(1.0, upright)))
        self.peak_tilt = max(self.peak_tilt, self.tilt)
        if not self.toppled:
            shift = state.position - self.start.position
            shift = shift + (state.rotation - self.start.rotation) @ self.foot
            self.slip = max(self.slip, math.hypot(shift[0], shift[1]))
        impulse = self.motion.remaining_impulse(0.0) - self.motion.remaining_impulse(self.time)
        start = GRAVITY * float(self.start.position[2]) - self.floor
        most = bounds.reachable_energy(start, impulse) + ENERGY_SLACK * GRAVITY * self.radius
        if energy - self.floor > most:
            return False
        if not closely:
            return True
        depth = self.terrain.depth(state.position) or 0.0
        return max(depth, self.world.contacts()[1]) <= PENETRATION_SHARE * self.radius

    def _ended(self, outcome: Outcome, stop: StopReason) -> Travel:
        if self.kept[-1][0] < self.time:
            self.kept.append((self.time, self.state, self.touched))
        response = Response(
            outcome,
            DecidedBy.SIMULATION,
            self.peak_tilt,
            self.tilt,
            self.slip,
            (self.sample - self.begin) * self.substeps,
        )
        return Travel(response, stop, _trajectory(self.kept))


class _Rest:
    """Whether a rock has stood still for a while."""

    def __init__(self, radius: float) -> None:
        self.energy = REST_SHARE * GRAVITY * radius
        self.time = REST_TIME * math.sqrt(radius / GRAVITY)
        self.way, self.radius = REST_WAY * radius, radius
        self.since: tuple[float, State] | None = None

    def seen(self, time: float, state: State, kinetic: float) -> bool:
        """Take note of a look; true if the rock rests."""
        if kinetic > self.energy:
            self.since = None
            return False
        if self.since is None:
            self.since = time, state
        if time - self.since[0] < self.time:
            return False
        before, self.since = self.since[1], (time, state)
        way = float(np.linalg.norm(state.position - before.position))
        turn = float(np.linalg.norm(state.rotation - before.rotation)) / math.sqrt(2.0)
        return way + turn * self.radius <= self.way


def clear(world: engines.GroundWorld, state: State) -> State:
    """The state, raised until the rock is no deeper in the ground than a touch."""
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


def _finite(state: State) -> bool:
    total = (
        state.position.sum()
        + state.rotation.sum()
        + state.velocity.sum()
        + state.angular_velocity.sum()
    )
    return math.isfinite(float(total))


def _inertia(rock: Rock) -> Array:
    """Inertia about the centre of mass per unit mass, in the rock's axes, shape (3, 3) [m^2]."""
    return rock.axes * (rock.inertia / rock.mass) @ rock.axes.T


def _kinetic(inertia: Array, state: State) -> float:
    """Kinetic energy per unit mass [m^2/s^2]."""
    angular_velocity = state.angular_velocity @ state.rotation
    return 0.5 * float(
        state.velocity @ state.velocity + angular_velocity @ inertia @ angular_velocity
    )


def _angle(rotation: Array) -> float:
    return math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(rotation)) - 1.0))))


def _trajectory(kept: list[tuple[float, State, bool]]) -> Trajectory:
    times, states, contact = zip(*kept, strict=True)
    return Trajectory(
        np.array(times),
        np.array([state.position for state in states]),
        Rotation.from_matrix([state.rotation for state in states]).as_quat(),
        np.array([state.velocity for state in states]),
        np.array([state.angular_velocity for state in states]),
        np.array(contact),
    )
