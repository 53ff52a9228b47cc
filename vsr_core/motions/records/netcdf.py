"""NetCDF: variables along a time coordinate whose ``units`` are those of an acceleration."""

from __future__ import annotations

from vsr_core.motions.named_columns import of_netcdf
from vsr_core.motions.records.record import Record
from vsr_core.motions.records.timed_columns import on_times

MAGIC = (b"CDF", b"\x89HDF")


def read(content: bytes, component: str | None, unit: str | None) -> Record:
    """The accelerations along ``time`` in a file's content, one channel per variable.

    Parameters
    ----------
    component, unit : str or None
        See ``on_times``; times must state their unit.

    Raises
    ------
    InvalidInput
        If there is no time in seconds or no such variable, or the time steps are uneven.
    """
    file = of_netcdf(content)
    time = next(column for column in file.columns if column.name == "time")
    others = [column for column in file.columns if column is not time]
    return on_times(
        time._replace(unit=time.unit or ""),
        others,
        component,
        unit,
        station=file.attributes.get("station", ""),
        source=f"NetCDF file: {file.attributes.get('title') or 'no title'}",
    )
