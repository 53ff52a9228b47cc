"""Files of a table's motion: time and up to six axes, as CSV or NetCDF.

CSV has a line of names, with units in brackets where they are not seconds, metres and radians:
``time [s], x [mm], y, z, roll [degree], pitch, yaw``. In NetCDF the variables have these names and
their ``units``. An axis that is not there does not move.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.named_columns import Column, of_netcdf, of_text
from vsr_core.motions.sampled import SampledMotion, sampled
from vsr_core.motions.six_axes import AXES

TIME = "time"

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
ANGLES = {"rad": 1.0, "degree": 0.017453292519943295, "mrad": 0.001}
ALIASES = {"deg": "degree", "degrees": "degree", "radian": "rad", "meter": "m", "metre": "m"}
SECONDS = {"s": 1.0, "ms": 0.001}

Columns = dict[str, Column]


def load(path: Path) -> SampledMotion:
    """The motion in a file, checked."""
    try:
        columns = _columns(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInput(
            f"{path.name}, which cannot be read ({error})",
            "a table's motion is a CSV or NetCDF file",
            "check the path and the file",
        ) from None
    _check_names(path.name, columns, (TIME, *AXES))
    time = _scaled(columns[TIME], SECONDS)
    axes = [
        _scaled(columns[axis], LENGTHS if axis in "xyz" else ANGLES)
        if axis in columns
        else np.zeros_like(time)
        for axis in AXES
    ]
    return sampled(time, np.column_stack(axes))


def _columns(path: Path) -> Columns:
    """The columns of a file by their names."""
    if path.suffix.lower() in (".nc", ".nc4"):
        found, others, _ = of_netcdf(path.read_bytes())
        if others:
            raise InvalidInput(
                f"{path.name} with variables of several dimensions",
                "all are along the time",
                "leave out the others",
            )
    else:
        found = of_text(path.read_text(encoding="utf-8-sig"))
    columns = {column.name: column for column in found}
    if len(columns) < len(found):
        raise InvalidInput(
            f"{path.name} with a column twice", "each name is there once", "remove one"
        )
    return columns


def _check_names(file: str, columns: Columns, known: tuple[str, ...]) -> None:
    rule = f"the names are {', '.join(known)}"
    strange = [name for name in columns if name not in known]
    if strange:
        raise InvalidInput(f"{file} with a column {strange[0]!r}", rule, "rename or remove it")
    if TIME not in columns or len(columns) < 2:
        what = "an axis" if TIME in columns else TIME
        raise InvalidInput(f"{file} without {what}", rule, "add it")


def _scaled(column: Column, units: dict[str, float]) -> Array:
    unit = ALIASES.get(column.unit or "", column.unit)
    if unit is None:
        return column.values
    if unit not in units:
        raise InvalidInput(
            f"{column.name} in {unit!r}", f"its unit is {', '.join(units)}", "convert it"
        )
    return units[unit] * column.values
