"""Hazard: survival of a rock under each branch of a hazard model, and the posterior model.

Nothing is simulated here: other curves, another age or another table of PGV/PGA use the runs that
are there.
"""

from __future__ import annotations

import math

from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.paths import shown
from pipeline.stages.fragility.products import Fits
from pipeline.stages.hazard import curve_folder
from pipeline.stages.hazard.curve_folder import Curves
from pipeline.stages.hazard.hazard_dataset import dataset, pga_at, table
from pipeline.stages.hazard.hazard_page import page
from pipeline.stages.hazard.others import Others
from pipeline.stages.hazard.rock_fragility import of_fits, of_members
from pipeline.stages.hazard.shaking_ratio import of_model
from pipeline.stages.hazard.survival_analysis import (
    AS_SCANNED,
    DatedRock,
    SurvivalAnalysis,
    ages_of,
    cases,
)
from pipeline.stages.mesh.products import RockData
from pipeline.stages.uncertainty.products import EnsembleData
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Product, Work

FILE, TABLE, PAGE = "hazard.nc", "hazard.csv", "hazard.html"


def make(
    work: Work,
    config: HazardConfig,
    curves: Curves,
    beside: Others,
    rock: RockData,
    fits: Fits,
    ensemble: EnsembleData | None,
) -> Product:
    """Reject and reweight the branches of a hazard model by a rock's survival.

    Returns
    -------
    Product
        ``hazard.nc``, ``hazard.csv`` and ``hazard.html``.
    """
    model, name = curves.model, work.origin.name
    ratio = of_model(config, model, model.levels[[0, -1]], curves.disaggregated)
    own = of_fits(fits) if ensemble is None else of_members(ensemble.data)
    assert config.age is not None
    rocks = [DatedRock(name, own, ages_of(config.age))]
    for other, given in zip(beside.rocks, config.rocks, strict=True):
        rocks.append(DatedRock(other.name, other.fragility(fits.folder), ages_of(given.age)))
    compared = {}
    if ensemble is not None:  # beside which settings are compared
        compared[AS_SCANNED] = of_fits(fits)
    for other in beside.compared:
        what = other.name if ensemble is None else f"{AS_SCANNED}, {other.name}"
        compared[what] = other.fragility(fits.folder)
    analysis = SurvivalAnalysis(
        model, tuple(rocks), ratio.table, config.minimum_survival_probability
    )
    by_member = analysis.survival_of_others()
    all_cases = cases(analysis, by_member, ratio, compared)
    results = all_cases[0].results
    found = dataset(analysis, results, by_member, all_cases)
    about = curve_folder.about(curves.path)
    facts = page(name, config, rock, analysis, ratio, found, shown(curves.path), about)
    files = {
        FILE: netcdf(described(found, work, "Hazard")),
        TABLE: writers.table(table(found)),
        PAGE: writers.text(pages.filled(PAGE, facts)),
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
