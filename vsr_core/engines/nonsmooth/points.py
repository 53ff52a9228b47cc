"""What the search for impulses asks of a point of contact."""

from __future__ import annotations

from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth.body import Points
from vsr_core.engines.nonsmooth.compiling import compiled

OPEN, GRIPS, SLIDES = 0, 1, 2
"""States of a point."""


@compiled
def excess(point: Points, k: int, velocity: Array) -> float:
    """Velocity of a point less the one wanted, along the normal or a tangent."""
    rows = point.rows
    return (
        rows[k, 0] * velocity[0]
        + rows[k, 1] * velocity[1]
        + rows[k, 2] * velocity[2]
        + rows[k, 3] * velocity[3]
        + rows[k, 4] * velocity[4]
        + rows[k, 5] * velocity[5]
        - point.wanted[k]
    )


@compiled
def add_impulse(point: Points, share: float, velocity: Array) -> None:
    """Add to a velocity what a share of the impulse of a point does."""
    for k in range(3):
        p = share * point.impulse[k]
        for j in range(3):
            velocity[j] += p * point.rows[k, j]
            velocity[3 + j] += p * point.turning[k, j]
