"""What was observed of a rock in the field, beside the plain fact that it stands."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from pipeline.config.sections import (
    LARGEST_PGA,
    LARGEST_RATIO,
    LEAST_RATIO,
    SMALLEST_PGA,
    Lax,
    Outside,
    Refused,
    Section,
)
from vsr_core import GRAVITY

_Direction = Annotated[float, Field(ge=-360, le=360)]
_TOWARDS = "direction towards which the rock goes, counter-clockwise from the scan's +x [degree]"


class _Observation(Section):
    label: str = Field("", max_length=60, description="tells it from another one that is alike")

    @property
    def words(self) -> str:
        """What was observed, for pages and messages."""
        return f"{self.label}: {self.told}" if self.label else self.told

    @property
    def told(self) -> str:
        """The same without its label."""
        raise NotImplementedError


class TiltTest(_Observation):
    """The rock and its ground were slowly tilted, or the rock was levered up and let go."""

    kind: Literal["tilt"] = Field(description="kind of observation")
    direction: _Direction = Field(description=_TOWARDS)
    angle: float = Field(gt=0, lt=90, description="tilt at which it ended [degree]")
    outcome: Literal["tipped", "stood"] = Field(description="what the rock did")
    sd: float = Field(ge=0.01, le=45, description="standard deviation of the angle [degree]")

    @property
    def told(self) -> str:
        return f"tilted to {self.angle:g}° toward {self.direction:g}°, {self.outcome}"


class PushTest(_Observation):
    """The rock was pushed or pulled with a rope, horizontally and slowly."""

    kind: Literal["push"] = Field(description="kind of observation")
    direction: _Direction = Field(description=_TOWARDS)
    force: float = Field(gt=0, le=1e9, description="largest horizontal force [N]")
    height: float = Field(ge=0.001, le=100, description="height of the force above the seat [m]")
    outcome: Literal["lifted", "stood"] = Field(description="what the rock did")
    sd: float = Field(ge=0.01, le=1e9, description="standard deviation of the force [N]")

    @property
    def told(self) -> str:
        place = f"at {self.height:g} m toward {self.direction:g}°"
        return f"pushed with {self.force:g} N {place}, {self.outcome}"


class RockingTest(_Observation):
    """The rock rocked freely."""

    kind: Literal["rocking"] = Field(description="kind of observation")
    direction: _Direction = Field(description=_TOWARDS)
    frequency: float = Field(gt=0, le=1000, description="whole cycles in a second [Hz]")
    amplitude: float = Field(gt=0, lt=90, description="tilt to that side [degree]")
    sd: float = Field(ge=1e-4, le=1000, description="standard deviation of the frequency [Hz]")

    @property
    def told(self) -> str:
        return f"rocked at {self.frequency:g} Hz, {self.amplitude:g}° toward {self.direction:g}°"


class ShakeTest(_Observation):
    """The ground was shaken by a known motion."""

    kind: Literal["shake"] = Field(description="kind of observation")
    motion: Outside = Field(
        min_length=1,
        description="file of the ground's acceleration; relative to the file that names it",
    )
    component: str | None = Field(None, description="channel or column, where it has several")
    unit: str | None = Field(
        None, description="unit of the acceleration where the file states none, e.g. m/s2 or gal"
    )
    direction: _Direction = Field(
        description="direction of a positive acceleration of the ground, counter-clockwise from "
        "the scan's +x [degree]"
    )
    outcome: Literal["stood", "toppled"] = Field(description="what the rock did")

    @property
    def told(self) -> str:
        return f"shaken by {self.motion} along {self.direction:g}°, {self.outcome}"


_LogSd = Annotated[float, Field(gt=0, le=3)]


class Earthquake(_Observation):
    """An earthquake that the rock has survived."""

    kind: Literal["earthquake"] = Field(description="kind of observation")
    year: int = Field(ge=-100_000, le=2200, description="year of the earthquake [CE]")
    pga: float = Field(
        ge=SMALLEST_PGA, le=LARGEST_PGA, description="median peak ground acceleration [g]"
    )
    pga_log_sd: _LogSd = Field(description="standard deviation of its logarithm [1]")
    pgv: float = Field(ge=1e-4, le=1000, description="median peak ground velocity [cm/s]")
    pgv_log_sd: _LogSd = Field(description="standard deviation of its logarithm [1]")
    correlation: float = Field(
        0.73, gt=-1, lt=1, description="correlation of the two logarithms [1]"
    )
    outcome: Literal["stood"] = Field("stood", description="the rock stands today")

    @model_validator(mode="after")
    def _is_one_earthquake(self) -> Self:
        """Refuse PGV/PGA of which no shaking is."""
        ratio = 0.01 * self.pgv / (GRAVITY * self.pga)
        if not LEAST_RATIO <= ratio <= LARGEST_RATIO:
            rule = f"PGV/PGA is {LEAST_RATIO:g} to {LARGEST_RATIO:g} s; here it is {ratio:.2g} s"
            raise Refused(rule, "give PGA in g and PGV in cm/s", "pgv", f"{self.pgv:g}")
        return self

    @property
    def told(self) -> str:
        return f"stood in the earthquake of {self.year}, {self.pga:g} g and {self.pgv:g} cm/s"


Observation = Annotated[
    TiltTest | PushTest | RockingTest | ShakeTest | Earthquake, Field(discriminator="kind")
]


def _differ(given: tuple[Observation, ...]) -> tuple[Observation, ...]:
    for number, one in enumerate(given):
        if one in given[:number]:
            first = given.index(one) + 1
            rule = f"observation {number + 1} is observation {first} word for word"
            raise Refused(rule, "leave it out, or give each its label", given=one.words)
    return given


Observations = Annotated[
    tuple[Observation, ...], Lax, Field(max_length=50), AfterValidator(_differ)
]
