"""Cosine pulses on any axis of a table: by the configuration, and as one motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import Ran
from hypothesis import given, settings
from hypothesis import strategies as st

from vsr_core import GRAVITY
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.six_axes import AXES, AxisPulse, AxisPulses
from vsr_core.rock import solid
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene

PULSES = st.lists(
    st.builds(AxisPulse, st.sampled_from(AXES), st.floats(0.2, 5.0), st.floats(0.05, 1.0)),
    min_size=1,
    max_size=5,
)


@given(PULSES)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_pulses_together_are_their_sum(pulses: list[AxisPulse]) -> None:
    motion = AxisPulses(tuple(pulses))
    assert motion.duration == 2.0 * math.pi * max(pulse.ratio for pulse in pulses)
    assert motion.shortest_time == min(pulse.ratio for pulse in pulses)
    assert motion.turns == any(pulse.axis in AXES[3:] for pulse in pulses)
    t = np.linspace(-0.1, 1.1, 40) * motion.duration
    for order, name in enumerate(("displacement", "velocity", "acceleration")):
        expected = np.zeros((len(t), 6))
        for pulse in pulses:
            own = getattr(CosinePulse(pulse.peak, pulse.ratio), name)(t)
            expected[:, AXES.index(pulse.axis)] += own
        np.testing.assert_allclose(motion.derivative(t, order), expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_left_out_changes_no_outcome(seed: int) -> None:
    """Of pulses of several lengths, in translation and with a turn."""
    rng = np.random.default_rng(seed)
    axes = ("x", "y", "z") if seed % 2 else ("x", "z", "pitch")
    motion = AxisPulses(
        tuple(
            AxisPulse(axis, rng.uniform(1.0, 6.0) * (0.2 if axis == "pitch" else 1.0), ratio)
            for axis, ratio in zip(axes, rng.uniform(0.08, 0.5, 3), strict=True)
        )
    )
    rock = solid.box((0.5, 0.6, 1.2), 2110.0).rock
    scene, limits = Scene(rock, Contact(0.6), rng.uniform(0.0, 3.0)), barrier(rock)
    least, whole = (
        simulate(prepare(scene, limits, reduce=reduce), motion, Settings(8e-4, reduce))
        for reduce in (True, False)
    )
    assert least.outcome is whole.outcome


# Through the pipeline

SITE = """rock: {{shape: box, size: [0.5, 0.5, 1.2], density: 2110}}
motion:
  kind: table
  pulses: {pulses}
  pgv_pga: [0.15, 0.3]
  pga: [0.1, 0.8, 1.4]
