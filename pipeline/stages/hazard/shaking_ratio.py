"""Where PGV/PGA at a PGA comes from, best first: a table, a disaggregation, curves of PGV."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.config import in_si
from pipeline.config.hazard_schema import HazardConfig
from pipeline.stages.hazard import disaggregation
from pipeline.stages.hazard.hazard_model import HazardModel
from vsr_core.arrays import Array
from vsr_core.hazard.branches import mean_curve
from vsr_core.hazard.ground_motion import LOG_SD, ratios_of_scenarios
from vsr_core.hazard.ratio import RatioTable, ratio_of_curves

DEFAULT, SMALLER, LARGER = (6.5, 20.0), (5.5, 10.0), (7.5, 40.0)
"""Magnitude and distance [km] of the earthquake that is taken where nothing is known, and of two
that might as well be."""

DOUBT = 1.25
"""Factor by which a known median of PGV/PGA is moved up and down to see what it matters: medians
of ground-motion models differ by about as much."""

STEP = 1.05
"""Factor between the accelerations of a table."""


@dataclass(frozen=True, eq=False)
class ShakingRatio:
    """PGV/PGA as it is used, and in doubt.

    Attributes
    ----------
    source : str, "table", "disaggregation", "curves" or "default"
    doubts : dict, from what is changed, in words, to the table with the change
    """

    table: RatioTable
    source: str
    doubts: dict[str, RatioTable]


def of_model(
    config: HazardConfig, model: HazardModel, levels: Array, disaggregated: Path | None
) -> ShakingRatio:
    """PGV/PGA of the shaking at a place.

    Parameters
    ----------
    levels : ndarray, shape (2,) [m/s^2], least and largest PGA
    """
    given = config.pgv_pga
    if given is not None:
        pga = np.array(in_si.acceleration(np.array(given.pga)))
        return _known("table", RatioTable(pga, np.array(given.median), np.array(given.log_sd)))
    at = np.geomspace(levels[0], levels[1], 2 + int(np.log(levels[1] / levels[0]) / np.log(STEP)))
    if disaggregated is not None:
        found = disaggregation.load(disaggregated)
        scenarios = found.magnitudes, found.distances, found.levels, found.shares
        return _known("disaggregation", ratios_of_scenarios(*scenarios, at))
    pgv = [one.pgv for one in model.branches if one.pgv is not None]
    if len(pgv) == len(model.branches):
        weights = np.array([one.weight for one in model.branches])
        pga_mean = mean_curve([one.pga for one in model.branches], weights, model.levels)
        velocities = max((one.levels for one in pgv), key=len)
        pgv_mean = mean_curve(pgv, weights, velocities)
        return _known("curves", ratio_of_curves(pga_mean, pgv_mean, LOG_SD))
    doubts = {
        f"PGV/PGA: of {_words(one)}, not {_words(DEFAULT)}": _one(one, at)
        for one in (SMALLER, LARGER)
    }
    return ShakingRatio(_one(DEFAULT, at), "default", doubts)


def _known(source: str, table: RatioTable) -> ShakingRatio:
    doubts = {
        f"PGV/PGA: a quarter {word}": table.times(factor)
        for word, factor in (("larger", DOUBT), ("smaller", 1.0 / DOUBT))
    }
    return ShakingRatio(table, source, doubts)


def _one(scenario: tuple[float, float], at: Array) -> RatioTable:
    """PGV/PGA where all shaking is of earthquakes of one magnitude and distance."""
    magnitude, distance = np.array([[value] for value in scenario])
    return ratios_of_scenarios(magnitude, distance, at[:1], np.ones((1, 1)), at)


def _words(scenario: tuple[float, float]) -> str:
    return f"earthquakes of M {scenario[0]:g} at {scenario[1]:g} km"
