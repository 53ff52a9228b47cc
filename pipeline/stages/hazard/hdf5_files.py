"""Data of HDF5 files, but for those that HDF5 would read for ever or make no end of room for.

Where a text of no fixed length is used, in an array or an attribute, stands its length, four bytes
before its place in a heap, and HDF5 makes room for that many.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vsr_core.motions.hdf5_heaps import damaged

_HEADS = {1: 8, 2: 8, 3: 9}
"""Bytes of an attribute before its name, the first of which is the version."""

_PARTS = struct.Struct("<HHH")
"""Bytes of its name, type and space, after which its value stands; in version 1 in eights."""

_OF_NO_FIXED_LENGTH = 9
"""Class of the type of texts and arrays of no fixed length."""

_STORED_TEXT = 16
"""Bytes of a text of no fixed length where it is used: its length, and its place in a heap."""

_PACKED = 1100
"""Bytes that one byte of a compressed file can stand for, at most."""


def content(data: Any, most: int) -> Any:
    """What a dataset holds, which is of so many values at most.

    Raises
    ------
    ValueError
        of more of them, of longer ones than the file can hold, or of any that stand in other
        files, which is not seen before in a file whose other parts are damaged
    """
    if data.is_virtual or data.external:
        raise ValueError(f"{data.name[1:]} that stands in other files")
    if data.size > most:
        raise ValueError(f"{data.size:,} values of {data.name[1:]}, of at most {most:,}")
    with Path(data.file.filename).open("rb") as file:
        length = max(data.nbytes // _PACKED, sum(map(int, _lengths(file, data.id))))
        _check_length(file, data.name[1:], length)
    return data[()]


def attribute(owner: Any, name: str) -> Any:
    """An attribute of a dataset or a group.

    Raises
    ------
    KeyError
        of none of that name
    ValueError
        of one that is longer than the file
    """
    with Path(owner.file.filename).open("rb") as file:
        _check_length(file, name, max(_lengths_of_attributes(file, name), default=0))
    return owner.attrs[name]


def _check_length(file: Any, name: str, length: int) -> None:
    size = file.seek(0, 2)
    if length > size:
        raise ValueError(f"{length:,} bytes of {name} in a file of {size:,}")


def _lengths_of_attributes(file: Any, name: str) -> Iterator[int]:
    """Lengths that attributes of a name, of no fixed length, say they have."""
    sought = name.encode() + b"\0"
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as held:
        at = held.find(sought)
        while at >= 0:
            for version, head in _HEADS.items():
                if at < head or held[at - head] != version:
                    continue
                parts = _PARTS.unpack_from(held, at - head + 2)
                if parts[0] != len(sought):
                    continue
                to_value = [-(-part // 8) * 8 if version == 1 else part for part in parts]
                kind, value = at + to_value[0], at + sum(to_value)
                if value < len(held) and held[kind] & 15 == _OF_NO_FIXED_LENGTH:
                    yield int.from_bytes(held[value : value + 4], "little")
            at = held.find(sought, at + 1)


def _lengths(file: Any, data: Any) -> Iterator[int]:
    """Sums of the lengths that values of no fixed length say they have, where they are stored."""
    kind = data.get_type()
    places, row = list(_places(kind, 0)), kind.get_size() + _longer(kind)
    if not places:
        return
    if data.get_create_plist().get_nfilters():  # where they lie is packed with how long they are
        _check_all_heaps(file)
        return
    for start, size in _blocks(data):
        file.seek(start)
        held = np.frombuffer(file.read(size), np.uint8)
        rows = held[: held.size - held.size % row].reshape(-1, row)
        for at in places:
            yield rows[:, at : at + 4].copy().view("<u4").sum(dtype=np.int64)


def _check_all_heaps(file: Any) -> None:
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as held:
        if (at := damaged(held, packed=True)) is not None:
            raise ValueError(f"a damaged heap at byte {at}")


def _blocks(data: Any) -> Iterator[tuple[int, int]]:
    """Where values are stored, and in how many bytes."""
    if data.get_offset() is not None:
        yield data.get_offset(), data.get_storage_size()
    elif data.get_create_plist().get_layout() == 2:  # chunked
        for at in range(data.get_num_chunks()):
            chunk = data.get_chunk_info(at)
            yield chunk.byte_offset, chunk.size


def _places(kind: Any, at: int) -> Iterator[int]:
    """Where in a stored value lengths of texts and arrays are."""
    from h5py import h5t

    if kind.get_class() == h5t.COMPOUND:
        for member in range(kind.get_nmembers()):
            one = kind.get_member_type(member)
            yield from _places(one, at + kind.get_member_offset(member))
            at += _longer(one)
    elif kind.get_class() == h5t.VLEN or _is_text(kind):
        yield at


def _longer(kind: Any) -> int:
    """Bytes by which a value is longer in a file than in memory, where a text is a pointer."""
    from h5py import h5t

    if kind.get_class() == h5t.COMPOUND:
        return sum(_longer(kind.get_member_type(n)) for n in range(kind.get_nmembers()))
    return _STORED_TEXT - kind.get_size() if _is_text(kind) else 0


def _is_text(kind: Any) -> bool:
    """Whether it is a text of no fixed length."""
    from h5py import h5t

    return bool(kind.get_class() == h5t.STRING and kind.is_variable_str())
