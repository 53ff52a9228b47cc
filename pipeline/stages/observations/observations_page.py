"""The page of the observations: what each taught, and what a further test would teach."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from pipeline.drawing import style
from pipeline.stages.observations.evidence import Evidence
from pipeline.workflow.grammar import counted, form
from vsr_core.arrays import Array
from vsr_core.observations import weighing

ALIKE = 0.02
"""Difference of expected reductions that is none."""


def facts(
    site: str, found: xr.Dataset, evidence: Sequence[Evidence], pictures: dict[str, str]
) -> dict[str, Any]:
    """Values for the template."""
    prior, posterior = (np.exp(found["width"].values[at]) for at in (0, 1))
    low = found["tipping_band"].values[1, 1]
    best = reductions(found)
    return {
        "site": site,
        "draws": found.sizes["draw"],
        "members": found.sizes["member"],
        "effective": float(found.attrs["effective_number"]),
        "few": float(found.attrs["effective_number"]) < found.sizes["member"],
        "observations": taught(found, evidence),
        "before": float(np.median(prior)),
        "after": float(np.median(posterior)),
        "weak": float(found["direction"][low.argmin()]),
        "weak_before": float(prior[low.argmin()]),
        "weak_after": float(posterior[low.argmin()]),
        "directions": directions(found),
        "unknowns": unknowns(found),
        "best": [
            f"{way:g}" for way in found["test_direction"].values[best > best.max() - ALIKE].tolist()
        ],
        "best_reduction": float(best.max()),
        "test_sd": float(found.attrs["test_sd_degree"]),
        "pictures": pictures,
    }


def taught(found: xr.Dataset, evidence: Sequence[Evidence]) -> list[dict[str, Any]]:
    """Each observation, what the draws expected of it, and how many of them it leaves alone."""
    rows = []
    ln_tipping = np.log(found["draw_tipping_pga"].values)
    for at, one in enumerate(evidence):
        known = np.isfinite(one.expected)
        own = one.expected[known]
        if one.unit:
            low, high = (f"{end:,.{_digits(end)}f}" for end in np.quantile(own, (0.05, 0.95)))
            expected = f"{low} to {high}{'' if one.unit == '°' else ' '}{one.unit}"
        else:
            expected = f"{100.0 * own.mean():.0f} % stand"
        tried = ln_tipping[np.isfinite(one.log_likelihood)]
        whole = weighing.width(tried, np.full(len(tried), 1.0 / len(tried)))
        alone = weighing.width(tried, weighing.left(one.log_likelihood))
        rows.append(
            {
                "words": str(found["observation"].values[at]),
                "repairs": str(found["repairs"].values[at]),
                "expected": expected,
                "left": float(found["alone_effective"][at]) / len(tried),
                "narrower": float(_narrower(alone.mean(), whole.mean())),
            }
        )
    return rows


def _digits(value: float) -> int:
    return 0 if abs(value) >= 100.0 else 2


def directions(found: xr.Dataset) -> list[dict[str, Any]]:
    """The band in each direction before and after, and after a further tilt test there."""
    bands, wanted = found["tipping_band"].values, found["expected_width"].values
    return [
        {
            "direction": float(direction),
            "prior": bands[0, :, at].tolist(),
            "posterior": bands[1, :, at].tolist(),
            "angle": float(np.degrees(np.arctan(bands[1, 1, at]))),
            "then": float(np.exp(wanted[at, at])),
            "now": float(np.exp(found["width"].values[1, at])),
            "reduction": float(reductions(found)[at]),
        }
        for at, direction in enumerate(found["direction"].values)
    ]


def reductions(found: xr.Dataset) -> Array:
    """Share of the band, in the mean over directions, that a tilt test in each is to take off."""
    return _narrower(found["expected_width"].values.mean(axis=1), found["width"].values[1].mean())


def _narrower(after: ArrayLike, before: ArrayLike) -> Array:
    """Share that is taken off the widths of bands: 0 of a band that has none."""
    left = np.divide(after, before, out=np.ones(np.shape(after)), where=np.greater(before, 0.0))
    return np.asarray(1.0 - left)


def unknowns(found: xr.Dataset) -> list[dict[str, Any]]:
    """What was drawn, before and after: 5 %, median and 95 %."""
    weight = found["draw_weight"].values
    alike = np.full(len(weight), 1.0 / len(weight))
    centre = 1e3 * found["drawn_centre"].values
    columns = [
        ("friction", found["drawn_friction"].values, ""),
        ("inset of the base, of the height of the centre of mass", found["drawn_inset"].values, ""),
        *((f"centre of mass along {axis}", centre[:, at], "mm") for at, axis in enumerate("xyz")),
    ]
    return [
        {
            "name": name,
            "unit": unit,
            "prior": weighing.quantiles(values[:, None], alike)[:, 0].tolist(),
            "posterior": weighing.quantiles(values[:, None], weight)[:, 0].tolist(),
        }
        for name, values, unit in columns
        if np.ptp(values) > 0.0
    ]


def summary(found: xr.Dataset) -> str:
    """One line for the log."""
    before, after = (float(np.exp(np.median(one))) for one in found["width"].values)
    number = found.sizes["observation"]
    return (
        f"{counted(number, 'observation')} {form(number, 'leaves', 'leave')} "
        f"{found.attrs['effective_number']:.0f} of {found.sizes['draw']} draws; the band of the "
        f"tipping acceleration spans a factor of {before:.2f} before and {after:.2f} "
        "after, in the median direction"
    )


@style.styled
def band(found: xr.Dataset) -> Figure:
    """The static tipping acceleration against direction, before and after."""
    figure = Figure(figsize=(6.6, 3.8), layout="constrained")
    axes = figure.add_subplot()
    way = np.append(found["direction"].values, 360.0)
    for at, (name, colour, alpha) in enumerate(
        (("prior", style.FAINT, 0.35), ("with the observations", style.MODEL, 0.75))
    ):
        low, middle, high = (np.append(one, one[0]) for one in found["tipping_band"].values[at])
        axes.fill_between(way, low, high, color=colour, alpha=alpha, lw=0, label=f"{name}, 5-95 %")
        axes.plot(way, middle, color=style.INK, lw=1.0, ls=("--", "-")[at], label=f"{name}, median")
    axes.set(
        xlabel="direction towards which the rock tips [degree]",
        ylabel="static tipping acceleration [g]",
        xticks=np.arange(0.0, 361.0, 60.0),
        xlim=(0.0, 360.0),
    )
    axes.set_ylim(bottom=0.0)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


@style.styled
def shares(found: xr.Dataset) -> Figure:
    """Share of the variance with each unknown, before and after."""
    figure = Figure(figsize=(7.2, 3.4), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    way = found["direction"].values
    for axes, own, title in zip(
        panels, found["tipping_share"].values, ("prior", "with the observations"), strict=True
    ):
        above = np.zeros(len(way))
        for at, name in enumerate(found["unknown"].values):
            part = np.clip(np.nan_to_num(own[:, at]), 0.0, None)
            if not np.nan_to_num(found["tipping_share"].values[:, :, at]).any():
                continue  # it is known
            axes.bar(way, part, 24.0, above, color=style.SERIES[at], label=name)
            above += part
        axes.set(title=title, xlabel="direction [degree]", xticks=np.arange(0.0, 360.0, 90.0))
    panels[0].set_ylabel("share of the variance")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


@style.styled
def further(found: xr.Dataset) -> Figure:
    """What a tilt test in each direction is to be expected to take off the band."""
    figure = Figure(figsize=(6.0, 3.2), layout="constrained")
    axes = figure.add_subplot()
    way = found["test_direction"].values
    here = _narrower(np.diag(found["expected_width"].values), found["width"].values[1])
    axes.bar(
        way - 6.0,
        100.0 * reductions(found),
        11.0,
        color=style.SERIES[0],
        label="of all directions, mean",
    )
    axes.bar(way + 6.0, 100.0 * here, 11.0, color=style.SERIES[4], label="of that direction")
    axes.set(
        xlabel="direction of a further tilt test [degree]",
        ylabel="expected reduction of the band [%]",
        xticks=np.arange(0.0, 360.0, 60.0),
        ylim=(0.0, 100.0),
    )
    figure.legend(loc="outside lower center", ncols=2)
    return figure
