"""The ground motions of a configuration: pulses, records, and tables in several axes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from pipeline.config.sections import (
    LARGEST_PGA,
    LONGEST_PULSE,
    SHORTEST_PULSE,
    SMALLEST_PGA,
    Corner,
    Grid,
    Lax,
    Outside,
    Range,
    Rate,
    Refused,
    Section,
    as_values,
)
from vsr_core.motions.records.processing import Processing

# What the schema says of each value; the functions below say it in the field's words.
_Peak = Annotated[float, Field(ge=SMALLEST_PGA, le=LARGEST_PGA)]
_Ratio = Annotated[float, Field(ge=SHORTEST_PULSE, le=LONGEST_PULSE)]


def _in_g(pga: tuple[float, ...]) -> tuple[float, ...]:
    if pga[0] < SMALLEST_PGA:
        raise Refused(f"a PGA is positive, at least {SMALLEST_PGA:g} g", "start above 0 g")
    if pga[-1] > LARGEST_PGA:
        rule = f"PGA is in g and at most {LARGEST_PGA:g} g"
        raise Refused(rule, "write 0.3 for 30 percent of g, or 1 for 9.81 m/s2")
    return pga


OCTAVES = (*(part * 2.0**power for power in range(-5, 1) for part in (1.0, 1.5)), 2.0)
"""PGAs of ``auto`` [g]: two an octave, at which the brackets of every grid are parted, too."""


def _as_peaks(given: object) -> object:
    return OCTAVES if given == "auto" else as_values(given)


Peaks = Annotated[
    Grid,
    BeforeValidator(
        _as_peaks, json_schema_input_type=Literal["auto"] | _Peak | list[_Peak] | Range
    ),
    AfterValidator(_in_g),
]
"""Peak ground accelerations [g]; ``auto`` where only the boundary is wanted."""


def _in_seconds(pgv_pga: tuple[float, ...]) -> tuple[float, ...]:
    if pgv_pga[0] < SHORTEST_PULSE:
        raise Refused(f"PGV/PGA is positive, at least {SHORTEST_PULSE:g} s", "start there")
    if pgv_pga[-1] > LONGEST_PULSE:
        raise Refused(
            f"PGV/PGA is in seconds and at most {LONGEST_PULSE:g} s", "write 0.3 for 300 ms"
        )
    return pgv_pga


Ratios = Annotated[
    Grid,
    BeforeValidator(as_values, json_schema_input_type=_Ratio | list[_Ratio] | Range),
    AfterValidator(_in_seconds),
]
"""Ratios of peak velocity to peak acceleration [s]."""


class PulseGrid(Section):
    """A grid of pulses of one shape."""

    pga: Peaks = Field(
        description="peak ground acceleration; auto for 13 values from 1/32 to 2 g, between and "
        "beyond which the boundary is resolved [g]"
    )
    pgv_pga: Ratios = Field(description="ratio of peak velocity to peak acceleration [s]")


class PulseConfig(PulseGrid):
    """The grid of cosine pulses."""

    kind: Literal["cosine_pulse"] = Field("cosine_pulse", description="kind of motion")


class SinePulseConfig(PulseGrid):
    """A grid of single sine pulses of acceleration."""

    kind: Literal["sine_pulse"] = Field("sine_pulse", description="kind of motion")


class RickerPulseConfig(PulseGrid):
    """A grid of symmetric Ricker pulses."""

    kind: Literal["ricker_pulse"] = Field("ricker_pulse", description="kind of motion")


PULSES = ("cosine_pulse", "sine_pulse", "ricker_pulse")
"""Kinds with the same keys: a layer may change one for another."""

PUSHING = ("cosine_pulse", "sine_pulse")
"""Those that begin with an acceleration towards +x, which pushes a rock towards -x."""


def is_along_x(motion: Mapping[str, Any]) -> bool:
    """Whether motions, as plain data, shake along x alone."""
    return motion["kind"] in PULSES or (motion["kind"] == "record" and bool(motion["files"]))


Files = Annotated[
    tuple[Outside, ...],
    Lax,
    BeforeValidator(as_values, json_schema_input_type=str | list[str]),
    Field(min_length=1),
]
"""Names of files or folders."""


class ProcessingConfig(Section):
    """Processing of each record; no filter by default."""

    order: Literal["paper", "standard", "none"] = Field(
        description="steps and their order: paper (filters), standard (straight line removed, "
        "filters, baseline correction) or none"
    )
    highpass: Corner | None = Field(
        description="corner frequency of the high-pass filter; null for none [Hz]"
    )
    lowpass: Corner | None = Field(
        description="corner frequency of the low-pass filter; null for none [Hz]"
    )
    poles: int = Field(4, ge=1, le=10, description="number of poles of each filter in one pass")
    resample: Rate | None = Field(
        None,
        ge=10,
        le=100_000,
        description="new sampling rate, band-limited; null to keep it [1/s]",
    )

    @model_validator(mode="after")
    def _corners_make_sense(self) -> ProcessingConfig:
        if self.order == "none" and (self.highpass is not None or self.lowpass is not None):
            rule = "processing order `none` takes no filter corners"
            raise Refused(rule, "set both to null, or order: paper")
        if (self.highpass or 0.0) >= (self.lowpass or math.inf):
            raise Refused("the high-pass corner must be below the low-pass corner", "exchange them")
        return self

    def how(self) -> Processing:
        """The same in the terms of the physics."""
        return Processing(self.order, self.highpass, self.lowpass, self.poles, self.resample)


_Edge = Annotated[float, Field(ge=0, le=100_000)]


class ResponseConfig(Section):
    """Removal of an instrument's response."""

    file: Outside = Field(
        description="StationXML file of the instruments; relative to the file that names it"
    )
    corners: Annotated[tuple[_Edge, _Edge, _Edge, _Edge], Lax] = Field(
        description="corner frequencies f1 < f2 < f3 < f4 of the spectrum's taper [Hz]"
    )

    @field_validator("corners")
    @classmethod
    def _ascend(cls, corners: tuple[float, ...]) -> tuple[float, ...]:
        if corners[0] < 0.0 or list(corners) != sorted(set(corners)):
            raise Refused("corners ascend from 0 Hz or more", "sort them")
        return corners


