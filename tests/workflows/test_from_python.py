"""``import vsr``: each product's own dataset, of sweeps and of scans, too."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import xarray as xr
from support import tumbling

import pipeline.inspection.in_notebook  # noqa: F401 (what a dataset of vsr has, as vsr.run does)
import vsr
from pipeline import ROOT
from pipeline.config.yaml_text import parse as load_yaml

BLOCK = vsr.box(0.5, 1.0, 2.0, density=2110)
PULSES = vsr.pulses([0.3, 0.9], [0.3])
QUICK = {"workers": 0, "simulation": {"time_step": 0.004}}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_a_name_of_a_site_is_that_of_a_variant() -> None:
    Path("block.yaml").write_text(json.dumps({**BLOCK, **PULSES}))
    low, high = (
        vsr.responses("block.yaml", contact={"friction": friction}, name=name, **QUICK)
        for name, friction in (("low", 0.4), ("high", 0.8))
    )
    assert sorted(path.name for path in Path("data/derived").glob("block*/")) == (
        ["block", "block@high", "block@low"]  # the first has the runs of both
    )
    for made, name in ((low, "low"), (high, "high")):
        assert Path(made.encoding["source"]).parent.name == f"block@{name}"
        page = made.vsr.replay(pga=0.9, pgv_pga=0.3).path
        assert f"/block@{name}/" in page.resolve().as_posix()
    with pytest.raises(vsr.InputError, match=r"^--name: got 'a/b'; it has letters"):
        vsr.responses("block.yaml", name="a/b", **QUICK)


def test_a_sweep_gives_the_dataset_of_the_study() -> None:
    found = vsr.responses(BLOCK, PULSES, study="friction", **QUICK)
    assert found.sizes["friction"] == 7
    assert found.sizes["pga"] == 2


@pytest.mark.slow
def test_a_report_gives_the_fragility_it_shows() -> None:
    report = vsr.run("report", BLOCK, PULSES, **QUICK)
    assert report.equals(vsr.fragility(BLOCK, PULSES, **QUICK))


@pytest.mark.slow
def test_a_replay_is_of_the_rock_of_its_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever rock the name stands for by now, in another folder or after an edit."""
    for folder, height in (("one", 2.0), ("other", 4.0)):
        (tmp_path / folder).mkdir()
        rock = BLOCK | {"rock": {"shape": "box", "size": [0.5, 1.0, height], "density": 2110}}
        (tmp_path / folder / "rock.yaml").write_text(json.dumps(rock))
    monkeypatch.chdir("one")
    found = vsr.fragility("rock.yaml", PULSES, derived="made", **QUICK)
    page = found.vsr.replay(pga=0.9, pgv_pga=0.3).path
    assert page.resolve().is_relative_to(tmp_path / "one" / "made")
    monkeypatch.chdir("../other")
    with pytest.raises(vsr.InputError, match="another working folder"):
        found.vsr.replay(pga=0.9, pgv_pga=0.3)
    assert [path.name for path in Path.cwd().iterdir()] == ["rock.yaml"]
    monkeypatch.chdir("../one")
    assert found.vsr.replay(pga=0.9, pgv_pga=0.3).path == page
    shutil.copy(tmp_path / "other" / "rock.yaml", "rock.yaml")
    with pytest.raises(vsr.InputError, match="other files or settings"):
        found.vsr.replay(pga=0.9, pgv_pga=0.3)


MANY = """vsr.responses(
    vsr.box(1, 1, 2, density=2000), vsr.pulses({"start": 0.1, "stop": 1, "num": 120}, [0.1, 0.3]),
    yaw=30, simulation={"engine": "bullet", "time_step": 0.002}, workers=2)
"""


@pytest.mark.slow
def test_a_process_of_a_pool_has_no_workers(tmp_path: Path) -> None:
    given = ["from multiprocessing import Pool", "import vsr", "def f(_):", "    try:"]
    given += ["        " + MANY.replace("\n", " "), "    except vsr.InputError as error:"]
    given += ["        return str(error)", "if __name__ == '__main__':"]
    given += ["    with Pool(1) as pool:", "        print(*pool.map(f, [0]))"]
    assert "give workers=0" in script(tmp_path, given).stdout


@pytest.mark.slow
def test_a_script_that_its_workers_would_run_again_is_told(tmp_path: Path) -> None:
    ended = script(tmp_path, ["import vsr", "print('top')", MANY])
    assert ended.returncode
    assert ended.stderr.count("has its calls below if __name__") == 3
    assert ended.stderr.count("Traceback") == 1


