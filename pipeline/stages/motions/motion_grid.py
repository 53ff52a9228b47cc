"""The ground motions of a study: rows of a grid, each at every PGA.

A row is one PGV/PGA of the cosine pulses or one record. Each kind of motion in the configuration
has a class here that makes its motions; `of_data` and `of_files` choose it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

from pipeline.config import in_si
from pipeline.config.layers import Origin, Site
from pipeline.config.motion_schema import (
    AxisPulseConfig,
    MotionConfig,
    PulseConfig,
    PulseGrid,
    RecordConfig,
    TableMotionConfig,
)
from pipeline.stages.motions import component_inputs, record_inputs, table_motions
from pipeline.stages.motions.record_inputs import Ready
from pipeline.workflow import keys
from pipeline.workflow.datasets import Stored, split
from pipeline.workflow.keys import AXIS_CODE, COMPONENT_CODE, RECORD_CODE, TABLE_CODE
from pipeline.workflow.stage import FilesInput
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse, RickerPulse, SinePulse
from vsr_core.motions.records.components import Components
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.motions.sampled import SampledMotion
from vsr_core.motions.six_axes import AxisPulse, AxisPulses
from vsr_core.source import tracing

Shape = type[CosinePulse] | type[SinePulse] | type[RickerPulse]

SHAPES: dict[str, Shape] = {
    "cosine_pulse": CosinePulse,
    "sine_pulse": SinePulse,
    "ricker_pulse": RickerPulse,
}
"""Pulses that are told by their peaks, by their kinds."""


class Cell(NamedTuple):
    """Place of a run in the grid: number of its row, and PGA [g]."""

    row: int
    pga: float


class Shaking(Protocol):
    """The motions of a study; small enough to travel to a worker."""

    @property
    def dimension(self) -> str:
        """Name of the dimension of the rows."""

    @property
    def rows(self) -> tuple[Any, ...]:
        """Coordinate of the rows."""

    @property
    def pgv_pga(self) -> tuple[float, ...]:
        """PGV/PGA of each row [s], ascending."""

    @property
    def pga(self) -> tuple[float, ...]:
        """PGA of each column [g]."""

    def motion(self, cell: Cell) -> GroundMotion:
        """The motion of a run."""

    def token(self, cell: Cell) -> bytes:
        """What tells the motion of a run from those of all others of its kind."""

    def identity(self) -> Any:
        """What all its motions share, for the identity of their runs."""


def cells(shaking: Shaking) -> tuple[Cell, ...]:
    """All cells of the grid."""
    return tuple(each_cell(shaking))


def each_cell(shaking: Shaking) -> Iterator[Cell]:
    """The cells of the grid one by one, where there may be millions."""
    for row in range(len(shaking.rows)):
        for pga in shaking.pga:
            yield Cell(row, pga)


def one_way(shaking: Shaking) -> bool:
    """Whether all motions are along one axis, as proofs of runs need it."""
    return all(motion.columns == 1 for motion in strongest(shaking))


def count(shaking: Shaking) -> int:
    """Count the cells of the grid."""
    return len(shaking.rows) * len(shaking.pga)


def strongest(shaking: Shaking) -> list[GroundMotion]:
    """The motions of largest PGA.

    Returns
    -------
    list of GroundMotion, every record, or the shortest and the longest pulse
    """
    rows = range(len(shaking.rows)) if shaking.dimension == "record" else (0, -1)
    return [shaking.motion(Cell(row, shaking.pga[-1])) for row in rows]


@dataclass(frozen=True)
class Pulses:
    """Cosine pulses."""

    pgv_pga: tuple[float, ...]
    pga: tuple[float, ...]
    dimension: ClassVar = "pgv_pga"

    @property
    def rows(self) -> tuple[float, ...]:
        return self.pgv_pga

    def motion(self, cell: Cell) -> GroundMotion:
        """The motion of a run."""
        return CosinePulse(in_si.acceleration(cell.pga), self.pgv_pga[cell.row])

    def token(self, cell: Cell) -> bytes:
        return struct.pack("<2d", self.pgv_pga[cell.row], cell.pga)

    def identity(self) -> Any:
        return "cosine_pulse"


@dataclass(frozen=True)
class ShapedPulses(Pulses):
    """Pulses of another shape than the cosine's."""

    kind: str

    def motion(self, cell: Cell) -> GroundMotion:
        """The motion of a run."""
        return SHAPES[self.kind](in_si.acceleration(cell.pga), self.pgv_pga[cell.row])

    def identity(self) -> Any:
        """Kind and code, which tell these from other pulses of the same peaks."""
        shape = SHAPES[self.kind]
        code = tracing.reached((f"{shape.__module__}:{shape.__name__}",))
        return [self.kind, keys.digest(code)]


