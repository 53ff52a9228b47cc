"""Survival of rocks by brute force: the earthquakes of many histories, each felt by all the rocks.

Written from docs/hazard.md alone; nothing of the program's physics is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stage:
    """A rock as it stood for some time, in each of its draws.

    Attributes
    ----------
    ratios : of the rows [s]
    levels : ndarray, shape (n,) [g], ascending
    toppled : ndarray, shape (draws, rows, n), chance to topple from each level on, mean over yaw
    """

    ratios: Array
    levels: Array
    toppled: Array

    def chance(self, draw: NDArray[np.int64], pga: Array, ratio: Array) -> Array:
        """That to topple in each of some earthquakes."""
        borders = np.sqrt(self.ratios[1:] * self.ratios[:-1])
        level = np.searchsorted(self.levels, pga, side="right") - 1
        of_row = self.toppled[draw, np.searchsorted(borders, ratio), np.maximum(level, 0)]
        return np.where(level < 0, 0.0, of_row)


@dataclass(frozen=True)
class Rock:
    """Stages, the latest first, and when they began.

    Attributes
    ----------
    began : ndarray, shape (n, stages) [years before present], equally likely, ascending in a row
    """

    stages: tuple[Stage, ...]
    began: Array


def of_ensemble(data: xr.Dataset) -> Stage:
    """A member topples from its first overturning on, but for cells above that stand."""
    pga, edges = data["pga"].values, data["member_boundary"].values
    borders = np.sqrt(pga[1:] * pga[:-1])
    levels = np.unique(np.concatenate([edges[np.isfinite(edges)], borders, pga]))
    stands = (data["overturned"].values == 0) & (pga >= edges[..., None])
    nearest = stands[..., np.searchsorted(borders, levels, side="right")] & (levels <= pga[-1])
    toppled = (levels >= edges[..., None]) & ~nearest
    return Stage(data["pgv_pga"].values, levels, toppled.mean(axis=1))


@dataclass(frozen=True)
class Shaking:
    """Earthquakes of a hazard curve, with a lognormal PGV/PGA.

    Attributes
    ----------
    pga, rate : of the curve [g, 1/year], straight in their logarithms
    table : ndarray, shape (3, n): PGA [g], median [s] and deviation of ln PGV/PGA
    """

    pga: Array
    rate: Array
    table: Array

    def drawn(self, total: float, number: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """PGA and PGV/PGA of earthquakes, a total of which come each year."""
        exceeded = np.log(total) + np.log1p(-rng.random(number))
        log_pga = np.interp(-exceeded, -np.log(self.rate), np.log(self.pga))
        at, median, log_sd = self.table
        centre, spread = (np.interp(log_pga, np.log(at), one) for one in (np.log(median), log_sd))
        return np.exp(log_pga), np.exp(centre + spread * rng.standard_normal(number))


def survival(
    shaking: Shaking, rocks: Sequence[Rock], number: int, seed: int
) -> tuple[float, float]:
    """Chance that all the rocks stand, and its standard error, of a number of histories.

    Ages and draws of the rocks are independent; a draw is the rock in all its stages.
    """
    rng, stood = np.random.default_rng(seed), np.zeros(number)
    began = [rock.began[rng.integers(len(rock.began), size=number)] for rock in rocks]
    draws = [rng.integers(len(rock.stages[0].toppled), size=number) for rock in rocks]
    first = min(
        one.levels[one.toppled.any(axis=(0, 1))][0] for rock in rocks for one in rock.stages
    )
    total = float(np.exp(np.interp(np.log(first), np.log(shaking.pga), np.log(shaking.rate))))
    oldest = np.max([times[:, -1] for times in began], axis=0)
    history = np.repeat(np.arange(number), rng.poisson(total * oldest))
    ago = rng.random(len(history)) * oldest[history]
    pga, ratio = shaking.drawn(total, len(history), rng)
    for rock, times, draw in zip(rocks, began, draws, strict=True):
        then = (ago[:, None] >= times[history]).sum(axis=1)
        for place, stage in enumerate(rock.stages):
            felt = then == place
            chance = stage.chance(draw[history[felt]], pga[felt], ratio[felt])
            with np.errstate(divide="ignore"):
                stood += np.bincount(history[felt], np.log1p(-chance), minlength=number)
    return float(np.exp(stood).mean()), float(np.exp(stood).std() / np.sqrt(number))
