"""A folder of recorded tests: what of its records and its table is refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from support.recorded_tests import recorded_tests

from pipeline.config.problems import InputError
from pipeline.stages.studies.validation.recorded_tests import ASSUMED, OUTCOMES, RECORDS, motions_of
from pipeline.stages.studies.validation.recorded_tests import tests_in as read_tests
from pipeline.stages.studies.validation.remarks import remarks
from pipeline.stages.studies.validation.validation_page import assumed

Change = Callable[[xr.Dataset], xr.Dataset]


def changed(folder: Path, change: Change) -> Path:
    """The folder of tests with other records."""
    recorded_tests(folder)
    records = xr.load_dataset(folder / RECORDS)
    change(records).to_netcdf(folder / RECORDS)
    return folder


def in_unit(unit: str, factor: float) -> Change:
    """The same motions in another unit."""
    return lambda data: data.assign(
        acceleration=(factor * data["acceleration"]).assign_attrs(units=unit)
    )


def at_times(times: Callable[[np.ndarray], np.ndarray], unit: str = "s") -> Change:
    return lambda data: data.assign_coords(
        time=("time", times(data["time"].values), {"units": unit})
    )


def valid(**given: float | str | list[float]) -> Change:
    return lambda data: data.assign(acceleration=data["acceleration"].assign_attrs(given))


def counted(values: list[float], dimension: str = "test") -> Change:
    return lambda data: data.assign(n_samples=(dimension, values))


def at_rate(hertz: float | str | list[float]) -> Change:
    return lambda data: data.assign_attrs(sampling_rate_hz=hertz)


def one_test(factor: float) -> Change:
    """The motion of the first test by a factor."""
    return lambda data: data.assign(
        acceleration=data["acceleration"] * xr.DataArray([factor, 1.0], dims="test")
    )


def added(offset: float) -> Change:
    """An offset [m/s2] of the accelerometer, of peaks of 2.9 and 5.8."""
    return lambda data: data.assign(acceleration=data["acceleration"] + offset)


def unsigned(data: xr.Dataset) -> xr.Dataset:
    """The motion of the first test without its minus signs."""
    data["acceleration"][0] = abs(data["acceleration"][0])
    return data


def filled(value: float) -> Change:
    """The motion of the first test with a gap of 0.1 s in its strongest shaking."""

    def change(data: xr.Dataset) -> xr.Dataset:
        data["acceleration"][0, 190:210] = value
        return data

    return change


def of_values(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    """The values of all tests."""
    return lambda data: data.assign(
        acceleration=(("test", "time"), change(data["acceleration"].values))
    )


def spiked(values: np.ndarray) -> np.ndarray:
    """A sample of 20 m/s2 at rest."""
    values[1, 350] = 20.0
    return values


def along(names: list[Any]) -> Change:
    """The motions along two components."""

    def change(data: xr.Dataset) -> xr.Dataset:
        both = xr.concat([data["acceleration"], 0.0 * data["acceleration"]], "component")
        return data.assign(acceleration=both).assign_coords(component=names)

    return change


def upright(rest: float) -> Change:
    """The motions along three components, of which the vertical is about a value."""

    def change(data: xr.Dataset) -> xr.Dataset:
        x = data["acceleration"]
        return data.assign(acceleration=xr.concat([x, 0.0 * x, 0.1 * x + rest], "component"))

    return change


@pytest.mark.parametrize(("unit", "one"), [("g", 9.80665), ("cm s-2", 0.01), ("m s-2", 1.0)])
def test_records_are_in_the_unit_that_they_state(tmp_path: Path, unit: str, one: float) -> None:
    found = motions_of(changed(tmp_path, in_unit(unit, 1.0 / one)))
    expected = motions_of(changed(tmp_path, lambda data: data))
    for number, motion in found.items():
        assert motion.peak_acceleration == pytest.approx(expected[number].peak_acceleration)


def test_records_of_a_format_that_hides_a_cut_are_refused(tmp_path: Path) -> None:
    with xr.load_dataset(recorded_tests(tmp_path) / RECORDS) as records:
        records.to_netcdf(tmp_path / RECORDS, format="NETCDF3_64BIT")
    with pytest.raises(InputError, match="of a format before 4"):
        motions_of(tmp_path)


def test_records_that_were_replaced_are_read_again(tmp_path: Path) -> None:
    before, after = (
        motions_of(changed(tmp_path, in_unit("m s-2", share))) for share in (1.0, 0.95)
    )
    for number, motion in after.items():
        assert motion.peak_acceleration == pytest.approx(0.95 * before[number].peak_acceleration)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (in_unit("m", 1.0), "acceleration: got the unit 'm'"),
        (in_unit("m/s2", 0.1), r"peaks of 0\.1\d* times pga_g"),
        (at_times(lambda t: 100.0 * t, "ms"), "time: got times in ms"),
        (at_times(lambda t: np.where(t < 1.0, t, t + 5.0)), "time: got 1000 times left out"),
        (at_times(lambda t: np.where(t == 1.0, 1.002, t)), "time: got time steps that differ"),
        (at_times(lambda t: t % 1.0), "time: got times that do not ascend"),
        (counted([399.7, 2.2]), "n_samples: .*whole number for each test"),
        (counted([200, 200], "other"), "n_samples: .*whole number for each test"),
        (valid(valid_range=[-1.0, 1.0]), "acceleration: got .*; the file says -1 to 1 of it"),
        (valid(valid_max=1.0), "the file says -inf to 1 of it"),
        (valid(actual_range=[-1.0, 1.0]), "the file's actual_range of it is -1 to 1"),
        (at_rate("100 Hz"), "beside a sampling_rate_hz of 100 Hz; they agree"),
        (at_rate([200.0, 100.0]), "beside a sampling_rate_hz of "),
        (at_rate(100.0), "time: got a step of 0.005 s beside a sampling_rate_hz of 100"),
        (one_test(0.06), r"peaks of 0\.089\d+ times pga_g \(test 1\)"),
        (filled(0.0), "acceleration: got 20 samples in a row of 0 .test 1. from 0.95 s on"),
        (filled(-1.5), "acceleration: got 20 samples in a row of -1.5 .test 1. from 0.95 s on"),
        (of_values(lambda a: np.clip(a, -1.5, 1.5)), r"in a row within 1 % .* \(test 1\)"),
        (of_values(lambda a: a.round(0)), r"samples \(test 2\) in steps of 1, 6 from rest"),
        (of_values(spiked), r"got 20 \(test 2\) at 1.75 s, far beyond what is beside it"),
        (upright(9.8), r"got a vertical about 9.8 m/s2 in test 1; it is without gravity"),
        (upright(-9.8), r"got a vertical about -9.8 m/s2 in test 1"),
        (along(["y", "x"]), "got components y, x; they are x, y, z"),
        (along(["up", "x"]), "got components up, x; they are x, y, z"),
        (along(["Y", "X"]), "got components Y, X; they are x, y, z"),
        (along([1, 0]), "got components 1, 0; they are x, y, z"),
    ],
)
def test_records_that_contradict_themselves(tmp_path: Path, change: Change, words: str) -> None:
    with pytest.raises(InputError, match=words):
        motions_of(changed(tmp_path, change))


@pytest.mark.parametrize(
    "change",
    [
        at_rate("200 Hz"),
        at_rate("unknown"),
        at_rate([200.0, 200.0]),
        valid(valid_range=[-60.0, 60.0]),
        valid(valid_range="-60 to 60", valid_min="none"),
        valid(actual_range="-60 to 60"),
        valid(valid_range=[-60.0, 60.0], missing_value=999.0),
    ],
)
def test_records_with_remarks_of_their_own_are_read(tmp_path: Path, change: Change) -> None:
    assert len(motions_of(changed(tmp_path, change))) == 2


@pytest.mark.parametrize("name", ["time", "acceleration", "n_samples"])
def test_numbers_that_no_byte_stands_for_are_bounded_before_they_are_read(
    tmp_path: Path, name: str
) -> None:
    recorded_tests(tmp_path)
    with netCDF4.Dataset(tmp_path / RECORDS, "w") as data:
        data.createDimension("test", 50_000_000 if name == "n_samples" else 2)
        data.createDimension("time", {"time": 50_000_000, "acceleration": 25_000_000}.get(name, 8))
        own = {"time": ("time",), "n_samples": ("test",)}.get(name, ("test", "time"))
        dimensions = {"time": ("time",), name: own}
        for one, along in dimensions.items():
            data.createVariable(one, "f4", along, zlib=True, fill_value=0.5)
    assert (tmp_path / RECORDS).stat().st_size < 100_000
    with pytest.raises(InputError, match=f"{name}: got 50000000 numbers; it holds at most"):
        motions_of(tmp_path)


def told(folder: Path, change: Change) -> list[str]:
    changed(folder, change)
    text = (folder / OUTCOMES).read_text()
    # 3 sin(10 t) m/s2 reaches 0.3 m/s, 0.1 s of its peak, which is 1.5 and 1.2 times pga_g
    (folder / OUTCOMES).write_text(text.replace(",0.3,", ",0.13,"))
    return list(remarks(folder, read_tests(folder)))


@pytest.mark.parametrize("names", [["X", "Y"], ["drive", "across"], [0, 1], [1, 2]])
def test_components_may_have_these_names(tmp_path: Path, names: list[Any]) -> None:
    assert motions_of(changed(tmp_path, along(names)))


@pytest.mark.parametrize("name", ["x", "drive", 0])
def test_one_component_may_be_left_of_several(tmp_path: Path, name: Any) -> None:
    first = motions_of(changed(tmp_path, lambda data: data))
    one = motions_of(changed(tmp_path, lambda data: data.assign_coords(component=name)))
    assert one[1].peak_acceleration == first[1].peak_acceleration


@pytest.mark.parametrize("name", ["up", 1])
def test_one_component_of_several_is_not_taken_for_the_drive(tmp_path: Path, name: Any) -> None:
    """A 1 may be the first of 1, 2, 3, or the second of 0, 1, 2."""
    with pytest.raises(InputError, match=f"got components {name}"):
        motions_of(changed(tmp_path, lambda data: data.assign_coords(component=name)))


def test_records_of_the_same_size_and_date_are_read_anew(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    other = changed(tmp_path / "other", in_unit("m s-2", 1.02)) / RECORDS
    folder = changed(tmp_path, lambda data: data)
    path = folder / RECORDS
    longer = max(other.stat().st_size, path.stat().st_size)
    path.write_bytes(path.read_bytes().ljust(longer, b"\0"))
    first, before = motions_of(folder), path.stat()
    path.write_bytes(other.read_bytes().ljust(longer, b"\0"))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_size == before.st_size
    assert motions_of(folder)[1].peak_acceleration > 1.01 * first[1].peak_acceleration


def take_records_out(folder: Path) -> None:
    (folder / RECORDS).unlink()
    rows = [row.split(",") for row in (folder / OUTCOMES).read_text().splitlines()]
    place = rows[0].index("has_record")
    text = "".join(",".join(row[:place] + row[place + 1 :]) + "\n" for row in rows)
    (folder / OUTCOMES).write_text(text)


@pytest.mark.parametrize("recorded", [True, False])
def test_what_is_not_used_of_the_table_is_told(tmp_path: Path, recorded: bool) -> None:
    folder = changed(tmp_path, lambda data: data)
    given = {
        "stepper": "stepper: {rate: 1000, step: 0.00001, overhead: 0.00001}\n",
        "acceleration": "acceleration: merged\n",
    }
    used, left = ("acceleration", "stepper") if recorded else ("stepper", "acceleration")
    if not recorded:
        take_records_out(folder)
    before = (folder / ASSUMED).read_text() if (folder / ASSUMED).exists() else ""
    (folder / ASSUMED).write_text(before + given[left])
    tests = read_tests(folder)
    line = f"{left} of table.yaml left out, as there is {'a' if recorded else 'no'} records.nc"
    assert line in list(remarks(folder, tests))
    ((_, words, key),) = (one for one in assumed(tests.config, recorded=recorded) if one[2] == used)
    assert words.startswith("the merged record" if recorded else "as commanded"), key


def test_records_that_fit_the_table_are_not_told(tmp_path: Path) -> None:
    assert not told(tmp_path, at_rate(199.9))
    for padding in (np.nan, 0.0):
        assert not told(
            tmp_path,
            lambda data, one=padding: data.pad(time=(0, 9), constant_values=one).assign_coords(
                time=0.005 * np.arange(409)
            ),
        )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (counted([200, 400]), "samples of 1 test of records.nc (1) after the last"),
        (one_test(0.21), "peaks of 1 test of records.nc (1) are not within a factor of 3 of pga_g"),
        (at_times(lambda t: 2.0 * t), "peak velocities of records.nc are 2.1"),
        (at_times(lambda t: 0.5 * t), "peak velocities of records.nc are 0.53"),
        (added(0.3), "accelerations of records.nc have a mean of 7% of their peak (median)"),
    ],
)
def test_records_that_differ_from_the_table_are_told(
    tmp_path: Path, change: Change, words: str
) -> None:
    (line,) = told(tmp_path, change)
    assert line.startswith(words)


def test_records_without_their_minus_signs_are_told(tmp_path: Path) -> None:
    words = "1 test of records.nc (1) may be sorted, or have lost order, minus signs or exponents"
    assert words in told(tmp_path, unsigned)


def test_a_specimen_has_one_number_however_it_is_written(tmp_path: Path) -> None:
    folder = recorded_tests(tmp_path)
    text = (folder / OUTCOMES).read_text()
    (folder / OUTCOMES).write_text(text.replace("specimen1", "specimen01"))
    assert read_tests(folder).observed == {1: (0, 1)}
    (folder / OUTCOMES).write_text(text.replace("dem_s1_soft", "specimen01"))
    with pytest.raises(InputError, match="specimen01 and specimen1; a specimen has a number"):
        read_tests(folder)
    (folder / OUTCOMES).write_text(text.replace("specimen1", "dem_s01_soft"))
    with pytest.raises(InputError, match="dem_s01_soft: got specimen 1 again; each specimen has a"):
        read_tests(folder)
    (folder / "sp01.ply").write_text("")
    with pytest.raises(InputError, match=r"sp01.ply and sp1.ply; a specimen has a number"):
        read_tests(folder)


def test_peaks_in_another_unit_are_told_where_no_record_tells(tmp_path: Path) -> None:
    folder = changed(tmp_path, lambda data: data)
    take_records_out(folder)
    assert list(remarks(folder, read_tests(folder))) == []
    text = (folder / OUTCOMES).read_text()
    (folder / OUTCOMES).write_text(text.replace(",0.2,", ",1.96,").replace(",0.5,", ",4.9,"))
    (line,) = remarks(folder, read_tests(folder))
    assert line == "pga_g of up to 4.9 g, and records rarely exceed 4 g: m/s2?"
    (folder / OUTCOMES).write_text(text.replace(",0.3,", ",2.94,"))
    (line,) = remarks(folder, read_tests(folder))
    assert line == "pgv_pga_s of up to 2.94 s, and that of tests is below 1 s: (m/s)/g?"


@pytest.mark.parametrize(("azimuth", "told"), [("1.5708", True), ("90", False), ("67.5", False)])
def test_azimuths_in_radians_are_told(tmp_path: Path, azimuth: str, told: bool) -> None:
    folder = changed(tmp_path, lambda data: data)
    head, *rows = (folder / OUTCOMES).read_text().splitlines()
    rows = [f"{row},{azimuth if number else 0}" for number, row in enumerate(rows)]
    (folder / OUTCOMES).write_text("\n".join([f"{head},azimuth_deg", *rows, ""]))
    said = [line for line in remarks(folder, read_tests(folder)) if "azimuth" in line]
    assert said == ["azimuth_deg from 0 to 1.5708: radians?"] * told


def test_an_axis_that_is_quiet_may_be_of_few_digits(tmp_path: Path) -> None:
    """Noise of 1 % of the drive in digits of a third of it."""
    noise = np.random.default_rng(1).integers(-1, 2, (2, 400)) * 0.01

    def quiet(data: xr.Dataset) -> xr.Dataset:
        both = [data["acceleration"], data["acceleration"] * 0.0 + noise]
        return data.assign(acceleration=xr.concat(both, "component"))

    assert motions_of(changed(tmp_path, quiet))
