"""The typed configuration: every key, its unit and its range. Degrees, g and s live here only."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    field_serializer,
    field_validator,
    model_validator,
)

from pipeline.config.motion_schema import MotionConfig, TableMotionConfig
from pipeline.config.sections import Section, Values, as_values
from vsr_core.table.servo import Servo, check

Vector = tuple[float, float, float]


class RockConfig(Section):
    """What stands on the pedestal."""

    shape: Literal["box", "mesh"]
    size: tuple[float, float, float] | None = Field(
        None, description="x, y, z of a box at yaw 0 [m]"
    )
    mesh: str | None = Field(
        None, description="scan of the rock, z up; .ply .stl .obj .dae .glb; relative to this file"
    )
    fallback: str | None = Field(
        None, description="generator in vsr_core.surrogates used where the scan is absent"
    )
    scale: float = Field(1.0, gt=0, description="metres per unit of the mesh file")
    closing: Literal["caps", "hull", "poisson"] = Field(
        "caps", description="how the open underside of a rock in a terrain scan is closed"
    )
    density: float = Field(gt=0, le=30_000, description="density [kg m-3]")

    @field_validator("size")
    @classmethod
    def _positive(cls, size: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if size is not None and min(size) <= 0.0:
            raise ValueError("a box has three positive lengths in metres; correct the size")
        return size

    @model_validator(mode="after")
    def _shape_is_given(self) -> RockConfig:
        if self.shape == "box" and self.size is None:
            raise ValueError("a box needs `size`; give [x, y, z] in metres")
        if self.shape == "mesh" and self.mesh is None:
            raise ValueError("a mesh needs `mesh`; give the path of the scan")
        return self


class PlaneCut(Section):
    """The rock is what lies on one side of a plane, in the scan's coordinates."""

    kind: Literal["plane"]
    point: Vector = Field(description="a point of the plane [m]")
    normal: Vector = Field(description="its normal, toward the rock")


class BoxCut(Section):
    """The rock is what lies in a box, in the scan's coordinates."""

    kind: Literal["box"]
    low: Vector = Field(description="its lowest corner [m]")
    high: Vector = Field(description="its highest corner [m]")


class PolygonCut(Section):
    """The rock is what lies in a polygon seen from above, in the scan's coordinates."""

    kind: Literal["polygon"]
    corners: tuple[tuple[float, float], ...] = Field(min_length=3, description="x, y [m]")


class ColourCut(Section):
    """The rock is what the scan's vertices colour so."""

    kind: Literal["colour"]
    rgb: tuple[int, int, int] = Field(description="red, green, blue, 0 to 255")
    tolerance: float = Field(40.0, gt=0, le=442, description="distance in that space")


Cut = Annotated[PlaneCut | BoxCut | PolygonCut | ColourCut, Field(discriminator="kind")]


class PedestalConfig(Section):
    """What the rock stands on: level ground, or the terrain in its scan."""

    shape: Literal["flat", "mesh"] = "flat"
    cut: Literal["proposal"] | Cut | None = Field(
        None, description="what of the scan is the rock; proposal accepts what `vsr prep` shows"
    )
    near: Vector | None = Field(
        None, description="a point on the rock, where the scan shows several [m]"
    )
    clearance: float = Field(
        0.001, gt=0, le=0.05, description="gap between the rock and its seat before it settles [m]"
    )


class ContactConfig(Section):
    """Effective coefficients of the pair rock-pedestal."""

    friction: Values = Field(description="Coulomb friction of the pair [1]")
    restitution: float = Field(0.0, ge=0, le=1, description="normal restitution of the pair [1]")
    rolling_friction: float = Field(0.0, ge=0, description="rolling friction, a length [m]")

    _values = field_validator("friction", mode="before")(as_values)

    @field_validator("friction")
    @classmethod
    def _not_negative(cls, friction: tuple[float, ...]) -> tuple[float, ...]:
        if min(friction) < 0.0:
            raise ValueError("friction cannot be negative; dry rock on rock is about 0.6")
        if max(friction) > 100.0:
            raise ValueError("friction above 100 is no Coulomb coefficient; use 10 for no sliding")
        return friction


