"""Which sizes rocks have here."""

from __future__ import annotations

from vsr_core.errors import InvalidInput

LARGEST_SIZE = 30.0
"""A rock with a longer side than this [m] was probably not given in metres."""

SMALLEST_SIZE = 0.005
"""The same for one whose longest side is shorter [m]."""

THINNEST = 0.001
"""Shortest side of a block, as a share of its longest: engines take a thinner base for a point."""


def check_size(size: float) -> None:
    """Refuse a size that no rock has here.

    Parameters
    ----------
    size : float [m], its longest side

    Raises
    ------
    InvalidInput
        If it is too large or too small.
    """
    if not SMALLEST_SIZE <= size <= LARGEST_SIZE:
        raise InvalidInput(
            f"a rock {size:.3g} m large",
            f"rocks here are {SMALLEST_SIZE} to {LARGEST_SIZE:.0f} m",
            "scale? lengths are in metres, or rock.scale is 0.001 for a site's mesh in millimetres",
        )
