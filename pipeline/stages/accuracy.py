"""Accuracy: error of the boundary against CPU time, of this project and of other ways.

The products hold CPU times, which are their subject: unlike all others they differ from call to
call.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline import ROOT, comparing, pages, writers
from pipeline.comparing import Place, Record
from pipeline.datasets import described, netcdf, read
from pipeline.layers import Site
from pipeline.motion_config import PulseConfig
from pipeline.problems import InputError, Problem
from pipeline.scenes import ENGINE_CODE, RUN_CODE
from pipeline.stage import Job, Product, Stage
from pipeline.stages.precision import FILE as PRECISION
from vsr_core import GRAVITY

if TYPE_CHECKING:
    import xarray as xr

    from vsr_core.comparison import Target

FILE, TABLE, PAGE, PICTURE = "accuracy.nc", "accuracy.csv", "accuracy.html", "work_precision"


def make(job: Job) -> Product:
    """Compare ways of running on the site's own rows, and run the reference suite."""
    from pipeline.figures.accuracy import work_precision
    from pipeline.figures.accuracy_page import facts
    from pipeline.figures.style import pictures

    if job.config.on_terrain:
        raise InputError(
            Problem(
                job.site.file,
                "pedestal.shape",
                "a terrain",
                "other ways of running are compared on a flat pedestal",
                "use the site of the same rock on a flat pedestal, or set pedestal.shape: flat",
            )
        )
    if not isinstance(job.config.motion, PulseConfig):
        raise InputError(
            Problem(
                job.site.file,
                "motion.kind",
                job.config.motion.kind,
                "other ways of running are compared under pulses",
                "use the site with motion.kind: cosine_pulse",
            )
        )
    targets = comparing.find_targets(job)
    records = comparing.score_ways(job, targets)
    cells = comparing.sample_cells(job)
    records += comparing.compare_cells(cells)
    records += comparing.run_suite(job)
    records += comparing.absent_peers()
    diagram = work_precision(records, job.config.simulation.tolerance, job.site.name)
    shown = facts(job.site.name, job.config, records, targets, read(job.path(PRECISION)), diagram)
    files = {
        FILE: netcdf(described(_dataset(targets, cells), job, "Accuracy")),
        TABLE: writers.table(comparing.COLUMNS, records),
        PAGE: writers.text(pages.filled(PAGE, shown)),
        **pictures(PICTURE, diagram),
    }
    return Product(files, _summary(records))


def _dataset(targets: dict[Place, Target], cells: list[Record]) -> xr.Dataset:
    import xarray as xr

    dataset = xr.Dataset(
        {
            "row_yaw": ("row", [yaw for yaw, _ in targets]),
            "row_pgv_pga": ("row", [pgv_pga for _, pgv_pga in targets]),
            "row_reference": ("row", [t.boundary / GRAVITY for t in targets.values()]),
            "row_spread": ("row", [t.spread for t in targets.values()]),
        }
    )
    for name in cells[0] if cells else ():
        dataset[name] = ("cell", [cell[name] for cell in cells])
    return dataset


def _summary(records: list[Record]) -> str:
    from pipeline.figures.accuracy import cheapest

    ways = cheapest(records, 0.01)
    texts = [f"{way['method']} {1e3 * way['cpu_s']:.3g} ms" for way in ways]
    return "a run at 1 % error of the boundary: " + (", ".join(texts) or "no way gets there")


def _inputs(site: Site) -> dict[str, str]:
    return {PAGE: pages.digest(PAGE)}


def _modules(package: str) -> list[str]:
    """Modules of a package of the physics, whose contents are found by name only."""
    return sorted(path.stem for path in (ROOT / "vsr_core" / package).glob("[!_]*.py"))


STAGE = Stage(
    name="accuracy",
    make=make,
    needs=("rock", "precision"),
    reads=("pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
    code=(
        *RUN_CODE,
        "pipeline.measuring:find_target",
        "pipeline.measuring:score",
        "pipeline.measuring:run_cells",
        "pipeline.measuring:run_reference",
        *ENGINE_CODE,
        *(f"vsr_core.peers.{name}:build" for name in _modules("peers")),
        *(f"vsr_core.reference.{name}:CASES" for name in _modules("reference")),
    ),
    inputs=_inputs,
    versions=("pybullet", "matplotlib", "jinja2"),
)
