"""Displacement report: figures, pictures of motion and two pages, from the products of a site."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.motion_schema import MotionConfig
from pipeline.config.scene_schema import ObservedBoulder as BoulderConfig
from pipeline.config.simulation_schema import SimulationConfig
from pipeline.drawing import style
from pipeline.drawing.style import png_uri
from pipeline.stages.datasets import displaced_runs, vertical
from pipeline.stages.datasets.displaced_runs import (
    STOPS,
    ends,
    forward,
    groups,
    left_seat,
    overturned_runs,
)
from pipeline.stages.datasets.displacement_dataset import Displacement
from pipeline.stages.datasets.stored_runs import in_words, kinds, ways
from pipeline.stages.displacement import correlation_figures, scene3d, timelapse, trajectory_maps
from pipeline.stages.displacement.correlation_figures import (
    NAMES,
    TABLE_1,
    ensemble_means,
    power,
    trajectory_lengths,
)
from pipeline.stages.displacement.origin_maps import SHARE, origin_maps
from pipeline.stages.displacement.trajectory_maps import end_positions, side_view, trajectories
from pipeline.stages.fragility.summary import time_steps
from pipeline.stages.mesh.products import RockData, TerrainData
from pipeline.stages.runs.step_choice import StepData
from pipeline.workflow.datasets import is_shaken_along_x
from pipeline.workflow.pages import filled
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.writers import Writer, binary, text
from vsr_core.displacement.correlation import STATISTICS, Correlation, correlations, lower_bound
from vsr_core.displacement.origin import ObservedBoulder, trace
from vsr_core.outcome import StopReason

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
    report = page(
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
        up=work.up,
    )
    space = scene3d.page(displacement, terrain, rock, work.origin.name, source, work.up)
    files |= {PAGE: text(report), SPACE: text(space)}
    sizes = f"{len(report) / 1e6:.1f} MB, and {len(space) / 1e6:.1f} MB in three dimensions"
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


Row = dict[str, Any]

TEMPLATE = "displacement.html"


@dataclass(frozen=True)
class Slot:
    """Something made elsewhere that the page shows or leads to.

    Attributes
    ----------
    image : str, address that holds a picture, animated or not; shown in the page
    link : str, address relative to the page, e.g. of a page in three dimensions
    """

    title: str
    caption: str = ""
    image: str = ""
    link: str = ""


def page(
    site: str,
    displacement: xr.Dataset,
    terrain: xr.Dataset,
    source: str,
    found: ObservedBoulder | None = None,
    slots: Sequence[Slot] = (),
    *,
    surrogate: bool,
    numerics: Row | None = None,
    up: str = "../",
) -> str:
    """Everything about large displacement in one page that loads nothing.

    Parameters
    ----------
    found : ObservedBoulder, optional
        A fallen rock observed on the terrain, in the site's frame.
    slots : sequence of Slot
        Time-lapse, animation, page in three dimensions.
    surrogate : bool
        Whether the terrain is not a scan, but made from published figures.
    numerics : dict, optional
        Measured time steps, settings of the simulation, and what kind of motions there are.
    up : str
        The way from the page to the folder of all results, as a link has it.

    Returns
    -------
    str
        HTML that holds all it needs.
    """
    facts = {
        "site": site,
        "source": source,
        "surrogate": surrogate,
        "seat": terrain.attrs.get("seat", ""),
        "held": terrain.attrs.get("held", ""),
        "answer": _answer(displacement),
        "counts": _counts(displacement),
        "along_x": is_shaken_along_x(displacement),
        "vertical": vertical.effect(displacement),
        "groups": [_group(name, runs, terrain, source) for name, runs in groups(displacement)],
        "ends": png_uri(end_positions(displacement, terrain, source)),
        "origin": _origin(displacement, terrain, source, found) if found else None,
        "slots": slots,
        "numerics": numerics,
    }
    return filled(TEMPLATE, facts, up)


def _answer(displacement: xr.Dataset) -> Row:
    """Numbers of the first sentences."""
    runs, stop = overturned_runs(displacement), displacement["stop_reason"].values
    answer: Row = {
        "runs": displacement.sizes["run"],
        "left": len(runs),
        "ways": _ways(displacement),
        "cut": int((left_seat(displacement) & (stop != StopReason.REST)).sum()),
        "undone": int((stop == StopReason.UNDONE).sum()),
    }
    for name in STATISTICS:
        answer[name] = [float(runs[name].median()), float(runs[name].max())]
    return answer


def _ways(displacement: xr.Dataset) -> str:
    """How many runs left the seat by rolling over, by falling and by sliding."""
    return in_words(ways(displacement["outcome"].values, displacement["movement"].values))


def _counts(displacement: xr.Dataset) -> Row:
    """Runs by kind of end and by what ended them."""
    stop = displacement["stop_reason"].values
    found = kinds(displacement["outcome"].values, displacement["movement"].values)
    return {
        "kinds": list(found),
        "rows": [
            {"stop": STOPS[reason], "runs": [int((runs & (stop == reason)).sum())
                                             for runs in found.values()]}
            for reason in StopReason
            if (stop == reason).any()
        ],
        "total": [int(runs.sum()) for runs in found.values()],
    }  # fmt: skip


def _group(name: str, runs: xr.Dataset, terrain: xr.Dataset, source: str) -> Row:
    """Table 1 and the figures of one direction and friction."""
    return {
        "name": name,
        "left": int(left_seat(runs).sum()),
        "ways": _ways(runs),
        "runs": runs.sizes["run"],
        "table": [_line(found) for found in correlations(overturned_runs(runs))],
        "trajectories": png_uri(trajectories(runs, terrain, source)),
        "side": png_uri(side_view(runs, terrain, source)),
        "lengths": png_uri(trajectory_lengths(runs, source)),
        "means": png_uri(ensemble_means(runs, source)),
    }


def _line(found: Correlation) -> Row:
    r2, p = TABLE_1[found.statistic, found.regressor]
    return {
        "found": found,
        "statistic": "mean " + NAMES[found.statistic],
        "regressor": NAMES[found.regressor],
        "p": power(found.line.p),
        "paper_r2": r2,
        "paper_p": power(p),
    }


def _origin(
    displacement: xr.Dataset, terrain: xr.Dataset, source: str, found: ObservedBoulder
) -> Row:
    """The inverse: the shaking that explains the place, and the least that carries a rock there."""
    runs = forward([displacement], np.zeros((1, 2)))
    origin = trace(runs, found)
    region = origin.region(SHARE)
    axes = (("PGA", "g", origin.pga, region.any(axis=0)),
            ("PGV/PGA", "s", origin.pgv_pga, region.any(axis=1)))  # fmt: skip
    spans = [
        {"name": name, "unit": unit, "ends": values[inside][[0, -1]].tolist()}
        for name, unit, values, inside in axes
        if inside.any()
    ]
    mask = left_seat(displacement)
    far, distance = np.hypot(*ends(displacement)[mask].T), math.hypot(*found.place)
    bounds = [
        lower_bound(displacement[name].values[mask].astype(float), far, distance, name)
        for name in ("pga", "pgv_pga")
    ]
    return {
        "found": found,
        "answer": origin,
        "share": SHARE,
        "spans": spans,
        "distance": distance,
        "bounds": [
            {"name": NAMES[bound.regressor], "bound": bound, "interval": _interval(*bound.of_run)}
            for bound in bounds
        ],
        "maps": png_uri(origin_maps(origin, runs, found, terrain, source)),
    }


def _interval(low: float, high: float) -> str:
    if math.isnan(low):
        return "not known"
    return f"{low:.3g} to {high:.3g}" if math.isfinite(low) else "unbounded"
