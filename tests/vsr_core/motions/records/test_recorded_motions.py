"""Recorded motions as tables move: integrals, processing, resampling and measures."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy.signal.windows import tukey
from support.recorded import PLAIN, STEP, VALUES, refusal

from pipeline import ROOT
from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records import processing
from vsr_core.motions.records.formats import Reading, read
from vsr_core.motions.records.processing import Processing, process
from vsr_core.motions.records.record import check_rest, repaired
from vsr_core.motions.records.trace import FEWEST, PARTS, RecordedMotion, Trace, measures, spectrum

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


def test_measures_are_those_of_the_motion_between_its_samples_too() -> None:
    """The same straight lines in 64 times as many samples."""
    coarse = Trace(VALUES, STEP)
    t = np.arange(64 * (len(VALUES) - 1) + 1) * STEP / 64
    fine = Trace(np.interp(t, coarse.times, VALUES), STEP / 64)
    hertz = np.array([0.1, 0.25, 0.5, 1.0, 2.0]) / STEP
    np.testing.assert_allclose(spectrum(coarse, hertz), spectrum(fine, hertz), rtol=2e-3)
    one, other = measures(coarse), measures(fine)
    for name, samples in (("pgv", fine.velocity), ("pgd", fine.displacement)):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-9)
        assert getattr(one, name) == pytest.approx(np.abs(samples).max(), rel=1e-3)
        assert getattr(one, name) >= np.abs(samples).max() * (1.0 - 1e-12)


def test_a_soft_oscillator_follows_fast_shaking_between_the_samples() -> None:
    """A Ricker wavelet of 12 Hz in steps of 0.01 s, at any phase."""
    for phase in np.linspace(0.0, 1.0, 7):
        argument = (math.pi * 12.0 * ((np.arange(40) + phase) * 0.01 - 0.2)) ** 2
        coarse = Trace((1.0 - 2.0 * argument) * np.exp(-argument), 0.01)
        t = np.arange(200 * 39 + 1) * 0.01 / 200
        fine = Trace(np.interp(t, coarse.times, coarse.acceleration), 0.01 / 200)
        hertz = np.array([0.3, 1.0, 3.0])
        np.testing.assert_allclose(spectrum(coarse, hertz), spectrum(fine, hertz), rtol=2.5e-3)


def test_a_pulse_of_three_samples_is_fastest_where_its_acceleration_crosses_zero() -> None:
    """1, -1 and 1 m/s^2, a second apart: v = t - t^2 and d = t^2/2 - t^3/3 in the first second."""
    found = measures(Trace(np.array([1.0, -1.0, 1.0]), 1.0))
    assert (found.pgv, found.pgv_pga, found.pgd) == pytest.approx((0.25, 0.25, 1.0 / 6.0))


def test_spectrum_against_direct_integration() -> None:
    from scipy.integrate import solve_ivp

    trace, w = Trace(VALUES, STEP), 2.0 * np.pi * 1.7
    parts = max(math.ceil(PARTS * 1.7 * STEP), FEWEST)
    found = solve_ivp(
        lambda t, y: [y[1], -0.1 * w * y[1] - w**2 * y[0] - np.interp(t, trace.times, VALUES)],
        (0.0, trace.duration), [0.0, 0.0], max_step=STEP / 2, rtol=1e-8, atol=1e-10,
        t_eval=np.arange(parts * (len(VALUES) - 1)) * STEP / parts,
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
