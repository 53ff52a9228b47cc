"""What can be left out of a scene, and why the outcome stays the same."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

import numpy as np

from vsr_core.rock.reduction import KEPT_TILT, simplified
from vsr_core.scene import Scene


class Reduction(Enum):
    """Something left out of a scene, and why the outcome stays the same."""

    TRAJECTORY = "trajectory", "only outcomes are wanted"
    SETTLING = "settling before the pulse", "the rest pose is known from the hull's geometry"
    MOVING_PEDESTAL = (
        "joint, servo and moving pedestal",
        "the motion is prescribed, so the table's own frame is exact: gravity minus the table's "
        "acceleration",
    )
    STATIC_RUNS = (
        "runs below the uplift and sliding limits",
        "the resultant stays inside the base and the friction cone: nothing moves",
    )
    LEAD_IN = (
        "the motion before its first push",
        "until it leaves those limits nothing moves, so the run starts there; it passes over rests "
        "in a record as well",
    )
    CERTAIN_END = (
        "time after the outcome is certain",
        "energy too small for any way back, or falling past every support",
    )
    PEDESTAL_SLAB = "pedestal slab", "a flat pedestal is a plane; its edges are out of reach"
    HULL_VERTICES = (
        "hull vertices",
        f"they cannot touch below {np.degrees(KEPT_TILT):.0f} deg of tilt, and it tips as before "
        "without them; a run that tilts further is repeated with all",
    )
    MOVING_TERRAIN = (
        "joint, servo and moving terrain",
        "the motion is prescribed, so the table's own frame is exact: gravity minus the table's "
        "acceleration",
    )
    STATIC_RUNS_ON_TERRAIN = (
        "runs below the uplift and sliding limits",
        "forces in the friction cones at the points of contact balance weight and inertia",
    )
    TRIANGLES = (
        "triangles of the terrain",
        "fewer ones take their place within a stated tolerance",
    )
    FAR_GROUND = (
        "ground out of reach",
        "only what is near the rock's surface is in the engine's world",
    )
    HULL_CORNERS = (
        "corners of the rock's hull",
        "its base is complete while it is on its seat; what is left out lies within a stated "
        "distance of the rest, farther once the rock has toppled",
    )

    def __init__(self, what: str, why: str) -> None:
        self.what, self.why = what, why


STANDING_REDUCTIONS = (Reduction.TRAJECTORY, Reduction.SETTLING)
"""What ``simulate`` itself leaves out when a scene is reduced."""

_FLAT_PROOFS = (Reduction.STATIC_RUNS, Reduction.LEAD_IN, Reduction.CERTAIN_END)

PROOFS = (*_FLAT_PROOFS, Reduction.STATIC_RUNS_ON_TERRAIN)
"""What is proved for a motion along one axis."""

TABLE_FRAME_REDUCTIONS = (Reduction.MOVING_PEDESTAL, *_FLAT_PROOFS)
"""What it leaves out besides where no servo moves the table."""

TERRAIN_REDUCTIONS = (
    Reduction.MOVING_TERRAIN,
    Reduction.STATIC_RUNS_ON_TERRAIN,
    Reduction.TRIANGLES,
    Reduction.FAR_GROUND,
    Reduction.HULL_CORNERS,
)
"""What runs on a terrain leave out."""


def reduce(scene: Scene) -> tuple[Scene, tuple[Reduction, ...]]:
    """The least scene with the same outcome, and what was left out."""
    dropped = [*STANDING_REDUCTIONS]
    reduced = scene
    if scene.drive is None:
        dropped = [*TABLE_FRAME_REDUCTIONS, *dropped]
    if scene.drive is None and scene.rock.shape == "hull" and scene.contact.restitution == 0.0:
        # On a plane Bullet finds one corner of a landing edge at a time, on a slab both. With a
        # box that shifts the boundary of short pulses by 3-5 %, and no face rebounds as it should.
        reduced = replace(reduced, pedestal="plane")
        dropped.insert(0, Reduction.PEDESTAL_SLAB)
    if scene.rock.shape == "hull":
        rock = simplified(scene.rock)
        if len(rock.vertices) < len(scene.rock.vertices):
            reduced = replace(reduced, rock=rock, kept_tilt=float(KEPT_TILT))
            dropped.append(Reduction.HULL_VERTICES)
    return reduced, tuple(dropped)
