"""K-NET and SAC files, of text and of bytes, by their headers."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from support import record_files as files
from support.recorded import PLAIN, STEP, VALUES, by_fortran, example, refusal, sac, trace

from vsr_core import GRAVITY
from vsr_core.motions.records.formats import Reading, from_stream, read
from vsr_core.motions.records.record import repaired


def test_unknown_format_is_refused() -> None:
    refusal(lambda: read(b"\0\1\2", ".bin", PLAIN), "no known format", "CSV")
    refusal(lambda: read(b"some words", ".doc", PLAIN), "no known format")


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


def test_sac_of_text_as_fortran_writes_it_is_read() -> None:
    pytest.importorskip("obspy")
    lines = sac_text().splitlines()[:30]
    words = [by_fortran(float(one)) for one in VALUES]
    lines += ["".join(words[at : at + 5]) for at in range(0, len(words), 5)]
    found = read("\n".join([*lines, ""]).encode(), ".sac", Reading(unit="m/s2"))
    np.testing.assert_allclose(found.acceleration, VALUES, rtol=1e-6)


def knet_text() -> str:
    return files.knet(VALUES, STEP)


def at2_text() -> str:
    return files.at2(VALUES, STEP)


def sac_text() -> str:
    import obspy

    content = io.BytesIO()
    obspy.Trace(VALUES.astype(np.float32), {"delta": STEP}).write(content, format="SACXY")
    return content.getvalue().decode()


@pytest.mark.parametrize("damaged", [r"\1_\2", r"\1.\2", r"\1\2e1"])
def test_a_sample_of_knet_is_a_whole_number(damaged: str) -> None:
    """Python reads 12_00 as 1200."""
    pytest.importorskip("obspy")
    text = files.knet(VALUES, STEP)
    at = text.index("Memo.") + 9
    changed = text[:at] + re.sub(r"(\d)(\d)", damaged, text[at:], count=1)
    refusal(
        lambda: read(changed.encode(), ".NS", PLAIN), "among its samples; they are whole numbers"
    )


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


def test_a_sac_file_of_text_that_is_cut_is_refused() -> None:
    obspy = pytest.importorskip("obspy")
    text, how = io.BytesIO(), Reading(unit="m/s2")
    obspy.Trace(VALUES, {"delta": STEP, "channel": "HNE"}).write(text, format="SACXY")
    whole = text.getvalue()
    assert len(read(whole, ".sac", how).acceleration) == len(VALUES)
    for lost in (1, 2, 5, 9):
        refusal(lambda cut=whole[:-lost]: read(cut, ".sac", how), "last line has no end")
