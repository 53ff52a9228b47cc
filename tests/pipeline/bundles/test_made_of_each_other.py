"""Products are handed on, or compared, only as their stages wrote them, of each other."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from test_bundles import changed

from pipeline.bundles import checking, comparison, layout
from pipeline.bundles.export import export
from pipeline.config.problems import InputError
from pipeline.workflow.keys import digest_file
from pipeline.workflow.site_folder import FILE, SETTINGS
from pipeline.workflow.store import Store, manifest_text
from pipeline.workflow.writers import Writer, text

FRICTION = {"contact": {"friction": [0.6]}}


def put(folder: Path, stage: str, files: dict[str, Writer], **facts: Any) -> None:
    """Publish products as a stage does that read a friction."""
    made = {"config": FRICTION, "inputs": {}, "versions": {}, "code": {}, "needs": {}} | facts
    whole = {"key": f"key of {stage}", "facts": made, "unresolved": 0, "retry": 0}
    Store(folder).publish(stage, whole, files)


def manifest(folder: Path, stage: str) -> Path:
    return folder / ".stages" / f"{stage}.json"


def rewritten(path: Path, **facts: Any) -> None:
    path.write_text(manifest_text(json.loads(path.read_text()) | facts))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Results of a rock and of its runs, beside the settings of both."""
    (tmp_path / "mine").mkdir()
    found = tmp_path / "stone"
    head = "# resolved configuration of stone.yaml\ncontact: {friction: [0.6]}\n"
    put(found, SETTINGS, {FILE: text(head)})
    rewritten(manifest(found, SETTINGS), place=str(tmp_path / "mine" / "stone.yaml"))
    put(found, "rock", {"rock.csv": text("a rock")}, inputs={"m.ply": "0" * 64})
    for name in ("responses", "replay-yaw_0"):
        put(found, name, {f"{name}.html": text("<body>")}, needs={"rock": "key of rock"})
    return found


def exported(folder: Path, **options: str) -> list[str]:
    """Names of the files in a bundle of the folder."""
    path = folder.with_name("study.zip")
    export(folder, path, inputs=True, **{"licence": "", **options})
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def of_another_rock(folder: Path) -> None:
    rewritten(manifest(folder, "rock"), key="of a scan in place of the former")


def cut(folder: Path) -> None:
    path = manifest(folder, "rock")
    path.write_bytes(path.read_bytes()[:50])


def gone(folder: Path) -> None:
    manifest(folder, "rock").unlink()


def from_elsewhere(folder: Path) -> None:
    facts = {"config": {"contact": {"friction": [0.3]}}, "needs": {"rock": "key of rock"}}
    rewritten(manifest(folder, "responses"), facts=facts)


