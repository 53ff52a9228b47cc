"""A scan of a rock alone with faults: what `vsr prep` makes and shows of it, and what runs take."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import Ran
from matplotlib.figure import Figure

from pipeline.stages.mesh import scan_figures
from pipeline.workflow.datasets import read

Vsr = Callable[..., Ran]

DENSITY = 2000.0


def stone() -> trimesh.Trimesh:
    """A ball with a flat base."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    points = np.array(ball.vertices)
    points[:, 2] = np.maximum(points[:, 2], -0.35)
    return trimesh.Trimesh(points, ball.faces, process=False)


def site(folder: Path, mesh: trimesh.Trimesh, kind: str = "ply", more: str = "") -> Path:
    content = mesh.export(file_type=kind)
    (folder / f"rock.{kind}").write_bytes(content.encode() if isinstance(content, str) else content)
    path = folder / "stone.yaml"
    path.write_text(f"rock: {{shape: mesh, mesh: rock.{kind}, density: {DENSITY}{more}}}\n")
    return path


def faulty() -> trimesh.Trimesh:
    """Its normals inward, two faces missing, a speck beside it."""
    speck = trimesh.creation.icosphere(subdivisions=0, radius=0.01)
    speck.apply_translation((1.0, 0.0, 0.0))
    kept = np.delete(stone().faces, (300, 900), axis=0)[:, ::-1]
    wrong = trimesh.Trimesh(stone().vertices, kept, process=False)
    return trimesh.util.concatenate([wrong, speck])


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[object, ...]]:
    """What would be drawn, by figure."""
    asked: dict[str, tuple[object, ...]] = {}
    for name in ("rock_from_sides", "scan_from_sides", "tippings"):

        def draw(*given: object, name: str = name) -> Figure:
            asked[name] = given
            return Figure(figsize=(0.1, 0.1))

        monkeypatch.setattr(scan_figures, name, draw)
    return asked


@pytest.mark.parametrize("kind", ["ply", "stl", "obj", "dae"])
def test_a_faulty_export_gives_the_rock_itself(
    tmp_path: Path, vsr: Vsr, derived: Path, kind: str
) -> None:
    assert vsr("run", "rock", "--site", site(tmp_path, faulty(), kind)).code == 0
    found = read(derived / "stone" / "rock.nc")
    assert found.attrs["mass_kg"] == pytest.approx(DENSITY * stone().volume, rel=1e-5)
    for word in ("all faces turned outward", "1 loose piece dropped", "of their rims: 2"):
        assert word in found.attrs["repaired"]


def test_page_of_holes_and_of_an_opening_beneath(
    tmp_path: Path, vsr: Vsr, derived: Path, drawn: dict[str, tuple[object, ...]]
) -> None:
    mesh = faulty()
    base = (mesh.triangles[:, :, 2] <= -0.35 + 1e-9).all(axis=1)
    area = mesh.area_faces[base].sum()
    mesh.update_faces(~base)
    where = site(tmp_path, mesh)
    ran = vsr("prep", "--site", where)
    assert ran.code == 0, ran.err
    folder = derived / "stone"
    assert f"-> {folder / 'prep.html'}" in ran.err
    assert str(folder / "rock.nc") in ran.err.splitlines()[-1]
    page = (folder / "prep.html").read_text()
    rows = re.findall(r'<tr><td class="n">(\d)</td><td>\((.*?)\)</td>', page)
    assert [number for number, _ in rows] == ["1", "2", "3"]
    assert np.fromstring(rows[0][1], sep=",") == pytest.approx([0.0, 0.0, -0.35], abs=0.01)
    missing = stone().triangles_center[[300, 900]]
    told = [np.fromstring(place, sep=",") for _, place in rows[1:]]
    for point in missing:
        assert min(np.abs(place - point).max() for place in told) < 0.01
    assert "beneath the rock: caps" in page
    assert 'id="closings"' in page
    vertices, faces, added, marks, _ = drawn["rock_from_sides"]
    assert len(marks) == 3
    shown = trimesh.Trimesh(vertices, faces, process=False)
    assert shown.area_faces[added].sum() == pytest.approx(area, rel=0.1)


def test_page_of_a_closed_scan(
    tmp_path: Path, vsr: Vsr, derived: Path, drawn: dict[str, tuple[object, ...]]
) -> None:
    assert vsr("prep", "--site", site(tmp_path, stone())).code == 0
    page = (derived / "stone" / "prep.html").read_text()
    assert "used unchanged" in page
    assert 'id="holes"' not in page
    assert not np.any(drawn["rock_from_sides"][2])


@pytest.mark.slow
def test_page_of_a_refusal(tmp_path: Path, vsr: Vsr, derived: Path) -> None:
    """With its picture; `plan`, which leaves nothing behind, names no page."""
    mesh = stone()
    mesh.update_faces(mesh.triangles_center[:, 0] < 0.4)
    where = site(tmp_path, mesh)
    ran = vsr("plan", "fragility", "--site", where)
    assert ran.code == 2
    assert "prep.html" not in ran.err
    assert not derived.exists() or not [*derived.rglob("prep.html")]
    ran = vsr("prep", "--site", where)
    page = derived / "stone" / "prep.html"
    assert ran.code == 2
    assert ran.err.splitlines()[-1].endswith(f"{page} shows it")
    text = page.read_text()
    for word in ("is refused", "a hole 0.6", "data:image/png", "Positions of", "fill the hole"):
        assert word in text
    (place,) = re.findall(r"<li>\((.*?)\)</li>", text)
    assert np.fromstring(place, sep=",") == pytest.approx([0.4, 0.0, 0.0], abs=0.05)
    assert vsr("prep", "--site", site(tmp_path, stone())).code == 0
    assert "is refused" not in page.read_text()


def test_a_mesh_of_one_point_is_refused_without_a_picture(tmp_path: Path, vsr: Vsr) -> None:
    (tmp_path / "point.obj").write_text("v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n")
    where = tmp_path / "point.yaml"
    where.write_text("rock: {shape: mesh, mesh: point.obj, density: 2600}\n")
    ran = vsr("prep", "--site", where)
    assert ran.code == 2, ran.err
    assert "got a rock 0 m large" in ran.err
    assert "shows it" not in ran.err
