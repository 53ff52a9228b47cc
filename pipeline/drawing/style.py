"""The one style of all figures: colours, type, marks, and how a figure becomes bytes."""

from __future__ import annotations

import base64
import functools
import io
from collections.abc import Callable
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from pipeline.drawing import style
from pipeline.workflow.writers import Writer, binary
from vsr_core.arrays import Array, Mask

P = ParamSpec("P")

# Red and blue as the paper draws them, apart in lightness too, so that they differ in grey and
# for a reader who sees no red.
OVERTURNED = "#c7362f"
UPRIGHT = "#2b66ad"
PROVED = "#a8c5e6"
UNDECIDED = "#ffffff"
MODEL = "#ffd23f"
INK = "#1c1c1c"
FAINT = "#8a8a8a"
BASE = "#e08a00"
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Okabe and Ito's colours, for lines that are told apart by colour."""

MARKERS = ("o", "s", "^", "D", "v", "P")

HALO = (withStroke(linewidth=2.4, foreground="white"),)
"""Path effects of text that stands on a picture."""

BOTH_WAYS = {"arrowstyle": "<|-|>", "shrinkA": 0, "shrinkB": 0}
"""Arrow of the shaking, to and fro."""

DPI = 160

_RC: Any = {
    "font.family": "DejaVu Sans",  # matplotlib brings it: the same picture everywhere
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.5,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.7,
    "axes.axisbelow": True,
    "grid.color": "#d5d5d5",
    "grid.linewidth": 0.5,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "svg.hashsalt": "vsr",
    "pdf.fonttype": 42,  # text that can be selected and edited
}

_OWN: Any = {key: mpl.rcParamsDefault[key] for key in mpl.rcParamsDefault if key != "backend"}
"""Matplotlib's own settings, which stand beside ours in place of those of a user's matplotlibrc."""

_SAVED: dict[str, Any] = {  # without the time at which it was made
    "png": {"dpi": DPI, "facecolor": "white", "metadata": {"Software": None}},
    "svg": {"dpi": DPI, "facecolor": "white", "metadata": {"Date": None}},
    "pdf": {"dpi": DPI, "metadata": {"CreationDate": None}},
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw with the project's style, whatever the caller's matplotlib is set to."""

    @functools.wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context({**_OWN, **_RC}):
            return draw(*args, **kwargs)

    return drawn


def png(figure: Figure) -> bytes:
    """Render as PNG, the same bytes every time."""
    return _rendered(figure, "png")


def pictures(
    name: str, figure: Figure, kinds: tuple[str, ...] = ("png", "pdf")
) -> dict[str, Writer]:
    """The files of a figure that is a product."""
    return {f"{name}.{kind}": binary(_rendered(figure, kind)) for kind in kinds}


def png_uri(figure: Figure) -> str:
    """Render as PNG, inside an address that holds it all."""
    return data_uri(png(figure), "png")


def svg_uri(figure: Figure) -> str:
    """Render as SVG, inside an address that holds it all."""
    return data_uri(_rendered(figure, "svg"), "svg+xml")


def data_uri(image: bytes, kind: str) -> str:
    """Address that holds an image.

    Examples
    --------
    >>> data_uri(b"RIFF", "webp")
    'data:image/webp;base64,UklGRg=='
    """
    return f"data:image/{kind};base64,{base64.b64encode(image).decode()}"


def _rendered(figure: Figure, kind: str) -> bytes:
    with mpl.rc_context({**_OWN, **_RC}), io.BytesIO() as file:
        figure.savefig(file, format=kind, **_SAVED[kind])
        return file.getvalue()


def cell_edges(values: Array) -> Array:
    """Borders of cells around grid values, half-way between them; none of positive ones below zero.

    Parameters
    ----------
    values : ndarray, shape (n,), ascending

    Returns
    -------
    ndarray, shape (n + 1,)

    Examples
    --------
    >>> cell_edges(np.array([1.0, 2.0, 4.0])).tolist()
    [0.5, 1.5, 3.0, 5.0]
    """
    if values.size == 1:  # the only record of a site is at 0
        return values + (0.5 * values[0] or 0.5) * np.array([-1.0, 1.0])
    middle = (values[1:] + values[:-1]) / 2
    first = 2 * values[0] - middle[0]
    first = max(first, 0.0) if values[0] > 0.0 else first
    return np.concatenate([[first], middle, [2 * values[-1] - middle[-1]]])


def legend_below(figure: Figure, axes: Axes, columns: int, top: float = 0.08) -> None:
    """Legend of one panel, below the figure.

    Parameters
    ----------
    top : float
        Its upper end, as a share of the figure's height.
    """
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="upper center",
        bbox_to_anchor=(0.5, top),
        ncols=columns,
        handlelength=1.6,
        columnspacing=1.2,
        labelspacing=0.35,
        borderaxespad=0.2,
    )


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
