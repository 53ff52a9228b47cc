"""Soft contact: springs and dashpots of growing stiffness, as discrete-element codes have them."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from vsr_core import GRAVITY
from vsr_core.rock.body import Rock
from vsr_core.run import input_checks
from vsr_core.run.input_checks import longest_step_on_springs
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box, frustum, unit
from vsr_core.verification.stability import ExtremeCase, Measured, sweep
from vsr_core.verification.stability._trial import boundary, checked_world, lifted, same, step_of

SINK = "depth [m] at rest; m g / (4 k), four points under a face; relative"
REBOUND = "speed after / before a flat landing; spring and dashpot that do not pull; absolute"
BOUNDARY = "first overturning PGA [g] on well damped springs; Housner's; relative"

SPEED = 0.1
"""Speed of a landing in units of sqrt(g radius)."""

BLOCK = box(1.0, 1.0, 2.0)


def springs(
    rock: Rock, stiffness: float, damping: float = 1.0, restitution: float = 0.0
) -> Contact:
    """Contact of a stiffness [N/m] and a share of the damping that is critical on four points.

    Parameters
    ----------
    stiffness : float [N/m], of a point of contact
    """
    dashpot = damping * math.sqrt(stiffness * rock.mass)
    return Contact(GRIPPING, restitution, stiffness=stiffness, damping=dashpot)


def fine(rock: Rock, contact: Contact, share: float = 0.7) -> float:
    """A ``share`` of the longest time step [s] that the program takes for those springs.

    Returns
    -------
    float [s]
    """
    return share * longest_step_on_springs(contact, rock.mass)


def sink(rock: Rock, contact: Contact, step: float, engine: str = "bullet") -> Measured:
    """Depth to which a rock sinks at rest.

    Parameters
    ----------
    step : float [s]
    """
    world = checked_world(Scene(rock, contact), step, engine)
    world.advance([0.0] * 100)
    assert contact.stiffness is not None
    expected = rock.mass * GRAVITY / (4.0 * contact.stiffness)
    return same(rock.height - float(world.state().position[2]), expected, expected)


def _sink(rock: Rock, stiffness: float, engine: str, restitution: float = 0.0) -> Measured:
    contact = springs(rock, stiffness, 1.0, restitution)
    return sink(rock, contact, min(fine(rock, contact), step_of(rock)), engine)


def _rebound(damping: float, stiffness: float, share: float, engine: str) -> Measured:
    """Flat landing in free space, at a ``share`` of the longest step."""
    contact, speed = springs(BLOCK, stiffness, damping), SPEED * GRAVITY * unit(BLOCK)
    start = lifted(BLOCK, 0.01 * BLOCK.radius, speed)
    step = fine(BLOCK, contact, share)
    world = checked_world(Scene(BLOCK, contact, start=start, gravity=0.0), step, engine)
    period = 2.0 * math.pi * math.sqrt(BLOCK.mass / (4.0 * stiffness))
    world.advance([0.0] * math.ceil((0.01 * BLOCK.radius / speed + 5.0 * period) / step))
    after = float(world.state().velocity[2]) / speed
    return same(after, input_checks.rebound(contact, BLOCK.mass), 1.0)


def _landing(stiffness: float, damping: float) -> ExtremeCase:
    name = f"landing at {stiffness:g} N/m, damping {damping:g}"
    measure = partial(_rebound, damping, stiffness, 0.7, "bullet")
    return ExtremeCase(name, "stiffness", stiffness, "N/m", REBOUND, 0.03, measure)


def _boundary(stiffness: float, engine: str) -> Measured:
    contact = springs(BLOCK, stiffness)
    return boundary(Scene(BLOCK, contact), 0.2, fine(BLOCK, contact), 0.03, engine)


def _small_and_soft(stiffness: float, engine: str) -> Measured:
    """The 350 kg that lean by 8 deg at rest (PHYSICS 5.6), as a box."""
    side = (350.0 / 2110.0 / 2.0) ** (1.0 / 3.0)
    rock = box(side, side, 2.0 * side)
    return sink(rock, Contact(GRIPPING, stiffness=stiffness, damping=1e4), step_of(rock), engine)


def _negative(stiffness: float, engine: str) -> Measured:
    return sink(BLOCK, Contact(GRIPPING, stiffness=stiffness, damping=-1.0), 1e-4, engine)


SINKING = ("stiffness", "N/m", SINK, 0.03)

HULL = frustum((1.0, 1.0), (0.6, 0.6), 2.0)

CASES = (
    *sweep("sinking at {x:g} N/m", SINKING, 10.0 ** np.arange(3.0, 11.0), partial(_sink, BLOCK)),
    *(_landing(k, z) for k in (1e8, 1e10) for z in (0.0, 0.1, 1.0, 3.0)),
    *sweep("landing at {x:g} of the longest step", ("step / longest", "1", REBOUND, 0.03),
           (0.1, 1.0, 2.0, 20.0), partial(_rebound, 0.1, 1e8)),
    *sweep("boundary at {x:g} N/m", ("stiffness", "N/m", BOUNDARY, 0.03), (3e7, 1e8, 1e9),
           _boundary),
    *sweep("350 kg on 1e6 N/m", SINKING, (1e6,), _small_and_soft),
    *sweep("springs and a restitution", SINKING, (1e8,), partial(_sink, BLOCK, restitution=0.5)),
    *sweep("springs under a hull", SINKING, (1e8,), partial(_sink, HULL)),
    *sweep("springs in {engine}", SINKING, (1e8,), partial(_sink, BLOCK), ["mujoco"]),
    *sweep("damping below 0", SINKING, (1e8,), _negative),
)  # fmt: skip
