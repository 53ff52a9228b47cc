"""The equations fitted to boundaries of drawn rocks, and their error on shapes left out.

Fitted is z = ln(1 - g tan(alpha_min) / PGA), by least squares in which an error counts as what it
is in ln PGA, up to a boundary of twice g tan(alpha_min) and as much beyond. Where no pulse tried
topples a rock, z is only asked to be as large or larger. Weights are of a Cauchy law, as boundaries
jump where another impact decides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsr_core.archive.equations import (
    HIGHEST,
    OPEN,
    Equations,
    Error,
    above_static,
    shortness,
    splines,
    terms,
)
from vsr_core.archive.profiles import Profiles
from vsr_core.arrays import Array, Indices

KNOTS = np.log([0.25, 0.6, 1.1, 1.6, 2.2, 3.0, 4.0, 5.5, 8.0])
"""Knots of ln u."""

SCALE = 0.15
"""Error from which on a boundary counts less."""

RIDGE = 1e-6
"""Pull of coefficients to 0, as a share of what the boundaries say on average."""

RESOLVED = 1.005
"""Least boundary in units of g tan(alpha_min): runs tell no less from 1."""

FOLDS = 5
"""Parts of the shapes, each left out once."""

CLASSES = np.array([1.0, 1.1, 1.3, 1.7, 2.5, 4.0])
"""Least boundaries, in units of g tan(alpha_min), of the classes whose errors are told apart."""

SHORTER = np.array([0.0, 1.2, 1.8, 2.5, 3.5])
"""Least u of those classes."""

ENOUGH = 100
"""Boundaries from which a class has errors of its own, and not those of all u."""

_ROUNDS, _ENOUGH = 40, 1e-6


@dataclass(frozen=True, eq=False)
class Boundaries:
    """Boundaries of drawn rocks, a row for each rock and direction.

    Attributes
    ----------
    shape : ndarray of int, shape (n,), number of the shape: both directions have the same
    rocks : Profiles, shape (n,)
    pgv_pga : ndarray, shape (n, m) [s]
    pga : ndarray, shape (n, m) [g], nan where none was found up to ``HIGHEST``
    """

    shape: Indices
    rocks: Profiles
    pgv_pga: Array
    pga: Array

    @property
    def relative(self) -> Array:
        """Boundaries in units of g tan(alpha_min), shape (n, m)."""
        return np.asarray(self.pga / self.rocks.weakest[:, None])


@dataclass(frozen=True, eq=False)
class _Aims:
    """What z is to be, how much an error in it counts, and whether more is as good."""

    z: Array
    counts: Array
    beyond: Array

    @classmethod
    def of(cls, relative: Array) -> _Aims:
        beyond = np.isnan(relative)
        known = np.maximum(np.where(beyond, HIGHEST, relative), RESOLVED)
        return cls(np.log1p(-1.0 / known), np.minimum(known - 1.0, 1.0), beyond)

    def missed(self, z: Array) -> Array:
        """Errors, about those of ln PGA."""
        off = (self.z - z) * self.counts
        return np.where(self.beyond, np.maximum(off, 0.0), off)

    def weights(self, missed: Array) -> Array:
        """Weights of squares of errors in z."""
        off = np.where(self.beyond & (missed == 0.0), 0.0, self.counts)
        return np.asarray(off**2 / (1.0 + (missed / SCALE) ** 2))


def fit(given: Boundaries, names: tuple[str, ...]) -> Equations:
    """Equations with some terms, their covariance, and their error on shapes left out."""
    design, relative = _design(given, names), given.relative
    found = left_out(given, names)
    coefficients = _solved(design, relative)
    covariance = _covariance(design, relative, coefficients, given.shape)
    table = coefficients.reshape(len(KNOTS), len(names))
    u = np.exp(shortness(given.rocks, given.pgv_pga))
    return Equations(KNOTS, names, table, covariance, error_of(found, u, missed(found, relative)))


def left_out(given: Boundaries, names: tuple[str, ...]) -> Array:
    """Boundaries by equations that were fitted without the shape, in units of g tan(alpha_min)."""
    design, relative = _design(given, names), given.relative
    part = np.unique(given.shape, return_inverse=True)[1] % FOLDS
    found = np.empty_like(relative)
    for number in range(FOLDS):
        out = part == number
        found[out] = above_static(design[out] @ _solved(design[~out], relative[~out]))
    return found


def _design(given: Boundaries, names: tuple[str, ...]) -> Array:
    """Products of splines and terms, shape (n, m, coefficients)."""
    ln_u = shortness(given.rocks, given.pgv_pga)
    each = splines(ln_u, KNOTS)[..., :, None] * terms(names, given.rocks)[:, None, None, :]
    return each.reshape(*ln_u.shape, -1)


def _solved(design: Array, relative: Array) -> Array:
    """Coefficients, by least squares with weights that follow what is missed."""
    rows, aims = design.reshape(-1, design.shape[-1]), _Aims.of(relative.ravel())
    ridge = np.diag(RIDGE * (rows**2).sum(axis=0) + 1e-9)
    weight, before = np.where(aims.beyond, 0.0, aims.counts**2), np.inf
    coefficients: Array = np.zeros(rows.shape[1])
    for _ in range(_ROUNDS):
        weighed = rows * weight[:, None]
        coefficients = np.asarray(
            np.linalg.solve(weighed.T @ rows + ridge, weighed.T @ aims.z), dtype=np.float64
        )
        missed = aims.missed(rows @ coefficients)
        weight = aims.weights(missed)
        cost = float(np.log1p((missed / SCALE) ** 2).sum())
        if abs(before - cost) <= _ENOUGH * cost:
            break
        before = cost
    return coefficients


def _covariance(design: Array, relative: Array, coefficients: Array, shape: Indices) -> Array:
    """Covariance of coefficients: shapes are independent, boundaries of one shape are not."""
    aims, z = _Aims.of(relative), design @ coefficients
    weight = aims.weights(aims.missed(z))
    rows = design.reshape(-1, design.shape[-1])
    normal = (rows * weight.reshape(-1, 1)).T @ rows
    inverse = np.linalg.inv(normal + np.diag(RIDGE * (rows**2).sum(axis=0) + 1e-9))
    pulls = np.einsum("nmc,nm->nc", design, weight * (aims.z - z))
    number = np.unique(shape, return_inverse=True)[1]
    by_shape = np.zeros((number.max() + 1, pulls.shape[1]))
    np.add.at(by_shape, number, pulls)
    return np.asarray(inverse @ (by_shape.T @ by_shape) @ inverse)


def missed(found: Array, relative: Array) -> Array:
    """Errors of ln boundary, equations by runs, both in units of g tan(alpha_min).

    Minus infinite where the equations alone give one up to ``HIGHEST``: the rock topples beyond it
    or never. Nan where neither has one.
    """
    none = np.where(found < HIGHEST, -np.inf, np.nan)
    return np.where(np.isnan(relative), none, np.log(found / relative))


def error_of(found: Array, u: Array, missed: Array) -> Error:
    """Error by classes of what the equations give, and of u.

    Parameters
    ----------
    found : ndarray, boundaries by the equations in units of g tan(alpha_min)
    u : ndarray, of the same shape, 1 / (p PGV/PGA)
    missed : ndarray, of the same shape, as of `missed`
    """
    known = found < HIGHEST  # beyond, no boundary is told
    size = np.abs(missed[known])
    by_size = np.searchsorted(CLASSES, found[known], side="right") - 1
    by_u = np.searchsorted(SHORTER, u[known], side="right") - 1
    tables = np.empty((3, len(CLASSES), len(SHORTER)))
    for i, k in np.ndindex(len(CLASSES), len(SHORTER)):
        here = (by_size == i) & (by_u == k)
        part = size[here if here.sum() >= ENOUGH else by_size == i]
        none = float(np.isinf(part).mean())
        if none >= OPEN:
            part = part[np.isfinite(part)]
        tables[:, i, k] = *np.quantile(part, (0.5, 0.95)), none
    return Error(CLASSES, SHORTER, *tables)
