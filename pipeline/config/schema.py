"""The typed configuration: every key, its unit and its range. Degrees, g and s live here only."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    field_serializer,
    field_validator,
    model_validator,
)

from pipeline.config import in_si
from pipeline.config.bounds import MOST_SCENES, SHORTEST_STEP, Coordinate, Density
from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.motion_schema import MotionConfig, RecordConfig, TableMotionConfig
from pipeline.config.priors_schema import UncertaintyConfig
from pipeline.config.scene_schema import ContactConfig, ServoConfig
from pipeline.config.sections import Lax, Range, Section, Values, as_values
from vsr_core.rock.body import THINNEST, check_size
from vsr_core.table.servo import check

Vector = Annotated[tuple[Coordinate, Coordinate, Coordinate], Lax]
Place = Annotated[tuple[Coordinate, Coordinate], Lax]
Channel = Annotated[int, Field(ge=0, le=255)]

COMPILED = "nonsmooth"
"""The engine that ``auto`` takes where it can hold the scene."""

# What the schema says of each value; the validators below say it in the field's words.
_Angle = Annotated[float, Field(ge=-360, le=360)]


class RockConfig(Section):
    """What stands on the pedestal."""

    shape: Literal["box", "mesh"] = Field(description="shape of the rock: a box, or a scanned mesh")
    size: Annotated[tuple[float, float, float], Lax] | None = Field(
        None, description="lengths of a box along x, y, z at yaw 0 [m]"
    )
    mesh: str | None = Field(
        None,
        description="scan of the rock, z up, or a folder with one: .ply, .stl, .obj, .dae or .glb; "
        "relative to the file that names it",
    )
    fallback: str | None = Field(
        None,
        description="surrogate, listed in vsr_core.surrogates, that is used where there is no scan",
    )
    scale: float = Field(1.0, ge=1e-6, le=1e6, description="length of the mesh file's unit [m]")
    closing: Literal["caps", "hull", "poisson"] = Field(
        "caps", description="how the underside of a rock is closed, where no scan saw it"
    )
    density: Density = Field(description="density of the rock [kg m-3]")

    @field_validator("size")
    @classmethod
    def _positive(cls, size: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if size is None:
            return size
        if min(size) <= 0.0:
            raise ValueError("a box has three positive lengths in metres; correct the size")
        check_size(max(size))
        if min(size) < THINNEST * max(size):
            raise ValueError(
                f"a block is at least {THINNEST:g} as thick as it is long; correct the size"
            )
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

    kind: Literal["plane"] = Field(description="kind of cut")
    point: Vector = Field(description="a point of the plane [m]")
    normal: Vector = Field(description="normal of the plane, toward the rock [1]")


class BoxCut(Section):
    """The rock is what lies in a box, in the scan's coordinates."""

    kind: Literal["box"] = Field(description="kind of cut")
    low: Vector = Field(description="lowest corner of the box [m]")
    high: Vector = Field(description="highest corner of the box [m]")


class PolygonCut(Section):
    """The rock is what lies in a polygon seen from above, in the scan's coordinates."""

    kind: Literal["polygon"] = Field(description="kind of cut")
    corners: Annotated[tuple[Place, ...], Lax] = Field(
        min_length=3, description="x, y of the polygon's corners [m]"
    )


class ColourCut(Section):
    """The rock is what has a given colour at the scan's vertices."""

    kind: Literal["colour"] = Field(description="kind of cut")
    rgb: Annotated[tuple[Channel, Channel, Channel], Lax] = Field(
        description="red, green and blue of the rock, out of 255 [1]"
    )
    tolerance: float = Field(
        40.0, gt=0, le=442, description="largest distance from that colour, out of 442 [1]"
    )


Cut = Annotated[PlaneCut | BoxCut | PolygonCut | ColourCut, Field(discriminator="kind")]


class PedestalConfig(Section):
    """What the rock stands on: level ground, or the terrain in its scan."""

    shape: Literal["flat", "mesh"] = Field(
        "flat", description="level ground, or the terrain in the rock's scan"
    )
    cut: Literal["proposal"] | Cut | None = Field(
        None,
        description="which part of the scan is the rock; proposal accepts what `vsr prep` shows",
    )
    near: Vector | None = Field(
        None, description="a point on the rock, where the scan shows several rocks [m]"
    )
    clearance: float = Field(
        0.001, gt=0, le=0.05, description="gap between the rock and its seat before it settles [m]"
    )


class SimulationConfig(Section):
    """How runs are computed."""

    engine: Literal["auto", "nonsmooth", "bullet", "mujoco"] = Field(
        "auto",
        description="physics engine; auto for the cheapest that can hold the scene; mujoco is an "
        "extra of the installation",
    )
    time_step: Literal["auto"] | Annotated[float, Field(ge=SHORTEST_STEP, le=0.02)] = Field(
        "auto", description="time step; auto for the coarsest that keeps to the tolerance [s]"
    )
    tolerance: float = Field(
        0.01,
        ge=0.0005,
        le=0.1,
        description="relative error of the overturning boundary for which auto chooses [1]",
    )
    reduce: Annotated[bool, Lax] = Field(
        True, description="whether what cannot change an outcome is left out of a run"
    )


