"""Drive: how well the servo's table follows its motions, and what that does to the boundary."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config import in_si
from pipeline.config.layers import Site
from pipeline.config.motion_schema import MotionConfig
from pipeline.config.problems import InputError
from pipeline.config.scene_schema import ServoConfig
from pipeline.config.schema import SceneSettings
from pipeline.config.sections import Key
from pipeline.drawing.style import pictures, svg_uri
from pipeline.stages.mesh.products import Standing
from pipeline.stages.motions.motion_grid import MotionFiles
from pipeline.stages.runs.scenes import Group, Scenes
from pipeline.stages.studies.servo import drive_figures as figures
from pipeline.stages.studies.servo import drive_runs
from pipeline.stages.studies.servo.drive_runs import Followed
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, netcdf
from pipeline.workflow.stage import Product, Work
from vsr_core.errors import InvalidInput
from vsr_core.run.boundary_search import Bracket
from vsr_core.table.servo import check
from vsr_core.verification.tracking import TableHistory

FILE, TABLE, PAGE = "drive.nc", "drive.csv", "drive.html"

_SAMPLED = {
    "time": "time",
    "wanted_velocity": "wanted",
    "command": "command",
    "table_velocity": "measured",
    "servo_force": "force",
    "tilt": "tilt",
}
"""Variables of the samples, and what they are in a ``TableHistory``."""


def make(
    work: Work,
    settings: SceneSettings,
    servo: Annotated[ServoConfig, Key("own_servo")],
    yaw: Annotated[tuple[float, ...], Key("yaw")],
    motion: MotionConfig,
    files: MotionFiles | None,
    standing: Standing,
) -> Product:
    """Follow a pulse and a rougher motion, and look for the boundary with and without a servo.

    Returns
    -------
    Product
        Dataset, table, page and figures of the driven table.
    """
    scenes, group = Scenes(settings, standing), Group(yaw[0], settings.contact.friction[0])
    drives = drive_runs.drives(in_si.servo(servo))
    waves = drive_runs.rough(motion, files)
    tracks, records = drive_runs.tracks(scenes, group, drives, waves)
    rows = drive_runs.rows(work, motion, scenes, group, drives)
    dataset = described(_dataset(tracks, rows), work, "Driven table")
    drawn = {
        "drive_tracking": figures.tracking(dataset),
        "drive_disturbance": figures.disturbed(dataset),
        "drive_boundary": figures.boundaries(dataset),
    }
    page = {
        "site": work.origin.name,
        "records": records,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
        "pga": records[-1]["pga_g"],
        "wanted_pga": waves.pga,
        "made": waves.name == drive_runs.ROUGH,
        "motion": waves.name,
        "tried": motion.pga[-1],
        "mass": scenes.rock.mass,
        "table_mass": drives[-1].servo.mass if drives[-1].servo else math.nan,
        "shift": _shift(dataset),
        "rows": np.column_stack([dataset["pgv_pga"], dataset["first_overturning_pga"].T]).tolist(),
        "drives": [drive.name for drive in drives],
    }
    made = {
        FILE: netcdf(dataset),
        TABLE: writers.table(pd.DataFrame(records, columns=drive_runs.COLUMNS)),
        PAGE: writers.text(pages.filled(PAGE, page)),
    }
    for name, figure in drawn.items():
        made |= pictures(name, figure)
    worst = max(record["rms_m_per_s"] for record in records if not record["note"])
    return Product(made, f"rms errors up to {worst:.2g} m/s; boundary {_shift(dataset)}")


def _dataset(
    tracks: dict[Followed, TableHistory], rows: dict[tuple[str, float], Bracket]
) -> xr.Dataset:
    names, ratios = (list(dict.fromkeys(part)) for part in zip(*rows, strict=True))
    row = ("drive", "pgv_pga")
    ends = [[(rows[d, r].stands or math.nan, rows[d, r].topples) for r in ratios] for d in names]
    stands, topples = np.moveaxis(np.array(ends), -1, 0)
    samples = {
        name: ("sample", np.concatenate([getattr(track, part) for track in tracks.values()]))
        for name, part in _SAMPLED.items()
    }
    return xr.Dataset(
        {
            "row_size": ("case", [len(track.time) for track in tracks.values()]),
            **samples,
            "case_motion": ("case", [case.motion for case in tracks]),
            "case_drive": ("case", [case.drive for case in tracks]),
            "first_overturning_pga": (row, np.sqrt(stands * topples)),
            "first_overturning_pga_lower": (row, stands),
            "first_overturning_pga_upper": (row, topples),
        },
        {"case": [str(case) for case in tracks], "drive": names, "pgv_pga": ratios},
    )


def _shift(dataset: xr.Dataset) -> str:
    """Change of the boundary from the table's frame to a servo, in words."""
    boundary = dataset["first_overturning_pga"].values
    change = 100.0 * (boundary[1:] / boundary[0] - 1.0)
    change = change[np.isfinite(change)]
    if not change.size:
        return "outside the grid"
    worst = change[np.abs(change).argmax()]
    return f"shifted by {np.median(change):+.1f} % in the median row and by {worst:+.1f} % at most"


def refuse_servo(site: Site) -> None:
    """Refuse a servo that is not stable, which counts here even where it drives nothing else."""
    try:
        check(in_si.servo(site.config.servo))
    except InvalidInput as error:
        raise InputError.from_invalid(site.file_of("servo"), "servo", error) from None
