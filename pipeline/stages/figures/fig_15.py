"""Fig. 15b-f: trajectories of the toppled rock over the terrain."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from pipeline.stages.datasets.displaced_runs import left_seat
from pipeline.stages.displacement import trajectory_maps
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import Data, Finding, Source, by_rule

TITLE = "Trajectories of the toppled rock"

SITE = "double_rock_terrain"

SOURCES = {
    "displacement": Source(SITE, "displacement"),
    "terrain": Source(SITE, "terrain"),
    "rock": Source(SITE, "rock"),
}

PUBLISHED = 692 / 2500
"""Toppled share of the published runs."""

LIKE = 1.5
"""Factor within which a toppled share is like the published one."""

RANGES = ((0.5, 0.7), (0.7, 0.8))
"""PGA of the paper's panels [g]."""


def draw(data: Data) -> Figure:
    """Draw all trajectories from above, and those of each range of PGA."""
    source = diagrams.terrain_source(data["rock"])
    return trajectory_maps.trajectories(data["displacement"], data["terrain"], source)


def findings(data: Data) -> list[Finding]:
    """Compare with section 5.4."""
    displacement = data["displacement"]
    fell = left_seat(displacement)
    number, share = int(fell.sum()), float(fell.mean())
    pga, speed = displacement["pga"].values, displacement["largest_speed"].values
    inside = [(pga > low) & (pga <= high) for low, high in RANGES]
    rates = [float(fell[part].mean()) if part.any() else math.nan for part in inside]
    counts = [int((fell & part).sum()) for part in inside]
    speeds = [
        float(np.median(speed[fell & part])) if count else math.nan
        for part, count in zip(inside, counts, strict=True)
    ]
    names = [f"({low:g}, {high:g}] g" for low, high in RANGES]
    return [
        Finding(
            "Fig. 15b, section 5.4",
            "692 of 2,500 runs overturn the rock at yaw 0° on the terrain.",
            f"the same share, within a factor of {LIKE:g}: a terrain of another shape gives "
            "another number",
            f"{number} of {displacement.sizes['run']}, a share of {share:.2f} against "
            f"{PUBLISHED:.2f}, on a surrogate terrain",
            1.0 / LIKE <= share / PUBLISHED <= LIKE,
        ),
        Finding(
            "Fig. 15c-f, section 5.4",
            "More runs overturn, and so more trajectories there are, the larger the PGA.",
            f"a larger share overturns in {names[1]} than in {names[0]}",
            f"{100 * rates[0]:.0f} % of the runs ({counts[0]}) in {names[0]}, "
            f"{100 * rates[1]:.0f} % ({counts[1]}) in {names[1]}",
            by_rule(rates[1] > rates[0], *rates),
        ),
        Finding(
            "Fig. 15, section 5.4",
            "The speed along the trajectories changes with PGA.",
            f"the median of the largest speeds is higher in {names[1]}",
            f"{speeds[0]:.2f} m/s in {names[0]}, {speeds[1]:.2f} m/s in {names[1]}",
            by_rule(speeds[1] > speeds[0], *speeds),
        ),
    ]
