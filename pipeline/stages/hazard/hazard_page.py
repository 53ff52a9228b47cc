"""Page of hazard: the values its template is filled with, and its sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.paths import kept
from pipeline.drawing.style import svg_uri
from pipeline.stages.hazard import hazard_figures as figures
from pipeline.stages.hazard import sensitivity
from pipeline.stages.hazard.curve_folder import Curves
from pipeline.stages.hazard.hazard_dataset import COLUMNS, OF_EVENTS, SCALES, pga_at
from pipeline.stages.hazard.hazard_model import MOST_PGA
from pipeline.stages.hazard.rock_ages import of_age
from pipeline.stages.hazard.shaking_ratio import DEFAULT, DRAWN_AGAIN, AssumedShaking
from pipeline.stages.hazard.survival_analysis import SurvivalAnalysis
from pipeline.stages.mesh.products import RockData
from pipeline.workflow.grammar import form, listed
from vsr_core.arrays import Array, Mask
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import CORRELATION, LOG_SD
from vsr_core.hazard.shaking import EventShaking

MOST_ROWS = 40
"""Branches in the table of the page, the heaviest; all are in ``hazard.csv``."""

MOST_NAMED = 8
"""Branches that a sentence names; of more it gives the number."""


def page(
    site: str,
    config: HazardConfig,
    shape: RockData,
    analysis: SurvivalAnalysis,
    assumed: AssumedShaking,
    hazard: xr.Dataset,
    curves: Curves,
) -> dict[str, Any]:
    """Values for the template."""
    rock, known = analysis.rocks[0].fragility, shape.data.attrs
    origin = {"source": known["shape_source"], "surrogate": known["surrogate"]}
    drawn = {
        "curves": figures.curves(hazard, rock.tested),
        "survival": figures.survival(hazard, config.minimum_survival_probability),
        "shaking": figures.shaking(hazard, rock.tested),
    }
    if hazard.sizes["branch"] > 1:
        drawn["weights"] = figures.weights(hazard)
    return {
        "site": site,
        "curves": kept(curves.path),
        "unused": curves.unused,
        "about": curves.about,
        "origin": origin,
        "config": config,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
        "place": of_location(analysis.model.location),
        "ratio": assumed.source,
        "events": _events(assumed, hazard),
        "default": DEFAULT,
        "correlation": CORRELATION,
        "log_sd": LOG_SD,
        "records": rock.records,
        "range": rock.source,
        "drawn": analysis.drawn,
        "fitted": ", ".join(one.name for one in analysis.rocks if not one.drawn),
        "tested": rock.tested,
        "hatched": [*figures.untried(hazard, rock.tested)],
        "frictions": listed([f"{one:g}" for one in rock.frictions]) if rock.frictions else "",
        "yaws": len(rock.by_yaw),
        "percent": lambda share: percent(share).replace(" ", "\N{NO-BREAK SPACE}"),
        "every": every,
        **_results(analysis, hazard, config),
        **_shaking(hazard, rock.tested),
        "rocks": _rocks(config, analysis),
    }


def _results(
    analysis: SurvivalAnalysis, hazard: xr.Dataset, config: HazardConfig
) -> dict[str, Any]:
    names = hazard["branch"].values.tolist()
    rejected = hazard["rejected"].values == 1
    survivals = hazard["survival"].values
    at = hazard.sel(return_period=2475.0)
    pga = at["pga_before"].item(), at["pga_dropped"].item(), at["pga_after"].item()
    minimum, number = config.minimum_survival_probability, len(analysis.rocks)
    heavy = np.argsort(-hazard["weight"].values, kind="stable")[:MOST_ROWS]
    of_case = ("survival", "rejected", "pga_after", "toppling_rate")
    columns = ("case", *(f"case_{name}" for name in of_case))
    keys = ("name", "survival", "rejected", "after", "rate")
    rows = zip(*(hazard[column].values.tolist() for column in columns), strict=True)
    cases = [dict(zip(keys, row, strict=True)) for row in rows]
    periods = ("return_period", "pga_before", "pga_dropped", "pga_after")
    return {
        "sentence": sentence(names, rejected, survivals, minimum, pga, number),
        "least": f"{100.0 * minimum:g}\N{NO-BREAK SPACE}%",
        "none_left": bool(rejected.all()),
        "some_rejected": bool(rejected.any()),
        "fewest": int((hazard["survival_high"].values < minimum).sum()),
        "most": int((hazard["survival_low"].values < minimum).sum()),
        "lost_weight": float(hazard["weight"].values[rejected].sum()),
        "mean_survival": float(analysis.weights @ survivals),
        "branch_count": len(names),
        "branches": [_row(hazard.isel(branch=i)) for i in np.sort(heavy)],
        "periods": np.column_stack([hazard[name] for name in periods]).tolist(),
        "scale": hazard["scale_factor"].item(),
        "scales": _by_rows(*(hazard[name].item() for name in SCALES)),
        "effective": [hazard[f"effective_branches_{name}"].item() for name in ("before", "after")],
        "cases": cases,
        "anew": next((case for case in cases if case["name"] == sensitivity.DRAWN_ANEW), None),
        "sampling": float(hazard["survival_error"].max()),
    }


def _by_rows(scale: float, low: float, high: float) -> str:
    """The ends of a factor by other PGV/PGA of the runs, in brackets; empty where they are it.

    >>> _by_rows(1.4, 1.2, 2.0), _by_rows(1.4, 1.2, math.inf)
    (' (1.2 to 2 by other PGV/PGA of the runs)', ' (1.2 or more by other PGV/PGA of the runs)')
    """
    ends = [f"{one:.3g}" for one in (low, high)]
    if {*ends} == {f"{scale:.3g}"}:
        return ""
    span = " to ".join(ends) if high < math.inf else f"{ends[0]} or more"
    return f" ({span} by other PGV/PGA of the runs)"


def _row(branch: xr.Dataset) -> dict[str, Any]:
    names = ["branch_path" if name == "path" else name for name in (*COLUMNS, *OF_EVENTS)]
    return {name: branch[name].item() for name in names if name in branch}


def _shaking(hazard: xr.Dataset, tested: tuple[float, float]) -> dict[str, Any]:
    """Shaking that would topple the rock, and the part beyond the curves and the runs."""
    by_pga, starts = hazard["toppling_rate_by_pga"].values, hazard["pga_bin"].values
    rate = float(by_pga.sum())
    # PGA up to which a share of the rate comes, straight in ln PGA within a bin
    summed, ends = np.append(0.0, np.cumsum(by_pga)), np.append(starts, starts[-1])
    quantiles = np.exp(np.interp(np.array([0.05, 0.5, 0.95]) * summed[-1], summed, np.log(ends)))
    return {
        "rate": rate,
        "toppling_pga": quantiles.tolist(),
        "untested": float(by_pga[starts >= tested[1]].sum() / rate) if rate > 0.0 else math.nan,
        "first_level": float(hazard["pga"][0]),
        "last_level": float(hazard["pga"][-1]),
        "at_first": hazard["probability_at_first_level"].item(),
        "open_beyond": hazard["toppling_rate_beyond"].item(),
    }


def _events(assumed: AssumedShaking, hazard: xr.Dataset) -> dict[str, Any] | None:
    """What the page tells of simulated earthquakes; None of curves."""
    if not isinstance(assumed.shaking, EventShaking):
        return None
    events = assumed.shaking.events
    rates = dict(zip(hazard["case"].values, hazard["case_toppling_rate"].values, strict=True))
    return {
        "number": f"{len(events.pga):,}",
        "years": f"{events.years:,.0f}",
        "pgv": events.pgv is not None,
        "correlation": events.correlation() if DRAWN_AGAIN in rates else math.nan,
        "rate": rates[sensitivity.BASE_CASE],
        "error": hazard["mean_toppling_rate_error"].item(),
        "independent": hazard["mean_toppling_rate_error_independent"].item(),
        "anew": rates.get(DRAWN_AGAIN),
    }


def _rocks(config: HazardConfig, analysis: SurvivalAnalysis) -> list[dict[str, str]]:
    """Age and survival of each rock alone."""
    given = [config.age, *(one.age for one in config.rocks)]
    rows = []
    for number, (rock, age) in enumerate(zip(analysis.rocks, given, strict=True)):
        assert age is not None
        alone = float(analysis.weights @ analysis.survival_alone(number))
        row = {"name": rock.name, "age": of_age(age), "survival": percent(alone)}
        rows.append(row | {"source": age.source})
    return rows


def percent(share: float) -> str:
    """A probability in percent, to two digits where it is small.

    >>> percent(0.4123), percent(0.0523), percent(0.02), percent(0.0), percent(1.0)
    ('41 %', '5.2 %', '2.0 %', 'less than 0.01 %', '100 %')
    """
    if share < 1e-4:
        return "less than 0.01 %"
    return f"{100.0 * share:{'.0f' if share >= 0.0995 else '#.2g'}} %"


def every(rate: float) -> str:
    """Mean time between events of a rate [1/year] in years, to two digits.

    >>> every(5.45e-5), every(0.4), every(0.0)
    ('18,000', '2.5', '∞')
    """
    return f"{float(f'{1.0 / rate:.2g}'):,.15g}" if rate > 0.0 else "\N{INFINITY}"


def sentence(
    names: Sequence[str],
    rejected: Mask,
    survival: Array,
    minimum: float,
    pga: tuple[float, float, float],
    rocks: int = 1,
) -> str:
    """The result in one sentence.

    Parameters
    ----------
    rejected : ndarray of bool, shape (branches,)
    survival : ndarray, shape (branches,)
    minimum : float, probability of survival below which a branch is rejected
    pga : tuple of float [g]
        Exceeded once in 2,475 years: prior, without the rejected branches, and posterior.

    Examples
    --------
    >>> gone = np.array([False, True, True])
    >>> text = sentence(["2", "3", "7"], gone, 0.01 * ~gone, 0.05, (0.41, 0.31, 0.29))
    >>> text[:69]
    "The rock's survival probability is below 5 % under branches 3 and 7; "
    >>> text[69:127]
    'without them the 2,475-year PGA falls from 0.41 to 0.31 g,'
    >>> text[127:]
    ' and with the others weighted by survival it is 0.29 g.'
    """
    whose = "The rock's" if rocks == 1 else f"The {rocks} rocks' joint"
    below = f"{whose} survival probability is below {100.0 * minimum:g} %"
    if len(names) == 1:
        verdict = "rejected" if rejected[0] else "retained"
        one = f"{whose} survival probability under the one curve given is {percent(survival[0])}"
        return f"{one}; the curve is {verdict}."
    if rejected.all():
        return f"{below} under every branch: model, age and fragility are inconsistent."
    if not rejected.any():
        worst = int(np.argmin(survival))
        lowest = f"the lowest, under branch {names[worst]}, is {percent(survival[worst])}"
        above = below.replace("below", "at least")
        moved = _moved(pga[0], pga[2])
        return f"{above} under every branch; {lowest}. Weighted by survival, {moved}."
    gone = [name for name, out in zip(names, rejected, strict=True) if out]
    if len(gone) > MOST_NAMED:
        which = f"{len(gone):,} of {len(names):,} branches"
    else:
        which = f"{form(len(gone), 'branch', 'branches')} {listed(gone)}"
    text = f"{below} under {which}; without {form(len(gone), 'it', 'them')} {_moved(*pga[:2])}"
    dropped, after = (f"{value:.2f}" for value in pga[1:])
    if after not in (dropped, "nan"):
        text += f", and with the others weighted by survival it is {after} g"
    return f"{text}."


def _moved(before: float, after: float) -> str:
    shown = f"{before:.2f}", f"{after:.2f}"
    if not np.isfinite([before, after]).all():
        change = "is beyond the levels of the curves"
    elif shown[0] == shown[1]:
        change = f"stays at {shown[0]} g"
    else:
        change = f"{'falls' if after < before else 'rises'} from {shown[0]} to {shown[1]} g"
    return f"the 2,475-year PGA {change}"


def strength(mean: HazardCurve) -> str:
    """How strong shaking is by a mean curve, in which a wrong unit shows.

    >>> strength(HazardCurve(np.array([0.98, 9.8]), np.array([0.01, 0.0001])))
    'by the mean curve 0.218 g is exceeded once in 475 years, and 0.497 g once in 2,475 years'
    """
    told: list[str] = []
    for years in MOST_PGA:
        pga = pga_at(mean, years)
        shown = "a PGA beyond its levels" if math.isnan(pga) else f"{pga:.3g} g"
        told.append(f"{shown}{'' if told else ' is exceeded'} once in {years:,} years")
    return f"by the mean curve {', and '.join(told)}"


def of_location(place: tuple[float, float] | None) -> str:
    """A longitude and latitude [degree] with their hemispheres, where they are told.

    >>> of_location((-120.86, 35.19))
    '120.86° W, 35.19° N'
    """
    if place is None:
        return "an unnamed place"
    longitude, latitude = place
    east, north = "E" if longitude >= 0.0 else "W", "N" if latitude >= 0.0 else "S"
    return f"{abs(longitude):.5g}° {east}, {abs(latitude):.5g}° {north}"
