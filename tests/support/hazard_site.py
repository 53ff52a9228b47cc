"""A block and the shipped hazard curves, parsed and integrated without the program's physics."""

from __future__ import annotations

import csv
import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import norm

from pipeline import ROOT

Array = NDArray[np.float64]

CURVES = ROOT / "data" / "raw" / "hazard" / "made_up"
AGE, SD, LEAST = 3500.0, 400.0, 0.05
BOX = "rock: {shape: box, size: [0.25, 0.5, 1.2], density: 2110}\n"
GRID = (
    "motion: {pga: [0.15, 0.3, 0.45, 0.6], pgv_pga: [0.05, 0.1, 0.2, 0.4]}\nyaw: [0, 90]\n"
    "simulation: {engine: nonsmooth, time_step: 0.0015}\nuncertainty: {members: 0}\n"
)
HAZARD = (
    f"hazard: {{curves: {CURVES}, "
    f"age: {{kind: normal, mean: {AGE:g}, sd: {SD:g}, source: invented.}}, "
    "compare: [{name: slippery, set: [contact.friction=0.3]}]}\n"
)


def levels_and_rates(measure: str) -> tuple[Array, Array]:
    """Levels, and annual rates of each branch, of the shipped files: shape (branches, levels)."""
    rows = []
    for path in sorted(CURVES.glob(f"hazard_curve-rlz-*-{measure}_1.csv")):
        _, names, values = csv.reader(path.read_text(encoding="utf-8").splitlines())
        rows.append([-math.log1p(-float(value)) for value in values[3:]])
    return np.array([float(name.split("-")[1]) for name in names[3:]]), np.array(rows)


def rate_at(level: Array, levels: Array, rates: Array) -> Array:
    held = rates > 0.0
    y = np.interp(np.log(level), np.log(levels[held]), np.log(rates[held]), right=-np.inf)
    return np.exp(y)


def by_row(fits: xr.Dataset, hazard: xr.Dataset, pga: Array, factor: float = 1.0) -> Array:
    """Probability of a PGV/PGA and of toppling at it, shape (rows, n), from the fits of a rock.

    The rock feels the shaking multiplied by the factor.

    A row stands for what is nearer to it than to the others, in logarithms; of the directions each
    is as likely.
    """
    theta, beta = (fits[name].values[:, 0, :, None] for name in ("theta", "beta"))
    chance = norm.cdf(np.log(factor * pga / theta) / beta).mean(axis=0)
    known = np.log(hazard["pga"].values)
    middle = np.interp(np.log(pga), known, np.log(hazard["pgv_pga_median"].values))
    spread = np.interp(np.log(pga), known, hazard["pgv_pga_log_sd"].values)
    rows = np.log(fits["pgv_pga"].values)
    borders = np.concatenate([[-np.inf], 0.5 * (rows[1:] + rows[:-1]), [np.inf]])
    return np.diff(norm.cdf((borders[:, None] - middle) / spread), axis=0) * chance


def parts_of(levels: Array, rates: Array) -> tuple[Array, Array]:
    """PGA in fine steps, the last beyond all levels, and the rate of earthquakes of each."""
    held = levels[rates > 0.0]
    fine = np.geomspace(held[0], held[-1], 5_000)
    exceeded = rate_at(fine, levels, rates)
    middles = np.sqrt(fine[1:] * fine[:-1])
    return np.append(middles, fine[-1]), np.append(-np.diff(exceeded), exceeded[-1])


def survived(rate: Array) -> Array:
    """Of a normal age, seven standard deviations from zero."""
    return np.exp(-rate * AGE + 0.5 * (rate * SD) ** 2)
