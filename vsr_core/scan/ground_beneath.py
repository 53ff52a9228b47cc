"""The ground beneath a rock, which no scan sees: up to the seam it is the rock's own underside."""

from __future__ import annotations

import numpy as np

from vsr_core.arrays import Mask
from vsr_core.errors import InvalidPlace
from vsr_core.scan.closing import Closed
from vsr_core.scan.separation import Separation
from vsr_core.scan.weighing import signed_distance
from vsr_core.terrain.surface import Terrain

LARGEST_OVERLAP = 0.1
"""Depth of scanned ground in the rock, as a share of the rock's size, that is no noise."""


def ground_beneath(separation: Separation, closed: Closed) -> tuple[Terrain, Mask, tuple[str, ...]]:
    """Ground without a hole: the caps that close the rock below close the ground above.

    Rock and ground meet in one surface there, so that neither starts inside the other. How far
    noise has put scanned ground beside the seam into the rock is measured.

    Returns
    -------
    terrain : Terrain, in the scan's coordinates
    unseen : ndarray of bool, shape (m,), its faces beneath the rock

    Raises
    ------
    InvalidPlace
        If ground reaches into the rock by more than a tenth of its size.
    """
    faces = separation.faces[~separation.rock]
    seat = np.concatenate([cap.faces[:, ::-1] for cap in closed.caps])
    used, triangles = np.unique(np.concatenate([faces, seat]), return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    terrain = Terrain(closed.vertices[used], triangles)
    unseen = np.arange(len(triangles)) >= len(faces)
    low, high = closed.rock.bounds
    own = np.setdiff1d(triangles[~unseen], triangles[unseen])
    points = terrain.vertices[own]
    points = points[((points > low) & (points < high)).all(axis=1)]
    inside = -signed_distance(closed.rock, points)[0] if len(points) else np.zeros(1)
    deepest = float(max(0.0, inside.max()))
    if deepest > LARGEST_OVERLAP * float((high - low).max()):
        raise InvalidPlace(
            f"ground that reaches {deepest:.3g} m into the rock",
            f"rock and ground touch, to {LARGEST_OVERLAP:.0%} of the rock's size",
            "move pedestal.cut, or set rock.closing to another of caps, hull and poisson",
            points[[int(np.argmax(inside))]],
        )
    notes = [f"one surface of {len(seat)} faces for the rock's underside and the ground beneath"]
    if deepest > 0.0:
        count = int((inside > 0.0).sum())
        notes.append(f"{count} vertices of the ground lie up to {1e3 * deepest:.1f} mm in the rock")
    return terrain, unseen, tuple(notes)
