"""PGV/PGA of the shaking at a peak ground acceleration: of hazard curves, or of scenarios."""

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


CORRELATION = 0.733
"""Of the residuals of ln PGA and ln PGV (Bradley 2012, Earthquake Spectra 28(1))."""


@dataclass(frozen=True)
class Equation:
    """log10 y = b1 + b2 M + b3 M^2 + (b4 + b5 M) log10 sqrt(R^2 + b6^2), in cm and s.

    On rock (shear-wave velocity above 750 m/s) and for strike-slip earthquakes; M is the moment
    magnitude, R the distance in km from the surface projection of the fault. It is for the
    geometric mean of two horizontal components.

    Attributes
    ----------
    within, between : float, standard deviations of log10 y within and between earthquakes
    """

    b1: float
    b2: float
    b3: float
    b4: float
    b5: float
    b6: float
    within: float
    between: float

    def log_median(self, magnitude: Array, distance: Array) -> Array:
        """Natural logarithm of the median, in m and s.

        Parameters
        ----------
        magnitude, distance : ndarray, of one shape [1] and [km]
        """
        path = (self.b4 + self.b5 * magnitude) * np.log10(np.hypot(distance, self.b6))
        size = self.b1 + self.b2 * magnitude + self.b3 * magnitude**2
        return (size + path - 2.0) * np.log(10.0)

    @property
    def log_sd(self) -> float:
        """Standard deviation of the natural logarithm."""
        return float(np.hypot(self.within, self.between) * np.log(10.0))


PGA = Equation(1.43525, 0.74866, -0.06520, -2.72950, 0.25139, 7.74959, 0.2611, 0.1056)
"""Bommer, Akkar & Drouet (2012), Bull. Earthquake Eng. 10, table 5."""

PGV = Equation(-2.12833, 1.21448, -0.08137, -2.46942, 0.22349, 6.41443, 0.2562, 0.1083)
"""Akkar & Bommer (2010), Seismol. Res. Lett. 81(2), table 1."""

LOG_SD = PGV.log_sd * float(np.sqrt(1.0 - CORRELATION**2))
"""Standard deviation of ln PGV where PGA, magnitude and distance are known."""


def log_pgv_given(log_pga: Array, magnitude: Array, distance: Array) -> Array:
    """Mean of ln PGV where PGA, magnitude and distance are known, m_V + rho s_V (a - m_A) / s_A.

    Parameters
    ----------
    log_pga, magnitude, distance : ndarray, of one shape, or that broadcast [ln m/s^2], [1], [km]

    Returns
    -------
    ndarray [ln m/s]
    """
    residual = (log_pga - PGA.log_median(magnitude, distance)) / PGA.log_sd
    return PGV.log_median(magnitude, distance) + CORRELATION * PGV.log_sd * residual


def ratios_of_scenarios(
    magnitudes: Array, distances: Array, levels: Array, shares: Array, at: Array
) -> RatioTable:
    """PGV/PGA of the earthquakes that a disaggregation of PGA names.

    Of one magnitude and distance ln PGV is normal given ln PGA, with the mean of ``log_pgv_given``
    and the standard deviation `LOG_SD`. The table has mean and variance of all together. Shares are
    straight in ln PGA between levels, and as at the ends beyond.

    Parameters
    ----------
    magnitudes, distances : ndarray, shape (n,) [1] and [km]
    levels : ndarray, shape (k,) [m/s^2], ascending, at which PGA was disaggregated
    shares : ndarray, shape (k, n), of each magnitude and distance; rows sum to 1
    at : ndarray, shape (m,) [m/s^2], accelerations of the table
    """
    x = np.log(at)
    share = np.stack([np.interp(x, np.log(levels), one) for one in shares.T], axis=1)
    velocity = log_pgv_given(x[:, None], magnitudes, distances)
    mean = (share * velocity).sum(axis=1)
    spread = (share * (velocity - mean[:, None]) ** 2).sum(axis=1)
    return RatioTable(at, np.exp(mean - x), np.sqrt(LOG_SD**2 + spread))
