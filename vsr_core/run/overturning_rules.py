"""The rules that begin and end a run on a flat pedestal."""

from __future__ import annotations

import math
from typing import cast

import numpy as np

from vsr_core import GRAVITY
from vsr_core.engines.interface import DrivenWorld, TurningWorld
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import DISPLACED_SHARE, DecidedBy, Outcome
from vsr_core.run import loop, proofs
from vsr_core.run.cases import Case, Settings
from vsr_core.run.guards import ENERGY_SLACK, Rest, gained_too_much
from vsr_core.run.loop import LEAD, Run, first_push
from vsr_core.run.sampling import MOST_SUBSTEPS, sampling
from vsr_core.run.static_limits import as_it_stands
from vsr_core.scene import Scene

MONITORED_STEPS = 48
"""Time steps in a monitoring interval."""

PENETRATION_SHARE = 0.01
"""Deepest penetration allowed, as a share of the rock's radius."""

REST_SHARE, REST_OF_BARRIER = 1e-6, 1e-3
"""Kinetic energy of a rock at rest, as a share of g times its radius, and of what it has to climb
to topple: a needle that hesitates on its edge is not at rest."""

REST_TIME = 0.28
"""Time with that little energy that makes a rest, in units of sqrt(radius / g)."""

CREEP_SHARE = 1e-4
"""Longest path of a rock in that time, as a share of its radius: even in the longest wait it would
not creep a sixth of the path that counts as displaced."""

STATIC_SHARE = 0.95
"""Share of the static limits that is used once the rock has moved."""

DRIFT_SHARE = 0.01
"""Longest path of a rock that nothing has moved yet, as a share of its radius."""

LEAST_WAIT, WAITING_TIMES = 4.0, 40.0
"""Longest wait after the motion: seconds, as in the published set-up, and units of
sqrt(radius / g), whichever is more."""

Ending = tuple[Outcome, DecidedBy]

_UNSTABLE = Outcome.UNSTABLE, DecidedBy.SIMULATION


