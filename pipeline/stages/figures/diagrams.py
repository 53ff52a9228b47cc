"""Response diagrams with PGA [g] to the right and PGV/PGA [s] upward, and measures of them."""

from __future__ import annotations

import csv
import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from pipeline.config.layers import CONFIGS, TABLES, load_table
from pipeline.drawing import style
from vsr_core import GRAVITY
from vsr_core.arrays import Array, Mask
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.table.capacity import Table, largest_pga

PGA, RATIO = "PGA [g]", "PGV/PGA [s]"

WIDTH = 9.4
"""Of a figure [inch]."""

PALE = {1: "#e9aaa6", 0: "#bccfe4", -1: "#ffffff"}
"""Colours of cells on which curves are drawn."""

FULL = {1: style.OVERTURNED, 0: style.UPRIGHT, -1: style.UNDECIDED}


def cells(axes: Axes, pga: Array, ratios: Array, outcomes: Array, *, pale: bool = False) -> None:
    """Draw the outcome of every run, red where it overturned and blue where not.

    Parameters
    ----------
    pga, ratios : ndarray [g], [s]
    outcomes : ndarray, shape (ratios, pga), 1, 0, or -1 for unresolved
    pale : bool, whether curves are to be drawn on them
    """
    colours = PALE if pale else FULL
    axes.pcolormesh(
        style.cell_edges(pga),
        style.cell_edges(ratios),
        outcomes,
        cmap=ListedColormap([colours[kind] for kind in (-1, 0, 1)]),
        vmin=-1.5,
        vmax=1.5,
        edgecolors=(1.0, 1.0, 1.0, 0.35),
        linewidth=0.25,
        rasterized=True,
        gid="cells",
    )
    row, column = np.nonzero(outcomes < 0)
    if row.size:
        axes.plot(pga[column], ratios[row], "x", color="black", ms=4, gid="unresolved")
    axes.set(xlim=(0.0, style.cell_edges(pga)[-1]), ylim=(0.0, style.cell_edges(ratios)[-1]))


def labelled(panels: Any) -> None:
    """Label the axes at the left and lower side of a grid of panels."""
    for axes in panels[-1]:
        axes.set_xlabel(PGA)
    for axes in panels[:, 0]:
        axes.set_ylabel(RATIO)


def key(*, pale: bool = False) -> list[Any]:
    """Handles of the cells, for a legend."""
    axes = Figure().add_subplot()
    colours = PALE if pale else FULL
    square: Any = {"ls": "", "marker": "s", "ms": 7}
    handles = axes.plot([], [], color=colours[1], label="overturned", **square)
    handles += axes.plot([], [], color=colours[0], label="balanced", **square)
    return handles


class PhysicalTests(NamedTuple):
    """Tests on a table, at their commanded pulses.

    Attributes
    ----------
    pga, ratio : ndarray, shape (n,) [g], [s]
    toppled : ndarray of bool, shape (n,)
    """

    pga: Array
    ratio: Array
    toppled: Mask


def physical_tests(series: str) -> PhysicalTests:
    """The shipped tests of the print in a series, those with an outcome."""
    with PRINT_TESTS.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["series"] == series]
    known = [row for row in rows if row["specimen1"]]
    pga, ratio = (np.array([float(row[k]) for row in known]) for k in ("pga_g", "pgv_pga_s"))
    return PhysicalTests(pga, ratio, np.array([row["specimen1"] == "1" for row in known]))


def tested(axes: Axes, tests: PhysicalTests) -> list[Any]:
    """Draw physical tests, and return their handles for a legend."""
    look: Any = {"ls": "", "ms": 5, "mec": style.INK, "mew": 0.7}
    kinds = ((True, "^", style.OVERTURNED, "overturned"), (False, "o", "white", "balanced"))
    return [
        axes.plot(
            tests.pga[tests.toppled == kind],
            tests.ratio[tests.toppled == kind],
            marker,
            mfc=colour,
            label=f"physical test: {word}",
            gid=f"tests-{word}",
            **look,
        )[0]
        for kind, marker, colour, word in kinds
    ]


def logistic(axes: Axes, fragility: xr.Dataset, place: int = 0, **look: Any) -> None:
    """Draw the median of the logistic model of one direction."""
    axes.plot(median(fragility, place), fragility["pgv_pga"].values, **look)


def median(fragility: xr.Dataset, place: int = 0) -> Array:
    """PGA of probability one half in the logistic model of each row.

    Returns
    -------
    ndarray, shape (rows,) [g]; nan outside the tested PGA
    """
    pga = fragility["pga"].values
    line = fragility.isel(yaw=place, friction=0).sel(model="logistic")["median_pga"].values
    return np.where((line >= pga[0]) & (line <= pga[-1]), line, np.nan)


def note(figure: Figure, text: str) -> None:
    """Say in the upper left corner what a reader must know of the whole figure."""
    figure.text(0.006, 0.995, text, ha="left", va="top", size=7.5, color="#5a5a5a", gid="source")


PRINT_TESTS = CONFIGS / "tests" / "double_rock_prints" / "outcomes.csv"
"""Outcomes of the 12 cm print on the table, at yaw 0 deg."""

_ROBOT = "mini_shake_robot"
ROBOT_FILES = (TABLES / f"{_ROBOT}.yaml",)


def _robot() -> Table:
    """The robot of the paper's section 4.3."""
    return load_table(_ROBOT)[0].table()


def feasible(pga: Array, ratios: Array) -> Mask:
    """Which pulses the robot can perform.

    Parameters
    ----------
    pga, ratios : ndarray [g], [s]

    Returns
    -------
    ndarray of bool, shape (ratios, pga)
    """
    return pga[None] <= _largest(ratios)[:, None] + 1e-12


