"""PGV given PGA, from magnitudes and distances: two measures that are lognormal together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsr_core.arrays import Array
from vsr_core.hazard.ratio import RatioTable

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


def ratios_of_scenarios(
    magnitudes: Array, distances: Array, levels: Array, shares: Array, at: Array
) -> RatioTable:
    """PGV/PGA of the earthquakes that a disaggregation of PGA names.

    Of one magnitude and distance ln PGV is normal given ln PGA = a, with mean
    m_V + rho s_V (a - m_A) / s_A and variance s_V^2 (1 - rho^2). The table has mean and variance of
    all together. Shares are straight in ln PGA between levels, and as at the ends beyond.

    Parameters
    ----------
    magnitudes, distances : ndarray, shape (n,) [1] and [km]
    levels : ndarray, shape (k,) [m/s^2], ascending, at which PGA was disaggregated
    shares : ndarray, shape (k, n), of each magnitude and distance; rows sum to 1
    at : ndarray, shape (m,) [m/s^2], accelerations of the table
    """
    x = np.log(at)
    share = np.stack([np.interp(x, np.log(levels), one) for one in shares.T], axis=1)
    residual = (x[:, None] - PGA.log_median(magnitudes, distances)) / PGA.log_sd
    velocity = PGV.log_median(magnitudes, distances) + CORRELATION * PGV.log_sd * residual
    mean = (share * velocity).sum(axis=1)
    spread = (share * (velocity - mean[:, None]) ** 2).sum(axis=1)
    return RatioTable(at, np.exp(mean - x), np.sqrt(LOG_SD**2 + spread))
