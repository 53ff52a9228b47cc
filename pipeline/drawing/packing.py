"""Arrays as a page holds them for its scripts."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from vsr_core.arrays import Array, Indices


def packed(values: Any, kind: str) -> str:
    """Numbers as text, of which a script makes a typed array.

    Parameters
    ----------
    kind : str, as NumPy names types, such as "<f4"

    Examples
    --------
    >>> packed([1.0, 2.0], "<u2")
    'AQACAA=='
    """
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()


def packed_mesh(vertices: Array, faces: Indices) -> dict[str, str]:
    """A surface as text.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    """
    return {"vertices": packed(vertices, "<f4"), "faces": packed(faces, "<u4")}
