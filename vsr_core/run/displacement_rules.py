"""The rules that begin and end a displacement run.

Everything is in the site's frame, relative to the terrain, in which the table's acceleration acts
as a body force. While the rock is on its seat its base is complete; once it has toppled it goes on
in a second scene, in which it is as detailed as a tumbling rock needs.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.engines.interface import GroundWorld
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import DISPLACED_SHARE, Outcome, StopReason
from vsr_core.run import loop
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.guards import Rest, gained_too_much
from vsr_core.run.loop import LEAD, Run, first_push
from vsr_core.run.sampling import Sampling, sampling
from vsr_core.run.trajectory import Recorder
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

TREMBLES_SHARE, STAYS_SHARE = 2e-4, 0.05
"""Kinetic energy, as a share of g radius, of a rock that only trembles when time is up: with it its
centre could climb a five-thousandth of its radius. And the way, as a share of the radius, that it
may have gone in the second half of the wait: it stands or lies where it is."""

LONGEST_TIME, LONGEST_TIMES = 20.0, 80.0
"""Longest wait after the motion: seconds, and units of sqrt(radius / g), whichever is more."""

QUIET_STEPS = 100
"""Steps in which the engine finds what a rock at rest stands on."""

Ending = tuple[Outcome, StopReason]

_UNSTABLE = Outcome.UNSTABLE, StopReason.UNDONE


def clear(world: GroundWorld, state: State) -> State:
    """Raise a rock until it is no deeper in the ground than a touch."""
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


def sampled_for(motion: GroundMotion, time_step: float) -> Sampling:
    """Sampling of a motion.

    Parameters
    ----------
    time_step : float [s], the largest allowed
    """
    most = sampling(motion, None, time_step, max(1, int(MONITORING_TIME / time_step))).substeps
    # Bullet finds the steps in a sample by division, and one less where that is not exact.
    return sampling(motion, None, time_step, 1 << (most.bit_length() - 1))


def set_up(seat: Scene, motion: GroundMotion, settings: Settings, sampled: Sampling) -> Run:
    """A displacement run before its first step."""
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
        self.rest = rest_of(self.radius)
        self.recorder = Recorder(run.start, along(case.seat))
        self.intervals = 0
        self.toppled = False
        self.middle = run.start.position

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
        if 2 * run.sample < run.sampled.pulse_samples + run.last_sample:
            self.middle = run.state.position
        self.intervals += 1
        closely = self.intervals % BORDER_INTERVALS == 0
        if not self._sound(run, closely=closely):
            return _UNSTABLE
        if closely and self.terrain.depth(run.state.position) is None:
            outcome = Outcome.OVERTURNED if self.toppled else Outcome.UNSETTLED
            return outcome, StopReason.LEFT_TERRAIN
        return self._decided(run)

    def out_of_time(self, run: Run) -> Ending:
        """A rock that only trembles rests; another is overturned, or unresolved."""
        way = float(np.linalg.norm(run.state.position - self.middle))
        stays = way < STAYS_SHARE * self.radius
        if stays and run.kinetic < TREMBLES_SHARE * GRAVITY * self.radius:
            return self._side(run), StopReason.REST
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


def rest_of(radius: float) -> Rest:
    """When a rock of a radius [m] rests.

    Parameters
    ----------
    radius : float [m]
    """
    return Rest(
        energy=REST_SHARE * GRAVITY * radius,
        duration=REST_TIME * math.sqrt(radius / GRAVITY),
        creep=REST_PATH * radius,
        radius=radius,
    )


def along(scene: Scene) -> Array:
    """Direction of the shaking in the site's frame.

    Returns
    -------
    ndarray, shape (3,)
    """
    return np.array([math.cos(scene.yaw), -math.sin(scene.yaw), 0.0])
