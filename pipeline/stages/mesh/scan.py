"""Scan: rock and terrain from one raw mesh, each step weighed, with a page to look at."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pipeline.config.schema import Config
from pipeline.stages.mesh import scan_page, sources
from pipeline.stages.mesh.products import SCAN, SCAN_PAGE
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.writers import text
from vsr_core.scan import cuts
from vsr_core.scan.preparation import Miscut, Prepared, prepare_scan
from vsr_core.scan.weighing import Refused


def make(job: Job) -> Product:
    """Separate, close and weigh; a proposed cut is shown, and used once it is accepted."""
    source = sources.find(job.site)
    prepared = _prepared(job, source)
    accepted = job.config.pedestal.cut is not None
    dataset = _dataset(prepared)
    dataset.attrs |= {"accepted": int(accepted), **source.attributes}
    page = scan_page.page(
        job.site.name, source.label, prepared, accepted=accepted, surrogate=source.surrogate
    )
    files = {SCAN: netcdf(described(dataset, job, "Scan")), SCAN_PAGE: text(page)}
    return Product(files, _summary(prepared, job))


def _summary(prepared: Prepared, job: Job) -> str:
    solid = prepared.steps[-1].after
    given = job.config.pedestal.cut
    how = "cut as given" if given not in (None, "proposal") else "cut along the hollow"
    length = sum(seam.length for seam in prepared.separation.seams)
    return (
        f"{how}, {length:.2f} m long; rock of {solid.volume:.4g} m3 closed by "
        f"{job.config.rock.closing}; ground of {len(prepared.terrain.faces)} faces"
    )


def _cut_of(config: Config) -> cuts.Cut | None:
    """The user's cut in the terms of the physics; None where one is to be proposed."""
    cut = config.pedestal.cut
    if cut is None or cut == "proposal":
        return None
    kinds = {
        "plane": cuts.Plane,
        "box": cuts.Box,
        "polygon": cuts.Polygon,
        "colour": cuts.Colour,
    }
    return kinds[cut.kind](**cut.model_dump(exclude={"kind"}))


def _prepared(job: Job, source: sources.Source) -> Prepared:
    config = job.config
    mesh = sources.load(source, job.site)
    try:
        with Steps(job.stage, job.log) as steps:
            return prepare_scan(
                mesh,
                _cut_of(config),
                near=config.pedestal.point_on_rock,
                closing=config.rock.closing,
                density=config.rock.density,
                clearance=config.pedestal.clearance,
                tell=steps.tell,
            )
    except Miscut as error:
        raise scan_page.refusal(job.site, source, "pedestal.cut", error) from None
    except Refused as error:
        raise scan_page.refusal(job.site, source, "rock.mesh", error) from None


def _dataset(prepared: Prepared) -> xr.Dataset:
    rock, terrain = prepared.rock, prepared.terrain
    return xr.Dataset(
        {
            "rock_vertex": (("rock_corner", "xyz"), np.array(rock.vertices)),
            "rock_face": (("rock_triangle", "three"), np.array(rock.faces, np.int32)),
            "terrain_vertex": (("terrain_corner", "xyz"), terrain.vertices),
            "terrain_face": (("terrain_triangle", "three"), terrain.faces.astype(np.int32)),
        },
        attrs={"origin_in_scan": prepared.origin},
    )
