"""What the mini shake robot can do, on a response diagram."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from pipeline.config.layers import TABLES, load_table
from pipeline.drawing import style
from vsr_core import GRAVITY
from vsr_core.arrays import Array, Mask
from vsr_core.table.capacity import Table, largest_pga

NAME = "mini_shake_robot"
INPUTS = (TABLES / f"{NAME}.yaml",)


def table() -> Table:
    """The robot of the paper's section 4.3."""
    return load_table(NAME)[0].table()


def can(pga: Array, ratios: Array) -> Mask:
    """Which pulses the robot can perform.

    Parameters
    ----------
    pga, ratios : ndarray [g], [s]

    Returns
    -------
    ndarray of bool, shape (ratios, pga)
    """
    return pga[None] <= _largest(ratios)[:, None] + 1e-12


def limits(axes: Axes, highest: float) -> None:
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


def note(rock: xr.Dataset) -> str:
    """Say what the rock is, and that the physical results are not public."""
    return f"{rock.attrs['shape_source']}; the robot's own results are not public"


def _largest(ratios: Array) -> Array:
    """Largest PGA of a pulse [g]."""
    robot = table()
    ends = [min(largest_pga(robot, float(ratio)).values()) for ratio in ratios]
    return np.array(ends) / GRAVITY
