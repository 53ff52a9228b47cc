"""Prior distributions of what is uncertain in a rock and its shaking."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, field_validator, model_validator

from pipeline.config.fragility_schema import Resolution
from pipeline.config.sections import Density, Lax, Outside, Refused, Section


class Spread(Section):
    """A normal distribution."""

    mean: float = Field(ge=-360, le=360, description="mean")
    sd: float = Field(ge=0, le=360, description="standard deviation")


Share = Annotated[float, Field(ge=0, le=1)]
Friction = Annotated[float, Field(ge=0, le=100)]
Blend = Annotated[float, Field(ge=-1, le=2)]


def _ascend(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise Refused("the lower end of a range comes first", "exchange them")
    return pair


Pair = AfterValidator(_ascend)

MOST_MEMBERS = 10_000

BRACKET = 0.01
"""Relative width to which a draw's first overturning is bracketed where none is asked for."""


class PriorsConfig(Section):
    """Prior distributions of rock and shaking; the defaults are those of a shake table."""

    azimuth: Spread = Field(
        Spread(mean=-7.5, sd=7.5),
        description="direction of the shaking from the scan's +x [degree]",
    )
    polarity_reversal_probability: float = Field(
        0.1, ge=0, le=1, description="probability that the motion has the opposite polarity [1]"
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
    replica_fraction: Annotated[tuple[Blend, Blend], Lax, Pair] = Field(
        (0.15, 0.85),
        description="range of the replica's fraction in the shape; 0 is the scan itself [1]",
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
    inset: Annotated[tuple[Share, Share], Lax, Pair] = Field(
        (0.0, 0.034),
        description="range of how far inside the hull of its scan the rock bears, relative to the "
        "height of its centre of mass [1]",
    )
    members: int = Field(20, ge=1, le=MOST_MEMBERS, description="number of draws in the ensemble")


class ScanErrorConfig(Section):
    """Error of the scan at the base of the rock."""

    error: float = Field(
        0.002, ge=0, le=1, description="standard deviation of the scan's error at the base [m]"
    )
    correlation_length: float = Field(
        0.1, gt=0, le=100, description="correlation length of the scan's error [m]"
    )
    replica: Outside | None = Field(
        None,
        description="second scan of the same form, in metres; draws interpolate the two, and "
        "error is not used; relative to the file that names it",
    )


Weight = Annotated[float, Field(ge=0, le=1e6)]


class SeatWeights(Section):
    """Relative weights of what may bear a rock that was scanned with its ground."""

    rim: Weight = Field(0.5, description="weight of points along the outline of the seam [1]")
    points: Weight = Field(
        0.3, description="weight of a few points of it: 3, 4, 5 and 6 share it alike [1]"
    )
    whole: Weight = Field(0.2, description="weight of all of the seam [1]")

    @model_validator(mode="after")
    def _bears(self) -> SeatWeights:
        if self.rim + self.points + self.whole <= 0.0:
            raise Refused("something bears the rock", "give one of the weights", "rim points whole")
        return self

    @property
    def shares(self) -> dict[str, float]:
        """Probability of each."""
        total = self.rim + self.points + self.whole
        return {name: weight / total for name, weight in self}


class UncertaintyConfig(PriorsConfig):
    """Prior distributions of a site's rock and shaking, and the number of draws."""

    azimuth: Spread = Field(
        Spread(mean=0.0, sd=5.0),
        description="direction of the shaking from that of each yaw [degree]",
    )
    polarity_reversal_probability: float = Field(
        0.0, ge=0, le=1, description="probability that the motion has the opposite polarity [1]"
    )
    friction: Annotated[tuple[Friction, Friction], Lax, Pair] = Field(
        (0.45, 0.75), description="range of the friction [1]"
    )
    restitution: Annotated[tuple[Share, Share], Lax, Pair] = Field(
        (0.0, 0.1), description="range of the restitution [1]"
    )
    amplitude: Spread = Field(
        Spread(mean=1.0, sd=0.05), description="factor on the acceleration, or gain [1]"
    )
    scan: ScanErrorConfig = Field(
        ScanErrorConfig(), description="error of the scan, which a box does not have"
    )
    seat: SeatWeights = Field(
        SeatWeights(), description="what bears the rock on a terrain, of which no scan has seen it"
    )
    centre_of_mass: float = Field(
        0.01, ge=0, le=1, description="error of the centre of mass along each axis [m]"
    )
    members: int = Field(
        32, ge=0, le=MOST_MEMBERS, description="number of draws in the ensemble; 0 for none"
    )

    resolution: Resolution = Field(
        "auto",
        description="relative width to which the first overturning of each draw is bracketed; auto "
        "for 0.01, or the numerical error of the draws and the spread of their islands together "
        "where that is larger [1]",
    )

    @field_validator("members")
    @classmethod
    def _differ(cls, members: int) -> int:
        if members == 1:
            raise Refused("an ensemble has no draws, or 2 or more", "give 0, or at least 2")
        return members

    @field_validator("amplitude")
    @classmethod
    def _stays_positive(cls, amplitude: Spread) -> Spread:
        if amplitude.mean <= 5.0 * amplitude.sd:
            rule = "the mean must exceed five standard deviations: no draw may reverse it"
            raise Refused(rule, "reduce sd, or set polarity_reversal_probability")
        return amplitude


class StepperConfig(Section):
    """A table whose motor steps are timed by software, which makes fast motions slower."""

    rate: float = Field(gt=0, le=1e5, description="velocity commands in a second [Hz]")
    step: float = Field(
        gt=0, le=1, description="travel that the program counts for a motor step [m]"
    )
    overhead: float = Field(
        ge=0, le=1, description="time by which each step takes longer than it was to [s]"
    )


class ShakeTableConfig(PriorsConfig):
    """Prior assumptions on a series of recorded tests, made before any outcome is known."""

    density: Density = Field(2700.0, description="density of the rock [kg m-3]")
    acceleration: str | None = Field(
        None, description="variable of records.nc that holds the table's acceleration"
    )
    stepper: StepperConfig | None = Field(
        None,
        description="how the table's motor makes a commanded pulse, where there is no record; "
        "without it the pulse is as commanded",
    )

    @property
    def engine(self) -> str:
        """Name of the physics engine in which the tests are simulated."""
        return "nonsmooth"
