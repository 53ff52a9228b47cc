"""`vsr run fragility` on six cells a direction: runs, responses, fits and the report.

The rock is a slender block, of which Housner's equation knows what each cell does.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Ran

from pipeline.workflow.datasets import read
from vsr_core import GRAVITY
from vsr_core.verification.rocking_block import Block, rocking_response

SITE = """rock: {shape: box, size: [0.4, 1.2, 1.6], density: 2110}
motion: {pga: [0.15, 0.9, 1.4], pgv_pga: [0.12, 0.3]}
yaw: [0, 90]
simulation: {time_step: auto}
"""


@pytest.fixture
def made(vsr: Callable[..., Ran], write_site: Callable[..., str], derived: Path) -> Ran:
    return vsr("run", "fragility", "--site", write_site(SITE), "--workers", "0")


def test_from_a_site_to_curves_and_report(made: Ran, derived: Path) -> None:
    assert made.code == 0, made.err
    folder = derived / "rock"
    responses = read(folder / "responses.nc")
    assert responses["outcome"].dims == ("yaw", "friction", "pgv_pga", "pga")
    assert responses["pga"].values.tolist() == [0.15, 0.9, 1.4]
    units = {name: responses[name].attrs["units"] for name in responses["outcome"].dims}
    assert units == {"yaw": "degree", "friction": "1", "pgv_pga": "s", "pga": "g"}

    # Shaken at yaw 0 it rocks over its thin side, at 90 over its wide one.
    for yaw, half_width in ((0, 0.2), (90, 0.6)):
        for ratio in (0.12, 0.3):
            for pga in (0.15, 0.9, 1.4):
                found = int(responses["overturned"].sel(yaw=yaw, pgv_pga=ratio, pga=pga).item())
                if yaw == 0:
                    exact = rocking_response(Block(half_width, 0.8), pga * GRAVITY, ratio)
                    assert found == exact.overturned, (yaw, ratio, pga)
                elif pga < half_width / 0.8:
                    assert found == 0
    assert set(np.unique(responses["overturned"].sel(yaw=0))) == {0, 1}

    fragility = read(folder / "fragility.nc")
    first = fragility["first_overturning_pga"].sel(yaw=0).squeeze()
    for row in range(2):
        fell = responses["overturned"].sel(yaw=0).squeeze().values[row]
        known = responses["pga"].values[fell == 1].min(initial=math.inf)
        assert float(first[row]) == known
    with (folder / "fragility.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {float(row["yaw_deg"]) for row in rows} == {0.0, 90.0}

    report = (folder / "report.html").read_text(encoding="utf-8")
    assert "most fragile at <strong>yaw 0 deg</strong>" in report
    error = float(responses["boundary_error"].values[0])
    assert 0.0 < error <= 0.01 or not math.isfinite(error)
    assert float(responses["time_step"].values[0]) > 0.0
    for name in ("report.html", "fragility.csv", "responses.nc"):
        assert f"-> {folder / name}" in made.err
