"""Whole products on disk, with their checksums."""

from __future__ import annotations

import errno
import json
import os
import shutil
import sqlite3
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from graphlib import CycleError, TopologicalSorter
from itertools import product
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter

from pipeline.config.outside import content
from pipeline.config.paths import shown
from pipeline.config.problems import InputError, Problem
from pipeline.workflow.keys import digest, digest_file
from pipeline.workflow.owner import LOCK, Ownership, make_folder, settle
from pipeline.workflow.writers import Writer, marked, text

LOG = "log.jsonl"


def _inside(name: str) -> str:
    """A name that leads to nothing outside of the folder."""
    parts = PurePosixPath(name).parts
    if not parts or not name.isprintable() or name.startswith("/") or ".." in parts:
        raise ValueError("no name of a product")
    return name


ProductName = Annotated[str, AfterValidator(_inside)]

_NAMES = TypeAdapter(list[ProductName])


class Facts(BaseModel):
    """What a product was made of, for those that compare it."""

    model_config = ConfigDict(extra="allow", strict=True)

    config: dict[str, Any] = Field(default_factory=dict)
    inputs: dict[str, str] = Field(default_factory=dict)
    versions: dict[str, str] = Field(default_factory=dict)
    code: dict[str, str] = Field(default_factory=dict)
    needs: dict[str, str] = Field(default_factory=dict)


class Manifest(BaseModel):
    """What every manifest holds; files are products by their names, with checksums."""

    model_config = ConfigDict(extra="allow", strict=True)

    key: str
    seal: str = ""
    facts: Facts
    files: dict[ProductName, str]
    unresolved: int = Field(ge=0)
    retry: int = Field(ge=0)
    warning: str = ""
    stale: str = ""
    place: str = ""


