"""Parts of an HDF5 file, also of NetCDF, that are kept in others: links, raw bytes, virtual data.

Another file may change unseen, or be a pipe; where it is missing, HDF5 makes numbers up.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO


def kept_elsewhere(file: Path | BinaryIO) -> str:
    """Name of such a part; empty if there is none, or in a file that cannot be read."""
    import h5py

    def linked(name: bytes, link: Any) -> bytes | None:
        return name if link.type == h5py.h5l.TYPE_EXTERNAL else None

    def stored(name: str | bytes, one: Any) -> str | bytes | None:
        return name if isinstance(one, h5py.Dataset) and (one.is_virtual or one.external) else None

    with suppress(Exception), h5py.File(file) as opened:  # of what is damaged its reader tells
        name = opened.id.links.visit(linked, info=True) or opened.visititems(stored) or ""
        return name if isinstance(name, str) else name.decode(errors="backslashreplace")
    return ""
