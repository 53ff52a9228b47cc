"""The products of a hazard analysis: the table of branches, and the dataset behind its page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config import in_si
from pipeline.stages.hazard.rock_fragility import DRAWN, OTHER_ROWS
from pipeline.stages.hazard.sensitivity import BASE_CASE, Case
from pipeline.stages.hazard.survival_analysis import (
    BranchResults,
    Sampling,
    SurvivalAnalysis,
    sampling,
)
from vsr_core.arrays import Array
from vsr_core.hazard.curve import HazardCurve, effective_number, fractiles, mean_curve
from vsr_core.hazard.shaking import REACH
from vsr_core.hazard.survival import largest_scale
from vsr_core.hazard.toppling import FINEST, averaged, toppling

COLUMNS = ("branch", "path", "weight", "toppling_rate", "survival", "survival_low",
           "survival_high", "survival_error", "rejected", "new_weight")  # fmt: skip

SCALES = ("scale_factor", "scale_factor_low", "scale_factor_high")
"""The factor on the mean curve, and its ends by other PGV/PGA of the runs."""

OF_EVENTS = ("toppling_rate_error", "survival_sampling_error")
"""Columns of simulated earthquakes beside these."""

FRACTILES = (0.05, 0.16, 0.5, 0.84, 0.95)

RETURN_PERIODS = (475.0, 2475.0, 10_000.0)
"""Years for which the PGA of the mean curve is given."""

_AGES = 120
"""Ages at which survival is given."""

_BINS = 40
"""Bins of PGA in which the rate of toppling is given."""


def dataset(
    analysis: SurvivalAnalysis, results: BranchResults, others: Array, cases: Sequence[Case]
) -> xr.Dataset:
    """All results, in g, seconds and years.

    Parameters
    ----------
    others : ndarray, shape (n, branches), survival with each other fragility
    """
    levels = analysis.model.levels
    number = 2 + int(np.log(levels[-1] / levels[0]) / np.log(FINEST))
    at = np.geomspace(levels[0], levels[-1], number)
    branches = analysis.model.branches
    low, high = survival_range(analysis, others)
    own = xr.Dataset(
        {
            "branch_path": ("branch", [one.path for one in branches]),
            "weight": ("branch", analysis.weights),
            "toppling_rate": ("branch", results.rates),
            "survival": ("branch", results.survival),
            "survival_low": ("branch", low),
            "survival_high": ("branch", high),
            "survival_error": ("branch", survival_error(analysis, others)),
            "rejected": ("branch", results.rejected.astype(np.int8)),
            "new_weight": ("branch", results.weights),
        },
        {"branch": [one.name for one in branches], "pga": in_si.in_g(at)},
    )
    return xr.merge(
        [
            own,
            _fragility(analysis, at),
            _curves(analysis, results, at),
            _by_age(analysis, analysis.rocks[0].ages),
            _disaggregated(analysis),
            _cases(cases),
            _scaled(cases),
            _sampled(sampling(analysis, results)),
        ],
        combine_attrs="drop",
    )


def survival_range(analysis: SurvivalAnalysis, others: Array) -> tuple[Array, Array]:
    """Range of survival under each branch: 5-95 % of draws, or the ends of the fits.

    Parameters
    ----------
    others : ndarray, shape (n, branches)

    Returns
    -------
    low, high : ndarray, shape (branches,)
    """
    if analysis.drawn:
        low, high = np.percentile(others, [5.0, 95.0], axis=0)
        return low, high
    return others.min(axis=0), others.max(axis=0)


MORE_THAN_ONE = 1.0 + 1e-9
"""Least effective number of draws whose error is known."""


def survival_error(analysis: SurvivalAnalysis, others: Array) -> Array:
    """Standard error of survival for the number of draws, shape (branches,); 0 of fits.

    NaN of one draw, which tells nothing of it.

    Of several rocks the one with the fewest counts: of it draws come again beside those of others.
    Draws that observations chose several times count by their effective number n, from n s^2 /
    (n - 1) for the variance of one (Kish 1965, Survey Sampling).

    Parameters
    ----------
    others : ndarray, shape (n, branches)
    """
    if not analysis.drawn:
        return np.zeros(len(analysis.curves))
    number = min(rock.effective for rock in analysis.rocks if rock.drawn)
    if number < MORE_THAN_ONE:
        return np.full(len(analysis.curves), np.nan)
    return np.asarray(others.std(axis=0) / np.sqrt(number - 1.0))


def table(found: xr.Dataset) -> pd.DataFrame:
    """The branches, one a row."""
    own = {"path": "branch_path"}
    names = [*COLUMNS, *(name for name in OF_EVENTS if name in found)]
    frame = pd.DataFrame({name: found[own.get(name, name)].values for name in names})
    return frame.rename(columns=lambda name: f"{name}_per_year" if "rate" in name else name)


def drawn_tables(found: xr.Dataset) -> dict[str, pd.DataFrame]:
    """What each figure of the page shows, and its cases, by the names of tables."""
    branches = found["branch"].values
    curves = {
        "toppling_probability": found["toppling_probability"],
        "toppling_probability_low": found["toppling_probability_low"],
        "toppling_probability_high": found["toppling_probability_high"],
        **{f"mean_{when}_per_year": found[f"mean_rate_{when}"] for when in ("before", "after")},
    }
    for when in ("before", "after"):
        for fractile, rates in zip(FRACTILES, found[f"rate_{when}"], strict=True):
            curves[f"fractile_{fractile:g}_{when}_per_year"] = rates
    for branch, rates in zip(branches, found["branch_rate"], strict=True):
        curves[f"branch_{branch}_per_year"] = rates
    ages = {"age_density_per_year": found["age_density"]}
    for branch, survival in zip(branches, found["survival_at_age"], strict=True):
        ages[f"survival_branch_{branch}"] = survival
    cases = {"survival": "survival", "toppling_rate": "toppling_rate_per_year",
             "rejected": "branches_rejected", "pga_after": "posterior_2475_year_pga_g"}  # fmt: skip
    of_case = {told: found[f"case_{name}"] for name, told in cases.items()}
    return {
        "hazard_curves.csv": _columns("pga_g", found["pga"], curves),
        "hazard_survival.csv": _columns("age_years", found["age"], ages),
        "hazard_cases.csv": _columns("case", found["case"], of_case),
    }


def _columns(name: str, along: xr.DataArray, others: dict[str, xr.DataArray]) -> pd.DataFrame:
    return pd.DataFrame({name: along.values} | {k: one.values for k, one in others.items()})


def pga_at(curve: HazardCurve | None, years: float) -> float:
    """PGA that is exceeded once in so many years [g]; NaN beyond the levels of a curve."""
    return float("nan") if curve is None else float(in_si.in_g(curve.level_at(1.0 / years)))


def _fragility(analysis: SurvivalAnalysis, at: Array) -> xr.Dataset:
    """The first rock's, with its range, and the PGV/PGA over which it was averaged."""
    rock, shaking = analysis.rocks[0].fragility, analysis.shaking
    span = analysis.model.levels[[0, -1]] * [1.0 / REACH, REACH]
    own = averaged(rock.mean, rock.ratios, shaking.table, span)
    others = [averaged(one, rock.ratios, shaking.table, span)(at) for one in rock.others]
    shares = (5.0, 95.0) if rock.source == DRAWN else (0.0, 100.0)
    low, high = np.percentile(others, shares, axis=0)
    median, log_sd = shaking.table.at(at)
    whole = toppling(analysis.before, own)
    return xr.Dataset(
        {
            "toppling_probability": ("pga", own(at)),
            "toppling_probability_low": ("pga", low),
            "toppling_probability_high": ("pga", high),
            "pgv_pga_median": ("pga", median),
            "pgv_pga_log_sd": ("pga", log_sd),
            "probability_at_first_level": ((), whole.below),
            "toppling_rate_beyond": ((), whole.beyond),
        }
    )


