"""Motions of a table in several axes: from their files to `motions.nc`, and back from there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import maximum_filter1d

from pipeline.config import in_si
from pipeline.config.layers import Origin
from pipeline.config.motion_schema import AxisPulseConfig
from pipeline.config.outside import held
from pipeline.config.paths import shown
from pipeline.stages.motions import record_inputs
from pipeline.workflow.datasets import split
from pipeline.workflow.grammar import counted
from pipeline.workflow.keys import digest_bytes
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions import digits
from vsr_core.motions.named_columns import Column, of_netcdf, of_text
from vsr_core.motions.sampled import SUBDIVISION, SampledMotion, sampled
from vsr_core.motions.six_axes import AXES

Loaded = tuple[tuple[str, ...], tuple["SampledMotion", ...], tuple[float, ...]]
"""Names, motions and their PGV/PGA [s], by ascending PGV/PGA."""


def of_files(origin: Origin, paths: list[Path]) -> Loaded:
    """The motions in files of a site."""
    file, key = origin.file_of("motion.files"), "motion.files"
    motions = record_inputs.each(file, key, paths, lambda path: _moving(load(path)))
    at_any_scale = map(_at_any_scale, map(shown, paths), motions)
    record_inputs.refuse_copies(file, key, at_any_scale)
    found = dict(zip(map(record_inputs.name_of, paths), motions, strict=True))
    ratios = {name: one.peak_velocity / one.peak_acceleration for name, one in found.items()}
    names = tuple(sorted(found, key=lambda name: (ratios[name], name)))
    return names, tuple(found[name] for name in names), tuple(ratios[name] for name in names)


def dataset(loaded: Loaded, pga: tuple[float, ...]) -> tuple[xr.Dataset, str]:
    """The motions as they are in the files, and their peaks."""
    names, motions, ratios = loaded
    samples = np.concatenate([one.samples for one in motions])
    data = xr.Dataset(
        {
            "record_size": ("record", np.array([len(one.time) for one in motions], np.int32)),
            "table_time": ("sample", np.concatenate([one.time for one in motions])),
            "table_position": (("sample", "xyz"), samples[:, :3]),
            "table_angle": (("sample", "angle"), samples[:, 3:]),
        },
        {
            "record": list(names),
            "record_digest": ("record", [_digest(one) for one in motions]),
            "pgv_pga": ("record", list(ratios)),
            "record_pga": ("record", [in_si.in_g(one.peak_acceleration) for one in motions]),
            "record_pgv": ("record", [one.peak_velocity for one in motions]),
        },
    )
    data["record_size"].attrs["sample_dimension"] = "sample"
    data["repairs"] = "record", ["; ".join(_doubts(one)) for one in motions]
    turning = sum(one.turns for one in motions)
    shaking = len(pga) * sum(one.duration for one in motions)
    own = counted(len(names), "table motion")
    summary = f"{own} x {len(pga)} PGA, {shaking:.0f} s of shaking"
    return data, summary + (f"; {turning} of them turn it" if turning else "")


def of_dataset(data: Any) -> Loaded:
    """The motions from the product."""
    motions = tuple(
        SampledMotion(
            one["table_time"].values,
            np.hstack([one["table_position"].values, one["table_angle"].values]),
        )
        for one in split(data, "record_size")
    )
    names = tuple(str(name) for name in data["record"].values)
    return names, motions, tuple(float(ratio) for ratio in data["pgv_pga"].values)


def named(pulses: tuple[AxisPulseConfig, ...]) -> str:
    """Pulses on axes in words.

    Returns
    -------
    str, e.g. "x, 0.5 z of 0.2 s"
    """
    words = []
    for pulse in pulses:
        share = "" if pulse.pga_ratio == 1.0 else f"{pulse.pga_ratio:g} "
        own = "" if pulse.pgv_pga is None else f" of {pulse.pgv_pga:g} s"
        words.append(f"{share}{pulse.axis}{own}")
    return ", ".join(words)


def _doubts(motion: SampledMotion) -> Iterator[str]:
    """What is to be told of a motion that passes."""
    share, from_on = _rough(motion)
    if share > SLIGHT:
        why = "noise or rounding of its positions, or too few samples"
        yield f"{why}, make {share:.0%} of its PGA by waves above {from_on:.3g} Hz alone"
    if np.allclose(np.diff(motion.time), 1.0, rtol=0.0, atol=1e-6):
        yield "time in steps of 1 s: numbers of samples?"
    for axis, most in zip(AXES[:5], np.abs(motion.samples).max(axis=0), strict=False):
        if axis in "xyz" and most > FAR:
            yield f"{axis} to {most:.3g} m: cm?"
        elif axis not in "xyz" and most > STEEP:
            yield f"{axis} to {most:.3g} rad, {math.degrees(most):.0f} degrees: degrees?"


def _digest(motion: SampledMotion) -> str:
    return digest_bytes(motion.time.tobytes(), motion.samples.tobytes())


def _at_any_scale(file: str, motion: SampledMotion) -> record_inputs.Scaled:
    """What it has in common with itself at another scale: no PGV/PGA, of a table that tilts.

    Where its zero is says nothing, but of its angles, by which gravity and its axes turn.
    """
    moved = motion.samples - motion.samples[0] * [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    most = float(np.abs(moved).max())
    step = motion.duration / (len(motion.time) - 1)
    left, peak = float(np.abs(moved).mean()) / most, motion.peak_acceleration / most
    return record_inputs.Scaled(file, left, step, moved, peak=peak)


def _moving(motion: SampledMotion) -> SampledMotion:
    # of what stands elsewhere than at 0 the spline has accelerations of rounding
    stands = not np.ptp(motion.samples[:, :3], axis=0).any() and not motion.samples[:, 3:5].any()
    if stands or motion.peak_acceleration == 0.0:
        raise InvalidInput("a table that never moves", "it is scaled to each PGA", "leave it out")
    return motion


TIME = "time"

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
ANGLES = {"rad": 1.0, "degree": 0.017453292519943295, "mrad": 0.001}
ALIASES = {"deg": "degree", "degrees": "degree", "radian": "rad", "meter": "m", "metre": "m"}
SECONDS = {"s": 1.0, "ms": 0.001}

NOISE = 4.0
"""Largest acceleration that rounding to a digit makes, in such digits over the square of the step:
by splines, of 400 samples to 40,000, 3.5 to 4.3 times."""

SLIGHT, MOST_ROUGH = 0.05, 0.4
"""Share of the PGA up to which what noise and rounding make is not told of, and the most that waves
of fewer than four samples a period may make: they are noise, or sampled too rarely. Of 245
accelerations recorded on a table and integrated they make .02 in the median at 200 Hz, .04 at 100
and .18 at 50 Hz, and .35, .32 and .59 at most; they make more than .4 of 4 % at 50 Hz."""

MOST_OF_MEAN = {2.0: 2.0, 2.5: 2.3, 3.0: 3.0}
"""How much larger an acceleration of half the PGA or more may be than any mean over so many steps
beside it. At a corner of the way, and about samples that are off it, a spline makes 2.4 to 7 times
one of them, however sharp. Of the accelerations of 490 shake-table tests, integrated to positions,
it is by more in none at 100 and 200 Hz, 6 % at 50 Hz and four tenths at 25 Hz, where the PGA is 3,
9 and 27 % off in the median."""

FAR, STEEP = 10.0, 0.6
"""Way [m] and tilt [rad], beyond those of shake tables and of most tilt tests, that are told of."""

STRONGEST = 100.0
"""PGA [g] beyond which a motion is in other units than it says."""

BESIDE = 20
"""Steps to each side of an acceleration that are beside it."""

Columns = dict[str, Column]


def load(path: Path) -> SampledMotion:
    """The motion in a file, checked."""
    try:
        columns = _columns(path)
    except UnicodeDecodeError as error:
        rule, remedy = "a table's motion is a CSV or NetCDF file", "check the path and the file"
        raise InvalidInput(f"{path.name}, which cannot be read ({error})", rule, remedy) from None
    _check_names(path.name, columns, (TIME, *AXES))
    time = _factor(columns[TIME], SECONDS) * columns[TIME].values
    axes = [
        _unit(columns[axis]) * columns[axis].values if axis in columns else np.zeros_like(time)
        for axis in AXES
    ]
    motion = sampled(time, np.column_stack(axes))
    _check_digits(motion, columns)
    _check_way(motion, columns)
    _check_waves(motion)
    if (pga := in_si.in_g(motion.peak_acceleration)) > STRONGEST:
        given, rule = f"a PGA of {pga:.3g} g", f"no table shakes harder than {STRONGEST:g} g"
        raise InvalidInput(given, rule, "correct the units, e.g. time [s]")
    return motion


def _columns(path: Path) -> Columns:
    """The columns of a file by their names."""
    if path.suffix.lower() in (".nc", ".nc4"):
        found, others, _ = of_netcdf(held(path, record_inputs.LARGEST_FILE))
        if others:
            given = f"{path.name} with variables of several dimensions"
            raise InvalidInput(given, "all are along the time", "leave out the others")
    else:
        found = of_text(held(path, record_inputs.LARGEST_FILE).decode("utf-8-sig"))
    columns = {column.name: column for column in found}
    if len(columns) < len(found):
        raise InvalidInput(
            f"{path.name} with a column twice", "each name is there once", "remove one"
        )
    return columns


def _check_names(file: str, columns: Columns, known: tuple[str, ...]) -> None:
    rule = f"the names are {', '.join(known)}"
    strange = [name for name in columns if name not in known]
    if strange:
        raise InvalidInput(f"{file} with a column {strange[0]!r}", rule, "rename or remove it")
    if TIME not in columns or len(columns) < 2:
        what = "an axis" if TIME in columns else TIME
        raise InvalidInput(f"{file} without {what}", rule, "add it")


def _check_digits(motion: SampledMotion, columns: Columns) -> None:
    """No acceleration that rounding makes by itself.

    Angles count by the way of a point one metre away.
    """
    step = motion.duration / (len(motion.time) - 1)
    rounded = np.zeros(2)
    for axis in (one for one in AXES if one in columns and np.ptp(columns[one].values)):
        values, unit = columns[axis].values, _unit(columns[axis])
        far = np.abs(values) > 0.1 * np.abs(values).max()  # in a long rest all digits are fine
        rounded[int(axis not in "xyz")] += unit * np.quantile(digits.last(values)[far], 0.9)
    share = float((NOISE * rounded / step**2 / _peaks(motion)).max())
    if share > SLIGHT:
        given = f"positions whose last digits alone make up to {share:.0%} of the PGA"
        rule, remedy = f"it is {SLIGHT:.0%} at most", "write them with more digits"
        raise InvalidInput(given, rule, remedy)


def _check_waves(motion: SampledMotion) -> None:
    """No PGA that is of waves sampled too rarely to be told from noise."""
    share, from_on = _rough(motion)
    if share > MOST_ROUGH:
        given = f"positions that jump to and fro: waves above {from_on:.3g} Hz make {share:.0%} of"
        rule = f"it is {MOST_ROUGH:.0%} at most, or they are noise, or samples are too few"
        remedy = "give positions as commanded, or accelerations as a record"
        raise InvalidInput(f"{given} the PGA", rule, remedy)


def _rough(motion: SampledMotion) -> tuple[float, float]:
    """Share of the PGA that waves of fewer than four samples a period make, and from where on [Hz].

    Angles count as the way of a point one metre away.
    """
    number = len(motion.time)
    times = motion.duration * np.arange(number) / (number - 1)
    # of what stands elsewhere than at 0 the spline has accelerations of rounding
    accelerations = motion.derivative(times, 2) * (np.ptp(motion.samples, axis=0) > 0.0)
    waves = np.fft.rfft(accelerations, 2 * number, axis=0)
    waves[number // 2 + 1 :] = 0.0
    smooth = np.fft.irfft(waves, 2 * number, axis=0)[:number]
    peaks = [
        np.linalg.norm(rows.reshape(number, 2, 3), axis=2).max(axis=0)
        for rows in (accelerations, smooth)
    ]
    share = float(((peaks[0] - peaks[1]) / _peaks(motion)).max())
    return share, 0.25 * (number - 1) / motion.duration


def _check_way(motion: SampledMotion, columns: Columns) -> None:
    """No corner in the way of the table: where it was cut off, a sample is off, or lines join some.

    Angles count by the way of a point one metre away.
    """
    bend = np.abs(np.diff(motion.samples, 2, axis=0)).max(axis=0)
    moving = [AXES[axis] for axis in np.flatnonzero(bend > SLIGHT * bend.max())]
    ways = {name: motion.samples[:, AXES.index(name)] / _unit(columns[name]) for name in moving}
    for name, way in ways.items():
        digits.refuse_lines(way, name, motion.time)
    velocity, acceleration = (motion.derivative(motion.fine_times, order) for order in (1, 2))
    step = motion.duration / (len(motion.time) - 1)
    for steps, most in MOST_OF_MEAN.items() if ways else ():
        times = _times_the_mean(velocity, acceleration, steps, step)
        fine = int(times.argmax())
        at = round(fine / SUBDIVISION)
        if times[fine] > most:
            name = AXES[int(np.abs(acceleration[fine]).argmax())]
            value = motion.samples[at, AXES.index(name)] / _unit(columns[name])
            where = f"{value:.10g} ({name}) at {motion.time[at]:.6g} s"
            mean = f"the mean of any {steps:g} steps beside it"
            given = f"{where}, where the table shakes {times[fine]:.2g} times as hard as in {mean}"
            rule = f"it is {most:g} times at most"
            remedy = "leave out or fill what is off there, or sample it more often"
            raise InvalidInput(given, rule, remedy)
    for name, way in ways.items():
        digits.refuse_held(way, name, motion.time)


def _times_the_mean(velocity: Array, acceleration: Array, steps: float, step: float) -> Array:
    """Accelerations as multiples of the largest mean over steps beside them; 0 of small ones.

    Parameters
    ----------
    velocity, acceleration : ndarray, shape (n, 6), at the fine times
    step : float [s], between samples

    Returns
    -------
    ndarray, shape (n,), of the axes or the angles, the larger
    """
    aside = round(0.5 * steps * SUBDIVISION)
    at_rest = np.pad(velocity, ((aside, aside), (0, 0)))
    gained = at_rest[2 * aside :] - at_rest[: -2 * aside]
    mean = gained / (steps * step)
    least, times = SLIGHT * np.abs(acceleration).max(), np.zeros(len(mean))
    for axes in (slice(0, 3), slice(3, 6)):
        size, means = (np.linalg.norm(rows[:, axes], axis=1) for rows in (acceleration, mean))
        beside = maximum_filter1d(means, 2 * BESIDE * SUBDIVISION + 1)
        counts = size > max(0.5 * size.max(), least)
        times = np.fmax(times, np.divide(size, beside, out=np.zeros_like(size), where=counts))
    return times


def _peaks(motion: SampledMotion) -> Array:
    """PGA [m/s^2], and the largest angular acceleration [rad/s^2] or it, of a point at 1 m."""
    turning = np.linalg.norm(motion.derivative(motion.fine_times, 2)[:, 3:], axis=1).max()
    shaking = motion.peak_acceleration
    return np.maximum([shaking, max(shaking, turning)], 1e-300)


def _unit(axis: Column) -> float:
    """What one of an axis's unit is in m or rad."""
    return _factor(axis, LENGTHS if axis.name in "xyz" else ANGLES)


def _factor(column: Column, units: dict[str, float]) -> float:
    name, rule = column.name, f"its unit is {', '.join(units)}"
    if column.unit is None:
        remedy = f"state it: {name} [{next(iter(units))}], or the attribute units in NetCDF"
        raise InvalidInput(f"{name} without a unit", rule, remedy)
    unit = ALIASES.get(column.unit, column.unit)
    if unit not in units:
        raise InvalidInput(f"{name} in {unit!r}", rule, "convert it")
    return units[unit]
