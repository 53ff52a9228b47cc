"""Records: readers, checks, processing, measures and the motion, against exact answers."""

from __future__ import annotations

import codecs
import copy
import io
import itertools
import math
import re
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import netCDF4
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.signal import firwin, freqz, lsim
from scipy.signal.windows import tukey
from support import record_files as files

from pipeline import ROOT
from pipeline.config.outside import damaged_heap
from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records import instrument_response, processing
from vsr_core.motions.records.columns import read_netcdf, read_table
from vsr_core.motions.records.formats import Reading, from_stream, read, read_all
from vsr_core.motions.records.processing import Processing, process
from vsr_core.motions.records.record import Record, check_end, check_rest, factor, repaired
from vsr_core.motions.records.text_files import read_at2, read_cosmos
from vsr_core.motions.records.trace import RecordedMotion, Trace, measures, spectrum

VALUES = files.shaking(7, 100.0, 4.0, 4.0, 0.6)
STEP = 0.01
PLAIN = Reading()


def record(values, interval: float = STEP) -> Record:
    return Record(np.asarray(values, dtype=float), interval, ("x",), "", "made up", "m/s2")


def refusal(call, *words: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        call()
    said = str(caught.value)
    assert [word for word in words if word not in said] == [], said


# Readers


@pytest.mark.parametrize("named", [True, False])
def test_at2_with_either_header(named: bool) -> None:
    found = read(files.at2(VALUES, STEP, named=named).encode(), ".AT2", PLAIN)
    assert found.interval == STEP
    assert found.unit == "G"
    assert found.station == "Nowhere Creek"
    assert found.channels == ("090",)
    # eight digits of g
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-7, atol=1e-9)


def test_at2_that_breaks_its_word_is_refused() -> None:
    text = files.at2(VALUES, STEP)
    refusal(lambda: read_at2(files.at2(VALUES, STEP, number=399), None), "400", "NPTS = 399")
    refusal(lambda: read_at2(text.replace("ACCELERATION", "VELOCITY"), None), "VELOCITY", "AT2")
    spectrum = text.replace("TIME SERIES", "RESPONSE SPECTRUM")
    refusal(lambda: read_at2(spectrum, None), "SPECTRUM", "TIME SERIES")
    refusal(lambda: read_at2(text, "m/s2"), "motion.unit m/s2", "in G")
    refusal(lambda: read_at2(text[:-20] + "word\n", None), "word", "numbers")
    for other in ("MSEC", "MIN", "ms", "(MSEC)", "SEC, DT= .0050 SEC", ".0050 SEC", "/2 SEC"):
        said = text.replace("SEC", other)
        refusal(lambda text=said: read_at2(text, None), "DT in seconds")
    twice = text.replace("NPTS=", "NPTS= 500, NPTS=")
    refusal(lambda: read_at2(twice, None), "NPTS and DT stand there once")
    for other, unit in (("CM/S2 G", "G"), ("G (CM/S2)", "CM/S2"), ("G (9.81 M/S2)", "M/S2")):
        told = f"its third line names {unit}, too; taken in {other.split()[0]}"
        assert read_at2(text.replace("OF G", f"OF {other}"), None).repairs == (told,)
    for other in ("SEC, BANDWIDTH=2", "[s]", "SEC; FILTERED", "SEC  FILTERED", "(100 Hz)", "", "."):
        assert read_at2(text.replace("SEC,", other), None).interval == STEP
    longer = text.replace("OF G", "OF G. FILTER POINTS: HP=0.1 Hz LP=30 Hz")
    longer = longer.replace("SEC,", "(s),   0 POLE @    30.00000 HZ,  -5 POLE @      .05000")
    np.testing.assert_array_equal(
        read_at2(longer, None).acceleration, read_at2(text, None).acceleration
    )


def test_cosmos_with_several_channels() -> None:
    text = files.cosmos((VALUES, 90), (-2.0 * VALUES, 400), interval=STEP)
    east = read(text.encode(), ".v2", Reading(component="90"))
    up = read(text.encode(), ".txt", Reading(component="up"))
    assert east.interval == up.interval == STEP
    assert east.unit == "cm/s2"
    assert "Nowhere Creek" in east.station
    np.testing.assert_allclose(east.acceleration, VALUES, atol=0.6e-6)  # four digits of a gal
    np.testing.assert_allclose(up.acceleration, -2.0 * VALUES, atol=0.6e-6)
    refusal(lambda: read(text.encode(), ".v2", PLAIN), "2 channels (90, up)", "motion.component")
    refusal(lambda: read(text.encode(), ".v2", Reading("north")), "'north'", "90, up")


def test_cosmos_velocity_is_passed_over() -> None:
    both = files.cosmos((VALUES, 90), interval=STEP, parameter=2) + files.cosmos(
        (VALUES, 180), interval=STEP
    )
    assert read_cosmos(both, None).channels == ("180",)
    only = files.cosmos((VALUES, 90), interval=STEP, parameter=2)
    refusal(lambda: read_cosmos(only, None), "without an acceleration")


def test_cosmos_that_breaks_its_word_is_refused() -> None:
    text = files.cosmos((VALUES, 90), interval=STEP)
    lines = text.splitlines()
    refusal(lambda: read_cosmos("\n".join(lines[:-5]), None), "ends early")
    one_more = "\n".join([*lines[:-9], lines[-9] + lines[-9][-10:], *lines[-8:]])
    refusal(lambda: read_cosmos(one_more, None), "a line of more columns than")
    refusal(lambda: read_cosmos(text.replace("     400 acc", "     392 acc"), None), "header")
    wrong_step = text.replace("    10.000000     4.000000", "    20.000000     4.000000")
    assert wrong_step != text
    refusal(lambda: read_cosmos(wrong_step, None), "400 samples of 20 ms", "4 s")
    block = text.index("acceleration pts")
    whole = text[:block] + re.sub(r"(\d)\.(\d{4})", r"\1\2 ", text[block:], count=1)
    refusal(lambda: read_cosmos(whole, None), "without a point, under")
    for said in ("g (04)", "cm/sec (04)", "g", "cm (04)"):
        other = text.replace("units=cm/sec2 (04)", f"units={said}")
        words = f"unit 4 in its header, and units={said} above"
        refusal(lambda text=other, words=words: read_cosmos(text, None), words)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Corrected acceleration", "Corrected velocity"),
        ("acceleration pts", "velocity pts"),
        ("       2       1       4", "       2       3       4"),
    ],
)
def test_cosmos_that_is_called_another_quantity_is_refused(old: str, new: str) -> None:
    """Else one of two channels would be passed over without a word, or a velocity be taken."""
    one, two = (files.cosmos((VALUES, azimuth), interval=STEP) for azimuth in (90, 360))
    changed = one + two.replace(old, new)
    assert changed != one + two
    refusal(lambda: read_cosmos(changed, None), "in its header, and is called")


@pytest.mark.parametrize(
    ("heading", "one"),
    [
        ("acceleration [m/s2]", 1.0),
        ("acc (cm/s^2)", 0.01),
        ("a [gal]", 0.01),
        ("acc_g", GRAVITY),
        ("A [mg]", 1e-3 * GRAVITY),
        ("a [m s-2]", 1.0),
        ("a [cm/sec**2]", 0.01),
        ("a_g [m/s2]", 1.0),  # the symbol of Eurocode 8: no g
        ("Sensor_mg [cm/s2]", 0.01),
    ],
)
def test_table_with_its_unit_in_the_heading(heading: str, one: float) -> None:
    found = read(files.csv(VALUES / one, STEP, heading).encode(), ".csv", PLAIN)
    assert found.interval == pytest.approx(STEP, rel=1e-12)
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("mark", [" ", ","])
def test_a_heading_behind_a_remark_is_read(mark: str) -> None:
    """As ``numpy.savetxt`` writes it."""
    told = io.BytesIO()
    table = np.column_stack([STEP * np.arange(len(VALUES)), VALUES])
    np.savetxt(told, table, delimiter=mark, header=f"made up\ntime [s]{mark}acceleration [m/s2]")
    found = read(told.getvalue(), ".csv", PLAIN)
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-12)
    without = told.getvalue().replace(b"# time [s]", b"# nothing\n#")
    with pytest.raises(InvalidInput, match=r"each row has|time"):
        read(without, ".csv", PLAIN)


def test_a_heading_of_two_units_is_refused() -> None:
    for name in ("acceleration [m/s2]", "acceleration m/s2", "acc in m/s2", "acc_m/s2"):
        text = files.csv(VALUES, STEP, f"{name} (g)")
        refusal(lambda text=text: read(text.encode(), ".csv", PLAIN), f"{name} in m/s2 and in g")
    same = files.csv(VALUES / GRAVITY, STEP, "HNE (SA[g]) [g]")
    np.testing.assert_allclose(read(same.encode(), ".csv", PLAIN).acceleration, VALUES, atol=1e-6)


@pytest.mark.parametrize("line", [0, 30, 60])
def test_a_line_that_lost_its_exponents_is_refused(line: int) -> None:
    """Of an AT2 in the notation of Fortran, and of a table."""
    words = [f"{one:.6E}" for one in VALUES]
    lost = [*words]
    lost[5 * line : 5 * line + 5] = [one.split("E")[0] for one in words[5 * line : 5 * line + 5]]
    head = f"PEER\nA, B, C\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= {len(words)}, DT= {STEP}"
    whole, damaged = (f"{head} SEC\n{' '.join(one)}\n".encode() for one in (words, lost))
    assert len(read(whole, ".at2", PLAIN).acceleration) == len(words)
    refusal(lambda: read(damaged, ".at2", PLAIN), "without an exponent, which others have, as")
    rows = "".join(f"{STEP * at:.3f},{one}\n" for at, one in enumerate(lost))
    table = f"time,acceleration [m/s2]\n{rows}".encode()
    refusal(lambda: read(table, ".csv", PLAIN), "without an exponent")


@pytest.mark.parametrize("form", ["{:g}", "{!r}", "{:.6E}", "{:.6f}"])
def test_numbers_formed_as_programs_do_are_read(form: str) -> None:
    rows = "".join(
        f"{STEP * at:.3f},{form.format(one)}\n" for at, one in enumerate((1e-2 * VALUES).tolist())
    )
    found = read(f"time,acceleration [m/s2]\n{rows}".encode(), ".csv", PLAIN)
    np.testing.assert_allclose(found.acceleration, 1e-2 * VALUES, atol=1e-6)


def test_a_byte_order_mark_is_no_part_of_a_record() -> None:
    plain = files.csv(VALUES, STEP).encode()
    marked = read(codecs.BOM_UTF8 + plain, ".csv", PLAIN)
    assert (marked.acceleration == read(plain, ".csv", PLAIN).acceleration).all()


def test_table_without_a_unit_needs_one() -> None:
    text = files.csv(VALUES, STEP, "raw")
    refusal(lambda: read_table(text, None, None), "without a unit", "motion.unit")
    assert read_table(text, "raw", "cm/s2").acceleration[50] == pytest.approx(0.01 * VALUES[50])
    refusal(lambda: read_table(text, None, "counts"), "counts", "motion.response")
    refusal(lambda: read_table(text, None, "furlong"), "'furlong'", "m/s2")
    for name in ("velocity", "disp_cm", "Vel_cm/s", "ground velocity cm/s", "velocity_g", "vx"):
        other = files.csv(VALUES, STEP, name)
        refusal(lambda text=other: read_table(text, None, "m/s2"), name, "motion.component")
    assert read_table(files.csv(VALUES, STEP, "V"), None, "m/s2").channels == ("V",)  # vertical
    known = files.csv(VALUES, STEP)
    refusal(lambda: read_table(known, None, "gal"), "motion.unit gal", "m/s2")
    refusal(lambda: read_table(known.replace("time", "age"), None, None), "age", "named time")
    refusal(lambda: read_table(files.csv(VALUES, STEP, f"a{' ' * 9000}x"), None, "g"), "9,002")
    refusal(lambda: read_table(known + "4.01,x\n", None, None), "row 402", "numbers")


