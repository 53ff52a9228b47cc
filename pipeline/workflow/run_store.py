"""Runs in an embedded database: each row sealed, and what is damaged set aside."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any, Generic

from pipeline.config.problems import InputError, Problem
from pipeline.workflow import owner
from pipeline.workflow.grammar import counted
from pipeline.workflow.log import complain
from pipeline.workflow.rows import TABLES, Layout, Row
from pipeline.workflow.store import writing

RUNS = "runs.sqlite"

DAMAGED = ".damaged-"
"""Follows the name of a database that was set aside, before its number."""

_OTHER = "tables of another version"

_TORN = {sqlite3.SQLITE_ERROR, sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB}
_ENDINGS = ("", "-wal", "-shm", "-journal")
_PATIENCE = 30.0  # [s], where another process reads or writes just now


class RunsLost(InputError):
    """Runs that were done and cannot be read any more; doing them again mends it."""


class RunStore(Generic[Row]):
    """Run results by key, in SQLite: survives ``kill -9`` and tells what was damaged on disk.

    One process writes; at most the batches not yet handed over are lost. Opening a damaged
    database to write sets it aside under another name and keeps its sound rows.

    Parameters
    ----------
    reads : bool, whether nothing is to be changed; the database then has to be there
    """

    def __init__(self, folder: Path, row: type[Row], *, reads: bool = False) -> None:
        self._path, self._layout, self._reads = folder / RUNS, Layout(row), reads
        _check_files(self._path)
        with self._using():
            if reads:
                self._database = _reader(self._path)
                return
            _mend(self._path)
            self._database = _writer(self._path)

    def close(self) -> None:
        """Close the database, in one file that can be read from a folder that is not ours."""
        with suppress(sqlite3.Error):  # another process reads it just now
            if not self._reads:
                self._database.execute("PRAGMA busy_timeout=0")
                self._database.execute("PRAGMA journal_mode=DELETE").fetchall()
        self._database.close()

    def add(self, rows: Iterable[Row]) -> None:
        """Keep rows, all or none."""
        with self._using(), _whole(self._database, "BEGIN IMMEDIATE"):
            _put(self._database, self._layout, map(self._layout.sealed, rows))

    def get(self, keys: Iterable[bytes]) -> dict[bytes, Row]:
        """Stored rows among ``keys``."""
        rows = (self._layout.unsealed(kept) for kept in self._kept(keys))
        return {row.key: row for row in rows if row is not None}

    def starting(self, start: bytes) -> Iterator[Row]:
        """Stored rows whose keys begin with some bytes, in the order of their keys."""
        database, table = self._database, self._layout.table
        query = f"SELECT * FROM {table} WHERE key >= ? AND key < ? ORDER BY key"  # noqa: S608
        with self._using():
            if self._layout.schema not in _tables(database):
                return
            with closing(database.execute(query, (start, start + b"\xff" * 64))) as found:
                rows = map(self._layout.unsealed, found)
                yield from (row for row in rows if row is not None)

    def outcomes(self, keys: Iterable[bytes]) -> dict[bytes, int]:
        """Outcomes of those of ``keys`` that are stored."""
        is_sound = self._layout.is_sound
        return {kept[0]: kept[1] for kept in self._kept(keys) if is_sound(kept)}

    def _kept(self, keys: Iterable[bytes]) -> Iterator[tuple[Any, ...]]:
        """Fields and checksums of rows."""
        database, table = self._database, self._layout.table
        query = f"SELECT {table}.* FROM wanted CROSS JOIN {table} USING (key)"  # noqa: S608
        with self._using(), _whole(database, "BEGIN"):
            if self._layout.schema not in _tables(database):  # none of the kind was ever done
                return
            database.execute(
                "CREATE TEMP TABLE IF NOT EXISTS wanted (key BLOB PRIMARY KEY) WITHOUT ROWID"
            )
            database.execute("DELETE FROM wanted")
            database.executemany(
                "INSERT OR IGNORE INTO wanted VALUES (?)", ((key,) for key in sorted(keys))
            )
            with closing(database.execute(query)) as found:
                yield from found

    @contextmanager
    def _using(self) -> Iterator[None]:
        """Turn what is wrong with the database or its folder into one line."""
        try:
            with writing(self._path.parent):
                yield
        except InputError as error:
            cause = error.__cause__
            if not _is_torn(cause):
                raise
            given, rule = f"a damaged database ({cause})", "it is as it was written"
            remedy = "run again: it is set aside, and what is sound in it is kept"
            raise RunsLost(Problem(str(self._path), "", given, rule, remedy)) from cause


def is_there(folder: Path) -> bool:
    """Whether a folder has a database of runs."""
    return (folder / RUNS).is_file()


def _check_files(path: Path) -> None:
    """Refuse a pipe, which SQLite may wait for without an end, a device or a folder."""
    for ending in _ENDINGS:
        file = path.with_name(path.name + ending)
        if file.exists() and not file.is_file():
            rule, remedy = "runs are kept in regular files", "remove it, or give another folder"
            raise InputError(Problem(str(file), "", "a pipe, a device or a folder", rule, remedy))


def _connected(where: Path | str) -> sqlite3.Connection:
    database = sqlite3.connect(
        where, isolation_level=None, timeout=_PATIENCE, uri=isinstance(where, str)
    )
    database.text_factory = bytes  # no row holds a text, unless its type was damaged
    return database


def _reader(path: Path) -> sqlite3.Connection:
    """A connection that changes nothing, not even beside the file."""
    uri = f"{path.resolve().as_uri()}?mode=ro"
    database = _connected(uri)
    try:
        database.execute("SELECT count(*) FROM sqlite_master").fetchall()
    except sqlite3.OperationalError as error:
        database.close()
        if error.sqlite_errorcode == sqlite3.SQLITE_READONLY_ROLLBACK:
            # What power or a kill cut short has to be taken back first, by who may write.
            with closing(_connected(path)) as writer:
                writer.execute("SELECT count(*) FROM sqlite_master").fetchall()
            return _connected(uri)
        if any(path.with_name(path.name + ending).exists() for ending in _ENDINGS[1:]):
            raise
        # Left in the mode of a write-ahead log, which would need to be made in a folder that
        # cannot be written to; nobody else writes there either.
        database = _connected(f"{uri}&immutable=1")
    return database


def _writer(path: Path) -> sqlite3.Connection:
    is_new = not path.exists()
    database = _connected(path)
    try:
        database.execute(f"PRAGMA journal_mode={owner.journal_mode(path.parent)}").fetchall()
        database.execute("PRAGMA synchronous=NORMAL")
        known = _tables(database)
        for row in TABLES:
            layout: Layout[Any] = Layout(row)
            if layout.schema not in known:
                database.execute(layout.schema)
    except sqlite3.Error:
        database.close()
        if is_new:  # no room for its first page: not to be taken for a damaged one
            for ending in _ENDINGS:
                path.with_name(path.name + ending).unlink(missing_ok=True)
        raise
    return database


def _mend(path: Path) -> None:
    """Set a damaged database aside, and keep its sound rows in a new one."""
    fault = _fault(path)
    if not fault:
        return
    whole = path.with_name(f".part-{path.name}")
    whole.unlink(missing_ok=True)
    with closing(_connected(path)) as old, closing(_writer(whole)) as new:
        kept = _salvage(old, new)
        new.execute("PRAGMA journal_mode=DELETE").fetchall()
    aside = _set_aside(path)
    whole.replace(path)
    owner.settle(path.parent)
    complain(
        f"vsr: warning: {path}: damaged ({fault}); set aside as {aside.name}; what is sound of "
        f"it stays, {counted(kept, 'row')}; the rest is run again"
    )


def _fault(path: Path) -> str:
    """What is wrong with a database as a whole, or an empty string."""
    if not path.exists():
        return ""
    fault, bad = _faults(path, _connected)
    return fault or (f"{counted(bad, 'row')} not as written" if bad else "")


def check(folder: Path) -> int:
    """Refuse a database that is damaged as a whole; the number of rows that are damaged.

    Nothing is changed on disk. Tables of another version are none that are read.
    """
    path = folder / RUNS
    with writing(folder):
        fault, bad = _faults(path, _reader)
    if fault and fault != _OTHER:
        rule, remedy = "it is as it was written", "copy it again, or run again where it was made"
        raise InputError(Problem(str(path), "", f"a damaged database ({fault})", rule, remedy))
    return bad


def _faults(path: Path, connect: Callable[[Path], sqlite3.Connection]) -> tuple[str, int]:
    """What is wrong with a database as a whole, or else how many of its rows are damaged."""
    if not any(file.stat().st_size for file in path.parent.glob(f"{path.name}*")):
        return "it is empty", 0
    with path.open("rb") as file:
        if max(file.read(20)[18:], default=0) > 2:  # or SQLite would take it for read-only
            return "file format not known", 0
    expected = {Layout(row).schema for row in TABLES}
    try:
        with closing(connect(path)) as database:
            ((said,),) = database.execute("PRAGMA integrity_check(1)").fetchall()
            if said != b"ok":
                return " ".join(said.decode(errors="replace").split()), 0
            tables = _tables(database)
            layouts: list[Layout[Any]] = [Layout(row) for row in TABLES]
            bad = sum(_unsound(database, layout) for layout in layouts if layout.schema in tables)
            return "" if tables <= expected else _OTHER, bad
    except sqlite3.DatabaseError as error:
        if not _is_torn(error):
            raise
        return str(error), 0


def _unsound(database: sqlite3.Connection, layout: Layout[Any]) -> int:
    """Number of rows that are not as they were written, or not in their order."""
    bad, last = 0, b""
    for kept in database.execute(f"SELECT * FROM {layout.table} ORDER BY key"):  # noqa: S608
        bad += not layout.is_sound(kept) or kept[0] <= last
        last = kept[0]
    return bad


def _is_torn(error: BaseException | None) -> bool:
    """Whether an error says that the database is damaged, not that it cannot be reached."""
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _TORN


def _tables(database: sqlite3.Connection) -> set[str]:
    """What the tables were made with."""
    made = database.execute("SELECT sql FROM sqlite_master").fetchall()
    return {(sql or b"").decode(errors="replace") for (sql,) in made}


def _salvage(old: sqlite3.Connection, new: sqlite3.Connection) -> int:
    """Copy the rows that can still be read and are as they were written; returns their number."""
    kept = 0
    for row in TABLES:
        layout: Layout[Any] = Layout(row)
        with _whole(new, "BEGIN"):
            for order in ("", "DESC"):  # from both ends, as far as each is readable
                _put(new, layout, _readable(old, layout, order))
        ((number,),) = new.execute(f"SELECT count(*) FROM {layout.table}")  # noqa: S608
        kept += number
    return kept


def _readable(
    old: sqlite3.Connection, layout: Layout[Any], order: str
) -> Iterator[tuple[Any, ...]]:
    query = f"SELECT * FROM {layout.table} ORDER BY key {order}"  # noqa: S608
    with suppress(sqlite3.DatabaseError, UnicodeDecodeError):  # of a row, of a column's name
        for kept in old.execute(query):
            if layout.is_sound(kept):
                yield kept


def _set_aside(path: Path) -> Path:
    """Keep a database and what belongs to it under a free name; it stays until it is replaced."""
    number = 1
    while (aside := path.with_name(f"{path.name}{DAMAGED}{number}")).exists():
        number += 1
    for ending in _ENDINGS[1:]:
        with suppress(FileNotFoundError):
            path.with_name(path.name + ending).rename(aside.with_name(aside.name + ending))
    try:
        aside.hardlink_to(path)
    except OSError:  # a file system without such links
        shutil.copyfile(path, aside)
    return aside


def _put(
    database: sqlite3.Connection, layout: Layout[Any], rows: Iterable[tuple[Any, ...]]
) -> None:
    places = ", ".join("?" * layout.width)
    database.executemany(
        f"INSERT OR REPLACE INTO {layout.table} VALUES ({places})",  # noqa: S608
        rows,
    )


@contextmanager
def _whole(database: sqlite3.Connection, begin: str) -> Iterator[None]:
    """A transaction: all of it, or nothing."""
    database.execute(begin)
    try:
        yield
    except BaseException:
        with suppress(sqlite3.Error):
            database.execute("ROLLBACK")
        raise
    database.execute("COMMIT")