def _curves(analysis: SurvivalAnalysis, results: BranchResults, at: Array) -> xr.Dataset:
    """Curves of the branches, and their mean and fractiles before and after."""
    after, only_dropped = np.full((len(FRACTILES), len(at)), np.nan), None
    if results.after is not None:
        after = fractiles(analysis.curves, results.weights, at, FRACTILES)
        weights = np.where(results.rejected, 0.0, analysis.weights)
        only_dropped = mean_curve(analysis.curves, weights / weights.sum(), analysis.model.levels)
    curves = {"before": analysis.before, "after": results.after, "dropped": only_dropped}
    before = fractiles(analysis.curves, analysis.weights, at, FRACTILES)
    return xr.Dataset(
        {
            "branch_rate": (("branch", "pga"), [_rates(one, at) for one in analysis.curves]),
            "mean_rate_before": ("pga", _rates(analysis.before, at)),
            "mean_rate_after": ("pga", _rates(results.after, at)),
            "rate_before": (("fractile", "pga"), before),
            "rate_after": (("fractile", "pga"), after),
            **{
                f"pga_{name}": ("return_period", [pga_at(one, years) for years in RETURN_PERIODS])
                for name, one in curves.items()
            },
            "effective_branches_before": ((), effective_number(analysis.weights)),
            "effective_branches_after": ((), effective_number(results.weights)),
        },
        {"fractile": list(FRACTILES), "return_period": list(RETURN_PERIODS)},
    )


