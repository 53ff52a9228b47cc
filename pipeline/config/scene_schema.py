"""The contact of the pair and the servo of a table, as a configuration states them."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, field_validator, model_validator

from pipeline.config.bounds import LARGEST_GAIN, SHORTEST_STEP, Force, Gain, Length, Mass, Rate
from pipeline.config.sections import Range, Section, Values, as_values

# What the schema says of each value; the validator below says it in the field's words.
_Friction = Annotated[float, Field(ge=0, le=100)]


class ContactConfig(Section):
    """Effective coefficients of the pair of rock and pedestal."""

    friction: Annotated[
        Values,
        BeforeValidator(as_values, json_schema_input_type=_Friction | list[_Friction] | Range),
    ] = Field(description="coefficient of Coulomb friction of the pair [1]")
    restitution: float = Field(
        0.0, ge=0, le=1, description="coefficient of normal restitution of the pair [1]"
    )
    restitution_law: Literal["newton", "energetic"] = Field(
        "newton",
        description="what the restitution is a ratio of: speeds normal to the ground, or, squared, "
        "energies given back and taken; no impact gains energy with either",
    )
    rolling_friction: Length = Field(0.0, description="rolling friction, a length [m]")

    @field_validator("friction")
    @classmethod
    def _not_negative(cls, friction: tuple[float, ...]) -> tuple[float, ...]:
        if min(friction) < 0.0:
            raise ValueError("friction cannot be negative; dry rock on rock is about 0.6")
        if max(friction) > 100.0:
            raise ValueError("friction above 100 is no Coulomb coefficient; use 10 for no sliding")
        return friction


class ServoConfig(Section):
    """The servo of a driven table: a PID controller of the pedestal's velocity."""

    mass: Mass = Field(description="mass of the pedestal [kg]")
    kp: float = Field(gt=0, le=LARGEST_GAIN, description="proportional gain [N s/m]")
    ki: Gain = Field(description="integral gain [N/m]")
    kd: Gain = Field(description="derivative gain [N s2/m]")
    period: float = Field(
        ge=SHORTEST_STEP, le=0.1, description="control period, for which a force is held [s]"
    )
    force_limit: Force | None = Field(
        None, description="largest force of the servo; null for no limit [N]"
    )
    command_rate: Rate | None = Field(
        None, description="rate of velocity commands; null for one each period [Hz]"
    )

    @model_validator(mode="after")
    def _holds_commands(self) -> ServoConfig:
        if self.command_rate is None:
            return self
        periods = 1.0 / (self.command_rate * self.period)
        if round(periods) < 1 or not math.isclose(periods, round(periods), rel_tol=1e-6):
            raise ValueError(
                "a command lasts a whole number of control periods; "
                f"with periods of {self.period:g} s set command_rate to {1.0 / self.period:.6g} Hz "
                "over a whole number"
            )
        return self
