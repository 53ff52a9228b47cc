"""Hazard: survival of a rock under each branch of a hazard model, and the posterior model.

Nothing is simulated here: other curves, another age or another table of PGV/PGA use the runs that
are there.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

from pipeline.config.layers import Site
from pipeline.config.paths import located, shown
from pipeline.config.problems import InputError, Problem
from pipeline.stages.fragility.products import FILE as FITS
from pipeline.stages.hazard import curve_folder, others, rock_fragility
from pipeline.stages.hazard.hazard_dataset import dataset, pga_at, table
from pipeline.stages.hazard.hazard_page import page
from pipeline.stages.hazard.shaking_ratio import disaggregation_files, load_disaggregation, of_model
from pipeline.stages.hazard.survival_analysis import (
    AS_SCANNED,
    DatedRock,
    SurvivalAnalysis,
    ages_of,
    cases,
)
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.grammar import counted
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import Job, Product

FILE, TABLE, PAGE = "hazard.nc", "hazard.csv", "hazard.html"


def make(job: Job) -> Product:
    """Reject and reweight the branches of a hazard model by a rock's survival.

    Returns
    -------
    Product
        ``hazard.nc``, ``hazard.csv`` and ``hazard.html``.
    """
    config, site = job.config.hazard, job.site
    curves, disaggregated = _paths(site)
    model = curve_folder.load(curves)
    ratio = of_model(config, model, model.levels[[0, -1]], disaggregated)
    own = job.store.folder
    assert config.age is not None
    uncertain = job.config.uncertain
    rocks = [DatedRock(site.name, rock_fragility.load(own, uncertain), ages_of(config.age))]
    files_read = []
    for other, given in zip(others.rocks(site), config.rocks, strict=True):
        files_read.append(other.file(own))
        fragility = rock_fragility.load(other.folder(own), other.uncertain)
        rocks.append(DatedRock(other.name, fragility, ages_of(given.age)))
    compared = {}
    if uncertain:  # beside which settings are compared
        compared[AS_SCANNED] = rock_fragility.of_fits(own)
    for one in config.compare:
        folder = own / others.folder_of(one.name) / site.name
        files_read.append(folder / FITS)
        name = f"{AS_SCANNED}, {one.name}" if uncertain else one.name
        compared[name] = rock_fragility.of_fits(folder)
    analysis = SurvivalAnalysis(
        model, tuple(rocks), ratio.table, config.minimum_survival_probability
    )
    by_member = analysis.survival_of_others()
    all_cases = cases(analysis, by_member, ratio, compared)
    results = all_cases[0].results
    found = dataset(analysis, results, by_member, all_cases)
    found.attrs[others.NOTED] = json.dumps(others.digests(own, files_read), sort_keys=True)
    facts = page(job, analysis, ratio, found, shown(curves), curve_folder.about(curves))
    files = {
        FILE: netcdf(described(found, job, "Hazard")),
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


def inputs(site: Site) -> dict[str, str]:
    """Digests of the curves and of the disaggregation, by their names."""
    curves, disaggregated = _paths(site)
    curve_folder.load(curves)  # errors in them are reported before anything runs
    found = curve_folder.files(curves)
    if disaggregated is not None:
        load_disaggregation(disaggregated)
        found += [one for one in disaggregation_files(disaggregated) if one not in found]
    return {_name(path): digest_file(path) for path in found}


def _name(path: Path) -> str:
    """Its name, with the folder that tells nshmp-haz's measures apart."""
    return "/".join(path.parts[-2:]) if path.name == "curves.csv" else path.name


def _paths(site: Site) -> tuple[Path, Path | None]:
    """Where the curves are, and the disaggregation if there is one."""
    config = site.config.hazard
    if config.curves is None:
        raise InputError(
            Problem(
                site.file,
                "hazard.curves",
                "nothing",
                "a folder of hazard curves is required",
                "give CURVES=folder (--curves), or set the key",
            )
        )
    if config.age is None:
        raise InputError(
            Problem(
                site.file,
                "hazard.age",
                "nothing",
                "the age of the rock is required",
                "give AGE=years AGE_SD=years (--age, --age-sd), or set the key",
            )
        )
    curves = _located(site, "curves", config.curves)
    if config.disaggregation is not None:
        return curves, _located(site, "disaggregation", config.disaggregation)
    return curves, curves if curves.is_dir() and disaggregation_files(curves) else None


def _located(site: Site, key: str, name: str) -> Path:
    key = f"hazard.{key}"
    return located(site.folder_of(key), name, site.file_of(key), key)
