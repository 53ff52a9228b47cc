"""Plain tables: a line of names, then a column of times and one or more of acceleration.

A name may hold its unit: ``acceleration [m/s2]``, ``acc (g)``, ``acc_g``.
"""

from __future__ import annotations

from vsr_core.errors import InvalidInput
from vsr_core.motions.named_columns import Column, of_text
from vsr_core.motions.records.record import Record, is_acceleration
from vsr_core.motions.records.timed_columns import on_times


def read(text: str, component: str | None, unit: str | None) -> Record:
    """The accelerations in a table's text.

    Raises
    ------
    InvalidInput
        If times or accelerations are not there, or the time steps are uneven.
    """
    columns = [_by_suffix(column) for column in of_text(text)]
    times = [column for column in columns if column.name.lower() in ("time", "t")]
    if len(times) != 1:
        raise InvalidInput(
            f"a table with the columns {', '.join(one.name for one in columns)[:80] or 'none'}",
            "one of them is named time, in seconds",
            "name the columns in the first line",
        )
    others = [column for column in columns if column is not times[0]]
    return on_times(times[0], others, component, unit, source="table of columns")


def _by_suffix(column: Column) -> Column:
    """The column with the unit that ends its name, as in ``acc_g``."""
    head, mark, tail = column.name.rpartition("_")
    return Column(head, tail, column.values) if mark and is_acceleration(tail) else column
