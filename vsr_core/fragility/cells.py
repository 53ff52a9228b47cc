"""Flat run arrays gathered into a table of counts, the form in which every model fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput


@dataclass(frozen=True)
class Cells:
    """Counts of runs on the product of the distinct PGV/PGA and PGA values.

    Attributes
    ----------
    ln_pga : ndarray, shape (n_pga,) [ln g]
    ln_ratio : ndarray, shape (n_ratio,) [ln s]
    toppled, trials : ndarray, shape (n_ratio, n_pga)
        Overturned and decided runs of each cell; trials is 0 where nothing was decided.
    """

    ln_pga: Array
    ln_ratio: Array
    toppled: Array
    trials: Array

    @property
    def usable(self) -> Mask:
        """Rows with at least one decided run, shape (n_ratio,)."""
        return self.trials.sum(axis=1) > 0

    @property
    def varied(self) -> bool:
        """Whether both outcomes occur."""
        return 0 < self.toppled.sum() < self.trials.sum()


def positive(values: npt.ArrayLike, name: str) -> Array:
    """Return `values` as floats; refuse any that is not finite and above 0."""
    array = np.asarray(values, dtype=np.float64)
    if not (np.isfinite(array) & (array > 0)).all():
        raise InvalidInput(
            f"{name} holds values that are not finite and above 0",
            "fragility is fitted in ln PGA and ln PGV/PGA",
            f"leave such runs out or correct {name}",
        )
    return array


def outcomes(overturned: npt.ArrayLike) -> Array:
    """Return outcomes as 1.0, 0.0 and NaN (undecided: NaN or -1 on input)."""
    array = np.array(overturned, dtype=np.float64)
    array[array == -1] = np.nan
    if not np.isin(array[~np.isnan(array)], (0.0, 1.0)).all():
        raise InvalidInput(
            "overturned holds values other than 0, 1, -1 and NaN",
            "a run overturned (1), did not (0) or is undecided (-1 or NaN)",
            "pass the variable `overturned` of the responses",
        )
    return array


def tabulate(pga: npt.ArrayLike, pgv_pga: npt.ArrayLike, overturned: npt.ArrayLike) -> Cells:
    """Count the runs of each (PGV/PGA, PGA) cell.

    Parameters
    ----------
    pga : array_like, shape (n_runs,) [g]
    pgv_pga : array_like, shape (n_runs,) [s]
    overturned : array_like, shape (n_runs,)
        1, 0, or NaN / -1 for an undecided run. Undecided runs keep their row and column but add
        no trial. Repeated cells (Monte Carlo) are summed.
    """
    pga_runs, ratio_runs = positive(pga, "pga"), positive(pgv_pga, "pgv_pga")
    outcome = outcomes(overturned)
    if not pga_runs.shape == ratio_runs.shape == outcome.shape or outcome.ndim != 1:
        raise InvalidInput(
            f"arrays of shapes {pga_runs.shape}, {ratio_runs.shape} and {outcome.shape}",
            "a fit takes three flat arrays of equal length",
            "ravel the grid first, or call fit_all",
        )
    decided = ~np.isnan(outcome)
    if not decided.any():
        raise InvalidInput(
            "no decided run", "a fit needs at least one outcome", "check the runs' outcome codes"
        )
    pga_values, column = np.unique(pga_runs, return_inverse=True)
    ratio_values, row = np.unique(ratio_runs, return_inverse=True)
    trials = np.zeros((ratio_values.size, pga_values.size))
    toppled = np.zeros_like(trials)
    np.add.at(trials, (row[decided], column[decided]), 1.0)
    np.add.at(toppled, (row[decided], column[decided]), outcome[decided])
    return Cells(np.log(pga_values), np.log(ratio_values), toppled, trials)
