"""Where PGV/PGA at a PGA is from, best first: a table, events, a disaggregation, curves of PGV."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.config import in_si
from pipeline.config.hazard_schema import HazardConfig
from pipeline.stages.hazard.disaggregation import load_disaggregation
from pipeline.stages.hazard.hazard_model import HazardModel
from vsr_core.arrays import Array
from vsr_core.hazard.curve import mean_curve
from vsr_core.hazard.events import Events
from vsr_core.hazard.ratio import (
    CORRELATION,
    LOG_SD,
    RatioTable,
    ratio_of_curves,
    ratios_of_scenarios,
)
from vsr_core.hazard.shaking import CurveShaking, Shaking, counted_shaking

DEFAULT, SMALLER, LARGER = (6.5, 20.0), (5.5, 10.0), (7.5, 40.0)
"""Magnitude and distance [km] of the earthquake assumed where nothing is known of PGV, and of two
alternatives."""

VARIATION = 1.25
"""Factor by which a known median of PGV/PGA is varied: medians of ground-motion models differ by
about as much."""

STEP = 1.05
"""Factor between the accelerations of a table."""


@dataclass(frozen=True, eq=False)
class ShakingRatio:
    """PGV/PGA as it is used, and plausible alternatives.

    Attributes
    ----------
    source : str, "table", "disaggregation", "curves" or "default"
    alternatives : dict, from the name of a case to the table then
    """

    table: RatioTable
    source: str
    alternatives: dict[str, RatioTable]


@dataclass(frozen=True, eq=False)
class AssumedShaking:
    """Shaking at a site as it is used, and plausible alternatives.

    Attributes
    ----------
    source : str, of PGV/PGA: as of `ShakingRatio`, or "events"
    alternatives : dict, from the name of a case to the shaking then
    """

    source: str
    shaking: Shaking
    alternatives: Mapping[str, Shaking]


DRAWN_AGAIN = f"PGV/PGA: PGV drawn anew given PGA, at a correlation of {CORRELATION:g}"
"""The case in which PGV of an event is not as it was simulated."""


def of_hazard(
    config: HazardConfig,
    model: HazardModel,
    events: Events | None,
    disaggregated: Path | None,
    borders: Array,
) -> AssumedShaking:
    """Shaking of curves, or of events, with its PGV/PGA.

    Parameters
    ----------
    borders : ndarray, shape (cells - 1,) [s], as of `rock_fragility.all_borders`
    """
    if events is None or events.pgv is None or config.pgv_pga is not None:
        found = of_model(config, model, model.levels[[0, -1]], disaggregated)
    if events is None:
        curves = tuple(one.pga for one in model.branches)
        tables = found.alternatives.items()
        return AssumedShaking(
            found.source,
            CurveShaking(curves, found.table, borders),
            {name: CurveShaking(curves, table, borders) for name, table in tables},
        )
    weights = np.array([one.weight for one in model.branches])
    if events.pgv is None or config.pgv_pga is not None:
        drawn = {
            name: counted_shaking(events, events.ratio_of_table(table), borders, weights)
            for name, table in {"": found.table, **found.alternatives}.items()
        }
        return AssumedShaking(found.source, drawn.pop(""), drawn)
    alternatives = {}
    if events.ruptures is not None:
        again = counted_shaking(events, events.ratio_anew(), borders, weights)
        alternatives[DRAWN_AGAIN] = again
    simulated = counted_shaking(events, events.ratio_as_simulated(), borders, weights)
    return AssumedShaking("events", simulated, alternatives)


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
        found = load_disaggregation(disaggregated)
        scenarios = found.magnitudes, found.distances, found.levels, found.shares
        return _known("disaggregation", ratios_of_scenarios(*scenarios, at))
    pgv = [one.pgv for one in model.branches if one.pgv is not None]
    if len(pgv) == len(model.branches):
        weights = np.array([one.weight for one in model.branches])
        pga_mean = mean_curve([one.pga for one in model.branches], weights, model.levels)
        velocities = max((one.levels for one in pgv), key=len)
        pgv_mean = mean_curve(pgv, weights, velocities)
        return _known("curves", ratio_of_curves(pga_mean, pgv_mean, LOG_SD))
    alternatives = {
        f"PGV/PGA: of {_words(one)}, not {_words(DEFAULT)}": _one(one, at)
        for one in (SMALLER, LARGER)
    }
    return ShakingRatio(_one(DEFAULT, at), "default", alternatives)


def _known(source: str, table: RatioTable) -> ShakingRatio:
    alternatives = {
        "PGV/PGA: a quarter larger": table.times(VARIATION),
        "PGV/PGA: a fifth smaller": table.times(1.0 / VARIATION),
    }
    return ShakingRatio(table, source, alternatives)


def _one(scenario: tuple[float, float], at: Array) -> RatioTable:
    """PGV/PGA where all shaking is of earthquakes of one magnitude and distance."""
    magnitude, distance = np.array([[value] for value in scenario])
    return ratios_of_scenarios(magnitude, distance, at[:1], np.ones((1, 1)), at)


def _words(scenario: tuple[float, float]) -> str:
    return f"earthquakes of M {scenario[0]:g} at {scenario[1]:g} km"
