"""Uncertainty: the probability of overturning in each cell, its boundary, and what decides it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import xarray as xr
from scipy.special import ndtr
from scipy.stats import binomtest

from pipeline.config.priors_schema import BRACKET, UncertaintyConfig
from pipeline.config.sections import Key
from pipeline.drawing.style import pictures, png_uri
from pipeline.stages.boundary.boundary import BoundaryData
from pipeline.stages.boundary.resolution import widths
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.fragility.summary import SEARCHED
from pipeline.stages.mesh.products import RockData, ScanData, TerrainData
from pipeline.stages.runs.scenes import Group, reach, refuse_force
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.stages.uncertainty import draw_step, seats
from pipeline.stages.uncertainty import draws as drawing
from pipeline.stages.uncertainty import uncertainty_page as page
from pipeline.stages.uncertainty import unknowns as told
from pipeline.stages.uncertainty.draw_runs import Search
from pipeline.stages.uncertainty.draw_step import DrawStep
from pipeline.stages.uncertainty.draws import Draw, EnsembleData, Observed, Replica
from pipeline.stages.uncertainty.ensemble import Ensemble, outcomes
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted, form
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.outcome import FoundBy
from vsr_core.uncertainty import probability, search, sensitivity
from vsr_core.uncertainty.sensitivity import Shares
from vsr_core.validation.priors import Priors

PAGE = "uncertainty.html"


def make(
    work: Work,
    study: Study,
    responses: Responses,
    boundary: BoundaryData,
    measured: StepData,
    rock: RockData,
    scan: ScanData | None,
    terrain: TerrainData | None,
    replica: Replica | None,
    config: UncertaintyConfig,
    density: Annotated[float, Key("rock.density")],
    observed: Observed | None,
) -> Product:
    """Draw what is not known, find the outcomes of all draws, and what decides them."""
    shape = drawing.surface(rock, config.scan, replica)
    numbers = observed.data["taken"].values.tolist() if observed else range(config.members)
    draws = drawing.draws(study, config, density, shape, scan, work.origin, numbers)
    friction = nearest_friction(study.settings.contact.friction, config)
    grid, own_edge = (one.data.isel(friction=friction) for one in (responses, boundary))
    width = widths(config.resolution, BRACKET, measured, work.origin, "uncertainty.resolution")
    settings = study.how(Group(study.yaw[0], study.settings.contact.friction[friction]))
    highest = own_edge.attrs["searched_to_g"]
    for draw in draws:
        gain = draw.member.amplitude
        refuse_force(draw.identified, gain * study.motions.pga[-1], work.origin)
        highest = min(highest, reach(draw.identified) / gain)
    own, yaws = study.scenes.rock, np.radians(study.yaw)
    if scan and terrain:
        given = search.scales_on(seats.of_site(scan, terrain, own), yaws)
    else:
        given = search.scales(own.hull, yaws)
    nominal = grid["overturned"].values.astype(np.int8)
    wanted = Search(
        work,
        draws,
        given,
        study.motions,
        settings,
        nominal,
        own_edge["first_overturning_pga"].values,
        float(width[friction]),
        (own_edge.attrs["searched_from_g"], highest),
    )
    simulation = study.settings.simulation
    step = draw_step.measured(wanted, simulation.time_step, simulation.tolerance)
    settings = replace(settings, time_step=step.time_step)
    bracket = draw_step.resolution(config.resolution, wanted.width, step, work.origin)
    wanted = replace(wanted, settings=settings, width=bracket)
    levels = wanted.boundary.size
    work.log(f"uncertainty: {len(draws)} draws of {levels} first overturnings each")
    if observed and observed.repeats:
        work.log(
            "uncertainty: by the observations an effective number of rocks of "
            f"{observed.rocks:.3g} for {counted(len(draws), 'draw')}: intervals that count these "
            "are too narrow"
        )
    found = outcomes(wanted)
    followed, late = int(found.followed.sum()), int(found.not_first.sum())
    if followed:
        high = math.expm1(float(found.too_high.sum()) / followed)
        work.log(
            f"uncertainty: of {counted(followed, 'bracket')} that were followed {late} "
            f"{form(late, 'is', 'are')} not the first; all lie {high:.1%} too high in the mean"
        )
    known = drawing.priors(config)
    if shape.replica:
        apart = f"differ as if each had an error of {1e3 * shape.error:.2g} mm at the base"
        work.log(f"uncertainty: the two scans {apart}")
    base: Array | None = None
    if scan:
        base = told.seat_effects(draws, given)
    elif not shape.replica:
        base = told.base_effects(draws, shape, density, given)
    dataset = _dataset(wanted, found)
    shares = _shares(draws, known, base, found.known, weighed=bool(observed))
    dataset = dataset.merge(_indices(shares, draws, known, base))
    dataset["boundary_error"] = ((), float(own_edge["boundary_error"]))
    dataset = dataset.assign(_of_step(step))
    dataset = described(dataset, work, "Overturning with its uncertainty")
    drawn = {
        "uncertainty_bands": page.bands(dataset, grid),
        "uncertainty_shares": page.shares(dataset),
        "uncertainty_surface": page.surface(dataset),
    }
    facts = page.facts(
        work.origin.name,
        rock,
        config,
        dataset,
        own_edge,
        observed,
        step,
        {name: png_uri(figure) for name, figure in drawn.items()},
    )
    files = {
        EnsembleData.FILE: netcdf(dataset),
        PAGE: writers.text(pages.filled(PAGE, facts, work.up)),
    }
    for name, figure in drawn.items():
        files |= pictures(name, figure)
    lost = int(found.unresolved.sum())
    return Product(files, page.summary(dataset), unresolved=lost, retry=found.crashed)


def nearest_friction(frictions: tuple[float, ...], config: UncertaintyConfig) -> int:
    """Number of the site's friction that is nearest to the middle of its prior."""
    return int(np.abs(np.array(frictions) - np.mean(config.friction)).argmin())


