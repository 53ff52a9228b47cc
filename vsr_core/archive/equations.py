"""Equations of the first overturning under a cosine pulse, in similarity variables.

    PGA = g tan(alpha_min) / (1 - exp(z)),   z = sum over i, j of c_ij S_i(ln u) T_j,
    u = 1 / (p PGV/PGA),   p^2 = p_1 p_2

S_i are natural cubic splines, T_j products of the features below. Where z reaches 0 no PGA topples
the rock: the overturning with an impact ends there. Below the first knot z rises by 1 per unit of
ln u, so that long pulses topple at g tan(alpha_min), Housner's limit.

References
----------
Housner (1963), Bull. Seismol. Soc. Am. 53(2), 403-417.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from vsr_core.archive.profiles import Profiles
from vsr_core.arrays import Array, Mask

HIGHEST = 10.0
"""PGA in units of g tan(alpha_min) up to which boundaries were looked for."""

SHORTEST = 12.0
"""Largest 1 / (p PGV/PGA) among the runs."""

MOST_GRIP = 1.0 / 1.05
"""Largest tan(alpha_min) by friction among the runs: beyond 1 the rock slides."""

FARTHEST = 20.0
"""PGA in units of g tan(alpha_min) that is given at most."""

OPEN = 0.025
"""Share of rocks without a boundary from which on a band that holds 95 % is open above."""

ONE = "1"
"""The term that is always there."""


def _first_stronger(rock: Profiles) -> Array:
    return np.tanh(np.maximum(np.log(rock.tan_alpha[..., 0] / rock.tan_alpha[..., 1]), 0.0))


def _first_weaker(rock: Profiles) -> Array:
    return np.tanh(np.maximum(np.log(rock.tan_alpha[..., 1] / rock.tan_alpha[..., 0]), 0.0))


FEATURES: dict[str, Callable[[Profiles], Array]] = {
    "first_stronger": _first_stronger,
    "first_weaker": _first_weaker,
    "lost": lambda rock: 1.0 - rock.kept,
    "roundness": lambda rock: rock.roundness,
    "grip": lambda rock: np.minimum(rock.weakest / rock.friction, MOST_GRIP),
    "slenderness": lambda rock: rock.weakest,
}
"""What the terms are made of.

