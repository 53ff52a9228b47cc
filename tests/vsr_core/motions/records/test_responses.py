"""Instruments' responses: their parts, removed from records, and what is wrong with them."""

from __future__ import annotations

import copy
import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import firwin, freqz, lsim
from support.recorded import STEP, refusal

from vsr_core.errors import InvalidInput
from vsr_core.motions.records import instrument_response, processing
from vsr_core.motions.records.formats import Reading, read
from vsr_core.motions.records.record import Record
from vsr_core.motions.records.trace import Trace


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
