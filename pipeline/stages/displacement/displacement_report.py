"""Displacement report: figures, pictures of motion and two pages, from the products of a site."""

from __future__ import annotations

import math

import xarray as xr

from pipeline.config.motion_schema import MotionConfig
from pipeline.config.scene_schema import ObservedBoulder as BoulderConfig
from pipeline.config.schema import SimulationConfig
from pipeline.drawing import style
from pipeline.stages.datasets import displaced_runs
from pipeline.stages.datasets.displacement_dataset import Displacement
from pipeline.stages.displacement import (
    correlation_figures,
    displacement_page,
    scene3d,
    timelapse,
    trajectory_maps,
)
from pipeline.stages.displacement.displacement_page import Slot
from pipeline.stages.fragility.summary import time_steps
from pipeline.stages.mesh.products import RockData, TerrainData
from pipeline.stages.runs.step_choice import StepData
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.writers import Writer, binary, text
from vsr_core.displacement.origin import ObservedBoulder

PAGE, SPACE = "displacement.html", "trajectories.html"
STILL, FILM = "figures/timelapse.png", "figures/animation.webp"


def make(
    work: Work,
    runs: Displacement,
    ground: TerrainData,
    shape: RockData,
    boulder: BoulderConfig | None,
    time_step: StepData,
    motion: MotionConfig,
    simulation: SimulationConfig,
) -> Product:
    """Draw the figures and fill in the pages."""
    displacement, terrain, rock = runs.data, ground.data, shape.data
    source = rock.attrs["shape_source"]
    files = _figures(displacement, terrain, source)
    words = "Rotate, zoom and play any run; one file that works offline."
    slots = [Slot("All trajectories in three dimensions", words, link=SPACE)]
    run = displaced_runs.typical(displacement)
    if run is not None:
        still = style.png(timelapse.timelapse(displacement, terrain, rock, run, source))
        film = timelapse.animation(displacement, terrain, rock, run)
        files |= {STILL: binary(still), FILM: binary(film)}
        pga, ratio = (float(displacement[name][run]) for name in ("pga", "pgv_pga"))
        caption = (f"PGA {pga:.3g} g, PGV/PGA {ratio:.3g} s: the trajectory of median length "
                   "among those that end at rest.")  # fmt: skip
        slots += [
            Slot("One run, pose by pose", caption, style.data_uri(still, "png")),
            Slot("The same run in motion", image=style.data_uri(film, "webp")),
        ]
    page = displacement_page.page(
        work.origin.name,
        displacement,
        terrain,
        source,
        _found(boulder, terrain),
        slots,
        surrogate=bool(rock.attrs["surrogate"]),
        numerics={
            "time_steps": time_steps(time_step.data),
            "simulation": simulation,
            "records": motion.kind == "record",
            "tables": motion.kind == "table",
        },
    )
    space = scene3d.page(displacement, terrain, rock, work.origin.name, source)
    files |= {PAGE: text(page), SPACE: text(space)}
    sizes = f"{len(page) / 1e6:.1f} MB, and {len(space) / 1e6:.1f} MB in three dimensions"
    return Product(files, sizes)


def _figures(displacement: xr.Dataset, terrain: xr.Dataset, source: str) -> dict[str, Writer]:
    """Files of the figures of all runs."""
    drawn = {
        "trajectories": trajectory_maps.trajectories(displacement, terrain, source),
        "side_view": trajectory_maps.side_view(displacement, terrain, source),
        "end_positions": trajectory_maps.end_positions(displacement, terrain, source),
        "trajectory_lengths": correlation_figures.trajectory_lengths(displacement, source),
        "ensemble_means": correlation_figures.ensemble_means(displacement, source),
    }
    files: dict[str, Writer] = {}
    for name, figure in drawn.items():
        files |= style.pictures(f"figures/{name}", figure)
    return files


def _found(given: BoulderConfig | None, terrain: xr.Dataset) -> ObservedBoulder | None:
    """The observed fallen rock, in the site's frame."""
    if given is None:
        return None
    x, y, _ = terrain.attrs["origin_in_scan"]
    area = math.inf if given.deposit_area is None else given.deposit_area
    place = given.position[0] - x, given.position[1] - y
    return ObservedBoulder(place, given.position_sd, given.association_probability, area)
