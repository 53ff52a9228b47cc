"""Flight: what falls, flies and tumbles far from any contact."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.scene import Contact, Scene, State
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import box, same, unit

FALL = "way [m] fallen; g t^2 / 2; relative"
ENERGY = "energy of tumbling after eight turns / at the start; 1; relative"

TURNED = 50.0
"""Eight turns [rad]: more than a rock makes between two contacts."""


def _falls(share: float, engine: str) -> Measured:
    """Fall for 10 sqrt(radius / g), at a step of ``share`` of that unit."""
    rock = box(1.0, 1.0, 2.0)
    start = State(np.array([0.0, 0.0, 1e3]), np.eye(3), np.zeros(3), np.zeros(3))
    number = round(10.0 / share)
    step = 10.0 * unit(rock) / number
    scene = Scene(rock, Contact(0.6), pedestal="none", start=start)
    world = engines.load(engine).build(scene, step, 1)
    world.advance([0.0] * number)
    expected = 0.5 * GRAVITY * (number * step) ** 2
    return same(1e3 - float(world.state().position[2]), expected, expected)


def _tumbles(rate: float, engine: str) -> Measured:
    """Torque-free, mostly about the middle axis, at ``rate`` radians per sqrt(radius / g)."""
    rock = box(1.0, 1.5, 2.0)
    step, speed = 0.002 * unit(rock), rate / unit(rock)
    angular_velocity = speed * np.array([0.1, 1.0, 0.1])
    start = State(np.zeros(3), np.eye(3), np.zeros(3), angular_velocity)
    scene = Scene(rock, Contact(0.6), pedestal="none", start=start, gravity=0.0)
    world = engines.load(engine).build(scene, step, 1)
    world.advance([0.0] * math.ceil(TURNED / speed / step))
    state = world.state()
    inertia = rock.axes * rock.inertia @ rock.axes.T
    body = state.rotation.T @ state.angular_velocity
    return same(
        float(body @ inertia @ body) / float(angular_velocity @ inertia @ angular_velocity),
        1.0,
        1.0,
    )


CASES = (
    *(
        Case(f"fall at {x:g} in {engine}", "flight", "step / sqrt(R/g)", x, "1", FALL, 0.01,
             partial(_falls, x, engine))
        for engine in ("bullet", "mujoco") for x in (0.08, 0.008, 0.0005)
    ),
    *(
        Case(f"tumbling at {w:g} in {engine}", "flight", "spin", w, "rad/sqrt(R/g)", ENERGY, 0.03,
             partial(_tumbles, w, engine))
        for engine in ("bullet", "mujoco") for w in (1.0, 5.0, 10.0)
    ),
)  # fmt: skip
