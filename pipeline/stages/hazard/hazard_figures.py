"""Figures of the hazard page: curves over fragility, survival against age, weights, shaking."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.legend import Legend

from pipeline.drawing import style
from pipeline.workflow.datasets import label

MOST_BARS = 40
"""Branches whose weights are drawn, the heaviest; bars of more are not legible."""

_SOLID = 60
"""Branches that are drawn solid; more are drawn the fainter, the more there are."""

_SHOWN = 0.999
"""Share of the toppling rate in the rows of PGV/PGA that are drawn; the others look empty."""

_BEFORE, _AFTER = style.SERIES[0], style.SERIES[1]
_RETAINED, _REJECTED = style.FAINT, style.OVERTURNED


@style.styled
def curves(hazard: xr.Dataset, tested: tuple[float, float]) -> Figure:
    """Prior and posterior hazard curves, and below them the rock's fragility.

    Parameters
    ----------
    tested : tuple of float [g], least and largest PGA that was simulated
    """
    figure = Figure(figsize=(6.2, 6.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.7, 1.0])
    pga = hazard["pga"].values
    _branches(above, pga, hazard["branch_rate"].values, hazard["rejected"].values)
    for name, word, colour, look in (
        ("before", "prior", _BEFORE, "-"),
        ("after", "posterior", _AFTER, "--"),
    ):
        mean = hazard[f"mean_rate_{name}"].values
        if hazard.sizes["branch"] == 1 or np.isnan(mean).all():
            continue  # a single branch is its own mean
        rows = hazard[f"rate_{name}"].sel(fractile=[0.05, 0.95]).values
        rows = np.where(rows > 0.0, rows, np.nan)
        band: Any = {"color": colour, "alpha": 0.22, "lw": 0, "label": f"{word}, 5-95 %"}
        above.fill_between(pga, *rows, **band)
        above.plot(pga, mean, look, color=colour, lw=2.0, label=f"{word}, mean")
    above.set(yscale="log", ylim=(1e-6, None), ylabel="annual rate of exceedance")
    for years in hazard["return_period"].values:
        above.axhline(1.0 / years, color=style.INK, lw=0.5, ls=":")
        text = f"{years:,.0f} years"
        above.text(pga[0], 1.0 / years, text, va="bottom", fontsize=7.5, path_effects=style.HALO)
    _solid(figure.legend(*above.get_legend_handles_labels(), loc="outside upper center", ncols=3))
    _fragility(below, hazard, tested)
    below.set_xlim(pga[0], pga[-1])
    _log_pga(below, pga[0], pga[-1])
    for axes in (above, below):
        axes.grid(visible=True)
    return figure


def _log_pga(axes: Axes, low: float, high: float) -> None:
    axes.set_xscale("log")
    ticks = [x for x in (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0) if low <= x <= high]
    axes.set_xticks(ticks, [f"{x:g}" for x in ticks])
    axes.minorticks_off()
    axes.set_xlabel(label("pga"))


def _branches(axes: Axes, pga: Any, rates: Any, rejected: Any) -> None:
    for out, colour, name in ((0, _RETAINED, "branch retained"), (1, _REJECTED, "branch rejected")):
        lines = [np.column_stack([pga, one]) for one in rates[rejected == out]]
        if lines:
            dashes = (0, (1, 1.2)) if out else "solid"
            look: Any = {"colors": colour, "linewidths": 0.8, "linestyles": [dashes], "zorder": 1}
            look["alpha"] = max(min(1.0, _SOLID / len(rejected)), 0.06)
            look |= {"label": name, "rasterized": len(lines) > 100}
            axes.add_collection(LineCollection(lines, **look))


def _solid(legend: Legend) -> None:
    """Draw the lines of a legend solid, though the many in the plot are faint."""
    for line in legend.get_lines():
        line.set_alpha(1.0)


def untried(hazard: xr.Dataset, tested: tuple[float, float]) -> dict[str, tuple[float, float]]:
    """PGA of the axis that were not simulated [g], by what a caption says of them."""
    low, high = hazard["pga"].values[[0, -1]].tolist()
    spans = {
        f"below {tested[0]:.3g}": (low, tested[0]),
        f"above {tested[1]:.3g}": (tested[1], high),
    }
    return {words: span for words, span in spans.items() if span[1] > span[0]}


def _fragility(axes: Axes, hazard: xr.Dataset, tested: tuple[float, float]) -> None:
    pga = hazard["pga"].values
    low, high = (hazard[f"toppling_probability_{end}"].values for end in ("low", "high"))
    axes.fill_between(pga, low, high, color=_RETAINED, alpha=0.35, lw=0)
    axes.plot(pga, hazard["toppling_probability"].values, color=style.INK, lw=1.8)
    for edge, end in untried(hazard, tested).values():
        axes.axvspan(edge, end, facecolor="none", edgecolor="#c9c9c9", hatch="///", lw=0)
    if pga[-1] > tested[1]:
        middle = np.sqrt(tested[1] * pga[-1])
        axes.text(middle, 0.06, "not simulated", ha="center", fontsize=7.5, path_effects=style.HALO)
    axes.set(ylim=(0.0, 1.0), ylabel="probability of toppling")


@style.styled
def survival(hazard: xr.Dataset, minimum: float) -> Figure:
    """Probability of survival under each branch against age, over the density of the age.

    Parameters
    ----------
    minimum : float, probability below which a branch is rejected
    """
    figure = Figure(figsize=(6.2, 4.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3.0, 1.0])
    age, probabilities = hazard["age"].values, hazard["survival_at_age"].values
    rejected = hazard["rejected"].values
    _branches(above, age, probabilities, rejected)
    above.axhline(minimum, color=style.INK, lw=0.9, ls="--", label=f"{100 * minimum:g} %")
    if len(probabilities) <= MOST_BARS:
        _name_branches(above, hazard)
    above.set(ylim=(0.0, 1.0), ylabel="probability of survival")
    _solid(figure.legend(*above.get_legend_handles_labels(), loc="outside upper center", ncols=3))
    below.fill_between(age, hazard["age_density"].values, step="mid", color=style.BASE, alpha=0.6)
    below.set(
        ylim=(0.0, None),
        yticks=[],
        ylabel="density\nof age",
        xlabel="age [years]",
        xlim=(0.0, age[-1]),
    )
    below.xaxis.set_major_formatter(lambda x, _: f"{x:,.0f}")
    above.grid(visible=True)
    return figure


def _name_branches(axes: Axes, hazard: xr.Dataset) -> None:
    """Write names beside lines that lie apart, inside of the axes."""
    age, probabilities = hazard["age"].values, hazard["survival_at_age"].values
    inside = np.flatnonzero((age >= 0.02 * age[-1]) & (age <= 0.98 * age[-1]))
    at = int(inside[np.abs(probabilities[:, inside].mean(axis=0) - 0.45).argmin()])
    side = "left" if age[at] < 0.5 * age[-1] else "right"
    order = np.argsort(-probabilities[:, at])
    groups: list[list[int]] = []
    for i in order:
        if groups and probabilities[groups[-1][0], at] - probabilities[i, at] < 0.05:
            groups[-1].append(int(i))
        else:
            groups.append([int(i)])
    for group in groups:
        names = [str(hazard["branch"].values[i]) for i in sorted(group)]
        text = ", ".join(names) if len(names) <= 6 else f"{len(names)} branches"
        height = np.clip(probabilities[group, at].mean(), 0.03, 0.97)
        look: Any = {"fontsize": 7.5, "ha": side, "va": "center", "path_effects": style.HALO}
        axes.text(age[at], height, text, **look)


@style.styled
def weights(hazard: xr.Dataset) -> Figure:
    """Prior and posterior weights of the branches."""
    heavy = np.argsort(-hazard["weight"].values, kind="stable")[:MOST_BARS]
    shown = hazard.isel(branch=np.sort(heavy))
    number = shown.sizes["branch"]
    figure = Figure(figsize=(6.2, 2.8), layout="constrained")
    axes = figure.add_subplot()
    place = np.arange(number)
    axes.bar(place - 0.2, shown["weight"], 0.4, color=_BEFORE, label="prior")
    axes.bar(place + 0.2, shown["new_weight"], 0.4, color=_AFTER, label="posterior")
    out = shown["rejected"].values == 1
    if out.any():
        axes.plot(place[out] + 0.2, 0.0 * place[out], "x", color=_REJECTED, label="rejected")
    axes.set_xticks(place, shown["branch"].values, rotation=90 if number > 15 else 0)
    axes.set(xlabel="branch", ylabel="weight")
    axes.legend(ncols=3)
    axes.margins(y=0.25)
    axes.grid(visible=True, axis="y")
    return figure


@style.styled
def shaking(hazard: xr.Dataset, tested: tuple[float, float]) -> Figure:
    """PGA and PGV/PGA of the earthquakes that would topple the rock.

    Parameters
    ----------
    tested : tuple of float [g], least and largest PGA that was simulated
    """
    figure = Figure(figsize=(6.2, 4.6), layout="constrained")
    above, axes = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 2.2])
    starts = hazard["pga_bin"].values
    edges = np.append(starts, starts[-1] * starts[-1] / starts[-2])
    share = hazard["toppling_rate_by_pga"].values
    share = share / share.sum() if share.sum() > 0.0 else share
    above.stairs(100.0 * share, edges, fill=True, color=style.BASE, alpha=0.7)
    above.set_ylabel("share [%]")
    both = hazard["toppling_rate_by_pgv_pga"].values
    total = both.sum()
    borders = style.cell_edges(hazard["pgv_pga"].values)
    percent = 100.0 * both / total if total > 0.0 else both
    image = axes.pcolormesh(edges, borders, percent, cmap="magma_r", rasterized=True)
    figure.colorbar(image, ax=axes, label="share of the toppling rate [%]")
    for panel in (above, axes):
        panel.axvline(tested[1], color=style.INK, lw=0.8, ls="--")
    _log_pga(axes, starts[0], edges[-1])
    axes.set_ylabel("PGV/PGA [s]")
    above_all = np.searchsorted(np.cumsum(both.sum(axis=1)), _SHOWN * total) + 1
    axes.set_ylim(borders[0], borders[min(above_all, len(borders) - 1)])
    return figure
