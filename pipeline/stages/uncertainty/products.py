"""The ensemble as a product, for who reads it without drawing."""

from __future__ import annotations

from pipeline.workflow.datasets import Stored


class EnsembleData(Stored):
    """Outcomes of every draw, and what is told of them."""

    FILE = "uncertainty.nc"
