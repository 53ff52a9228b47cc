"""How runs are computed, and what is asked of their errors."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.sections import SHORTEST_STEP, Lax, Section
from vsr_core.outcome import AT_REST, QUANTITIES

Quantity = Literal["boundary", "peak_tilt", "final_tilt", "slip", "end_position", "trajectory"]


class SimulationConfig(Section):
    """How runs are computed."""

    engine: Literal["auto", "nonsmooth", "bullet", "mujoco"] = Field(
        "auto", description="physics engine; auto for the cheapest that can represent the scene"
    )
    time_step: Literal["auto"] | Annotated[float, Field(ge=SHORTEST_STEP, le=0.02)] = Field(
        "auto", description="time step; auto for the coarsest within the tolerance [s]"
    )
    tolerance: float = Field(
        0.01,
        ge=0.0005,
        le=0.1,
        description="largest relative error of what accurate names, for auto [1]",
    )
    accurate: Annotated[tuple[Quantity, ...], Lax] = Field(
        ("boundary",),
        description="what the tolerance holds for: boundary, and also peak_tilt, final_tilt, slip "
        "(runs whose rock stays upright are then followed to rest), end_position, trajectory",
    )
    reduce: Annotated[bool, Lax] = Field(
        True, description="leave out of a run what cannot change its outcome"
    )
    keep: Literal["all", "boundary"] = Field(
        "all",
        description="what is kept of the runs of a grid: each; or outcomes as their changes along "
        "PGA, and all else of a sample: for grids of many millions",
    )

    @property
    def measured(self) -> tuple[str, ...]:
        """Quantities besides the boundary whose errors are measured."""
        return tuple(name for name in QUANTITIES if name in self.accurate)

    @property
    def whole(self) -> bool:
        """Whether runs whose rock stays upright are followed to rest."""
        return any(name in self.accurate for name in AT_REST)
