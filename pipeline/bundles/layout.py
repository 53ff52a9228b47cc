"""What a bundle holds, and reading one that somebody else made."""

from __future__ import annotations

import errno
import hashlib
import shutil
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pipeline.config.outside import check_file, refused
from pipeline.config.problems import InputError, Problem

ABOUT, CRATE, SUMS = "bundle.json", "ro-crate-metadata.json", "checksums.txt"
RESULTS, INPUTS = "results", "inputs"

SCHEMA = 1

LARGEST_ABOUT = 64 * 1024**2
MOST_FILES = 100_000
MOST_BYTES = 20 * 1024**3
"""Of all that is unpacked."""

MOST_SHARE = 1100
"""Bytes that one packed byte stands for at most: of zeros that were deflated 1032."""

PIECE = 1 << 20

DAMAGED = zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, UnicodeDecodeError
"""Raised for an archive, or a member, that is cut or damaged."""


class Given(BaseModel):
    """A file that products were made from."""

    model_config = ConfigDict(extra="forbid", strict=True)

    name: str
    sha256: str
    path: str = ""
    source: str = ""


class About(BaseModel):
    """What a bundle says of itself.

    Attributes
    ----------
    site : str, its YAML as a command names it from the folder ``base``
    products : list of str, stages whose products it holds
    versions : dict, of libraries that were installed
    inputs : of files left out the path is empty
    files : dict, SHA-256 of each file
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    schema_version: int
    name: str
    site: str
    base: str
    vsr: str
    products: list[str]
    versions: dict[str, str]
    inputs: list[Given]
    files: dict[str, str] = Field(max_length=MOST_FILES)


@contextmanager
def opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """A bundle, none of whose members leads outside, is a link or unpacks to too much."""
    rule, remedy = "it is a bundle of vsr export", "ask for it again"
    check_file(path, MOST_BYTES)
    try:
        with zipfile.ZipFile(path) as archive:
            if fault := _fault(archive.infolist()):
                raise refused(path, "", fault, rule, remedy)
            yield archive
    except DAMAGED as error:
        raise refused(path, "", f"a file that is cut or damaged ({error})", rule, remedy) from None
    except OSError as error:
        raise refused(path, "", error.strerror or str(error), rule, "check the path") from None


def _fault(members: list[zipfile.ZipInfo]) -> str:
    """Why members are not to be unpacked; empty where they may be."""
    names = [one.filename for one in members]
    if len(members) > MOST_FILES or sum(one.file_size for one in members) > MOST_BYTES:
        size = sum(one.file_size for one in members) / 1024**3
        return f"{len(members)} files of {size:.1f} GiB in all"
    if len(set(names)) < len(names):
        return "a name twice"
    for one in (one for one in members if not _is_folder(one)):
        if not is_plain(one.filename):
            return f"{one.filename!r}, which is no file within it"
        if one.flag_bits & 1 or one.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            return f"{one.filename!r}, which is encrypted or packed in another way"
        if stat.S_IFMT(one.external_attr >> 16) not in (0, stat.S_IFREG):
            return f"{one.filename!r}, which is a link or no file"
        if one.file_size > MOST_SHARE * (one.compress_size + 1):
            return f"{one.filename!r}, of {one.file_size / 1e6:.0f} MB packed in hardly anything"
    return ""


def _is_folder(member: zipfile.ZipInfo) -> bool:
    """Whether a member is a folder alone, as most programs pack it beside the files in it."""
    return member.is_dir() and not member.file_size and is_plain(member.filename[:-1])


def names(archive: zipfile.ZipFile) -> list[str]:
    """Names of the files of a bundle."""
    return [one.filename for one in archive.infolist() if not _is_folder(one)]


def is_plain(name: str) -> bool:
    """Whether a member may have a name: that of one file below, wherever it is unpacked.

    >>> [is_plain(name) for name in ("a/b.nc", "/a", "a/../b", "a//b", "a/", "c:b", "")]
    [True, False, False, False, False, False, False]
    """
    path = PurePosixPath(name)
    whole = bool(path.parts) and str(path) == name and name.isprintable()
    return (
        whole and not path.is_absolute() and ".." not in path.parts and not set("\\:") & set(name)
    )


def about(path: Path, archive: zipfile.ZipFile) -> About:
    """What a bundle says of itself."""
    rule = f"it has a {ABOUT} of schema {SCHEMA}"
    try:
        if archive.getinfo(ABOUT).file_size > LARGEST_ABOUT:
            raise refused(path, ABOUT, "a larger file", rule)
        found = About.model_validate_json(archive.read(ABOUT))
    except KeyError:
        raise refused(path, ABOUT, "none", rule) from None
    except ValidationError as error:
        given = f"another form ({error.error_count()} differences)"
        raise refused(path, ABOUT, given, rule, "use the version of vsr that made it") from None
    if found.schema_version != SCHEMA:
        given = f"schema {found.schema_version}"
        raise refused(path, ABOUT, given, rule, "use the version of vsr that made it")
    return found


def digest(archive: zipfile.ZipFile, name: str) -> str:
    """SHA-256 of a member; empty where it cannot be unpacked whole."""
    state = hashlib.sha256()
    try:
        with archive.open(name) as file:
            while piece := file.read(PIECE):
                state.update(piece)
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError):
        return ""
    return state.hexdigest()


def unpack(path: Path, archive: zipfile.ZipFile, name: str, folder: Path) -> Path:
    """Write a member of a bundle below a folder, in pieces; its file."""
    into = folder / name
    try:
        into.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(name) as packed, into.open("wb") as file:
            shutil.copyfileobj(packed, file, PIECE)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            given = f"{folder}, which is full"
            rule, remedy = "a bundle is unpacked where there is room", "free space, or set another"
            raise InputError(Problem("TMPDIR", "", given, rule, remedy)) from None
        given = f"what cannot be unpacked ({error.strerror or error})"
        rule = "it is a file that can stand beside the others"
        raise refused(path, name, given, rule, "ask for it again") from None
    return into


def sums(files: dict[str, str]) -> bytes:
    """What the file of checksums holds, for ``sha256sum -c``."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(files.items())).encode()


def sha256(content: bytes) -> str:
    """SHA-256 of bytes."""
    return hashlib.sha256(content).hexdigest()
