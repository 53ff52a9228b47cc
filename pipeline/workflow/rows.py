"""Rows of stored runs, and the checksum by which one that was damaged on disk is known."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from typing import Any, Generic, NamedTuple, TypeVar, get_type_hints

from vsr_core.outcome import DecidedBy, StopReason

Row = TypeVar("Row", bound="RunRow | TerrainRow | LineRow | DisplacementRow | StepRow")


class RunRow(NamedTuple):
    """A stored run; the numbers mean what ``vsr_core.outcome.Response`` says.

    A run that crashed has a key and an outcome only.
    """

    key: bytes
    outcome: int
    decided_by: int = int(DecidedBy.SIMULATION)
    peak_tilt: float | None = None
    final_tilt: float | None = None
    slip: float | None = None
    steps: int = 0


class TerrainRow(NamedTuple):
    """A stored run on a terrain, up to where its outcome is decided: a ``RunRow`` and what follows.

    ``air_share`` is as ``vsr_core.run.movement`` says.
    """

    key: bytes
    outcome: int
    decided_by: int = int(DecidedBy.SIMULATION)
    peak_tilt: float | None = None
    final_tilt: float | None = None
    slip: float | None = None
    steps: int = 0
    air_share: float | None = None


class LineRow(NamedTuple):
    """All runs of a row of the grid, as ``pipeline.stages.runs.lines`` packs them.

    Attributes
    ----------
    outcome : int, largest code among its runs; where its worker died, there is nothing else
    """

    key: bytes
    outcome: int
    packed: bytes = b""


class DisplacementRow(NamedTuple):
    """A stored displacement run, with its trajectory as ``trajectory_packing`` packs it.

    A run that crashed has a key and an outcome only.
    """

    key: bytes
    outcome: int
    peak_tilt: float | None = None
    slip: float | None = None
    steps: int = 0
    stop_reason: int = int(StopReason.UNDONE)
    trajectory: bytes = b""


class StepRow(NamedTuple):
    """What was measured for a time step on one PGV/PGA: ``vsr_core.run.time_step.Row``.

    Attributes
    ----------
    numbers : bytes, its errors and steps, one after the other
    """

    key: bytes
    exact: int
    reference: float | None
    numbers: bytes


TABLES: dict[type, str] = {
    RunRow: "runs",
    TerrainRow: "terrain_runs",
    LineRow: "lines_of_runs",
    DisplacementRow: "displacement_runs",
    StepRow: "time_step_rows",
}
"""Table of the database for each kind of row."""

_COLUMNS: dict[Any, str] = {bytes: "BLOB", int: "INTEGER", float | None: "REAL"}
_PACKED = {"INTEGER": "q", "REAL": "d"}


class Layout(Generic[Row]):
    """How rows of a kind are kept: in which table, and sealed with which checksum.

    Examples
    --------
    SQLite knows no NaN and no negative zero, so that neither counts:

    >>> layout = Layout(RunRow)
    >>> *fields, checksum = layout.sealed(RunRow(b"key", 1, 0, -0.0, float("nan"), 2.5, 7))
    >>> fields
    [b'key', 1, 0, 0.0, None, 2.5, 7]
    >>> layout.unsealed((*fields, checksum))
    RunRow(key=b'key', outcome=1, decided_by=0, peak_tilt=0.0, final_tilt=None, slip=2.5, steps=7)

    What is not as it was written is no row:

    >>> layout.unsealed((b"key", 1, 0, 0.0, None, 2.5, 6, checksum)) is None
    True
    """

    def __init__(self, row: type[Row]) -> None:
        hints = get_type_hints(row)
        kinds = {name: _COLUMNS[hints[name]] for name in row._fields}
        columns = ", ".join(f"{name} {kind}" for name, kind in kinds.items() if name != "key")
        self.table = TABLES[row]
        self.schema = (
            f"CREATE TABLE {self.table} (key BLOB PRIMARY KEY, {columns}, checksum INTEGER) "
            "WITHOUT ROWID"
        )
        self._row, self.width = row, len(kinds) + 1
        # Key and outcome stand first, numbers follow, and bytes are last if there are any.
        codes = [_PACKED[kind] for kind in kinds.values() if kind in _PACKED]
        self._numbers, self._end = struct.Struct("<" + "".join(codes)), 1 + len(codes)
        self._reals = [place for place, kind in enumerate(kinds.values()) if kind == "REAL"]

    def sealed(self, row: Row) -> tuple[Any, ...]:
        """Fields of a row as SQLite gives them back, and their checksum."""
        fields: list[Any] = list(row)
        for place in self._reals:
            value = fields[place]
            if value is not None:
                fields[place] = None if math.isnan(value) else value + 0.0
        return (*fields, self._checksum(fields))

    def unsealed(self, kept: tuple[Any, ...]) -> Row | None:
        """The row, or None if it is not what was written."""
        return self._row(*kept[:-1]) if self.is_sound(kept) else None

    def is_sound(self, kept: tuple[Any, ...]) -> bool:
        """Whether fields and checksum are what was written."""
        try:
            return self._checksum(kept) == kept[-1]
        except (struct.error, TypeError):  # a field of another type
            return False

    def _checksum(self, fields: Sequence[Any]) -> int:
        """CRC-32 of the key, of the numbers with 8 bytes each, and of bytes."""
        numbers = fields[1 : self._end]
        if None in numbers:
            numbers = [math.nan if value is None else value for value in numbers]
        checksum = zlib.crc32(fields[0] + self._numbers.pack(*numbers))
        for value in fields[self._end : self.width - 1]:
            checksum = zlib.crc32(value, checksum)
        return checksum
