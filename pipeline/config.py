"""The typed configuration: every key, its unit and its range. Degrees, g and s live here only."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    field_serializer,
    field_validator,
    model_validator,
)

if TYPE_CHECKING:
    from vsr_core.records.processing import Processing
    from vsr_core.servo import Servo

_DIGITS = 12


class Section(BaseModel):
    """A part of the configuration: unknown keys are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Range(Section):
    """Evenly spaced values, both ends included."""

    start: float
    stop: float
    num: int = Field(ge=1, le=100_000, description="number of values")

    def values(self) -> tuple[float, ...]:
        """The values, rounded so that overlapping ranges share them exactly."""
        if self.num == 1:
            return (round(self.start, _DIGITS),)
        step = (self.stop - self.start) / (self.num - 1)
        return tuple(round(self.start + step * i, _DIGITS) for i in range(self.num))


def _as_values(given: Any) -> Any:
    if isinstance(given, dict):
        return Range(**given).values()
    if isinstance(given, (int, float, str)):
        return (given,)
    return given


def _distinct(values: tuple[float, ...]) -> tuple[float, ...]:
    if not values:
        raise ValueError("an empty grid has no runs; give at least one value")
    if len(set(values)) != len(values):
        raise ValueError("values repeat; give each once")
    return values


def _ascending(values: tuple[float, ...]) -> tuple[float, ...]:
    if list(values) != sorted(values):
        raise ValueError("values must ascend; sort them")
    return values


Values = Annotated[tuple[float, ...], AfterValidator(_distinct)]
"""A number, a list or {start, stop, num}; becomes a dimension of the dataset."""

Grid = Annotated[Values, AfterValidator(_ascending)]


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

    _values = field_validator("friction", mode="before")(_as_values)

    @field_validator("friction")
    @classmethod
    def _not_negative(cls, friction: tuple[float, ...]) -> tuple[float, ...]:
        if min(friction) < 0.0:
            raise ValueError("friction cannot be negative; dry rock on rock is about 0.6")
        if max(friction) > 100.0:
            raise ValueError("friction above 100 is no Coulomb coefficient; use 10 for no sliding")
        return friction


def _in_g(pga: tuple[float, ...]) -> tuple[float, ...]:
    if pga[0] <= 0.0:
        raise ValueError("a PGA is positive; start above 0 g")
    if pga[-1] > 10.0:
        raise ValueError(
            "PGA is in g and at most 10; g? write 0.3 for 30 percent of g, or 1 for 9.81 m/s2"
        )
    return pga


Peaks = Annotated[Grid, BeforeValidator(_as_values), AfterValidator(_in_g)]
"""Peak ground accelerations [g]."""


class PulseConfig(Section):
    """The grid of cosine pulses."""

    kind: Literal["cosine_pulse"] = "cosine_pulse"
    pga: Peaks = Field(description="peak ground acceleration [g]")
    pgv_pga: Grid = Field(description="ratio of peak velocity to peak acceleration [s]")

    _values = field_validator("pgv_pga", mode="before")(_as_values)

    @field_validator("pgv_pga")
    @classmethod
    def _in_seconds(cls, pgv_pga: tuple[float, ...]) -> tuple[float, ...]:
        if pgv_pga[0] <= 0.0:
            raise ValueError("PGV/PGA is positive; start above 0 s")
        if pgv_pga[-1] > 10.0:
            raise ValueError("PGV/PGA is in seconds and at most 10; s? write 0.3 for 300 ms")
        return pgv_pga


Corner = Annotated[float, Field(gt=0, le=1000)]


class ProcessingConfig(Section):
    """What is done to each record; no filter is there unless it is asked for."""

    order: Literal["paper", "standard", "none"] = Field(
        description="order: paper (filters), standard (line, filters, baseline) or none"
    )
    highpass: Corner | None = Field(description="corner [Hz] of the high-pass, or null")
    lowpass: Corner | None = Field(description="corner [Hz] of the low-pass, or null")
    poles: int = Field(4, ge=1, le=10, description="poles of each filter in one pass")
    resample: Corner | None = Field(None, le=100_000, description="new rate [1/s], band-limited")

    @model_validator(mode="after")
    def _corners_make_sense(self) -> ProcessingConfig:
        if self.order == "none" and (self.highpass is not None or self.lowpass is not None):
            raise ValueError("order none has no corners; set both to null, or order to paper")
        if (self.highpass or 0.0) >= (self.lowpass or math.inf):
            raise ValueError("the high-pass lies below the low-pass; exchange the corners")
        return self

    def how(self) -> Processing:
        """The same in the terms of the physics."""
        from vsr_core.records.processing import Processing

        return Processing(self.order, self.highpass, self.lowpass, self.poles, self.resample)


class ResponseConfig(Section):
    """Removal of an instrument's response."""

    file: str = Field(description="StationXML of the instruments; relative to this file")
    corners: tuple[float, float, float, float] = Field(
        description="f1 < f2 < f3 < f4 [Hz] of the taper of the spectrum"
    )

    @field_validator("corners")
    @classmethod
    def _ascend(cls, corners: tuple[float, ...]) -> tuple[float, ...]:
        if corners[0] < 0.0 or list(corners) != sorted(set(corners)):
            raise ValueError("corners ascend from 0 Hz or more; sort them")
        return corners


class RecordConfig(Section):
    """Recorded motions, each scaled to every PGA."""

    kind: Literal["record"] = "record"
    files: Annotated[tuple[str, ...], BeforeValidator(_as_values), Field(min_length=1)] = Field(
        description="recorded motions or folders of them; relative to this file"
    )
    component: str | None = Field(None, description="channel or column, where a file has several")
    unit: str | None = Field(None, description="unit of the files that state none, e.g. m/s2, gal")
    response: ResponseConfig | None = None
    processing: ProcessingConfig
    pga: Peaks = Field(description="peak ground acceleration after processing [g]")


class TableMotionConfig(Section):
    """Motions of a table in up to six axes, each scaled to every PGA."""

    kind: Literal["table"] = "table"
    files: Annotated[tuple[str, ...], BeforeValidator(_as_values), Field(min_length=1)] = Field(
        description="CSV or NetCDF files of time and axes; relative to this file"
    )
    pga: Peaks = Field(description="peak acceleration, tilt of gravity included [g]")


MotionConfig = Annotated[
    PulseConfig | RecordConfig | TableMotionConfig, Field(discriminator="kind")
]
"""The ground motions of a study; a kind is a class here and a function in `pipeline.shaking`."""


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
        from vsr_core.servo import Servo

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

    _values = field_validator("yaw", mode="before")(_as_values)

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
        from vsr_core.servo import check

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
