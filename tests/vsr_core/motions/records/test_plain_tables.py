"""Plain tables of samples: units, headings, times and the numbers in their columns."""

from __future__ import annotations

import codecs
import io
import math

import numpy as np
import pytest
from support import record_files as files
from support.recorded import PLAIN, STEP, VALUES, refusal, sac

from vsr_core import GRAVITY
from vsr_core.errors import InvalidInput
from vsr_core.motions.records.columns import read_table
from vsr_core.motions.records.formats import Reading, read


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
