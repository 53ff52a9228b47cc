"""One recorded shake-table test of one member of an ensemble."""

from __future__ import annotations

import math
from dataclasses import replace

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.records.recorded_motion import RecordedMotion
from vsr_core.motions.records.trace import Trace
from vsr_core.outcome import Response
from vsr_core.rock.body import Rock
from vsr_core.rock.hull import touching
from vsr_core.rock.reduction import lightened, on_bounding_box
from vsr_core.run import proofs
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene
from vsr_core.validation.priors import Member

STEP_SHARE = 0.01
"""Time step as a share of sqrt(radius / g), 2.4 ms for a rock of a metre. Half of it changes the
outcome of single doubtful tests, as a grain of sand would, and hardly how many overturn."""

COMPLETE_TILT, TOLERANCE = math.radians(20.0), 0.002
"""Vertices that touch below this tilt all stay; the rest of the hull keeps within this share of the
radius. With a step as fine as can be, no tilt of the tests tried was different."""

PAST_TOPPLING = math.radians(4.0)
"""Vertices that touch only this far beyond the tilt of a toppled rock are left out [rad]."""


def standing_case(rock: Rock, member: Member) -> Case:
    """A rock on a slab, turned so that the drive of the table is along its +x.

    A slab and not the plane that ``reduce`` takes for hulls: on a plane Bullet finds one corner of
    a landing edge at a time and loses too much in each impact. A pulse has few of them, a record
    of an earthquake hundreds.

    Parameters
    ----------
    rock : Rock
    member : Member

    Returns
    -------
    Case
    """
    contact = Contact(member.friction, member.restitution)
    limits = proofs.barrier(rock)
    case = prepare(Scene(rock, contact, -member.azimuth), limits, reduce=True)
    kept = min(limits.toppled_tilt + PAST_TOPPLING, math.pi)
    hull = rock.hull
    corners = touching(hull, kept)
    corners[on_bounding_box(hull.vertices, rock.axes)] = True
    part = replace(rock, vertices=hull.vertices[corners])
    base = touching(hull, COMPLETE_TILT)[corners]
    lighter = lightened(part, TOLERANCE * rock.radius, base)
    return replace(
        case,
        full=replace(case.full, pedestal="box"),
        scene=replace(case.scene, rock=lighter, kept_tilt=kept, pedestal="box"),
    )


def shaken(case: Case, acceleration: Array, interval: float, amplitude: float) -> Response:
    """Response to a recorded acceleration of the table.

    Parameters
    ----------
    case : Case, from ``standing_case``
    acceleration : ndarray, shape (n,) [m/s^2], along the drive
    interval : float [s], between its samples
    amplitude : float [1], factor on it

    Returns
    -------
    Response
    """
    step = STEP_SHARE * math.sqrt(case.full.rock.radius / GRAVITY)
    motion = RecordedMotion(Trace(amplitude * acceleration, interval))
    return simulate(case, motion, Settings(step))
