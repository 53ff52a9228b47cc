"""The figure of the page on rebound: impacts, a rolling prism, a sliding block, a tumbling rock."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks import tumbling
from pipeline.drawing.style import FAINT, INK, MARKERS, SERIES, styled
from vsr_core.scene import Contact
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.reference import impact, rimless_wheel, runout
from vsr_core.verification.reference._run import axes, slope
from vsr_core.verification.rocks import box

Array = NDArray[np.float64]

STEP = 1e-3

LEANS = np.concatenate([np.arange(-85.0, -4.0, 5.0), [math.nan], np.arange(5.0, 86.0, 5.0)])
"""Leans of the block that falls on its edge [degree]; flat it falls on its face."""

SHARES = 4000
"""Parts of an impact whose friction is followed."""

SIZES = (3.0, 1.5, 1.0, 0.7, 0.5, 0.35, 0.25)
"""Of triangles and parts that a block slides over [m]."""

Ensemble = dict[tuple[str, Contact, bool], tumbling.Runs]
"""Runs by engine, contact and whether the ground is convex parts."""


@styled
def figure(found: Ensemble, slides: float) -> Figure:
    """Four panels; ``slides`` is the slope of the sliding block [rad]."""
    drawn = Figure(figsize=(9.6, 7.4), layout="constrained")
    panels = drawn.subplots(2, 2)
    _edges(panels[0, 0])
    _wheels(panels[0, 1])
    _slides(panels[1, 0], slides)
    _tumbles(panels[1, 1], found)
    for panel in panels.flat:
        panel.grid(visible=True)
    return drawn


def _edges(panel: Axes) -> None:
    """Energy that a block keeps that falls on an edge, against how it leans."""
    ground = slope(impact.ANGLE, (-3.0, 3.0), 3.0, 6.0, True)
    for color, restitution in zip(SERIES, tumbling.RESTITUTIONS[1:], strict=False):
        contact = Contact(0.6, restitution)
        for engine, mark, size in (("nonsmooth", "o", 4.0), ("bullet", "x", 3.0)):
            kept = np.array([_kept(lean, contact, ground, engine) for lean in LEANS])
            name = "nonsmooth" if engine == "nonsmooth" else "Bullet"
            panel.plot(LEANS, kept[:, 0], mark, color=color, markersize=size, fillstyle="none",
                       label=f"{name}, e = {restitution:g}")  # fmt: skip
        panel.plot(LEANS, kept[:, 1], color=color, label="Newton's restitution")
        panel.plot(LEANS, kept[:, 2], "--", color=color, label="energetic restitution (Stronge)")
    panel.axhline(1.0, color=INK, linewidth=0.7)
    panel.set_xlabel("lean of the block [deg]")
    panel.set_ylabel("energy kept in the impact of an edge")
    panel.set_title("a  impact of an edge, friction 0.6", loc="left")
    panel.set_ylim(0.0, 1.5)
    panel.legend(ncols=2, loc="upper center", fontsize=7.0, columnspacing=1.0)


def _kept(
    lean: float, contact: Contact, ground: Terrain, engine: str
) -> tuple[float, float, float]:
    """Share of energy kept in an engine, by Newton's and by Stronge's restitution."""
    if math.isnan(lean):
        return math.nan, math.nan, math.nan
    turn = axes(math.radians(lean))
    throw = replace(impact.THROWS["edge"], rotation=turn, angular_velocity=np.zeros(3))
    before, after, theory, inertia = impact.thrown(throw, contact, ground, engine, STEP)
    held = before.energy(inertia)
    low = box(*impact.SIZE).vertices @ turn.T
    arm = low[low[:, 2] < low[:, 2].min() + 1e-6].mean(axis=0)
    energetic = _stronge(before, arm, inertia, contact)
    return after.energy(inertia) / held, theory.energy(inertia) / held, energetic / held


def _stronge(before: impact.Motion, arm: Array, inertia: Array, contact: Contact) -> float:
    """Energy after a plane impact that gives back e^2 of what its normal force took.

    The friction of each part of the impulse is that of the slip just then. Stronge (2000), ch. 4.
    """
    yields = impact.compliance(arm, inertia)
    along, normal = before.at(arm)[0], before.at(arm)[2]
    part = -normal / yields[2, 2] / SHARES
    impulse, work, taken = np.zeros(3), 0.0, 0.0
    while normal < 0.0 or work < -(contact.restitution**2) * taken:
        sticks = -yields[0, 2] / yields[0, 0]
        stopping = abs(along) < abs(yields[0, 0]) * part
        if stopping and abs(sticks) <= contact.friction:
            friction = sticks
        else:
            friction = -math.copysign(contact.friction, along if not stopping else -sticks)
        given = part * np.array([friction, 0.0, 1.0])
        change = yields @ given
        taken += min(normal, 0.0) * part
        work += max(normal + change[2], 0.0) * part
        along, normal, impulse = along + change[0], normal + change[2], impulse + given
    angular_velocity = before.angular_velocity + np.linalg.solve(inertia, np.cross(arm, impulse))
    return impact.Motion(before.velocity + impulse, angular_velocity).energy(inertia)


def _wheels(panel: Axes) -> None:
    """How far prisms that roll get ahead of the exact ones."""
    kinds = (
        ("nonsmooth, 0.5 m", "nonsmooth", 0.5, False, ":"),
        ("Bullet, parts, 1 m", "bullet", 1.0, True, "-"),
        ("Bullet, triangles, 0.5 m", "bullet", 0.5, False, "--"),
    )
    for color, wheel in zip(SERIES, rimless_wheel.WHEELS, strict=False):
        for name, engine, cell, cut, line in kinds:
            path = rimless_wheel.rolled(wheel, cell, cut, engine, STEP)
            times = wheel.period * np.arange(rimless_wheel.STEPS + 1)
            way = np.interp(times, path.time, path.position[:, 0]) / wheel.facet
            steps = np.arange(rimless_wheel.STEPS + 1)
            panel.plot(steps, way - steps, line, color=color, label=f"{wheel.sides} sides, {name}")
    panel.axhline(0.0, color=INK, linewidth=0.7)
    panel.set_xlabel("facets that the exact wheel has rolled")
    panel.set_ylabel("facets that the engine's is ahead")
    panel.set_title("b  rimless wheel at its terminal speed, e = 0", loc="left")
    panel.legend()


def _slides(panel: Axes, angle: float) -> None:
    """Loss of a sliding block against the size of what the ground is made of."""
    for color, restitution in zip(SERIES, tumbling.RESTITUTIONS, strict=False):
        contact = Contact(0.6, restitution)
        for name, engine, cut, line in (
            ("nonsmooth", "nonsmooth", False, ":^"),
            ("Bullet, parts", "bullet", True, "-o"),
            ("Bullet, triangles", "bullet", False, "--s"),
        ):
            losses = []
            for size in SIZES:
                ground = slope(angle, (-1.0, 11.0), 3.0, size, cut)
                fall = runout.energy_line(runout.block(), angle, contact, ground, engine, STEP)
                losses.append(fall / contact.friction)
            label = f"{name}, e = {restitution:g}"
            panel.plot(SIZES, losses, line, color=color, markersize=3.5, label=label)
    panel.axhline(1.0, color=INK, linewidth=0.7)
    panel.set_xscale("log")
    panel.set_ylim(0.9, 5.0)  # room for the legend above the lines
    panel.set_xticks([0.25, 0.5, 1.0, 2.0, 3.0], ["0.25", "0.5", "1", "2", "3"])
    panel.minorticks_off()
    panel.set_xlabel("size of triangles and parts [m]")
    panel.set_ylabel("fall of the energy line / friction")
    panel.set_title("c  block of 0.4 m that slides to rest, friction 0.6", loc="left")
    panel.legend(ncols=2, loc="upper center", fontsize=7.0)


def _tumbles(panel: Axes, found: Ensemble) -> None:
    """Run-outs of the rock that tumbles: mean with its standard error, and the spread."""
    for k, friction in enumerate(tumbling.FRICTIONS):
        place = np.array(tumbling.RESTITUTIONS) + 0.02 * (k - 1)
        ways = [found["nonsmooth", Contact(friction, e), False].way for e in tumbling.RESTITUTIONS]
        mean = np.array([way.mean() for way in ways])
        spread = np.array([way.std(ddof=1) for way in ways])
        error = spread / math.sqrt(len(ways[0]))
        panel.errorbar(place, mean, spread, fmt="none", color=FAINT, linewidth=0.7, capsize=2.0)
        panel.errorbar(place, mean, error, fmt=MARKERS[k], color=SERIES[k], linewidth=2.0,
                       markersize=5.0, label=f"friction {friction:g}")  # fmt: skip
    panel.axhline(-tumbling.START, color=INK, linewidth=0.7, label="foot of the slope")
    panel.set_ylim(bottom=0.0)
    panel.set_xticks(tumbling.RESTITUTIONS)
    panel.set_xlabel("restitution")
    panel.set_ylabel("horizontal distance [m]: mean, its error, spread")
    panel.set_title("d  rock that tumbles down 35 deg (nonsmooth)", loc="left")
    panel.legend()
