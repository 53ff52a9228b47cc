"""Heaps of HDF5 files, also of NetCDF, in which HDF5 would go on for ever.

Texts and arrays of no fixed length lie in heaps: after ``GCOL``, a version and the size, objects
follow each other, each with its number and its length. Number 0 is what is free, with its own head.
Of a free one of no length HDF5 goes on to itself, in a loop that hears no signal.
"""

from __future__ import annotations

import mmap
import struct

_HEAP = b"GCOL\1\0\0\0"

_OBJECT = struct.Struct("<H6xQ")
"""Number and length of an object."""


def endless(held: bytes | mmap.mmap) -> int | None:
    """Place of a heap without end in a file's content; None if there is none."""
    at = held.find(_HEAP)
    while at >= 0:
        # what nothing refers to may be the rest of a heap that was given up
        if _is_endless(held, at) and held.find(struct.pack("<Q", at)) >= 0:
            return at
        at = held.find(_HEAP, at + 1)
    return None


def _is_endless(held: bytes | mmap.mmap, start: int) -> bool:
    """Whether a free object of a heap has no length."""
    at = start + len(_HEAP)
    if at + 8 > len(held):
        return False
    end = min(start + struct.unpack_from("<Q", held, at)[0], len(held))
    at += 8
    while at + _OBJECT.size <= end:
        number, length = _OBJECT.unpack_from(held, at)
        if not number and not length:
            return True
        at += length if not number else _OBJECT.size + -(-length // 8) * 8
    return False
