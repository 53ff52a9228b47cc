"""Shake tables of hardware: their limits from `configs/tables`."""

from __future__ import annotations

import math

from pydantic import Field

from pipeline.config import in_si
from pipeline.config.bounds import SMALLEST_PGA, Mass, Rate, Travel
from pipeline.config.layers import TABLES, load_file
from pipeline.config.sections import Section
from vsr_core.table.capacity import Table


class TableConfig(Section):
    """What a table can do; null is a limit that is not stated, and so is not checked."""

    acceleration: float | None = Field(
        ge=SMALLEST_PGA, le=1000, description="largest acceleration [g]"
    )
    velocity: Travel | None = Field(description="largest velocity [m/s]")
    stroke: Travel | None = Field(description="stroke from end to end [m]")
    payload: Mass | None = Field(description="largest mass of the rock [kg]")
    pulley_diameter: Travel = Field(description="diameter on which the belt runs [m]")
    steps_per_turn: float | None = Field(
        ge=1,
        le=1e9,
        description="motor steps in a turn, microsteps counted; null exports no motor steps [1]",
    )
    command_rate: Rate = Field(le=10_000, description="rate of velocity commands [Hz]")

    def table(self) -> Table:
        """The table in the terms of the physics, null as no limit."""
        return Table(
            acceleration=in_si.acceleration(_limit(self.acceleration)),
            velocity=_limit(self.velocity),
            stroke=_limit(self.stroke),
            payload=_limit(self.payload),
            command_rate=self.command_rate,
            pulley=self.pulley_diameter,
            steps_per_turn=self.steps_per_turn,
        )

    @property
    def unstated(self) -> tuple[str, ...]:
        """Keys that are null."""
        return tuple(name for name, value in self if value is None)


def load(name: str) -> tuple[TableConfig, str]:
    """A table by its name in `configs/tables` or by the path of its YAML; and that file.

    Returns
    -------
    (TableConfig, str), the limits, and the file as a reader would write it
    """
    return load_file(name, TABLES, "table", TableConfig)


def _limit(value: float | None) -> float:
    return math.inf if value is None else value
