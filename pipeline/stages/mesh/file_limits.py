"""How coarse, and how large, what a file of a mesh shows may be."""

from __future__ import annotations

from vsr_core.errors import InvalidInput

COARSEST = 1e-3
"""Largest step between neighbouring numbers of a file, as a share of what it shows."""

MOST_SHAPES, MOST_REPEATED = 10_000, 1_000_000
"""In a scene, each as often as it is there."""


def check_repeated(shapes: int, faces: int, stored: int) -> None:
    """Refuse a scene of too many shapes, or of far more faces than its file holds.

    Raises
    ------
    InvalidInput
    """
    if shapes > MOST_SHAPES or faces - stored > MOST_REPEATED:
        given = f"{shapes:,} shapes of {faces:,} faces in a scene, where {stored:,} are stored"
        rule = f"they are at most {MOST_SHAPES:,}, of {MOST_REPEATED:,} faces more than that"
        raise InvalidInput(given, rule, "export the rock alone")