class FoundConfig(Section):
    """A rock found on the terrain, of which it is asked where it came from."""

    place: Place = Field(
        description="x, y of the found rock's centre, in the scan's coordinates [m]"
    )
    sigma: float = Field(gt=0, le=1000, description="standard deviation of that place [m]")
    identity: float = Field(
        1.0, gt=0, le=1, description="probability that the found rock is this one [1]"
    )
    area: float | None = Field(
        None,
        gt=0,
        le=1e15,
        description="area in which it could lie had it come from elsewhere; needed where identity "
        "is below 1 [m2]",
    )

    @model_validator(mode="after")
    def _elsewhere_is_known(self) -> FoundConfig:
        if self.identity < 1.0 and self.area is None:
            raise ValueError("with an identity below 1 another rock lies anywhere; give its `area`")
        return self


class Config(Section):
    """Everything that determines the products of a site."""

    rock: RockConfig = Field(description="rock on the pedestal: its shape and density")
    pedestal: PedestalConfig = Field(PedestalConfig(), description="what the rock stands on")
    contact: ContactConfig = Field(description="coefficients of the pair of rock and pedestal")
    motion: MotionConfig = Field(description="ground motions of the study")
    yaw: Annotated[
        Values,
        BeforeValidator(as_values, json_schema_input_type=_Angle | list[_Angle] | Range),
    ] = Field(description="rotation of the rock about z before the shaking along +x [degree]")
    drive: Literal["table_frame", "servo"] = Field(
        "table_frame", description="motion as prescribed, or as a servo brings it about"
    )
    servo: ServoConfig = Field(description="servo of the table, where drive is servo")
    simulation: SimulationConfig = Field(
        SimulationConfig(), description="how the runs are computed"
    )
    found: FoundConfig | None = Field(
        None, description="rock found on the terrain, where there is one"
    )
    hazard: HazardConfig = Field(
        HazardConfig(), description="hazard curves and the rock's age, for `make hazard`"
    )
    uncertainty: UncertaintyConfig = Field(
        UncertaintyConfig(), description="what is not known of rock and shaking, and its draws"
    )

    @property
    def on_terrain(self) -> bool:
        """Whether the rock stands on a terrain."""
        return self.pedestal.shape == "mesh"

    @property
    def rock_alone(self) -> bool:
        """Whether the rock is scanned without its ground."""
        return self.rock.shape == "mesh" and not self.on_terrain

    @property
    def engine(self) -> str:
        """Name of the physics engine: of ``auto`` the cheapest that can hold the scene."""
        given = self.simulation.engine
        if given != "auto":
            return given
        rolls = self.contact.rolling_friction > 0.0
        return "bullet" if self.drive == "servo" or rolls else COMPILED

    @property
    def uncertain(self) -> bool:
        """Whether what is not known of the rock is drawn, which it is on a flat pedestal only."""
        return self.uncertainty.members > 0 and not self.on_terrain

    @property
    def in_other_engine(self) -> bool:
        """Whether runs are in another engine than Bullet, which then repeats a sample of them."""
        return self.engine != "bullet"

    @property
    def long_runs(self) -> bool:
        """Whether a hundred runs in Bullet are work for several processes."""
        from_files = isinstance(self.motion, RecordConfig | TableMotionConfig) and self.motion.files
        return self.on_terrain or bool(from_files)

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
            check(in_si.servo(servo))
        return servo

    @field_validator("simulation")
    @classmethod
    def _can_drive(cls, simulation: SimulationConfig, info: ValidationInfo) -> SimulationConfig:
        bullet = simulation.engine in ("auto", "bullet")
        if info.data.get("drive") == "servo" and not bullet:
            raise ValueError("a servo needs Bullet; set engine: bullet, or drive: table_frame")
        pedestal = info.data.get("pedestal")
        if simulation.engine == "mujoco" and pedestal is not None and pedestal.shape == "mesh":
            raise ValueError("MuJoCo takes the convex hull of any terrain; set engine: bullet")
        return simulation

    @field_validator("simulation")
    @classmethod
    def _knows_the_law(cls, simulation: SimulationConfig, info: ValidationInfo) -> SimulationConfig:
        contact = info.data.get("contact")
        if contact is None or contact.restitution_law == "newton":
            return simulation
        elsewhere = info.data.get("drive") == "servo" or contact.rolling_friction > 0.0
        if elsewhere or simulation.engine not in ("auto", COMPILED):
            raise ValueError(
                f"contact.restitution_law: energetic is only in the engine {COMPILED}, which has "
                f"no servo and no rolling friction; set newton"
            )
        return simulation

    @field_serializer("servo", mode="wrap")
    def _empty_if_idle(
        self, servo: ServoConfig, dump: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        """A servo that drives nothing is no part of what determines a product."""
        return dict(dump(servo)) if self.drive == "servo" else {}

    @field_validator("yaw")
    @classmethod
    def _in_a_circle(cls, yaw: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        contact = info.data.get("contact")
        if contact is not None and len(yaw) * len(contact.friction) > MOST_SCENES:
            raise ValueError(f"directions times frictions are at most {MOST_SCENES}; thin them out")
        if min(yaw) < -360.0 or max(yaw) > 360.0:
            raise ValueError("yaw is in degrees from -360 to 360; bring it into the circle")
        return yaw
