"""A folder of recorded shake-table tests that is broken is refused in a line."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import trimesh
import xarray as xr

from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.problems import InputError
from pipeline.stages.studies.validation.recorded_tests import (
    OUTCOMES,
    RECORDS,
    Folder,
    assumptions,
    find,
    scan,
    site_of,
)
from pipeline.stages.studies.validation.recorded_tests import tests_in as read_tests
from pipeline.stages.studies.validation.remarks import remarks, sizes

Refused = Callable[..., str]

HEAD = "test,ground_motion,pga_g,pgv_pga_s,specimen1\n"
SAMPLES = 400


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two tests of one specimen."""
    path = tmp_path / "tests"
    path.mkdir()
    records().to_netcdf(path / RECORDS)
    (path / OUTCOMES).write_text(HEAD + "1,a,0.2,0.3,0\n2,a,0.5,0.3,1\n")
    trimesh.creation.box((0.1, 0.1, 0.3)).export(path / "sp1.ply")
    return path


def records() -> xr.Dataset:
    time = 0.005 * np.arange(SAMPLES)
    shaking = 3.0 * np.sin(10.0 * time) * np.hanning(SAMPLES)
    return xr.Dataset(
        {
            "acceleration": (("test", "time"), np.array([shaking, 2.0 * shaking])),
            "n_samples": ("test", [SAMPLES, SAMPLES]),
        },
        {"test": [1, 2], "time": time},
    )


WRONG_OUTCOMES = {
    "": ("without a row",),
    "\0\1\2\xff": ("no text",),
    HEAD + "x,a,0.2,0.3,0\n": ("test", "'x' in row 1"),
    HEAD + "1,a,nan,0.3,0\n": ("pga_g", "'nan' in row 1"),
    HEAD + "1,a,-1,0.3,0\n": ("pga_g", "'-1' in row 1", "0.000001"),
    HEAD + "1,a,0.2,1e308,0\n": ("pgv_pga_s", "1e308", "equal to 10"),
    HEAD + "1.5,a,0.2,0.3,0\n": ("test", "a whole one"),
    HEAD + '"1,a,0.2,0.3,0\n': ("cannot be read",),
    HEAD + "2,a,0.5,0.3,1\n1,a,0.2,0.3,perhaps\n": ("specimen1", "'perhaps' of test 1"),
}


BOTH = HEAD + "1,a,0.2,0.3,0\n2,a,0.5,0.3,1\n"
WRONG_OUTCOMES |= {
    BOTH + "2,a,0.5,0.3,0\n": ("test", "2 twice"),
    BOTH + "9,a,0.5,0.3,0\n": ("test", "9 without a record"),
    BOTH.replace("2,a,0.5,0.3,1\n", ""): ("test", "2 with a record, and without a row"),
    BOTH.replace("pgv_pga_s", "pga_g"): ("pga_g", "a column twice"),
    BOTH.removesuffix("1\n"): ("a last line that ends in ''",),
    BOTH.replace(",a,", f",{'a' * 200_000},"): ("field larger",),
    BOTH.replace(",0\n", ",True\n"): ("specimen1", "'True' of test 1"),
}


@pytest.mark.parametrize("text", WRONG_OUTCOMES, ids=range(len(WRONG_OUTCOMES)))
def test_outcomes_are_refused(folder: Path, refused: Refused, text: str) -> None:
    (folder / OUTCOMES).write_text(text)
    refused("run", "validation", "--table", folder, words=(OUTCOMES, *WRONG_OUTCOMES[text]))


def test_recorded_tests_without_their_records_are_not_taken_for_pulses(
    folder: Path, refused: Refused
) -> None:
    (folder / RECORDS).unlink()
    rows = "1,a,0.2,0.3,0,1\n2,a,0.5,0.3,1,0\n"
    (folder / OUTCOMES).write_text(HEAD.strip() + ",has_record\n" + rows)
    refused("run", "validation", "--table", folder, words=("has_record", f"1, and no {RECORDS}"))


