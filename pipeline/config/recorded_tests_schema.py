"""What is assumed of a series of recorded shake-table tests."""

from __future__ import annotations

from pydantic import Field

from pipeline.config.sections import Section


class Spread(Section):
    """A normal distribution."""

    mean: float = Field(description="mean")
    sd: float = Field(ge=0, description="standard deviation")


Pair = tuple[float, float]


class ShakeTableConfig(Section):
    """What is assumed of a series of tests, before any outcome is looked at."""

    density: float = Field(2700.0, gt=0, le=30_000, description="density of the rock [kg m-3]")
    acceleration: str | None = Field(
        None, description="variable of records.nc that holds the table's acceleration"
    )
    azimuth: Spread = Field(
        Spread(mean=-7.5, sd=7.5),
        description="direction of the shaking from the scan's +x [degree]",
    )
    reversed_share: float = Field(
        0.5, ge=0, le=1, description="probability that the shaking points the other way [1]"
    )
    friction: Pair = Field((0.5, 0.9), description="range of the friction [1]")
    restitution: Pair = Field((0.0, 0.0), description="range of the restitution [1]")
    amplitude: Spread = Field(
        Spread(mean=1.0, sd=0.03), description="factor on the acceleration [1]"
    )
    mixing: Pair = Field(
        (0.15, 0.85), description="range of the blend from a scan to its replica's [1]"
    )
    base_error: float = Field(
        1.0,
        ge=0,
        le=10,
        description="error of the base, relative to that of a scan without replica [1]",
    )
    centre_of_mass: float = Field(
        0.004, ge=0, le=1, description="error of the centre of mass along each axis [m]"
    )
    members: int = Field(20, ge=1, le=10_000, description="number of draws in the ensemble")

    @property
    def engine(self) -> str:
        """Name of the physics engine in which the tests are simulated."""
        return "nonsmooth"