@pytest.mark.parametrize("form", [".6g", ".8g", ".4f"])
def test_table_whose_times_are_rounded(form: str) -> None:
    step = 0.00125
    times = np.arange(9000) * step
    rows = [f"{t:{form}},{math.sin(t)}" for t in times]
    found = read_table("\n".join(["time,a [m/s2]", *rows]), None, None)
    assert found.interval == pytest.approx(step, rel=1e-5)
    assert len(found.acceleration) == 9000


def few_digits(rate: float, digits: int, lost: slice | int) -> str:
    """A table of 2,000 rows, less some."""
    rows = [f"{place / rate:.{digits}f},{math.sin(place)}" for place in range(2000)]
    del rows[lost]
    return "\n".join(["time,a [m/s2]", *rows])


@pytest.mark.parametrize(("rate", "digits"), [(60.0, 2), (62.5, 2), (512.0, 3), (800.0, 4)])
def test_times_of_few_digits_leave_none_out(rate: float, digits: int) -> None:
    found = read_table(few_digits(rate, digits, slice(0)), None, None)
    assert found.interval == pytest.approx(1.0 / rate, rel=1e-9)
    np.testing.assert_allclose(found.acceleration, np.sin(np.arange(2000)))
    assert found.repairs == ()


def test_a_short_table_is_of_the_step_of_all_its_times() -> None:
    """At its end 33 Hz would do, too."""
    rows = [f"{0.03 * place:.2f},{place % 7}" for place in range(30)]
    found = read_table("\n".join(["time,a [m/s2]", *rows]), None, None)
    assert found.interval == pytest.approx(0.03, rel=1e-9)


@pytest.mark.parametrize("place", [2, 400, 1000])
def test_one_that_is_left_out_is_a_gap_however_few_digits(place: int) -> None:
    found = read_table(few_digits(100.0, 2, place), None, None)
    assert found.interval == pytest.approx(0.01)
    assert np.flatnonzero(np.isnan(found.acceleration)).tolist() == [place]


@pytest.mark.parametrize(
    ("rate", "digits", "lost"),
    [
        (80.0, 2, slice(0)),
        (200.0 / 3.0, 2, slice(0)),
        (99.0, 2, slice(0)),
        (800.0, 3, slice(0)),
        (80.0, 2, 700),
        (100.0, 2, slice(50, None, 100)),  # one in a second, or 99 Hz
    ],
)
def test_times_that_may_be_of_two_rates_are_refused(
    rate: float, digits: int, lost: slice | int
) -> None:
    text = few_digits(rate, digits, lost)
    refusal(lambda: read_table(text, None, None), "left out", "more digits")


@pytest.mark.parametrize("many", [1.0, 10.0])
def test_times_that_are_in_no_seconds_are_refused(many: float) -> None:
    """Milliseconds of 1000 and 100 Hz, or samples by their numbers: a PGV of 24 s times the PGA."""
    lines = [f"{many * place:g},{value}" for place, value in enumerate(VALUES)]
    text = "\n".join(["time,a [m/s2]", *lines])
    refusal(lambda: read_table(text, None, None), f"time steps of {many:g} s", "in seconds, not")
    slow = [f"{np.float32(0.1) * np.float32(place)},{value}" for place, value in enumerate(VALUES)]
    text = "\n".join(["time,a [m/s2]", *slow])
    assert read_table(text, None, None).interval == pytest.approx(0.1, rel=1e-5)
    rare = np.float32(0.1)  # as SAC has it, and a little longer
    assert read(sac(delta=float(rare)), ".sac", Reading(unit="m/s2")).interval == rare


@pytest.mark.parametrize("start", [0, 5])
def test_the_shortest_steps_are_taken_however_they_are_rounded(start: int) -> None:
    def of(step: float) -> str:
        lines = [f"{start + step * place:.9f},{value}" for place, value in enumerate(VALUES)]
        return "\n".join(["time,a [m/s2]", *lines])

    assert read_table(of(1e-6), None, None).interval == pytest.approx(1e-6, rel=1e-9)
    refusal(lambda: read_table(of(9e-7), None, None), "time steps of 9e-07 s", "from 1e-06")


def test_uneven_steps_are_refused_and_left_out_ones_are_gaps() -> None:
    lines = files.csv(VALUES, STEP).splitlines()
    late = [*lines[:50], lines[50].replace(",", "4,"), *lines[51:]]
    refusal(lambda: read_table("\n".join(late), None, None), "time steps that differ", "resample")
    beside_the_first = [*lines[:2], lines[2].replace("0.01", "0.01e-320"), *lines[3:]]
    refusal(lambda: read_table("\n".join(beside_the_first), None, None), "time steps that differ")
    holes = [*lines[:50], *lines[53:]]
    found = read_table("\n".join(holes), None, None)
    assert np.flatnonzero(np.isnan(found.acceleration)).tolist() == [49, 50, 51]
    assert "3 time steps were left out" in found.repairs[0]
    coarse = [f"{t:.5g},0.1" for t in np.arange(9000) * 0.00137]  # 1 ms from 10 s on
    refusal(lambda: read_table("\n".join([lines[0], *coarse]), None, None), "time steps")
    turned = [lines[0], *reversed(lines[1:])]
    refusal(lambda: read_table("\n".join(turned), None, None), "not increasing")


def test_columns_that_state_no_unit_are_in_the_one_that_is_given() -> None:
    lines = [f"{place * STEP:.2f},{place % 7},{place % 5},{place}" for place in range(64)]
    text = "\n".join(["time,HNE,HNN,velocity", *lines])
    found = read_table(text, None, "g")
    assert found.channels == ("HNE", "HNN")
    expected = GRAVITY * (np.arange(64) % 5)
    np.testing.assert_allclose(found.channel("HNN").acceleration, expected)
    refusal(lambda: found.channel(None), "HNE", "HNN")
    refusal(lambda: read_table(text, None, None), "without a unit of acceleration")
    other = read_table(text.replace("HNE", "HNE [degC]"), None, "g")
    assert other.channels == ("HNN",)
    assert other.repairs == ("left out, as g is the unit of others: HNE",)


def test_a_column_without_a_unit_beside_one_of_acceleration_is_told() -> None:
    lines = [f"{place * STEP:.2f},{place % 7},{3 * (place % 7)}" for place in range(64)]
    found = read_table("\n".join(["time [s],EW [m/s2],NS", *lines]), None, None)
    assert found.channels == ("EW",)
    assert found.repairs == ("left out, as m/s2 is the unit of others: NS",)


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


def test_unknown_format_is_refused() -> None:
    refusal(lambda: read(b"\0\1\2", ".bin", PLAIN), "no known format", "CSV")
    refusal(lambda: read(b"some words", ".doc", PLAIN), "no known format")


def trace(data, start: float, channel: str = "HNE", calib: float = 1.0, **more) -> SimpleNamespace:
    """What is used of ObsPy's Trace."""

    class Stats(SimpleNamespace):
        def __contains__(self, name: str) -> bool:
            return hasattr(self, name)

    stats = Stats(
        network="XX", station="NWC", location="", channel=channel, delta=STEP, calib=calib,
        starttime=start, endtime=start + STEP * (len(data) - 1), **more,
    )  # fmt: skip
    return SimpleNamespace(data=data, stats=stats)


def test_waveforms_keep_gaps_and_are_cut_to_common_times() -> None:
    masked = np.ma.masked_array(100.0 * VALUES, mask=np.arange(400) == 20)
    found = from_stream([trace(masked, 5.0), trace(VALUES[10:], 5.1, "HNN")], "gal")
    assert found.channels == ("HNE", "HNN")
    assert found.acceleration.shape == (390, 2)
    assert np.flatnonzero(np.isnan(found.acceleration[:, 0])).tolist() == [10]
    np.testing.assert_allclose(found.acceleration[11:, 0], VALUES[21:])
    np.testing.assert_allclose(found.acceleration[:, 1], 0.01 * VALUES[10:])
    assert found.repairs == ("HNE: 10 samples that others lack were cut",)
    refusal(lambda: from_stream([trace(VALUES, 0.0)], None), "without a unit")
    japanese = from_stream([trace(1e3 * VALUES, 0.0, calib=1e-3, knet={})], None)
    np.testing.assert_allclose(japanese.acceleration, VALUES)


@pytest.mark.parametrize("suffix", [".csv", ".AT2", ".v2", ".NS"])
def test_what_states_accelerations_needs_no_response_and_a_line_tells_one(suffix: str) -> None:
    how = Reading(response=b"of other files", corners=(0.05, 0.1, 25.0, 35.0))
    text = {
        ".csv": lambda: files.csv(VALUES, STEP),
        ".AT2": lambda: files.at2(VALUES, STEP),
        ".v2": lambda: files.cosmos((VALUES, 90), interval=STEP),
        ".NS": lambda: files.knet(VALUES, STEP),
    }[suffix]()
    with_it, alone = read(text.encode(), suffix, how), read(text.encode(), suffix, PLAIN)
    np.testing.assert_array_equal(with_it.acceleration, alone.acceleration)
    told = (*alone.repairs, "motion.response left alone, which is for miniSEED and SAC")
    assert with_it.repairs == told


def test_knet_by_obspy() -> None:
    pytest.importorskip("obspy")
    found = read(files.knet(VALUES, STEP).encode(), ".NS", PLAIN)
    assert found.interval == pytest.approx(STEP)
    assert found.station == "NWC001"
    count = 0.01 * 3920.0 / 8223790.0
    offset = 20000 * count
    np.testing.assert_allclose(found.acceleration - offset, VALUES, atol=0.51 * count)


@pytest.mark.parametrize("rate", [102.4, 12.5, 33.3])
def test_knet_of_a_rate_that_is_no_whole_number(rate: float) -> None:
    """The step by the header; ObsPy takes 102 and 12 Hz."""
    pytest.importorskip("obspy")
    values = np.resize(VALUES, round(30.0 * rate))
    text = files.knet(values, 1.0 / rate).replace(f"{round(rate)}Hz", f"{rate}Hz")
    found = read(text.encode(), ".NS", PLAIN)
    assert (found.interval, len(found.acceleration)) == (1.0 / rate, len(values))


@pytest.mark.parametrize(
    "change",
    [
        ("3920(gal)", "39200(gal)"),
        ("Max. Acc. (gal)   ", "&9"),
        ("(gal)   245.166", "(gal)   0.000"),
    ],
)
def test_knet_whose_scale_contradicts_its_peak(change: tuple[str, str]) -> None:
    pytest.importorskip("obspy")
    old, new = change
    text = files.knet(VALUES, STEP).replace(old, new.replace("&", old))
    refusal(lambda: read(text.encode(), ".NS", PLAIN), "gal by its scale factor", "two agree")


@pytest.mark.parametrize("line", [0, 20, -2, -1])
@pytest.mark.parametrize("kind", [".NS", ".AT2", ".sac"])
@pytest.mark.parametrize("lost", [-1, 20])
def test_a_line_that_lost_a_character_is_refused(kind: str, line: int, lost: int) -> None:
    pytest.importorskip("obspy")
    text = {".NS": knet_text, ".AT2": at2_text, ".sac": sac_text}[kind]()
    header = {".NS": 17, ".AT2": 4, ".sac": 30}[kind]
    how = Reading(unit="m/s2" if kind == ".sac" else None)
    lines = text.splitlines()
    samples = [one.rstrip() for one in lines[header:]]
    whole = samples[line]
    samples[line] = whole[:lost] + whole[lost:][1:]
    cut = "\n".join([*lines[:header], *samples, ""])
    refusal(lambda: read(cut.encode(), kind, how), "a line '", "out of column")
    free = "\n".join([*lines[:header], *(" ".join(one.split()) for one in lines[header:]), ""])
    whole = read(text.encode(), kind, how).acceleration
    np.testing.assert_array_equal(read(free.encode(), kind, how).acceleration, whole)


