"""The rock, what it stands on, their contact, and the servo of a table."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, field_validator, model_validator

from pipeline.config.sections import (
    LARGEST_GAIN,
    SHORTEST_STEP,
    Coordinate,
    Density,
    Force,
    Gain,
    Lax,
    Length,
    Mass,
    Outside,
    Range,
    Rate,
    Refused,
    Section,
    Values,
    as_values,
)
from vsr_core.rock.size import THINNEST, check_size

Vector = Annotated[tuple[Coordinate, Coordinate, Coordinate], Lax]
Point = Annotated[tuple[Coordinate, Coordinate], Lax]
Channel = Annotated[int, Field(ge=0, le=255)]

# What the schema says of each value; the validator below says it in the field's words.
_Friction = Annotated[float, Field(ge=0, le=100)]


class PoseConfig(Section):
    """How the rock's file lies in the coordinates of the terrain's file."""

    position: Vector = Field(description="origin of the rock's file [m]")
    quaternion: Annotated[tuple[float, float, float, float], Lax] = Field(
        (0.0, 0.0, 0.0, 1.0), description="turn of the rock's axes: x, y, z, w [1]"
    )
    drop: Annotated[bool, Lax] = Field(
        False, description="let it fall from just above the ground there, whatever the z given"
    )

    @field_validator("quaternion")
    @classmethod
    def _turns(cls, quaternion: tuple[float, ...]) -> tuple[float, ...]:
        if not math.isclose(math.hypot(*quaternion), 1.0, abs_tol=0.01):
            raise Refused("a quaternion of a turn has length 1", "give x, y, z, w")
        return quaternion


class RockConfig(Section):
    """The rock on the pedestal."""

    shape: Literal["box", "mesh"] = Field(description="shape of the rock: a box, or a scanned mesh")
    size: Annotated[tuple[float, float, float], Lax] | None = Field(
        None, description="lengths of a box along x, y, z at yaw 0 [m]"
    )
    mesh: Outside | None = Field(
        None,
        description="scan of the rock, z up, or a folder with one: .ply, .stl, .obj, .dae or .glb; "
        "relative to the file that names it",
    )
    fallback: str | None = Field(
        None, description="surrogate of vsr_core.surrogates, used where there is no scan"
    )
    scale: float = Field(
        1.0,
        ge=1e-6,
        le=1e6,
        description="length of the mesh file's unit, by which a surrogate is scaled, too [m]",
    )
    closing: Literal["caps", "hull", "poisson"] = Field(
        "caps", description="method to close the underside, which a scan does not see"
    )
    density: Density = Field(description="density of the rock [kg m-3]")
    contact_shape: Literal["auto", "hull", "pieces"] = Field(
        "auto",
        description="what of it touches a terrain: its hull, convex pieces, or the hull unless "
        "ground comes into what that has besides the rock; on level ground the hull is exact",
    )
    contact_error: float = Field(
        0.05,
        ge=0.005,
        le=0.3,
        description="largest distance of those pieces from the rock, as a share of its radius [1]",
    )
    pose: PoseConfig | None = Field(
        None, description="place on a terrain of pedestal.mesh; null where both files agree on it"
    )

    @field_validator("size")
    @classmethod
    def _positive(cls, size: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if size is None:
            return size
        if min(size) <= 0.0:
            raise Refused("the lengths of a box must be positive [m]", "correct the size")
        check_size(max(size))
        if min(size) < THINNEST * max(size):
            rule = f"the thickness of a block must be at least {THINNEST:g} of its length"
            raise Refused(rule, "correct the size")
        return size

    @model_validator(mode="after")
    def _shape_is_given(self) -> RockConfig:
        if self.shape == "box" and self.size is None:
            raise Refused("shape `box` needs `size`", "give [x, y, z] in metres")
        if self.shape == "mesh" and self.mesh is None:
            raise Refused("shape `mesh` needs `mesh`", "give the path of the scan")
        return self


class PlaneCut(Section):
    """The rock is the part of the scan on one side of a plane."""

    kind: Literal["plane"] = Field(description="kind of cut")
    point: Vector = Field(description="a point of the plane [m]")
    normal: Vector = Field(description="normal of the plane, toward the rock [1]")


class BoxCut(Section):
    """The rock is the part of the scan within a box."""

    kind: Literal["box"] = Field(description="kind of cut")
    low: Vector = Field(description="lowest corner of the box [m]")
    high: Vector = Field(description="highest corner of the box [m]")


class PolygonCut(Section):
    """The rock is the part of the scan within a polygon in plan view."""

    kind: Literal["polygon"] = Field(description="kind of cut")
    corners: Annotated[tuple[Point, ...], Lax] = Field(
        min_length=3, description="x, y of the polygon's corners [m]"
    )


class ColourCut(Section):
    """The rock is the part of the scan whose vertices have a given colour."""

    kind: Literal["colour"] = Field(description="kind of cut")
    rgb: Annotated[tuple[Channel, Channel, Channel], Lax] = Field(
        description="red, green and blue of the rock, out of 255 [1]"
    )
    tolerance: float = Field(
        40.0, gt=0, le=442, description="largest distance from that colour, out of 442 [1]"
    )


Cut = Annotated[PlaneCut | BoxCut | PolygonCut | ColourCut, Field(discriminator="kind")]


class SeatPoints(Section):
    """The rock bears on a few points of its seam with the ground."""

    points: int = Field(ge=3, le=6, description="number of points, which span the largest area")


class PedestalConfig(Section):
    """The support of the rock: level ground, or a terrain."""

    shape: Literal["flat", "mesh"] = Field(
        "flat", description="level ground, or a terrain: that in the rock's scan, or `mesh`"
    )
    mesh: Outside | None = Field(
        None,
        description="terrain in a file of its own, in metres, z up, named as rock.mesh is; the "
        "rock stands on it at rock.pose, and nothing is cut",
    )
    fallback: str | None = Field(
        None, description="ground of vsr_core.surrogates, used where there is no such file"
    )
    cut: Literal["proposal"] | Cut | None = Field(
        None,
        description="cut that separates rock and ground; proposal accepts the one of `vsr prep`",
    )
    point_on_rock: Vector | None = Field(
        None, description="a point on the rock, where the scan shows several rocks [m]"
    )
    seat: Literal["rim", "whole"] | SeatPoints = Field(
        "rim",
        description="what of the seam bears the rock, which no scan has seen: points along its "
        "outline, so many points, or all of it",
    )

    @property
    def is_own_file(self) -> bool:
        """Whether it is a terrain that is not in the rock's scan."""
        return self.shape == "mesh" and (self.mesh or self.fallback) is not None

    @model_validator(mode="after")
    def _cuts_its_scan_only(self) -> PedestalConfig:
        if self.is_own_file and self.cut is not None:
            rule = "a rock in a file of its own is not cut from a terrain"
            raise Refused(rule, "leave out cut, or mesh", "cut mesh")
        return self


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
        description="law of restitution: Newton's ratio of normal speeds, or ratio of energies; "
        "no impact gains energy with either",
    )
    rolling_friction: Length = Field(0.0, description="rolling friction, a length [m]")

    @field_validator("friction")
    @classmethod
    def _not_negative(cls, friction: tuple[float, ...]) -> tuple[float, ...]:
        if min(friction) < 0.0:
            raise Refused("friction must not be negative", "dry rock on rock has about 0.6")
        if max(friction) > 100.0:
            raise Refused("a Coulomb coefficient is at most 100", "use 10 for no sliding")
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
            raise Refused(
                f"a command lasts a whole number of control periods, here of {self.period:g} s",
                f"set command_rate to {1.0 / self.period:.6g} Hz divided by a whole number",
                "period command_rate",
                f"{self.period:g} s beside a command rate of {self.command_rate:g} Hz",
            )
        return self


