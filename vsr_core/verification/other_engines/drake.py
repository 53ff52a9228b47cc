"""Drake: a discrete plant with its convex contact solver (SAP), in the table's own frame.

The table's acceleration acts as a force on the centre of mass. Drake's point contact finds one
point for a pair of shapes, on which no box can stand, so every corner that can touch is a ball of
no size. Near-rigid points reach Housner's boundary of the 1x1x2 m block to 0.2 % at 4 ms. What was
tried instead is worse: the default point stiffness is 3-4 % off; hydroelastic contact costs four
times as much and is 5 % off on a compliant slab, and fails on a compliant half-space.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock.body import Rock
from vsr_core.scene import Scene, resting
from vsr_core.verification.other_engines import (
    SLAB,
    Setting,
    Test,
    accelerations,
    inertia,
    largest_tilt,
    tilt_of,
    touching_corners,
)

LABEL = "Drake (SAP, points)"
NEEDS = ("pydrake",)
SWEEP = ({"time_step": 4e-3}, {"time_step": 2e-3}, {"time_step": 1e-3})

SAG = 1e-5
"""Depth at which one point would bear the weight [m]; SAP softens it to what the step allows."""

FORCE_X = 3
"""Row of the force along x among the generalised forces: torque first, then force."""


def build(scene: Scene, setting: Setting) -> Test:
    """Test whose forces are a trajectory that Drake reads by itself, one value a step."""
    drake = _library()
    time_step, mass = setting["time_step"], scene.rock.mass
    builder = drake.DiagramBuilder()
    config = drake.MultibodyPlantConfig(
        time_step=time_step, contact_model="point", discrete_contact_approximation="sap"
    )
    plant, _ = drake.AddMultibodyPlant(config, builder)
    _fill(plant, scene)
    force = builder.AddSystem(drake.TrajectorySource(drake.PiecewisePolynomial(np.zeros(6))))
    builder.Connect(force.get_output_port(), plant.get_applied_generalized_force_input_port())
    simulator = drake.Simulator(builder.Build())
    context = simulator.get_mutable_context()
    rock = plant.GetMyMutableContextFromRoot(context)

    def advance(values: Iterable[float]) -> None:
        steps = round(context.get_time() / time_step) + len(list(values))
        simulator.AdvanceTo(steps * time_step)

    def tilt() -> float:
        return tilt_of(plant.GetPositions(rock)[:4].tolist())

    def test(pulse: CosinePulse) -> float:
        drive = accelerations(pulse, time_step)
        forces = np.zeros((6, len(drive) + 1))
        forces[FORCE_X, :-1] = -mass * drive
        # Half a step early: the value of a step is then read well inside its interval.
        times = time_step * (np.arange(len(drive) + 1) - 0.5)
        force.UpdateTrajectory(drake.PiecewisePolynomial.ZeroOrderHold(times, forces))
        plant.SetDefaultContext(rock)
        context.SetTime(0.0)
        simulator.Initialize()
        try:
            return largest_tilt(advance, tilt, drive)
        except RuntimeError:  # the contact solver did not converge
            return math.nan

    return test


def _fill(plant: Any, scene: Scene) -> None:
    """Put the pedestal and the rock at rest into a plant, and finish it."""
    drake, start, friction = _library(), resting(scene), scene.contact.friction
    touch = drake.ProximityProperties()
    drake.AddContactMaterial(
        dissipation=None,
        point_stiffness=scene.rock.mass * scene.gravity / SAG,
        friction=drake.CoulombFriction(friction, friction),
        properties=touch,
    )
    plant.RegisterCollisionGeometry(
        plant.world_body(),
        drake.RigidTransform([0.0, 0.0, -0.5 * SLAB[2]]),
        drake.Box(*SLAB),
        "pedestal",
        touch,
    )
    body = plant.AddRigidBody("rock", _inertia(scene.rock))
    for number, corner in enumerate(touching_corners(scene.rock)):
        plant.RegisterCollisionGeometry(
            body, drake.RigidTransform(corner), drake.Sphere(0.0), f"corner {number}", touch
        )
    pose = drake.RigidTransform(drake.RotationMatrix(start.rotation), start.position)
    plant.SetDefaultFloatingBaseBodyPose(body, pose)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scene.gravity])
    plant.Finalize()


def _inertia(rock: Rock) -> Any:
    drake, unit = _library(), inertia(rock) / rock.mass
    rotational = drake.UnitInertia(*unit.diagonal(), unit[0, 1], unit[0, 2], unit[1, 2])
    return drake.SpatialInertia(rock.mass, np.zeros(3), rotational)


def _library() -> Any:
    """Drake, untyped: its stubs take no other arrays than their own."""
    return importlib.import_module("pydrake.all")
