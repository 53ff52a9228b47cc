"""Flight: what falls, flies and tumbles far from any contact."""

from __future__ import annotations

import math

from vsr_core import GRAVITY, engines
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import box, unit, upright
from vsr_core.verification.stability import Measured, sweep
from vsr_core.verification.stability._trial import BOTH, same

FALL = "way [m] fallen; g t^2 / 2; relative"
ENERGY = "energy of tumbling after eight turns / at the start; 1; relative"

TURNED = 50.0
"""Eight turns [rad]: more than a rock makes between two contacts."""


def _falls(share: float, engine: str) -> Measured:
    """Fall for 10 sqrt(radius / g), at a step of ``share`` of that unit."""
    rock = box(1.0, 1.0, 2.0)
    number = round(10.0 / share)
    step = 10.0 * unit(rock) / number
    scene = Scene(rock, Contact(0.6), pedestal="none", start=upright((0.0, 0.0, 1e3)))
    world = engines.load(engine).build(scene, step, 1)
    world.advance([0.0] * number)
    expected = 0.5 * GRAVITY * (number * step) ** 2
    return same(1e3 - float(world.state().position[2]), expected, expected)


def _tumbles(rate: float, engine: str) -> Measured:
    """Torque-free, mostly about the middle axis, at ``rate`` radians per sqrt(radius / g)."""
    rock = box(1.0, 1.5, 2.0)
    step, speed = 0.002 * unit(rock), rate / unit(rock)
    start = upright((0.0, 0.0, 0.0), angular_velocity=(speed * 0.1, speed * 1.0, speed * 0.1))
    scene = Scene(rock, Contact(0.6), pedestal="none", start=start, gravity=0.0)
    world = engines.load(engine).build(scene, step, 1)
    world.advance([0.0] * math.ceil(TURNED / speed / step))
    state = world.state()
    inertia = rock.axes * rock.inertia @ rock.axes.T
    now, before = state.rotation.T @ state.angular_velocity, start.angular_velocity
    return same(float(now @ inertia @ now) / float(before @ inertia @ before), 1.0, 1.0)


CASES = (
    *sweep("fall at {x:g} in {engine}", ("step / sqrt(R/g)", "1", FALL, 0.01),
           (0.08, 0.008, 0.0005), _falls, BOTH),
    *sweep("tumbling at {x:g} in {engine}", ("angular velocity", "rad/sqrt(R/g)", ENERGY, 0.03),
           (1.0, 5.0, 10.0), _tumbles, BOTH),
)  # fmt: skip
