"""Samples that are none: clipped, of few digits, marks, spikes, filled gaps; units and drift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import record_files as files
from support.recorded import PLAIN, STEP, VALUES, record, refusal

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.formats import read
from vsr_core.motions.records.record import check_end, check_rest, factor, repaired
from vsr_core.motions.records.trace import Trace


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