def script(folder: Path, lines: list[str]) -> subprocess.CompletedProcess[str]:
    (folder / "script.py").write_text("\n".join(lines))
    told = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "script.py"]
    return subprocess.run(command, cwd=folder, env=told, capture_output=True, text=True)


def test_a_scan_is_found_from_the_working_folder() -> None:
    Path("𐀀 rock").mkdir()  # a letter of four bytes
    trimesh.creation.box((0.5, 0.6, 1.5)).subdivide().export("𐀀 rock/é.ply")
    found = vsr.responses(vsr.mesh("𐀀 rock/é.ply", 2500.0), PULSES, name="scan", **QUICK)
    assert found["overturned"].values.ravel().tolist() == [0, 1]


def test_a_name_that_is_no_text_is_refused() -> None:
    with pytest.raises(vsr.InputError, match="not in UTF-8"):
        vsr.responses(vsr.mesh("\udcff.ply", 2500.0), PULSES, **QUICK)


def test_a_text_of_any_letters_arrives_as_it_is(tmp_path: Path) -> None:
    text = "a\x85b \u2028 \x7f\x9f\ufffe\U00010000é"
    path = vsr._written(tmp_path, "rock", {"text": text, "lone": "\udcff"})
    assert load_yaml(path.read_text(encoding="utf-8"))["text"] == text
    assert vsr._written(tmp_path, "rock", {"text": "another"}) == path


def test_what_has_no_dataset_is_refused_before_any_work() -> None:
    with pytest.raises(vsr.InputError, match="got stability; it has no dataset"):
        vsr.run("stability", BLOCK)
    assert not Path("data").exists()


@pytest.mark.parametrize(
    ("site", "layer", "words"),
    [
        (None, {}, "site: got None"),
        (BLOCK, [1], r"layers: got \[1\]"),
        (BLOCK, {"yaw": {1, 2}}, r"got \{1, 2\}; a value is a number"),
        (BLOCK, {"yaw": (one for one in (1, 2))}, "got <generator"),
        (BLOCK, {"yaw": np.array(["2020"], dtype="M8[Y]")}, r"datetime\.date"),
        (BLOCK, {"rock": {(1, 2): 3}}, r"\{\(1, 2\): 3\}"),
        (BLOCK, {"yaw": b"90"}, "got b'90'; a value is a number"),
    ],
)
def test_what_is_no_setting_is_refused(site: Any, layer: Any, words: str) -> None:
    with pytest.raises(vsr.InputError, match=words):
        vsr.run("rock", site, layer, workers=0)
    assert not Path("data").exists()


@pytest.mark.parametrize("name", ["../up", "a/b", "/up", "a\nb", "", ".", "..", "x" * 300, 5])
def test_a_name_that_is_no_folder_of_results_is_refused(name: Any, tmp_path: Path) -> None:
    with pytest.raises(vsr.InputError, match=r"^vsr\.run: (name: )?got [^\n]*$"):
        vsr.run("rock", BLOCK, derived="results", name=name, workers=0)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_an_empty_folder_of_results_is_refused(tmp_path: Path) -> None:
    """As of the command; only None is the default."""
    with pytest.raises(vsr.InputError, match=r"^--derived: got ''; "):
        vsr.run("rock", BLOCK, derived="", workers=0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("key", ["derived", "study"])
@pytest.mark.parametrize("path", [5, b"results", ["results"], "a\0b"])
def test_what_is_no_path_is_refused(key: str, path: Any, tmp_path: Path) -> None:
    with pytest.raises(vsr.InputError, match=rf"^vsr\.run: {key}: got [^\n]*; it is a name or a"):
        vsr.run("rock", BLOCK, workers=0, **{key: path})
    with pytest.raises(vsr.InputError, match=r"^vsr\.run: hazard\.curves: got "):
        vsr.hazard(BLOCK, curves=path)
    assert list(tmp_path.rglob("*.nc")) == []


@pytest.mark.parametrize("own", ["# mine\nrock: {shape: box}\n", '{"rock": 1}\n', "", "\0"])
def test_a_file_by_another_hand_is_not_written_over(own: str, tmp_path: Path) -> None:
    path = tmp_path / "rock.yaml"
    path.write_text(own)
    with pytest.raises(vsr.InputError, match=r"rock\.yaml: got a file by another hand"):
        vsr.run("rock", BLOCK, derived=tmp_path, workers=0)
    assert path.read_text() == own


def test_what_was_changed_by_hand_is_not_written_over(tmp_path: Path) -> None:
    """A number in an editor; what nobody changed is that of the rock which is given."""
    other = vsr.box(0.5, 0.5, 1.0, density=2650.0)
    for given in (BLOCK, other):
        vsr.run("rock", given, derived=tmp_path, workers=0)
    path = tmp_path / "rock.yaml"
    path.write_text(path.read_text().replace("2650.0", "2651.0"))
    with pytest.raises(vsr.InputError, match=r"rock\.yaml: got a file by another hand"):
        vsr.run("rock", other, derived=tmp_path, workers=0)
    assert "2651.0" in path.read_text()


@pytest.mark.slow
def test_each_thread_gets_the_rock_that_it_asks_for() -> None:
    masses = [1000.0, 2000.0, 3000.0, 4000.0] * 5

    def asked(number: int) -> float:
        block = vsr.box(1.0, 1.0, 1.0, masses[number])
        made = vsr.run("rock", block, derived="results", name=f"block_{number % 3}", workers=0)
        return float(made.attrs["mass_kg"])

    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(asked, range(len(masses)))) == pytest.approx(masses)


