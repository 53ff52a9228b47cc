"""How the table moved in each test: by its record, or as it was commanded."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from pipeline.config import in_si
from pipeline.config.outside import check_file, check_hdf5, refused
from pipeline.config.paths import shown
from pipeline.config.problems import InputError
from pipeline.config.sections import LARGEST_PGA, SMALLEST_PGA
from pipeline.workflow.grammar import listed
from pipeline.workflow.keys import digest_bytes
from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput, reason
from vsr_core.motions import even_times
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.named_columns import check_format, check_range
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.columns import check_seconds
from vsr_core.motions.records.components import ComponentMotion
from vsr_core.motions.records.record import check_samples, check_sampling, factor
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.table.stepper import SteppedPulse, Stepper

RECORDS = "records.nc"

_LARGEST = 4 * 1024**3
"""Bytes of the records."""

_MOST, _MOST_TESTS = 30_000_000, 100_000
"""Numbers of a variable, those that are missing included, and tests."""

QUIET = 0.2
"""Range of a component, as a share of the peak, below which it is noise, with digits of its own."""

_RATE = 0.01
"""How far a stated sampling rate, of few digits, may be from that of the times."""


def commanded(pga: float, ratio: float, stepper: Stepper | None) -> GroundMotion:
    """The pulse of a test without a record, as its table makes it.

    Parameters
    ----------
    pga, ratio : float [g], [s]
    """
    pulse = CosinePulse.from_g(pga, ratio)
    return SteppedPulse(pulse, stepper) if stepper else pulse


def motions(folder: Path, variable: str | None) -> dict[int, GroundMotion]:
    """Recorded motions of the table by test, along its drive, or along x, y and z.

    Parameters
    ----------
    variable : str or None
        Its name in the records; by default the merged one, else that of the accelerometer.
    """
    _, interval = recorded(folder)
    name, tests = _samples(folder, variable)
    return {
        number: _motion(folder / RECORDS, name, number, row[:count], interval)
        for number, count, row in tests
    }


def left_out(folder: Path, variable: str | None) -> list[int]:
    """Tests of which samples other than zero follow those that count."""
    _, tests = _samples(folder, variable)
    return [number for number, count, row in tests if np.nan_to_num(row[count:]).any()]


def _samples(folder: Path, variable: str | None) -> tuple[str, list[tuple[int, int, Array]]]:
    """Name of the accelerations, and of each test its number, how many count, and all [m/s2]."""
    path = folder / RECORDS
    with _records(folder) as records:
        name = variable or _named(records)
        if name not in records:
            raise refused(path, name, "nothing", "the variable is there", "name another")
        if records[name].dtype.kind not in "iuf" or not _is_series(records[name]):
            given, rule = "no table of numbers", "it holds numbers by test and time"
            raise refused(path, name, given, rule, "name another")
        values = records[name].transpose("test", "time", ...).values
        one = _unit(path, name, records[name])
        counts, numbers = records["n_samples"].values, records["test"].values
    return name, [
        (int(number), int(count), one * row)
        for number, count, row in zip(numbers, counts, values, strict=True)
    ]


def _named(records: xr.Dataset) -> str:
    return "acceleration_merged" if "acceleration_merged" in records else "acceleration"


def others(folder: Path, variable: str | None) -> Iterator[str]:
    """Which accelerations count, and what else is in the records, in words."""
    with _records(folder) as records:
        name = variable or _named(records)
        more = [str(one) for one in records.data_vars if one not in (name, "n_samples")]
    if more:
        yield f"{listed(more)} of {RECORDS} left out, as {name} counts"


def _is_series(variable: xr.DataArray) -> bool:
    """Whether it is by test and time, or by those and up to three components."""
    dims = set(variable.dims)
    if dims == {"test", "time", "component"}:
        return variable.sizes["component"] <= len("xyz")
    return dims == {"test", "time"}


_ALONG = ("x", "y", "z"), ("drive", "across", "up"), "012", "123"
"""Names of components, in any case, and their numbers; of one taken from several a 1 is any."""


def _unit(path: Path, name: str, variable: xr.DataArray) -> float:
    """What one of its unit is [m/s2], its components along drive, across and up."""
    along = np.atleast_1d(variable["component"]).tolist() if "component" in variable.coords else []
    named = [str(one).strip().lower() for one in along]
    taken = bool(along) and "component" not in variable.dims
    if not any(named == list(known[: len(named)]) for known in _ALONG[: -1 if taken else None]):
        given, rule = (
            f"components {', '.join(map(str, along))}",
            "they are x, y, z or drive, across, up",
        )
        raise refused(path, name, given, rule, "put them in order, or rename them")
    try:
        return factor(str(variable.attrs.get("units", "m/s2")))
    except InvalidInput as error:
        rule = "it is an acceleration"
        raise refused(path, name, error.given, rule, "correct its units, or name another") from None


def _motion(path: Path, name: str, number: int, values: Array, interval: float) -> GroundMotion:
    if not np.isfinite(values).all():
        given = f"values that are no numbers in test {number}"
        raise refused(path, name, given, "they are numbers", "mend or drop the test")
    along = values.reshape(len(values), -1).astype(np.float64)
    peak = float(np.abs(along[:, :2]).max())
    if not in_si.acceleration(SMALLEST_PGA) <= peak <= in_si.acceleration(LARGEST_PGA):
        given = f"a peak of {peak:.3g} m/s2 in test {number}"
        rule = f"it is {SMALLEST_PGA:g} to {LARGEST_PGA:g} g"
        raise refused(path, name, given, rule, "correct the unit, or drop the test")
    if along.shape[1] == 3 and abs(rest := float(np.median(along[:, 2]))) > 0.5 * GRAVITY:
        given, rule = f"a vertical about {rest:.3g} m/s2 in test {number}", "it is without gravity"
        raise refused(path, name, given, rule, "take gravity off")
    try:
        for moving in along.T[np.ptp(along, axis=0) > QUIET * peak]:
            check_samples(moving, f"test {number}", interval)
    except InvalidInput as error:
        raise refused(path, name, error.given, error.rule, "mend or drop the test") from None
    if along.shape[1] == 1:
        return RecordedMotion(Trace(along[:, 0].copy(), interval))
    whole = np.zeros((len(along), 3))
    whole[:, : along.shape[1]] = along
    x, y, z = (RecordedMotion(Trace(one.copy(), interval)) for one in whole.T)
    return ComponentMotion((x, y, z))


def identity(motion: GroundMotion) -> str:
    """What tells a motion from all others: digest of its samples, or its parameters."""
    match motion:
        case RecordedMotion(trace):
            return digest_bytes(trace.acceleration.tobytes(), repr(trace.interval).encode())
        case ComponentMotion(along):
            return " ".join(identity(one) for one in along)
    return repr(motion)


def recorded(folder: Path) -> tuple[set[int], float]:
    """Numbers of the tests that have a record, and its time step [s]."""
    path = folder / RECORDS
    with _records(folder) as records:
        for name in ("test", "time", "n_samples"):
            values = records.variables.get(name)
            if values is None:
                raise refused(path, name, "nothing", "the variable is there", "add it")
            if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
                given, rule = "values that are no numbers", "they are numbers"
                raise refused(path, name, given, rule, "correct them")
        numbers = records["test"].values.ravel()
        for name in ("test", "n_samples"):
            values = records.variables[name]
            if values.dims != ("test",) or (values.values % 1 != 0).any():
                given, rule = "other values", "it is a whole number for each test"
                raise refused(path, name, given, rule, "correct it")
        known = {int(number) for number in numbers}
        time, counts = (records[name].values.ravel() for name in ("time", "n_samples"))
        unit, rate = records["time"].attrs.get("units"), records.attrs.get("sampling_rate_hz")
    if len(known) < len(counts):
        rule, remedy = "a test has one record", "number them anew"
        raise refused(path, "test", "a number twice", rule, remedy)
    if not len(counts) or not 2 <= counts.min() <= counts.max() <= len(time):
        rule = f"each test has from 2 to {len(time)}, as there are times"
        raise refused(path, "n_samples", "other numbers of samples", rule, "correct them")
    try:
        check_seconds(unit)
        check_sampling(float(time[1] - time[0]), counts.max())
        if (np.diff(time) <= 0.0).any():
            raise InvalidInput("times that do not ascend", "each is after the last", "sort them")
        interval = round(even_times.step(time.astype(np.float64)), 9)
    except InvalidInput as error:
        raise InputError.from_invalid(shown(path), "time", error) from None
    _check_rate(path, rate, interval)
    return known, interval


def _check_rate(path: Path, rate: Any, interval: float) -> None:
    """Refuse times that contradict the sampling rate of the file, where it states one."""
    words = " ".join(map(str, np.ravel(rate))) if rate is not None else ""
    if any(abs(interval * float(one) - 1.0) > _RATE for one in _NUMBER.findall(words)):
        given = f"a step of {interval:g} s beside a sampling_rate_hz of {rate}"
        raise refused(path, "time", given, "they agree", "correct one of them")


@contextmanager
def _records(folder: Path) -> Iterator[xr.Dataset]:
    """The records, of which numbers are read as they are asked for."""
    path = folder / RECORDS
    with _opened(path) as records:
        try:
            yield records
        except (OSError, RuntimeError) as error:  # of numbers that cannot be unpacked
            raise _unreadable(path, error) from None


def _opened(path: Path) -> xr.Dataset:
    check_file(path, _LARGEST)
    check_hdf5(path)
    try:
        with path.open("rb") as file:
            check_format(file.read(3))
        with netCDF4.Dataset(path) as data:
            variables = data.variables.items()
            sizes = {name: variable.size for name, variable in variables}
            most = dict.fromkeys(("test", "n_samples"), _MOST_TESTS)
            for name in (name for name, size in sizes.items() if size > most.get(name, _MOST)):
                given, rule = f"{sizes[name]} numbers", f"it holds at most {most.get(name, _MOST)}"
                raise refused(path, name, given, rule, "cut the tests to their shaking")
            for name, variable in variables:
                check_range(variable)
                _check_valid(path, name, variable)
        return xr.open_dataset(path, decode_times=False)
    except InputError:
        raise
    except InvalidInput as error:
        raise InputError.from_invalid(shown(path), "", error) from None
    except Exception as error:  # noqa: BLE001 (of a broken file, whatever HDF5 meets first)
        raise _unreadable(path, error) from None


_NUMBER = re.compile(r"\d+\.?\d*(?:[eE][-+]?\d+)?")

_SINGLE = 1e-6
"""How far single precision may be off, as a share."""


def _check_valid(path: Path, name: str, variable: Any) -> None:
    """Refuse numbers that the file itself calls invalid (NetCDF Users Guide, appendix A)."""
    names = ("valid_range", "valid_min", "valid_max")
    given = {name: getattr(variable, name, ()) for name in names}
    if not all(np.asarray(one).dtype.kind in "iuf" for one in given.values()):
        return  # as none that is a number
    low = max((*np.ravel(given["valid_range"])[:1], *np.ravel(given["valid_min"])), default=-np.inf)
    high = min((*np.ravel(given["valid_range"])[1:], *np.ravel(given["valid_max"])), default=np.inf)
    if np.isfinite([low, high]).any():
        variable.set_auto_scale(False)
        variable.set_auto_mask(False)
        values = np.ravel(variable[...])
        kind = np.dtype(variable.dtype).str[1:]
        fills: list[Any] = [getattr(variable, "_FillValue", netCDF4.default_fillvals.get(kind))]
        fills += np.ravel(getattr(variable, "missing_value", fills)).tolist()
        for fill in fills:
            values = values[values != fill]
        values = values[np.isfinite(values)]
        far = _SINGLE * np.abs(values)
        if (beyond := values[(values < low - far) | (values > high + far)]).size:
            rule = f"the file says {low:g} to {high:g} of it"
            remedy = "correct the number, or its valid range"
            raise refused(path, name, f"{beyond[0]:g}", rule, remedy)


def _unreadable(path: Path, error: Exception) -> InputError:
    given = f"a file that cannot be read ({reason(error)})"
    return refused(path, "", given, "it is NetCDF", "correct it")
