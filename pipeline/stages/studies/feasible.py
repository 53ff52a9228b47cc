"""Which part of a grid of motions a shake table can do, and its commands for that part."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from pipeline.config.layers import load_table
from pipeline.config.motion_schema import PulseConfig
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import TableConfig
from pipeline.config.slips import warnings_of_table
from pipeline.drawing import style
from pipeline.drawing.style import pictures
from pipeline.stages.boundary.boundary import BoundaryData
from pipeline.stages.mesh.products import Standing
from pipeline.workflow import graph, writers
from pipeline.workflow.datasets import described, label, netcdf
from pipeline.workflow.grammar import counted
from pipeline.workflow.graph import Identity
from pipeline.workflow.log import complain
from pipeline.workflow.registry import BY_NAME
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import writing
from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.table.capacity import LIMITS, Table, binding, commands, largest_pga, loads

FILE, TABLE, PICTURE = "feasible.nc", "feasible.csv", "feasible"

_BINDING = ("none", *LIMITS)
"""Limits of a motion, by code."""

_COLUMNS = {
    "pgv_pga": "pgv_pga_s",
    "pga": "pga_g",
    "feasible": "feasible",
    "binding": "binding",
    "pgv": "pgv_m_per_s",
    "stroke": "stroke_m",
}
"""Columns of the table by their variables."""


def make(job: Job, name: str, export: Path | None) -> list[str]:
    """Write the products, and the commands if wanted."""
    config, file = load_table(name)
    for warning in warnings_of_table(config, file):
        complain(f"vsr: warning: {warning}")
    motion = job.config.motion
    if not isinstance(motion, PulseConfig):
        rule, remedy = "the grid is one of cosine pulses", "use a site or study of cosine pulses"
        file = job.site.file_of("motion.kind")
        raise InputError(Problem(file, "motion.kind", repr(motion.kind), rule, remedy))
    if export is not None:
        _check_export(export, motion, config.table(), file)
    job.store.check_apart([Path(name)] if name.endswith((".yaml", ".yml")) else [])
    graph.make("rock", job)
    job.store.open()
    rock = graph.built(Standing, job).rock
    label = Path(file).stem
    boundaries, known = _boundaries(job), graph.identities("boundary", job.site)
    drawn = ("rock",) if boundaries is None else ("rock", "boundary")
    above = {stage: known[stage].key for stage in drawn}
    table = {"table": config.model_dump(mode="json"), "motion": motion.model_dump(mode="json")}
    identity = Identity({"config": table, "code": {}, "inputs": {}, "versions": {}, "needs": above})
    work = graph.work_of("feasible", identity.key, job)
    number = len(motion.pga) * len(motion.pgv_pga)
    work.log(f"feasible: {counted(number, 'motion')} of {label}")
    dataset = _dataset(motion, config.table(), rock.mass)
    dataset.attrs |= {"table": label, "unchecked": ", ".join(config.unstated)}
    dataset = described(dataset, work, f"What {label} can do")
    dataset["binding"].attrs |= {
        "flag_values": np.arange(len(_BINDING), dtype=dataset["binding"].dtype),
        "flag_meanings": " ".join(_BINDING),
    }
    figure = feasible_grid(dataset, boundaries)
    files = {FILE: netcdf(dataset), TABLE: writers.table(_table(dataset))}
    graph.keep(PICTURE, identity, Product(files | pictures(PICTURE, figure), label), job.store)
    lines = _told(dataset, config, rock.mass)
    if export is not None:
        number = _export(dataset, config.table(), export)
        lines.append(f"commands of {number} motions -> {export}")
    return lines


def _dataset(motion: PulseConfig, table: Table, mass: float) -> xr.Dataset:
    """Loads of each motion on the table, and the limit that it exceeds most."""
    cells = pd.MultiIndex.from_product([motion.pgv_pga, motion.pga], names=["pgv_pga", "pga"])
    pulses = [CosinePulse.from_g(pga, ratio) for ratio, pga in cells]
    asked = [loads(pulse, mass) for pulse in pulses]
    binds = [_BINDING.index(binding(table, pulse, mass) or "none") for pulse in pulses]
    grid = pd.DataFrame(
        {
            "feasible": np.equal(binds, 0).astype(np.int8),
            "binding": np.array(binds, np.int8),
            "pgv": [load["velocity"] for load in asked],
            "stroke": [load["stroke"] for load in asked],
        },
        cells,
    ).to_xarray()
    ends = pd.DataFrame([largest_pga(table, ratio) for ratio in motion.pgv_pga]) / GRAVITY
    limits = {f"{name}_pga": ("pgv_pga", values) for name, values in ends.items()}
    return grid.assign(limits).assign_attrs(mass_kg=mass)


def _boundaries(job: Job) -> xr.Dataset | None:
    """The site's boundary, if it is there, whole, of these settings and of pulses."""
    own = graph.identities("boundary", job.site)["boundary"]
    if any(graph.why(BY_NAME["boundary"], own, job.store)):
        return None
    boundary = BoundaryData.load(job.store).data
    return boundary if "pgv_pga" in boundary.dims else None


