"""Displacement report: figures, pictures of motion and two pages, from the products of a site."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from pipeline.drawing import style
from pipeline.stages.datasets.trajectories import FILE as DISPLACEMENT
from pipeline.stages.displacement import (
    correlation_figures,
    displacement_page,
    scene3d,
    side_view,
    timelapse,
    trajectory_maps,
)
from pipeline.stages.displacement.displacement_page import Slot
from pipeline.stages.mesh.products import ROCK as ROCK
from pipeline.stages.mesh.products import TERRAIN as TERRAIN
from pipeline.workflow.datasets import read
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.writers import Writer, binary, text
from vsr_core.displacement.origin import Found
from vsr_core.outcome import Outcome, StopReason

PAGE, SPACE = "displacement.html", "trajectories.html"
STILL, FILM = "figures/timelapse.png", "figures/animation.webp"

LIMITS = (
    "Ground and rock are rigid, and one friction and one restitution hold everywhere: no soil, no "
    "plants, no breaking of rock. docs/rebound.md shows how rebound and rolling compare with "
    "answers that are known, and how far rocks run with other coefficients.",
    "A tumbling rock is chaotic: a single path says little, the ensemble more. Another time step "
    "or another computer architecture gives other paths with the same statistics.",
)


def make(job: Job) -> Product:
    """Draw the figures and fill in the pages."""
    displacement, terrain, rock = (read(job.path(name)) for name in (DISPLACEMENT, TERRAIN, ROCK))
    source = rock.attrs["shape_source"]
    run = _typical(displacement)
    motion = {} if run is None else _motion(displacement, terrain, rock, run, source)
    slots = [] if run is None else _slots(displacement, run, motion)
    found = _found(job, terrain)
    page = displacement_page.page(
        job.site.name,
        displacement,
        terrain,
        source,
        found,
        slots,
        LIMITS,
        surrogate=bool(rock.attrs["surrogate"]),
    )
    space = scene3d.page(displacement, terrain, rock, job.site.name, source)
    files = _figures(displacement, terrain, source) | {PAGE: text(page), SPACE: text(space)}
    files |= {name: binary(content) for name, content in motion.items()}
    sizes = f"{len(page) / 1e6:.1f} MB, and {len(space) / 1e6:.1f} MB in three dimensions"
    return Product(files, sizes)


def _figures(displacement: xr.Dataset, terrain: xr.Dataset, source: str) -> dict[str, Writer]:
    """Files of the figures of all runs."""
    drawn = {
        "trajectories": trajectory_maps.trajectories(displacement, terrain, source),
        "side_view": side_view.side_view(displacement, terrain, source),
        "end_positions": trajectory_maps.end_positions(displacement, terrain, source),
        "trajectory_lengths": correlation_figures.trajectory_lengths(displacement, source),
        "ensemble_means": correlation_figures.ensemble_means(displacement, source),
    }
    files: dict[str, Writer] = {}
    for name, figure in drawn.items():
        files |= style.pictures(f"figures/{name}", figure)
    return files


def _motion(
    displacement: xr.Dataset, terrain: xr.Dataset, rock: xr.Dataset, run: int, source: str
) -> dict[str, bytes]:
    """Pictures of one run, by file name."""
    return {
        STILL: style.png(timelapse.timelapse(displacement, terrain, rock, run, source)),
        FILM: timelapse.animation(displacement, terrain, rock, run),
    }


def _slots(displacement: xr.Dataset, run: int, motion: dict[str, bytes]) -> list[Slot]:
    pulse = (
        f"{float(displacement.pga[run]):.3g} g, PGV/PGA {float(displacement.pgv_pga[run]):.3g} s"
    )
    return [
        Slot(
            "Every way in three dimensions",
            "Turn, enlarge and play any run; one file that works offline.",
            link=SPACE,
        ),
        Slot(
            "One run, pose by pose",
            f"PGA {pulse}: the way of middle length among those that end at rest.",
            image=motion[STILL],
        ),
        Slot("The same run as it goes", "", image=motion[FILM]),
    ]


def _typical(displacement: xr.Dataset) -> int | None:
    """Place of the run of middle length among those that toppled and came to rest."""
    rested = (displacement["outcome"].values == Outcome.OVERTURNED) & (
        displacement["stop_reason"].values == StopReason.REST
    )
    runs = np.flatnonzero(rested)
    if not len(runs):
        return None
    order = np.argsort(displacement["trajectory_length"].values[runs], kind="stable")
    return int(runs[order[len(order) // 2]])


def _found(job: Job, terrain: xr.Dataset) -> Found | None:
    """The rock that was found, in the site's frame."""
    given = job.config.found
    if given is None:
        return None
    x, y, _ = terrain.attrs["origin_in_scan"]
    area = math.inf if given.area is None else given.area
    return Found((given.place[0] - x, given.place[1] - y), given.sigma, given.identity, area)
