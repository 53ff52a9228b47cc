"""What products say of their origin: the stage, the settings, and no folder of this machine."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from support.jobs import work

from pipeline import ROOT
from pipeline.config.layers import Site, load_site
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.workflow.datasets import described, read

GRID = "motion: {pga: [0.01, 0.02], pgv_pga: 0.3}\nsimulation: {time_step: 0.001}\n"


def test_history_names_the_stage_and_no_folder(
    write_site: Callable[..., str], vsr: Callable[..., Any], derived: Path, tmp_path: Path
) -> None:
    assert vsr("run", "responses", "--site", write_site(GRID), "--workers", "0").code == 0
    folder = derived / "rock"
    stages = {"rock": "rock", "motions": "motions", "time_step": "time_step"}
    for name, stage in {**stages, "responses": "responses"}.items():
        attributes = read(folder / f"{name}.nc").attrs
        assert attributes["history"] == f"made by stage {stage} from rock.yaml"
        assert not [key for key, value in attributes.items() if str(tmp_path) in str(value)]
    assert str(tmp_path) not in (folder / "config.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("path", "origin"),
    [
        (ROOT / "configs" / "sites" / "rock.yaml", "configs/sites/rock.yaml"),
        (Path("/home/me/rock.yaml"), "rock.yaml"),
        (Path("mine/rock.yaml"), "rock.yaml"),
    ],
)
def test_a_file_of_the_project_is_named_by_its_place_in_it(
    path: Path, origin: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And another by its name, from wherever it is asked for."""
    monkeypatch.chdir(tmp_path)
    assert replace(load_site("cuboid_1x1x2"), path=path).label == origin


def test_settings_are_those_of_what_was_made(tmp_path: Path) -> None:
    """A series of tests is no site: its provenance is what was assumed of it, and nothing else."""
    assumed = ShakeTableConfig(members=3)
    site = Site(name="tests", file="tests", path=tmp_path / "tests", settings=assumed)
    made = described(xr.Dataset({"pga": 0.1}), work(site, tmp_path, "validation"), "Title")
    attributes = made.attrs
    assert json.loads(attributes["vsr_config_json"]) == assumed.model_dump(mode="json")
    assert attributes["history"] == "made by stage validation from tests"
    assert "numba" in attributes["source"]
    with pytest.raises(AssertionError):
        _ = site.config
