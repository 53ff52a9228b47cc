"""NetCDF: variables along a time coordinate whose ``units`` are those of an acceleration."""

from __future__ import annotations

from typing import Any

import netCDF4
import numpy as np

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Record, factor, is_acceleration, stated
from vsr_core.motions.records.record_checks import evenly

MAGIC = (b"CDF", b"\x89HDF")


def read(content: bytes, component: str | None, unit: str | None) -> Record:
    """The accelerations along ``time`` in a file's content, one channel per variable.

    Raises
    ------
    InvalidInput
        If there is no time in seconds or no such variable, or the time steps are uneven.
    """
    with netCDF4.Dataset("record.nc", memory=content) as data:
        if "time" not in data.variables or data["time"].ndim != 1:
            raise InvalidInput(
                f"a NetCDF file with the variables {', '.join(data.variables)[:80]}",
                "one of them is the coordinate time",
                "name it so",
            )
        _check_seconds(data["time"])
        along = [
            name
            for name, variable in data.variables.items()
            if name != "time" and variable.dimensions == data["time"].dimensions
        ]
        units = {name: getattr(data[name], "units", None) for name in along}
        named = [name for name in along if is_acceleration(units[name] or "")]
        wanted = named if component is None else [name for name in along if name == component]
        if not wanted:
            raise InvalidInput(
                f"a NetCDF file with {', '.join(along) or 'nothing'} along time",
                "an acceleration has units such as m s-2",
                "set its units, or name it as motion.component with motion.unit",
            )
        if len({units[name] for name in wanted}) > 1:
            raise InvalidInput(
                f"variables {', '.join(wanted)} in several units",
                "they share one",
                "name one of them as motion.component",
            )
        unit_read = stated(units[wanted[0]], unit)
        times = np.ma.filled(data["time"][:].astype(np.float64), np.nan)
        columns = [np.ma.filled(data[name][:].astype(np.float64), np.nan) for name in wanted]
        station = str(getattr(data, "station", ""))
        title = str(getattr(data, "title", "")) or "no title"
    values, interval, repairs = evenly(times, np.column_stack(columns) * factor(unit_read))
    values = values[:, 0] if len(wanted) == 1 else values
    source = f"NetCDF file: {title}"
    return Record(values, interval, tuple(wanted), station, source, unit_read, repairs)


def _check_seconds(time: Any) -> None:
    units = str(getattr(time, "units", ""))
    if units.split(" since ")[0].strip() not in ("s", "sec", "second", "seconds"):
        raise InvalidInput(
            f"times in {units or 'no unit'}", "they are in s", "set the units of time to s"
        )
