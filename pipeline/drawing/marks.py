"""Marks on pictures of a scene: the directions of its axes, and lines on its surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from pipeline.drawing import style
from vsr_core.arrays import Array, Mask

_SHORTEST = 0.3  # share of its length; a direction that is seen shorter points at the eye


def directions(axes: Axes, seen: Array, foot: Array, size: float, gap: float, colour: str) -> None:
    """Draw the directions of x, y and z, but for one that points at the eye.

    Parameters
    ----------
    seen : ndarray, shape (3, 2), unit vectors along x, y and z as the picture shows them
    foot : ndarray, shape (2,), where they begin
    size, gap : float, length of a line, and from its end to its name, in units of the axes
    """
    middle: Any = {"ha": "center", "va": "center", "size": 7.5, "path_effects": style.HALO}
    for name, along in zip("xyz", seen, strict=True):
        length = float(np.linalg.norm(along))
        if length > _SHORTEST:
            axes.plot(*np.stack([foot, foot + size * along]).T, color=colour, lw=0.85)
            x, y = (foot + (size + gap / length) * along).tolist()
            axes.text(x, y, name, color=colour, **middle)


def line_on_surface(axes: Axes, parts: Array, visible: Mask, name: str, **given: Any) -> None:
    """Draw pieces of a line, those that the surface hides thinner and dotted.

    Parameters
    ----------
    parts : ndarray, shape (n, 2, 2), ends of the pieces
    visible : ndarray of bool, shape (n,)
    name : str
        Group of the visible pieces; that of the others is "hidden" and the name.
    **given
        Further looks, ``colors`` of shape (n, 3) and ``linewidths`` among them.
    """
    for keep, group, share, dashes in (
        (visible, name, 1.0, "solid"),
        (~visible, f"hidden {name}", 0.6, (0, (1, 1.5))),
    ):
        look = {**given, "colors": given["colors"][keep]}
        look |= {"linewidths": share * given["linewidths"], "linestyles": [dashes], "gid": group}
        axes.add_collection(LineCollection(list(parts[keep]), **look))