class ServoConfig(Section):
    """The servo of a driven table: PID of the pedestal's velocity."""

    mass: float = Field(gt=0, description="mass of the pedestal [kg]")
    kp: float = Field(gt=0, description="proportional gain [N s/m]")
    ki: float = Field(ge=0, description="integral gain [N/m]")
    kd: float = Field(ge=0, description="derivative gain [N s^2/m]")
    period: float = Field(gt=0, le=0.1, description="time for which a force is held [s]")
    force_limit: float | None = Field(
        None, gt=0, description="largest force [N], or null where there is no limit"
    )
    command_rate: float | None = Field(
        None, gt=0, description="velocity commands in a second [Hz], null for one each period"
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

    def _hold(self) -> int:
        """Control periods for which a command is held."""
        return 1 if self.command_rate is None else round(1.0 / (self.command_rate * self.period))

    def servo(self) -> Servo:
        """The servo in the terms of the physics."""
        limit = math.inf if self.force_limit is None else self.force_limit
        return Servo(self.mass, self.kp, self.ki, self.kd, self.period, limit, self._hold())


class SimulationConfig(Section):
    """How runs are computed."""

    engine: Literal["bullet", "mujoco"] = Field(
        "bullet", description="physics engine; mujoco is an extra"
    )
    time_step: Literal["auto"] | Annotated[float, Field(gt=0, le=0.02)] = Field(
        "auto", description="step [s], or auto: chosen for `tolerance`"
    )
    tolerance: float = Field(
        0.01, ge=0.0005, le=0.1, description="relative error of the overturning boundary [1]"
    )
    reduce: bool = Field(True, description="leave out what cannot change an outcome")


class FoundConfig(Section):
    """A rock that lies on the terrain, to ask where it came from and how strong the shaking was."""

    place: tuple[float, float] = Field(
        description="x, y of its middle, in the scan's coordinates [m]"
    )
    sigma: float = Field(gt=0, description="standard deviation of that place [m]")
    identity: float = Field(1.0, gt=0, le=1, description="probability that it is this rock [1]")
    area: float | None = Field(
        None, gt=0, description="ground on which it could lie had it come from elsewhere [m2]"
    )

    @model_validator(mode="after")
    def _elsewhere_is_known(self) -> FoundConfig:
        if self.identity < 1.0 and self.area is None:
            raise ValueError("with an identity below 1 another rock lies anywhere; give its `area`")
        return self


class Config(Section):
    """Everything that determines the products of a site."""

    rock: RockConfig
    pedestal: PedestalConfig = PedestalConfig()
    contact: ContactConfig
    motion: MotionConfig
    yaw: Values = Field(description="turn of the rock about z before the shaking along +x [degree]")
    drive: Literal["table_frame", "servo"] = Field(
        "table_frame", description="motion as prescribed, or as a servo brings it about"
    )
    servo: ServoConfig
    simulation: SimulationConfig = SimulationConfig()
    found: FoundConfig | None = None

    _values = field_validator("yaw", mode="before")(as_values)

    @property
    def on_terrain(self) -> bool:
        """Whether the rock stands on a terrain."""
        return self.pedestal.shape == "mesh"

    @field_validator("pedestal")
    @classmethod
    def _is_in_a_scan(cls, pedestal: PedestalConfig, info: ValidationInfo) -> PedestalConfig:
        rock = info.data.get("rock")
        if pedestal.shape == "mesh" and rock is not None and rock.shape != "mesh":
            raise ValueError("terrain comes with the rock in one scan; set rock.shape: mesh")
        return pedestal

    @field_validator("motion")
    @classmethod
    def _has_a_way(cls, motion: MotionConfig, info: ValidationInfo) -> MotionConfig:
        pedestal = info.data.get("pedestal")
        if isinstance(motion, TableMotionConfig) and pedestal and pedestal.shape == "mesh":
            raise ValueError(
                "a table in several axes carries a flat pedestal; set pedestal.shape: flat, or "
                "motion.kind: record"
            )
        return motion

    @field_validator("drive")
    @classmethod
    def _can_carry(cls, drive: str, info: ValidationInfo) -> str:
        pedestal = info.data.get("pedestal")
        if drive == "servo" and pedestal is not None and pedestal.shape == "mesh":
            raise ValueError("a servo drives a flat pedestal; set drive: table_frame")
        if drive == "servo" and isinstance(info.data.get("motion"), TableMotionConfig):
            raise ValueError("a servo's table slides along x; set drive: table_frame")
        return drive

    @field_validator("servo")
    @classmethod
    def _stable(cls, servo: ServoConfig, info: ValidationInfo) -> ServoConfig:
        if info.data.get("drive") == "servo":
            check(servo.servo())
        return servo

    @field_validator("simulation")
    @classmethod
    def _can_drive(cls, simulation: SimulationConfig, info: ValidationInfo) -> SimulationConfig:
        if info.data.get("drive") == "servo" and simulation.engine != "bullet":
            raise ValueError("a servo needs Bullet; set engine: bullet, or drive: table_frame")
        pedestal = info.data.get("pedestal")
        if simulation.engine != "bullet" and pedestal is not None and pedestal.shape == "mesh":
            raise ValueError("MuJoCo takes the convex hull of any terrain; set engine: bullet")
        return simulation

    @field_serializer("servo", mode="wrap")
    def _empty_if_idle(
        self, servo: ServoConfig, dump: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        """A servo that drives nothing is no part of what determines a product."""
        return dict(dump(servo)) if self.drive == "servo" else {}

    @field_validator("yaw")
    @classmethod
    def _in_a_circle(cls, yaw: tuple[float, ...]) -> tuple[float, ...]:
        if min(yaw) < -360.0 or max(yaw) > 360.0:
            raise ValueError("yaw is in degrees from -360 to 360; bring it into the circle")
        return yaw