def _table(dataset: xr.Dataset) -> pd.DataFrame:
    """A row a motion."""
    table = dataset[["feasible", "binding", "pgv", "stroke"]].to_dataframe().reset_index()
    table["binding"] = [_BINDING[code] for code in table["binding"]]
    return table[list(_COLUMNS)].rename(columns=_COLUMNS)


def _told(dataset: xr.Dataset, config: TableConfig, mass: float) -> list[str]:
    limit = dataset["binding"].values
    name = dataset.attrs["table"]
    lines = [
        f"{name}: {int((limit == 0).sum())} of {limit.size} motions can be done",
        f"{'binding':<14}{'limit':<12}{'motions':>7}",
    ]
    units = {"acceleration": "g", "velocity": "m/s", "stroke": "m", "payload": "kg"}
    for code, what in enumerate(LIMITS, 1):
        given = getattr(config, what)
        shown = "not stated" if given is None else f"{given:g} {units[what]}"
        lines.append(f"{what:<14}{shown:<12}{int((limit == code).sum()):>7}")
    if config.payload is not None and mass > config.payload:
        lines.append(
            f"the rock weighs {mass:.4g} kg: a model of it at "
            f"{(config.payload / mass) ** (1.0 / 3.0):.3g} of its size would be light enough"
        )
    if config.unstated:
        lines.append(f"not stated for this table, so not checked: {', '.join(config.unstated)}")
    return lines


FEWEST = 16
"""Commands of a pulse, each the mean velocity while it is held: so many keep .994 of the PGV."""


def _check_export(folder: Path, motion: PulseConfig, table: Table, file: str) -> None:
    """Refuse commands too coarse for a pulse, and a folder that holds others of another table."""
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        rule, remedy = "commands go into a new or an empty folder", "give another"
        raise InputError(Problem("--export", "", str(folder), rule, remedy))
    shortest = CosinePulse.from_g(motion.pga[0], motion.pgv_pga[0]).duration
    if shortest * table.command_rate < FEWEST:
        given = f"{table.command_rate:g} Hz, for a pulse of {shortest:.3g} s"
        rule = f"a pulse has at least {FEWEST} commands"
        raise InputError(Problem(file, "command_rate", given, rule, "leave out the short pulses"))


def _export(dataset: xr.Dataset, table: Table, folder: Path) -> int:
    """Write the commands of each motion that can be done; returns their number."""
    places = np.argwhere(dataset["feasible"].values == 1)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            for i, k in places.tolist():
                _write(folder, table, float(dataset["pgv_pga"][i]), float(dataset["pga"][k]))
        except BaseException:  # a part would be taken for the whole
            for path in folder.glob("*.csv"):
                path.unlink()
            raise
    return len(places)


def _write(folder: Path, table: Table, ratio: float, pga: float) -> None:
    """Write the commands of a motion."""
    sent = commands(table, CosinePulse.from_g(pga, ratio))
    frame = pd.DataFrame({"time_s": sent.time, "velocity_m_per_s": sent.velocity})
    if sent.steps is not None:
        frame["motor_step"] = sent.steps
    file = folder / f"pgv_pga_{ratio:.12g}_pga_{pga:.12g}.csv"
    frame.to_csv(file, index=False, lineterminator="\r\n")


