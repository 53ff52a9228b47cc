"""Events against curves, both made by OpenQuake from one source model, where it is installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.stages.hazard import curve_folder, event_files
from pipeline.stages.hazard.disaggregation import load_disaggregation
from vsr_core import GRAVITY
from vsr_core.hazard.ratio import ratios_of_scenarios
from vsr_core.hazard.shaking import CurveShaking, counted_shaking
from vsr_core.hazard.toppling import borders_of, lognormal_rows

SHARED = Path(__file__).parents[3] / "shared" / "data" / "hazard"
YEARS = 200_000

RATIOS = np.geomspace(0.03, 0.4, 8)
ROWS = lognormal_rows(GRAVITY * 0.05 / RATIOS[None], np.full((1, 8), 0.2))
"""A rock that topples from a PGV of some 0.5 m/s on, whatever the PGA."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("oq") is None, reason="OpenQuake is not installed"),
    pytest.mark.skipif(not SHARED.exists(), reason="the source model is not there"),
]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> event_files.EventSet:
    folder = tmp_path_factory.mktemp("openquake") / "job"
    shutil.copytree(SHARED / "job", folder)
    job = (folder / "job.ini").read_text()
    job = job.replace("mode = classical", "mode = event_based\nground_motion_fields = true")
    job = job.replace("time = 1.0", f"time = 1.0\nses_per_logic_tree_path = {YEARS}")
    job = re.sub(r"intensity_measure_types_and_levels.*", "intensity_measure_types = PGA, PGV", job)
    job = re.sub(r"individual_rlzs.*\n|mean = true\n|quantiles.*\n", "", job)
    (folder / "events.ini").write_text(job)
    home = {"OQ_DISTRIBUTE": "no", "OQ_DATADIR": str(folder / "data")}
    (folder / "data").mkdir()
    command = ["oq", "engine", "--run", "events.ini", "--exports", "csv"]
    subprocess.run(command, cwd=folder, env=os.environ | home, check=True, capture_output=True)
    return event_files.load(folder / "out", None)


def test_events_and_curves_of_one_model_agree(simulated: event_files.EventSet) -> None:
    """In the mean of the branches, PGA by itself, and with PGV drawn anew what topples."""
    classical = curve_folder.load(SHARED / "curves")
    weights = np.array([one.weight for one in classical.branches])
    events = simulated.events
    assert events.years == YEARS
    np.testing.assert_allclose([one.weight for one in simulated.model.branches], weights)
    assert events.correlation() == pytest.approx(0.0, abs=0.03)

    curves = tuple(one.pga for one in classical.branches)
    levels = GRAVITY * np.array([0.1, 0.2, 0.4])
    found = weights @ events.rates(events.pga, levels, len(weights))
    expected = weights @ np.array([one.rate_at(levels) for one in curves])
    np.testing.assert_allclose(found, expected, rtol=0.08)

    shares = load_disaggregation(SHARED / "disaggregation")
    scenarios = shares.magnitudes, shares.distances, shares.levels, shares.shares
    table = ratios_of_scenarios(*scenarios, np.geomspace(0.05, 40.0, 200))
    of_curves = CurveShaking(curves, table, borders_of(RATIOS))
    expected = weights @ of_curves.rates(of_curves.fragility(ROWS, RATIOS))

    def of_events(ratio: np.ndarray) -> tuple[float, float]:
        shaking = counted_shaking(events, ratio, borders_of(RATIOS), weights)
        fragility = shaking.fragility(ROWS, RATIOS)
        drawn = shaking.resampled(fragility, 300) @ weights
        return float(weights @ shaking.rates(fragility)), float(drawn.std())

    anew, error = of_events(events.ratio_anew())
    assert error < 0.15 * anew
    assert anew == pytest.approx(expected, abs=2.5 * error)
    # As it was simulated PGV goes with PGA as in no earthquake, and PGV/PGA scatters more.
    spread = np.log(events.ratio_as_simulated()).std(), np.log(events.ratio_anew()).std()
    assert spread[0] > 1.2 * spread[1]
