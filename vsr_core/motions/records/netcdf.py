"""NetCDF: variables along a time coordinate whose ``units`` are those of an acceleration."""

from __future__ import annotations

from typing import Any

import netCDF4
import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Record, is_acceleration
from vsr_core.motions.records.timed_columns import on_times

MAGIC = (b"CDF", b"\x89HDF")


def read(content: bytes, component: str | None, unit: str | None) -> Record:
    """The accelerations along ``time`` in a file's content, one channel per variable.

    Parameters
    ----------
    content : bytes
    component : str or None
        Variable to take; without one, those whose units are of acceleration.
    unit : str or None
        Of a variable that states none.

    Returns
    -------
    Record

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
        unit_of_time = str(getattr(data["time"], "units", ""))
        if unit_of_time.split(" since ")[0].strip() not in ("s", "sec", "second", "seconds"):
            raise InvalidInput(
                f"times in {unit_of_time or 'no unit'}",
                "they are in s",
                "set the units of time to s",
            )
        along = {
            name: getattr(variable, "units", None)
            for name, variable in data.variables.items()
            if name != "time" and variable.dimensions == data["time"].dimensions
        }
        wanted = [
            (name, units, _filled(data[name]))
            for name, units in along.items()
            if (is_acceleration(units or "") if component is None else name == component)
        ]
        if not wanted:
            raise InvalidInput(
                f"a NetCDF file with {', '.join(along) or 'nothing'} along time",
                "an acceleration has units such as m s-2",
                "set its units, or name it as motion.component with motion.unit",
            )
        station, title = str(getattr(data, "station", "")), str(getattr(data, "title", ""))
        source = f"NetCDF file: {title or 'no title'}"
        return on_times(_filled(data["time"]), wanted, unit, station=station, source=source)


def _filled(variable: Any) -> Array:
    """Values of a variable, nan where one is missing."""
    return np.asarray(np.ma.filled(variable[:].astype(np.float64), np.nan))
