"""A rock as it is seen from the side of its shaking: what its toppling depends on.

All is told of two rocking points, first that towards which the rock leans when the pulse begins,
behind it, then the other. The pulse begins with a push to the front.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.rock.body import Rock
from vsr_core.rock.tipping import base_polygon, tipping

FLAT = 0.99
"""Share of the toppling acceleration at which a rock on a flat base lifts, at least."""


@dataclass(frozen=True, eq=False)
class Profiles:
    """Rocks on level ground, seen from the side, shape (..., 2) where the two sides differ.

    Attributes
    ----------
    tan_alpha : ndarray, shape (..., 2), of the angles between the vertical and the lines from the
        rocking points to the centre of mass
    radius : ndarray, shape (..., 2) [m], from a rocking point to the centre of mass
    inertia : ndarray, shape (...) [m^2], moment about the centre of mass by the mass
    roundness : ndarray, shape (...)
        Radius of the edges of the base by the height of the centre of mass; the rocking points are
        where the base's flat part ends.
    friction : ndarray, shape (...)
    """

    tan_alpha: Array
    radius: Array
    inertia: Array
    roundness: Array
    friction: Array

    @property
    def weakest(self) -> Array:
        """Acceleration that topples the rock to its weaker side if it lasts, shape (...) [g]."""
        return np.asarray(self.tan_alpha.min(axis=-1))

    @property
    def p(self) -> Array:
        """Frequency parameters sqrt(m g r / I) about the rocking points, shape (..., 2) [1/s]."""
        about = self.inertia[..., None] + self.radius**2
        return np.asarray(np.sqrt(GRAVITY * self.radius / about))

    @property
    def kept(self) -> Array:
        """Share of the energy of rocking that is left after an impact on either point, shape (...).

        Angular momentum about the new point is kept: (I_c + m r_1 r_2 cos(alpha_1 + alpha_2)) /
        (I_c + m r_2^2) in spin (Housner 1963 for a block).
        """
        both = np.arctan(self.tan_alpha).sum(axis=-1)
        across = self.inertia + self.radius.prod(axis=-1) * np.cos(both)
        spins = across[..., None] / (self.inertia[..., None] + self.radius**2)
        return np.asarray(np.maximum(spins.prod(axis=-1), 0.0))

    def mirrored(self) -> Profiles:
        """The same rocks, shaken the other way."""
        return Profiles(
            self.tan_alpha[..., ::-1],
            self.radius[..., ::-1],
            self.inertia,
            self.roundness,
            self.friction,
        )


def of_rock(rock: Rock, friction: float, edge: float = 0.0) -> Profiles:
    """Profile of a rock that is shaken along its +x.

    Parameters
    ----------
    friction : float, of rock on pedestal
    edge : float [m], radius of the edges of its base
    """
    base = base_polygon(rock.vertices, 1e-6 * rock.radius)[:, 0]
    tan_alpha = np.array([-base.min(), base.max()]) / rock.height
    seen = rock.axes[1] ** 2  # of its axes, along y
    return Profiles(
        tan_alpha,
        rock.height * np.hypot(1.0, tan_alpha),
        np.array((seen * rock.inertia).sum() / rock.mass),
        np.array(edge / rock.height),
        np.array(friction),
    )


def rests_flat(rock: Rock) -> bool:
    """Whether nothing holds a rock along x once its base has lifted: then Housner's limit is exact.

    One that rests on a round bottom lifts earlier, and swings over what would hold it.
    """
    tips = tipping(rock.hull, np.array([math.pi, 0.0]))
    return bool((tips.uplift >= FLAT * tips.overturning).all())
