"""Fig. 7: velocity of a table that the published servo drives, in a pulse and in a record."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Rectangle

from pipeline.config import in_si
from pipeline.drawing import style
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.paper import RECORDED, Data, Finding, Source
from pipeline.stages.studies.servo.drive_runs import A_PULSE, PULSE, RECORD
from pipeline.workflow.datasets import split
from vsr_core.arrays import Array
from vsr_core.outcome import Outcome
from vsr_core.verification.tracking import shaken

TITLE = "Velocity of the driven table"

_FLAT, _TERRAIN = "double_rock", "double_rock_terrain"

SOURCES = {
    "drive": Source(_FLAT, "drive", RECORDED),
    "rock": Source(_FLAT, "rock", RECORDED),
    "records on flat ground": Source(_FLAT, "responses", RECORDED),
    "records on the terrain": Source(_TERRAIN, "responses", RECORDED),
    "pulse on flat ground": Source(_FLAT, "responses", "pulse_of_fig_7b"),
    "pulse on the terrain": Source(_TERRAIN, "responses", "pulse_of_fig_7b"),
}

OVERLAP = 0.01
"""Rms error over PGV up to which two velocities overlap."""

FALLS = 0.5
"""Tilt from which the rock falls [rad]."""

STANDS_OUT, QUICK = 3.0, 0.5
"""Disturbance over the rms error before it, and time [s] of a quick recovery."""

_AROUND = 0.05  # s, to either side of the disturbance
_MARGIN = 1.5  # s, drawn around the part of a record that shakes the table


@style.styled
def draw(data: Data) -> Figure:
    """Draw desired and measured velocity in both motions, and the disturbance closely."""
    pulses, record = _cases(data["drive"])
    below_the_note = ConstrainedLayoutEngine(rect=(0.0, 0.0, 1.0, 0.975))
    figure = Figure(figsize=(7.2, 8.2), layout=below_the_note)
    panels = figure.subplots(3, 1, height_ratios=(1.2, 1.2, 1.0))
    _velocities(panels[0], pulses[0])
    pga, ratio = PULSE
    panels[0].set_title(f"(a) single-pulse cosine displacement, PGA {pga:g} g, PGV/PGA {ratio:g} s")
    panels[0].set_xlim(0.0, 2.0 * np.pi * ratio + 1.0)
    _velocities(panels[1], record)
    panels[1].set_xlim(*_moving(record))
    panels[0].legend(loc="upper right")
    name = record["case_motion"].item().removeprefix(RECORD).strip()
    panels[1].set_title(f"(b) recorded motion “{name}”, PGA {_peak(record):.2g} g")
    _closely(panels[1], panels[2], record)
    for axes in panels:
        axes.grid(visible=True)
        axes.set_ylabel("velocity [m/s]")
    panels[2].set_xlabel("time [s]")
    diagrams.note(figure, data["rock"].attrs["shape_source"])
    return figure


def _cases(drive: xr.Dataset) -> tuple[list[xr.Dataset], xr.Dataset]:
    """The pulse with each servo, and the recorded motion."""
    cases = split(drive, "row_size")
    return [case for case in cases if case["case_motion"].item() == A_PULSE], cases[-1]


def _velocities(axes: Axes, case: xr.Dataset) -> None:
    axes.plot(case["time"], case["commanded_velocity"], color=style.BASE, lw=3.2, alpha=0.6,
              label="desired", gid="desired")  # fmt: skip
    axes.plot(case["time"], case["table_velocity"], color=style.SERIES[0], lw=0.9,
              label="measured", gid="measured")  # fmt: skip


def _moving(record: xr.Dataset) -> tuple[float, float]:
    """Time in which the table is shaken, and a little more [s]."""
    time = record["time"].values[shaken(record["commanded_velocity"].values)]
    return float(time[0]) - _MARGIN, float(time[-1]) + _MARGIN


def _closely(whole: Axes, near: Axes, record: xr.Dataset) -> None:
    """The largest disturbance, boxed in one panel and magnified in the next."""
    at, time = _push(record), record["time"].values
    start, stop = time[at] - _AROUND, time[at] + _AROUND
    inside = (time >= start) & (time <= stop)
    part = record.isel(sample=inside)
    near_velocity = part["table_velocity"].values
    low, high = float(near_velocity.min()), float(near_velocity.max())
    pad = 0.05 * float(np.ptp(record["table_velocity"].values))
    box = (start, low - pad), stop - start, high - low + 2.0 * pad
    whole.add_patch(Rectangle(*box, fill=False, edgecolor=style.OVERTURNED, lw=1.4, zorder=5))
    _velocities(near, part)
    near.set_xlim(start, stop)
    near.set_title("within the box: the rock falls onto the table")


def _error(case: xr.Dataset) -> Array:
    """Velocity measured less desired [m/s]."""
    error: Array = case["table_velocity"].values - case["commanded_velocity"].values
    return error


def _push(case: xr.Dataset) -> int:
    """Sample of the largest error once the rock falls, or of all if it does not."""
    falls = case["tilt"].values > FALLS
    error = np.abs(_error(case))
    return int(np.argmax(np.where(falls, error, 0.0) if falls.any() else error))


def _peak(case: xr.Dataset) -> float:
    """Largest desired acceleration [g]."""
    rates = np.gradient(case["commanded_velocity"].values, case["time"].values)
    return float(in_si.in_g(np.abs(rates).max()))


def findings(data: Data) -> list[Finding]:
    """Compare with section 4.1."""
    pulses, record = _cases(data["drive"])
    return [
        _overlap(pulses),
        _disturbance(record),
        _outcomes(data, "records", "a recorded motion"),
        _outcomes(data, "pulse", "a pulse of 0.4 g and 1.2 s"),
    ]


def _overlap(pulses: list[xr.Dataset]) -> Finding:
    shares = {}
    for case in pulses:
        wanted = case["commanded_velocity"].values
        rms = np.sqrt(np.mean(_error(case)[shaken(wanted)] ** 2))
        shares[case["case_drive"].item()] = float(rms / np.abs(wanted).max())
    result = "; ".join(f"{name}: {100 * share:.2f} % of PGV" for name, share in shares.items())
    return Finding(
        "Fig. 7a, section 4.1",
        "In a pulse of 0.2 g and 0.8 s the measured velocity overlaps the desired one.",
        f"rms error at most {100 * OVERLAP:g} % of PGV",
        result,
        max(shares.values()) <= OVERLAP,
    )


def _disturbance(record: xr.Dataset) -> Finding:
    claim = "The toppling rock disturbs the table's velocity for an instant; the servo corrects it."
    rule = (
        f"an error {STANDS_OUT:g} times the rms from the first shaking to the fall, and "
        f"within {QUICK:g} s no larger than the largest then"
    )
    if record["tilt"].max() <= FALLS:
        return Finding("Fig. 7b, section 4.1", claim, rule, "the rock does not topple", None)
    error, time, at = np.abs(_error(record)), record["time"].values, _push(record)
    fall = int(np.argmax(record["tilt"].values > FALLS))
    earlier = error[shaken(record["commanded_velocity"].values).start : fall]
    before = float(np.sqrt(np.mean(earlier**2)))
    calm = np.flatnonzero(error[at:] <= earlier.max())
    recovery = float(time[at + calm[0]] - time[at]) if calm.size else np.inf
    return Finding(
        "Fig. 7b, section 4.1",
        claim,
        rule,
        f"error up to {1e3 * error[at]:.3g} mm/s, {1e3 * before:.2g} mm/s rms before; over after "
        f"{1e3 * recovery:.3g} ms",
        bool(error[at] >= STANDS_OUT * before and recovery <= QUICK),
    )


def _outcomes(data: Data, kind: str, motion: str) -> Finding:
    """Outcomes of the motions of one kind on flat ground and on the terrain."""
    flat, terrain = _named(data[f"{kind} on flat ground"]), _named(data[f"{kind} on the terrain"])
    result = "; ".join(
        f"{name}: {outcome.name.lower()} on flat ground, {terrain[name].name.lower()} on the "
        "terrain"
        for name, outcome in flat.items()
    )
    at_least = ", one record at least" if kind == "records" else ""
    return Finding(
        "Fig. 7b, sections 4.1 and 6.1",
        f"A motion of 0.4 g that topples Double Rock on flat ground leaves it standing on the "
        f"terrain, at yaw 0° (here {motion}).",
        f"it topples on flat ground and not on the terrain{at_least}",
        f"{result}; the terrain is a surrogate",
        _topples_on_flat_ground_alone(flat, terrain),
    )


def _topples_on_flat_ground_alone(
    flat: dict[str, Outcome], terrain: dict[str, Outcome]
) -> bool | None:
    """Whether a motion does; None where only an unresolved one may."""
    sides = [(flat[name].overturned, terrain[name].overturned) for name in flat]
    if (1, 0) in sides:
        return True
    return None if {(1, -1), (-1, 0), (-1, -1)} & set(sides) else False


def _named(responses: xr.Dataset) -> dict[str, Outcome]:
    """Outcome of each motion, by its name."""
    codes = responses["outcome"].values[0, 0, :, 0]
    names = responses["record"].values if "record" in responses.dims else ["pulse"]
    return {str(name): Outcome(code) for name, code in zip(names, codes, strict=True)}