"""
SHAKEN = "[{axis: x}, {axis: z, pga_ratio: -0.5}, {axis: pitch, pga_ratio: 0.2, pgv_pga: 0.1}]"


@pytest.fixture
def site(write_site: Callable[..., str]) -> str:
    return write_site(SITE.format(pulses=SHAKEN))


@pytest.mark.slow
def test_a_grid_of_pulses_on_three_axes(site: str, vsr: Callable[..., Ran], derived: Path) -> None:
    """Every outcome is that of the same run by hand."""
    assert vsr("run", "fragility", "--site", site, "--workers", "0").code == 0
    data = xr.load_dataset(derived / "rock" / "responses.nc")
    assert data["outcome"].dims == ("yaw", "friction", "pgv_pga", "pga")
    rock = solid.box((0.5, 0.5, 1.2), 2110.0).rock
    case = prepare(Scene(rock, Contact(0.6)), barrier(rock), reduce=True)
    own = Settings(float(data["time_step"][0]), engine="nonsmooth")
    for ratio in (0.15, 0.3):
        for pga in (0.1, 0.8, 1.4):
            motion = AxisPulses(
                (
                    AxisPulse("x", 1.0 * pga * GRAVITY, ratio),
                    AxisPulse("z", -0.5 * pga * GRAVITY, ratio),
                    AxisPulse("pitch", 0.2 * pga * GRAVITY, 0.1),
                )
            )
            response = simulate(case, motion, own)
            found = data.sel(pgv_pga=ratio, pga=pga).squeeze()
            assert int(found["outcome"]) == response.outcome
            assert float(found["tilt_until_decided"]) == pytest.approx(response.peak_tilt)
    assert {0, 1} <= set(data["overturned"].values.ravel().tolist())
    named = "x, -0.5 z, 0.2 pitch of 0.1 s"
    motions = xr.load_dataset(derived / "rock" / "motions.nc")
    assert motions.attrs["axes"] == named
    np.testing.assert_allclose(motions["duration"], 2.0 * math.pi * np.array([0.15, 0.3]))
    longer = SHAKEN.replace("0.1}", "0.2}")
    assert longer != SHAKEN
    assert vsr("run", "motions", "--site", site, "--set", f"motion.pulses={longer}").code == 0
    motions = xr.load_dataset(derived / "rock" / "motions.nc")
    np.testing.assert_allclose(motions["duration"], 2.0 * math.pi * np.array([0.2, 0.3]))
    assert named in " ".join((derived / "rock" / "report.html").read_text().split())
    assert "0 to do" in vsr("plan", "--site", site).out
    changed = SHAKEN.replace("-0.5", "0.5")
    plan = vsr("plan", "--site", site, "--set", f"motion.pulses={changed}").out
    assert "6 to do" in plan


@pytest.mark.slow
def test_x_alone_is_the_plain_pulse(
    write_site: Callable[..., str], vsr: Callable[..., Ran], derived: Path
) -> None:
    site = write_site(SITE.format(pulses="[{axis: x}]"))
    plain = "motion={kind: cosine_pulse, pgv_pga: [0.15, 0.3], pga: [0.1, 0.8, 1.4]}"
    run = ("run", "responses", "--site", site, "--workers", "0")
    assert vsr(*run).code == 0
    one = xr.load_dataset(derived / "rock" / "responses.nc")
    assert vsr(*run, "--set", plain).code == 0
    other = xr.load_dataset(derived / "rock" / "responses.nc")
    np.testing.assert_array_equal(one["outcome"].values, other["outcome"].values)
    assert (one["outcome"] == 1).any()


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("pulses=[]", ("motion.pulses", "at least one pulse")),
        ("pulses=null", ("motion", "table motion needs", "`pulses` and `pgv_pga`")),
        ("pulses=[{axis: w}]", ("motion.pulses.0.axis", "'w'", "'roll'")),
        ("pulses=[{axis: x, shar: 1}]", ("motion.pulses.0.shar", "the keys here are axis")),
        ("pulses=[{axis: x, pga_ratio: 0}]", ("motion.pulses.0.pga_ratio", "no motion")),
        ("pulses=[{axis: x, pgv_pga: -1}]", ("motion.pulses.0.pgv_pga", "equal to 0.001")),
        ("pulses=[{axis: x, pgv_pga: 0.2}]", ("motion.pulses", "from the grid")),
        ("pulses=[{pga_ratio: 1}]", ("motion.pulses.0.axis", "required")),
        ("pgv_pga=null", ("motion.pgv_pga", "pulses need a PGV/PGA")),
        ("pgv_pga=[0.0, 1.0]", ("motion.pgv_pga", "positive")),
        ("files=[shaking.csv]", ("motion.pulses", "not both")),
    ],
)
def test_pulses_that_are_refused(
    site: str, refused: Callable[..., str], setting: str, words: tuple[str, ...]
) -> None:
    refused("plan", "--site", site, "--set", f"motion.{setting}", words=words)


@pytest.mark.parametrize("setting", ["drive=servo", "pedestal.shape=mesh"])
def test_what_carries_no_table(site: str, refused: Callable[..., str], setting: str) -> None:
    refused("plan", "--site", site, "--set", setting, words=("set ",))