@dataclass(frozen=True)
class TablePulses(Pulses):
    """Cosine pulses on axes of a table, all at once; a row is the PGV/PGA of those without one."""

    pulses: tuple[AxisPulseConfig, ...]

    def motion(self, cell: Cell) -> GroundMotion:
        row, pga = self.pgv_pga[cell.row], cell.pga
        return AxisPulses(
            tuple(
                AxisPulse(
                    pulse.axis, in_si.acceleration(pulse.pga_ratio * pga), pulse.pgv_pga or row
                )
                for pulse in self.pulses
            )
        )

    def identity(self) -> Any:
        parts = [pulse.model_dump(mode="json") for pulse in self.pulses]
        return ["table_pulses", parts, keys.digest(tracing.reached(AXIS_CODE))]


@dataclass(frozen=True, eq=False)
class Records:
    """Recorded motions, after processing, and scaled to each PGA."""

    rows: tuple[str, ...]
    traces: tuple[Trace, ...]
    pgv_pga: tuple[float, ...]
    pga: tuple[float, ...]
    dimension: ClassVar = "record"

    def motion(self, cell: Cell) -> GroundMotion:
        return RecordedMotion.scaled(self.traces[cell.row], cell.pga)

    def token(self, cell: Cell) -> bytes:
        trace = RecordedMotion.scaled(self.traces[cell.row], cell.pga).trace
        step = struct.pack("<d", trace.interval)
        return keys.digest_bytes(step, trace.acceleration.tobytes()).encode()

    def identity(self) -> Any:
        return ["record", keys.digest(tracing.reached(RECORD_CODE))]


@dataclass(frozen=True, eq=False)
class ComponentRecords:
    """Recorded motions along several axes, after processing, and scaled to each PGA."""

    rows: tuple[str, ...]
    motions: tuple[Components, ...]
    pgv_pga: tuple[float, ...]
    pga: tuple[float, ...]
    dimension: ClassVar = "record"

    def motion(self, cell: Cell) -> GroundMotion:
        return self.motions[cell.row].scaled(cell.pga)

    def token(self, cell: Cell) -> bytes:
        one = self.motions[cell.row]
        told = struct.pack("<3d", one.interval, one.azimuth, cell.pga)
        return keys.digest_bytes(told, one.acceleration.tobytes()).encode()

    def identity(self) -> Any:
        return ["components", keys.digest(tracing.reached(COMPONENT_CODE))]

    def level(self) -> ComponentRecords:
        """The same without the vertical components."""
        return replace(self, motions=tuple(one.level() for one in self.motions))


@dataclass(frozen=True, eq=False)
class Tables:
    """Motions of a table in up to six axes, all of them scaled together to each PGA."""

    rows: tuple[str, ...]
    motions: tuple[SampledMotion, ...]
    pgv_pga: tuple[float, ...]
    pga: tuple[float, ...]
    dimension: ClassVar = "record"

    def motion(self, cell: Cell) -> SampledMotion:
        whole = self.motions[cell.row]
        return whole.scaled(in_si.acceleration(cell.pga) / whole.peak_acceleration)

    def token(self, cell: Cell) -> bytes:
        motion = self.motion(cell)
        return keys.digest_bytes(motion.time.tobytes(), motion.samples.tobytes()).encode()

    def identity(self) -> Any:
        return ["table", keys.digest(tracing.reached(TABLE_CODE))]


class MotionData(Stored):
    """The motions as a product: pulses by their peaks, records as processed."""

    FILE = "motions.nc"


