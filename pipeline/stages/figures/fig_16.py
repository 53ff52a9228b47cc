"""Fig. 16: trajectory lengths against PGA and PGV/PGA."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.stats import spearmanr

from pipeline.stages.datasets.displaced_runs import ends, left_seat, overturned_runs
from pipeline.stages.displacement import correlation_figures
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.fig_15 import SOURCES as SOURCES
from pipeline.stages.figures.paper import Data, Finding, by_rule
from vsr_core.arrays import Array

TITLE = "Lengths of the trajectories"

SITE_KEYS = {"displacement": ("observed_boulder",)}

LONGEST, BOTH = 0.1, 0.9
"""Share of the trajectories that are called long, and of these that need both to be large."""

NICHE, FEWEST = 2.0, 0.02
"""Radius of the niche in standard deviations of the found place, and share of the toppled runs
that make a cluster there."""


def draw(data: Data) -> Figure:
    """Draw the length of each trajectory over PGA and PGV/PGA."""
    return correlation_figures.trajectory_lengths(
        data["displacement"], diagrams.terrain_source(data["rock"])
    )


def findings(data: Data) -> list[Finding]:
    """Compare with section 5.4."""
    runs = overturned_runs(data["displacement"])
    length = runs["trajectory_length"]
    long = runs[length >= length.quantile(1.0 - LONGEST)]
    middle = runs[["pga", "pgv_pga"]].median()
    both = (long[["pga", "pgv_pga"]] >= middle).all(axis=1)
    above = float(both.mean()) if len(both) else math.nan
    trends = {name: spearmanr(runs[name], length) for name in ("pga", "pgv_pga")}
    result = "; ".join(
        f"{correlation_figures.NAMES[name]}: {one.statistic:.2f}, p = "
        f"{correlation_figures.power(one.pvalue)}"
        for name, one in trends.items()
    )
    return [
        Finding(
            "Fig. 16a, section 5.4",
            "Trajectories are long only where both PGA and PGV/PGA are large.",
            f"of the longest {100 * LONGEST:g} %, {100 * BOTH:g} % have both above the median of "
            "the toppled runs",
            f"{100 * above:.0f} % of {len(long)}, on a surrogate terrain",
            by_rule(above >= BOTH, above),
        ),
        Finding(
            "Fig. 16b, c, section 5.4",
            "Length grows with PGA and with PGV/PGA.",
            "rank correlations over the runs above 0, p below 0.001",
            result,
            by_rule(
                all(one.statistic > 0.0 and one.pvalue < 1e-3 for one in trends.values()),
                *(one.pvalue for one in trends.values()),
            ),
        ),
        _niche(data["displacement"], data["terrain"]),
    ]


def _niche(displacement: xr.Dataset, terrain: xr.Dataset) -> Finding:
    """The cluster of trajectories that end in the niche."""
    where, claim = "Fig. 16b, c, section 5.4", (
        "A cluster of trajectories of about the same length, near 6 m, ends in a niche."
    )  # fmt: skip
    found = displacement.attrs["observed_boulder"]
    rule = (
        f"at least {100 * FEWEST:g} % of the toppled runs end within {NICHE:g} standard "
        "deviations of it"
    )
    if found is None:
        return Finding(where, claim, rule, "the site names no niche", None)
    place = np.array(found["position"]) - np.asarray(terrain.attrs["origin_in_scan"])[:2]
    chosen = left_seat(displacement)
    if not chosen.any():
        return Finding(where, claim, rule, "nothing topples", None)
    apart: Array = np.linalg.norm(ends(displacement)[chosen] - place, axis=1)
    inside = apart <= NICHE * found["position_sd"]
    length = displacement["trajectory_length"].values[chosen][inside]
    spread = np.percentile(length, (25, 50, 75)) if inside.any() else np.zeros(3)
    measured = (
        f"{inside.sum()} of {chosen.sum()} ({100 * inside.mean():.1f} %), their lengths "
        f"{spread[1]:.1f} m in the median, half of them from {spread[0]:.1f} to {spread[2]:.1f} m; "
        "the surrogate terrain has a niche made for this"
    )
    return Finding(where, claim, rule, measured, bool(inside.mean() >= FEWEST))
