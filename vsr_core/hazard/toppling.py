"""How often a year a rock would topple: its fragility over a hazard curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.hazard.curve import HazardCurve

Fragility = Callable[[Array], Array]
"""Probability of toppling at peak ground accelerations [m/s^2], which does not fall with them."""

PARTS = 64
"""Parts of an interval between two levels of a curve, equal in ln level."""


@dataclass(frozen=True, eq=False)
class Toppling:
    """Annual rate of toppling, and what the curve leaves open.

    Attributes
    ----------
    rate : float [1/year]
        Beyond the last level with the probability of toppling there.
    beyond : float [1/year], by how much it is larger if all that exceeds the last level topples
    below : float, probability of toppling at the first level: what is weaker is left out
    levels : ndarray, shape (m,) [m/s^2], of the parts that the rate is made of
    parts : ndarray, shape (m,) [1/year], the last of all that exceeds the last level
    """

    rate: float
    beyond: float
    below: float
    levels: Array
    parts: Array


def toppling(curve: HazardCurve, fragility: Fragility) -> Toppling:
    """Annual rate of earthquakes that topple a rock, nu = integral of P(a) (-d lambda(a)).

    References
    ----------
    Baker, Abrahamson, Whitney, Board & Hanks (2013), Bull. Seismol. Soc. Am. 103(3).
    """
    x = np.log(curve.levels)
    fine = np.interp(np.arange((len(x) - 1) * PARTS + 1) / PARTS, np.arange(len(x)), x)
    rates = np.exp(np.interp(fine, x, np.log(curve.rates)))
    middles = np.exp(0.5 * (fine[1:] + fine[:-1]))
    parts = fragility(middles) * -np.diff(rates)
    first, last = fragility(curve.levels[[0, -1]])
    ends = np.append(parts, last * curve.rates[-1])
    return Toppling(
        float(ends.sum()),
        float((1.0 - last) * curve.rates[-1]),
        float(first),
        np.append(middles, curve.levels[-1]),
        ends,
    )


def any_of(fragilities: Sequence[Fragility]) -> Fragility:
    """Probability that one or more of several rocks topple in the same shaking.

    Given the shaking they topple independently; that it is the same shaking joins them.
    """

    def together(level: Array) -> Array:
        stands = np.ones_like(level)
        for fragility in fragilities:
            stands = stands * (1.0 - fragility(level))
        return 1.0 - stands

    return together