@dataclass(frozen=True, eq=False)
class MotionFiles(FilesInput):
    """Files of motions, read and checked.

    Attributes
    ----------
    names : tuple of str, of the files in keys
    records : tuple of Ready, or tables : names, motions and PGV/PGA of a table's
    """

    paths: tuple[Path, ...]
    names: tuple[str, ...]
    before: dict[str, str]
    records: tuple[Ready, ...] = ()
    tables: table_motions.Loaded | None = None

    def files_read(self) -> tuple[Path, ...]:
        return self.paths

    def digests(self) -> dict[str, str]:
        return dict(zip(self.names, map(keys.digest_file, self.paths), strict=True))


def find(motion: MotionConfig, origin: Origin) -> MotionFiles | None:
    """The files of a site's motions; what cannot be used is refused."""
    if isinstance(motion, RecordConfig):
        if motion.files is None:
            paths, load = component_inputs.find(origin, motion), component_inputs.load
        else:
            paths, load = record_inputs.find(origin, motion.files), record_inputs.load
        response = record_inputs.response_file(origin, motion)
        read = tuple(path for path in (*paths, response) if path is not None)
        known = {path: keys.digest_file(path) for path in read}
        names = keys.names_of(read)
        if motion.files is None:  # which component a file is counts, whatever it is called
            names = tuple(f"{n}/{path.name}" for n, path in enumerate(read))
        before = {name: known[path] for name, path in zip(names, read, strict=True)}
        return MotionFiles(read, names, before, load(origin, motion, paths, known))
    if isinstance(motion, TableMotionConfig) and motion.files is not None:
        paths = record_inputs.find(origin, motion.files)
        before, tables = keys.digests_of(paths), table_motions.of_files(origin, paths)
        return MotionFiles(tuple(paths), keys.names_of(paths), before, tables=tables)
    return None


def of_data(motion: MotionConfig, stored: MotionData) -> Shaking:
    """The motions of a study; records as the stage of motions has made them."""
    pulses = _pulses(motion)
    if pulses is not None:
        return pulses
    data = stored.data
    if isinstance(motion, TableMotionConfig):
        return Tables(*table_motions.of_dataset(data), motion.pga)
    ratios = tuple(data["pgv_pga"].values.tolist())
    names = tuple(map(str, data["record"].values))
    if "component_acceleration" in data:
        motions = tuple(
            Components(
                one["component_acceleration"].values.copy(),
                one["interval"].item(),
                in_si.angle(one["azimuth"].item()),
            )
            for one in split(data, "record_size")
        )
        return ComponentRecords(names, motions, ratios, motion.pga)
    traces = tuple(
        Trace(one["acceleration"].values.copy(), one["interval"].item())
        for one in split(data, "record_size")
    )
    return Records(names, traces, ratios, motion.pga)


def of_files(motion: MotionConfig, files: MotionFiles | None) -> Shaking:
    """The motions of a study; records from their files, before any product is made."""
    pulses = _pulses(motion)
    if pulses is not None:
        return pulses
    assert files is not None
    if files.tables is not None:
        return Tables(*files.tables, motion.pga)
    names = tuple(one.name for one in files.records)
    ratios = tuple(one.measures.pgv_pga for one in files.records)
    motions = tuple(one.components for one in files.records if one.components is not None)
    if motions:
        return ComponentRecords(names, motions, ratios, motion.pga)
    return Records(names, tuple(one.trace for one in files.records), ratios, motion.pga)


def of_site(site: Site) -> Shaking:
    """The motions that a site asks for."""
    return of_files(site.config.motion, find(site.config.motion, site.origin))


def _pulses(motion: MotionConfig) -> Shaking | None:
    """The motions that are told by the configuration alone."""
    if isinstance(motion, PulseConfig):
        return Pulses(motion.pgv_pga, motion.pga)
    if isinstance(motion, PulseGrid):
        return ShapedPulses(motion.pgv_pga, motion.pga, motion.kind)
    if isinstance(motion, TableMotionConfig) and motion.pulses:
        assert motion.pgv_pga is not None
        return TablePulses(motion.pgv_pga, motion.pga, motion.pulses)
    return None
