"""Files of a user that are written over while a command reads them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
import xarray as xr
from conftest import Ran
from support import record_files

from pipeline import ROOT
from pipeline.config.hazard_schema import HazardRock
from pipeline.config.layers import load_site
from pipeline.config.observation_schema import ShakeTest
from pipeline.config.priors_schema import ScanErrorConfig
from pipeline.config.problems import InputError
from pipeline.stages.hazard import curve_folder, fault_files, other_rocks
from pipeline.stages.mesh import sources
from pipeline.stages.motions import record_inputs, table_motions
from pipeline.stages.motions.motion_grid import MotionFiles
from pipeline.stages.observations import shaking
from pipeline.stages.uncertainty import draws as drawing
from pipeline.workflow import graph, keys
from vsr_core.surrogates.double_rock import double_rock

BOX = "rock: {shape: box, size: [0.5, 0.5, 1.0], density: 2110}\n"
ORDER = "processing: {order: none, highpass: null, lowpass: null}"
RECORDS = f"motion: {{kind: record, files: wave.csv, pga: [1], {ORDER}}}\n"
TABLE = "motion: {kind: table, files: moves.csv, pga: [1]}\n"
HAZARD = "hazard: {curves: curves, faults: faults.csv, age: {kind: normal, mean: 900}}\n"


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    """Some of each kind that is read before anything is made of it."""
    made_up = ROOT / "data" / "raw" / "hazard"
    shutil.copytree(made_up / "made_up", tmp_path / "curves")
    shutil.copy(made_up / "made_up_faults.csv", tmp_path / "faults.csv")
    wave = 3.0 * np.cos(np.linspace(0.0, 2.0 * np.pi, 401))
    (tmp_path / "wave.csv").write_text(record_files.csv(wave, 0.005))
    time = np.linspace(0.0, 2.0, 401)
    rows = np.column_stack([time, 0.1 * (1.0 - np.cos(np.pi * time))])
    np.savetxt(tmp_path / "moves.csv", rows, "%.9g", ",", header="time [s],x [m]", comments="")
    return tmp_path


def edited_once_read(
    monkeypatch: pytest.MonkeyPatch, module: ModuleType, function: str, path: Path
) -> None:
    read = getattr(module, function)

    def read_and_edited(*given: Any) -> Any:
        found = read(*given)
        path.write_bytes(path.read_bytes() + b"# later\n")
        return found

    monkeypatch.setattr(module, function, read_and_edited)


@pytest.mark.parametrize(
    ("product", "text", "module", "function", "name"),
    [
        ("motions", RECORDS, record_inputs, "read", "wave.csv"),
        ("motions", TABLE, table_motions, "load", "moves.csv"),
        ("hazard", HAZARD, curve_folder, "load", "curves/hazard_curve-rlz-000-PGA_1.csv"),
        ("exclusion", HAZARD, fault_files, "_faults", "faults.csv"),
    ],
)
def test_the_key_is_of_what_was_read(
    product: str,
    text: str,
    module: ModuleType,
    function: str,
    name: str,
    inputs: Path,
    write_site: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    site, old = write_site(BOX + text), keys.digest_file(inputs / name)
    edited_once_read(monkeypatch, module, function, inputs / name)
    own = graph.identities(product, load_site(site))[product]
    assert old != keys.digest_file(inputs / name)
    assert own.facts["inputs"][Path(name).name] == old


def test_a_record_that_is_written_while_it_is_read_makes_nothing(
    inputs: Path,
    write_site: Callable[..., str],
    vsr: Callable[..., Ran],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    site = write_site(BOX + RECORDS)
    with monkeypatch.context() as patch:
        edited_once_read(patch, record_inputs, "read", inputs / "wave.csv")
        ran = vsr("run", "motions", "--site", site)
    assert ran.code == 2
    assert "wave.csv edited while a command that reads it was at work" in ran.err
    assert not (derived / "rock" / "motions.nc").exists()
    assert vsr("run", "motions", "--site", site).code == 0


@pytest.mark.parametrize(("line", "code"), [("1", 2), ("# said", 0)])
def test_code_that_is_edited_while_it_is_at_work_makes_nothing(
    line: str,
    code: int,
    write_site: Callable[..., str],
    vsr: Callable[..., Ran],
    derived: Path,
    code_copy: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Which of both texts made it is not known: a module is imported when a stage needs it."""
    module, work_of = code_copy / "pipeline/stages/motions/motions.py", graph.work_of

    def work_and_edit(*given: Any) -> Any:
        module.write_text(module.read_text().replace("\n    return ", f"\n    {line}\n    return "))
        return work_of(*given)

    monkeypatch.setattr(graph, "work_of", work_and_edit)
    ran = vsr("run", "motions", "--site", write_site())
    assert ran.code == code
    assert ("got code pipeline.stages.motions.motions:" in ran.err) == (code == 2)
    assert ("command that reads it was at work" in ran.err) == (code == 2)
    assert (derived / "rock" / "motions.nc").exists() == (code == 0)


