"""What can be left out of a scene, and why the outcome stays the same."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vsr_core.rock.reduction import KEPT_TILT, simplified
from vsr_core.scene import Scene


@dataclass(frozen=True)
class Reduction:
    """Something left out of a scene, and why the answer stays the same."""

    what: str
    why: str


STANDING_REDUCTIONS = (
    Reduction("trajectory", "only outcomes are wanted"),
    Reduction("settling before the pulse", "the rest pose is known from the hull's geometry"),
)
"""What ``simulate`` itself leaves out when a scene is reduced."""

TABLE_FRAME_REDUCTIONS = (
    Reduction(
        "joint, servo and moving pedestal",
        "the motion is prescribed, so the table's own frame is exact: gravity minus the table's "
        "acceleration",
    ),
    Reduction(
        "runs below the uplift and sliding limits",
        "the resultant stays inside the base and the friction cone: nothing moves",
    ),
    Reduction(
        "the motion before its first push",
        "until it leaves those limits nothing moves, so the run starts there; it passes over rests "
        "in a record as well",
    ),
    Reduction(
        "time after the outcome is certain",
        "energy too small for any way back, or falling past every support",
    ),
)
"""What it leaves out besides where no servo moves the table."""

TERRAIN_REDUCTIONS = (
    Reduction(
        "joint, servo and moving terrain",
        "the motion is prescribed, so the table's own frame is exact: gravity minus the table's "
        "acceleration",
    ),
    Reduction(
        "runs below the uplift and sliding limits",
        "forces in the friction cones at the points of contact balance weight and inertia",
    ),
    Reduction(
        "triangles of the terrain",
        "convex parts that stand out of it by less than a stated tolerance take their place",
    ),
    Reduction(
        "ground out of reach", "only what is near the rock's surface is in the engine's world"
    ),
    Reduction(
        "corners of the rock's hull",
        "its base is complete while it is on its seat; what is left out lies within a stated "
        "distance of the rest, farther once the rock has toppled",
    ),
)
"""What runs on a terrain leave out."""


def reduce(scene: Scene) -> tuple[Scene, tuple[Reduction, ...]]:
    """The least scene with the same outcome, and what was left out.

    Parameters
    ----------
    scene : Scene
        As the user described it.

    Returns
    -------
    scene : Scene
    reductions : tuple of Reduction
    """
    dropped = [*STANDING_REDUCTIONS]
    reduced = scene
    if scene.drive is None:
        dropped = [*TABLE_FRAME_REDUCTIONS, *dropped]
    if scene.drive is None and scene.rock.shape == "hull" and scene.contact.restitution == 0.0:
        # On a plane Bullet finds one corner of a landing edge at a time, on a slab both. With a
        # box that shifts the boundary of short pulses by 3-5 %, and no face rebounds as it should.
        reduced = replace(reduced, pedestal="plane")
        dropped.insert(
            0, Reduction("pedestal slab", "a flat pedestal is a plane; its edges are out of reach")
        )
    if scene.rock.shape == "hull":
        rock = simplified(scene.rock)
        left_out = len(scene.rock.vertices) - len(rock.vertices)
        if left_out:
            reduced = replace(reduced, rock=rock, kept_tilt=float(KEPT_TILT))
            dropped.append(
                Reduction(
                    f"{left_out} of {len(scene.rock.vertices)} hull vertices",
                    f"they cannot touch below {np.degrees(KEPT_TILT):.0f} deg of tilt, and it tips "
                    "as before without them; a run that tilts further is repeated with all",
                )
            )
    return reduced, tuple(dropped)