@pytest.mark.parametrize(
    "name", ["Records.nc", "records.nc4", "records.netcdf", "record.nc", "records (1).nc"]
)
def test_records_of_another_name(folder: Path, refused: Refused, name: str) -> None:
    (folder / RECORDS).rename(folder / name)
    refused("run", "validation", "--table", folder, words=(name, f"it is {RECORDS}", "rename it"))


@pytest.mark.parametrize("name", ["table.yml", "TABLE.YAML", "table.yaml.txt", "table (1).yaml"])
def test_assumptions_of_another_name(folder: Path, refused: Refused, name: str) -> None:
    (folder / name).write_text("density: 2700\n")
    refused("run", "validation", "--table", folder, words=(name, "it is table.yaml", "rename it"))


@pytest.mark.parametrize("name", [RECORDS, "table.yaml", "sp2.ply"])
def test_a_link_that_leads_nowhere(folder: Path, refused: Refused, name: str) -> None:
    """As of a file that is still to be fetched; without it tests would be run as pulses."""
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to("elsewhere")
    refused("run", "validation", "--table", folder, words=(name, "a link that leads nowhere"))


def test_assumptions_that_say_nothing(folder: Path, refused: Refused) -> None:
    """As of a disk that was full when they were saved."""
    (folder / "table.yaml").write_text("")
    refused("run", "validation", "--table", folder, words=("table.yaml", "got an empty file"))
    (folder / "table.yaml").write_text("# friction: [0.5, 0.9]\n")
    assert assumptions(folder) == ShakeTableConfig()


def test_files_that_are_not_read_are_named(folder: Path) -> None:
    """A second download, motions under a name of their own, assumptions that an editor renamed."""
    for name in ("records (1).nc", "motions.cdf", "table.txt", "notes.md"):
        (folder / name).write_text("")
    said = [line for line in remarks(folder, read_tests(folder)) if "nothing reads" in line]
    alone = Folder(folder, ()).digests()
    names = ["motions.cdf", "records (1).nc", "table.txt"]
    assert find(site_of(folder)).digests().keys() - alone.keys() == {
        f"{name} (not read)" for name in names
    }  # it is told of anew
    shown = ", ".join(map(repr, names))
    assert said == [f"{shown} left out, as nothing reads a file of that name there"]


def test_which_of_several_accelerations_counts_is_told(folder: Path) -> None:
    """A name that is spelt otherwise is no name of the merged one."""
    made = records()
    for name, counts in (("acceleration_merged", True), ("Acceleration_merged", False)):
        made.assign({name: made["acceleration"]}).to_netcdf(folder / RECORDS)
        one, other = (name, "acceleration") if counts else ("acceleration", name)
        told = f"{other} of records.nc left out, as {one} counts"
        assert told in list(remarks(folder, read_tests(folder)))


@pytest.mark.parametrize(
    ("name", "blank"),
    [
        ("ground_motion", ""),
        ("ground_motion", "NA"),
        *(("series", one) for one in ("", "NaN", "-")),
    ],
)
def test_a_blank_in_a_column_that_groups_tests_is_refused(
    folder: Path, name: str, blank: str
) -> None:
    """As merged cells of a spreadsheet leave in all rows but the first."""
    path = folder / OUTCOMES
    head, *rows = path.read_text().splitlines()
    if name not in head:
        head, rows = f"{head},{name}", [f"{row},7" for row in rows]
    at = head.split(",").index(name)
    cells = rows[1].split(",")
    cells[at] = blank
    path.write_text("\n".join([head, rows[0], ",".join(cells), *rows[2:], ""]))
    said = f"{name}: got {blank or 'nothing'} in row 2; it is in each row, or in none"
    with pytest.raises(InputError, match=said):
        read_tests(folder)


