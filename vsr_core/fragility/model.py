"""What every fragility model offers, so that all are scored and resampled alike."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from vsr_core.arrays import Array
from vsr_core.fragility.cells import Cells


class FragilityModel(ABC):
    """A model fitted to the cells of one grid; many fits are one batch, the leading axis.

    Attributes
    ----------
    coefs : ndarray, shape (1, ...)
        Coefficients of the fit, as a batch of one.
    method : str
        How the model was estimated, in words.
    """

    name: ClassVar[str]
    cells: Cells
    coefs: Array
    separated: bool
    method: str

    @abstractmethod
    def refit(self, row_weights: Array) -> Array:
        """Fit again with PGV/PGA row r counted `row_weights[:, r]` times.

        Parameters
        ----------
        row_weights : ndarray, shape (batch, n_ratio)

        Returns
        -------
        ndarray, shape (batch, ...)
        """

    def resample(self, row_weights: Array, rng: np.random.Generator) -> Array:
        """Bootstrap replicates; shapes as of `refit`, which they are if nothing else is random."""
        return self.refit(row_weights)

    def named(self, coefs: Array) -> dict[str, Array]:
        """Parameters of a batch by name, each of shape (batch,) or (batch, n_ratio).

        None where coefficients mean nothing one by one.
        """
        return {}

    @abstractmethod
    def grid_probability(self, coefs: Array) -> Array:
        """P(overturned) at the grid cells, shape (batch, n_ratio, n_pga)."""

    @abstractmethod
    def grid_contour(self, coefs: Array, probability: float) -> Array:
        """Smallest PGA [g] with a probability at the grid's rows, shape (batch, n_ratio)."""