@pytest.mark.parametrize("each", [1, 2, 8])
def test_numbers_parted_by_blanks_stand_in_no_columns(each: int) -> None:
    """Negative ones are a character longer: half of them, none, or few after others alike."""
    head = files.at2(VALUES, STEP).splitlines()[:4]
    for values in (
        VALUES,
        VALUES - 0.9 * VALUES.min(),
        np.where(np.arange(400) < 280, 0.1, VALUES),
    ):
        words = [f"{one:.7E}" for one in values]
        lines = [" ".join(words[at : at + each]) for at in range(0, len(words), each)]
        found = read("\n".join([*head, *lines, ""]).encode(), ".at2", PLAIN)
        np.testing.assert_allclose(found.acceleration, values * GRAVITY, atol=1e-6)


@pytest.mark.parametrize("form", ["{:6.3f}", "{:5.2f}", "{: .6f}", "{: g}", "{:7.3f} "])
@pytest.mark.parametrize("each", [1, 8])
def test_numbers_that_outgrow_their_columns_are_read(form: str, each: int) -> None:
    head = files.at2(VALUES, STEP).splitlines()[:4]
    words = [form.format(one) for one in 8.0 * VALUES]
    lines = ["".join(f" {one}" for one in words[at : at + each]) for at in range(0, 400, each)]
    found = read("\n".join([*head, *lines, ""]).encode(), ".at2", PLAIN)
    assert len(found.acceleration) == 400


def by_fortran(value: float) -> str:
    """By G15.7: four blanks follow where no exponent stands."""
    size = abs(value)
    if not 0.1 <= size < 1e7:
        return f"{value:15.7E}"
    return f"{value:11.{6 - math.floor(math.log10(size))}f}    "


def test_sac_of_text_as_fortran_writes_it_is_read() -> None:
    pytest.importorskip("obspy")
    lines = sac_text().splitlines()[:30]
    words = [by_fortran(float(one)) for one in VALUES]
    lines += ["".join(words[at : at + 5]) for at in range(0, len(words), 5)]
    found = read("\n".join([*lines, ""]).encode(), ".sac", Reading(unit="m/s2"))
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-6)


@pytest.mark.parametrize("peak", [0.05, 0.101, 0.4, 4.0])
def test_at2_as_fortran_writes_it_is_read(peak: float) -> None:
    values = VALUES * peak / np.abs(VALUES).max()
    words = [by_fortran(float(one)) for one in values]
    lines = [*files.at2(VALUES, STEP).splitlines()[:4]]
    lines += ["".join(words[at : at + 5]) for at in range(0, len(words), 5)]
    found = read("\n".join([*lines, ""]).encode(), ".at2", PLAIN)
    np.testing.assert_allclose(found.acceleration, values * GRAVITY, rtol=1e-6)


def test_cosmos_series_of_other_quantities_are_passed_over() -> None:
    """Such as a displacement between two floors, by a number of its own."""
    text = files.cosmos((VALUES, 90), interval=STEP)
    other = files.cosmos((VALUES, 180), interval=STEP, parameter=2)
    other = other.replace("       2       2       4", "       2       4       6")
    other = other.replace("velocity", "relative displacement")
    assert read_cosmos(text + other, None).channels == ("90",)
    zeros = np.where(np.arange(400) == 7, 0.0, VALUES)
    plain = files.cosmos((zeros, 90), interval=STEP).replace("    0.0000", "         0")
    np.testing.assert_allclose(read_cosmos(plain, None).acceleration, zeros, atol=1e-6)


@pytest.mark.parametrize(
    "end", ["/&  ---------  End of data for channel  1  ---------", "END-OF-DATA"]
)
def test_cosmos_with_other_words_for_its_end_is_read(end: str) -> None:
    text = files.cosmos((VALUES, 90), interval=STEP)
    other = re.sub("End-of-data.*", end, text).replace("Format=(8F10.4)", "Format=(8F10.4E)")
    assert other != text
    np.testing.assert_array_equal(
        read_cosmos(other, None).acceleration, read_cosmos(text, None).acceleration
    )


def test_at2_in_one_line_and_of_old_line_ends_is_read() -> None:
    text = files.at2(VALUES, STEP)
    *header, samples = text.split("\n", 4)
    in_one = "\n".join([*header, " ".join(samples.split())])
    ends = ("\r", "\r\n", "\r\r\n")
    for other in (in_one, f"{in_one}\n", *(text.replace("\n", end) for end in ends)):
        np.testing.assert_array_equal(
            read(other.encode(), ".AT2", PLAIN).acceleration,
            read(text.encode(), ".AT2", PLAIN).acceleration,
        )


def knet_text() -> str:
    return files.knet(VALUES, STEP)


def at2_text() -> str:
    return files.at2(VALUES, STEP)


def sac_text() -> str:
    import obspy

    content = io.BytesIO()
    obspy.Trace(VALUES.astype(np.float32), {"delta": STEP}).write(content, format="SACXY")
    return content.getvalue().decode()


def test_a_sample_of_knet_has_no_underscore() -> None:
    """Python reads 12_00 as 1200."""
    pytest.importorskip("obspy")
    text = files.knet(VALUES, STEP)
    at = text.index("Memo.") + 9
    changed = text[:at] + re.sub(r"(\d)(\d)", r"\1_\2", text[at:], count=1)
    refusal(lambda: read(changed.encode(), ".NS", PLAIN), "among its samples; they are numbers")


def test_miniseed_and_sac_by_obspy(tmp_path: Path) -> None:
    obspy = pytest.importorskip("obspy")
    header = {"delta": STEP, "station": "NWC", "channel": "HNE"}
    stream = obspy.Stream([obspy.Trace(100.0 * VALUES, header)])
    for form, suffix, digits in (("MSEED", ".mseed", 1e-12), ("SAC", ".sac", 1e-6)):
        path = tmp_path / f"one{suffix}"
        stream.write(str(path), format=form)
        found = read(path.read_bytes(), suffix, Reading(unit="gal"))
        np.testing.assert_allclose(found.acceleration, VALUES, rtol=digits, atol=1e-7)
        unnumbered = b" " * 6 + path.read_bytes()[6:] if form == "MSEED" else path.read_bytes()
        again = read(unnumbered, suffix, Reading(unit="gal"))
        np.testing.assert_array_equal(again.acceleration, found.acceleration)
        refusal(lambda p=path, s=suffix: read(p.read_bytes(), s, PLAIN), "without a unit")


@pytest.mark.parametrize(("kind", "told"), [("ivel", "velocity"), ("idisp", "displacement")])
def test_a_sac_file_of_another_quantity_is_no_record(kind: str, told: str) -> None:
    refusal(lambda: read(sac(idep=kind), ".sac", Reading(unit="m/s2")), told, "motion.response")


@pytest.mark.parametrize("header", [{"iftype": "irlim"}, {"iftype": "ixy"}, {"leven": False}])
def test_a_sac_file_of_another_kind_is_no_record(header: dict[str, object]) -> None:
    refusal(lambda: read(sac(**header), ".sac", Reading(unit="m/s2")), "IFTYPE", "even steps")


def test_a_pressure_is_no_record() -> None:
    refusal(lambda: read(sac(kcmpnm="BDF"), ".sac", Reading(unit="m/s2")), "BDF", "a pressure")


def test_a_sac_file_of_version_7_has_a_footer() -> None:
    """As SAC 102 writes it: times of the header once more, in double precision."""
    whole, how = sac(idep="iacc", kcmpnm="HNE"), Reading(unit="m/s2")
    first = read(whole, ".sac", how)
    number, step = len(first.acceleration), first.interval
    footer = np.array([step, 0.0, (number - 1) * step, *[-12345.0] * 19])
    seven = whole[:304] + np.array(7, "<i4").tobytes() + whole[308:]
    found = read(seven + footer.tobytes(), ".sac", how)
    np.testing.assert_array_equal(found.acceleration, first.acceleration)
    refusal(lambda: read((seven + footer.tobytes())[:-8], ".sac", how), "version 7 with", "whole")
    footer[0] *= 2.0
    refusal(lambda: read(seven + footer.tobytes(), ".sac", how), "its footer 0.0", "agree")


def test_what_a_sac_header_says_beside_is_told() -> None:
    found = read(sac(idep="iacc", scale=4.0, kcmpnm="HHE"), ".sac", Reading(unit="m/s2"))
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-6, atol=1e-7)
    assert any("SCALE of the header, 4" in said for said in found.repairs)
    assert any("HHE: by its code a seismometer" in said for said in found.repairs)
    plain = read(sac(idep="iacc", kcmpnm="HNE"), ".sac", Reading(unit="m/s2"))
    assert plain.repairs == ()


@pytest.mark.parametrize(
    "head",
    [
        "time [s],acceleration [m/s²]",
        "time [s] acceleration [m/s2]",
        "Time (Sec),acc (m/s2)",
        "# Ålesund\ntime,acc [m s⁻²]",
    ],
)
def test_tables_of_other_hands(head: str) -> None:
    mark = "," if "," in head else " "
    rows = "".join(f"{STEP * k:.6g}{mark}{value:.9g}\n" for k, value in enumerate(VALUES))
    found = read(f"{head}\n{rows}".encode(), ".csv", PLAIN)
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-6)


def test_a_station_with_a_letter_of_its_own() -> None:
    text = files.at2(VALUES, STEP).replace("Nowhere", "Ålesund")
    assert "Ålesund" in text
    for encoding in ("utf-8", "latin-1"):
        found = read(text.encode(encoding), ".at2", PLAIN)
        assert "Ålesund" in found.source


