"""What is not known of a rock and its shaking, as ranges and normal distributions."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, field_validator

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

MOST_MEMBERS = 10_000


class PriorsConfig(Section):
    """What is not known of a rock on a shaken ground; the defaults are those of a shake table."""

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
    members: int = Field(20, ge=1, le=MOST_MEMBERS, description="number of draws in the ensemble")


class ScanErrorConfig(Section):
    """How well the scan of a rock gives the base that it stands on."""

    error: float = Field(
        0.002, ge=0, le=1, description="standard deviation of the scan's error at the base [m]"
    )
    length: float = Field(
        0.1, gt=0, le=100, description="length over which errors of the scan are alike [m]"
    )
    replica: str | None = Field(
        None,
        description="second scan of the same form, in metres; draws then lie between the two, and "
        "error is not used; relative to the file that names it",
    )


class UncertaintyConfig(PriorsConfig):
    """What is not known of the rock of a site and of its shaking, and how often it is drawn."""

    azimuth: Spread = Field(
        Spread(mean=0.0, sd=5.0),
        description="direction of the shaking from that of each yaw [degree]",
    )
    reversed_share: float = Field(
        0.0, ge=0, le=1, description="probability that the shaking points the other way [1]"
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
    centre_of_mass: float = Field(
        0.01, ge=0, le=1, description="error of the centre of mass along each axis [m]"
    )
    members: int = Field(
        32, ge=0, le=MOST_MEMBERS, description="number of draws in the ensemble; 0 for none"
    )

    @field_validator("members")
    @classmethod
    def _differ(cls, members: int) -> int:
        if members == 1:
            raise ValueError("an ensemble has 2 draws or more, or none; give 0 or 2 and more")
        return members

    @field_validator("amplitude")
    @classmethod
    def _stays_positive(cls, amplitude: Spread) -> Spread:
        if amplitude.mean <= 5.0 * amplitude.sd:
            raise ValueError(
                "the mean gain is above five standard deviations, so that no draw turns the "
                "motion round; narrow it, or give reversed_share"
            )
        return amplitude
