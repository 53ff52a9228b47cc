"""The typed configuration: every key, its unit and its range. Degrees, g and s live here only."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple

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
from pipeline.config.fragility_schema import FragilityConfig
from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.motion_schema import MotionConfig, RecordConfig, TableMotionConfig
from pipeline.config.observation_schema import Observations
from pipeline.config.priors_schema import UncertaintyConfig
from pipeline.config.scene_schema import (
    ContactConfig,
    Georeference,
    ObservedBoulder,
    PedestalConfig,
    RockConfig,
    ServoConfig,
)
from pipeline.config.sections import (
    MOST_SCENES,
    SMALLEST_PGA,
    Key,
    Lax,
    Mass,
    Range,
    Rate,
    Refused,
    Section,
    Travel,
    Values,
    as_values,
)
from pipeline.config.simulation_schema import SimulationConfig
from vsr_core import engines
from vsr_core.errors import InvalidInput
from vsr_core.outcome import OF_TRAVEL
from vsr_core.table.capacity import Table
from vsr_core.table.servo import check

COMPILED = "nonsmooth"
"""The engine that ``auto`` takes where it can hold the scene."""

# What the schema says of each value; the validators below say it in the field's words.
_Angle = Annotated[float, Field(ge=-360, le=360)]

_SAME_DIRECTION = 1e-6
"""Degrees by which two directions differ at least."""


class StabilityConfig(Section):
    """What `make stability` tries beside its usual cases."""

    raw_scans: Annotated[bool, Lax] = Field(
        False, description="24 made scans, from the scan to the verdicts of runs: some minutes more"
    )


class SceneSettings(NamedTuple):
    """What the scenes of a study are set up by, and how they are run."""

    pedestal: PedestalConfig
    contact: ContactConfig
    drive: Annotated[str, Key("drive")]
    servo: ServoConfig | None
    simulation: SimulationConfig

    @property
    def on_terrain(self) -> bool:
        """Whether the rock stands on a terrain."""
        return self.pedestal.shape == "mesh"

    @property
    def engine(self) -> str:
        """Name of the physics engine: of ``auto`` the cheapest that can hold the scene."""
        given = self.simulation.engine
        if given != "auto":
            return given
        rolls = self.contact.rolling_friction > 0.0
        return "bullet" if self.drive == "servo" or rolls else COMPILED

    def with_contact(self, **changes: Any) -> SceneSettings:
        """The same with another contact."""
        return self._replace(contact=self.contact.model_copy(update=changes))


class Config(Section):
    """Everything that determines the products of a site."""

    rock: RockConfig = Field(description="rock on the pedestal: its shape and density")
    pedestal: PedestalConfig = Field(PedestalConfig(), description="support of the rock")
    contact: ContactConfig = Field(description="contact coefficients of rock and pedestal")
    motion: MotionConfig = Field(description="ground motions of the study")
    yaw: Annotated[
        Values, BeforeValidator(as_values, json_schema_input_type=_Angle | list[_Angle] | Range)
    ] = Field(description="rotation of the rock about z before the shaking along +x [degree]")
    drive: Literal["table_frame", "servo"] = Field(
        "table_frame", description="prescribed motion, or a servo-controlled table"
    )
    servo: ServoConfig = Field(description="servo of the table, where drive is servo")
    simulation: SimulationConfig = Field(
        SimulationConfig(), description="how the runs are computed"
    )
    fragility: FragilityConfig = Field(
        FragilityConfig(), description="the overturning boundary between the cells of the grid"
    )
    observed_boulder: ObservedBoulder | None = Field(
        None, description="boulder observed on the terrain, to be traced to its source"
    )
    georeference: Georeference | None = Field(
        None, description="where the scan lies, for `vsr run geodata`"
    )
    hazard: HazardConfig = Field(
        HazardConfig(), description="hazard curves and age of the rock, for `make hazard`"
    )
    uncertainty: UncertaintyConfig = Field(
        UncertaintyConfig(),
        description="prior distributions of rock and shaking, for `make uncertainty`",
    )
    observations: Observations = Field(
        (), description="what was observed of the rock in the field, for `make observations`"
    )
    stability: StabilityConfig = Field(
        StabilityConfig(), description="further cases, for `make stability`"
    )

    @property
    def scene(self) -> SceneSettings:
        """What the scenes are set up by."""
        servo = self.servo if self.drive == "servo" else None
        return SceneSettings(self.pedestal, self.contact, self.drive, servo, self.simulation)

    @property
    def on_terrain(self) -> bool:
        """Whether the rock stands on a terrain."""
        return self.scene.on_terrain

    @property
    def own_servo(self) -> ServoConfig:
        """The servo, also where it drives nothing."""
        return self.servo

    @property
    def rock_alone(self) -> bool:
        """Whether the rock is scanned without its ground."""
        return self.rock.shape == "mesh" and not self.on_terrain

    @property
    def on_own_ground(self) -> bool:
        """Whether the rock stands on a terrain in a file of its own."""
        return self.pedestal.is_own_file

    @property
    def engine(self) -> str:
        """Name of the physics engine: of ``auto`` the cheapest that can hold the scene."""
        return self.scene.engine

    @property
    def uncertain(self) -> bool:
        """Whether what is not known of the rock is drawn: not on a terrain of another file."""
        return self.uncertainty.members > 0 and not self.on_own_ground

    @property
    def observed(self) -> bool:
        """Whether something was observed of the rock."""
        return bool(self.observations)

    @property
    def second_engine(self) -> str | None:
        """Engine that repeats a sample of the runs: Bullet, or MuJoCo where that is not installed.

        MuJoCo has no terrain, no restitution and no table that turns.
        """
        if self.engine == "bullet" or engines.available("bullet"):
            return None if self.engine == "bullet" else "bullet"
        turns = isinstance(self.motion, TableMotionConfig)
        limited = self.on_terrain or turns or self.contact.restitution > 0.0
        return None if limited or self.engine == "mujoco" else "mujoco"

    @property
    def with_vertical(self) -> bool:
        """Whether the ground is shaken by records that may have a vertical component."""
        motion = self.motion
        given = motion.records or () if isinstance(motion, RecordConfig) else ()
        return any(one.components is None or one.components.z is not None for one in given)

    @property
    def long_runs(self) -> bool:
        """Whether a hundred runs in Bullet are work for several processes."""
        motion = self.motion
        pulses = isinstance(motion, TableMotionConfig) and motion.files is None
        recorded = isinstance(motion, RecordConfig | TableMotionConfig) and not pulses
        return self.on_terrain or recorded

    @field_validator("pedestal")
    @classmethod
    def _is_in_a_scan(cls, pedestal: PedestalConfig, info: ValidationInfo) -> PedestalConfig:
        rock = info.data.get("rock")
        if pedestal.shape == "mesh" and rock is not None and rock.shape != "mesh":
            raise Refused("a terrain needs a scan of the rock", "set rock.shape: mesh")
        return pedestal

    @field_validator("motion")
    @classmethod
    def _has_a_way(cls, motion: MotionConfig, info: ValidationInfo) -> MotionConfig:
        pedestal = info.data.get("pedestal")
        turns = isinstance(motion, TableMotionConfig) and motion.turns
        if turns and pedestal and pedestal.shape == "mesh":
            rule = "a terrain is shaken along x, y and z and does not turn"
            raise Refused(rule, "leave out roll, pitch and yaw, or set pedestal.shape: flat")
        return motion

    @field_validator("drive")
    @classmethod
    def _can_carry(cls, drive: str, info: ValidationInfo) -> str:
        pedestal = info.data.get("pedestal")
        if drive == "servo" and pedestal is not None and pedestal.shape == "mesh":
            raise Refused("a servo needs a flat pedestal", "set drive: table_frame")
        motion = info.data.get("motion")
        several = isinstance(motion, RecordConfig) and motion.records is not None
        if drive == "servo" and (several or isinstance(motion, TableMotionConfig)):
            raise Refused("a servo-controlled table moves along x only", "set drive: table_frame")
        return drive

    @field_validator("servo")
    @classmethod
    def _stable(cls, servo: ServoConfig, info: ValidationInfo) -> ServoConfig:
        if info.data.get("drive") == "servo":
            try:
                check(in_si.servo(servo))
            except InvalidInput as error:
                keys = "period kp ki kd mass"
                raise Refused(error.rule, error.remedy, keys, error.given) from None
        return servo

    @field_validator("simulation")
    @classmethod
    def _can_drive(cls, simulation: SimulationConfig, info: ValidationInfo) -> SimulationConfig:
        bullet = simulation.engine in ("auto", "bullet")
        if info.data.get("drive") == "servo" and not bullet:
            raise Refused(
                "a servo needs Bullet", "set it to auto, or drive: table_frame", key="engine"
            )
        pedestal = info.data.get("pedestal")
        if simulation.engine == "mujoco" and pedestal is not None and pedestal.shape == "mesh":
            raise Refused(
                "MuJoCo replaces a terrain by its convex hull", "set it to auto", key="engine"
            )
        return simulation

    @field_validator("simulation")
    @classmethod
    def _travels(cls, simulation: SimulationConfig, info: ValidationInfo) -> SimulationConfig:
        pedestal = info.data.get("pedestal")
        flat = pedestal is not None and pedestal.shape != "mesh"
        if flat and set(OF_TRAVEL) & set(simulation.accurate):
            rule = "a rock travels over a terrain, which pedestal.shape: mesh has"
            raise Refused(rule, f"leave out {' and '.join(OF_TRAVEL)}", key="accurate")
        return simulation

    @model_validator(mode="after")
    def _knows_the_law(self) -> Config:
        rolling, engine = self.contact.rolling_friction, self.simulation.engine
        elsewhere = {  # the engine last: auto chooses one for a servo and for rolling friction
            "drive: servo": self.drive == "servo",
            f"contact.rolling_friction: {rolling:g}": rolling > 0.0,
            f"simulation.engine: {engine}": engine not in ("auto", COMPILED),
        }
        given = next((name for name, is_so in elsewhere.items() if is_so), "")
        if self.contact.restitution_law != "newton" and given:
            rule = (
                f"it is only in the engine {COMPILED}, which has no servo and no rolling friction"
            )
            raise Refused(rule, "set newton", "contact.restitution_law", f"energetic with {given}")
        return self

    @model_validator(mode="after")
    def _stands_on_a_file(self) -> Config:
        own = self.pedestal.mesh or self.pedestal.fallback
        if self.rock.pose is not None and not own:
            rule, remedy = "a pose is a place on a terrain", "name that terrain in pedestal.mesh"
            raise Refused(rule, remedy, "rock.pose", "no pedestal.mesh")
        return self

    @model_validator(mode="after")
    def _has_one_scan(self) -> Config:
        replica = self.uncertainty.scan.replica
        if self.on_terrain and replica is not None:
            rule = "draws on a terrain have an error of the seam, and one scan of the rock"
            raise Refused(rule, "leave it out", "uncertainty.scan.replica", repr(replica))
        return self

    @model_validator(mode="after")
    def _weighs_draws(self) -> Config:
        if self.observed and self.on_own_ground:
            rule, remedy = "draws of rock and ground in one scan are weighed", "leave them out"
            raise Refused(rule, remedy, "observations", "a terrain in a file of its own")
        if self.observed and not self.uncertainty.members:
            rule, remedy = "observations weigh draws", "give a number of draws, such as 32"
            raise Refused(rule, remedy, "uncertainty.members", "0")
        return self

    @model_validator(mode="after")
    def _has_its_engine(self) -> Config:
        try:
            engines.require(self.engine)
        except InvalidInput as error:
            key = "simulation.engine"
            if self.simulation.engine == "auto":
                key = "drive" if self.drive == "servo" else "contact.rolling_friction"
            raise Refused(error.rule, error.remedy, key, error.given) from None
        return self

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
            raise Refused(
                f"directions times frictions are at most {MOST_SCENES}", "reduce their number"
            )
        if min(yaw) < -360.0 or max(yaw) > 360.0:
            raise Refused("yaw is in degrees from -360 to 360", "add or subtract 360")
        around = sorted((one % 360.0, one) for one in yaw)
        around += [(around[0][0] + 360.0, around[0][1])] if len(yaw) > 1 else []
        for (low, one), (high, other) in pairwise(around):
            if high - low < _SAME_DIRECTION:
                given, rule = f"{one:g} and {other:g}", "each direction is there once, as all count"
                raise Refused(rule, "leave one out", given=given)
        return yaw


class TableConfig(Section):
    """Limits of a shake table; a limit of null is unknown and not checked."""

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


def _limit(value: float | None) -> float:
    return math.inf if value is None else value
