"""What the hazard page says: the facts that its template is filled with."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.hazard_schema import HazardConfig
from pipeline.drawing.style import svg_uri
from pipeline.stages.hazard import hazard_figures as figures
from pipeline.stages.hazard.question import Question
from pipeline.stages.hazard.sensitivity import SAME_ROCK
from pipeline.stages.hazard.shaking_ratio import DEFAULT, ShakingRatio
from pipeline.stages.hazard.words import of_age, of_place, percent, sentence
from pipeline.workflow.datasets import read
from pipeline.workflow.grammar import listed
from pipeline.workflow.stage import Job
from vsr_core.arrays import Array
from vsr_core.hazard.ground_motion import CORRELATION, LOG_SD
from vsr_core.hazard.survival import survival
from vsr_core.hazard.toppling import toppling

MOST_ROWS = 40
"""Branches in the table of the page, the heaviest; all are in ``hazard.csv``."""


def page(
    job: Job, question: Question, ratio: ShakingRatio, hazard: xr.Dataset, curves: str, about: str
) -> dict[str, Any]:
    """What fills the places of the template."""
    config, rock = job.config.hazard, question.rocks[0].fragility
    with read(job.path("rock.nc")) as shape:
        origin = {"source": shape.attrs["shape_source"], "surrogate": shape.attrs["surrogate"]}
    drawn = {
        "curves": figures.curves(hazard, rock.tested),
        "survival": figures.survival(hazard, config.least_survival),
        "shaking": figures.shaking(hazard, rock.tested),
    }
    if hazard.sizes["branch"] > 1:
        drawn["weights"] = figures.weights(hazard)
    return {
        "site": job.site.name,
        "curves": curves,
        "about": about,
        "origin": origin,
        "config": config,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
        "place": of_place(*question.model.place),
        "ratio": ratio.source,
        "default": DEFAULT,
        "correlation": CORRELATION,
        "log_sd": LOG_SD,
        "records": rock.records,
        "range": rock.source,
        "tested": rock.tested,
        "frictions": listed([f"{one:g}" for one in rock.frictions]) if rock.frictions else "",
        "yaws": len(rock.by_yaw),
        "percent": lambda share: percent(share).replace(" ", "\N{NO-BREAK SPACE}"),
        "every": lambda rate: f"{1.0 / rate:,.0f}" if rate > 0.0 else "\N{INFINITY}",
        **_answer(question, hazard, config),
        **_shaking(hazard, rock.tested),
        "rocks": _rocks(job, question),
    }


def _answer(question: Question, hazard: xr.Dataset, config: HazardConfig) -> dict[str, Any]:
    names = hazard["branch"].values.tolist()
    rejected = hazard["rejected"].values == 1
    chances = hazard["survival"].values
    at = hazard.sel(return_period=2475.0)
    pga = at["pga_before"].item(), at["pga_dropped"].item(), at["pga_after"].item()
    least, number = config.least_survival, len(question.rocks)
    heavy = np.argsort(-hazard["weight"].values, kind="stable")[:MOST_ROWS]
    cases = [
        {"what": what, "survival": survival, "rejected": out, "after": after}
        for what, survival, out, after in zip(
            hazard["case"].values.tolist(),
            hazard["case_survival"].values.tolist(),
            hazard["case_rejected"].values.tolist(),
            hazard["case_pga_after"].values.tolist(),
            strict=True,
        )
    ]
    return {
        "sentence": sentence(names, rejected, chances, least, pga, number),
        "least": f"{100.0 * least:g}\N{NO-BREAK SPACE}%",
        "none_left": bool(rejected.all()),
        "some_rejected": bool(rejected.any()),
        "fewest": int((hazard["survival_high"].values < least).sum()),
        "most": int((hazard["survival_low"].values < least).sum()),
        "lost_weight": float(hazard["weight"].values[rejected].sum()),
        "mean_survival": float(question.weights @ chances),
        "branch_count": len(names),
        "branches": [_row(hazard.isel(branch=i)) for i in np.sort(heavy)],
        "periods": np.column_stack(
            [hazard[name] for name in ("return_period", "pga_before", "pga_dropped", "pga_after")]
        ).tolist(),
        "scale": hazard["scale_factor"].item(),
        "effective": [hazard[f"effective_branches_{name}"].item() for name in ("before", "after")],
        "cases": cases,
        "same_rock": next((case for case in cases if case["what"] == SAME_ROCK), None),
    }


def _row(branch: xr.Dataset) -> dict[str, Any]:
    names = ("branch", "branch_path", "weight", "toppling_rate", "survival", "survival_low",
             "survival_high", "rejected", "new_weight")  # fmt: skip
    return {name: branch[name].item() for name in names}


def _shaking(hazard: xr.Dataset, tested: tuple[float, float]) -> dict[str, Any]:
    """Which shaking would topple the rock, and what the curves and the runs leave open."""
    rate = float(hazard["toppling_rate_by_pga"].sum())
    low, middle, high = (_quantile(hazard, share) for share in (0.05, 0.5, 0.95))
    beyond = hazard["toppling_rate_by_pga"].values[hazard["pga_bin"].values >= tested[1]]
    return {
        "rate": rate,
        "toppling_pga": (low, middle, high),
        "untested": float(beyond.sum() / rate) if rate > 0.0 else 0.0,
        "first_level": float(hazard["pga"][0]),
        "last_level": float(hazard["pga"][-1]),
        "at_first": hazard["probability_at_first_level"].item(),
        "open_beyond": hazard["toppling_rate_beyond"].item(),
    }


def _quantile(hazard: xr.Dataset, share: float) -> float:
    """PGA up to which a share of the toppling rate comes [g], straight in ln PGA within a bin."""
    summed = np.append(0.0, np.cumsum(hazard["toppling_rate_by_pga"].values))
    ends = np.append(hazard["pga_bin"].values, hazard["pga_bin"].values[-1])
    return float(np.exp(np.interp(share * summed[-1], summed, np.log(ends))))


def _rocks(job: Job, question: Question) -> list[dict[str, str]]:
    config = job.config.hazard
    given = [config.age, *(one.age for one in config.rocks)]
    alone = [
        float(question.weights @ _alone(question, number)) for number in range(len(question.rocks))
    ]
    return [
        {
            "name": rock.name,
            "age": of_age(age),
            "source": age.source,
            "survival": percent(chance),
        }
        for rock, age, chance in zip(question.rocks, given, alone, strict=True)
        if age is not None
    ]


def _alone(question: Question, number: int) -> Array:
    """Survival of one of the rocks under each branch."""
    own = question.standing[number]
    rates = [toppling(curve, own.fragility).rate for curve in question.curves]
    return np.array([survival(rate, own.ages) for rate in rates])
