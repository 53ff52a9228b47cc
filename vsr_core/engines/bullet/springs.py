"""Springs and dashpots at points of contact, in Bullet.

Bullet steps them implicitly: a spring without a dashpot rebounds with exp(-pi w h / 2) of the
speed, w its frequency and h the step, and is stable at any step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from vsr_core.engines.bullet.binding import pybullet

SETTLING = 20.0
"""Time constants that a rock is given to settle on its springs."""


@dataclass(frozen=True)
class Springs:
    """What bears a body at each point of contact, in Bullet's units."""

    stiffness: float
    damping: float

    def under(self, body: int, link: int, client: int) -> None:
        """Put them under a body. Bullet takes two bodies' springs in series, and adds dashpots."""
        pybullet.changeDynamics(
            body,
            link,
            contactStiffness=self.stiffness,
            contactDamping=self.damping,
            physicsClientId=client,
        )

    def damped(self, mass: float) -> Springs:
        """The same on which a body of ``mass`` no longer bounces."""
        return replace(self, damping=max(self.damping, math.sqrt(self.stiffness * mass)))

    @property
    def settling_time(self) -> float:
        """Time in which a rock settles on them."""
        return SETTLING * self.damping / self.stiffness


RIGID = Springs(1e18, 0.0)
"""What the pedestal adds to the rock's: not stated, it would be a dashpot of 0.1."""


def exact_springs(client: int) -> None:
    """Have springs push by the whole depth; split, Bullet would correct a deep one by position.

    Parameters
    ----------
    client : int, Bullet's number of the connection
    """
    pybullet.setPhysicsEngineParameter(useSplitImpulse=0, contactSlop=0.0, physicsClientId=client)
