"""Rapier: four substeps with soft constraints, single precision, in the table's own frame.

A box lands on a half-space, a hull by small balls in the corners that can touch: Rapier takes its
points of contact from one facet of a hull at a time, and a scanned rock that should stand on many
corners stands on three, falls over by itself on the half-space, and topples a fifth too early on a
slab. On triangles a hull has more points, and is 1 to 4 % off.

One default must not stay: up to 5 mm of penetration are left as they are, which lowers the corners
a small rock stands on. The friction model, Coulomb's or the simplified one, makes no difference
here; four times as many substeps cost 1.8 times as much and gain little.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock.body import Rock
from vsr_core.scene import Scene, resting
from vsr_core.verification.other_engines import (
    Setting,
    Test,
    accelerations,
    largest_tilt,
    tilt_of,
    touching_corners,
)

if TYPE_CHECKING:
    import rapier3d

LABEL = "Rapier"
NEEDS = ("rapier3d",)
SWEEP = tuple({"time_step": step} for step in (8e-3, 4e-3, 2e-3, 1e-3))

PENETRATION = 1e-5
"""Penetration that is left uncorrected [m]."""

BALL = 1e-3
"""Radius of the balls in a hull's corners [m]; the half-space lies that much lower."""


def build(scene: Scene, setting: Setting) -> Test:
    """Test with gravity set in every step; a new world for every run."""
    from rapier3d import Vec3

    time_step, down = setting["time_step"], -scene.gravity

    def test(pulse: CosinePulse) -> float:
        world, rock = _world(scene, time_step)

        def advance(values: Iterable[float]) -> None:
            for along_x in values:
                world.gravity = Vec3(-along_x, 0.0, down)
                world.step()

        def tilt() -> float:
            turn = rock.rotation
            return tilt_of((turn.w, turn.i, turn.j, turn.k))

        return largest_tilt(advance, tilt, accelerations(pulse, time_step))

    return test


def _world(scene: Scene, time_step: float) -> tuple[rapier3d.PhysicsWorld, rapier3d.RigidBody]:
    """World with the rock at rest, and the rock."""
    import rapier3d

    # A pool of threads, even of one, costs four times the step of one rock.
    world = rapier3d.PhysicsWorld()
    world.integration_parameters.dt = time_step
    world.integration_parameters.normalized_allowed_linear_error = PENETRATION
    rock, start = scene.rock, resting(scene)
    below = BALL if rock.shape == "hull" else 0.0
    ground = rapier3d.SharedShape.halfspace((0.0, 0.0, 1.0))
    world.add_collider(_touching(ground, scene).translation((0.0, 0.0, -below)))
    mass = rapier3d.MassProperties(
        (0.0, 0.0, 0.0), rock.mass, rock.inertia.tolist(), _turn(rock.axes)
    )
    place = rapier3d.Isometry3(start.position.tolist(), _turn(start.rotation))
    body = rapier3d.RigidBody.dynamic().position(place).can_sleep(False)
    collider = _touching(_shape(rock), scene).density(0.0)
    handle = world.add_body(body.additional_mass_properties(mass), [collider])
    return world, world.rigid_bodies[handle]


def _shape(rock: Rock) -> rapier3d.SharedShape:
    import rapier3d

    if rock.shape == "box":
        return rapier3d.SharedShape.cuboid(*np.abs(rock.vertices).max(axis=0).tolist())
    ball = rapier3d.SharedShape.ball(BALL)
    corners = touching_corners(rock).tolist()
    return rapier3d.SharedShape.compound([(rapier3d.Isometry3(corner), ball) for corner in corners])


def _touching(shape: rapier3d.SharedShape, scene: Scene) -> rapier3d.ColliderBuilder:
    """Collider of a shape; the mean of two coefficients, Rapier's default, is the pair's."""
    import rapier3d

    friction = scene.contact.friction
    return rapier3d.Collider.new(shape).friction(friction).restitution(0.0)


def _turn(rotation: Array) -> rapier3d.Rotation3:
    import rapier3d

    return rapier3d.Rotation3(*Rotation.from_matrix(rotation).as_quat(scalar_first=True).tolist())
