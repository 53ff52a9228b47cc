"""A hazard curve: how often a year the ground shakes more strongly than a level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput


@dataclass(frozen=True, eq=False)
class HazardCurve:
    """Annual rates of exceedance; between its levels ln rate is linear in ln level.

    Attributes
    ----------
    levels : ndarray, shape (n,) [m/s^2], or [m/s] of PGV, ascending
    rates : ndarray, shape (n,) [1/year], positive and not rising

    Raises
    ------
    InvalidInput
        If levels or rates break these rules.
    """

    levels: Array
    rates: Array

    def __post_init__(self) -> None:
        if len(self.levels) < 2 or len(self.levels) != len(self.rates):
            raise InvalidInput(
                f"{len(self.levels)} levels and {len(self.rates)} rates above 0",
                "a curve has two or more, and a rate for each",
                "look at the curve",
            )
        if not (self.levels[0] > 0.0 and (np.diff(self.levels) > 0.0).all()):
            raise InvalidInput("levels out of order", "they ascend from above 0", "sort them")
        if not ((self.rates > 0.0).all() and np.isfinite(self.rates).all()):
            raise InvalidInput("a rate that is not positive", "rates are above 0", "cut it off")
        rising = np.flatnonzero(np.diff(self.rates) > 0.0)
        if len(rising):
            raise InvalidInput(
                f"a rate that rises after level {rising[0] + 1} of {len(self.levels)}",
                "stronger shaking is not more frequent",
                "look at the curve",
            )

    def rate_at(self, level: Array) -> Array:
        """Annual rates at which levels are exceeded.

        Parameters
        ----------
        level : ndarray [m/s^2]

        Returns
        -------
        ndarray [1/year], NaN outside the levels of the curve
        """
        x, y = np.log(self.levels), np.log(self.rates)
        return np.exp(np.interp(np.log(level), x, y, left=np.nan, right=np.nan))

    def level_at(self, rate: float) -> float:
        """The level that is exceeded at a rate; for 1/2475 a year that of 2,475 years.

        Parameters
        ----------
        rate : float [1/year]

        Returns
        -------
        float [m/s^2], NaN outside the rates of the curve
        """
        x, y = np.log(self.levels[::-1]), np.log(self.rates[::-1])
        return float(np.exp(np.interp(np.log(rate), y, x, left=np.nan, right=np.nan)))


def curve_of_probabilities(levels: Array, probabilities: Array, years: float) -> HazardCurve:
    """A curve from probabilities of exceedance in some years, earthquakes being Poissonian.

    Levels that are never exceeded end the curve.

    Parameters
    ----------
    levels : ndarray, shape (n,) [m/s^2]
    probabilities : ndarray, shape (n,)

    Raises
    ------
    InvalidInput
        For a probability of 1, which has no finite rate, or outside 0 to 1.
    """
    if not ((probabilities >= 0.0).all() and (probabilities <= 1.0).all()):
        raise InvalidInput(
            f"probabilities from {probabilities.min():g} to {probabilities.max():g}",
            "they are from 0 to 1",
            "look at the curve",
        )
    if (probabilities == 1.0).any():
        raise InvalidInput(
            f"a probability of 1 in {years:g} years",
            "it has no finite rate",
            "export the curve for fewer years, or drop the level",
        )
    rates = -np.log1p(-probabilities) / years
    held = rates > 0.0
    return HazardCurve(levels[held], rates[held])
