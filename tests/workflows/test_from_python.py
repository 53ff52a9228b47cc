"""``import vsr``: each product's own dataset, of sweeps and of scans, too."""

from __future__ import annotations

import html
import re
from pathlib import Path

import pytest
import trimesh
import xarray as xr

import vsr

BLOCK = vsr.box(0.5, 1.0, 2.0, density=2110)
PULSES = vsr.pulses([0.3, 0.9], [0.3])
QUICK = {"workers": 0, "simulation": {"time_step": 0.004}}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_sweep_gives_the_dataset_of_the_study() -> None:
    found = vsr.responses(BLOCK, PULSES, study="friction", **QUICK)
    assert found.sizes["friction"] == 7
    assert found.sizes["pga"] == 2


def test_a_report_gives_the_fragility_it_shows() -> None:
    report = vsr.run("report", BLOCK, PULSES, **QUICK)
    assert report.equals(vsr.fragility(BLOCK, PULSES, **QUICK))


def test_a_scan_is_found_from_the_working_folder() -> None:
    trimesh.creation.box((0.5, 0.6, 1.5)).subdivide().export("rock.ply")
    found = vsr.responses(vsr.mesh("rock.ply", 2500.0), PULSES, name="scan", **QUICK)
    assert found["overturned"].values.ravel().tolist() == [0, 1]


def test_what_has_no_dataset_is_refused_before_any_work() -> None:
    with pytest.raises(vsr.InputError, match="got stability; it has no dataset"):
        vsr.run("stability", BLOCK)
    assert not Path("data").exists()


def test_curves_and_tests_are_found_from_the_working_folder() -> None:
    with pytest.raises(vsr.InputError, match=r"^curves: got folder not found") as refused:
        vsr.hazard(BLOCK, PULSES, curves="curves", hazard={"age": {"kind": "normal", "mean": 1e4}})
    assert "derived" not in str(refused.value)
    with pytest.raises(vsr.InputError, match="my_tests"):
        vsr.run("validation", "my_tests")


def test_a_dataset_shows_its_page_its_figure_and_its_runs_in_a_notebook() -> None:
    made = vsr.fragility(BLOCK, PULSES, derived="results", **QUICK)
    shown = re.search(r'srcdoc="([^"]*)"', made.vsr._repr_html_())
    assert shown is not None
    page = Path("results", "rock", "report.html").read_text(encoding="utf-8")
    assert html.unescape(shown[1]) == page
    (diagram,) = made.vsr.plot(yaw=0).axes
    assert diagram.get_xlabel() == "peak ground acceleration [g]"
    run = made.vsr.replay(yaw=0, pga=0.9, pgv_pga=0.3)
    assert "Replay of a run" in run._repr_html_()
    assert run.path.parent.name == "replays"


def test_what_a_dataset_does_not_have_is_refused() -> None:
    made = vsr.responses(BLOCK, PULSES, **QUICK)
    with pytest.raises(vsr.InputError, match="got responses; fragility and displacement have"):
        made.vsr.plot()
    with pytest.raises(vsr.InputError, match=r"report\.html"):
        made.vsr.page  # noqa: B018 (it is the asking that fails)
    with pytest.raises(vsr.InputError, match=r"the grid of the study has PGA 0\.3, 0\.9 g"):
        made.vsr.replay(yaw=0, pga=0.5, pgv_pga=0.3)
    with pytest.raises(vsr.InputError, match="a dataset of a product"):
        xr.Dataset({"x": 1}).vsr  # noqa: B018
    fragile = vsr.fragility(BLOCK, PULSES, **QUICK)
    with pytest.raises(vsr.InputError, match="yaw: got 7; it is one of 0; give one of these"):
        fragile.vsr.plot(yaw=7)