FAULTS = {
    of_another_rock: "rock was made anew since",
    cut: "rock: got a manifest that cannot be read",
    gone: "nothing there that tells of rock, which it was made of",
    from_elsewhere: "contact.friction changed: [0.3] is now [0.6]",
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_products_that_are_not_of_each_other_are_not_exported(
    fault: Callable[[Path], None], folder: Path, tmp_path: Path
) -> None:
    assert "results/rock.csv" in exported(folder)
    (tmp_path / "study.zip").unlink()
    fault(folder)
    with pytest.raises(InputError) as refusal:
        exported(folder)
    assert FAULTS[fault] in str(refusal.value)
    assert not (tmp_path / "study.zip").exists()


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_products_that_are_not_of_each_other_are_told_where_they_are_compared(
    fault: Callable[[Path], None], folder: Path, tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    assert not any(one.lines for one in comparison.compare(folder, folder, page)[:2])
    fault(folder)
    try:
        told = str(comparison.compare(folder, folder, page))
    except InputError as refusal:
        told = str(refusal)
    assert FAULTS[fault] in told


def test_how_a_stale_replay_is_made_again_is_told(folder: Path) -> None:
    of_another_rock(folder)
    manifest(folder, "responses").unlink()
    with pytest.raises(InputError, match=r"e\.g\. vsr replay --site .*stone\.yaml, or"):
        exported(folder)
    variant = folder.rename(folder.with_name("stone@rough"))
    with pytest.raises(InputError, match=r"vsr replay --site .*stone\.yaml --name rough, or"):
        exported(variant)


def test_of_a_folder_that_a_setting_names_only_inputs_are_exported(
    folder: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine"
    for name in ("m.ply", "secret.txt", "keys/mine.txt", "scans/m.ply", "scans/other.txt"):
        (mine / name).parent.mkdir(exist_ok=True)
        (mine / name).write_text(name.rpartition("/")[2])
    (mine / "scans" / "origin.json").write_text('{"from": "somewhere"}')
    settings = 'rock: {mesh: m.ply}\nage: {source: ""}\ncurves: .\nscan: scans\n'
    head = f"# resolved configuration of stone.yaml\n{settings}"
    put(folder, SETTINGS, {FILE: text(head)})
    rewritten(manifest(folder, SETTINGS), place=str(mine / "stone.yaml"))
    put(folder, "rock", {"rock.csv": text("")}, inputs={"m.ply": digest_file(mine / "m.ply")})
    wanted = ["m.ply", "scans/m.ply", "scans/origin.json", "stone.yaml"]
    assert [one for one in exported(folder) if one.startswith("inputs/")] == [
        f"inputs/{name}" for name in wanted
    ]


@pytest.mark.parametrize("licence", ["\udcff", "a\nb"])
def test_a_licence_that_is_no_line_of_text_is_refused(licence: str, folder: Path) -> None:
    with pytest.raises(InputError, match="--licence: got "):
        exported(folder, licence=licence)


def test_a_folder_whose_name_is_no_text_is_exported(folder: Path) -> None:
    assert exported(folder.rename(folder.with_name("b\udcff")))


@pytest.mark.parametrize("content", [b"", b"0  results/rock.csv\n"])
def test_checksums_that_are_not_those_of_the_files_are_told(content: bytes, folder: Path) -> None:
    exported(folder)
    bundle = folder.with_name("study.zip")
    assert checking.check(bundle)[0] == []
    changed(bundle, layout.SUMS, lambda old: content)
    assert checking.check(bundle)[0] == ["checksums.txt does not hold the checksums of bundle.json"]


def test_pages_that_commands_make_aside_are_known(write_site: Callable[..., str]) -> None:
    site = Path(write_site())
    told = layout.About.model_construct(base=".", site=site.name)
    stages: dict[str, dict[str, Any]] = {"feasible": {}, "replay-yaw_0": {}, "strange": {}}
    lines = list(checking._stages(site.parent, told, stages))
    assert lines == ["strange is a stage that is not known here"]


def test_a_full_folder_for_what_is_unpacked_is_not_the_bundles_fault(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    exported(folder)

    def full(*given: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("shutil.copyfileobj", full)
    with pytest.raises(InputError, match=r"TMPDIR: got .* full"):
        checking.check(folder.with_name("study.zip"))


def boundaries(tmp_path: Path, *values: list[float]) -> list[str]:
    """What is told of two boundaries."""
    folders = []
    for number, pga in enumerate(values):
        places = {"yaw": [0.0], "friction": [0.6], "pgv_pga": np.arange(float(len(pga)))}
        # below all that was run a middle is assumed, and there is no lower end
        lower, assumed = np.where(pga, pga, np.nan), np.where(pga, pga, 0.01 + 0.01 * number)
        found = {comparison.BOUNDARY: assumed, f"{comparison.BOUNDARY}_lower": lower}
        named = {name: (tuple(places), [[values]]) for name, values in found.items()}
        data = xr.Dataset(named, places)
        folders.append(tmp_path / str(number))
        put(folders[-1], "fragility", {"fragility.nc": data.to_netcdf}, code={"fit": str(number)})
        rewritten(manifest(folders[-1], "fragility"), key=str(number))
    (*_, found) = comparison.compare(*folders, tmp_path / "page.html")
    assert found.name == "boundary"
    return found.lines


def test_the_median_is_of_the_boundaries_that_differ(tmp_path: Path) -> None:
    assert boundaries(tmp_path, [0.2, 0.3, 0.4], [0.2, 0.3, 0.44]) == [
        "1 of 3 first-overturning PGAs differ, by a median of 10 % and 10 % at most"
    ]


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.filterwarnings("error")
def test_a_boundary_beyond_all_runs_is_no_number(tmp_path: Path, order: int) -> None:
    one, other = [0.0, np.inf, np.nan, 0.0], [0.3, np.nan, np.inf, 0.0]
    pairs = (
        ("below all that was run", "known"),
        ("above all that was run", "undecided"),
        ("undecided", "above all that was run"),
    )
    assert boundaries(tmp_path, *(one, other)[::order]) == [
        f"1 of 4 first-overturning PGAs: {' and '.join(pair[::order])}" for pair in pairs
    ]


def test_a_dataset_without_a_manifest_is_not_compared(tmp_path: Path) -> None:
    boundaries(tmp_path, [0.2], [0.3])
    manifest(tmp_path / "1", "fragility").unlink()
    parts = comparison.compare(tmp_path / "0", tmp_path / "1", tmp_path / "page.html")
    assert parts[-1] == replace(parts[-1], lines=["not compared: fragility.nc is not in both"])
