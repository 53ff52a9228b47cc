"""Hazard: survival of a rock under each branch of a hazard model, and the posterior model.

Nothing is simulated here: other curves, another age or another table of PGV/PGA use the runs that
are there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import xarray as xr

from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.observation_schema import Observations
from pipeline.config.paths import shown
from pipeline.config.sections import Key
from pipeline.drawing.style import svg_uri
from pipeline.stages.fragility.summary import Fits
from pipeline.stages.hazard import hazard_figures as figures
from pipeline.stages.hazard import sensitivity
from pipeline.stages.hazard.curve_folder import Curves
from pipeline.stages.hazard.exclusion import ExclusionData
from pipeline.stages.hazard.exclusion import facts as of_earthquakes
from pipeline.stages.hazard.hazard_dataset import (
    COLUMNS,
    OF_EVENTS,
    dataset,
    drawn_tables,
    pga_at,
    table,
)
from pipeline.stages.hazard.hazard_model import MOST_PGA
from pipeline.stages.hazard.one_rock import Other, alike_in_shape
from pipeline.stages.hazard.open_ends import of_scale, open_cases, open_ends
from pipeline.stages.hazard.other_rocks import Others, dated
from pipeline.stages.hazard.rock_ages import of_age, years_observed
from pipeline.stages.hazard.rock_fragility import of_fits, of_members
from pipeline.stages.hazard.shaking_ratio import DEFAULT, DRAWN_AGAIN, AssumedShaking, of_hazard
from pipeline.stages.hazard.survival_analysis import SurvivalAnalysis
from pipeline.stages.mesh.products import RockData
from pipeline.stages.uncertainty.draws import EnsembleData
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted, form, listed
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array, Mask
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import CORRELATION, LOG_SD
from vsr_core.hazard.shaking import EventShaking

FILE, TABLE, PAGE = "hazard.nc", "hazard.csv", "hazard.html"


def make(
    work: Work,
    config: HazardConfig,
    curves: Curves,
    beside: Others,
    rock: RockData,
    fits: Fits,
    ensemble: EnsembleData | None,
    excluded: ExclusionData,
    observed: Annotated[Observations, Key("observations")],
) -> Product:
    """Reject and reweight the branches of a hazard model by a rock's survival.

    Returns
    -------
    Product
        ``hazard.nc``, ``hazard.html``, and tables of branches, curves, ages and cases.
    """
    model, name = curves.model, work.origin.name
    for unused in curves.unused:
        work.log(f"hazard: {unused}")
    drawn = ensemble is not None and config.support == "tested"
    own = of_members(ensemble.data) if ensemble and drawn else of_fits(fits)
    assert config.age is not None
    seen = observed if drawn else ()
    rocks = [dated(fits.folder, name, own, config.age, config.history, seen, beside.earlier)]
    for other, given in zip(beside.rocks, config.rocks, strict=True):
        now, known = other.fragility(fits.folder), (other.history, other.observed, other.earlier)
        rocks.append(dated(fits.folder, other.name, now, given.age, *known))
    made = [one for one in beside.rocks if isinstance(one, Other)]
    shapes = {one.name: RockData(one.folder(fits.folder)).data for one in made}
    for alike in alike_in_shape({name: rock.data} | shapes):
        work.log(f"hazard: {alike}")
    compared = {}
    if ensemble is not None:  # beside which settings are compared
        compared[sensitivity.AS_GIVEN if drawn else sensitivity.AS_TESTED] = (
            of_fits(fits) if drawn else of_members(ensemble.data)
        )
    for other in beside.compared:
        what = f"{sensitivity.AS_GIVEN}, {other.name}" if drawn else other.name
        compared[what] = other.fragility(fits.folder)
    used = [*(stage for rock in rocks for stage in rock.stages), *compared.values()]
    ratios = [one.ratios for one in used]
    assumed = of_hazard(config, model, curves.events, curves.disaggregated, ratios)
    minimum = config.minimum_survival_probability
    analysis = SurvivalAnalysis(model, tuple(rocks), assumed.shaking, minimum)
    work.log(f"hazard: {strength(analysis.before)}")
    by_member = analysis.survival_of_others()
    all_cases = sensitivity.cases(analysis, assumed.alternatives, compared)
    results = all_cases[0].results
    of_pgv = assumed.source == "curves"
    found = dataset(analysis, results, by_member, all_cases)
    beyond = open_ends(analysis, results, work.origin, of_pgv=of_pgv)
    scale, late = of_scale(analysis, found["scale_factor"].item(), of_pgv=of_pgv)
    found["scale_factor"] = (), scale
    of_others = open_cases(all_cases, compared, work.origin)
    not_known = (*beyond, *late, *of_others, *sensitivity.too_coarse(all_cases))
    for one in (*beside.slips(), *not_known):
        work.log(f"hazard: {one}")
    facts = page(name, config, rock, analysis, assumed, found, shown(curves.path), curves)
    others = [*beside.earlier, *(o for one in beside.rocks for o in (one, *one.earlier))]
    facts["earthquakes"] = sum(map(years_observed, [seen, *(one.observed for one in others)]))
    facts["history"] = [
        {"rock": of, "name": Path(one.site).stem, "until": of_age(one.until), "age": one.until}
        for of, stages in ((name, config.history), *((o.name, o.history) for o in beside.rocks))
        for one in stages
    ]
    facts |= {"unused": curves.unused, "not_known": not_known}
    facts["exclusion"] = of_earthquakes(excluded.data, minimum, own)
    files = {
        FILE: netcdf(described(found, work, "Hazard")),
        TABLE: writers.table(table(found)),
        **{name: writers.table(one) for name, one in drawn_tables(found).items()},
        PAGE: writers.text(pages.filled(PAGE, facts, work.up)),
    }
    rejected = int(results.rejected.sum())
    before, after = (
        "none" if math.isnan(pga) else f"{pga:.3g} g"
        for pga in (pga_at(one, 2475.0) for one in (analysis.before, results.after))
    )
    return Product(
        files,
        f"{rejected} of {counted(len(model.branches), 'branch', 'branches')} rejected; "
        f"2,475-year PGA: prior {before}, posterior {after}",
    )


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
    file: str,
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
        "curves": file,
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
        "effective": [hazard[f"effective_branches_{name}"].item() for name in ("before", "after")],
        "cases": cases,
        "anew": next((case for case in cases if case["name"] == sensitivity.DRAWN_ANEW), None),
        "sampling": float(hazard["survival_error"].max()),
    }


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