``first_stronger`` and ``first_weaker`` are tanh |ln(tan alpha_a / tan alpha_b)| where side a, to
which the rock leans first, is the stronger or the weaker one, else 0; ``lost`` is the share of the
energy that impacts on both points take; ``slenderness`` is tan(alpha) of the weaker side, and
``grip`` that by friction.
"""


def terms(names: tuple[str, ...], rocks: Profiles) -> Array:
    """Values of terms, shape (..., terms); each name is of features with ``*`` between them."""
    values = {name: feature(rocks) for name, feature in FEATURES.items()}
    values[ONE] = np.ones_like(rocks.friction)
    return np.stack(
        [reduce(np.multiply, (values[one] for one in name.split("*"))) for name in names], axis=-1
    )


def splines(ln_u: Array, knots: Array) -> Array:
    """Natural cubic splines: linear beyond the last knot, along 1 below the first.

    Returns
    -------
    ndarray, shape (..., knots)
    """
    within = np.maximum(ln_u, knots[0])[..., None]
    cubes = np.maximum(within - knots, 0.0) ** 3
    parts = (cubes[..., :-1] - cubes[..., -1:]) / (knots[-1] - knots[:-1])
    return np.concatenate(
        [np.ones_like(within), within - knots[0], parts[..., :-1] - parts[..., -1:]], axis=-1
    )


@dataclass(frozen=True, eq=False)
class Error:
    """Error of the equations on shapes that they were not fitted to, by their result and by u.

    Attributes
    ----------
    above : ndarray, shape (n,), ascending from 1: least PGA of a class in units of g tan(alpha_min)
    shorter : ndarray, shape (k,), ascending from 0: least u of a class
    median, most : ndarray, shape (n, k), of the size of ln(equation / run): half, and 95 in 100,
        are below; without a boundary by runs it is infinite, but where ``none`` is ``OPEN`` or more
        left out
    none : ndarray, shape (n, k), share of what the equations give for which no run up to
        ``HIGHEST`` toppled the rock
    """

    above: Array
    shorter: Array
    median: Array
    most: Array
    none: Array

    def of(self, relative: Array, u: Array) -> tuple[Array, Array]:
        """What 95 in 100 errors are below, and the share without a boundary.

        Parameters
        ----------
        relative : ndarray, boundaries by the equations in units of g tan(alpha_min)
        u : ndarray, 1 / (p PGV/PGA)
        """
        by_size = np.maximum(np.searchsorted(self.above, relative, side="right") - 1, 0)
        here = by_size, np.searchsorted(self.shorter, u, side="right") - 1
        return np.asarray(self.most[here]), np.asarray(self.none[here])


@dataclass(frozen=True, eq=False)
class Equations:
    """Fitted equations.

    Attributes
    ----------
    knots : ndarray, shape (k,), of ln u
    names : tuple of str, the n terms
    coefficients : ndarray, shape (k, n)
    covariance : ndarray, shape (k n, k n), of the coefficients row by row; shapes are independent
    """

    knots: Array
    names: tuple[str, ...]
    coefficients: Array
    covariance: Array
    error: Error

    def boundary(self, rocks: Profiles, pgv_pga: Array) -> Array:
        """PGA of first overturning [g].

        Parameters
        ----------
        rocks : Profiles, shape (...)
        pgv_pga : ndarray, shape (m,) [s], or that of the rocks and (m,)

        Returns
        -------
        ndarray, shape (..., m), also where it is beyond what was looked for (`is_known`)
        """
        return np.asarray(rocks.weakest[..., None] * above_static(self._z(rocks, pgv_pga)))

    def _z(self, rocks: Profiles, pgv_pga: Array) -> Array:
        ln_u = shortness(rocks, pgv_pga)
        by_spline = terms(self.names, rocks) @ self.coefficients.T
        z = np.einsum("...mk,...k->...m", splines(ln_u, self.knots), by_spline)
        return np.asarray(z + np.minimum(ln_u - self.knots[0], 0.0))

    def told_error(self, rocks: Profiles, pgv_pga: Array, boundary: Array) -> tuple[Array, Array]:
        """`Error.of` boundaries [g] on shapes left out, each of shape (..., m)."""
        relative = boundary / rocks.weakest[..., None]
        return self.error.of(relative, np.exp(shortness(rocks, pgv_pga)))

    def known(self, rocks: Profiles, pgv_pga: Array, boundary: Array) -> Mask:
        """Whether boundaries are within what was looked for, shape (..., m)."""
        reach = boundary <= HIGHEST * rocks.weakest[..., None]
        return np.asarray(reach & (shortness(rocks, pgv_pga) <= np.log(SHORTEST)))

    def coefficient_sd(self, rocks: Profiles, pgv_pga: Array) -> Array:
        """Standard deviation of ln boundary from the coefficients alone, shape (..., m)."""
        shape = splines(shortness(rocks, pgv_pga), self.knots)
        each = shape[..., :, None] * terms(self.names, rocks)[..., None, None, :]
        flat = each.reshape(*shape.shape[:-1], -1)
        variance = ((flat @ self.covariance) * flat).sum(axis=-1)
        slope = above_static(self._z(rocks, pgv_pga)) - 1.0
        return np.asarray(slope * np.sqrt(variance))


def above_static(z: Array) -> Array:
    """1 / (1 - exp(z)), at most ``FARTHEST``."""
    return np.asarray(1.0 / -np.expm1(np.minimum(z, np.log1p(-1.0 / FARTHEST))))


def shortness(rocks: Profiles, pgv_pga: Array) -> Array:
    """Logarithm of u = 1 / (p PGV/PGA) with the geometric mean of both p, shape (..., m).

    Parameters
    ----------
    pgv_pga : ndarray, shape (m,) or (..., m) [s]
    """
    return np.asarray(-0.5 * np.log(rocks.p).sum(axis=-1)[..., None] - np.log(pgv_pga))