def test_curves_and_tests_are_found_from_the_working_folder() -> None:
    with pytest.raises(vsr.InputError, match=r"^curves: got folder not found") as refused:
        vsr.hazard(BLOCK, PULSES, curves="curves", hazard={"age": {"kind": "normal", "mean": 1e4}})
    assert "derived" not in str(refused.value)
    with pytest.raises(vsr.InputError, match="my_tests"):
        vsr.run("validation", "my_tests")


@pytest.mark.slow
def test_a_dataset_shows_its_page_its_figure_and_its_runs_in_a_notebook() -> None:
    made = vsr.fragility(BLOCK, PULSES, derived="results", **QUICK)
    shown = re.search(r'srcdoc="([^"]*)"', made.vsr._repr_html_())
    assert shown is not None
    page = Path("results", "rock", "report.html").read_text(encoding="utf-8")
    assert 'href="../index.html"' in page
    assert "All results" not in shown[1]  # a link that would lead nowhere
    assert html.unescape(shown[1]).endswith(page.partition("<header>")[2])
    (diagram,) = made.vsr.plot(yaw=0).axes
    assert diagram.get_xlabel() == "peak ground acceleration [g]"
    run = made.vsr.replay(yaw=made.yaw[0], pga=made.pga[1], pgv_pga=0.3)
    assert "Replay of a run" in run._repr_html_()
    assert run.path.parent.name == "replays"


def test_responses_without_a_page_show_themselves_in_short() -> None:
    made = vsr.responses(BLOCK, PULSES, yaw=[0, 30], **QUICK)
    shown = re.sub(r"<[^>]*>|\s+", " ", made.vsr._repr_html_()).split()
    balanced, overturned = ((made.outcome == code).sum().item() for code in (0, 1))
    said = " ".join(shown)
    assert "rock box, 0.5 \N{MULTIPLICATION SIGN} 1 \N{MULTIPLICATION SIGN} 2 m, 2110 kg" in said
    assert f"runs 4: {balanced} balanced, {overturned} overturned" in said
    assert "error of the boundary not measured, at a time step of 4 ms" in said
    one = re.sub(r"<[^>]*>|\s+", " ", made.isel(yaw=0).vsr._repr_html_())
    assert "runs 2: 2 overturned" in " ".join(one.split())  # at 0.3 g, as it is 1:4
    found = vsr.run("boundary", BLOCK, PULSES, yaw=[0, 30], **QUICK).vsr._repr_html_()
    assert "first overturning" in found
    for over in (made.max("yaw"), made.max("pga"), made.isel(yaw=0, drop=True)):
        assert " runs " not in over.vsr._repr_html_()
    with pytest.raises(vsr.InputError, match=r"report\.html was not made; call vsr\.fragility"):
        made.vsr.page  # noqa: B018 (it is the asking that fails)
    again = vsr.responses(BLOCK, vsr.pulses(made.pga, made.pgv_pga), yaw=made.yaw, **QUICK)
    assert again.equals(made)  # asked for by its coordinates
    (cells,) = made.vsr.plot(yaw=30).axes
    assert cells.get_xlabel() == "peak ground acceleration [g]"
    assert cells.get_title() == "yaw 30 deg"
    assert cells.figure.legends[0].get_texts()[0].get_text() == "overturned"