class Georeference(Section):
    """Where on earth a scan lies; its x points to the east and its y to the north of that grid."""

    crs: str = Field(
        pattern=r"^[A-Za-z]+:[0-9]+$",
        description="projected coordinate reference system in metres, such as EPSG:32611",
    )
    origin: Annotated[tuple[Coordinate, Coordinate, Coordinate], Lax] = Field(
        (0.0, 0.0, 0.0),
        description="easting, northing and height there of the origin of the scan's coordinates; "
        "zero where the scan is in that system's coordinates [m]",
    )


class ObservedBoulder(Section):
    """A boulder observed on the terrain, whose source is to be found."""

    position: Point = Field(
        description="x, y of the boulder's centre, in the scan's coordinates [m]"
    )
    position_sd: float = Field(
        gt=0, le=1000, description="standard deviation of each coordinate of that position [m]"
    )
    association_probability: float = Field(
        1.0, gt=0, le=1, description="prior probability that the boulder is this site's rock [1]"
    )
    deposit_area: float | None = Field(
        None,
        gt=0,
        le=1e15,
        description="plan area over which a boulder from another source could lie; required where "
        "association_probability is below 1 [m2]",
    )

    @model_validator(mode="after")
    def _has_a_deposit_area(self) -> ObservedBoulder:
        if self.association_probability < 1.0 and self.deposit_area is None:
            raise Refused(
                "an association probability below 1 needs a `deposit_area`", "give it in m2"
            )
        return self
