"""miniSEED: records of it that are cut, empty, damaged or drift from their rate."""

from __future__ import annotations

import io
import itertools
import struct

import numpy as np
import pytest
from support.recorded import STEP, VALUES, example, refusal

from vsr_core.errors import InvalidInput
from vsr_core.motions.records.formats import Reading, read, read_all
from vsr_core.motions.records.record import repaired


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
