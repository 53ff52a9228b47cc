"""PGV/PGA of the shaking at a peak ground acceleration, as a hazard model leaves it open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import HazardCurve


@dataclass(frozen=True, eq=False)
class RatioTable:
    """Lognormal PGV/PGA at peak ground accelerations, straight in ln PGA between them.

    Attributes
    ----------
    levels : ndarray, shape (n,) [m/s^2], ascending; beyond them as at the first and the last
    medians : ndarray, shape (n,) [s]
    log_sds : ndarray, shape (n,), standard deviation of ln PGV/PGA

    Raises
    ------
    InvalidInput
        If levels do not ascend, or a value is not positive.
    """

    levels: Array
    medians: Array
    log_sds: Array

    def __post_init__(self) -> None:
        if not len(self.levels) == len(self.medians) == len(self.log_sds) > 0:
            raise InvalidInput(
                f"{len(self.levels)} PGA, {len(self.medians)} PGV/PGA and {len(self.log_sds)} "
                "deviations",
                "each PGA has a median of PGV/PGA and a deviation of its logarithm",
                "look at the table",
            )
        if not (np.diff(self.levels) > 0.0).all():
            raise InvalidInput("PGA out of order", "they ascend", "sort them")
        values = np.concatenate([self.levels, self.medians, self.log_sds])
        if not ((values > 0.0).all() and np.isfinite(values).all()):
            raise InvalidInput(
                f"{values.min():g} in a table of PGV/PGA", "all are positive", "look at the table"
            )

    def at(self, level: Array) -> tuple[Array, Array]:
        """Median of PGV/PGA and standard deviation of its logarithm.

        Parameters
        ----------
        level : ndarray, shape (n,) [m/s^2]

        Returns
        -------
        medians, log_sds : ndarray, shape (n,) [s] and [1]
        """
        x, known = np.log(level), np.log(self.levels)
        median = np.exp(np.interp(x, known, np.log(self.medians)))
        return median, np.interp(x, known, self.log_sds)

    def times(self, factor: float) -> RatioTable:
        """The same with all medians multiplied."""
        return RatioTable(self.levels, factor * self.medians, self.log_sds)


def ratio_of_curves(pga: HazardCurve, pgv: HazardCurve, log_sd: float) -> RatioTable:
    """PGV/PGA where both are exceeded equally often.

    It is not the median of PGV given PGA: extremes of the two come together only in part, and so
    it is somewhat larger at rare levels.

    Parameters
    ----------
    pga, pgv : HazardCurve [m/s^2] and [m/s]

    Returns
    -------
    RatioTable, at the levels of PGA whose rates both curves have

    Raises
    ------
    InvalidInput
        If they have no rate in common.
    """
    velocities = np.array([pgv.level_at(rate) for rate in pga.rates])
    known = np.isfinite(velocities)
    levels = pga.levels[known]
    return RatioTable(levels, velocities[known] / levels, np.full(len(levels), log_sd))