def _dataset(wanted: Search, found: Ensemble) -> xr.Dataset:
    """Outcomes, probabilities, boundaries and surfaces."""
    motions = wanted.motions
    row = motions.dimension
    grid = ("yaw", row, "pga")
    pga, ratio = np.array(motions.pga), np.array(motions.pgv_pga)
    chance = probability.chance(found.overturned)
    edges = found.boundary
    low, median, high = probability.band(found.known)
    theta, beta = probability.lognormal(edges, ratio, wanted.width, wanted.bounds)
    of_yaw = ndtr(np.log(pga / theta[..., None]) / beta[..., None])
    dataset = xr.Dataset(
        {
            "overturned": (("member", *grid), found.overturned),
            "found_by": (("member", *grid), found.found_by),
            "probability": (grid, chance.probability),
            "probability_low": (grid, chance.low),
            "probability_high": (grid, chance.high),
            "inferred_share": (grid, (found.found_by == FoundBy.INFERRED).mean(axis=0)),
            "member_boundary": (("member", "yaw", row), edges),
            "member_boundary_lower": (("member", "yaw", row), found.lower),
            "member_boundary_upper": (("member", "yaw", row), found.upper),
            "member_runs": (("member", "yaw", row), found.runs),
            "member_unresolved": (("member", "yaw", row), found.unresolved),
            "boundary_resolution": ((), wanted.width),
            "boundary_low": (("yaw", row), low),
            "boundary_median": (("yaw", row), median),
            "boundary_high": (("yaw", row), high),
            "surface_of_yaw": (grid, of_yaw),
            "surface": ((row, "pga"), np.nanmean(of_yaw, axis=0)),
            "theta": (("yaw", row), theta),
            "beta": (("yaw", row), beta),
            "non_monotonic": (row, found.non_monotonic.astype(np.int8)),
            "inferred_tested": ("level_kind", found.checked),
            "inferred_wrong": ("level_kind", found.wrong),
            "levels_followed": ("level_kind", found.followed),
            "levels_not_first": ("level_kind", found.not_first),
            "levels_too_high": ("level_kind", _too_high(found)),
            **told.drawn_values(wanted.draws),
        },
        {
            "member": np.arange(len(wanted.draws)),
            "yaw": list(wanted.draws[0].yaw),
            row: list(motions.rows),
            "pga": pga,
            "level_kind": ["monotonic", "non-monotonic"],
        },
    )
    if row != "pgv_pga":
        dataset["record_pgv_pga"] = (row, ratio)
    dataset["overturned"].encoding["_FillValue"] = np.int8(-1)
    dataset.attrs |= _rule(found) | dict(zip(SEARCHED, wanted.bounds, strict=True))
    return dataset


