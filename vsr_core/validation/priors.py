"""What is unknown of a shake-table test, as prior ranges, and an ensemble that fills them evenly.

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

SEED = 7
"""Of the sequence of draws."""

FIRST_SEED = 1000 * SEED
"""Of the first draw's own chance; that of each further one is the next number."""


@dataclass(frozen=True)
class Priors:
    """Ranges of the unknowns; pairs are (low, high) of a uniform one, (mean, sd) of a normal one.

    Attributes
    ----------
    azimuth : (mean, sd) [rad], direction of the drive from the scan's +x, counter-clockwise
    polarity_reversal_probability : float, probability that the drive points the other way
    friction : (low, high) [1]
    restitution : (low, high) [1]
    amplitude : (mean, sd) [1], factor on the acceleration, for its gain
    mixing : (low, high) [1], share of a replica's scan in the shape, where there is a replica
    error : float [1], error of the base in units of its standard deviation (see ``Form.spread``)
    centre : float [m], sd of the centre of mass along each axis: density, closing of the scan
    inset : (low, high) [1]
        How far inside the hull of its scan a rock bears, relative to the height of its centre of
        mass: rounded and crushed edges, a soft or rough support.
    """

    azimuth: tuple[float, float] = (math.radians(-7.5), math.radians(7.5))
    polarity_reversal_probability: float = 0.5
    friction: tuple[float, float] = (0.5, 0.9)
    restitution: tuple[float, float] = (0.0, 0.0)
    amplitude: tuple[float, float] = (1.0, 0.03)
    mixing: tuple[float, float] = (0.15, 0.85)
    error: float = 1.0
    centre: float = 0.004
    inset: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Member:
    """One draw; see ``Priors``.

    Attributes
    ----------
    reversed : bool, whether the drive points against its azimuth
    centre : ndarray, shape (3,) [m], offset of the centre of mass
    """

    azimuth: float
    reversed: bool
    friction: float
    restitution: float
    amplitude: float
    mixing: float
    error: float
    centre: Array
    seed: int
    inset: float = 0.0

    def shaken_as(self, other: Member) -> Member:
        """The same rock in the shaking of another draw."""
        return replace(
            self, azimuth=other.azimuth, reversed=other.reversed, amplitude=other.amplitude
        )

    @property
    def direction(self) -> float:
        """Where a positive acceleration points [rad], from the scan's +x, counter-clockwise."""
        return self.azimuth + math.pi * self.reversed


def draws(priors: Priors, count: int) -> list[Member]:
    """Members of an ensemble: a scrambled Sobol sequence over all unknowns but the base's error.

    The drive is reversed in every other member, or with ``polarity_reversal_probability``.
    """
    points, insets = _sequence(9, count), _sequence(11, count)[:, 10]
    return [
        replace(
            _member(priors, u, z, error=priors.error, seed=FIRST_SEED + number),
            inset=_within(priors.inset, inset),
        )
        for number, (u, z, inset) in enumerate(zip(points, norm.ppf(points), insets, strict=True))
    ]


def further(count: int) -> Array:
    """Numbers on (0, 1) for what only some members draw, shape (count,).

    They are the tenth of their sequence, and so fill its square with each of the nine of ``draws``.
    """
    return _sequence(10, count)[:, 9]


def _sequence(dimensions: int, count: int) -> Array:
    exponent = math.ceil(math.log2(max(count, 2)))
    points = qmc.Sobol(dimensions, rng=SEED).random_base2(exponent)[:count]
    return np.asarray(np.clip(points, 1e-6, 1.0 - 1e-6))


def best_guess(priors: Priors) -> Member:
    """The middle of all priors, with the scan as it is and the likelier sign of the drive.

    Examples
    --------
    >>> best_guess(Priors(friction=(0.5, 0.75))).friction
    0.625
    """
    guess = _member(priors, np.full(9, 0.5), np.zeros(9), error=0.0, seed=0)
    return replace(guess, inset=_within(priors.inset, 0.5))


def extremes(priors: Priors, *, replica: bool) -> dict[str, tuple[Member, Member]]:
    """For each unknown that has a range, the best guess at its 16th and at its 84th percentile.

    Parameters
    ----------
    replica : bool
        Whether the base is drawn between two scans; else it has an error of its own.

    Returns
    -------
    dict of str to (Member, Member)
        By the unknown in words.
    """
    guess = best_guess(priors)
    azimuth, turn, (mean, gain) = guess.azimuth, priors.azimuth[1], priors.amplitude
    drive = np.array([math.cos(guess.direction), math.sin(guess.direction), 0.0])
    along = priors.centre * drive
    up = priors.centre * np.array([0.0, 0.0, 1.0])
    ends: dict[str, tuple[str, Any, Any]] = {
        "azimuth": ("azimuth", azimuth - turn, azimuth + turn),
        "sign of the drive": ("reversed", guess.reversed, not guess.reversed),
        "friction": ("friction", *_percentiles(priors.friction)),
        "restitution": ("restitution", *_percentiles(priors.restitution)),
        "amplitude": ("amplitude", mean - gain, mean + gain),
        "centre of mass along the drive": ("centre", -along, along),
        "height of the centre of mass": ("centre", -up, up),
        "inset of the base": ("inset", *_percentiles(priors.inset)),
    }
    if replica:
        ends["mixing of the scans"] = ("mixing", *_percentiles(priors.mixing))
    pairs = {
        name: (replace(guess, **{field: low}), replace(guess, **{field: high}))
        for name, (field, low, high) in ends.items()
        if np.any(low != high)
    }
    if not replica:
        one, other = (replace(guess, error=priors.error, seed=seed) for seed in (1, 2))
        pairs["error of the base"] = one, other
    return pairs


def _member(priors: Priors, u: Array, z: Array, *, error: float, seed: int) -> Member:
    """The member at nine numbers each, uniform on (0, 1) and the same as standard normal ones."""
    return Member(
        azimuth=float(priors.azimuth[0] + priors.azimuth[1] * z[0]),
        reversed=bool(u[1] < priors.polarity_reversal_probability),
        friction=_within(priors.friction, u[2]),
        restitution=_within(priors.restitution, u[3]),
        amplitude=float(priors.amplitude[0] + priors.amplitude[1] * z[4]),
        mixing=_within(priors.mixing, u[5]),
        error=error,
        centre=priors.centre * z[6:9],
        seed=seed,
    )


def _within(pair: tuple[float, float], share: float) -> float:
    return pair[0] + (pair[1] - pair[0]) * float(share)


def _percentiles(pair: tuple[float, float]) -> tuple[float, float]:
    """The 16th and the 84th of a uniform prior."""
    return _within(pair, 0.16), _within(pair, 0.84)
