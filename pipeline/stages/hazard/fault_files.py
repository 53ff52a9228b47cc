"""Faults near a rock, and a ground-motion model as a table: two files of a user's.

Faults are ``name,magnitude,distance_km,rate_per_year`` and, to be shown, ``mechanism``: a row is
one kind of earthquake of a fault, how large it is, how near the surface projection of its rupture,
and how often a year it comes. A ground-motion model is
``magnitude,distance_km,pga_g,pga_log_sd,pgv_cm_s,pgv_log_sd``: medians and standard deviations of
natural logarithms, at every distance for every magnitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from pipeline.config.hazard_schema import Age
from pipeline.config.layers import Origin
from pipeline.config.outside import Row, refused, rows, short_text, table
from pipeline.config.paths import located
from pipeline.config.problems import InputError, Problem
from pipeline.config.sections import LARGEST_RATIO, LEAST_RATIO, Key, Refused
from pipeline.stages.hazard.hazard_model import LEVELS, UNITS
from pipeline.workflow.keys import digests_of
from pipeline.workflow.stage import FilesInput
from vsr_core.arrays import Array
from vsr_core.hazard.scenarios import GroundMotionTable

_Magnitude = Annotated[float, Field(ge=3, le=10)]
_LogSd = Annotated[float, Field(ge=0.05, le=2)]  # of published models 0.3 to 1
"""Models have 0.4 to 1."""

_MOST = 5_000
"""Faults, or rows of a table of a ground-motion model."""

STRONGEST = 4.0
"""Median PGA [g] of a ground-motion model, at most: most saturate near 1 g beside a rupture, one of
hard rock (Atkinson & Boore 2006) at 3.3 g, 1 km from an earthquake of magnitude 4.5."""

SATURATION = 1.5
"""How many times shaking may exceed that of any larger magnitude, or of any lesser distance: models
saturate near a rupture, and have reflections far from it."""


class Fault(Row):
    """A row of a table of faults."""

    name: str = Field(min_length=1, max_length=200, description="name of the fault")
    magnitude: _Magnitude = Field(description="moment magnitude of its earthquakes")
    distance_km: float = Field(ge=0, le=1000, description="distance of the rupture [km]")
    rate_per_year: float = Field(gt=0, le=10, description="earthquakes a year")
    mechanism: str = Field("", max_length=100, description="kind of faulting, for the page")

    @model_validator(mode="after")
    def _is_one_fault(self) -> Self:
        """Refuse 3 % of the world's earthquakes, of which each magnitude has 10^(8 - M)."""
        most = 10.0 ** (6.5 - self.magnitude)
        if self.rate_per_year > most:
            rule = f"a fault has at most {most:.2g} of magnitude {self.magnitude:g} a year"
            remedy = "a return period, or a rate in thousands of years? give a year's"
            raise Refused(rule, remedy, "rate_per_year", f"{self.rate_per_year:g}")
        return self

    @property
    def is_frequent(self) -> bool:
        """Whether few faults have so many earthquakes; M 7 comes at least once in 32 years."""
        return self.rate_per_year > 10.0 ** (5.5 - self.magnitude)


class Expected(Row):
    """A row of a table of a ground-motion model."""

    magnitude: _Magnitude = Field(description="moment magnitude")
    distance_km: float = Field(gt=0, le=1000, description="distance [km]")
    pga_g: float = Field(gt=0, le=STRONGEST, description="median PGA in g, and not in m/s2")
    pga_log_sd: _LogSd = Field(description="standard deviation of ln PGA")
    pgv_cm_s: float = Field(gt=0, le=LEVELS["PGV"][2], description="median PGV in cm/s")
    pgv_log_sd: _LogSd = Field(description="standard deviation of ln PGV")


@dataclass(frozen=True, eq=False)
class Faults(FilesInput):
    """Faults and the ground-motion model that a site names, read and checked.

    Attributes
    ----------
    model : GroundMotionTable, None for the equations
    """

    files: tuple[Path, ...]
    before: dict[str, str]
    faults: tuple[Fault, ...]
    model: GroundMotionTable | None

    def files_read(self) -> tuple[Path, ...]:
        return self.files

    def digests(self) -> dict[str, str]:
        return digests_of(self.files)