@pytest.mark.slow
def test_a_part_of_a_fragility_shows_the_boundary_and_the_diagram_of_its_own_yaw() -> None:
    made = vsr.fragility(BLOCK, PULSES, yaw=[0, 90], **QUICK)
    Path(made.encoding["source"]).with_name("report.html").unlink()
    at = made.first_overturning_pga.isel(friction=0, pgv_pga=0)
    said = re.sub(r"<[^>]*>|\s+", " ", made.vsr._repr_html_())
    assert f" {at.min().item():#.4g} [" in said
    assert re.search(rf" to {at.max().item():#.4g} \[[^]]*\] g at yaw 90 deg", said)
    thick = made.sel(yaw=90).vsr.plot().axes[0]
    assert thick.get_title() == "yaw 90 deg"
    (strokes,) = (one for one in thick.collections if one.get_gid() == "cells")
    held = vsr.responses(BLOCK, PULSES, yaw=[0, 90], **QUICK).sel(yaw=90)
    assert (strokes.get_array() == 2).sum() == (held.overturned == 1).sum()
    rows = vsr.pulses([0.3, 0.9], [0.1, 0.3, 0.5])
    many = vsr.fragility(BLOCK, rows, name="many", **QUICK)
    ran = vsr.responses(BLOCK, rows, name="many", **QUICK)
    for part in ([0, 2], [2, 1]):
        axes = many.isel(pgv_pga=part).vsr.plot().axes[0]
        (cells,) = (one for one in axes.collections if one.get_gid() == "cells")
        overturned = ran.overturned.isel(pgv_pga=part, yaw=0, friction=0).values
        assert cells.get_array().shape == (2, 2)
        assert (cells.get_array() == 2).sum() == (overturned == 1).sum()
    for whole in (ran.isel(pgv_pga=[0, 2]), many):
        (one, other) = (
            next(c for c in axes.collections if c.get_gid() == "cells").get_array()
            for axes in (
                made.vsr.plot().axes[0] for made in (whole, whole.transpose().isel(pga=[1, 0]))
            )
        )
        assert (one == other).all()
    pictures = [one.vsr.plot()._repr_png_() for one in (many, many.isel(bound=[1, 0]))]  # type: ignore[attr-defined]
    assert pictures[0] == pictures[1]
    joined = xr.concat(
        [many.isel(pgv_pga=[0]), many.isel(pgv_pga=[1, 2])], "pgv_pga", data_vars="all"
    )
    for other, words in (
        (joined, "values along pgv_pga; the figure needs variables along the dim"),
        (many.isel(bound=[0]), "bound: got a part; the figure needs all"),
        (many.isel(pgv_pga=[]), "pgv_pga: got a part; the figure needs all"),
    ):
        with pytest.raises(vsr.InputError, match=words):
            other.vsr.plot()
    with pytest.raises(vsr.InputError, match="beta: the figure needs all variables"):
        many.drop_vars("beta").vsr.plot()


def test_a_dataset_of_a_file_alone_says_how_its_runs_are_replayed() -> None:
    made = vsr.responses(BLOCK, PULSES, derived="results", name="elsewhere", **QUICK)
    path = Path(made.encoding["source"])
    copy = Path(shutil.copytree(path.parent, "copy")) / path.name
    with pytest.raises(vsr.InputError, match=r"with which vsr made .* call vsr\.fragility"):
        xr.open_dataset(copy).vsr.replay(yaw=0, pga=0.9, pgv_pga=0.3)


@pytest.mark.slow
def test_what_a_dataset_does_not_have_is_refused() -> None:
    made = vsr.responses(BLOCK, PULSES, **QUICK)
    rock = vsr.run("rock", BLOCK, **QUICK)
    with pytest.raises(vsr.InputError, match="got rock; responses, fragility, displacement and"):
        rock.vsr.plot()
    with pytest.raises(vsr.InputError, match=r"rock\.html was not made; see the dataset itself"):
        rock.vsr.page  # noqa: B018 (it is the asking that fails)
    with pytest.raises(vsr.InputError, match=r"the grid of the study has PGA 0\.3, 0\.9 g"):
        made.vsr.replay(yaw=0, pga=0.5, pgv_pga=0.3)
    with pytest.raises(vsr.InputError, match="a dataset of a product"):
        xr.Dataset({"x": 1}).vsr  # noqa: B018
    fragile = vsr.fragility(BLOCK, PULSES, **QUICK)
    with pytest.raises(vsr.InputError, match="yaw: got 7; it is one of 0; give one of these"):
        fragile.vsr.plot(yaw=7)
    for part in (made.isel(pga=0), made.sel(pgv_pga=0.3), xr.concat([made, made], "z")):
        with pytest.raises(
            vsr.InputError, match="the figure needs all dimensions but yaw and fric"
        ):
            part.vsr.plot()
    for part in (made.isel(yaw=0, drop=True), made.mean(["yaw", "friction"])):
        with pytest.raises(vsr.InputError, match=r"yaw: got dropped, or averaged over; the figure"):
            part.vsr.plot()
    for lost in (made.drop_vars("pga"), fragile.drop_vars("pgv_pga")):
        with pytest.raises(vsr.InputError, match=r"pga: got dropped, or averaged over"):
            lost.vsr.plot()
    with pytest.raises(vsr.InputError, match="pga: got values twice; the figure has each value"):
        made.isel(pga=[1, 0, 1]).vsr.plot()
    with pytest.raises(vsr.InputError, match="got yaw 7 deg; it is of the runs beside it"):
        fragile.assign_coords(yaw=[7.0]).vsr.plot(yaw=7)
    for wrong in ({"yaw": "x"}, {"yaw": [0]}, {"friction": float("nan")}):
        with pytest.raises(vsr.InputError, match=r"got .* it is one of 0(\.6)?; give one"):
            made.vsr.plot(**wrong)