@pytest.mark.parametrize("name", ["ground_motion", "series"])
@pytest.mark.parametrize("other", ["KOBE 1", "Kobe\N{NO-BREAK SPACE}1", "Kobe  1"])
def test_names_that_differ_in_capitals_or_blanks_are_refused(
    folder: Path, name: str, other: str
) -> None:
    """They would part a group in two."""
    (folder / OUTCOMES).write_text(
        f"test,{name},pga_g,pgv_pga_s,specimen1\n1,Kobe 1,0.3,0.3,0\n2,{other},0.6,0.3,1\n"
    )
    with pytest.raises(InputError, match=f"{name}: got 'Kobe 1' and .*; each has one spelling"):
        read_tests(folder)


def test_rows_between_two_ditto_marks_are_missed(folder: Path) -> None:
    """A field between them holds what is in the lines from the first to the second."""
    rows = [f"{number},{name},0.3,0.3,0" for number, name in enumerate('a"ba"c')]
    (folder / OUTCOMES).write_text("\n".join([HEAD.strip(), *rows, ""]))
    with pytest.raises(InputError, match="got a field over several lines in row 2; a field is in"):
        read_tests(folder)


def test_what_has_no_part_is_named(folder: Path) -> None:
    rows = "1,0,1,a,0.2,0.3,0,1,1,1\n2,0,1,a,0.5,0.3,1,1,0,1\n3,0,0,a,0.5,0.3,1,1,1,0\n"
    names = "test,date,has_record,ground_motion,pga_g,pgv_pga_s,specimen1,specimen9,"
    names += "dem_s1_kn10,dem_s9_kn10\n"
    (folder / OUTCOMES).write_text(names + rows)
    found = read_tests(folder)
    assert found.number == (1, 2)
    assert found.unused == (
        "1 row of outcomes.csv with has_record of 0 left out",
        "column date of outcomes.csv left out, as it says nothing here",
        "column specimen9 of outcomes.csv left out, as there is no scan of that specimen",
        "column dem_s9_kn10 of outcomes.csv left out, as there is no scan of that specimen",
    )


CUT = "1 test of records.nc ({}) begin or end at more than 60% of their peak: they may be cut"


@pytest.mark.parametrize("how", ["link", "raw", "virtual"])
def test_a_part_of_records_that_is_kept_in_another_file_is_not_waited_for(
    folder: Path, refused: Refused, how: str
) -> None:
    """That may be a pipe."""
    other = str(folder / "other.hdf5")
    os.mkfifo(other)
    with h5py.File(folder / RECORDS, "r+") as file:
        if how == "link":
            file["extra"] = h5py.ExternalLink(other, "extra")
        elif how == "raw":
            file.create_dataset("extra", (4,), "f8", external=[(other, 0, 32)])
        else:
            layout = h5py.VirtualLayout((4,), "f8")
            layout[:] = h5py.VirtualSource(other, "extra", (4,))
            file.create_virtual_dataset("extra", layout)
    words = ("extra", "a part that is kept in another file")
    refused("run", "validation", "--table", folder, words=words)


def test_a_link_of_what_is_not_read_is_welcome(folder: Path) -> None:
    """As an editor leaves beside a file that is not saved yet."""
    (folder / ".#outcomes.csv").symlink_to("somebody@somewhere.123")
    assert site_of(folder).name == folder.name


def test_records_that_are_cut_or_stand_twice_are_told(folder: Path) -> None:
    made = records()
    assert not [line for line in remarks(folder, read_tests(folder)) if "may" in line]
    cut = SAMPLES // 2 + int(np.argmax(np.abs(made["acceleration"][0].values[SAMPLES // 2 :])))
    made.assign(n_samples=("test", [cut, SAMPLES])).to_netcdf(folder / RECORDS)
    said = [line for line in remarks(folder, read_tests(folder)) if "may" in line]
    assert said == [CUT.format(1)]
    late = np.zeros((2, SAMPLES))
    late[1, : SAMPLES - cut] = made["acceleration"][1].values[cut:]  # and rests for its length
    late[0] = made["acceleration"][0].values
    made.assign(acceleration=(("test", "time"), late)).to_netcdf(folder / RECORDS)
    said = [line for line in remarks(folder, read_tests(folder)) if "may" in line]
    assert said == [CUT.format(2)]
    same = np.array([made["acceleration"][1].values] * 2)
    made.assign(acceleration=(("test", "time"), same)).to_netcdf(folder / RECORDS)
    said = [line for line in remarks(folder, read_tests(folder)) if "may" in line]
    assert said == [
        "2 tests of records.nc (1, 2) are the same to the last digit: a record may stand twice"
    ]


