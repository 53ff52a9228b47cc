"""The fits as a product, for who reads them without fitting."""

from __future__ import annotations

from pipeline.workflow.datasets import Stored

TABLE = "fragility.csv"


class Fits(Stored):
    """Fitted models, and the boundary, of each direction and friction."""

    FILE = "fragility.nc"
