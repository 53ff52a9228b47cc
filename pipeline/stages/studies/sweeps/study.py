"""The study of a sweep: one dataset of all members, and a page that compares them."""

from __future__ import annotations

from os.path import relpath
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.sweep import Dimension
from pipeline.drawing.style import svg_uri
from pipeline.stages.mesh.products import RockData
from pipeline.stages.studies.sweeps import sweep_figures as figures
from pipeline.stages.studies.sweeps.changes import (
    BOUNDARY,
    Change,
    along,
    changes,
    collapsed,
    places,
    quantity,
    spread,
)
from pipeline.stages.studies.sweeps.sentences import about, headline
from pipeline.stages.studies.sweeps.stacking import stacked
from pipeline.workflow import graph, pages, writers
from pipeline.workflow.datasets import netcdf
from pipeline.workflow.grammar import listed
from pipeline.workflow.stage import Product
from pipeline.workflow.sweeps import DATA, PAGE, Swept


def make(swept: Swept, key: str) -> Product:
    """Stack the members of a sweep and compare them.

    Returns
    -------
    Product
        ``study.nc`` and ``study.html``.
    """
    job = swept.job
    data = stacked(swept, graph.work_of("study", key, job))
    dimensions = swept.sweep.dimensions
    compared = [_compared(swept, data, one) for one in dimensions] if BOUNDARY in data else []
    page = {
        "study": swept.sweep.study,
        "site": job.site.name,
        "headline": headline(swept.sweep, [part["sentence"] for part in compared], job.site.name),
        "dimensions": compared,
        "members": _members(swept),
        "sizes": dict(data.sizes),
        "surrogate": _surrogate(swept),
        "up": job.store.up,
    }
    files = {DATA: netcdf(data), PAGE: writers.text(pages.filled(PAGE, page))}
    sizes = " x ".join(f"{len(one.labels)} {one.name}" for one in dimensions)
    return Product(files, f"{sizes}; {page['headline']}")


def _compared(swept: Swept, data: xr.Dataset, dimension: Dimension) -> dict[str, Any]:
    """What the page shows of one dimension."""
    part = along(data, swept.sweep, dimension)
    found: list[Change] = changes(part, dimension)
    own = collapsed(part)
    apart = spread(own, dimension) if own is not None else None
    drawn = {
        "multiples": figures.multiples(part, dimension),
        "over_key": figures.over_key(part, dimension),
        "boundaries": figures.boundaries(part, dimension, own),
    }
    return {
        "name": dimension.name,
        "keys": [(key, quantity(key)[0]) for key in dimension.values],
        "over": _over(part, dimension),
        "changes": found,
        "reference": places(dimension)[dimension.reference],
        "sentence": about(dimension, found, apart),
        "gaps": bool((data["outcome"] < 0).any()),
        "others": [
            f"{one.name} {places(one)[one.reference]}"
            for one in swept.sweep.dimensions
            if one is not dimension
        ],
        "unmeasured": any(np.isnan(one.error) for one in found),
        "panels": min(len(dimension.labels), figures.MOST_PANELS),
        "spread": apart,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
    }


def _over(part: xr.Dataset, dimension: Dimension) -> str:
    """What curves along a dimension are medians over; nothing where there is one of each."""
    grids = {"yaw": "directions", "friction": "frictions"}
    names = [
        name
        for grid, name in grids.items()
        if part.sizes.get(grid, 1) > 1 and grid != dimension.name
    ]
    return listed(names)


def _members(swept: Swept) -> list[dict[str, str]]:
    """Each member, and the page of its own where its product has one."""
    found = []
    for member in swept.sweep.members:
        folder = swept.jobs[member.place].store.folder
        pages_there = sorted(folder.glob("*.html"))
        page = relpath(pages_there[0], swept.job.store.folder) if pages_there else ""
        found.append({"name": member.name, "page": page})
    return found


def _surrogate(swept: Swept) -> bool:
    """Whether the rock is a surrogate of one that is not public."""
    job = swept.jobs[swept.sweep.reference.place]
    there = job.store.manifest("rock") is not None
    return there and bool(RockData.load(job.store).data.attrs["surrogate"])
