"""Drive: how well the servo's table follows its motions, and what that does to the boundary."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pipeline.config import in_si
from pipeline.config.layers import Site
from pipeline.config.motion_schema import MotionConfig
from pipeline.config.problems import InputError
from pipeline.config.scene_schema import ServoConfig
from pipeline.config.schema import SceneSettings
from pipeline.config.sections import Key
from pipeline.drawing import style
from pipeline.drawing.style import pictures, svg_uri
from pipeline.stages.mesh.products import Standing
from pipeline.stages.motions.motion_grid import MotionFiles
from pipeline.stages.runs.scenes import Group, Scenes, reach, refuse_force
from pipeline.stages.studies.servo import drive_runs
from pipeline.stages.studies.servo.drive_runs import A_PULSE, Followed
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import described, label, netcdf, split
from pipeline.workflow.grammar import counted
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.run.boundary_search import Bracket
from vsr_core.table.servo import check
from vsr_core.verification.tracking import TableHistory

FILE, TABLE, PAGE = "drive.nc", "drive.csv", "drive.html"

_SAMPLED = {
    "time": "time",
    "commanded_velocity": "wanted",
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
    driven = replace(scenes, settings=settings._replace(servo=servo))
    refuse_force(driven, motion.pga[-1], work.origin)
    drives = drive_runs.drives(in_si.servo(servo))
    waves = drive_runs.rough(motion, files)
    with Steps("drive", work.log) as steps:
        steps.tell(f"following the table through {waves.name}")
        tracks, records = drive_runs.tracks(scenes, group, drives, waves, reach(driven))
    falling = tracks[Followed(waves.name, drives[-1].name)]
    rows = drive_runs.rows(work, motion, scenes, group, drives)
    dataset = described(_dataset(tracks, rows), work, "Driven table")
    dataset["first_overturning_pga"].attrs["long_name"] = (
        "first-overturning PGA: geometric middle of its interval; missing where an end of it is"
    )
    dataset["first_overturning_pga_upper"].attrs["long_name"] = (
        "upper end of that interval: lowest PGA tried that overturns the rock, missing where none "
        "does"
    )
    shift = _shift(dataset)
    drawn = {
        "drive_tracking": tracking(dataset),
        "drive_disturbance": disturbed(dataset),
        "drive_boundary": boundaries(dataset),
    }
    page = {
        "site": work.origin.name,
        "records": records,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
        "pga": records[-1]["pga_g"],
        "wanted_pga": waves.pga,
        "toppled": drive_runs.peak_tilt(falling, standing.barrier) > standing.barrier.toppled_tilt,
        "made": waves.name == drive_runs.ROUGH,
        "motion": waves.name,
        "tried": motion.pga[-1],
        "levels": drive_runs.LEVELS,
        "mass": scenes.rock.mass,
        "table_mass": drives[-1].servo.mass if drives[-1].servo else math.nan,
        "shift": shift,
        "rows": np.column_stack([dataset["pgv_pga"], dataset["first_overturning_pga"].T]).tolist(),
        "drives": [drive.name for drive in drives],
    }
    made = {
        FILE: netcdf(dataset),
        TABLE: writers.table(pd.DataFrame(records, columns=drive_runs.COLUMNS)),
        PAGE: writers.text(pages.filled(PAGE, page, work.up)),
    }
    for name, figure in drawn.items():
        made |= pictures(name, figure)
    worst = max(record["rms_m_per_s"] for record in records if not record["note"])
    return Product(made, f"rms errors up to {worst:.2g} m/s; boundary {shift}")


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
    """Change of the boundary from the table's frame to the last of the drives, in words."""
    frame, driven = dataset["first_overturning_pga"].values[[0, -1]]
    change = 100.0 * (driven / frame - 1.0)
    found = change[np.isfinite(change)]
    both = "both with the servo and without it"
    if not found.size:
        said = f"known in no row {both}"
    else:
        middle, worst = np.median(found), found[np.abs(found).argmax()]
        said = f"shifted by {middle:+.1f} % in the median row and by {worst:+.1f} % at most"
        if len(found) < len(change):
            said += f", over the {len(found)} of {counted(len(change), 'row')} that have one {both}"
    for one, where in ((driven, "with the servo"), (frame, "without it")):
        if alone := int((np.isfinite(one) & ~np.isfinite(change)).sum()):
            said += f"; in {counted(alone, 'row')} there is one only {where}"
    return said


def refuse_servo(site: Site) -> None:
    """Refuse a servo that is not stable, which counts here even where it drives nothing else."""
    try:
        check(in_si.servo(site.config.servo))
    except InvalidInput as error:
        raise InputError.from_invalid(site.file_of("servo"), "servo", error) from None


_AROUND = (0.06, 0.14)
"""Time shown before and after the largest push [s]."""

_LAY = 1.0
"""Tilt of a rock that is down [rad]; what it does to the table before is no disturbance yet."""