def _scaled(cases: Sequence[Case]) -> xr.Dataset:
    """The largest factor on the mean curve, and its ends by other PGV/PGA of the runs."""
    analyses = [one.analysis for one in cases if one.name in (BASE_CASE, *OTHER_ROWS)]
    found = [largest_scale(one.survival_scaled, one.minimum) for one in analyses]
    return xr.Dataset(dict(zip(SCALES, (found[0], min(found), max(found)), strict=True)))


def _rates(curve: HazardCurve | None, at: Array) -> Array:
    """Rates of a curve; NaN beyond its levels."""
    return np.full(len(at), np.nan) if curve is None else curve.rate_at(at)


def _by_age(analysis: SurvivalAnalysis, ages: Array) -> xr.Dataset:
    """Survival of the first rock alone against its age, and how likely the ages are."""
    edges = np.linspace(0.0, 1.35 * np.percentile(ages, 99.0), _AGES + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    survival = analysis.survival_for(0, middles)
    density, _ = np.histogram(ages, bins=edges, density=True)
    return xr.Dataset(
        {"survival_at_age": (("branch", "age"), survival), "age_density": ("age", density)},
        {"age": middles},
    )


def _disaggregated(analysis: SurvivalAnalysis) -> xr.Dataset:
    """Rate of toppling of the first rock under the mean curve, by PGA and by PGV/PGA."""
    rock = analysis.rocks[0].fragility
    parts, rates = analysis.mean_shaking.by_row(rock.mean, rock.ratios)
    last = rates.shape[1] - 1  # of curves the part of all beyond the last level
    starts = np.append(np.arange(0, last, -(-last // _BINS)), last)
    binned, edges = np.add.reduceat(rates, starts, axis=1), in_si.in_g(parts[starts])
    return xr.Dataset(
        {
            "toppling_rate_by_pga": ("pga_bin", binned.sum(axis=0)),
            "toppling_rate_by_pgv_pga": (("pgv_pga", "pga_bin"), binned),
            "pga_bin_end": ("pga_bin", np.append(edges[1:], np.inf)),
        },
        {"pga_bin": edges, "pgv_pga": rock.ratios},
    )


def _cases(cases: Sequence[Case]) -> xr.Dataset:
    survival, rates = (
        [float(one.analysis.weights @ getattr(one.results, name)) for one in cases]
        for name in ("survival", "rates")
    )
    after = [pga_at(one.results.after, RETURN_PERIODS[1]) for one in cases]
    return xr.Dataset(
        {
            "case_survival": ("case", survival),
            "case_toppling_rate": ("case", rates),
            "case_rejected": ("case", [int(one.results.rejected.sum()) for one in cases]),
            "case_pga_after": ("case", after),
        },
        {"case": [one.name for one in cases]},
    )


def _sampled(errors: Sampling | None) -> xr.Dataset:
    """Standard errors of what was found from simulated earthquakes; none of curves."""
    if errors is None:
        return xr.Dataset()
    return xr.Dataset(
        {
            "toppling_rate_error": ("branch", errors.rates),
            "survival_sampling_error": ("branch", errors.survival),
            "mean_toppling_rate_error": ((), errors.mean_rate),
            "mean_toppling_rate_error_independent": ((), errors.mean_rate_independent),
        }
    )
