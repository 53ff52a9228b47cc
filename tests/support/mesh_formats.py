"""A ball in the formats of meshes, as the tests of their readers change it."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import trimesh


def ball() -> trimesh.Trimesh:
    """One of a metre, of 1,280 faces."""
    return trimesh.creation.icosphere(subdivisions=3, radius=0.5)


def ply(encoding: str) -> bytes:
    """The ball as PLY."""
    written = ball().export(file_type="ply", encoding=encoding, vertex_normal=False)
    return written if isinstance(written, bytes) else written.encode()


def glb(
    path: Path,
    change: Callable[[dict[str, Any]], dict[str, Any]],
    mesh: trimesh.Trimesh | None = None,
    more: bytes = b"",
) -> None:
    """Write the ball or a mesh, with another scene beside its coordinates and more behind them."""
    content = (mesh or ball()).export(file_type="glb")
    length = int.from_bytes(content[12:16], "little")
    scene, data = json.loads(content[20 : 20 + length]), content[28 + length :] + more
    scene["buffers"][0]["byteLength"] = len(data)
    text = json.dumps(change(scene)).encode()
    text += b" " * (-len(text) % 4)
    whole = struct.pack("<I4s", len(text), b"JSON") + text
    whole += struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(whole)) + whole)