def robot_limits(axes: Axes, highest: float) -> None:
    """Draw the end of what the robot can do, and shade what is beyond it.

    Parameters
    ----------
    highest : float [s], PGV/PGA at its upper end
    """
    ratios = np.linspace(1e-4, highest, 600)
    end, right = _largest(ratios), axes.get_xlim()[1]
    axes.plot(end, ratios, color=style.INK, lw=1.4, ls=(0, (5, 2)), gid="limit",
              label="limit of the mini shake robot")  # fmt: skip
    axes.fill_betweenx(ratios, np.minimum(end, right), right, facecolor="none", hatch="////",
                       edgecolor="#8a8a8a", lw=0.0, gid="beyond")  # fmt: skip


def print_source(rock: xr.Dataset) -> str:
    """The source of the rock; the physical results are not public."""
    return f"{rock.attrs['shape_source']}; the robot's own results are not public"


def _largest(ratios: Array) -> Array:
    """Largest PGA of a pulse [g]."""
    robot = _robot()
    ends = [min(largest_pga(robot, float(ratio)).values()) for ratio in ratios]
    return np.array(ends) / GRAVITY


def terrain_source(rock: xr.Dataset) -> str:
    """Where rock and terrain come from, for the corner of a figure."""
    if rock.attrs["surrogate"]:
        return "SURROGATE rock and terrain, made up: no statement about the real site"
    return str(rock.attrs["shape_source"])


TRIED, _TOLERANCE = 100, 1e-3
"""Of the search on Housner's equation: PGAs tried up to the highest, and relative width."""


def grid(responses: xr.Dataset, yaw: float | None = None, friction: int = 0) -> Array:
    """Outcomes of one direction: 1 overturned, 0 not, -1 undecided.

    Parameters
    ----------
    yaw : float or None [degree], the first one if None

    Returns
    -------
    ndarray, shape (PGV/PGA, PGA)
    """
    place = 0 if yaw is None else responses["yaw"].values.tolist().index(yaw)
    outcomes: Array = responses["overturned"].values[place, friction]
    return outcomes


def toppled_share(outcomes: Array) -> float:
    """Share of the decided runs that overturned.

    >>> round(toppled_share(np.array([[1, 0], [-1, 0]])), 3)
    0.333
    """
    return _share((outcomes == 1)[outcomes >= 0])


def differing(one: Array, other: Array) -> float:
    """Share of the cells decided in both that end differently.

    >>> differing(np.array([1, 0, -1]), np.array([1, 1, 1]))
    0.5
    """
    both = (one >= 0) & (other >= 0)
    return _share((one != other)[both])


def _share(which: Mask) -> float:
    return float(which.mean()) if which.size else math.nan


def first_overturning(boundary: xr.Dataset, yaw: float | None = None, friction: int = 0) -> Array:
    """First-overturning PGA of each row of one direction.

    Parameters
    ----------
    yaw : float or None [degree], the first one if None

    Returns
    -------
    ndarray, shape (rows,) [g]; nan where the row does not overturn
    """
    place = 0 if yaw is None else boundary["yaw"].values.tolist().index(yaw)
    found = boundary["first_overturning_pga"].values[place, friction]
    return np.where(np.isfinite(found), found, np.nan)


def lower_in(one: Array, other: Array) -> float:
    """Share of the rows in which one boundary lies lower than another, or as low.

    Parameters
    ----------
    one, other : ndarray, shape (rows,) [g]
        Rows where neither is known do not count; an unknown one lies above all that was tried.

    >>> lower_in(np.array([0.1, 0.3, np.nan]), np.array([0.2, 0.2, np.nan]))
    0.5
    """
    known = np.isfinite(one) | np.isfinite(other)
    return _share((np.nan_to_num(one, nan=np.inf) <= np.nan_to_num(other, nan=np.inf))[known])


def housner(width: float, height: float, ratios: Array, highest: float) -> Array:
    """First-overturning PGA of a block by Housner's equation.

    Parameters
    ----------
    width, height : float [m]
    ratios : ndarray, shape (rows,), PGV/PGA [s]
    highest : float [g], up to which is looked; a band narrower than ``TRIED`` parts of it is missed

    Returns
    -------
    ndarray, shape (rows,) [g]; nan where none is found
    """
    return np.array([_exact(width, height, float(ratio), float(highest)) for ratio in ratios])


@cache
def _exact(width: float, height: float, ratio: float, highest: float) -> float:
    block, top = Block(0.5 * width, 0.5 * height), highest * GRAVITY
    found = first_overturning_pga(block, ratio, top, top / TRIED, _TOLERANCE)
    return found / GRAVITY if math.isfinite(found) else math.nan


def from_housner(boundary: xr.Dataset, width: float, height: float) -> Array:
    """Relative distance of a block's first overturning from that by Housner's equation.

    Parameters
    ----------
    width, height : float [m]

    Returns
    -------
    ndarray, shape (rows in which both are known,)
    """
    pga, ratios = boundary["pga"].values, boundary["pgv_pga"].values
    first = first_overturning(boundary)
    return apart(first, housner(width, height, ratios, pga[-1]))


def apart(boundary: Array, reference: Array) -> Array:
    """Relative difference of two boundaries in the rows where both are known.

    Parameters
    ----------
    boundary, reference : ndarray, shape (rows,) [g]

    Returns
    -------
    ndarray, shape (known rows,)
    """
    known: Mask = np.isfinite(boundary) & np.isfinite(reference)
    difference: Array = boundary[known] / reference[known] - 1.0
    return difference


def middle(differences: Array) -> float:
    """Median of the absolute values of differences.

    >>> middle(np.array([-0.3, 0.1, 0.2])), middle(np.array([]))
    (0.2, nan)
    """
    return float(np.median(np.abs(differences))) if differences.size else math.nan
