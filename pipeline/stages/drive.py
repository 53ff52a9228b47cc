"""Drive: how well the servo's table follows its motions, and what that does to the boundary."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pipeline import driving, pages, writers
from pipeline.datasets import described, netcdf
from pipeline.layers import Site
from pipeline.problems import InputError
from pipeline.stage import Job, Product, Stage
from pipeline.stages.rock import load_rock

if TYPE_CHECKING:
    import xarray as xr

    from vsr_core.bounds import Barrier
    from vsr_core.scene import Rock
    from vsr_core.tracking import Track

FILE, TABLE, PAGE = "drive.nc", "drive.csv", "drive.html"


def make(job: Job) -> Product:
    """Follow a pulse and a rougher motion, and look for the boundary with and without a servo."""
    from pipeline.figures import drive as figures
    from pipeline.figures.style import pictures, svg_uri

    rock, limits = _rock(job)
    drives = driving.drives(job.config.servo.servo())
    tracks, records = driving.tracks(job, rock, limits, drives)
    rows = driving.rows(job, rock, limits, drives)
    dataset = described(_dataset(tracks, rows), job, "Driven table")
    drawn = {
        "drive_tracking": figures.tracking(dataset),
        "drive_disturbance": figures.disturbed(dataset),
        "drive_boundary": figures.boundaries(dataset),
    }
    page = {
        "site": job.site.name,
        "records": records,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
        "pga": records[-1]["pga_g"],
        "wanted_pga": driving.SYNTHETIC[0],
        "tried": job.config.motion.pga[-1],
        "mass": rock.mass,
        "table_mass": drives[-1].servo.mass if drives[-1].servo else math.nan,
        "shift": _shift(dataset),
        "rows": _listed(dataset),
        "drives": [drive.name for drive in drives],
    }
    files = {
        FILE: netcdf(dataset),
        TABLE: writers.table(driving.COLUMNS, records),
        PAGE: writers.text(pages.filled(PAGE, page)),
    }
    for name, figure in drawn.items():
        files |= pictures(name, figure)
    worst = max(record["rms_m_per_s"] for record in records if not record["note"])
    return Product(files, f"rms errors up to {worst:.2g} m/s; boundary {_shift(dataset)}")


def _rock(job: Job) -> tuple[Rock, Barrier]:
    from vsr_core.solid import standing

    rock, limits = load_rock(job.store)
    return (standing(rock) if job.config.on_terrain else rock), limits


def _dataset(
    tracks: dict[str, Track], rows: dict[tuple[str, float], driving.Interval]
) -> xr.Dataset:
    import numpy as np
    import xarray as xr

    names = list(dict.fromkeys(name for name, _ in rows))
    ratios = list(dict.fromkeys(ratio for _, ratio in rows))
    ends = np.array([[rows[name, ratio] for ratio in ratios] for name in names])

    def joined(part: str) -> Any:
        return np.concatenate([getattr(track, part) for track in tracks.values()])

    sampled = {
        "time": "time",
        "wanted_velocity": "wanted",
        "command": "command",
        "table_velocity": "measured",
        "servo_force": "force",
        "tilt": "tilt",
    }
    return xr.Dataset(
        {
            "row_size": ("case", [len(track.time) for track in tracks.values()]),
            **{name: ("sample", joined(part)) for name, part in sampled.items()},
            "last_balanced_pga": (("drive", "pgv_pga"), ends[..., 0]),
            "first_overturning_pga": (("drive", "pgv_pga"), ends[..., 1]),
        },
        {"case": list(tracks), "drive": names, "pgv_pga": ratios},
    )


def _shift(dataset: xr.Dataset) -> str:
    """Change of the boundary from the table's frame to a servo, in words."""
    import numpy as np

    middle = 0.5 * (dataset["last_balanced_pga"] + dataset["first_overturning_pga"]).values
    change = 100.0 * (middle[1:] / middle[0] - 1.0)
    change = change[np.isfinite(change)]
    if not change.size:
        return "outside the grid"
    worst = change[np.abs(change).argmax()]
    return f"shifted by {np.median(change):+.1f} % in the median row and by {worst:+.1f} % at most"


def _listed(dataset: xr.Dataset) -> list[list[float]]:
    """Rows of the page's table: PGV/PGA and the boundary with each drive [g]."""
    middle = 0.5 * (dataset["last_balanced_pga"] + dataset["first_overturning_pga"]).values
    return [
        [float(ratio), *(float(value) for value in middle[:, i])]
        for i, ratio in enumerate(dataset["pgv_pga"].values)
    ]


def _inputs(site: Site) -> dict[str, str]:
    """The template, and the servo, which the configuration leaves out where it is idle.

    Raises
    ------
    InputError
        For a servo whose sampled loop is unstable.
    """
    from vsr_core.errors import Unfit
    from vsr_core.servo import check

    servo = site.config.servo.servo()
    try:
        check(servo)
    except Unfit as error:
        raise InputError.from_unfit(site.file, "servo", error) from None
    return {PAGE: pages.digest(PAGE), "servo": repr(sorted(asdict(servo).items()))}


STAGE = Stage(
    name="drive",
    make=make,
    needs=("rock",),
    reads=("pedestal", "contact", "motion", "yaw"),
    code=(
        "pipeline.driving:run_rows",
        "vsr_core.engines.bullet:build",
        "vsr_core.engines.bullet:SOLVER",
    ),
    inputs=_inputs,
    versions=("pybullet", "matplotlib", "jinja2"),
)
