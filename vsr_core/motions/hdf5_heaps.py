"""Damaged heaps of HDF5 files, also of NetCDF, in which HDF5 may go on for ever.

Texts and arrays of no fixed length lie in heaps: after ``GCOL``, a version and the size, objects
follow each other, each with its number and its length. Number 0 is what is free, with its own head.
Of a free one of no length HDF5 goes on to itself, in a loop that hears no signal. It counts in 64
bits, so that from one of nearly 2^64 bytes it may go on to any place, or back.
"""

from __future__ import annotations

import mmap
import struct

_HEAP = b"GCOL\1\0\0\0"

_OBJECT = struct.Struct("<H6xQ")
"""Number and length of an object."""


def damaged(held: bytes | mmap.mmap, *, packed: bool = False) -> int | None:
    """Place of a heap in a file's content whose objects do not follow each other to its end.

    Parameters
    ----------
    packed : whether what refers to heaps may be packed, so that any of them may be in use

    Returns
    -------
    int or None
        None if there is none that is in use: what nothing refers to may be the rest of a heap that
        was given up.
    """
    at = held.find(_HEAP)
    while at >= 0:
        if _is_damaged(held, at) and (packed or held.find(struct.pack("<Q", at)) >= 0):
            return at
        at = held.find(_HEAP, at + 1)
    return None


def _is_damaged(held: bytes | mmap.mmap, start: int) -> bool:
    """Whether an object of a heap is followed by itself, or goes beyond the end."""
    at = start + len(_HEAP)
    if at + 8 > len(held):
        return False
    end = min(start + struct.unpack_from("<Q", held, at)[0], len(held))
    at += 8
    while at + _OBJECT.size <= end:
        number, length = _OBJECT.unpack_from(held, at)
        step = length if not number else _OBJECT.size + -(-length // 8) * 8
        if not 0 < step <= end - at:
            return True
        at += step
    return False
