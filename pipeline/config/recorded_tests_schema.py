"""What is assumed of a series of recorded shake-table tests."""

from __future__ import annotations

from pydantic import Field

from pipeline.config.bounds import Density
from pipeline.config.priors_schema import PriorsConfig


class ShakeTableConfig(PriorsConfig):
    """What is assumed of a series of tests, before any outcome is looked at."""

    density: Density = Field(2700.0, description="density of the rock [kg m-3]")
    acceleration: str | None = Field(
        None, description="variable of records.nc that holds the table's acceleration"
    )

    @property
    def engine(self) -> str:
        """Name of the physics engine in which the tests are simulated."""
        return "nonsmooth"
