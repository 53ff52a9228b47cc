"""Bullet, through PyBullet's direct connection.

Bullet's tolerances are lengths and speeds in absolute units: 1 mm of margin around a hull, 2 cm
to break a contact, 0.2 m/s below which nothing bounces. Every rock is therefore scaled to one
size by similarity: lengths by s, times by sqrt(s), accelerations unchanged. The same tolerances
are then the same share of any rock, and geometrically similar scenes give the same numbers.
"""

from __future__ import annotations

from collections import OrderedDict
from importlib.metadata import version

import numpy as np

from vsr_core.engines.bullet.driven import BulletDrivenWorld
from vsr_core.engines.bullet.world import BulletWorld
from vsr_core.engines.interface import Ladder, Solver
from vsr_core.errors import InvalidInput
from vsr_core.scene import Scene

VERSION = version("pybullet")

SOLVER = Solver(iterations=50, residual=5e-4)
"""Bullet's number of iterations. The residual is a share of the speed that gravity gives in a step:
with Bullet's fixed one, fine steps end them early, a rock at rest creeps, and a block of 1:20 yaws
on a corner and topples 5 % too soon."""

LADDER = Ladder(
    (0.048, 0.032, 0.024, 0.016, 0.012, 0.008, 0.006, 0.004, 0.003, 0.002),
    coarse=0.006,
    reference=0.000375,
    second=0.00055,
    longest=0.006,
)
"""At 0.006 a released block of 1:1.5 to 1:20 swings back to within 1.9 % of Housner's and a hull to
within 2.8 %, at 0.009 to within 3.4 %, at 0.012 to within 5.3 %; boundaries move by as much."""

SLENDER_SHARE = 0.2
"""Longest step of a slender rock, as a share of tan(alpha) sqrt(radius / g). At 0.25 a needle
swings back to within 3 % of Housner's; at 1.0 a knife edge falls over by itself."""

SLIDING_SHARE = 1.0
"""Friction, as a share of tan(alpha), from which to 1 scenes are refused: never, as few rocks
topple that should slide. Of 192 strong pulses on blocks and frusta none topples one at 0.85, two
at 0.9, ten at 0.94, some at finer steps; ours slides in all, which is exact."""

WORLDS_KEPT = 2
"""Worlds kept for the next run of the same scene: the reduced one and the complete one."""

_worlds: OrderedDict[Scene, BulletWorld] = OrderedDict()


def build(
    scene: Scene, time_step: float, substeps: int = 1, solver: Solver | None = None
) -> BulletWorld:
    """World with the rock at its start.

    The world of an earlier call with the same scene is rewound and no longer valid itself.

    Parameters
    ----------
    time_step : float [s]
    substeps : int, steps for which a sample is held

    Returns
    -------
    BulletWorld
        In a scene with a drive a ``BulletDrivenWorld``.

    Raises
    ------
    InvalidInput
        For a drive whose pedestal no servo can move, or whose control period is not a sample; for
        springs under anything but a box or a sphere on a slab, where their number is not known.
        For an energetic restitution.
    """
    if scene.contact.stiffness is not None and (
        scene.rock.shape == "hull" or scene.pedestal != "box"
    ):
        raise InvalidInput(
            f"a contact stiffness under a {scene.rock.shape} on a {scene.pedestal}",
            "it is a spring at each point of contact, and Bullet keeps any number of them there",
            "use a rigid contact, or a box on a slab",
        )
    if scene.contact.energetic and scene.contact.restitution > 0.0:
        raise InvalidInput(
            "an energetic restitution in Bullet",
            "its impacts have Newton's, a ratio of speeds",
            "set contact.restitution_law: newton, or simulation.engine: nonsmooth",
        )
    world = _worlds.pop(scene, None)
    if world is not None and not np.isfinite(world.state().position).all():
        world.close()
        world = None
    _worlds[scene] = world or (BulletWorld if scene.drive is None else BulletDrivenWorld)(scene)
    while len(_worlds) > WORLDS_KEPT:
        _worlds.popitem(last=False)[1].close()
    _worlds[scene].rewind(time_step, substeps, solver or SOLVER)
    return _worlds[scene]