def set_up(simulated: Scene, motion: GroundMotion, settings: Settings, time_step: float) -> Run:
    """A run on a flat pedestal before its first step.

    Parameters
    ----------
    time_step : float [s], of this attempt
    """
    # Where the table turns, what the rock feels depends on its state in every step.
    turns = motion.columns == 9
    sampled = sampling(motion, simulated.drive, time_step, 1 if turns else MOST_SUBSTEPS)
    unit = math.sqrt(simulated.rock.radius / GRAVITY)
    return loop.set_up(
        simulated,
        motion,
        settings,
        sampled,
        monitored=max(1, MONITORED_STEPS // sampled.substeps),
        wait=max(LEAST_WAIT, WAITING_TIMES * unit),
    )


class OverturningRules:
    """When a rock on a flat pedestal has overturned, stays upright, or shows no sound run."""

    def __init__(self, case: Case, simulated: Scene, run: Run, *, reduce: bool) -> None:
        rock, self.contact = simulated.rock, simulated.contact
        self.limits, self.radius = case.limits, rock.radius
        self.kept_tilt = math.pi if simulated is case.full else simulated.kept_tilt
        turns = run.motion.columns == 9
        self.turning = cast(TurningWorld, run.world) if turns else None
        self.driven = cast(DrivenWorld, run.world) if simulated.drive else None
        # The proofs assume the prescribed motion, which a servo's table does not quite follow, and
        # gravity along z, which a table that turns has not; and they know of no energy in springs.
        rigid = self.contact.stiffness is None
        self.proves = reduce and rigid and not (self.driven or self.turning)
        climb = max(self.limits.edge_height - self.limits.upright_floor, 0.0)
        self.rest = Rest(
            energy=GRAVITY * min(REST_SHARE * self.radius, REST_OF_BARRIER * climb),
            duration=REST_TIME * math.sqrt(self.radius / GRAVITY),
            creep=CREEP_SHARE * self.radius,
            radius=self.radius,
        )
        # A rock on the move from its start is never at rest before the motion.
        self.first_push = -1
        if simulated.start is None:
            several = run.values.ndim > 1
            self.first_push = 0 if several else first_push(run.values, case.static_limits)

    def begin(self, run: Run) -> Ending | None:
        """Start at the first push: until then nothing moves the rock."""
        if not self._sound(run):
            return _UNSTABLE
        if run.kinetic > ENERGY_SLACK * GRAVITY * self.radius:
            return Outcome.UNSETTLED, DecidedBy.SIMULATION
        if self.proves:
            run.skip(max(0, min(self.first_push, run.sampled.pulse_samples)))
        return None

    def judge(self, run: Run, since: int) -> Ending | None:
        """End a run that is not sound, is decided, or has to be repeated with all vertices."""
        if not self._sound(run):
            return _UNSTABLE
        if run.peak_tilt > self.kept_tilt:
            return self.out_of_time(run)
        decided = self._decided(run)
        if decided is None and self.proves and run.values.ndim == 1 and run.shaken:
            self._pass_over_rest(run)
        return decided

    def out_of_time(self, run: Run) -> Ending:
        """A side if it is proved; by now a driven table stands as still as its motion wants it."""
        side = self._side(run) if self._proved(run) else Outcome.UNSETTLED
        return side, DecidedBy.SIMULATION

    def _sound(self, run: Run) -> bool:
        """Read the rock; false if a guard fails."""
        if not run.monitor():
            return False
        # A rest is no motion along with a driven table.
        table = 0.5 * self.driven.table()[1] ** 2 if self.driven else 0.0
        self.rest.note(run.time, run.state, run.kinetic + table)
        run.note_tilt()
        run.note_slip()
        height = float(run.state.position[2])
        self.heights = run.rock.vertices @ run.state.rotation[2]
        if height + float(self.heights.min()) < -PENETRATION_SHARE * self.radius:
            return False
        drift = max(run.slip, run.tilt * self.radius)
        if run.sample <= self.first_push and drift > DRIFT_SHARE * self.radius:
            return False
        self.energy = run.kinetic + GRAVITY * height
        start, floor = float(run.start.position[2]), self.limits.floor
        return not gained_too_much(self.energy, start, floor, self._impulse(run), self.radius)

    def _impulse(self, run: Run) -> float:
        """Integral of the table's absolute acceleration [m/s], as measured if driven or turning."""
        measured = self.driven or self.turning
        return measured.impulse() if measured else run.prescribed_impulse

    def _decided(self, run: Run) -> Ending | None:
        if not run.shaken and self.rest.reached(run.time, run.state):
            return self._side(run), DecidedBy.SIMULATION
        if not self.proves:
            return None
        lies = run.tilt > self.limits.toppled_tilt
        if lies and self._falls_on(run):
            return Outcome.OVERTURNED, DecidedBy.NO_RETURN
        if self._proved(run) and (lies or self._slip_is_known(run)):
            return self._side(run), DecidedBy.ENERGY_BOUND
        return None

    def _pass_over_rest(self, run: Run) -> None:
        """Go on at the next push if the rock rests: until then nothing moves it."""
        if run.tilt > self.limits.toppled_tilt or not self.rest.reached(run.time, run.state):
            return
        lowest, highest = as_it_stands(run.rock, self.contact, run.state.rotation)
        ahead = run.values[run.sample : run.sampled.pulse_samples]
        push = first_push(ahead, (STATIC_SHARE * lowest, STATIC_SHARE * highest))
        run.skip(max(0, push - LEAD))

    def _proved(self, run: Run) -> bool:
        impulse = run.motion.remaining_impulse(run.time)
        return proofs.cannot_topple(
            self.limits, run.tilt, self.energy, impulse
        ) or proofs.cannot_return(self.limits, run.tilt, self.energy, impulse)

    def _falls_on(self, run: Run) -> bool:
        turn = run.state.rotation
        lever = -(turn @ run.rock.vertices[int(np.argmin(self.heights))])
        inertia = turn @ run.inertia @ turn.T
        velocity, contact = run.state.angular_velocity, self.contact
        return proofs.cannot_be_stopped(
            lever, velocity, inertia, contact.friction, contact.rolling_friction
        )

    def _slip_is_known(self, run: Run) -> bool:
        """Whether the rest of the energy can no longer slide an upright rock past the limit.

        Friction takes mu g per unit length of sliding; one and a half times that path is allowed
        for a contact that is unloaded while the rock rocks.
        """
        limit = DISPLACED_SHARE * self.radius
        if run.slip > limit:
            return True
        if run.shaken or self.contact.friction == 0.0:
            return False
        spare = self.energy - GRAVITY * self.limits.upright_floor
        return run.slip + 1.5 * spare / (self.contact.friction * GRAVITY) <= limit

    def _side(self, run: Run) -> Outcome:
        if run.tilt > self.limits.toppled_tilt:
            return Outcome.OVERTURNED
        if run.slip > DISPLACED_SHARE * self.radius:
            return Outcome.DISPLACED
        return Outcome.BALANCED
