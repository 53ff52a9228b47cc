"""The outcomes of one grid as a table of counts, the form in which every model is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput


@dataclass(frozen=True)
class Cells:
    """Counts of runs on the product of PGV/PGA and PGA values.

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


def outcomes(overturned: npt.ArrayLike) -> Array:
    """Outcomes as 1.0, 0.0 and NaN.

    Raises
    ------
    InvalidInput
        For any other value.

    Examples
    --------
    >>> outcomes([1, 0, -1])
    array([ 1.,  0., nan])
    """
    array = np.array(overturned, dtype=np.float64)
    array[array == -1] = np.nan
    if not np.isin(array[~np.isnan(array)], (0.0, 1.0)).all():
        raise InvalidInput(
            "overturned holds values other than 0, 1, -1 and NaN",
            "a run overturned (1), did not (0) or is undecided (-1 or NaN)",
            "pass the variable `overturned` of the responses",
        )
    return array


def counted(pga: npt.ArrayLike, pgv_pga: npt.ArrayLike, overturned: npt.ArrayLike) -> Cells:
    """Count the runs of a grid with one run in each cell.

    Parameters
    ----------
    pga : array_like, shape (n_pga,) [g]
        Positive, strictly increasing.
    pgv_pga : array_like, shape (n_ratio,) [s]
        Positive, strictly increasing.
    overturned : array_like, shape (n_ratio, n_pga)
        1, 0, or NaN / -1 for an undecided run, which adds no trial.

    Raises
    ------
    InvalidInput
        If an axis or the shape does not fit, or no run is decided.
    """
    columns, rows = _axis(pga, "pga"), _axis(pgv_pga, "pgv_pga")
    grid = outcomes(overturned)
    if grid.shape != (rows.size, columns.size):
        raise InvalidInput(
            f"overturned of shape {grid.shape} for {rows.size} PGV/PGA and {columns.size} PGA",
            "its shape is (n_ratio, n_pga)",
            "transpose or reshape it",
        )
    decided = ~np.isnan(grid)
    if not decided.any():
        raise InvalidInput(
            "no decided run", "a fit needs at least one outcome", "check the runs' outcome codes"
        )
    toppled = np.where(decided, grid, 0.0)
    return Cells(np.log(columns), np.log(rows), toppled, decided.astype(np.float64))


def _axis(values: npt.ArrayLike, name: str) -> Array:
    axis = np.asarray(values, dtype=np.float64)
    if not (np.isfinite(axis) & (axis > 0)).all():
        raise InvalidInput(
            f"{name} holds values that are not finite and above 0",
            "fragility is fitted in ln PGA and ln PGV/PGA",
            f"leave such runs out or correct {name}",
        )
    if axis.ndim != 1 or axis.size == 0 or (np.diff(axis) <= 0).any():
        raise InvalidInput(
            f"{name} of shape {axis.shape} that is not one strictly increasing axis",
            "the grid's axes increase",
            f"sort the grid along {name} and merge repeated values",
        )
    return axis
