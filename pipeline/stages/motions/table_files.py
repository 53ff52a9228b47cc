"""Files of a table's motion: time and up to six axes, as CSV or NetCDF.

CSV has a line of names, with units in brackets where they are not seconds, metres and radians:
``time [s], x [mm], y, z, roll [degree], pitch, yaw``. In NetCDF the variables have these names and
their ``units``. An axis that is not there does not move.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import xarray as xr

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.sampled import SampledMotion, sampled
from vsr_core.motions.six_axes import AXES

TIME = "time"

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
ANGLES = {"rad": 1.0, "degree": 0.017453292519943295, "mrad": 0.001}
ALIASES = {"deg": "degree", "degrees": "degree", "radian": "rad", "meter": "m", "metre": "m"}
SECONDS = {"s": 1.0, "ms": 0.001}

_NAME = re.compile(r"\s*(\w+)\s*(?:\[\s*([^\]]+?)\s*\])?\s*")

Columns = dict[str, tuple["Array", str | None]]


def load(path: Path) -> SampledMotion:
    """The motion in a file, checked.

    Raises
    ------
    InvalidInput
        If the file cannot be read, a name or unit is not known, or it is no motion.
    """
    try:
        columns = _netcdf(path) if path.suffix.lower() in (".nc", ".nc4") else _csv(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInput(
            f"{path.name}, which cannot be read ({error})",
            "a table's motion is a CSV or NetCDF file",
            "check the path and the file",
        ) from None
    _check_names(path.name, columns, (TIME, *AXES))
    time = _scaled(TIME, columns[TIME], SECONDS)
    axes = [
        _scaled(axis, columns[axis], LENGTHS if axis in "xyz" else ANGLES)
        if axis in columns
        else np.zeros_like(time)
        for axis in AXES
    ]
    return sampled(time, np.column_stack(axes))


def _check_names(file: str, columns: Columns, known: tuple[str, ...]) -> None:
    rule = f"the names are {', '.join(known)}"
    strange = [name for name in columns if name not in known]
    if strange:
        raise InvalidInput(f"{file} with a column {strange[0]!r}", rule, "rename or remove it")
    if TIME not in columns or len(columns) < 2:
        what = "an axis" if TIME in columns else TIME
        raise InvalidInput(f"{file} without {what}", rule, "add it")


def _scaled(name: str, column: tuple[Array, str | None], units: dict[str, float]) -> Array:
    values, unit = column
    unit = ALIASES.get(unit or "", unit)
    if unit is None:
        return values
    if unit not in units:
        raise InvalidInput(f"{name} in {unit!r}", f"its unit is {', '.join(units)}", "convert it")
    return units[unit] * values


def _csv(path: Path) -> Columns:
    lines = (
        line
        for line in path.read_text(encoding="utf-8-sig").splitlines()
        if line.strip() and not line.startswith("#")
    )
    names, *rows = list(csv.reader(lines)) or [[]]
    heads = [_NAME.fullmatch(name) for name in names]
    found = [
        head.groups() if head else (name, None) for head, name in zip(heads, names, strict=True)
    ]
    if len({name for name, _ in found}) < len(found):
        raise InvalidInput(
            f"{path.name} with a column twice", "each name is there once", "remove one"
        )
    uneven = [n for n, row in enumerate(rows) if len(row) != len(names)]
    if uneven:
        raise InvalidInput(
            f"{path.name} with {len(rows[uneven[0]])} values in row {uneven[0] + 2}",
            f"each row has {len(names)}",
            "correct it",
        )
    try:
        values = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
    except ValueError as error:
        raise InvalidInput(f"{path.name}: {error}", "values are numbers", "correct it") from None
    return {name: (values[:, i], unit) for i, (name, unit) in enumerate(found)}


def _netcdf(path: Path) -> Columns:
    with xr.open_dataset(path, engine="netcdf4", decode_times=False) as data:
        if any(variable.dims != data[TIME].dims for variable in data.values() if TIME in data):
            raise InvalidInput(
                f"{path.name} with variables of several dimensions",
                "all are along the time",
                "leave out the others",
            )
        return {
            str(name): (np.asarray(variable.values, np.float64), variable.attrs.get("units"))
            for name, variable in data.variables.items()
        }
