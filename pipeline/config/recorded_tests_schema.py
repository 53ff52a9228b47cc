"""What is assumed of a series of recorded shake-table tests."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from pipeline.config.bounds import Density
from pipeline.config.sections import Lax, Section


class Spread(Section):
    """A normal distribution."""

    mean: float = Field(ge=-360, le=360, description="mean")
    sd: float = Field(ge=0, le=360, description="standard deviation")


Share = Annotated[float, Field(ge=0, le=1)]
Friction = Annotated[float, Field(ge=0, le=100)]
Blend = Annotated[float, Field(ge=-1, le=2)]


def _ascend(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError("a range begins with its lower end; exchange them")
    return pair


Pair = AfterValidator(_ascend)


class ShakeTableConfig(Section):
    """What is assumed of a series of tests, before any outcome is looked at."""

    density: Density = Field(2700.0, description="density of the rock [kg m-3]")
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
    friction: Annotated[tuple[Friction, Friction], Lax, Pair] = Field(
        (0.5, 0.9), description="range of the friction [1]"
    )
    restitution: Annotated[tuple[Share, Share], Lax, Pair] = Field(
        (0.0, 0.0), description="range of the restitution [1]"
    )
    amplitude: Spread = Field(
        Spread(mean=1.0, sd=0.03), description="factor on the acceleration [1]"
    )
    mixing: Annotated[tuple[Blend, Blend], Lax, Pair] = Field(
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
