"""How finely the overturning boundary is told, and how far it is looked for."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.config.sections import LARGEST_PGA, SMALLEST_PGA, Refused, Section

FINE = 0.005
"""Relative width to which a boundary is resolved where none is asked for."""

Resolution = Literal["auto"] | Annotated[float, Field(ge=1e-4, le=0.2)]

_Peak = Annotated[float, Field(ge=SMALLEST_PGA, le=LARGEST_PGA)]


class FragilityConfig(Section):
    """The overturning boundary beside the grid."""

    resolution: Resolution = Field(
        "auto",
        description="relative width to which the overturning boundary is resolved; auto for 0.005, "
        "or what outcomes agree to at the time step, where that is larger [1]",
    )
    lowest: _Peak = Field(
        0.001, description="PGA down to which a boundary below the grid is looked for [g]"
    )
    highest: _Peak = Field(
        4.0, description="PGA up to which a boundary above the grid is looked for [g]"
    )

    @model_validator(mode="after")
    def _in_order(self) -> FragilityConfig:
        if self.lowest >= self.highest:
            raise Refused("lowest must be below highest", "exchange them")
        return self
