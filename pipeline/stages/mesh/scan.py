"""Scan: rock and terrain from one raw mesh, each step weighed, with a page to look at."""

from __future__ import annotations

from functools import partial

import numpy as np
import xarray as xr

from pipeline.config.scene_schema import PedestalConfig, RockConfig
from pipeline.stages.mesh import scan_page, sources
from pipeline.stages.mesh.products import SCAN_PAGE, ScanData, of_contact
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.writers import text
from vsr_core.scan import cuts
from vsr_core.scan.preparation import Miscut, Prepared, prepare_scan
from vsr_core.scan.separation import SEAM_MOVED
from vsr_core.scan.weighing import Refused


def make(work: Work, rock: RockConfig, pedestal: PedestalConfig, source: Source) -> Product:
    """Separate, close and weigh; a proposed cut is shown, and used once it is accepted."""
    prepared = _prepared(work, rock, pedestal, source)
    accepted = pedestal.cut is not None
    dataset = _dataset(prepared)
    dataset.attrs |= {"accepted": int(accepted), **source.attributes}
    page = scan_page.page(
        work.origin.name, source.label, prepared, accepted=accepted, surrogate=source.surrogate
    )
    files = {ScanData.FILE: netcdf(described(dataset, work, "Scan")), SCAN_PAGE: text(page)}
    return Product(files, _summary(prepared, rock, pedestal))


def _summary(prepared: Prepared, rock: RockConfig, pedestal: PedestalConfig) -> str:
    solid = prepared.steps[-1].after
    how = "cut as given" if pedestal.cut not in (None, "proposal") else "cut along the hollow"
    length = sum(seam.length for seam in prepared.separation.seams)
    moved = "".join(
        f", {note}" for note in prepared.separation.notes if note.startswith(SEAM_MOVED)
    )
    return (
        f"{how}, {length:.2f} m long{moved}; rock of {solid.volume:.4g} m3 closed by "
        f"{rock.closing}; ground of {len(prepared.terrain.faces)} faces; contact: "
        f"{prepared.contact.told}"
    )


def _cut_of(pedestal: PedestalConfig) -> cuts.Cut | None:
    """The user's cut in the terms of the physics; None where one is to be proposed."""
    cut = pedestal.cut
    if cut is None or cut == "proposal":
        return None
    kinds = {"plane": cuts.Plane, "box": cuts.Box, "polygon": cuts.Polygon, "colour": cuts.Colour}
    return kinds[cut.kind](**cut.model_dump(exclude={"kind"}))


def _prepared(work: Work, rock: RockConfig, pedestal: PedestalConfig, source: Source) -> Prepared:
    try:
        with Steps(work.stage, work.log) as steps:
            return prepare_scan(
                partial(sources.load, source, work.origin),
                _cut_of(pedestal),
                near=pedestal.point_on_rock,
                closing=rock.closing,
                density=rock.density,
                tell=steps.tell,
                contact=(rock.contact_shape, rock.contact_error),
            )
    except Miscut as error:
        raise scan_page.refusal(work.origin, source, "pedestal.cut", error) from None
    except Refused as error:
        raise scan_page.refusal(work.origin, source, "rock.mesh", error) from None


def _dataset(prepared: Prepared) -> xr.Dataset:
    rock, terrain = prepared.rock, prepared.terrain
    made = xr.Dataset(
        {
            "rock_vertex": (("rock_corner", "xyz"), np.array(rock.vertices)),
            "rock_face": (("rock_triangle", "three"), np.array(rock.faces, np.int32)),
            "terrain_vertex": (("terrain_corner", "xyz"), terrain.vertices),
            "terrain_face": (("terrain_triangle", "three"), terrain.faces.astype(np.int32)),
            "terrain_unseen": ("terrain_triangle", prepared.seat.astype(np.int8)),
        },
        attrs={"origin_in_scan": prepared.origin},
    )
    contact = prepared.contact
    stored = of_contact(contact.pieces, contact.error, contact.told)
    return made.merge(stored, combine_attrs="no_conflicts")