def test_a_scan_in_centimetres_is_seen(folder: Path) -> None:
    assert [*sizes({1: scan(folder / "sp1.ply")})] == ["specimen 1 is 0.1 x 0.1 x 0.3 m"]
    thrown = trimesh.creation.icosphere()
    thrown.vertices[5] *= 3.0
    _, said = sizes({2: thrown})
    assert said.startswith("specimen 2: the vertex at "), said


def test_tests_to_predict_are_counted(folder: Path) -> None:
    """Scores are of the others, whose number alone would not tell that a cell was lost."""
    (folder / OUTCOMES).write_text(HEAD + "1,a,0.2,0.3,\n2,a,0.5,0.3,1\n")
    assert read_tests(folder).unused == ("1 test without an outcome in specimen1: predicted only",)


WRONG_RECORDS: dict[str, tuple[Callable[[xr.Dataset], xr.Dataset], str]] = {
    "one time": (lambda data: data.isel(time=[0]), "n_samples"),
    "backward": (lambda data: data.assign_coords(time=data["time"][::-1].values), "time"),
    "no time passes": (lambda data: data.assign_coords(time=1e-300 * data["time"]), "time"),
    "more samples than times": (lambda d: d.assign(n_samples=("test", [10**6, 9])), "n_samples"),
    "names for numbers": (lambda data: data.assign_coords(test=["a", "b"]), "test"),
    "a test twice": (lambda data: data.assign_coords(test=[1, 1]), "test"),
}


@pytest.mark.parametrize("case", WRONG_RECORDS)
def test_records_are_refused(folder: Path, refused: Refused, case: str) -> None:
    change, key = WRONG_RECORDS[case]
    change(records()).to_netcdf(folder / RECORDS)
    refused("run", "validation", "--table", folder, words=(f"{RECORDS}: {key}: got",))


@pytest.mark.parametrize("content", [b"", b"\x89HDF\r\n\x1a\n" + bytes(100), b"noise" * 99])
def test_records_that_are_no_netcdf(folder: Path, refused: Refused, content: bytes) -> None:
    (folder / RECORDS).write_bytes(content)
    refused("run", "validation", "--table", folder, words=(RECORDS, "cannot be read", "NetCDF"))


@pytest.mark.parametrize("share", [0.0, 0.5, 0.999])
def test_a_flipped_bit_of_packed_records(folder: Path, refused: Refused, share: float) -> None:
    """Which is met when the numbers are unpacked, long after the file is opened."""
    path = folder / RECORDS
    records().to_netcdf(path, encoding={"acceleration": {"zlib": True}})
    with h5py.File(path) as file:
        packed = file["acceleration"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[packed.byte_offset + int(share * packed.size)] ^= 1
    path.write_bytes(content)
    refused("run", "validation", "--table", folder, words=(RECORDS, "cannot be read", "NetCDF"))


@pytest.mark.parametrize("factor", [0.0, 1e308, np.nan, 1e-12])
def test_motions_are_refused(folder: Path, vsr: Callable[..., Any], factor: float) -> None:
    data = records()
    data.assign(acceleration=factor * data["acceleration"]).to_netcdf(folder / RECORDS)
    ran = vsr("run", "validation", "--table", folder, "--workers", "0")
    assert ran.code == 2, ran.err
    assert f"{RECORDS}: acceleration: got " in ran.err.splitlines()[-1]