def find(
    faults: Annotated[str | None, Key("hazard.faults")],
    ground_motion: Annotated[str | None, Key("hazard.ground_motion")],
    age: Annotated[Age | None, Key("hazard.age")],
    origin: Origin,
) -> Faults:
    """What a site names; errors are reported before anything runs."""
    found: dict[str, Path] = {}
    for key, name in (("faults", faults), ("ground_motion", ground_motion)):
        if name is not None:
            at = f"hazard.{key}"
            found[key] = located(origin.folder_of(at), name, origin.file_of(at), at)
    if faults is not None and age is None:
        file, rule = origin.file_of("hazard.faults"), "the chance to survive faults is for an age"
        remedy = "give AGE=years AGE_SD=years (--age, --age-sd), or set the key"
        raise InputError(Problem(file, "hazard.age", "nothing", rule, remedy))
    files = tuple(found.values())
    return Faults(
        files,
        digests_of(files),
        _faults(found["faults"]) if "faults" in found else (),
        _model(found["ground_motion"]) if "ground_motion" in found else None,
    )


def _faults(path: Path) -> tuple[Fault, ...]:
    cells = table(path, short_text(path, _MOST))
    if not 1 <= len(cells) <= _MOST:
        rule = f"there are 1 to {_MOST:,} faults"
        raise refused(path, "", f"{len(cells)} rows", rule, "give one a row")
    return tuple(rows(path, Fault, cells, once=("name", "magnitude", "distance_km"), only=True))


def _model(path: Path) -> GroundMotionTable:
    cells = table(path, short_text(path, _MOST))
    if len(cells) > _MOST:
        raise refused(path, "", f"{len(cells)} rows", f"at most {_MOST:,}", "thin it out")
    found = rows(path, Expected, cells, once=("magnitude", "distance_km"), only=True)
    magnitudes = sorted({row.magnitude for row in found})
    distances = sorted({row.distance_km for row in found})
    whole = len(magnitudes) * len(distances)
    if min(len(magnitudes), len(distances)) < 2 or len(found) != whole:
        given = f"{len(found)} rows of {len(magnitudes)} magnitudes and {len(distances)} distances"
        rule = "it has every distance for every magnitude, two or more of each"
        raise refused(path, "magnitude, distance_km", given, rule, "fill the gaps")
    for row in found:
        ratio = UNITS["PGV"] * row.pgv_cm_s / (UNITS["PGA"] * row.pga_g)
        if not LEAST_RATIO <= ratio <= LARGEST_RATIO:
            rule = f"it is {LEAST_RATIO:g} to {LARGEST_RATIO:g} s, with PGA in g and PGV in cm/s"
            given = f"PGV/PGA of {ratio:.2g} s at M {row.magnitude:g}, {row.distance_km:g} km"
            raise refused(path, "pgv_cm_s", given, rule, "convert the units")
    found.sort(key=lambda row: (row.magnitude, row.distance_km))
    values = [
        (
            np.log(UNITS["PGA"] * row.pga_g),
            row.pga_log_sd,
            np.log(UNITS["PGV"] * row.pgv_cm_s),
            row.pgv_log_sd,
        )
        for row in found
    ]
    shape = len(magnitudes), len(distances), 4
    grid = np.array(values).reshape(shape)
    _check_course(path, grid)
    return GroundMotionTable(np.array(magnitudes), np.array(distances), grid)


def _check_course(path: Path, grid: Array) -> None:
    """Refuse medians that are larger at a farther distance or a lesser magnitude, or all alike."""
    nearer, weaker = np.minimum.accumulate(grid, axis=1), np.maximum.accumulate(grid, axis=0)
    courses = (
        (1, grid - nearer, "from the nearest to the farthest distance, shaking decreases"),
        (0, weaker - grid, "from the least to the largest magnitude, shaking increases"),
    )
    for axis, rise, rule in courses:
        for place, name in ((0, "pga_g"), (2, "pgv_cm_s")):
            if not np.ptp(grid[..., place], axis=axis).any():
                raise refused(path, name, "medians that stay the same", rule, "correct the column")
            if (most := np.exp(rise[..., place].max())) > SATURATION:
                given = f"medians that go the other way by {most:.3g} times"
                raise refused(path, name, given, rule, "correct the columns")