_LINES = (
    ("acceleration_pga", "acceleration", "solid"),
    ("velocity_pga", "velocity", (0, (5, 2))),
    ("stroke_pga", "stroke", (0, (1, 1.5))),
)
"""Limits of motion: their variable, name and dashes."""

CAN, CANNOT, FAINTER = "#dcebdd", "#f2f2f2", "#b9b9b9"


@style.styled
def feasible_grid(feasible: xr.Dataset, boundary: xr.Dataset | None) -> Figure:
    """Draw the motions that a table can do, its limits, and the rock's boundary.

    Parameters
    ----------
    boundary : Dataset or None
        As in ``boundary.nc``; its first friction is drawn.
    """
    figure = Figure(figsize=(5.6, 5.2))
    axes = figure.add_axes((0.11, 0.24, 0.86, 0.69))
    _cells(axes, feasible)
    _limits(axes, feasible)
    if boundary is not None:
        _boundary(axes, boundary)
    axes.set_xlim(0.0, feasible["pga"].values[-1] * 1.02)
    axes.set_ylim(0.0, feasible["pgv_pga"].values[-1] * 1.02)
    axes.set_xlabel(label("pga"))
    axes.set_ylabel("PGV/PGA [s]")
    axes.set_title(_title(feasible))
    style.legend_below(figure, axes, 2, top=0.15)
    return figure


def _title(feasible: xr.Dataset) -> str:
    share = float(feasible["feasible"].values.mean())
    mass = f"rock of {feasible.attrs['mass_kg']:.4g} kg"
    return f"{feasible.attrs['table']}: {share:.0%} of the motions, {mass}"


def _cells(axes: Axes, feasible: xr.Dataset) -> None:
    pga, ratio = (
        style.cell_edges(feasible["pga"].values),
        style.cell_edges(feasible["pgv_pga"].values),
    )
    end = pga[feasible["feasible"].values.sum(axis=1)]  # what a table can do, it can do less, too
    parts = (("can", pga[0], end, CAN, ""), ("outside", end, pga[-1], CANNOT, "////"))
    for gid, first, last, colour, hatch in parts:
        left, right = np.broadcast_arrays(first, last, end)[:2]
        corners = [(left, ratio[:-1]), (left, ratio[1:]), (right, ratio[1:]), (right, ratio[:-1])]
        rows = np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1)[left < right]
        with mpl.rc_context({"hatch.linewidth": 0.5, "hatch.color": FAINTER}):
            axes.add_collection(
                PolyCollection(list(rows), facecolor=colour, hatch=hatch, linewidth=0.0, gid=gid)
            )
    axes.fill([], [], facecolor=CAN, edgecolor="#8fb392", label="the table can do it")
    beyond: dict[str, Any] = {"facecolor": CANNOT, "edgecolor": FAINTER, "hatch": "////"}
    axes.fill([], [], label="beyond its limits", **beyond)


def _limits(axes: Axes, feasible: xr.Dataset) -> None:
    pga, ratio = feasible["pga"].values, feasible["pgv_pga"].values
    dense = np.linspace(ratio[0], ratio[-1], 400)
    for name, text, dashes in _LINES:
        values = feasible[name].values
        # 1 / PGA goes as a power of the ratio, so it is drawn between the rows as on them
        end = np.exp(np.interp(np.log(dense), np.log(ratio), np.log(values)))
        if np.isfinite(end).any() and (end < pga[-1]).any():
            axes.plot(end, dense, color=style.INK, ls=dashes, lw=1.3, label=f"{text} limit")


def _boundary(axes: Axes, boundary: xr.Dataset) -> None:
    """First overturning of each direction."""
    runs = boundary.isel(friction=0)
    for number, yaw in enumerate(runs["yaw"].values):
        first = runs["first_overturning_pga"].values[number]
        text = "first overturning of the rock" + (", each yaw" if runs.sizes["yaw"] > 1 else "")
        axes.plot(
            np.where(np.isfinite(first), first, np.nan),
            runs["pgv_pga"].values,
            ".-",
            color=style.OVERTURNED,
            lw=1.0,
            ms=3.0,
            alpha=0.85 if runs.sizes["yaw"] == 1 else 0.5,
            label=text if number == 0 else None,
            gid=f"boundary-{yaw:g}",
        )
