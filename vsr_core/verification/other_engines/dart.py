"""DART: a rigid contact problem in every step, in the table's own frame.

A box lands on a slab by FCL, a hull by small balls in the corners that can touch; as one convex
shape it would have one point of contact at a time and topple 5 % too early.

Two defaults must not stay. The contact solver (Dantzig) fixes the friction's limits before the
normal forces are known, too low for a block on an edge: with a friction of 0.7 a 1x1x2 m block
slides flat under any pulse and never rocks. The Gauss-Seidel solver for Coulomb's cones, which
6.20 has, rocks it right for half as much time again. And bodies at rest are put to sleep, while
here gravity moves them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from vsr_core.motions.pulses import CosinePulse
from vsr_core.scene import Scene, resting
from vsr_core.verification.other_engines import (
    SLAB,
    Setting,
    Test,
    accelerations,
    inertia,
    largest_tilt,
    touching_corners,
)

if TYPE_CHECKING:
    import dartpy

LABEL = "DART (Gauss-Seidel, FCL)"
NEEDS = ("dartpy",)
SWEEP = ({"time_step": 4e-3}, {"time_step": 2e-3}, {"time_step": 1e-3}, {"time_step": 5e-4})

BALL = 1e-3
"""Radius of the balls in a hull's corners [m]; the slab lies that much lower."""


def build(scene: Scene, setting: Setting) -> Test:
    """Test with gravity set in every step; a new world for every run, or one leaves traces."""
    time_step, down = setting["time_step"], -scene.gravity

    def test(pulse: CosinePulse) -> float:
        world, rock = _world(scene, time_step)

        def advance(values: Iterable[float]) -> None:
            for along_x in values:
                world.setGravity(-along_x, 0.0, down)
                world.step()

        def tilt() -> float:
            upright = float(rock.getWorldTransform().rotation()[2, 2])
            return math.acos(max(-1.0, min(1.0, upright))) if math.isfinite(upright) else math.nan

        return largest_tilt(advance, tilt, accelerations(pulse, time_step))

    return test


def _world(
    scene: Scene, time_step: float
) -> tuple[dartpy.simulation.World, dartpy.dynamics.BodyNode]:
    """World with the rock at rest, and the rock."""
    import dartpy

    world = dartpy.simulation.World()
    world.setTimeStep(time_step)
    world.setCollisionDetector(dartpy.simulation.CollisionDetectorType.FCL)
    world.getConstraintSolver().setBoxedLcpSolver(dartpy.constraint.NsgsFrictionSolver())
    sleep = world.getDeactivationOptions()
    sleep.mEnabled = False
    world.setDeactivationOptions(sleep)
    rock = _rock(scene)
    world.addSkeleton(_pedestal(scene))
    world.addSkeleton(rock)
    return world, rock.getBodyNode(0)


def _pedestal(scene: Scene) -> dartpy.dynamics.Skeleton:
    import dartpy

    dynamics = dartpy.dynamics
    pedestal = dynamics.Skeleton("pedestal")
    _, body = pedestal.createWeldJointAndBodyNodePair()
    below = 0.5 * SLAB[2] + (BALL if scene.rock.shape == "hull" else 0.0)
    shape = _add(body, dynamics.BoxShape(SLAB), scene.contact.friction)
    shape.setRelativeTranslation([0.0, 0.0, -below])
    return pedestal


def _rock(scene: Scene) -> dartpy.dynamics.Skeleton:
    import dartpy

    dynamics = dartpy.dynamics
    described, friction, start = scene.rock, scene.contact.friction, resting(scene)
    rock = dynamics.Skeleton("rock")
    _, body = rock.createFreeJointAndBodyNodePair()
    body.setInertia(dynamics.Inertia(described.mass, np.zeros(3), inertia(described)))
    if described.shape == "box":
        _add(body, dynamics.BoxShape(np.ptp(described.vertices, axis=0)), friction)
    else:
        for corner in touching_corners(described):
            _add(body, dynamics.SphereShape(BALL), friction).setRelativeTranslation(corner)
    pose = dartpy.math.Isometry3(start.rotation, start.position)
    rock.setPositions(dynamics.FreeJoint.convertToPositions(pose))
    return rock


def _add(
    body: dartpy.dynamics.BodyNode, shape: dartpy.dynamics.Shape, friction: float
) -> dartpy.dynamics.ShapeNode:
    """Add a shape that touches; of two coefficients of friction DART takes the smaller."""
    node = body.createShapeNode(shape)
    node.createCollisionAspect()
    node.createDynamicsAspect().setFrictionCoeff(friction)
    return node
