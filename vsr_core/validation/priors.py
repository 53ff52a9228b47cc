"""What nobody knows of a shake-table test, and draws of it that fill it evenly.

None of this was fitted to outcomes. A test is predicted by an ensemble of draws, and its best guess
is the middle of all priors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from vsr_core.arrays import Array


@dataclass(frozen=True)
class Priors:
    """Ranges of the unknowns; pairs are (low, high) of a uniform one, (mean, sd) of a normal one.

    Attributes
    ----------
    azimuth : (mean, sd) [rad], direction of the drive from the scan's +x, counter-clockwise
    reversed_share : float, probability that the drive points the other way
    friction : (low, high) [1]
    restitution : (low, high) [1]
    amplitude : (mean, sd) [1], factor on the acceleration, for its gain
    mixing : (low, high) [1], way from the scan to that of a replica, where there is one
    error : float [1], error of the base in units of what is not known of it (see ``Form.spread``)
    centre : float [m], sd of the centre of mass along each axis: density, closing of the scan
    """

    azimuth: tuple[float, float] = (math.radians(-7.5), math.radians(7.5))
    reversed_share: float = 0.5
    friction: tuple[float, float] = (0.5, 0.9)
    restitution: tuple[float, float] = (0.0, 0.0)
    amplitude: tuple[float, float] = (1.0, 0.03)
    mixing: tuple[float, float] = (0.15, 0.85)
    error: float = 1.0
    centre: float = 0.004


@dataclass(frozen=True, eq=False)
class Member:
    """One draw; see ``Priors``. ``azimuth`` includes a reversed drive.

    Attributes
    ----------
    azimuth, friction, restitution, amplitude, mixing, error : float
    centre : ndarray, shape (3,) [m], offset of the centre of mass
    seed : int, of the error of the base
    """

    azimuth: float
    friction: float
    restitution: float
    amplitude: float
    mixing: float
    error: float
    centre: Array
    seed: int


def draws(priors: Priors, count: int, seed: int = 7) -> list[Member]:
    """Members of an ensemble: a scrambled Sobol sequence over all unknowns but the base's error.

    The drive is reversed in every other member, to the share that is asked for.
    """
    exponent = math.ceil(math.log2(max(count, 2)))
    points = qmc.Sobol(9, rng=seed).random_base2(exponent)[:count]
    points = np.clip(points, 1e-6, 1.0 - 1e-6)
    normal = norm.ppf(points)
    members = []
    for number, (u, z) in enumerate(zip(points, normal, strict=True)):
        turned = math.pi * (u[1] < priors.reversed_share)
        members.append(
            Member(
                azimuth=priors.azimuth[0] + priors.azimuth[1] * z[0] + turned,
                friction=_within(priors.friction, u[2]),
                restitution=_within(priors.restitution, u[3]),
                amplitude=priors.amplitude[0] + priors.amplitude[1] * z[4],
                mixing=_within(priors.mixing, u[5]),
                error=priors.error,
                centre=priors.centre * z[6:9],
                seed=1000 * seed + number,
            )
        )
    return members


def best_guess(priors: Priors) -> Member:
    """The middle of all priors, with the scan as it is and the drive as the scan has it."""
    turned = math.pi * (priors.reversed_share > 0.5)
    return Member(
        azimuth=priors.azimuth[0] + turned,
        friction=_within(priors.friction, 0.5),
        restitution=_within(priors.restitution, 0.5),
        amplitude=priors.amplitude[0],
        mixing=_within(priors.mixing, 0.5),
        error=0.0,
        centre=np.zeros(3),
        seed=0,
    )


def extremes(priors: Priors, *, replica: bool) -> dict[str, tuple[Member, Member]]:
    """For each unknown that has a range, the best guess at its 16th and at its 84th percentile.

    With a ``replica`` the base is drawn between two scans, without one with an error of its own.
    """
    guess = best_guess(priors)
    along = np.array([math.cos(guess.azimuth), math.sin(guess.azimuth), 0.0])
    azimuth, spread = guess.azimuth, priors.azimuth[1]
    mean, gain = priors.amplitude
    up = np.array([0.0, 0.0, 1.0])
    pairs: dict[str, list[dict[str, Any]]] = {
        "azimuth": [{"azimuth": azimuth + way * spread} for way in (-1.0, 1.0)],
        "sign of the drive": [{"azimuth": azimuth + turn} for turn in (0.0, math.pi)],
        "friction": [{"friction": _within(priors.friction, u)} for u in (0.16, 0.84)],
        "restitution": [{"restitution": _within(priors.restitution, u)} for u in (0.16, 0.84)],
        "amplitude": [{"amplitude": mean + way * gain} for way in (-1.0, 1.0)],
        "centre of mass along the drive": [
            {"centre": way * priors.centre * along} for way in (-1.0, 1.0)
        ],
        "height of the centre of mass": [
            {"centre": way * priors.centre * up} for way in (-1.0, 1.0)
        ],
    }
    if replica:
        pairs["mixing of the scans"] = [{"mixing": _within(priors.mixing, u)} for u in (0.16, 0.84)]
    else:
        pairs["error of the base"] = [{"error": priors.error, "seed": seed} for seed in (1, 2)]
    return {
        name: (replace(guess, **low), replace(guess, **high))
        for name, (low, high) in pairs.items()
        if str(low) != str(high)
    }


def _within(pair: tuple[float, float], share: float) -> float:
    return pair[0] + (pair[1] - pair[0]) * float(share)
