"""Accuracy: error of the boundary against CPU time, of this project and of other ways.

The products hold CPU times, which are their subject: unlike all others they differ from call to
call.
"""

from __future__ import annotations

import pandas as pd
import xarray as xr

from pipeline.config import in_si
from pipeline.config.motion_schema import PulseConfig
from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import pictures
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.stages.studies.accuracy import comparison
from pipeline.stages.studies.accuracy.accuracy_page import cheapest, facts, work_precision
from pipeline.stages.studies.accuracy.comparison import Place, SampledCell
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.stage import Product, Work
from vsr_core.verification.work_precision import Target

FILE, TABLE, PAGE, PICTURE = "accuracy.nc", "accuracy.csv", "accuracy.html", "work_precision"


def make(work: Work, study: Study, measured: StepData) -> Product:
    """Compare ways of running on the site's own rows, and run the reference suite."""
    if study.settings.on_terrain:
        raise InputError(
            Problem(
                work.origin.file_of("pedestal.shape"),
                "pedestal.shape",
                "a terrain",
                "other ways of running are compared on a flat pedestal",
                "use the site of the same rock on a flat pedestal, or set pedestal.shape: flat",
            )
        )
    if not isinstance(study.motion, PulseConfig):
        raise InputError(
            Problem(
                work.origin.file_of("motion.kind"),
                "motion.kind",
                study.motion.kind,
                "other ways of running are compared under pulses",
                "use the site with motion.kind: cosine_pulse",
            )
        )
    site = work.origin.name
    targets = comparison.find_targets(work, study)
    records = comparison.score_ways(work, study, targets)
    cells = comparison.sample_cells(work, study)
    records += comparison.compare_cells(cells)
    records += comparison.run_suite(work)
    records += comparison.absent_peers()
    table = pd.DataFrame(records)
    diagram = work_precision(table, study.settings.simulation.tolerance, site)
    shown = facts(site, study.settings, table, targets, measured.data, diagram)
    files = {
        FILE: netcdf(described(_dataset(targets, cells), work, "Accuracy")),
        TABLE: writers.table(table[list(comparison.COLUMNS)]),
        PAGE: writers.text(pages.filled(PAGE, shown)),
        **pictures(PICTURE, diagram),
    }
    return Product(files, _summary(table))


def _dataset(targets: dict[Place, Target], cells: list[SampledCell]) -> xr.Dataset:
    dataset = xr.Dataset(
        {
            "row_yaw": ("row", [yaw for yaw, _ in targets]),
            "row_pgv_pga": ("row", [pgv_pga for _, pgv_pga in targets]),
            "row_reference": ("row", [in_si.in_g(t.boundary) for t in targets.values()]),
            "row_spread": ("row", [t.spread for t in targets.values()]),
        }
    )
    for name in ("yaw", "pgv_pga", "pga") if cells else ():
        dataset[f"cell_{name}"] = ("cell", [getattr(cell, name) for cell in cells])
    for name in cells[0].outcomes if cells else ():
        dataset[f"outcome_{name}"] = ("cell", [cell.outcomes[name] for cell in cells])
    return dataset


def _summary(table: pd.DataFrame) -> str:
    ways = cheapest(table, 0.01).to_dict("records")
    texts = [f"{way['method']} {1e3 * way['cpu_s']:.3g} ms" for way in ways]
    return "a run at 1 % error of the boundary: " + (", ".join(texts) or "no method gets there")