@style.styled
def tracking(drive: xr.Dataset) -> Figure:
    """Velocity commanded and measured in the pulse (the paper's Fig. 7a), and their difference."""
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.2))
    cases = [case for case in split(drive, "row_size") if case["case_motion"].item() == A_PULSE]
    _commanded(upper, cases[0], 3.2)
    for number, case in enumerate(cases):
        colour = style.SERIES[number]
        name = "measured: " + case["case_drive"].item()
        upper.plot(case["time"], case["table_velocity"], color=colour, lw=0.9, label=name)
        lower.plot(case["time"], _error(case), color=colour, lw=0.5, zorder=3 - number)
    upper.set_ylabel("velocity of the table [m/s]")
    upper.legend()
    upper.grid(visible=True)
    lower.grid(visible=True)
    lower.set(ylabel="measured less\ncommanded [mm/s]", xlabel="time [s]")
    return figure


@style.styled
def disturbed(drive: xr.Dataset) -> Figure:
    """The rough motion while the rock topples (the paper's Fig. 7b), and the push closely."""
    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, height_ratios=(1.6, 0.8, 1.4))
    case = split(drive, "row_size")[-1]
    time, measured = case["time"].values, case["table_velocity"].values
    push = time[_largest_push(case)]
    _commanded(upper, case, 2.4)
    upper.plot(
        case["time"], case["table_velocity"], color=style.SERIES[0], lw=0.8, label="measured"
    )
    upper.set_ylabel("velocity of the\ntable [m/s]")
    upper.legend(loc="upper left", title=case["case_motion"].item())
    middle.plot(time, np.degrees(case["tilt"]), color=style.OVERTURNED, lw=1.0)
    middle.set(ylabel="tilt of the\nrock [deg]", xlabel="time [s]")
    start, stop = push - _AROUND[0], push + _AROUND[1]
    inside = (time >= start) & (time <= stop)
    error = _error(case)[inside]
    lower.plot(time[inside], error, color=style.SERIES[0], lw=0.9, marker=".", ms=2.0)
    lower.axhline(0.0, color=style.INK, lw=0.6)
    lower.set(
        ylabel="measured less\ncommanded [mm/s]",
        xlabel="time [s], around the largest push of the falling rock",
        xlim=(start, stop),
    )
    start, stop = push - 2.0 * _AROUND[0], push + 2.0 * _AROUND[1]
    shown = measured[(time >= start) & (time <= stop)]
    low, high, pad = shown.min(), shown.max(), 0.04 * np.ptp(measured)
    box = (start, low - pad), stop - start, high - low + 2.0 * pad
    upper.add_patch(Rectangle(*box, fill=False, edgecolor=style.BASE, lw=1.2))
    for axes in (upper, middle, lower):
        axes.grid(visible=True)
    return figure


@style.styled
def boundaries(drive: xr.Dataset) -> Figure:
    """First overturning with each way to drive the table."""
    figure = Figure(figsize=(5.6, 4.6), layout="constrained")
    axes = figure.add_subplot()
    ratio = drive["pgv_pga"].values
    for number, name in enumerate(drive["drive"].values.tolist()):
        one = drive.isel(drive=number)
        middle, low, high = (
            one[f"first_overturning_pga{end}"].values for end in ("", "_lower", "_upper")
        )
        known = np.isfinite(middle)
        frame = number == 0
        axes.errorbar(
            middle[known],
            ratio[known],
            xerr=np.array([middle - low, high - middle])[:, known],
            color=style.INK if frame else style.SERIES[number - 1],
            marker=style.MARKERS[number],
            mfc="white",
            ms=8.0 - 1.8 * number,
            lw=2.6 if frame else 1.1,
            alpha=0.45 if frame else 1.0,
            label=name,
        )
    axes.set_yscale("log")
    axes.set_yticks(ratio, [f"{value:.2g}" for value in ratio])
    axes.minorticks_off()
    axes.set(xlabel=f"first overturning: {label('pga')}", ylabel="PGV/PGA [s]")
    axes.grid(visible=True)
    figure.legend(loc="outside lower center", ncols=1)
    return figure


def _commanded(axes: Axes, case: xr.Dataset, width: float) -> None:
    look: Any = {"color": style.INK, "lw": width, "alpha": 0.35, "label": "commanded"}
    axes.plot(case["time"], case["commanded_velocity"], **look)


def _error(case: xr.Dataset) -> Array:
    """Velocity measured less commanded [mm/s]."""
    return 1e3 * (case["table_velocity"].values - case["commanded_velocity"].values)


def _largest_push(case: xr.Dataset) -> int:
    """Sample at which the table is farthest from where it should be, once the rock falls."""
    falls = case["tilt"].values > 0.5 * _LAY
    error = np.abs(_error(case))
    return int(np.argmax(np.where(falls, error, 0.0) if falls.any() else error))