class Note(BaseModel):
    """What runs took, of a line of the log: wall clock and CPU [s]; a cluster's workers are -1."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    stage: str
    engine: str = Field(pattern=r"^[a-z]\w*$")
    runs: int = Field(ge=0, le=10**15)
    seconds: float = Field(ge=0, le=1e15)
    cpu_seconds: float = Field(ge=0, le=1e15)
    workers: int = Field(ge=-1, le=10**15)


def read_manifest(path: Path, *, changed: bool = False) -> dict[str, Any] | None:
    """What a manifest says; None if there is none, or what is there is none.

    Parameters
    ----------
    changed : whether one that was changed since it was written is one
    """
    try:
        found = json.loads(content(path))
        facts = Manifest.model_validate(found).facts
        if found.pop("seal", "") != digest(found) and not changed:
            return None
    except (InputError, ValueError, RecursionError):
        return None
    return {**found, "facts": facts.model_dump()}


def manifest_text(manifest: dict[str, Any]) -> str:
    """A manifest as it is written, sealed (anew), by which a change on disk is seen."""
    plain = {key: value for key, value in manifest.items() if key != "seal"}
    return json.dumps({**plain, "seal": digest(plain)}, indent=1, sort_keys=True)


ROOM = 65536
"""Bytes that must be free where products are written; with fewer, a disk is full."""


class Store:
    """Products and manifests of one site, in ``folder``.

    A product appears under its final name only when it is whole. Its stage's manifest is written
    last and holds the key, what the key was made of, and a checksum of every product.

    Parameters
    ----------
    home : Store, of the site that a member of a sweep belongs to: it is owned in place of this one,
        and has the database of runs
    lenders : dict, stores by the stages and keys of what they can lend, shared among the members
    """

    def __init__(
        self,
        folder: Path,
        home: Store | None = None,
        lenders: dict[tuple[str, str], Store] | None = None,
    ) -> None:
        self.folder = folder
        self._home, self._lenders = home, {} if lenders is None else lenders
        self._manifests = folder / ".stages"
        self._owned: Ownership | None = None
        self._is_open = False

    @property
    def runs(self) -> Path:
        """Folder of the database of runs."""
        return self.folder if self._home is None else self._home.runs

    @property
    def up(self) -> str:
        """The way from here to the folder of all results, as a link has it."""
        return f"{os.path.relpath(self.runs.parent, self.folder)}/"

    def check_apart(self, paths: Iterable[Path]) -> None:
        """Refuse files in the folder that products are made from, lest these are written over them.

        Parameters
        ----------
        paths : of files, or of folders that hold some; of a link, where it lies counts, too
        """
        for path, folder in product(paths, (self.folder, self.runs)):
            link = os.path.normpath(Path(os.path.realpath(path.parent), path.name))
            places = map(Path, (link, os.path.realpath(path)))
            if any(place.is_relative_to(os.path.realpath(folder)) for place in places):
                given = f"{Path(shown(path.parent), path.name)}, which is read"
                rule = "it holds results and no input"
                remedy = "move that, or give another folder with DERIVED="
                raise InputError(Problem(str(folder), "", given, rule, remedy))

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *error: object) -> None:
        if self._home is not None:
            self._home.__exit__(*error)
            self._is_open = False
        if self._home is None and not self._owned and (self.folder / LOCK).exists():
            with suppress(InputError):  # there was nothing to do: what a killed owner left goes
                self.open()
        if self._owned:
            self._owned.end()
            self._owned, self._is_open = None, False

    def open(self) -> bool:
        """Make the folder, own it from now on, and see that it can be written to.

        Reading needs none of it.
        """
        just_owned = self._home is not None and self._home.open()
        if self._is_open:
            return just_owned
        with writing(self.folder):
            make_folder(self._manifests)
            if self._home is None:
                self._owned, just_owned = Ownership(self.folder), True
            with tempfile.NamedTemporaryFile(dir=self.folder, prefix=".try-") as probe:
                probe.write(b"x" * ROOM)
            for left in (*self.folder.glob(".part-*"), *self.folder.glob(".try-*")):
                left.unlink()
        self._is_open = True
        return just_owned

    def manifest(self, stage: str) -> dict[str, Any] | None:
        """Manifest of a stage; None if there is none or it cannot be read."""
        return read_manifest(self._manifests / f"{stage}.json")

    def manifests(self) -> dict[str, dict[str, Any]]:
        """Manifests of all that was made here, by stage, each after those that it needs."""
        found = {stage: self.manifest(stage) for stage in self.stages()}
        there = {name: one for name, one in sorted(found.items()) if one is not None}
        order = TopologicalSorter({name: one["facts"]["needs"] for name, one in there.items()})
        try:
            return {name: there[name] for name in order.static_order() if name in there}
        except CycleError:  # which nobody has made
            return there

    def stages(self) -> list[str]:
        """Stages that have a manifest here, be it one that cannot be read."""
        return sorted(path.stem for path in self._manifests.glob("*.json"))

    def names(self) -> set[str]:
        """Names of all files that stages wrote here, as far as can be read."""
        shown = map(_shown_in, self._manifests.glob("*.refused"))
        return set().union(*self._written().values(), *shown)

    def _written(self) -> dict[str, set[str]]:
        """Names of the files of each stage, also by a manifest that was changed since."""
        paths = {stage: self._manifests / f"{stage}.json" for stage in self.stages()}
        found = {stage: read_manifest(path, changed=True) for stage, path in paths.items()}
        return {stage: {*one["files"]} for stage, one in found.items() if one is not None}

    def mark(self, stage: str, reason: str) -> None:
        """Say of a stage's products that other settings made them, and why; or that none did."""
        manifest = self.manifest(stage) or {"files": {}}
        for name, checksum in manifest["files"].items():
            path = self.folder / name
            # One that was changed on disk keeps its checksum, by which that is seen.
            if name.endswith(".html") and path.is_file() and digest_file(path) == checksum:
                page = path.read_text(encoding="utf-8")
                manifest["files"][name] = self._put(path, text(marked(page, reason)))
        manifest |= {"stale": reason}
        self._put(self._manifests / f"{stage}.json", text(manifest_text(manifest)))

    def damage(self, stage: str) -> str:
        """What is wrong with a stage's products on disk, or an empty string."""
        for name, checksum in (self.manifest(stage) or {"files": {}})["files"].items():
            path = self.folder / name
            if not path.is_file():
                return f"{name} is missing"
            if digest_file(path) != checksum:
                return f"{name} is not what was written"
        return ""

    def publish(self, stage: str, facts: dict[str, Any], writers: dict[str, Writer]) -> None:
        """Write products beside their names, rename them, then write the manifest."""
        with writing(self.folder):
            files = {name: self._put(self.folder / name, write) for name, write in writers.items()}
            manifest = manifest_text({**facts, "files": files})
            for name in self._former(stage) - files.keys():
                (self.folder / name).unlink(missing_ok=True)
            self._shown(stage).unlink(missing_ok=True)
            self._put(self._manifests / f"{stage}.json", text(manifest))

    def show(self, stage: str, writers: dict[str, Writer]) -> None:
        """Write files that show why a stage's input is refused, until it is made."""
        with writing(self.folder):
            self._put(self._shown(stage), text(json.dumps([*writers])))
            for name, write in writers.items():
                self._put(self.folder / name, write)

    def _former(self, stage: str) -> set[str]:
        """Names of files of a stage that go where it does not write them again."""
        written = self._written()
        own = written.pop(stage, set()) | _shown_in(self._shown(stage))
        return own - set().union(*written.values())

    def _shown(self, stage: str) -> Path:
        """Names of a stage's files that no manifest has: shown at a refusal, or forgotten."""
        return self._manifests / f"{stage}.refused"

    def lends(self, stages: Iterable[str]) -> None:
        """Let the others that share its lenders take what it has of some stages."""
        for stage in stages:
            manifest = self.manifest(stage)
            if manifest is not None and not manifest["retry"]:
                self._lenders.setdefault((stage, manifest["key"]), self)

    def borrow(self, stage: str, key: str) -> str:
        """Take over what another store has of a stage."""
        lender = self._lenders.get((stage, key))
        manifest = lender.manifest(stage) if lender else None
        if lender is None or manifest is None or manifest["key"] != key or lender.damage(stage):
            return ""
        if lender.up != self.up and any(name.endswith(".html") for name in manifest["files"]):
            return ""  # its pages link to where all results lie
        writers: dict[str, Writer] = {
            name: partial(shutil.copyfile, lender.folder / name) for name in manifest["files"]
        }
        self.publish(stage, manifest, writers)
        return lender.folder.name

    def forget(self, stage: str) -> None:
        """Drop a stage's manifest, so that it is made again, and not borrowed."""
        for known in [known for known in self._lenders if known[0] == stage]:
            del self._lenders[known]
        manifest = self.manifest(stage)
        with writing(self.folder):
            if manifest is not None:
                self._put(self._shown(stage), text(json.dumps([*manifest["files"]])))
            (self._manifests / f"{stage}.json").unlink(missing_ok=True)

    def note(self, stage: str, **facts: Any) -> None:
        """Append facts that no product may hold, such as times, to the log."""
        line = json.dumps({"time": time.strftime("%Y-%m-%dT%H:%M:%S"), "stage": stage, **facts})
        with writing(self.folder), open(self.folder / LOG, "ab+", opener=_no_link) as file:
            file.seek(max(file.seek(0, os.SEEK_END) - 1, 0))
            torn = file.read(1) not in (b"", b"\n")  # by a kill or a full disk
            file.write(b"\n" * torn + line.encode() + b"\n")

    def notes(self, stage: str) -> list[dict[str, Any]]:
        """Facts noted about a stage, oldest first."""
        path = self.folder / LOG
        lines = path.read_bytes().splitlines() if path.is_file() else []
        return [note.model_dump() for note in map(_noted, lines) if note and note.stage == stage]

    def _put(self, final: Path, write: Writer) -> str:
        part = self.folder / f".part-{os.getpid()}-{final.name}"
        make_folder(final.parent)
        try:
            with writing(self.folder):  # while the part still fills the disk
                write(part)
            with part.open("rb+") as file:
                os.fsync(file.fileno())
            checksum = digest_file(part)
            part.replace(final)
            settle(final.parent)
        finally:
            part.unlink(missing_ok=True)
        return checksum