class AxesConfig(Section):
    """What was recorded along each axis, one of x and y at least."""

    x: str | None = Field(None, description="horizontal component: its file, or its channel")
    y: str | None = Field(None, description="horizontal component, 90 degrees to the left of x")
    z: str | None = Field(None, description="vertical component, positive upward")

    @model_validator(mode="after")
    def _is_not_vertical(self) -> AxesConfig:
        if self.x is None and self.y is None:
            rule = "the PGA is that of the larger horizontal component"
            raise Refused(rule, "add the component x or y")
        return self

    @property
    def named(self) -> dict[str, str]:
        """The files or channels that are given, by their axes."""
        return {axis: name for axis, name in self if name is not None}


class ComponentsConfig(Section):
    """A recorded motion along several axes, all scaled by one factor."""

    file: Outside | None = Field(
        None,
        description="one file of several channels, named as `components`; without these the "
        "channels that end in E, N and Z are x, y and z",
    )
    components: AxesConfig | None = Field(
        None, description="files of the components, or channels of `file`"
    )
    azimuth: float = Field(
        0.0,
        ge=-360,
        le=360,
        description="direction of x, counter-clockwise from the +x of scan or table [degree]",
    )

    @model_validator(mode="after")
    def _is_given(self) -> ComponentsConfig:
        if self.file is None and self.components is None:
            rule = "a record has `components`, or a `file` of several channels"
            raise Refused(rule, "e.g. {components: {x: a.at2, y: b.at2, z: c.at2}}")
        return self

    @property
    def files(self) -> tuple[str, ...]:
        """The files that it is in."""
        if self.file is not None:
            return (self.file,)
        assert self.components is not None
        return tuple(self.components.named.values())


class RecordConfig(Section):
    """Recorded motions, each scaled to every PGA."""

    kind: Literal["record"] = Field("record", description="kind of motion")
    files: Files | None = Field(
        None,
        description="recorded motions or folders of them, each along x; relative to the file that "
        "names them",
    )
    records: Annotated[tuple[ComponentsConfig, ...], Lax] | None = Field(
        None,
        description="recorded motions along several axes, in place of `files`; paths relative to "
        "the file that names them",
    )
    component: str | None = Field(None, description="channel or column, where a file has several")
    unit: str | None = Field(
        None, description="unit of the acceleration in files that state none, e.g. m/s2 or gal"
    )
    response: ResponseConfig | None = Field(
        None, description="removal of the instruments' response; null for none"
    )
    processing: ProcessingConfig = Field(description="processing of each record")
    pga: Peaks = Field(
        description="peak ground acceleration after processing, of the larger horizontal component "
        "[g]"
    )

    @model_validator(mode="after")
    def _is_given(self) -> RecordConfig:
        if self.files is None and self.records is None:
            rule = "required key not given, nor `records` of several components"
            raise Refused(rule, "name recorded motions", key="files")
        if self.files is not None and self.records is not None:
            rule = "recorded motions are `files` along x, or `records` of several components"
            raise Refused(rule, "give one of the two", key="files records")
        if self.records == ():
            raise Refused("at least one record is required", "add one", key="records")
        if self.response is not None and self.unit is not None:
            rule = "without their response, samples are in m/s2: no unit goes with it"
            raise Refused(rule, "leave out motion.unit", key="unit response")
        return self


