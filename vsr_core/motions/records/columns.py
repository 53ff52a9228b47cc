"""Columns given beside their times: plain tables, and NetCDF with the units that it states.

A table is a line of names, then a column of times and one or more of acceleration. A name may hold
its unit: ``acceleration [m/s2]``, ``acc (g)``, ``acc_g``. NetCDF holds variables along ``time``.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions import even_times
from vsr_core.motions.named_columns import Column, of_netcdf, of_text
from vsr_core.motions.records.record import (
    Record,
    check_sampling,
    factor,
    is_acceleration,
    is_raw,
    side_by_side,
    stated,
)


def read_table(text: str, component: str | None, unit: str | None) -> Record:
    """The accelerations in a table's text.

    Raises
    ------
    InvalidInput
        If times or accelerations are not there, or the time steps are uneven.
    """
    columns = [_by_suffix(column) for column in of_text(text)]
    times = [column for column in columns if column.name.lower() in ("time", "t")]
    if len(times) != 1:
        given = f"a table with the columns {', '.join(one.name for one in columns)[:80] or 'none'}"
        rule = "one of them is named time, in seconds"
        raise InvalidInput(given, rule, "name the columns in the first line")
    others = [column for column in columns if column is not times[0]]
    return on_times(times[0], others, component, unit, source="table of columns")


def _by_suffix(column: Column) -> Column:
    """The column with the unit that ends its name, as in ``acc_g``, if it states no other."""
    head, mark, tail = column.name.rpartition("_")
    ends = mark and column.unit is None and is_acceleration(tail) and not _OTHER.search(head)
    return Column(head, tail, column.values) if ends else column


MAGIC = (b"CDF", b"\x89HDF")


def read_netcdf(content: bytes, component: str | None, unit: str | None) -> Record:
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
    record = on_times(
        time._replace(unit=time.unit or ""),
        others,
        component,
        unit,
        station=file.attributes.get("station", ""),
        source=f"NetCDF file: {file.attributes.get('title') or 'no title'}",
    )
    left = f"left out, as not numbers along time alone: {', '.join(file.others)}"
    return replace(record, repairs=(*record.repairs, left)) if file.others else record


_PARTS = re.compile(r"[^\s\[(\])]+")
"""Words of a name and in its brackets."""

_SECONDS = ("s", "sec", "second", "seconds")


def on_times(
    time: Column,
    others: list[Column],
    component: str | None,
    unit: str | None,
    *,
    station: str = "",
    source: str,
) -> Record:
    """The record of the accelerations among columns.

    Parameters
    ----------
    time : Column [s]
    component : str or None
        Name of the one to take; without it, those in a unit of acceleration or, if there is none,
        all that state no unit where ``unit`` is given, or else a single one without a unit (or in
        counts or volts, which is refused with the reason); none that is named after velocity or
        displacement. Other columns are told among the repairs.

    Raises
    ------
    InvalidInput
        If times are not in seconds or in even steps, or accelerations are not there or of several
        units.
    """
    check_seconds(time.unit)
    wanted = _wanted(others, component, unit)
    names, units, values = zip(*wanted, strict=True)
    if len(set(units)) > 1:
        given = f"{', '.join(names)} in {', '.join(map(str, units))}"
        raise InvalidInput(given, "they share a unit", "name one of them as motion.component")
    name = stated(units[0], unit)
    for column in names:
        parts = [part for word in _PARTS.findall(column) for part in (word, _after_mark(word))]
        others_stated = [one for one in parts if is_acceleration(one)]
        if any(factor(one) != factor(name) for one in others_stated):
            given, rule = f"{column} in {others_stated[0]} and in {name}", "it has one unit"
            raise InvalidInput(given, rule, "leave the other out of its name")
    even, interval, repairs = _evenly(time.values, side_by_side(values) * factor(name))
    start = float(time.values[0])
    more = [one.name for one in others if one.name not in names and not _OTHER.search(one.name)]
    if component is None and more:
        repairs += (f"left out, as {name} is the unit of others: {', '.join(more)}",)
    return Record(even, interval, names, station, source, name, repairs, start)


def _after_mark(word: str) -> str:
    """What follows the mark in acc_cm/s2; a_g is a symbol of Eurocode 8."""
    tail = word.rpartition("_")[2]
    return tail if "/" in tail else ""


def check_seconds(unit: str | None) -> None:
    """Refuse times that state another unit.

    Raises
    ------
    InvalidInput
    """
    if unit is not None and unit.split(" since ")[0].strip().lower() not in _SECONDS:
        given = f"times in {unit or 'no unit'}"
        raise InvalidInput(given, "they are in s", "set the unit of time to s")


_OTHER = re.compile(r"(?<![^\W_])(vel|disp|speed)|^v[xyz]$", re.IGNORECASE)
"""What names of columns of another quantity have: a word that begins so, or vx; V is vertical."""


def _wanted(columns: list[Column], component: str | None, unit: str | None) -> list[Column]:
    listed = ", ".join(column.name for column in columns) or "nothing"
    if component is not None:
        found = [column for column in columns if column.name == component]
        if len(found) != 1:
            raise InvalidInput(
                f"no column {component!r}", f"the columns are {listed}", "name one of them"
            )
        return found
    bare = [one for one in columns if one.unit is None or is_raw(one.unit)]
    if len(columns) == len(bare) == 1 and not _OTHER.search(bare[0].name):
        return columns
    accelerations = [column for column in columns if is_acceleration(column.unit or "")]
    if unit is not None and not accelerations:
        accelerations = [one for one in columns if one.unit is None and not _OTHER.search(one.name)]
    if not accelerations:
        given = f"{listed} along time without a unit of acceleration"
        rule = "one of them is the acceleration, with units such as m s-2"
        raise InvalidInput(given, rule, "name it as motion.component, and its unit as motion.unit")
    return accelerations


def _evenly(times: Array, values: Array) -> tuple[Array, float, tuple[str, ...]]:
    """Values on an even grid of times, nan where a step was left out; interval [s], repairs."""
    if len(times) < 2 or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        rule, remedy = "each is later than the one before", "sort them and drop those that repeat"
        raise InvalidInput(f"{len(times)} times that are not increasing numbers", rule, remedy)
    span = times[-1] - times[0]
    step = float(np.median(np.diff(times)))
    check_sampling(step, float(span) / step)
    places, interval = even_times.places(times)
    if len(places) == places[-1] + 1:
        return values, interval, ()
    filled = np.full((int(places[-1]) + 1, *values.shape[1:]), np.nan)
    filled[places] = values
    lost = len(filled) - len(places)
    return filled, interval, (f"{lost} time steps were left out in the file",)