def _shown_in(path: Path) -> set[str]:
    """Names of the files that show why an input was refused; none where they cannot be read."""
    try:
        return set(_NAMES.validate_json(content(path)))
    except (InputError, ValueError):
        return set()


def _noted(line: bytes) -> Note | None:
    """What a line of the log says; None of one that was torn or damaged."""
    with suppress(ValueError):
        return Note.model_validate_json(line)
    return None


def _no_link(path: str, flags: int) -> int:
    """Open a file that lies in the folder itself."""
    return os.open(path, flags | os.O_NOFOLLOW, 0o666)


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn a failure to write into one clear line."""
    try:
        yield
    except (OSError, sqlite3.Error) as error:
        given = f"an output folder that cannot be written ({error})"
        remedy = "free space, change its permissions, or give another with DERIVED="
        if _is_full(folder, error):  # which NetCDF calls a lack of permission
            given = f"a full disk that cannot be written to ({os.strerror(errno.ENOSPC)})"
            remedy = "free space and start again, or give another with DERIVED="
        rule = "it is a folder with room that you may write to"
        if "\\" in str(folder):
            rule, remedy = "NetCDF takes a backslash in a name for a slash", "rename it"
        raise InputError(Problem(str(folder), "", given, rule, remedy)) from error


def _is_full(folder: Path, error: OSError | sqlite3.Error) -> bool:
    """Whether a lack of room is what was in the way."""
    if getattr(error, "errno", 0) in (errno.ENOSPC, errno.EDQUOT):
        return True
    if getattr(error, "sqlite_errorcode", 0) == sqlite3.SQLITE_FULL:
        return True
    with suppress(OSError):
        disk = os.statvfs(folder)
        return disk.f_bavail * disk.f_frsize < ROOM and not disk.f_flag & os.ST_RDONLY
    return False
