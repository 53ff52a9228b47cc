"""What simulation.accurate asks for, from the configuration to the products and the page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.config.layers import load_site
from pipeline.stages.mesh.products import Standing
from pipeline.stages.runs import step_choice
from pipeline.stages.runs.scenes import Scenes
from pipeline.workflow.datasets import read
from pipeline.workflow.store import Store
from vsr_core import GRAVITY
from vsr_core.outcome import Outcome
from vsr_core.run.rocking_block import Block, rocking_response

GRID = """rock: {shape: box, size: [1.0, 1.0, 2.0], density: 2110}
motion: {pga: {start: 0.4, stop: 1.2, num: 21}, pgv_pga: [0.05, 0.1, 0.2, 0.3]}
contact: {friction: 2.0}
simulation: {accurate: [peak_tilt, slip]}
"""
PLAIN = ("--set", "simulation.accurate=[boundary]")


@pytest.mark.slow
def test_what_is_named_is_known_and_has_its_error(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path, tmp_path: Path
) -> None:
    site = write_site(GRID)
    line = ("run", "fragility", "--site", site, "--workers", 0)
    ran = vsr(*line)
    assert ran.code == 0
    data = read(derived / "rock" / "responses.nc").squeeze()
    upright = data["outcome"].values == Outcome.BALANCED
    assert upright.sum() > 10
    assert np.isfinite(data["peak_tilt"].values[upright]).all()
    assert np.isnan(data["peak_tilt"].values[data["outcome"].values == Outcome.OVERTURNED]).all()
    for name in ("peak_tilt", "slip"):
        assert data[f"{name}_error_runs"] > 30
        assert data[f"{name}_error_median"] <= 0.003
        assert data[f"{name}_error_95"] <= 0.02
    # as it says of runs that it was not told from
    block = Block(0.5, 1.0)
    small = 0.01 * block.alpha
    errors = []
    for ratio, pga in np.argwhere(upright):
        given = GRAVITY * float(data["pga"][pga]), float(data["pgv_pga"][ratio])
        right = rocking_response(block, *given).peak_angle
        own = data["peak_tilt"].values[ratio, pga]
        errors.append(abs(own - right) / max(right, small))
    assert np.median(errors) < 0.003
    page = " ".join((derived / "rock" / "report.html").read_text().split())
    assert "The error of the largest tilt is" in page
    assert f"are known of {np.isfinite(data['peak_tilt'].values).sum()} of 84 runs" in page
    # a plan knows the step without measuring
    config = load_site(site).config
    scenes = Scenes(config.scene, Standing.load(Store(derived / "rock")))
    assert step_choice.stored_steps(scenes, derived / "rock").steps == (float(data["time_step"]),)
    assert "measuring" not in vsr(*line, "--set", "yaw=[0, 90]").err
    # outcomes are those of runs that are ended as soon as they are certain
    plain = tmp_path / "plain"
    assert vsr(*line, *PLAIN, into=plain).code == 0
    ended = read(plain / "rock" / "responses.nc").squeeze()
    assert "peak_tilt_error_95" not in ended
    assert ended["time_step"] >= data["time_step"]
    assert np.isnan(ended["peak_tilt"].values[upright]).any()
    assert (ended["outcome"].values == data["outcome"].values).mean() > 0.95


@pytest.mark.slow
def test_a_step_by_hand_has_its_errors_measured_all_the_same(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path
) -> None:
    site = write_site(GRID)
    by_hand = ("--set", "simulation.time_step=0.006", "--set", "simulation.accurate=[slip]")
    ran = vsr("run", "responses", "--site", site, "--workers", 0, *by_hand)
    assert ran.code == 0
    data = read(derived / "rock" / "responses.nc")
    assert float(data["time_step"].item()) == 0.006
    assert data["slip_error_95"].item() > 0.0
    assert np.isnan(data["boundary_error"].item())


@pytest.mark.slow
@pytest.mark.parametrize("at", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_friction_has_its_own_error(
    at: int, write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path
) -> None:
    """Measured alone and with another, in the same step of the same case."""
    site = write_site(GRID)
    step = ("--set", "simulation.time_step=0.006")
    line = ("run", "responses", "--site", site, "--workers", 0, *step, "--set")
    frictions = (2.0, 0.6)
    assert vsr(*line, f"contact.friction={list(frictions)}").code == 0
    both = read(derived / "rock" / "responses.nc")
    again = vsr(*line, f"contact.friction={frictions[at]}")
    assert "measuring" not in again.err
    alone = read(derived / "rock" / "responses.nc")
    for name in ("peak_tilt_error_95", "slip_error_median"):
        assert alone[name].values.tolist() == [both[name].values[at]]
    assert len(set(both["slip_error_median"].values.tolist())) == 2