@pytest.mark.parametrize("gone", [False, True])
def test_code_that_is_broken_when_it_is_imported_was_edited(
    gone: bool,
    write_site: Callable[..., str],
    vsr: Callable[..., Ran],
    derived: Path,
    code_copy: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = code_copy / "pipeline/stages/motions/motions.py"

    def save_and_import(*_: Any) -> None:
        module.write_text("def make(:\n")
        if gone:
            module.unlink()
        compile(module.read_text(), module, "exec")

    monkeypatch.setattr(graph, "work_of", save_and_import)
    ran = vsr("run", "motions", "--site", write_site())
    assert ran.code == 2
    assert ran.err.splitlines()[-1].startswith("vsr: pipeline.stages.motions.motions: got what was")
    assert ("No such file" if gone else "SyntaxError") in ran.err
    assert not (derived / "vsr-fault.txt").exists()


def test_what_was_saved_for_a_moment_is_not_kept(
    inputs: Path,
    write_site: Callable[..., str],
    vsr: Callable[..., Ran],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Another record, while it was read: the file has its old content before and afterwards."""
    site, wave, held = write_site(BOX + RECORDS), inputs / "wave.csv", keys.held
    text = wave.read_bytes()

    def held_for_a_moment(path: Path, largest: int) -> bytes:
        wave.write_bytes(text.replace(b"3,", b"4,"))
        found = held(path, largest)
        wave.write_bytes(text)
        return found

    with monkeypatch.context() as patch:
        patch.setattr(keys, "held", held_for_a_moment)
        ran = vsr("run", "motions", "--site", site)
    assert ran.code == 2
    assert "edited while a command that reads it was at work" in ran.err
    assert vsr("run", "motions", "--site", site).code == 0


@pytest.mark.slow
def test_a_member_of_another_record_is_compared_with_none(
    inputs: Path,
    write_site: Callable[..., str],
    vsr: Callable[..., Ran],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The record was another one while the second member was begun, and is the first again."""
    site, wave, make = write_site(BOX + RECORDS), inputs / "wave.csv", graph.make
    (inputs / "dense.yaml").write_text("sweep: {dense: {rock.density: [2000, 3000]}}\n")
    text = wave.read_bytes()

    def make_of_another(product: str, job: Any) -> int:
        if job.site.config.rock.density == 3000.0:
            wave.write_bytes(text + b"# another\n")
        return make(product, job)

    def put_back(function: Callable[..., Any]) -> Callable[..., Any]:
        def then(*given: Any) -> Any:
            found = function(*given)
            wave.write_bytes(text)
            return found

        return then

    study = ("run", "fragility", "--site", site, "--study", inputs / "dense.yaml")
    with monkeypatch.context() as patch:
        patch.setattr(graph, "make", put_back(make_of_another))
        ran = vsr(*study)
    assert ran.code == 2
    assert "made of files as they were in between" in ran.err
    assert not [*derived.rglob("study.nc")]
    assert vsr(*study).code == 0


@pytest.mark.slow
def test_a_motion_and_a_second_scan_are_those_of_the_key_when_they_are_read(inputs: Path) -> None:
    """They are read long after their digests, and were saved otherwise in between."""
    wave, copy = inputs / "wave.csv", inputs / "copy.obj"
    vertices, faces = double_rock()
    rng = np.random.default_rng(1)
    scans = [vertices + 0.002 * rng.standard_normal(vertices.shape) for _ in range(2)]
    trimesh.Trimesh(scans[1], faces).export(copy)
    test = ShakeTest(kind="shake", motion="wave.csv", direction=0.0, outcome="stood")
    shaken = shaking.ShakenBy(((0, wave, test),), "rock.yaml", {})
    shaken = replace(shaken, before=shaken.digests())
    second = drawing.Replica(copy, "rock.yaml")
    second = replace(second, before=second.digests())
    dataset = xr.Dataset(
        {"surface_vertex": (("v", "axis"), scans[0]), "surface_face": (("f", "corner"), faces)},
        attrs={"shape_source": "scan"},
    )
    rock: Any = SimpleNamespace(data=dataset)
    assert shaken.motion(0).duration > 0.0
    assert drawing.surface(rock, ScanErrorConfig(), second).replica
    for path in (wave, copy):
        path.write_bytes(path.read_bytes() + b"\n")
    with pytest.raises(InputError, match=r"wave.csv.*edited while a command that reads it"):
        shaken.motion(0)
    with pytest.raises(InputError, match=r"copy.obj.*edited while a command that reads it"):
        drawing.surface(rock, ScanErrorConfig(), second)


@pytest.mark.parametrize("name", ["rock.obj", "terrain.obj", "archive.csv"])
def test_a_scan_and_an_archive_are_those_of_the_key_when_they_are_read(
    name: str, tmp_path: Path, write_site: Callable[..., str]
) -> None:
    """They are read long after their digests, and were saved otherwise in between."""
    vertices, faces = double_rock()
    trimesh.Trimesh(vertices, faces).export(tmp_path / "rock.obj")
    trimesh.Trimesh(vertices, faces).export(tmp_path / "terrain.obj")
    header = "name,alpha_1_deg,alpha_2_deg,r_1_m,r_2_m,height_m,azimuth_deg,friction,roundness"
    (tmp_path / "archive.csv").write_text(f"{header}\nA,12,17,0.84,0.86,1.7,40,0.7,\n")
    pedestal = "pedestal: {shape: mesh, mesh: terrain.obj}\n"
    site = load_site(
        write_site(f"rock: {{shape: mesh, mesh: rock.obj, density: 2110}}\n{pedestal}")
    )
    rock = sources.find(site.config.rock, site.config.pedestal, site)
    ground = sources.find_ground(site.config.pedestal, site)
    assert rock is not None
    assert ground is not None
    dated = {"site": "A", "archive": "archive.csv", "age": {"kind": "normal", "mean": 900}}
    archived = other_rocks._other(HazardRock.model_validate(dated), site, drawn=False)
    read: dict[str, Callable[[], object]] = {
        "rock.obj": partial(sources.load, rock, site),
        "terrain.obj": partial(sources.load_ground, ground, site),
        "archive.csv": partial(archived.fragility, tmp_path),
    }
    assert read[name]() is not None
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes() + b"\n")
    with pytest.raises(InputError, match=f"{name}.*edited while a command that reads it"):
        read[name]()


def test_a_record_that_comes_while_others_are_read_waits_for_the_next_command(
    inputs: Path, write_site: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (inputs / "waves").mkdir()
    (inputs / "wave.csv").rename(inputs / "waves" / "wave.csv")
    digest_file = keys.digest_file

    def digest_as_one_comes(path: Path) -> str:
        late = record_files.csv(np.cos(np.linspace(0.0, 2.0 * np.pi, 201)), 0.005)
        (inputs / "waves" / "late.csv").write_text(late)
        return digest_file(path)

    monkeypatch.setattr(keys, "digest_file", digest_as_one_comes)
    site = load_site(write_site(BOX + RECORDS.replace("wave.csv", "waves")))
    own = graph.identities("motions", site)["motions"]
    (found,) = (one for one in own.inputs.values() if isinstance(one, MotionFiles))
    assert [one.name for one in found.records] == ["wave"]
    assert "late.csv" not in own.facts["inputs"]
