"""One recorded shake-table test of one member of an ensemble."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.judge import proofs
from vsr_core.motions.records.recorded_motion import RecordedMotion
from vsr_core.motions.records.trace import Trace
from vsr_core.outcome import Response
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.scene import Contact, Scene
from vsr_core.validation.priors import Member

ENGINE = "nonsmooth"
"""Engine in which the tests are simulated."""

STEP_SHARE = 0.01
"""Time step as a share of sqrt(radius / g), 2.4 ms for a rock of a metre. Half of it changes the
outcome of single doubtful tests, as a grain of sand would, and hardly how many overturn."""


def standing_case(rock: Rock, member: Member) -> Case:
    """A rock on a level table, turned so that its drive is along +x."""
    contact = Contact(member.friction, member.restitution)
    return prepare(Scene(rock, contact, -member.direction), proofs.barrier(rock), reduce=True)


def shaken(
    case: Case, accelerations: Sequence[Array], interval: float, amplitude: float
) -> list[Response]:
    """Responses to recorded accelerations of the table.

    Parameters
    ----------
    accelerations : sequence of ndarray, each of shape (n,) [m/s^2], along the drive
    interval : float [s], between their samples
    amplitude : float [1], factor on them
    """
    step = STEP_SHARE * math.sqrt(case.full.rock.radius / GRAVITY)
    motions = [RecordedMotion(Trace(amplitude * values, interval)) for values in accelerations]
    return simulate_all(case, motions, Settings(step, engine=ENGINE))
