"""Plain tables: a line of names, then a column of times and one or more of acceleration.

A name may hold its unit: ``acceleration [m/s2]``, ``acc (g)``, ``acc_g``.
"""

from __future__ import annotations

import re

import numpy as np

from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.record import Record, is_acceleration
from vsr_core.motions.records.timed_columns import on_times

_BRACKETS = re.compile(r"^(.*?)\s*[\[(]([^\])]*)[\])]\s*$")
_TIMES = ("time", "t")
_SECONDS = (None, "s", "sec", "seconds", "second")


def read(text: str, component: str | None, unit: str | None) -> Record:
    """The accelerations in a table's text.

    Parameters
    ----------
    text : str
    component : str or None
        Column to take; without one, those whose name holds a unit of acceleration or, if there is
        none, a single column besides the times.
    unit : str or None
        Of a column that states none.

    Returns
    -------
    Record

    Raises
    ------
    InvalidInput
        If times or accelerations are not there, or the time steps are uneven.
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    head, *rows = lines or [""]
    separator = next((mark for mark in ",;\t" if mark in head), None)
    names = [_name(word) for word in head.split(separator)]
    clock = [i for i, (name, _) in enumerate(names) if name.lower() in _TIMES]
    if len(clock) != 1 or names[clock[0]][1] not in _SECONDS:
        raise InvalidInput(
            f"a table with the columns {', '.join(name for name, _ in names)[:80] or 'none'}",
            "one of them is named time, in seconds",
            "name the columns in the first line",
        )
    table = _numbers(rows, separator, len(names))
    others = [i for i in range(len(names)) if i != clock[0]]
    wanted = [(*names[i], table[:, i]) for i in _wanted(names, others, component)]
    return on_times(table[:, clock[0]], wanted, unit, station="", source="table of columns")


def _name(word: str) -> tuple[str, str | None]:
    """A column's name without its unit, and the unit."""
    word = word.strip().strip('"')
    found = _BRACKETS.match(word)
    if found:
        return found[1], found[2].strip()
    head, mark, tail = word.rpartition("_")
    if mark and is_acceleration(tail):
        return head, tail
    return word, None


def _wanted(
    names: list[tuple[str, str | None]], others: list[int], component: str | None
) -> list[int]:
    listed = ", ".join(names[i][0] for i in others)
    if component is not None:
        found = [i for i in others if names[i][0] == component]
        if len(found) != 1:
            raise InvalidInput(
                f"no column {component!r}", f"the columns are {listed}", "name one of them"
            )
        return found
    accelerations = [i for i in others if is_acceleration(names[i][1] or "")]
    if accelerations or len(others) == 1:
        return accelerations or others
    raise InvalidInput(
        f"columns {listed} without a unit of acceleration",
        "one of them is the acceleration",
        "name it as motion.component, and its unit as motion.unit",
    )


def _numbers(lines: list[str], separator: str | None, width: int) -> Array:
    """All columns, shape (n, width); an empty cell is not a number."""
    rows = []
    for place, line in enumerate(lines, start=2):
        cells = line.split(separator)
        try:
            rows.append([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError:
            raise InvalidInput(
                f"row {place} of a table, {line.strip()[:40]!r}", "cells are numbers", "correct it"
            ) from None
        if len(cells) != width:
            raise InvalidInput(
                f"row {place} of a table, with {len(cells)} cells",
                f"each row has {width}",
                "correct it",
            )
    return np.array(rows, dtype=np.float64).reshape(-1, width)
