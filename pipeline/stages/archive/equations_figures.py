"""Figures of the equations of archives: their error, and published forms beside them."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.drawing.style import FAINT, INK, SERIES, styled
from vsr_core.archive.equations import HIGHEST, Equations
from vsr_core.archive.fitting import Boundaries, missed
from vsr_core.archive.profiles import Profiles
from vsr_core.arrays import Array
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.verification.rocking_forms import slender_pga_without_impact

BLOCKS = ((0.05, 0.5), (0.25, 0.5))
"""Half-widths and half-heights of the blocks whose boundaries are compared [m]."""

SHORTNESS = np.geomspace(0.25, 6.0, 24)
"""1 / (p PGV/PGA) at which they are compared."""

_STEP = 0.02
"""Share of g tan(alpha) by which Housner's block is tried."""


@styled
def errors(given: Boundaries, left_out: Array) -> Figure:
    """Boundaries of the equations against those of runs, of shapes left out of the fit."""
    figure = Figure(figsize=(7.4, 3.4), layout="constrained")
    against, share = figure.subplots(1, 2)
    found, run = left_out.ravel(), given.relative.ravel()
    known = ~np.isnan(run)
    against.plot(run[known], found[known], ".", color=SERIES[0], markersize=1.2, alpha=0.35)
    against.plot([1.0, HIGHEST], [1.0, HIGHEST], color=INK, linewidth=0.8)
    against.set(xscale="log", yscale="log", xlim=(0.98, HIGHEST), ylim=(0.98, 20.0))
    against.set_xlabel("runs: PGA / (g tan alpha)")
    against.set_ylabel("equations: PGA / (g tan alpha)")
    off = missed(found, run)
    size = np.sort(np.abs(off[~np.isnan(off)]))
    share.plot(100.0 * size, np.linspace(0.0, 100.0, len(size)), color=SERIES[0])
    for level in (50, 95):
        share.axhline(level, color=FAINT, linestyle=":", linewidth=0.8)
    share.set(xscale="log", xlim=(0.1, 200.0), ylim=(0.0, 100.0))
    share.set_xlabel("error [%]")
    share.set_ylabel("boundaries with less [%]")
    for axes in (against, share):
        axes.grid()
    return figure


@styled
def forms(equations: Equations) -> Figure:
    """Boundaries of blocks: the equations, Housner's equation integrated, and a closed form."""
    figure = Figure(figsize=(7.4, 3.2), layout="constrained")
    panels = figure.subplots(1, len(BLOCKS), sharey=True)
    for axes, sizes in zip(panels, BLOCKS, strict=True):
        _forms_of(axes, Block(*sizes), equations)
        axes.set_title(f"block of {2 * sizes[0]:g} x {2 * sizes[1]:g} m")
        axes.set_xlabel("1 / (p PGV/PGA)")
        axes.grid()
    panels[0].set_ylabel("PGA / (g tan alpha)")
    panels[0].legend(loc="upper left")
    return figure


def profile_of(block: Block, friction: float) -> Profiles:
    """Profile of a uniform block."""
    slender = block.half_width / block.half_height
    return Profiles(
        np.full(2, slender),
        np.full(2, block.radius),
        np.array((block.inertia_ratio - 1.0) * block.radius**2),
        np.array(0.0),
        np.array(friction),
    )


def _forms_of(axes: Axes, block: Block, equations: Equations) -> None:
    ratio, static = 1.0 / (block.p * SHORTNESS), block.uplift
    rock = profile_of(block, 1.0)
    by_equations = equations.boundary(rock, ratio) / rock.weakest
    highest = 6.0 * static
    exact = [first_overturning_pga(block, one, highest, _STEP * static, 1e-3) for one in ratio]
    closed = [slender_pga_without_impact(block, one) for one in ratio]
    inside = np.array(exact) / static
    axes.plot(SHORTNESS, by_equations, color=SERIES[0], label="these equations")
    axes.plot(
        SHORTNESS,
        np.where(np.isfinite(inside), inside, math.nan),
        "o",
        color=INK,
        markersize=3.0,
        label="Housner's equation, integrated",
    )
    axes.plot(
        SHORTNESS,
        np.array(closed) / static,
        color=SERIES[1],
        linestyle="--",
        label="slender block, no impact",
    )
    axes.axhline(1.0, color=FAINT, linestyle=":", label="Housner's limit")
    axes.set(xscale="log", ylim=(0.8, 6.0))
    axes.set_xticks([0.25, 0.5, 1.0, 2.0, 4.0], ["0.25", "0.5", "1", "2", "4"])
    axes.minorticks_off()
