"""What a standing rock does when it is tilted, pushed or rocked by hand.

A rock is what the acceleration says that tips it steadily toward a direction, its slope tan(alpha):
alpha is the angle at which it tips on a ground that is slowly tilted.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsr_core import GRAVITY
from vsr_core.rock.body import Rock


class Threshold(NamedTuple):
    """What moves a rock, and what it slides at before that; in the units of the test."""

    tips: float
    slides: float


def tilt_angle(slope: float, friction: float) -> Threshold:
    """Angle of a ground that is slowly tilted [rad].

    Parameters
    ----------
    slope : float [1], steady acceleration that tips the rock [g]

    Examples
    --------
    A block of 1 x 1 x 2 m tips at atan(b/h), and slides before at a friction below 1/2:

    >>> [round(math.degrees(one), 2) for one in tilt_angle(0.5, 0.4)]
    [26.57, 21.8]
    """
    return Threshold(math.atan(slope), math.atan(friction))


def push_force(
    weight: float, slope: float, friction: float, centre: float, height: float
) -> Threshold:
    """Horizontal force on a rock [N]: F h = W H tan(alpha), its moment that of the weight.

    Parameters
    ----------
    weight : float [N]
    centre, height : float [m], heights H of the centre of mass and h of the force above the seat

    Examples
    --------
    A block of 1 x 1 x 2 m that weighs 20 kN, pushed at its top:

    >>> push_force(20e3, 0.5, 0.6, 1.0, 2.0)
    Threshold(tips=5000.0, slides=12000.0)
    """
    return Threshold(weight * slope * centre / height, weight * friction)


def rocking_frequency(
    rock: Rock, centre: float, direction: float, slopes: tuple[float, float], amplitude: float
) -> float:
    """Frequency at which a rock rocks freely to and fro.

    A half of the period belongs to each edge: 2 acosh(1 / (1 - theta/alpha)) / p, with
    p^2 = m g R / I about the edge (Housner 1963, eq. 4). Beyond the other edge the rock rises to
    the same energy, as far as tilts are small; what impacts take is left out.

    Parameters
    ----------
    centre : float [m], height of the centre of mass above the seat
    direction : float [rad], towards which it was tilted, counter-clockwise from +x
    slopes : tuple of float [1], tan(alpha) to that side and to the other
    amplitude : float [rad], tilt to that side

    Returns
    -------
    float [Hz], 0 where the rock would not come back

    Examples
    --------
    Housner's block of 1 x 1 x 2 m has p^2 = 3 g / (4 R):

    >>> from vsr_core.rock.solid import block
    >>> alpha, p = math.atan(0.5), math.sqrt(0.75 * GRAVITY / math.hypot(0.5, 1.0))
    >>> period = 4.0 / p * math.acosh(1.0 / (1.0 - 0.1))
    >>> solid = block((1.0, 1.0, 2.0), 2700.0)
    >>> found = rocking_frequency(solid, 1.0, 0.0, (0.5, 0.5), 0.1 * alpha)
    >>> round(found * period, 12)
    1.0
    """
    alphas = [math.atan(slope) for slope in slopes]
    if amplitude >= alphas[0]:
        return 0.0
    energy = slopes[0] * amplitude * (1.0 - amplitude / (2.0 * alphas[0]))
    share = 2.0 * energy / (slopes[1] * alphas[1])
    if share >= 1.0:
        return 0.0
    tilts = amplitude, alphas[1] * (1.0 - math.sqrt(1.0 - share))
    across = np.array([-math.sin(direction), math.cos(direction), 0.0])
    own = float(across @ (rock.axes * rock.inertia) @ rock.axes.T @ across)
    period = 0.0
    for alpha, tilt in zip(alphas, tilts, strict=True):
        radius = centre / math.cos(alpha)
        p = math.sqrt(rock.mass * GRAVITY * radius / (own + rock.mass * radius**2))
        period += 2.0 * math.acosh(1.0 / (1.0 - tilt / alpha)) / p
    return 1.0 / period