class AxisPulseConfig(Section):
    """A cosine pulse on one axis of a table."""

    axis: Literal["x", "y", "z", "roll", "pitch", "yaw"] = Field(
        description="axis of the table along or about which the pulse acts"
    )
    pga_ratio: float = Field(
        1.0,
        ge=-100,
        le=100,
        description="ratio of its peak to the PGA, not 0; of a rotation, at 1 m from its axis [1]",
    )
    pgv_pga: _Ratio | None = Field(
        None, description="PGV/PGA of this pulse; null for that of the grid [s]"
    )

    @field_validator("pga_ratio")
    @classmethod
    def _moves(cls, pga_ratio: float) -> float:
        if abs(pga_ratio) < SMALLEST_PGA:
            raise Refused("a ratio of 0 is no motion", "remove the pulse")
        return pga_ratio


class TableMotionConfig(Section):
    """Motions of a table in up to six axes, from files or as pulses, each scaled to every PGA."""

    kind: Literal["table"] = Field("table", description="kind of motion")
    files: Files | None = Field(
        None,
        description="CSV or NetCDF files of time and axes; relative to the file that names them",
    )
    pulses: Annotated[tuple[AxisPulseConfig, ...], Lax] | None = Field(
        None, description="cosine pulses that begin together, each on its axis"
    )
    pgv_pga: Ratios | None = Field(
        None,
        validate_default=True,
        description="ratio of peak velocity to peak acceleration of the pulses [s]",
    )
    pga: Peaks = Field(
        description="peak ground acceleration; in files including the tilt of gravity [g]"
    )

    @field_validator("pulses")
    @classmethod
    def _are_alone(
        cls, pulses: tuple[AxisPulseConfig, ...] | None, info: ValidationInfo
    ) -> tuple[AxisPulseConfig, ...] | None:
        if pulses is None:
            return None
        if info.data.get("files") is not None:
            raise Refused("a table motion has files or pulses, not both", "remove one of them")
        if not pulses:
            raise Refused("at least one pulse is required", "e.g. {axis: z}")
        if all(pulse.pgv_pga is not None for pulse in pulses):
            rule = "at least one pulse takes its PGV/PGA from the grid"
            raise Refused(rule, "remove its pgv_pga and set motion.pgv_pga")
        return pulses

    @field_validator("pgv_pga")
    @classmethod
    def _are_of_pulses(
        cls, pgv_pga: tuple[float, ...] | None, info: ValidationInfo
    ) -> tuple[float, ...] | None:
        pulses = info.data.get("pulses", ())  # none if they are refused themselves
        if pgv_pga is not None and pulses is None and info.data.get("files") is not None:
            raise Refused("a recorded motion has its own PGV/PGA", "remove motion.pgv_pga")
        if pgv_pga is None and pulses:
            raise Refused("pulses need a PGV/PGA", "give a value [s] or a grid")
        return pgv_pga

    @property
    def turns(self) -> bool:
        """Whether a pulse turns the table."""
        return any(pulse.axis in ("roll", "pitch", "yaw") for pulse in self.pulses or ())

    @model_validator(mode="after")
    def _is_given(self) -> TableMotionConfig:
        if self.files is None and self.pulses is None:
            raise Refused(
                "a table motion needs `files`, or `pulses` and `pgv_pga`", "give one of the two"
            )
        return self


MotionConfig = Annotated[
    PulseConfig | SinePulseConfig | RickerPulseConfig | RecordConfig | TableMotionConfig,
    Field(discriminator="kind"),
]
"""The motions of a study; a kind is a class here and one in `stages/motions/motion_grid.py`."""
