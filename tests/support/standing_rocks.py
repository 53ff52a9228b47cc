"""Rocks that topple from a PGA on, and power laws of shaking, whose survival is known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from pipeline.stages.hazard.hazard_model import Branch, HazardModel
from pipeline.stages.hazard.rock_fragility import RockFragility, all_borders, of_members
from pipeline.stages.hazard.survival_analysis import DatedRock, SurvivalAnalysis
from vsr_core import GRAVITY
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.shaking import CurveShaking

SLOPE = 2.0
TABLE = RatioTable(np.array([1.0]), np.array([0.1]), np.array([0.4]))


def curve(rate: float) -> HazardCurve:
    """Power law with the given rate at 1 g."""
    level = np.geomspace(0.01, 10.0, 40)
    return HazardCurve(GRAVITY * level, rate * level**-SLOPE)


def model(*rates: float) -> HazardModel:
    share = 1.0 / len(rates)
    branches = tuple(Branch(str(n), f"b{n}", share, curve(rate)) for n, rate in enumerate(rates))
    return HazardModel(branches, (0.0, 50.0))


def of_curves(hazard: HazardModel, *rocks: DatedRock, component: float = 1.0) -> SurvivalAnalysis:
    borders = all_borders(stage for rock in rocks for stage in rock.stages)
    shaking = CurveShaking(tuple(one.pga for one in hazard.branches), TABLE, borders)
    return SurvivalAnalysis(hazard, rocks, shaking.times(component), 0.05)


def numbered(data: xr.Dataset, seeds: Sequence[int] = ()) -> xr.Dataset:
    """The same with the seeds of its members, each another unless some are given, and brackets."""
    seed, edges = ("member", list(seeds or range(data.sizes["member"]))), data["member_boundary"]
    brackets = {f"member_boundary_{end}": edges for end in ("lower", "upper")}
    return data.assign(brackets | {"drawn_seed": seed})


def ensemble(thresholds: list[float], number: int = 80, seeds: Sequence[int] = ()) -> RockFragility:
    """Members that topple from a PGA on [g], whatever the direction and PGV/PGA."""
    pga = np.geomspace(0.05, 2.0, number)
    falls = np.array([pga >= threshold for threshold in thresholds]).astype(np.int8)
    falls = np.broadcast_to(falls[:, None, None, :], (len(falls), 2, 3, len(pga)))
    edges = np.broadcast_to(np.array(thresholds)[:, None, None], falls.shape[:3])
    beta = 0.05  # so narrow about this median that E[threshold^-SLOPE] is that of the members
    theta = np.mean(np.array(thresholds) ** -SLOPE) ** (-1.0 / SLOPE) * np.exp(beta**2)
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), falls),
            "member_boundary": (("member", "yaw", "pgv_pga"), edges),
            "theta": (("yaw", "pgv_pga"), np.full((2, 3), theta)),
            "beta": (("yaw", "pgv_pga"), np.full((2, 3), beta)),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.05, 0.1, 0.2], "pga": pga},
        {"searched_from_g": 0.05, "searched_to_g": 2.0},
    )
    return replace(of_members(numbered(data, seeds)), static=min(thresholds))


def ended(level: float, often: float, years: float) -> HazardCurve:
    """A power law up to a level [g], which is so often exceeded in some years."""
    levels = np.geomspace(0.01, level, 20)
    return HazardCurve(GRAVITY * levels, often / years * (levels / level) ** -SLOPE)


def rows_from(ratios: Sequence[float], thresholds: Sequence[float]) -> RockFragility:
    """Rows of PGV/PGA [s] that topple from a PGA on [g]."""
    falls = GRAVITY * np.array(thresholds)[:, None]
    return replace(
        ensemble([0.5]),
        ratios=np.array(ratios),
        static=min(thresholds),
        mean=lambda level: (level > falls) * 1.0,
        others=(lambda level: (level > falls) * 1.0,),
        by_yaw={},
    )


def stand(
    rate: float, years: float, thresholds: list[float], *, same: bool, number: int = 20_000
) -> float:
    """Share of catalogues in which a rock stands that is one of two, or either in each of them."""
    rng, least = np.random.default_rng(11), min(thresholds)
    count = rng.poisson(rate * least**-SLOPE * years, number)
    of = np.repeat(np.arange(number), count)
    shaking = least * rng.uniform(size=len(of)) ** (-1.0 / SLOPE)
    rock = rng.choice(thresholds, number)[of] if same else rng.choice(thresholds, len(of))
    return 1.0 - len(np.unique(of[shaking >= rock])) / number
