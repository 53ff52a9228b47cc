"""NetCDF and HDF5 records: along time alone, whole, and of bounded size."""

from __future__ import annotations

from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest
from support import record_files as files
from support.recorded import PLAIN, STEP, VALUES, refusal

from pipeline.config.outside import damaged_heap
from vsr_core import GRAVITY
from vsr_core.motions.records.columns import read_netcdf, read_table
from vsr_core.motions.records.formats import read


def test_netcdf(tmp_path: Path) -> None:
    path = tmp_path / "one.nc"
    files.netcdf(path, VALUES / GRAVITY, STEP, "g")
    found = read(path.read_bytes(), ".nc", PLAIN)
    assert found.station == "Nowhere Creek"
    assert found.interval == pytest.approx(STEP, rel=1e-12)
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-6, atol=1e-9)
    files.netcdf(path, VALUES, STEP, "m")
    content = path.read_bytes()
    refusal(lambda: read_netcdf(content, None, None), "acceleration along time", "units")
    refusal(lambda: read_netcdf(content, "acceleration", "m/s2"), "the unit 'm'")


def test_what_is_not_along_time_alone_is_told(tmp_path: Path) -> None:
    """Accelerations of several channels in one variable were left out without a word."""
    path = tmp_path / "one.nc"
    files.netcdf(path, VALUES, STEP, "m/s2")
    assert read(path.read_bytes(), ".nc", PLAIN).repairs == ()
    with netCDF4.Dataset(path, "a") as file:
        file.createDimension("channel", 3)
        file.createVariable("strong", "f8", ("time", "channel"))
    (told,) = read(path.read_bytes(), ".nc", PLAIN).repairs
    assert told == "left out, as not numbers along time alone: strong"


@pytest.mark.parametrize("name", ["time", "acceleration"])
def test_numbers_beside_the_range_that_netcdf_states_are_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "one.nc"
    files.netcdf(path, VALUES, STEP, "m/s2")
    for change in ("none", "number", "range"):
        with netCDF4.Dataset(path, "a") as file:
            own = file[name]
            if change == "none":
                own.actual_range = [float(f"{one:.6g}") for one in (own[:].min(), own[:].max())]
            elif change == "number":
                own[-1] = 1.001 * own[:].max()
            else:
                own.actual_range = [own[:].min(), 2.0 * own[:].max()]
        if change == "none":
            assert len(read(path.read_bytes(), ".nc", PLAIN).acceleration) == len(VALUES)
        else:
            refusal(lambda: read(path.read_bytes(), ".nc", PLAIN), f"{name} from", "actual_range")


def test_netcdf_with_groups_is_refused(tmp_path: Path) -> None:
    """What is in one was left out, and not told."""
    path = tmp_path / "one.nc"
    files.netcdf(path, VALUES, STEP, "m/s2")
    with netCDF4.Dataset(path, "a") as file:
        file.createGroup("more").createVariable("y", "f8", ("time",))
    refusal(lambda: read(path.read_bytes(), ".nc", PLAIN), "the groups more", "at its root")


@pytest.mark.parametrize("old", ["NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA"])
def test_netcdf_that_hides_a_cut_is_refused(tmp_path: Path, old: str) -> None:
    """Of a file before NetCDF-4 that is cut, the library reads what is lost as zeros."""
    path = tmp_path / "old.nc"
    with netCDF4.Dataset(path, "w", format=old) as file:
        file.createDimension("time", len(VALUES))
        file.createVariable("time", "f8", ("time",))[:] = STEP * np.arange(len(VALUES))
        east = file.createVariable("east", "f8", ("time",))
        east[:], east.units = VALUES, "m/s2"
    refusal(lambda: read(path.read_bytes(), ".nc", PLAIN), "of a format before 4", "nccopy -k nc4")


def test_numbers_that_no_byte_stands_for_are_bounded_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "many.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", 6_000_000)
        for name in ("time", "east"):
            file.createVariable(name, "f4", ("time",), zlib=True, chunksizes=(1_000_000,))
    assert path.stat().st_size < 20_000
    refusal(lambda: read(path.read_bytes(), ".nc", PLAIN), "6000000 samples", "resample it")
    with netCDF4.Dataset(path, "w") as file:  # each no longer than a record
        file.createDimension("time", 160_000)
        for place in range(66):
            name = f"v{place}" if place else "time"
            file.createVariable(name, "f4", ("time",), zlib=True, chunksizes=(160_000,))
    said = "10560000 numbers along time", "leave out columns"
    refusal(lambda: read(path.read_bytes(), ".nc", PLAIN), *said)
    names = ",".join(["time", *(f"a{place}" for place in range(9999))])
    refusal(lambda: read_table("\n".join([names] + ["," * 9999] * 1100), None, None), "11010000")


def test_a_table_of_text_is_no_longer_than_a_record() -> None:
    text = "time,a [m/s2]\n" + "0,0\n" * 1_000_000
    refusal(lambda: read(text.encode(), ".csv", PLAIN), "1000001 rows", "resample it")


@pytest.mark.parametrize(
    ("number", "length"), [(0, 0), (0, (1 << 64) - 8), (1, (1 << 64) - 16), (1, 1 << 20)]
)
def test_a_damaged_heap_is_refused_before_it_is_read(
    tmp_path: Path, number: int, length: int
) -> None:
    """Texts with other letters lie in one; its free place, or a text, is followed by itself, by
    what is before it, or goes beyond the end."""
    path = tmp_path / "one.nc"
    files.netcdf(path, VALUES, STEP, "m/s2")
    with netCDF4.Dataset(path, "a") as file:
        file.station = "Zürich"
    content = bytearray(path.read_bytes())
    assert read(bytes(content), ".nc", PLAIN).station == "Zürich"
    at = content.index(b"GCOL") + 16
    while int.from_bytes(content[at : at + 2], "little") != number:  # of an object; 0 is free
        at += 16 + -(-int.from_bytes(content[at + 8 : at + 16], "little") // 8) * 8
    content[at + 8 : at + 16] = length.to_bytes(8, "little")
    path.write_bytes(content)
    refusal(lambda: read(bytes(content), ".nc", PLAIN), "a damaged heap")
    assert damaged_heap(path) == content.index(b"GCOL")


@pytest.mark.parametrize("virtual", [False, True])
def test_numbers_that_another_file_holds_are_refused(tmp_path: Path, virtual: bool) -> None:
    """It may change, and no key would tell."""
    path, other = tmp_path / "one.nc", str(tmp_path / "other")
    files.netcdf(path, VALUES, STEP, "m/s2")
    with h5py.File(path, "r+") as file:
        if virtual:
            layout = h5py.VirtualLayout((4,), "f8")
            layout[:] = h5py.VirtualSource(other, "x", (4,))
            file.create_virtual_dataset("x", layout)
        else:
            file.create_dataset("x", (4,), "f8", external=[(other, 0, 32)])
    refusal(lambda: read(path.read_bytes(), ".nc", PLAIN), "x, that is kept in another file")
