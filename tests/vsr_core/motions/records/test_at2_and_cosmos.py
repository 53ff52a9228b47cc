"""AT2 and COSMOS files: read as they are written, refused where they break their word."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support import record_files as files
from support.recorded import PLAIN, STEP, VALUES, by_fortran, refusal

from vsr_core import GRAVITY
from vsr_core.motions.records.formats import Reading, read
from vsr_core.motions.records.text_files import read_at2, read_cosmos


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
