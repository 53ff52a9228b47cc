"""PhysX, as SAPIEN offers it: single precision, in the table's own frame.

Bodies stand on an infinite plane, which every corner of a hull can touch; on a slab a hull stands
on one facet and topples a fifth too early. The table's acceleration is a force on the centre of
mass, for SAPIEN sets gravity once for all. A hull is made of the corners that can touch: PhysX
takes 255 at most.

Of two solvers the older one (projected Gauss-Seidel) is taken: SAPIEN's default (TGS) costs as much
and is worse on scanned rocks, by 1 % at 4 ms. Bodies at rest are put to sleep by default, while
here a force moves them.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable
from typing import Any

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

LABEL = "PhysX (SAPIEN)"
NEEDS = ("sapien",)
SWEEP = tuple({"time_step": step} for step in (4e-3, 2e-3, 1e-3, 5e-4))

UPWARD = (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0)
"""Quaternion that turns the normal of PhysX's plane, its x, upward; the real part first."""


def build(scene: Scene, setting: Setting) -> Test:
    """Test with a force set in every step; a new world for every run."""
    time_step, sapien = setting["time_step"], _library()

    def test(pulse: CosinePulse) -> float:
        world = sapien.Scene([_system(scene, time_step)])
        world.add_entity(_pedestal(scene))
        rock = _rock(scene)
        world.add_entity(rock)
        step = world.physx_system.step
        push = rock.find_component_by_type(sapien.physx.PhysxRigidDynamicComponent).add_force_torque
        force, torque = np.zeros(3, np.float32), np.zeros(3, np.float32)

        def advance(values: Iterable[float]) -> None:
            for along_x in values:
                force[0] = -along_x
                push(force, torque, "acceleration")
                step()

        def tilt() -> float:
            return tilt_of(rock.pose.q.tolist())

        return largest_tilt(advance, tilt, accelerations(pulse, time_step))

    return test


def _system(scene: Scene, time_step: float) -> Any:
    """Empty system; SAPIEN reads its settings, and a body's, from global ones."""
    physx = _library().physx
    physx.set_scene_config(gravity=np.array([0.0, 0.0, -scene.gravity]), enable_tgs=False)
    physx.set_body_config(sleep_threshold=0.0)
    system = physx.PhysxCpuSystem()
    system.timestep = time_step
    return system


def _pedestal(scene: Scene) -> Any:
    sapien = _library()
    plane = sapien.physx.PhysxCollisionShapePlane(_material(scene))
    plane.local_pose = sapien.Pose(q=UPWARD)
    body = sapien.physx.PhysxRigidStaticComponent()
    body.attach(plane)
    return sapien.Entity().add_component(body)


def _rock(scene: Scene) -> Any:
    """Rock at rest, its mass and moments given."""
    sapien, rock, start = _library(), scene.rock, resting(scene)
    body = sapien.physx.PhysxRigidDynamicComponent()
    body.attach(_shape(rock, _material(scene)))
    body.mass, body.inertia = rock.mass, rock.inertia
    body.cmass_local_pose = sapien.Pose(q=_quaternion(rock.axes))
    body.linear_damping = body.angular_damping = 0.0
    entity = sapien.Entity().add_component(body)
    entity.pose = sapien.Pose(start.position, _quaternion(start.rotation))
    return entity


def _shape(rock: Rock, material: Any) -> Any:
    physx = _library().physx
    if rock.shape == "box":
        return physx.PhysxCollisionShapeBox(np.abs(rock.vertices).max(axis=0), material)
    corners = touching_corners(rock).astype(np.float32)
    return physx.PhysxCollisionShapeConvexMesh(corners, (1.0, 1.0, 1.0), material)


def _material(scene: Scene) -> Any:
    """Material of rock and pedestal; of two coefficients PhysX takes the mean."""
    friction = scene.contact.friction
    return _library().physx.PhysxMaterial(friction, friction, 0.0)


def _quaternion(rotation: Array) -> Array:
    """Quaternion of a rotation matrix, the real part first."""
    return Rotation.from_matrix(rotation).as_quat(scalar_first=True)


def _library() -> Any:
    """SAPIEN, untyped: its stubs name each array's length and kind."""
    return importlib.import_module("sapien")