def _of_step(step: DrawStep) -> dict[str, Any]:
    """The time step of the draws, and what was measured at all that were tried."""
    errors, tried = step.errors, ("tried_step", step.tried)
    told = {"shift": errors.shift, "shift_sd": errors.unsure, "error": errors.kept,
            "islands": errors.islands}  # fmt: skip
    return {
        "tried_step": tried,
        "time_step": ((), step.time_step),
        "step_levels": ((), errors.levels),
        **{f"draw_{name}": ((), values[step.at]) for name, values in told.items()},
        **{f"tried_{name}": ("tried_step", values) for name, values in told.items()},
    }


def _too_high(found: Ensemble) -> Array:
    """How far brackets lie above the lowest PGA that topples, relative, in the mean."""
    none = np.full(len(found.followed), np.nan)
    return np.expm1(np.divide(found.too_high, found.followed, out=none, where=found.followed > 0))


def _rule(found: Ensemble) -> dict[str, Any]:
    """How often an inferred outcome is wrong, or a bracket not the first (Wilson, 95 %)."""
    facts: dict[str, Any] = {"inference_rule": " ".join((search.__doc__ or "").split())}
    kinds = ("monotonic", "non_monotonic")
    counts = {
        "inferred_wrong": (found.checked, found.wrong),
        "not_first": (found.followed, found.not_first),
    }
    for what, (number, wrong) in counts.items():
        for kind, tested, failed in zip(kinds, number.tolist(), wrong.tolist(), strict=True):
            if tested:
                ends = binomtest(failed, tested).proportion_ci(method="wilson")
                facts[f"{what}_{kind}_levels"] = failed / tested
                facts[f"{what}_{kind}_levels_interval"] = [float(end) for end in ends]
    return facts


def _shares(
    draws: list[Draw], known: Priors, base: Array | None, boundary: Array, *, weighed: bool
) -> list[Shares]:
    """Indices of the boundary's height in each direction, over rows where all draws have one.

    None of draws weighed by observations, which make what was drawn dependent on each other.
    """
    found = []
    for yaw in range(boundary.shape[1]):
        edges = boundary[:, yaw]
        own = np.log(edges[:, (np.isfinite(edges) & (edges > 0.0)).all(axis=0)])
        height = own.mean(axis=1) if own.size and not weighed else np.full(len(draws), np.nan)
        found.append(sensitivity.shares(told.unknowns(draws, known, base, yaw), height))
    return found


def _indices(
    shares: list[Shares], draws: list[Draw], known: Priors, base: Array | None
) -> xr.Dataset:
    names = [unknown.name for unknown in told.unknowns(draws, known, base, 0)]
    whole = sensitivity.joined(shares)
    parts: dict[str, Any] = {"explained_share": ("yaw", [one.explained for one in shares])}
    for order in ("first", "total"):
        values = [getattr(one, order) for one in shares]
        every = getattr(whole, order)
        parts |= {
            f"{order}_index": (("yaw", "unknown"), [one[0] for one in values]),
            f"{order}_index_interval": (
                ("yaw", "unknown", "bound"),
                [sensitivity.interval(one) for one in values],
            ),
            f"{order}_index_joined": ("unknown", every[0]),
            f"{order}_index_joined_interval": (("unknown", "bound"), sensitivity.interval(every)),
        }
    parts["explained_share_joined"] = ((), whole.explained)
    return xr.Dataset(parts, {"unknown": names, "bound": ["lower", "upper"]})
