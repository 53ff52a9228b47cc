"""Closed forms of Housner's rocking block: free rocking, and the slender block under a pulse.

References
----------
Housner (1963), Bull. Seismol. Soc. Am. 53(2), 403-417: rocking and free decay.
Zhang & Makris (2001), J. Eng. Mech. 127(5): blocks under one-cycle cycloidal pulses.
"""

from __future__ import annotations

import math

from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc

from vsr_core.errors import InvalidInput
from vsr_core.run.rocking_block import Block, turning_point


def free_period(block: Block, theta0: float) -> float:
    """Period of free rocking without loss.

    Four times the fall from ``theta0`` at rest to the impact, as an inverted pendulum:
    (4/p) [K(m) - F(asin(cos(alpha/2) / sqrt(m)) | m)], m = cos^2((alpha - theta0)/2). For slender
    blocks this is Housner's (4/p) acosh(1 / (1 - theta0/alpha)).

    Parameters
    ----------
    theta0 : float [rad], amplitude, between 0 and alpha

    Returns
    -------
    float [s]

    Examples
    --------
    >>> block = Block(0.005, 0.5)
    >>> slender = 4 / block.p * math.acosh(1 / (1 - 0.5))
    >>> abs(free_period(block, 0.5 * block.alpha) / slender - 1) < 1e-4
    True
    """
    _check_amplitude(block, theta0)
    modulus = math.cos(0.5 * (block.alpha - theta0))
    quarter = ellipk(modulus**2) - ellipkinc(
        math.asin(math.cos(0.5 * block.alpha) / modulus), modulus**2
    )
    return float(4.0 / block.p * quarter)


def free_amplitude(block: Block, theta0: float, impacts: int) -> float:
    """Amplitude of free rocking from rest after some impacts.

    cos(alpha - theta_n) - cos(alpha) = rho^(2n) [cos(alpha - theta_0) - cos(alpha)], which for
    slender blocks is Housner's phi_n = 1 - sqrt(1 - rho^(2n) [1 - (1 - phi_0)^2]).

    Parameters
    ----------
    theta0 : float [rad], at the start, between 0 and alpha

    Returns
    -------
    float [rad]

    Examples
    --------
    >>> block = Block(0.5, 1.0)
    >>> free_amplitude(block, 0.2, 2) < free_amplitude(block, 0.2, 1) < 0.2
    True
    """
    _check_amplitude(block, theta0)
    floor = math.cos(block.alpha)
    excess = block.impact_ratio ** (2 * impacts) * (math.cos(block.alpha - theta0) - floor)
    return turning_point(block, floor + excess)


def _check_amplitude(block: Block, theta0: float) -> None:
    if not 0.0 < theta0 < block.alpha:
        rule = f"free rocking needs one between 0 and alpha = {block.alpha:g} rad"
        raise InvalidInput(f"an amplitude of {theta0:g} rad", rule, "give a smaller positive tilt")


def slender_pga_without_impact(block: Block, pgv_pga: float) -> float:
    """PGA above which a slender block overturns at once, without an impact.

    g alpha [1 + (w/p)^2] / [1 - exp(-2 pi p/w)], w = 1 / pgv_pga: the growing exponential of the
    linearised equation is positive at the pulse's end.

    Parameters
    ----------
    pgv_pga : float [s]

    Returns
    -------
    float [m/s^2]
    """
    ratio = 1.0 / (block.p * pgv_pga)
    grown = -math.expm1(-2.0 * math.pi / ratio)
    return block.gravity * block.alpha * (1.0 + ratio**2) / grown


def slender_overturns(block: Block, pga: float, pgv_pga: float) -> bool:
    """Whether the cosine pulse overturns a slender block with at most one impact.

    Closed form of the linearised equation, for pga > 0; exact as alpha goes to 0. It knows no
    second impact, so it can miss an overturning after one.

    Parameters
    ----------
    pga : float [m/s^2]
    pgv_pga : float [s]

    Notes
    -----
    With w = 1 / pgv_pga and Q = (pga/g) p^2 / (w^2 + p^2), the first impact is the root t1 of
    (alpha - Q)(cosh p t - 1) = Q (1 - cos w t), here as the square root of both sides, which
    has one root in the pulse because sinh(x)/sin(y) grows. Behind it the growing exponential is
    rho [(alpha - Q) sinh(p t1) - S] + S - Q cos(w t1) - alpha + Q exp(-p (T - t1)), up to a
    positive factor, S = Q (w/p) sin(w t1), T = 2 pi / w.
    """
    if pga > slender_pga_without_impact(block, pgv_pga):
        return True
    alpha, ratio = block.alpha, 1.0 / (block.p * pgv_pga)
    q = pga / block.gravity / (1.0 + ratio**2)
    end = 2.0 * math.pi / ratio
    if pga <= block.gravity * alpha or q >= alpha:
        return False

    def height(t: float) -> float:
        return math.sqrt(alpha - q) * math.sinh(0.5 * t) - math.sqrt(q) * math.sin(0.5 * ratio * t)

    begin = 1e-9 * end
    # Where sinh alone outgrows the sine; keeps sinh from overflowing in long pulses.
    beyond = min(end, 2.0 * math.asinh(math.sqrt(q / (alpha - q))))
    if height(begin) >= 0.0:
        return False
    t1 = brentq(height, begin, beyond, xtol=1e-14, rtol=1e-14)
    s = q * ratio * math.sin(ratio * t1)
    grown = block.impact_ratio * ((alpha - q) * math.sinh(t1) - s)
    grown += s - q * math.cos(ratio * t1) - alpha + q * math.exp(t1 - end)
    return grown > 0.0