def test_headers_that_contradict_their_samples() -> None:
    whole = sac(idep="iacc", kcmpnm="HNE")
    said = np.frombuffer(whole[:632], "<f4").copy()
    assert said[0] == np.float32(STEP)
    said[0] *= 4.0  # DELTA, beside the end
    refusal(lambda: read(said.tobytes() + whole[632:], ".sac", Reading(unit="m/s2")), "DELTA")
    said[0] /= 4.0
    said[1:3] *= 2.0  # DEPMIN and DEPMAX
    found = read(said.tobytes() + whole[632:], ".sac", Reading(unit="m/s2"))
    assert any("DEPMAX of the header" in said for said in found.repairs)
    lost = np.frombuffer(whole[632:], "<f4").copy()
    lost[:] = np.roll(np.where(np.arange(len(lost)) // 10 == 10, 0.0, lost), -110)
    found = read(whole[:632] + lost.tobytes(), ".sac", Reading(unit="m/s2"))
    assert any("by DEPMEN of the header a mean of" in said for said in found.repairs)
    assert not read(whole, ".sac", Reading(unit="m/s2")).repairs
    text = files.cosmos((VALUES, 90), interval=STEP)
    refusal(lambda: read(text.replace("(04)", "(11)").encode(), ".v2", PLAIN), "(11) above")
    none = files.cosmos((VALUES[:0], 90), interval=STEP)
    refusal(lambda: repaired(read(none.encode(), ".v2", PLAIN)), "")
    peak = f"{100.0 * np.abs(VALUES).max():13.6f}"
    lines = text.splitlines(keepends=True)
    at = next(k for k, line in enumerate(lines) if "Real-header" in line) + 1 + 63 // 6
    for value, told in ((peak, False), (f"{7.5:13.6f}", True)):
        changed = lines.copy()
        changed[at] = lines[at][: 13 * (63 % 6)] + value + lines[at][13 * (63 % 6 + 1) :]
        found = read("".join(changed).encode(), ".v2", PLAIN)
        assert any("says a peak of 7.5" in said for said in found.repairs) is told


def sac(**header: object) -> bytes:
    """A SAC file of the values."""
    module = pytest.importorskip("obspy.io.sac")
    header = {"delta": STEP, "kstnm": "NWC"} | header
    trace = module.SACTrace(data=VALUES.astype("f4"), **header)
    file = io.BytesIO()
    trace.write(file)
    return file.getvalue()


def test_response_of_obspys_example_is_removed(tmp_path: Path) -> None:
    obspy = pytest.importorskip("obspy")
    stream, inventory = obspy.read(), obspy.read_inventory()
    path, xml = tmp_path / "one.mseed", tmp_path / "one.xml"
    stream.write(str(path), format="MSEED")
    inventory.write(str(xml), format="STATIONXML")
    band = (0.5, 1.0, 20.0, 30.0)
    how = Reading("EHZ", None, xml.read_bytes(), band)
    found = read(path.read_bytes(), ".mseed", how)
    # an independent way: velocity by the sensitivity alone holds well inside the band
    seen = stream.select(channel="EHZ")[0].data / 2516778400.0
    inside = {"kind": "lowpass", "corner": 10.0, "poles": 4}
    ours = processing.filtered(Trace(found.acceleration, STEP).velocity, STEP, **inside)
    other = processing.filtered(seen - seen.mean(), STEP, **inside)
    ours, other = (
        processing.filtered(v, STEP, "highpass", 3.0, 4)[500:-500] for v in (ours, other)
    )
    assert np.corrcoef(ours, other)[0, 1] > 0.97
    assert np.abs(ours).max() == pytest.approx(np.abs(other).max(), rel=0.1)
    altogether = b"</Frequency>\n            <InputUnits>\n              <Name>M/S"
    spelt = how.response.replace(altogether, altogether.replace(b"M/S", b"m/sec"))
    alike = read(path.read_bytes(), ".mseed", replace(how, response=spelt))
    np.testing.assert_array_equal(alike.acceleration, found.acceleration)
    for old, new, words in (
        (b"<Value>1500.0<", b"<Value>150000.0<", "100 times the sensitivity"),
        (b"<Value>1500.0<", b"<Value>NaN<", "nan times the sensitivity"),
        (altogether, altogether + b"**2", "in M/S**2 whose first stage is in M/S"),
        (b"<Name>M/S<", b"<Name>PA<", "an instrument in PA"),
        (b"<Name>M/S<", b"<Name>M/S^2<", "an instrument in M/S^2"),
        (b"<Name>M/S<", b"<Name>CM/SEC**2<", "an instrument in CM/SEC**2"),
        (b"<Name>M/S<", b"<Name>CM<", "an instrument in CM"),
        (b"<Name>M/S<", b"<Name><", "an instrument in no unit"),
    ):
        assert old in how.response
        other = replace(how, response=how.response.replace(old, new))
        refusal(lambda other=other: read(path.read_bytes(), ".mseed", other), words)
    bare = replace(how, corners=None)
    refusal(lambda: read(path.read_bytes(), ".mseed", bare), "motion.response.corners")


FILTERED = r"coefficients of {} sum to [\d.]+ and not to 1: signs may be lost"


def test_counts_and_poles_that_lost_their_signs_are_told() -> None:
    obspy = pytest.importorskip("obspy")
    (trace,), xml = obspy.read().select(channel="EHZ"), io.BytesIO()
    obspy.read_inventory().write(xml, format="STATIONXML")

    def told(response: bytes, change: Callable[[np.ndarray], np.ndarray]) -> list[str]:
        waves, changed = io.BytesIO(), trace.copy()
        changed.data = change(np.rint(trace.data).astype("i4"))
        changed.write(waves, format="MSEED")
        how = Reading("EHZ", None, response, (0.5, 1.0, 20.0, 30.0))
        return list(read(waves.getvalue(), ".mseed", how).repairs)

    whole, name = xml.getvalue(), "BW.RJOB..EHZ"
    assert told(whole, lambda counts: counts) == []
    (said,) = told(whole, np.abs)
    assert said == f"{name} is on one side of zero and reaches it: minus signs may be lost"
    (said,) = told(whole, np.sort)
    assert said == f"{name} hardly turns: its samples may be sorted"
    for part, words in (
        (b"Imaginary", "poles or zeros of {} lack their conjugates: signs may be lost"),
        (b"Real", "poles of {} grow with time: signs may be lost"),
        (b"Numerator", FILTERED),
    ):
        lost = re.sub(b"(<%s[^>]*>)-" % part, rb"\1", whole)
        assert lost != whole
        said = told(lost, lambda counts: counts)
        assert any(re.fullmatch(words.format(re.escape(name)), one) for one in said), said
    first_gain = rb'(?s)(<Stage number="1">.*?<StageGain>\s*<Value>)'
    turned = re.sub(first_gain, rb"\1-", whole)
    assert turned != whole
    said = told(turned, lambda counts: counts)
    assert f"gains of {name} have another sign than its sensitivity: it may be turned round" in said
    both = re.sub(rb"(<InstrumentSensitivity>\s*<Value>)", rb"\1-", turned)
    assert not any("another sign" in one for one in told(both, lambda counts: counts))
    whole_numbers = re.sub(
        rb"(<Numerator[^>]*>)([^<]*)",
        lambda one: one[1] + str(4096.0 * float(one[2])).encode(),
        whole,
    )
    assert whole_numbers != whole
    assert told(whole_numbers, lambda counts: counts) == []


@pytest.mark.parametrize(
    "part", ["Response", "InstrumentSensitivity", "StageGain", "PolesZeros", "Decimation"]
)
def test_a_part_of_a_response_that_stands_twice_is_refused(part: str) -> None:
    """ObsPy takes the first."""
    obspy = pytest.importorskip("obspy")
    (trace,), xml, waves = obspy.read().select(channel="EHZ"), io.BytesIO(), io.BytesIO()
    obspy.read_inventory().write(xml, format="STATIONXML")
    trace.write(waves, format="MSEED")
    whole = xml.getvalue()
    first = re.search(b"<%s[ >].*?</%s>" % ((part.encode(),) * 2), whole, re.DOTALL)
    how = Reading("EHZ", None, whole.replace(first[0], 2 * first[0]), (0.5, 1.0, 20.0, 30.0))
    refusal(lambda: read(waves.getvalue(), ".mseed", how), f"2 {part} in a")


@pytest.mark.parametrize("number", [1, 9])
@pytest.mark.parametrize("part", ["Stage", "Pole", "Zero"])
def test_parts_of_a_response_are_counted_through(part: str, number: int) -> None:
    """One that stands there twice by its number, or after one that is lost."""
    obspy, xml = pytest.importorskip("obspy"), io.BytesIO()
    obspy.read_inventory().write(xml, format="STATIONXML")
    whole = xml.getvalue()
    instrument_response.check_stated_once(whole)
    first = next(n for n in (2, 3) if whole.count(f'<{part} number="{n}"'.encode()))
    before, after = (
        f'<{part} number="{n}"'.encode() for n in (first, first - 1 if number == 1 else number)
    )
    refusal(
        lambda: instrument_response.check_stated_once(whole.replace(before, after, 1)),
        f"{part} in a",
        "follow each other",
    )


@pytest.mark.parametrize(("least", "told"), [(0.5, 0), (-0.5, 1)])
def test_amplitudes_of_a_response_below_0_are_told(least: float, told: int) -> None:
    module = pytest.importorskip("obspy.core.inventory.response")
    listed = [module.ResponseListElement(hertz, least * hertz, 0.0) for hertz in (1.0, 2.0, 5.0)]
    units = 1, 1.0, 1.0, "M/S**2", "COUNTS"
    stage = module.ResponseListResponseStage(*units, response_list_elements=listed)
    found = list(instrument_response._doubts(module.Response(response_stages=[stage]), "HNE"))
    assert found == ["amplitudes of HNE are below 0, which its phases are for"] * told


@pytest.mark.parametrize("gap", [0.0, 0.2])
def test_a_response_that_changes_within_the_record_is_refused(gap: float) -> None:
    """Twice the gain from its middle on; another epoch of the same response is none."""
    obspy = pytest.importorskip("obspy")
    (trace,), inventory = obspy.read().select(channel="EHZ"), obspy.read_inventory()
    middle, waves = trace.stats.starttime + 15.0, io.BytesIO()
    parts = trace.slice(endtime=middle - gap), trace.slice(middle + 0.01 + gap)
    obspy.Stream(parts).write(waves, format="MSEED")
    (network,) = inventory.networks = inventory.select(station="RJOB", channel="EHZ").networks
    network.stations = network.stations[-1:]  # that of the record's time
    early = network[0][0]
    late = copy.deepcopy(early)
    network[0].channels, early.end_date, late.start_date = [early, late], middle, middle

    def taken() -> Record:
        xml = io.BytesIO()
        inventory.write(xml, format="STATIONXML")
        how = Reading("EHZ", None, xml.getvalue(), (0.5, 1.0, 20.0, 30.0))
        return read(waves.getvalue(), ".mseed", how)

    whole = taken().acceleration
    late.azimuth = 180.0
    refusal(taken, "BW.RJOB..EHZ", f"orientation since {middle}", "cut it there")
    late.azimuth = 0.0
    late.response.response_stages[-1].stage_gain *= 2.0
    late.response.instrument_sensitivity.value *= 2.0
    refusal(
        taken, "BW.RJOB..EHZ", f"another response or orientation since {middle}", "cut it there"
    )
    early.end_date = late.start_date = trace.stats.starttime  # as of the file of a day
    np.testing.assert_allclose(taken().acceleration, 0.5 * whole, rtol=1e-9)
    late.end_date = middle
    refusal(taken, "BW.RJOB..EHZ", f"not known from {middle} on")
    late.start_date, late.end_date = middle, None
    refusal(taken, "BW.RJOB..EHZ", f"not known from {trace.stats.starttime} on")
    late.start_date, late.end_date = trace.stats.starttime, middle
    late.end_date = early.end_date
    refusal(taken, "no channel of BW.RJOB..EHZ")


def of_counts(
    counts: np.ndarray,
    unit: str,
    step: float,
    without: slice,
    *stages: object,
    corners: tuple[float, ...] = (0.05, 0.1, 25.0, 35.0),
) -> Record:
    """The record of an instrument with a flat response of 1e6 counts, which left out a gap.

    Parameters
    ----------
    stages : of the response, after the flat one
    """
    obspy = pytest.importorskip("obspy")
    from obspy.core.inventory import Channel, Inventory, Network, Response, Station

    flat = Response.from_paz([], [], 1e6, input_units=unit, output_units="COUNTS")
    flat.instrument_sensitivity.value = 1e6  # which ObsPy gives per metre
    flat.response_stages += stages
    channel = Channel("HNE", "", 0.0, 0.0, 0.0, 0.0, sample_rate=1.0 / step, response=flat)
    station = Station("STA", 0.0, 0.0, 0.0, channels=[channel])
    xml, waves = io.BytesIO(), io.BytesIO()
    Inventory([Network("XX", [station])]).write(xml, format="STATIONXML")
    head = {"network": "XX", "station": "STA", "channel": "HNE", "delta": step}
    traces = [
        obspy.Trace(np.round(part).astype("i4"), head | {"starttime": start})
        for part, start in (
            (counts[: without.start], obspy.UTCDateTime(0)),
            (counts[without.stop :], obspy.UTCDateTime(0) + without.stop * step),
        )
    ]
    obspy.Stream(traces).write(waves, format="MSEED")
    return read(waves.getvalue(), ".mseed", Reading("HNE", None, xml.getvalue(), corners))


@pytest.mark.parametrize("unit", ["NM/S", "MM/S**2", "M/(SEC**2)", "m/s/s"])
def test_a_response_has_the_sensitivity_that_it_says_in_each_unit(unit: str) -> None:
    pytest.importorskip("obspy")
    from obspy.core.inventory.response import PolesZerosResponseStage

    def taken(*factor: float) -> Record:
        counts, laplace = np.sin(0.05 * np.arange(4000)), "LAPLACE (RADIANS/SECOND)"
        stages = [
            PolesZerosResponseStage(2, 1.0, 1.0, "COUNTS", "COUNTS", laplace, 1.0, [], [], one)
            for one in factor
        ]
        return of_counts(1e4 * counts, unit, 0.005, slice(400, 400), *stages)

    np.testing.assert_allclose(taken(1.0).acceleration, taken().acceleration)
    refusal(lambda: taken(1e3), "1e+03 times the sensitivity that it says, at 1 Hz")


@pytest.mark.parametrize("unit", ["RADIANS/SECOND", "HERTZ"])
def test_poles_and_zeros_are_one_where_they_say(unit: str) -> None:
    """A zero too many was divided out by ObsPy, which normalizes anew at the gain's frequency."""
    pytest.importorskip("obspy")
    stage, size = geophone(4.5, 0.7), {"RADIANS/SECOND": 1.0, "HERTZ": 2.0 * np.pi}[unit]
    mass, omega = mass_on_spring(4.5, 0.7), 10.0 * np.pi
    stage.normalization_frequency = 5.0  # and that of the gain is 1 Hz
    stage.normalization_factor = float(abs(np.polyval(mass, 1j * omega)) / omega**2)
    stage.pz_transfer_function_type = f"LAPLACE ({unit})"
    stage.poles = [pole / size for pole in stage.poles]
    counts, without = 1e4 * np.sin(0.05 * np.arange(4000)), ("M/S", 0.005, slice(400, 400))
    taken = of_counts(counts, *without, stage)
    np.testing.assert_allclose(
        taken.acceleration, of_counts(counts, *without, geophone(4.5, 0.7)).acceleration, rtol=1e-6
    )
    stage.zeros = [0.0, 0.0, 0.0]
    ratio = {"RADIANS/SECOND": "31.4", "HERTZ": "5"}[unit]
    refusal(lambda: of_counts(counts, *without, stage), f"zeros that are {ratio} at 5 Hz")


def test_a_response_that_is_zero_within_the_band_is_at_fault() -> None:
    """The mean of ten samples of 100 a second is nothing of 10 Hz, which 4020 of them tell."""
    pytest.importorskip("obspy")
    from obspy.core.inventory.response import CoefficientsTypeResponseStage

    keys = ("input_sample_rate", "factor", "offset", "delay", "correction")
    by = {f"decimation_{key}": value for key, value in zip(keys, (100, 1, 0, 0, 0), strict=True)}
    kinds = "COUNTS", "COUNTS", "DIGITAL"
    mean = CoefficientsTypeResponseStage(
        2, 1, 1, *kinds, numerator=[0.1] * 10, denominator=[], **by
    )
    counts = 1e4 * np.sin(0.05 * np.arange(4004))
    without = "M/S**2", 0.01, slice(400, 400)
    assert np.isfinite(of_counts(counts, *without).acceleration).all()
    refusal(lambda: of_counts(counts, *without, mean), "a response for XX.STA..HNE that is zero")


def test_upper_corners_end_where_a_digitizers_filter_has_fallen() -> None:
    """To 1e-7, and the last digits of the counts were 500 times the PGA."""
    pytest.importorskip("obspy")
    from obspy.core.inventory.response import FIRResponseStage

    taps, late = firwin(201, 42.0, window=("kaiser", 13.0), fs=200.0), 100 / 200.0
    keys = ("input_sample_rate", "factor", "offset", "delay", "correction")
    by = {
        f"decimation_{key}": one for key, one in zip(keys, (200.0, 2, 0, late, late), strict=True)
    }
    fir = FIRResponseStage(2, 1.0, 1.0, "COUNTS", "COUNTS", coefficients=taps.tolist(), **by)
    time = 0.005 * np.arange(8000)
    shaking = 0.02 * np.exp(-(((time - 20.0) / 2.0) ** 2)) * np.sin(16.0 * np.pi * time)
    counts = 1e6 * np.convolve(shaking, taps, "same")[::2]

    def taken(*corners: float, stage: object = fir) -> np.ndarray:
        record = of_counts(counts, "M/S**2", 0.01, slice(400, 400), stage, corners=corners)
        return record.acceleration

    with pytest.raises(InvalidInput, match="lower") as caught:
        taken(0.05, 0.1, 45.0, 50.0)
    hertz = float(re.search(r"from ([\d.]+) Hz on", str(caught.value))[1])
    assert abs(freqz(taps, worN=[hertz], fs=200.0)[1][0]) == pytest.approx(0.1, rel=0.2)
    for ends in ((25.0, 35.0), (30.0, hertz)):
        error = np.abs(taken(0.05, 0.1, *ends) - shaking[::2]).max()
        assert error < 1e-3 * shaking.max(), (ends, error)
    refusal(lambda: taken(0.05, 0.1, 60.0, 80.0), "end at 80 Hz", "less than 10%")
    refusal(lambda: taken(47.0, 48.9, 49.0, 49.3), "end at 49.3 Hz", "less than 10%")
    refusal(lambda: taken(60.0, 70.0, 80.0, 90.0), "above 70 Hz", "tells up to 50 Hz")
    # of a geophone, long periods may be asked
    assert np.isfinite(taken(0.05, 0.1, 25.0, 35.0, stage=geophone(4.5, 0.7))).all()


def geophone(hertz: float, damping: float) -> object:
    """The second stage of its response, which is 1 at 1 Hz."""
    from obspy.core.inventory.response import PolesZerosResponseStage

    mass = mass_on_spring(hertz, damping)
    poles, one = [complex(pole) for pole in np.roots(mass)], above_one_hertz(mass)
    laplace = "LAPLACE (RADIANS/SECOND)"
    return PolesZerosResponseStage(
        2, 1.0, 1.0, "COUNTS", "COUNTS", laplace, 1.0, [0.0, 0.0], poles, one
    )


def mass_on_spring(hertz: float, damping: float) -> list[float]:
    omega = 2.0 * np.pi * hertz
    return [1.0, 2.0 * damping * omega, omega**2]


def above_one_hertz(mass: list[float]) -> float:
    """How much more a geophone tells of high frequencies."""
    return float(abs(np.polyval(mass, 2j * np.pi)) / (2.0 * np.pi) ** 2)


@pytest.mark.parametrize("hertz", [4.5, 1.0])
@pytest.mark.parametrize("till", [30.0, 30.04, 30.08])
def test_a_geophones_record_cut_in_its_coda_tells_the_pgv(hertz: float, till: float) -> None:
    """Counts of its mass on a spring. Ends of 10 s made of them up to 12 times the PGV."""
    pytest.importorskip("obspy")
    time = 0.001 * np.arange(round(1000 * till))
    swell, coda = np.exp(-(((time - 8.0) / 2.0) ** 2)), np.tanh((time - 8.0) / 2.0)
    envelope = swell + 0.025 * (1.0 + coda)
    changes = -0.5 * (time - 8.0) * swell + 0.0125 * (1.0 - coda**2)
    omega = 6.0 * np.pi
    velocity = envelope * np.sin(omega * time)
    truth = changes * np.sin(omega * time) + omega * envelope * np.cos(omega * time)
    mass = mass_on_spring(hertz, 0.56)
    seen = 1e6 * above_one_hertz(mass) * lsim(([1.0, 0.0, 0.0], mass), velocity, time)[1][::10]
    stage = geophone(hertz, 0.56)
    found = of_counts(seen, "M/S", 0.01, slice(400, 400), stage).acceleration
    assert np.abs(found).max() == pytest.approx(truth.max(), rel=0.05)
    told = 0.01 * np.abs(np.cumsum(found)).max()
    assert told == pytest.approx(velocity.max(), rel=0.05)


@pytest.mark.parametrize("off", [[8e4], [8e4, 8e4], [-32768.0]])
@pytest.mark.parametrize("unit", ["M/S**2", "M/S"])
def test_samples_that_are_none_are_looked_for_before_the_response(
    unit: str, off: list[float]
) -> None:
    """Divided by it and tapered at 25 Hz, they are smooth pulses of 2 to 30 times the PGA."""
    time = 0.005 * np.arange(4000)
    seen = 1e4 * np.exp(-(((time - 10.0) / 2.0) ** 2)) * np.sin(4.0 * np.pi * time)
    assert of_counts(seen, unit, 0.005, slice(400, 400)).acceleration.size == 4000
    clipped = np.clip(seen, -7e3, 7e3) + np.random.default_rng(5).integers(-3, 4, 4000)
    said = "extreme (counts of HNE)"
    refusal(lambda: of_counts(clipped, unit, 0.005, slice(400, 400)), said)
    seen[800 : 800 + len(off)] = off
    refusal(lambda: of_counts(seen, unit, 0.005, slice(400, 400)), "(counts of HNE) at 4 s")


@pytest.mark.parametrize("unit", ["M/S**2", "M/S"])
@pytest.mark.parametrize("gap", [0, 3])
def test_removing_a_response_silences_no_shaking(gap: int, unit: str) -> None:
    """It shakes at 5 s of 300, beside a gap."""
    counts, step = 1e6, 0.01
    time = step * np.arange(30_000)
    swell, omega = 2.0 * np.exp(-(((time - 5.0) / 0.7) ** 2)), 8.0 * np.pi
    seen = shaking = swell * np.sin(omega * time)
    if unit == "M/S":
        turning = omega * np.cos(omega * time)
        shaking = swell * (turning - 2.0 * (time - 5.0) / 0.7**2 * np.sin(omega * time))
    first, after = 460, 460 + gap
    found = of_counts(counts * seen, unit, step, slice(first, after)).acceleration
    missing = np.isnan(found)
    assert np.flatnonzero(missing).tolist() == list(range(first, after))
    error = np.abs(found - shaking)[~missing].max()
    assert error < 0.01 * shaking.max(), error / shaking.max()


def example(folder: str, name: str) -> bytes:
    """A file of ObsPy's own tests."""
    obspy = pytest.importorskip("obspy")
    path = Path(obspy.__file__).parent / folder / "tests" / "data" / name
    if not path.is_file():
        pytest.skip("this ObsPy came without its test data")
    return path.read_bytes()


def test_obspys_example_of_knet_is_what_its_text_says() -> None:
    content = example("io/nied", "test.knet")
    found = read(content, ".EW", PLAIN)
    lines = content.decode().splitlines()
    counts = np.array(" ".join(lines[17:]).split(), dtype=float)
    np.testing.assert_allclose(found.acceleration, counts * 0.01 * 2000.0 / 8388608.0, rtol=1e-12)
    assert (found.interval, found.station) == (0.01, "AKT013")
    assert "gal" in found.unit
    peak = 100.0 * np.abs(found.acceleration - found.acceleration.mean()).max()
    assert lines[14].split() == ["Max.", "Acc.", "(gal)", f"{peak:.3f}"]
    refusal(lambda: read(content, ".EW", Reading(unit="g")), "motion.unit g")


def test_obspys_example_of_sac_is_what_its_bytes_say() -> None:
    content = example("realtime", "II.TLY.BHZ.SAC")
    order = "<" if np.frombuffer(content, "<i4", 1, 4 * 76)[0] == 6 else ">"  # NVHDR
    number = int(np.frombuffer(content, f"{order}i4", 1, 4 * 79)[0])
    samples = np.frombuffer(content, f"{order}f4", number, 632)
    found = read(content, ".sac", Reading(unit="cm/s2"))
    exact = 0.01 * samples.astype(float)
    np.testing.assert_allclose(found.acceleration, exact, rtol=1e-12)
    assert any("rounded" in repair for repair in found.repairs)  # 50.00016 ms to 50 ms
    assert found.interval == pytest.approx(
        float(np.frombuffer(content, f"{order}f4", 1)[0]), rel=1e-5
    )
    assert found.station == "TLY"
    assert found.channels == ("BHZ",)


def test_obspys_examples_of_miniseed_with_a_gap_and_with_two_channels() -> None:
    obspy = pytest.importorskip("obspy")
    gaps = example("io/mseed", "gaps.mseed")
    pieces = obspy.read(io.BytesIO(gaps))
    found = read(gaps, ".mseed", Reading(unit="m/s2"))
    missing = np.isnan(found.acceleration)
    assert missing.any()
    assert (~missing).sum() == sum(len(piece) for piece in pieces)
    refusal(lambda: repaired(found), "gap")
    two = example("io/mseed", "two_channels.mseed")
    names = sorted({trace.stats.channel for trace in obspy.read(io.BytesIO(two))})
    assert len(names) == 2
    refusal(lambda: read(two, ".mseed", Reading(unit="m/s2")), *names, "motion.component")
    one = read(two, ".mseed", Reading(names[0], "m/s2"))
    assert one.channels == (names[0],)
    refusal(lambda: read(two, ".mseed", Reading(names[0], "counts")), "counts")


def test_what_obspy_warns_of_is_told() -> None:
    def said(content: bytes) -> list[str]:
        found = read_all(content, ".mseed", Reading(unit="gal"))
        return [repair for repair in found.repairs if repair.startswith("ObsPy: ")]

    odd = example("io/mseed", "wrong_blockette_numbers_specified.mseed")
    warned = said(b"".join(odd.replace(b"HHZ", b"HH%d" % channel) for channel in range(5)))
    assert len(warned) == 4
    assert "Number of blockettes" in warned[0]
    assert "2 more warnings" in warned[-1]
    assert said(example("io/mseed", "test.mseed")) == []


def miniseed(length: int) -> bytes:
    """80 s in records of so many bytes."""
    obspy = pytest.importorskip("obspy")
    waves = io.BytesIO()
    shaking = obspy.Trace(np.sin(0.1 * np.arange(8000.0)), {"delta": STEP, "channel": "HNE"})
    shaking.write(waves, format="MSEED", reclen=length)
    return waves.getvalue()


@pytest.mark.parametrize("length", [512, 4096])
def test_bytes_that_are_no_records_of_a_miniseed_are_refused(length: int) -> None:
    """ObsPy takes what stands before them, of some lengths without a warning."""
    whole, how = miniseed(length), Reading(unit="m/s2")
    end = len(whole) // (3 * length) * length
    for rest in (1, 47, 48, 60, 128, 300, length // 2, length - 1):
        told = f"{end + rest} bytes whose records end at byte"
        refusal(lambda cut=end + rest: read(whole[:cut], ".mseed", how), told, "download it again")
    for filler in (b"\0", b" ", b"<"):  # a download whose room was made beforehand
        filled = whole[:end] + filler * (len(whole) - end)
        told = f"records end at byte {end}"
        refusal(lambda content=filled: read(content, ".mseed", how), told)
    assert len(read(whole[:end], ".mseed", how).acceleration) < 8000  # nothing of it tells


def test_a_rate_far_from_that_of_its_header_is_refused() -> None:
    """Of a blockette 100, which has the actual one; that of the header is in whole numbers."""
    obspy, waves = pytest.importorskip("obspy"), io.BytesIO()
    about = {"sampling_rate": 99.7123, "channel": "HNE"}
    obspy.Trace(np.sin(0.1 * np.arange(4000.0)), about).write(waves, format="MSEED", reclen=512)
    whole, how = bytearray(waves.getvalue()), Reading(unit="m/s2")
    assert read(bytes(whole), ".mseed", how).interval == pytest.approx(1 / 99.7123, rel=1e-6)
    for number, rate in ((200, 200.0), (-2, 0.5), (50, 50.0)):  # a negative one divides
        for at in range(0, len(whole), 512):
            whole[at + 32 : at + 36] = struct.pack(">hh", number, 1)
        words = f"99.7123 samples a second, whose header says {rate:g}"
        refusal(lambda: read(bytes(whole), ".mseed", how), words)


def test_records_of_miniseed_without_samples_are_passed_over() -> None:
    """One that is blank but for its number, and one whose header says that it has none."""
    whole, how = miniseed(512), Reading(unit="m/s2")
    sound = read(whole, ".mseed", how)
    none = bytearray(whole[:512])
    none[30:32] = b"\0\0"
    for more in (b"001002" + b" " * 506, b"001002D" + b" " * 505, bytes(none)):
        found = read(whole + more, ".mseed", how)
        np.testing.assert_array_equal(found.acceleration, sound.acceleration)


@pytest.mark.parametrize("encoding", ["STEIM1", "STEIM2"])
def test_a_miniseed_that_contradicts_its_last_sample_is_refused(encoding: str) -> None:
    """Each sample is a difference to the one before: one that is wrong shifts all that follow."""
    obspy = pytest.importorskip("obspy")
    waves, how = io.BytesIO(), Reading(unit="m/s2")
    counts = np.round(1e4 * np.sin(0.1 * np.arange(2000.0))).astype("i4")
    shaking = obspy.Trace(counts, {"delta": STEP, "channel": "HNE"})
    shaking.write(waves, format="MSEED", encoding=encoding, reclen=4096)
    content = bytearray(waves.getvalue())
    read(bytes(content), ".mseed", how)
    content[1000] ^= 1
    refusal(lambda: read(bytes(content), ".mseed", how), "contradict the last one")


@pytest.mark.parametrize("encoding", ["STEIM1", "STEIM2", "INT32", "FLOAT64"])
def test_a_flipped_bit_in_how_a_record_is_laid_out_is_refused_or_told(encoding: str) -> None:
    """Of its encoding, its length and where its data begin, in any record: samples are lost."""
    obspy = pytest.importorskip("obspy")
    waves, how = io.BytesIO(), Reading(unit="m/s2")
    counts = np.round(1e4 * np.sin(0.1 * np.arange(3000.0)))
    shaking = obspy.Trace(counts.astype("f8" if encoding == "FLOAT64" else "i4"), {"delta": STEP})
    shaking.stats.channel = "HNE"
    shaking.write(waves, format="MSEED", encoding=encoding, reclen=512)
    whole = waves.getvalue()
    sound = read(whole, ".mseed", how)
    assert sound.repairs == ()
    for record in (0, 1, len(whole) // 512 - 1):
        for byte, bit in itertools.product((44, 45, 52, 54), range(8)):
            content = bytearray(whole)
            content[512 * record + byte] ^= 1 << bit
            try:
                found = read(bytes(content), ".mseed", how)
            except InvalidInput:
                continue
            if byte < 46:  # where data begin: a record that cannot be read there is not dropped
                assert len(found.acceleration) == len(sound.acceleration)
            if "a header may be damaged" not in "".join(found.repairs):
                np.testing.assert_array_equal(found.acceleration, sound.acceleration)


def test_a_sac_file_of_text_that_is_cut_is_refused() -> None:
    obspy = pytest.importorskip("obspy")
    text, how = io.BytesIO(), Reading(unit="m/s2")
    obspy.Trace(VALUES, {"delta": STEP, "channel": "HNE"}).write(text, format="SACXY")
    whole = text.getvalue()
    assert len(read(whole, ".sac", how).acceleration) == len(VALUES)
    for lost in (1, 2, 5, 9):
        refusal(lambda cut=whole[:-lost]: read(cut, ".sac", how), "last line has no end")


def test_records_of_several_lengths_are_whole() -> None:
    both = miniseed(4096) + miniseed(512).replace(b"HNE", b"HNN")
    assert read_all(both, ".mseed", Reading(unit="m/s2")).acceleration.shape == (8000, 2)


@pytest.mark.parametrize("place", [512 * 5, None])
def test_a_miniseed_may_have_records_without_data(place: int | None) -> None:
    whole, how = miniseed(512), Reading(unit="m/s2")
    assert len(whole) > 512 * 6
    place = len(whole) if place is None else place
    cut = whole[:place] + b"000099D ".ljust(300) + whole[place:]
    refusal(lambda: read(cut, ".mseed", how), f"records end at byte {place}")
    more = whole[:place] + b"000099D ".ljust(512) + whole[place:]
    np.testing.assert_array_equal(
        read(more, ".mseed", how).acceleration, read(whole, ".mseed", how).acceleration
    )


@pytest.mark.parametrize("late", [0.4, -0.3, 0.1])
def test_records_that_drift_from_their_rate_are_refused(late: float) -> None:
    obspy = pytest.importorskip("obspy")
    waves = io.BytesIO()
    for first in range(0, 400, 20):
        begun = obspy.UTCDateTime(2020, 1, 1) + first * STEP * (1.0 + late / 20.0)
        about = {"delta": STEP, "channel": "HNE", "starttime": begun}
        obspy.Trace(VALUES[first : first + 20], about).write(waves, format="MSEED", reclen=512)
    told = f"HNE that begin {19 * late:+.1f} samples off their rate"
    refusal(lambda: read(waves.getvalue(), ".mseed", Reading(unit="m/s2")), told)


def test_obspys_broken_examples_are_refused() -> None:
    seed = example("io/mseed", "two_channels.mseed")
    refusal(lambda: read(seed[:200], ".mseed", Reading(unit="m/s2")), "ObsPy cannot read")
    cut = example("io/mseed", "brokenlastrecord.mseed")
    refusal(lambda: read(cut, ".mseed", Reading(unit="m/s2")), "records end at byte 4096")


# Checks


def test_a_sound_record_is_left_alone() -> None:
    before = record(VALUES)
    assert repaired(before) is before


@pytest.mark.parametrize("limit", [0.5, 0.9])
def test_clipping_is_refused(limit: float) -> None:
    top = limit * VALUES.max()
    refusal(lambda: repaired(record(np.minimum(VALUES, top))), "in a row", "clipped")
    refusal(lambda: repaired(record(np.maximum(VALUES, -top))), "in a row", "clipped")


@pytest.mark.parametrize("limit", [0.3, 0.5])
@pytest.mark.parametrize("size", [1e-5, 1e-4, 1e-3])
def test_clipping_that_flickers_or_leans_is_refused(size: float, limit: float) -> None:
    """By the last digits, or as a line was taken off."""
    most = limit * np.abs(VALUES).max()
    flat, clipped = np.clip(VALUES, -most, most), np.abs(VALUES) > most
    flickers = np.random.default_rng(3).integers(-2, 3, len(VALUES)) * size * most
    refusal(lambda: repaired(record(flat + clipped * flickers)), "in a row", "clipped")
    line = np.linspace(-size, size, len(VALUES)) * most
    refusal(lambda: repaired(record(flat - line)), "in a row", "clipped")


def test_clipping_at_zero_is_refused_where_that_is_no_rest() -> None:
    """As of a digitizer without a sign: the record rests at more than zero."""
    most = np.abs(VALUES).max()
    assert repaired(record(VALUES + most)) is not None
    refusal(lambda: repaired(record(np.maximum(VALUES + 0.3 * most, 0.0))), "in a row", "clipped")


@pytest.mark.parametrize("steps", [50, 100, 1000])
@pytest.mark.parametrize("limit", [0.3, 0.5])
def test_clipping_is_refused_of_few_digits(steps: int, limit: float) -> None:
    """Within ten steps of a top lie many samples of the flanks."""
    time = np.arange(0.0, 12.0, 0.005)
    rounded = np.sin(np.pi * time / 12.0) ** 4 * (np.sin(9.0 * time) + np.sin(21.0 * time)) / 2.0
    whole = np.round(rounded / np.abs(rounded).max() * steps / limit)
    assert repaired(record(whole * limit / steps, 0.005)) is not None
    refusal(lambda: repaired(record(np.clip(whole, -steps, steps) / steps, 0.005)), "clipped")


@pytest.mark.parametrize("width", [0.1, 0.3, 1.0])
@pytest.mark.parametrize("step", [0.001, 0.005, 0.02])
def test_a_pulse_that_is_sampled_often_is_not_clipped(step: float, width: float) -> None:
    """A half sine with rest before and after, and a cosine whose top is flattest."""
    time = np.arange(0.0, 10.0, step)
    half = np.where(np.abs(time - 2.0) < width, np.cos(0.5 * np.pi * (time - 2.0) / width), 0.0)
    flattest = np.cos(time / width) - 0.25 * np.cos(2.0 * time / width)  # no curvature
    for pulse in (half, half[np.abs(time - 2.0) < 1.4 * width], flattest, -flattest):
        assert repaired(record(pulse, step)) is not None


@pytest.mark.parametrize("written", [".2e", ".3g", ".5g"])
@pytest.mark.parametrize("period", [0.5, 2.0])
@pytest.mark.parametrize("step", [0.001, 0.005])
def test_a_pulse_that_is_written_with_so_many_digits_is_not_clipped(
    written: str, period: float, step: float
) -> None:
    """Near zero its steps are smaller than the last digit of its peak."""
    time = np.arange(0.0, period, step)
    whole = np.sin(2.0 * np.pi * time / period) * np.sin(np.pi * time / period)
    for peak in (0.98, 2.3, 4.9, 9.81):
        rounded = np.array([float(f"{peak * one:{written}}") for one in whole / whole.max()])
        assert repaired(record(rounded, step)) is not None
        cut = np.clip(rounded, -0.5 * peak, 0.5 * peak)
        refusal(lambda cut=cut: repaired(record(cut, step)), "in a row", "clipped")


@pytest.mark.parametrize("digits", [3, 9])
def test_a_record_of_few_digits_is_refused(digits: int) -> None:
    """Also with an offset, or in a unit of which its last digit is no power of ten."""
    few = np.round(VALUES / np.abs(VALUES).max() * digits)
    said = f"{digits} from rest to peak"
    for one in (few, 0.013 * few, few + 0.3 * digits):
        refusal(lambda one=one: repaired(record(one)), "in steps of", said, "more digits")
    assert repaired(record(np.round(VALUES / np.abs(VALUES).max() * 30))) is not None
    wave = np.sin(0.25 * np.pi * np.arange(400))  # of three values and their negatives, not rounded
    assert repaired(record(wave)) is not None


@pytest.mark.parametrize("number", [6, 10, 30])
@pytest.mark.parametrize("steps", [300, 1e6])
def test_gaps_that_were_filled_are_refused(number: int, steps: float) -> None:
    """By the value before them or by zeros, soon after the peak."""
    rounded = np.round(VALUES / np.abs(VALUES).max() * steps) / steps
    start = int(np.abs(rounded).argmax()) + 2
    held, zeros = rounded.copy(), rounded.copy()
    held[start : start + number] = held[start - 1]
    zeros[start : start + number] = 0.0
    said = f"from {(start - 1) * STEP:.4g} s on, amid shaking"
    refusal(lambda: repaired(record(held)), f"{number + 1} samples in a row", said, "gap")
    refusal(lambda: repaired(record(zeros)), f"{number} samples in a row of 0 (m/s2)", "amid")


@pytest.mark.parametrize("step", [0.002, 0.01])
def test_rest_between_pulses_is_no_gap(step: float) -> None:
    """Sines, half sines, and cosines, which begin at a peak."""
    phase = np.arange(0.0, 12.0, step) % 2.0 / 0.5
    for pulse in (np.sin(2 * np.pi * phase), np.sin(np.pi * phase), np.cos(2 * np.pi * phase)):
        at_rest = record(np.where(phase < 1.0, pulse, 0.0), step)
        assert repaired(at_rest) is at_rest


def test_an_aftershock_appended_after_zeros_is_no_gap() -> None:
    """Both of noise that swells and fades, to 1 % of its peak where the zeros begin and end."""
    rng, slow = np.random.default_rng(8), np.hanning(41)
    for _ in range(40):
        fading = np.exp(-0.004 * np.abs(np.arange(2400.0) - 1200.0))
        shocks = [fading * np.convolve(rng.normal(size=2400), slow, "same") for _ in "ab"]
        both = record(np.concatenate([shocks[0], np.zeros(2000), shocks[1]]))
        assert repaired(both) is both


def test_counts_that_stay_the_same_in_quiet_are_no_gap() -> None:
    rng = np.random.default_rng(4)
    swell = 3000.0 * np.exp(-0.01 * np.maximum(np.arange(6000) - 2000, 0.0))
    swell[:2000] = 0.0
    counts = record(np.round(swell * np.sin(0.3 * np.arange(6000)) + 0.4 * rng.normal(size=6000)))
    assert repaired(replace(counts, acceleration=0.001 * counts.acceleration)) is not None


@pytest.mark.parametrize("places", [[100], [37, 251], [100, 101], [0], [399]])
@pytest.mark.parametrize(("mark", "unit"), [(-999.0, "gal"), (999.99, "cm/s2"), (-9999.0, "mm/s2")])
def test_marks_of_missing_samples_are_no_samples(places: list[int], mark: float, unit: str) -> None:
    marked = VALUES.copy()
    marked[places] = mark * factor(unit)
    said = f"{mark:g} ({unit}) at {places[0] * STEP:g} s"
    refusal(lambda: repaired(replace(record(marked), unit=unit)), said, "leave out")


def test_a_peak_that_happens_to_be_all_nines_is_one() -> None:
    one = replace(record(9.99 * VALUES / VALUES.max()), unit="gal")
    assert repaired(one) is one


@pytest.mark.parametrize("places", [[0], [100], [37, 251], [100, 101], [399]])
@pytest.mark.parametrize("times", [-6.0, 6.0, 20.0])
def test_a_lone_sample_far_beyond_the_others_is_none(places: list[int], times: float) -> None:
    spiked = 0.1 * VALUES
    spiked[places] = times * np.abs(spiked).max()
    refusal(lambda: repaired(record(spiked)), f"at {places[0] * STEP:g} s", "leave it out")
    text = files.knet(spiked, STEP).encode()  # in a unit by its scale factor
    refusal(lambda: repaired(read(text, ".NS", PLAIN)), "far beyond what is beside it")


@pytest.mark.parametrize("seed", range(20))
def test_what_shakes_as_fast_as_it_is_sampled_is_no_spike(seed: int) -> None:
    noise = record(np.random.default_rng(seed).normal(size=400))
    assert repaired(noise) is noise


def test_a_smooth_top_of_rounded_samples_is_no_clipping() -> None:
    t = np.arange(4000) * 0.001
    smooth = np.round(np.cos(2.0 * np.pi * t), 4)  # five in a row at the very top
    assert (smooth == 1.0).sum() > 10
    assert repaired(record(smooth, 0.001)) is not None


def test_short_gaps_are_bridged_and_long_ones_refused() -> None:
    holed = VALUES.copy()
    holed[100:103] = np.nan
    holed[:2] = holed[-1] = np.inf
    found = repaired(record(holed))
    assert len(found.acceleration) == 397
    line = np.interp([100, 101, 102], [99, 103], VALUES[[99, 103]])
    np.testing.assert_allclose(found.acceleration[98:101], line)
    assert np.array_equal(found.acceleration[:98], VALUES[2:100])
    said = " | ".join(found.repairs)
    assert "3 missing samples at the ends were cut" in said
    assert "3 missing samples at 1 s were bridged" in said
    holed[200:206] = np.nan
    refusal(lambda: repaired(record(holed)), "a gap of 6 samples, 0.06 s, at 2 s", "cut")
    refusal(lambda: repaired(record(np.full(50, np.nan))), "without a number")


@pytest.mark.parametrize("unit_error", [100.0, GRAVITY * 3, 1e-8])
def test_a_wrong_unit_shows_in_the_pga(unit_error: float) -> None:
    wrong = record(VALUES * unit_error)
    if 1e-6 <= np.abs(wrong.acceleration).max() / GRAVITY <= 5.0:
        pytest.fail("the case shows nothing")
    refusal(lambda: repaired(wrong), "a PGA of", "motion.unit", "gal")


def test_an_offset_is_no_pga() -> None:
    assert repaired(record(VALUES + 60.0)).acceleration.max() > 5.0 * GRAVITY


def test_nothing_that_moves_is_refused() -> None:
    refusal(lambda: repaired(record(np.full(100, 0.3))), "all alike")


def test_drift_is_refused() -> None:
    pulse = CosinePulse.from_g(0.3, 0.2)
    t = np.arange(0.0, pulse.duration, 0.001)
    level = Trace(pulse.acceleration(t), 0.001)
    check_rest(level)
    refusal(lambda: check_rest(Trace(level.acceleration + 0.05, 0.001)), "PGV", "highpass")
    half = Trace(pulse.acceleration(t[: len(t) // 2]), 0.001)  # stops, but elsewhere
    refusal(lambda: check_rest(half), "100% of its PGD")


def test_a_motion_taken_as_it_was_made_rests_in_the_end() -> None:
    """A push does too, that leaves a velocity."""
    push = 2.3 * (np.arange(600) < 300)
    for values in (VALUES, push, VALUES + 0.005 * np.abs(VALUES).max()):
        assert check_end(Trace(values, STEP)) == ()
    refusal(lambda: check_end(Trace(VALUES + 3.0, STEP)), "ends with 0.3", "offset")
    share = 0.05 * float(np.abs(VALUES).max())
    (told,) = check_end(Trace(VALUES + share, STEP))
    assert "ends with 0.012 g, 5% of its PGA" in told


def test_units() -> None:
    assert factor("g") == GRAVITY
    for counts in ("counts", "V"):
        refusal(lambda c=counts: factor(c), counts, "response")


# One motion: acceleration, velocity, displacement


samples = arrays.arrays(
    np.float64, st.integers(2, 40), elements=st.floats(-20.0, 20.0, allow_subnormal=False)
)
steps = st.floats(1e-3, 0.1)


@settings(max_examples=60, deadline=None)
@given(samples, steps, st.floats(0.0, 1.0))
def test_velocity_and_displacement_are_exact_integrals(values, step: float, share: float) -> None:
    motion = RecordedMotion(Trace(values, step))
    t = share * motion.duration
    knots = np.append(np.arange(math.floor(t / step) + 1) * step, t)
    mids = 0.5 * (knots[1:] + knots[:-1])
    width = np.diff(knots)
    line = lambda x: np.interp(x, motion.trace.times, values)  # noqa: E731
    simpson = (width / 6.0) * (line(knots[:-1]) + 4.0 * line(mids) + line(knots[1:]))
    scale = 20.0 * max(t, step)
    assert float(motion.velocity(np.array([t]))[0]) == pytest.approx(
        simpson.sum(), abs=1e-9 * scale
    )
    v = motion.velocity(np.concatenate([knots, mids]))
    v_knots, v_mids = v[: len(knots)], v[len(knots) :]
    way = (width / 6.0) * (v_knots[:-1] + 4.0 * v_mids + v_knots[1:])  # exact for a parabola
    found = float(motion.displacement(np.array([t]))[0])
    assert found == pytest.approx(way.sum(), abs=1e-9 * scale * max(t, step))


def test_outside_the_record_the_table_rests() -> None:
    motion = RecordedMotion(Trace(VALUES, STEP))
    outside = np.array([-1.0, motion.duration + 1.0])
    assert motion.acceleration(outside).tolist() == [0.0, 0.0]
    assert motion.velocity(outside).tolist() == [0.0, 0.0]
    assert motion.displacement(outside).tolist() == [0.0, motion.trace.displacement[-1]]
    assert motion.acceleration(motion.trace.times) == pytest.approx(VALUES)


def test_motions_are_told_apart_by_identity() -> None:
    one = Trace(VALUES, STEP)
    first, second = RecordedMotion(one), RecordedMotion(one)
    assert first == first
    assert first != second
    assert len({first, second}) == 2
    with pytest.raises(AttributeError):
        first.trace = one  # type: ignore[misc]


@pytest.mark.parametrize("pga", [0.05, 0.4, 2.0])
def test_scaling_keeps_the_shape(pga: float) -> None:
    motion = RecordedMotion.scaled(Trace(-VALUES, STEP), pga)
    assert motion.peak_acceleration == pytest.approx(pga * GRAVITY, rel=1e-12)
    ratio = motion.trace.acceleration[100] / -VALUES[100]
    assert ratio > 0.0  # which way the first push goes matters to a rock
    np.testing.assert_allclose(motion.trace.displacement, ratio * Trace(-VALUES, STEP).displacement)


def test_a_sampled_pulse_is_the_pulse() -> None:
    pulse = CosinePulse.from_g(0.4, 0.3)
    number = 4000
    step = pulse.duration / number
    motion = RecordedMotion(Trace(pulse.acceleration(np.arange(number + 1) * step), step))
    t = np.linspace(0.0, pulse.duration, 777)
    for name in ("acceleration", "velocity", "displacement"):
        exact = getattr(pulse, name)(t)
        # a chord is off by (h/r)^2 / 8 of the peak
        np.testing.assert_allclose(
            getattr(motion, name)(t), exact, atol=(step / 0.3) ** 2 / 6 * np.abs(exact).max()
        )


# Processing


def test_none_does_nothing() -> None:
    found = process(VALUES, STEP, Processing("none", None, None))
    assert np.array_equal(found.acceleration, VALUES)


@pytest.mark.parametrize("poles", [2, 4, 5])
@pytest.mark.parametrize(("kind", "corner"), [("lowpass", 5.0), ("highpass", 2.0)])
def test_two_passes_halve_the_corner_and_keep_the_phase(
    poles: int, kind: str, corner: float
) -> None:
    t = np.arange(20000) * 0.005
    for hertz in (corner, 0.5 * corner, 2.0 * corner):
        found = processing.filtered(np.sin(2.0 * np.pi * hertz * t), 0.005, kind, corner, poles)
        middle = slice(8000, 12000)
        inside, outside = (
            np.sin(2 * np.pi * hertz * t[middle]),
            np.cos(2 * np.pi * hertz * t[middle]),
        )
        gain = 2.0 * np.mean(found[middle] * inside)
        # Butterworth by the bilinear transform, whose frequencies are tan(pi f h)
        warped = math.tan(math.pi * hertz * 0.005) / math.tan(math.pi * corner * 0.005)
        order = 2 * poles if kind == "lowpass" else -2 * poles
        assert gain == pytest.approx(1.0 / (1.0 + warped**order), abs=1e-6)
        assert np.mean(found[middle] * outside) == pytest.approx(0.0, abs=1e-6)


def test_papers_order_is_the_high_passed_velocity() -> None:
    how = Processing("paper", 0.5, 20.0)
    found = process(VALUES, STEP, how)
    pad = processing.pad_length(how, STEP)
    assert pad * STEP * 2.0 == pytest.approx(1.5 * 4 / 0.5, abs=2.1 * STEP)
    low = processing.filtered(np.pad(VALUES, pad), STEP, "lowpass", 20.0, 4)
    literal = processing.filtered(Trace(low, STEP).velocity, STEP, "highpass", 0.5, 4)
    # the same but for what runs out of the ends of the zeros
    gap = np.abs(found.velocity - literal).max() / np.abs(literal).max()
    assert gap < 2e-3
    longer = replace(how, poles=4)
    far = np.pad(VALUES, 5 * pad)
    low = processing.filtered(far, STEP, "lowpass", 20.0, 4)
    literal = processing.filtered(Trace(low, STEP).velocity, STEP, "highpass", 0.5, longer.poles)
    ours = Trace(processing.filtered(low, STEP, "highpass", 0.5, 4), STEP).velocity
    np.testing.assert_allclose(ours, literal, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5))
def test_baseline_takes_a_polynomial_away_and_nothing_else(weights) -> None:
    t = np.linspace(0.0, 1.0, 2000)
    drift = sum(w * k * (k - 1) * t ** (k - 2) for w, k in zip(weights, range(2, 7), strict=True))
    swing = np.sin(2.0 * np.pi * 40.0 * t) * np.exp(-0.5 * ((t - 0.5) / 0.05) ** 2)
    step = 4.0 / 1999
    cleaned = processing.with_level_baseline(swing + drift, step)
    alone = processing.with_level_baseline(swing, step)
    np.testing.assert_allclose(cleaned, alone, atol=1e-9)
    nothing = processing.with_level_baseline(drift, step)
    assert np.abs(nothing).max() < 1e-9


def test_standard_order_takes_offset_and_slope_away() -> None:
    how = Processing("standard", 0.5, 25.0)
    t = np.arange(len(VALUES)) * STEP
    plain, tilted = (process(v, STEP, how) for v in (VALUES, VALUES + 0.7 + 0.3 * t))
    np.testing.assert_allclose(tilted.acceleration, plain.acceleration, atol=1e-9)
    check_rest(plain)
    powers = np.column_stack([(plain.times / plain.duration) ** k for k in range(2, 7)])
    rest = plain.displacement / np.abs(plain.displacement).max()
    weights = np.linalg.lstsq(powers, rest, rcond=None)[0]
    assert np.abs(powers @ weights).max() < 1e-3  # nothing of the polynomial is left


def test_resampling_is_band_limited() -> None:
    t = np.arange(4000) * 0.005
    tone = np.sin(2.0 * np.pi * 3.0 * t)
    found, step = processing.resampled(tone, 0.005, 80.0)
    assert step == pytest.approx(1.0 / 80.0)
    at = np.arange(len(found)) * step
    np.testing.assert_allclose(found[200:-200], np.sin(2 * np.pi * 3.0 * at)[200:-200], atol=2e-3)
    high, _ = processing.resampled(np.sin(2.0 * np.pi * 70.0 * t), 0.005, 80.0)
    assert np.abs(high[200:-200]).max() < 0.01  # above the new Nyquist frequency: gone, not folded
    written, step = processing.resampled(tone, 0.0039063, 100.0)  # of 256 samples a second
    assert step == pytest.approx(0.0039063 * 64 / 25, rel=1e-12)
    assert len(written) == math.ceil(len(tone) * 25 / 64)
    for interval, rate, down, up in (
        (0.0039063, 50.0, 128, 25),
        (0.0009766, 100.0, 256, 25),
        (0.0048828, 100.0, 256, 125),
        (0.0166667, 50.0, 6, 5),
        (0.003906, 100.0, 64, 25),
        (0.003333, 200.0, 3, 2),
        (0.03, 100.0, 1, 3),
    ):
        _, step = processing.resampled(tone, interval, rate)
        assert step == pytest.approx(interval * down / up, rel=1e-12)
    refusal(lambda: processing.resampled(tone, 0.005, 200.0 / math.pi), "ratio", "resample")


def test_an_offset_is_no_shaking() -> None:
    """The paper's order takes none off: its ends would shake the table."""
    wave = np.zeros(6000)
    wave[2000:2400] = 0.2 * np.sin(2.0 * np.pi * np.arange(400) * 0.01)
    of = {order: Processing(order, highpass=0.1, lowpass=25.0) for order in ("paper", "standard")}
    for order in of:
        assert np.abs(process(wave + 1e-4, 0.01, of[order]).velocity).max() > 0.02
    refusal(lambda: process(wave + 0.3, 0.01, of["paper"]), "offset of 60 %", "order: standard")
    burst = np.zeros(1000)
    burst[200:600] = np.abs(wave[2000:2400])  # a ground that is still under way in the end
    shaken = np.random.default_rng(5).normal(size=2000)  # cut from longer shaking, then padded
    shaken -= shaken.mean()
    padded = [np.pad(shaken + 0.1, 2000, constant_values=by) for by in (0.0, 1e-4)]
    tapered = (shaken + 0.1) * tukey(2000, 0.1)
    for record in (burst, shaken + 0.1, *padded, tapered):
        refusal(lambda record=record: process(record, 0.01, of["paper"]), "offset")
    process(shaken, 0.01, of["paper"])
    process(np.pad(shaken, 2000), 0.01, of["paper"])
    plain, moved = (process(one, 0.01, of["standard"]) for one in (wave, wave + 0.3))
    np.testing.assert_allclose(moved.velocity, plain.velocity, atol=1e-12)


def test_corners_out_of_reach_are_refused() -> None:
    refusal(lambda: process(VALUES, STEP, Processing("paper", None, 46.0)), "46 Hz", "45 Hz")
    refusal(lambda: process(VALUES, STEP, Processing("paper", 0.2, None)), "0.2 Hz", "0.25 Hz")
    refusal(lambda: process(VALUES[:10], STEP, Processing("none", None, None)), "10 samples")


# Measures


def test_measures_of_a_harmonic_motion() -> None:
    amplitude, hertz, length, step = 2.0, 1.25, 8.0, 1e-3
    t = np.arange(round(length / step) + 1) * step
    found = measures(Trace(amplitude * np.cos(2.0 * np.pi * hertz * t), step))
    w = 2.0 * np.pi * hertz
    assert found.pga == amplitude
    assert found.pgv == pytest.approx(amplitude / w, rel=1e-5)
    assert found.pgd == pytest.approx(2.0 * amplitude / w**2, rel=1e-5)
    assert found.pgv_pga == pytest.approx(1.0 / w, rel=1e-5)
    assert found.arias == pytest.approx(
        math.pi / (2 * GRAVITY) * amplitude**2 * length / 2, rel=2e-5
    )
    assert found.cav == pytest.approx(2.0 * amplitude * length / math.pi, rel=1e-5)
    assert found.significant_duration == pytest.approx(0.9 * length, rel=0.01)


def test_spectrum_of_a_step() -> None:
    step = 0.002
    trace = Trace(np.full(20000, 1.5), step)
    # a constant push overshoots by exp(-zeta pi / sqrt(1 - zeta^2)); exact but for the sampling
    for damping in (0.02, 0.05, 0.2):
        over = math.exp(-damping * math.pi / math.sqrt(1.0 - damping**2))
        found = spectrum(trace, np.array([0.4, 1.0, 3.0]), damping)
        np.testing.assert_allclose(found, 1.5 * (1.0 + over), rtol=2e-4)


def test_spectrum_at_resonance_and_at_its_ends() -> None:
    hertz, step = 2.0, 0.002
    t = np.arange(30000) * step
    trace = Trace(np.sin(2.0 * np.pi * hertz * t), step)
    soft = 3e-4
    low, at, high = spectrum(trace, np.array([soft, hertz, 200.0]))
    assert at == pytest.approx(1.0 / (2.0 * 0.05), rel=2e-3)
    assert high == pytest.approx(1.0, rel=1e-3)  # a stiff oscillator goes along
    # a soft one stays where it was: its relative displacement is the ground's
    pgd = np.abs(trace.displacement).max()
    assert low / (2.0 * np.pi * soft) ** 2 == pytest.approx(pgd, rel=0.05)


def test_spectrum_is_exact_whatever_the_step() -> None:
    coarse = Trace(VALUES, STEP)
    t = np.arange(0.0, coarse.duration, STEP / 16)
    fine = Trace(np.interp(t, coarse.times, VALUES), STEP / 16)
    hertz = np.array([0.5, 1.0, 2.0])
    # the same straight lines: only what lies between the samples of the response differs
    np.testing.assert_allclose(spectrum(coarse, hertz), spectrum(fine, hertz), rtol=2e-3)


def test_spectrum_against_direct_integration() -> None:
    from scipy.integrate import solve_ivp

    trace, w = Trace(VALUES, STEP), 2.0 * np.pi * 1.7
    found = solve_ivp(
        lambda t, y: [y[1], -0.1 * w * y[1] - w**2 * y[0] - np.interp(t, trace.times, VALUES)],
        (0.0, trace.duration), [0.0, 0.0], max_step=STEP / 2, rtol=1e-8, atol=1e-10,
        t_eval=trace.times[:-1],
    )  # fmt: skip
    inside = w**2 * np.abs(found.y[0]).max()
    assert float(spectrum(trace, np.array([1.7]))[0]) == pytest.approx(inside, rel=1e-4)


def test_measures_grow_as_they_should() -> None:
    one, twice = measures(Trace(VALUES, STEP)), measures(Trace(2.0 * VALUES, STEP))
    for name in ("pga", "pgv", "pgd", "sa_1hz", "sa_2hz", "cav"):
        assert getattr(twice, name) == pytest.approx(2.0 * getattr(one, name))
    assert twice.arias == pytest.approx(4.0 * one.arias)
    assert twice.pgv_pga == pytest.approx(one.pgv_pga)
    assert twice.significant_duration == pytest.approx(one.significant_duration)


def test_shake_table_record_of_the_shared_data() -> None:
    path = ROOT.parent / "shared" / "data" / "ground_motion" / "RSN316_table.csv"
    if not path.is_file():
        pytest.skip("the shared data are not here")
    refusal(lambda: read(path.read_bytes(), ".csv", PLAIN), "without a unit")
    found = repaired(read(path.read_bytes(), ".csv", Reading("raw_acc", "m/s2")))
    assert found.interval == pytest.approx(1.0 / 800.0)
    assert len(found.acceleration) == 20000
    trace = process(found.acceleration, found.interval, Processing("standard", 0.2, 40.0))
    check_rest(trace)