@pytest.mark.slow
def test_a_part_of_a_displacement_or_a_branch_of_a_hazard_is_refused(tmp_path: Path) -> None:
    made = tumbling.displacement(runs=3, samples=20).assign_attrs(vsr_key="one")
    made.to_netcdf(tmp_path / "displacement.nc")
    tumbling.terrain().assign_attrs(source="a program").to_netcdf(tmp_path / "terrain.nc")
    tumbling.rock().assign_attrs(shape_source="a surrogate").to_netcdf(tmp_path / "rock.nc")
    whole = xr.load_dataset(tmp_path / "displacement.nc")
    figure = whole.vsr.plot()
    assert len(figure.axes) > 1
    assert [text.get_text() for text in figure.texts if text.get_gid() == "source"] == [
        "a surrogate"
    ]
    for part in (whole.isel(run=[0, 1]), whole.isel(run=1), whole.isel(sample=slice(5))):
        with pytest.raises(vsr.InputError, match="the figure needs all runs and their samples"):
            part.vsr.plot()
    hazard = xr.Dataset({"survival_at_age": (("branch", "age"), np.ones((2, 3)))})
    hazard.assign_attrs(vsr_key="one").to_netcdf(tmp_path / "hazard.nc")
    with pytest.raises(vsr.InputError, match="branch: the figure needs all dimensions"):
        xr.load_dataset(tmp_path / "hazard.nc").isel(branch=0).vsr.plot()


@pytest.mark.slow
def test_a_friction_is_chosen_around_the_circle() -> None:
    several = {"yaw": [0, 90], "contact": {"friction": [0.4, 0.6]}}
    made = vsr.fragility(BLOCK, PULSES, **QUICK, **several)
    drawn = [made.vsr.plot(friction=one).axes[0].lines for one in (None, 0.6)]
    assert len(drawn[0]) == 2 * len(drawn[1])
    with pytest.raises(vsr.InputError, match=r"friction: got 99; it is one of 0\.4, 0\.6"):
        made.vsr.plot(friction=99)


@pytest.mark.slow
def test_a_replay_is_of_its_own_rock_whatever_was_refused_since() -> None:
    made = vsr.responses(BLOCK, PULSES, **QUICK)
    with pytest.raises(vsr.InputError):
        vsr.responses(vsr.box(1.0, 1.0, 1.2, density=-1.0), PULSES, **QUICK)
    made.vsr.replay(yaw=0, pga=0.9, pgv_pga=0.3)
    rock = load_yaml(Path("data/derived/rock.yaml").read_text())["rock"]
    assert rock["size"] == [0.5, 1.0, 2.0]


@pytest.mark.slow
@pytest.mark.parametrize("change", ["same product", "another product", "removed"])
def test_a_dataset_whose_folder_holds_another_result_shows_nothing(change: str) -> None:
    made = vsr.responses(BLOCK, PULSES, **QUICK)
    shown = made.vsr
    if change == "removed":
        shutil.rmtree("data")
    else:
        product = {"same product": "responses", "another product": "rock"}[change]
        vsr.run(product, vsr.box(1.0, 1.0, 1.2, density=2110), PULSES, **QUICK)
    for show in (shown._repr_html_, shown.plot, lambda: shown.replay(yaw=0, pga=0.9)):
        with pytest.raises(
            vsr.InputError, match=r"rock/responses\.nc: got (ano|no such)[^\n]*name="
        ):
            show()


def test_the_module_started_as_a_program_is_the_command() -> None:
    said = [
        subprocess.run([sys.executable, "-m", name, "run", "hazrd"], cwd=ROOT, capture_output=True)
        for name in ("vsr", "pipeline")
    ]
    assert [one.returncode for one in said] == [2, 2]
    assert said[0].stderr == said[1].stderr
