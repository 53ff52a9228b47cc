"""Meshes that are no rock are refused in one line; good ones weigh the same in every format."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure
from support.mesh_formats import ball, ply
from trimesh.exchange.dae import export_collada

from pipeline import ROOT, cli
from pipeline.stages.mesh import mesh_files, scan_figures
from pipeline.workflow.datasets import read
from vsr_core.errors import InvalidInput

FORMATS = ("ply", "stl", "obj", "dae", "glb")
DENSITY = 2000.0
ORIGINAL = ROOT.parent / "shared" / "data" / "double_rock" / "double_rock.ply"

Refused = Callable[..., str]


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what is refused: ``test_closed_rock.py`` looks at them."""
    monkeypatch.setattr(scan_figures, "scan_from_sides", lambda *given: Figure(figsize=(0.1, 0.1)))


def site(folder: Path, file: str, more: str = "") -> Path:
    path = folder / "scan.yaml"
    path.write_text(f"rock: {{shape: mesh, mesh: {file}, density: {DENSITY}{more}}}\n")
    return path


def open_above() -> trimesh.Trimesh:
    mesh = ball()
    mesh.update_faces(mesh.triangles_center[:, 2] < 0.42)
    return mesh


def through_itself() -> trimesh.Trimesh:
    mesh = ball()
    points = np.array(mesh.vertices)
    points[points[:, 2] > 0.44] += (0.03, 0.02, -1.2)  # the top, pulled out through the bottom
    return trimesh.Trimesh(points, mesh.faces, process=False)


def two_bodies() -> trimesh.Trimesh:
    other = ball()
    other.apply_translation([2.0, 0.0, 0.0])
    return trimesh.util.concatenate([ball(), other])


def millimetres() -> trimesh.Trimesh:
    mesh = ball()
    mesh.apply_scale(1500.0)  # a rock 1.5 m high
    return mesh


def kilometres() -> trimesh.Trimesh:
    mesh = ball()
    mesh.apply_scale(0.001)
    return mesh


def tilted() -> trimesh.Trimesh:
    mesh = trimesh.creation.box(extents=(0.6, 0.6, 1.0))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(40.0), [0, 1, 0]))
    return mesh


def overhanging() -> trimesh.Trimesh:
    """An oblique prism whose centre of mass is not above its base."""
    return prism(height=1.0, shift=(1.2, 0.0))


def on_a_map() -> trimesh.Trimesh:
    """At UTM coordinates, which single precision knows to 0.25 m."""
    mesh = ball()
    mesh.apply_translation([500_000.0, 3_900_000.0, 300.0])
    return mesh


def flat() -> trimesh.Trimesh:
    mesh = ball()
    mesh.apply_transform(np.diag([1.0, 1.0, 0.0, 1.0]))
    return mesh


BAD = {
    open_above: ("a hole 0.6", "at (0.00, 0.00, 0.4", "20% of the rock's size, 0.2 m", "fill"),
    through_itself: ("intersects itself", " at (", " more places", "remesh"),
    two_bodies: ("2 pieces", "one body", ".00, 0.00, 0.00); ", "alone"),
    millimetres: ("1.5e+03 m", "scale?", "rock.scale", "0.001"),
    kilometres: ("0.001 m", "scale?", "rock.scale"),
    tilted: ("falls", "stands as given", "upright"),
    overhanging: ("falls", "stands as given"),
    flat: (),
    on_a_map: ("single precision, in steps of 0.25", "0.1% of", "local origin"),
}


@pytest.mark.parametrize("make", BAD, ids=lambda make: make.__name__)
def test_unfit_mesh(tmp_path: Path, refused: Refused, make: Callable[[], trimesh.Trimesh]) -> None:
    (tmp_path / "rock.ply").write_bytes(make().export(file_type="ply"))
    where = site(tmp_path, "rock.ply")
    words = (str(where), "rock.mesh", "rock.ply", *BAD[make])
    page = (
        "" if make in (tilted, overhanging, on_a_map) else "prep.html"
    )  # of a closed mesh all is seen
    refused("run", "fragility", "--site", where, "--workers", "0", words=words, page=page)


@pytest.mark.xfail(reason="edges that cross edges exactly are not seen as piercing a face")
def test_mirrored_crossing(tmp_path: Path, refused: Refused) -> None:
    """The same, straight down: by symmetry all crossings are of edge with edge."""
    mesh = ball()
    points = np.array(mesh.vertices, dtype=np.float32)
    points[points[:, 2] > 0.44, 2] -= np.float32(1.2)
    crossed = trimesh.Trimesh(points, mesh.faces, process=False)
    (tmp_path / "rock.ply").write_bytes(crossed.export(file_type="ply"))
    where = site(tmp_path, "rock.ply")
    refused("run", "rock", "--site", where, words=("intersects itself",), page="prep.html")


def test_the_sphere_that_they_are_made_of_is_fit(
    tmp_path: Path, vsr: Callable[..., object]
) -> None:
    (tmp_path / "rock.ply").write_bytes(ball().export(file_type="ply"))
    assert vsr("run", "rock", "--site", site(tmp_path, "rock.ply")).code == 0


def test_scale_is_the_remedy_for_millimetres(
    tmp_path: Path, vsr: Callable[..., object], derived: Path
) -> None:
    (tmp_path / "rock.ply").write_bytes(millimetres().export(file_type="ply"))
    assert vsr("run", "rock", "--site", site(tmp_path, "rock.ply", ", scale: 0.001")).code == 0
    expected = DENSITY * float(ball().volume) * 1.5**3
    assert read(derived / "scan" / "rock.nc").attrs["mass_kg"] == pytest.approx(expected, rel=1e-5)


def test_a_map_in_double_precision_is_read(tmp_path: Path) -> None:
    (tmp_path / "rock.obj").write_text(on_a_map().export(file_type="obj"))
    found = mesh_files.read(tmp_path / "rock.obj")
    assert found.volume == pytest.approx(ball().volume, rel=1e-6)


def test_a_scan_is_named_alike_from_wherever_the_command_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball().export(tmp_path / "rock.ply")
    where, found = site(tmp_path, "rock.ply"), []
    for folder in (tmp_path.parent, tmp_path):
        monkeypatch.chdir(folder)
        assert cli.main(["run", "rock", "--site", str(where), "--derived", "made"]) == cli.DONE
        found.append((folder / "made" / where.stem / "rock.nc").read_bytes())
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        ("ascii.ply", lambda text: text[: text.rindex(b"\n3 ")], "where its header says"),
        ("ascii.ply", lambda text: text.replace(b"face 1280", b"face 1250"), "1922 lines where"),
        (
            "ascii.ply",
            lambda text: re.sub(rb" \S+\n3 ", b"\n3 ", text, count=1),
            "of other numbers",
        ),
        ("ascii.ply", lambda text: text.replace(b"\n3 ", b"\n4 ", 1), "of other numbers than its"),
        (
            "binary.ply",
            lambda text: text.replace(b"face 1280", b"face 1277"),
            "other faces than the 1277",
        ),
        (
            "x.dae",
            lambda text: text.replace(b'count="1280"', b'count="1270"'),
            "1270 triangles whose corners",
        ),
        ("x.dae", lambda text: re.sub(rb"( \d+){6}</p>", b"</p>", text), "1280 triangles whose"),
        (
            "x.dae",
            lambda text: re.sub(rb" \S+</float_", b"</float_", text, count=1),
            "numbers of which others",
        ),
    ],
)
def test_a_mesh_of_another_number_of_parts_than_it_says_is_refused(
    tmp_path: Path, kind: str, change: Callable[[bytes], bytes], words: str
) -> None:
    path = tmp_path / f"rock.{kind[-3:]}"
    whole = ply(kind.split(".")[0]) if path.suffix == ".ply" else export_collada(ball())
    path.write_bytes(whole)
    assert mesh_files.read(path).volume == pytest.approx(ball().volume, rel=1e-5)
    assert change(whole) != whole
    path.write_bytes(change(whole))
    with pytest.raises(InvalidInput, match=words):
        mesh_files.read(path)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(
    "content",
    [b"", b"\x00\xff\x13garbage" * 40, b"not a mesh at all\n", b"<html><body>404</body></html>"],
    ids=["empty", "binary", "text", "page"],
)
def test_file_that_is_no_mesh(tmp_path: Path, refused: Refused, kind: str, content: bytes) -> None:
    (tmp_path / f"rock.{kind}").write_bytes(content)
    where = site(tmp_path, f"rock.{kind}")
    refused("run", "rock", "--site", where, words=(str(where), "rock.mesh", f"rock.{kind}"))


@pytest.mark.parametrize("kind", FORMATS)
def test_file_cut_short(tmp_path: Path, refused: Refused, kind: str) -> None:
    content = ball().export(file_type=kind)
    content = content.encode() if isinstance(content, str) else content
    (tmp_path / f"rock.{kind}").write_bytes(content[: len(content) * 2 // 3])
    where = site(tmp_path, f"rock.{kind}")
    words = (str(where), "rock.mesh", f"rock.{kind}")
    refused("run", "rock", "--site", where, words=words)


def test_missing_file(tmp_path: Path, refused: Refused) -> None:
    where = site(tmp_path, "nowhere.ply")
    words = (str(where), "rock.mesh", "nowhere.ply", "not found")
    refused("run", "rock", "--site", where, words=words)


def test_unknown_format(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "rock.xyz").write_text("0 0 0\n")
    where = site(tmp_path, "rock.xyz")
    refused("run", "rock", "--site", where, words=("rock.mesh", "rock.xyz", *FORMATS, "convert"))


def test_folder_without_and_with_too_many_scans(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "scans").mkdir()
    where = site(tmp_path, "scans/")
    refused("run", "rock", "--site", where, words=("rock.mesh", "no scan", "put a scan there"))
    for name in ("a.ply", "b.stl"):
        (tmp_path / "scans" / name).write_bytes(ball().export(file_type=name[-3:]))
    refused("run", "rock", "--site", where, words=("rock.mesh", "2 scans", "a.ply", "b.stl"))


def test_unknown_surrogate(tmp_path: Path, refused: Refused) -> None:
    where = site(tmp_path, "nowhere/", ", fallback: rosetta_stone")
    refused("run", "rock", "--site", where, words=("rock.fallback", "rosetta_stone", "double_rock"))


def test_a_surrogate_stands_for_the_scan_beside_which_it_is_named(
    tmp_path: Path, refused: Refused, vsr: Callable[..., object]
) -> None:
    where = site(tmp_path, "nowhere/", ", fallback: double_rock")
    mistyped = ("run", "rock", "--site", where, "--set", "rock.mesh=mine.ply")
    refused(*mistyped, words=("rock.mesh", "file not found", "mine.ply"))
    assert vsr(*mistyped, "--set", "rock.fallback=double_rock").code == 0
    assert vsr(*mistyped[:4], "--set", "rock.fallback=double_rock").code == 0


@pytest.mark.slow
def test_a_refused_scan_leaves_the_products_of_the_last_good_one(
    tmp_path: Path, vsr: Callable[..., object], derived: Path
) -> None:
    where = site(tmp_path, "rock.ply")
    (tmp_path / "rock.ply").write_bytes(ball().export(file_type="ply"))
    assert vsr("run", "rock", "--site", where).code == 0
    before = {p: p.read_bytes() for p in derived.rglob("*") if p.is_file()}
    (tmp_path / "rock.ply").write_bytes(open_above().export(file_type="ply"))
    assert vsr("run", "rock", "--site", where).code == 2
    assert {p: p.read_bytes() for p in before} == before
    page = derived / "scan" / "prep.html"
    assert "is refused" in page.read_text()
    (tmp_path / "rock.ply").write_bytes(ball().export(file_type="ply"))
    assert vsr("run", "rock", "--site", where).code == 0
    assert page.exists()  # nothing was made anew
    (tmp_path / "rock.ply").write_bytes(prism(HEIGHT, SHIFT).export(file_type="ply"))
    assert vsr("run", "rock", "--site", where).code == 0
    assert not page.exists()


# An oblique prism over a quadrilateral: volume and centre of mass in closed form.
BASE = np.array([(0.0, 0.0), (0.8, 0.1), (0.7, 0.6), (0.1, 0.5)])


def prism(height: float, shift: tuple[float, float]) -> trimesh.Trimesh:
    below = np.column_stack([BASE, np.zeros(4)])
    above = np.column_stack([BASE + shift, np.full(4, height)])
    faces = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)]
    for i in range(4):
        j = (i + 1) % 4
        faces += [(i, j, j + 4), (i, j + 4, i + 4)]
    return trimesh.Trimesh(np.concatenate([below, above]), faces, process=False)


def area() -> float:
    x, y = BASE.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def centroid() -> np.ndarray:
    x, y = BASE.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    ends = BASE + np.roll(BASE, -1, axis=0)
    return (ends * cross[:, None]).sum(axis=0) / (6.0 * area())


def weighed(vsr: Callable[..., object], folder: Path, derived: Path, file: str):
    ran = vsr("run", "rock", "--site", site(folder, file))
    assert ran.code == 0, ran.err
    return read(derived / "scan" / "rock.nc")


HEIGHT, SHIFT = 1.25, (0.15, -0.05)


def see_that_it_is_the_prism(rock) -> None:
    volume = area() * HEIGHT
    assert rock.attrs["volume_m3"] == pytest.approx(volume, rel=1e-5)
    assert rock.attrs["mass_kg"] == pytest.approx(DENSITY * volume, rel=1e-5)
    assert rock.attrs["turned_to_rest_deg"] == pytest.approx(0.0, abs=1e-4)
    centre = np.append(centroid() + 0.5 * np.array(SHIFT), 0.5 * HEIGHT)
    expected = np.array(prism(HEIGHT, SHIFT).vertices) - centre
    found = rock["vertex"].values
    gaps = np.linalg.norm(found[:, None] - expected, axis=2)
    np.testing.assert_allclose(gaps.min(axis=0), 0.0, atol=1e-6)
    np.testing.assert_allclose(gaps.min(axis=1), 0.0, atol=1e-6)
    axes, moments = rock["principal_axis"].values, rock["principal_moment"].values
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    tensor = axes @ np.diag(moments) @ axes.T
    np.testing.assert_allclose(tensor, inertia_of_the_prism(), rtol=1e-5, atol=1e-3)


def inertia_of_the_prism() -> np.ndarray:
    """About the centre of mass, by slices: each is the base moved along the shift."""
    x, y = (BASE - centroid()).T
    nx, ny = np.roll(x, -1), np.roll(y, -1)
    cross = x * ny - nx * y
    xx = float(np.sum(cross * (x * x + x * nx + nx * nx))) / 12.0 / area()
    yy = float(np.sum(cross * (y * y + y * ny + ny * ny))) / 12.0 / area()
    xy = float(np.sum(cross * (x * ny + 2 * x * y + 2 * nx * ny + nx * y))) / 24.0 / area()
    along = np.array([*SHIFT, HEIGHT])  # from the centre of the base to that of the top
    spread = np.outer(along, along) / 12.0  # of a uniform rod
    spread[:2, :2] += [[xx, xy], [xy, yy]]
    mass = DENSITY * area() * HEIGHT
    return mass * (np.trace(spread) * np.eye(3) - spread)


@pytest.mark.parametrize("kind", FORMATS)
def test_same_rock_in_every_format(
    tmp_path: Path, vsr: Callable[..., object], derived: Path, kind: str
) -> None:
    content = prism(HEIGHT, SHIFT).export(file_type=kind)
    path = tmp_path / f"rock.{kind}"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    see_that_it_is_the_prism(weighed(vsr, tmp_path, derived, path.name))


def test_split_vertices_are_merged(
    tmp_path: Path, vsr: Callable[..., object], derived: Path
) -> None:
    mesh = prism(HEIGHT, SHIFT)
    mesh.unmerge_vertices()
    assert len(mesh.vertices) == 36
    (tmp_path / "rock.ply").write_bytes(mesh.export(file_type="ply"))
    rock = weighed(vsr, tmp_path, derived, "rock.ply")
    see_that_it_is_the_prism(rock)
    assert "28 split vertices merged" in rock.attrs["repaired"]


def test_a_vertex_that_stands_out_is_told(
    tmp_path: Path, vsr: Callable[..., Any], derived: Path
) -> None:
    mesh = ball()
    mesh.vertices[mesh.vertices[:, 0].argmax(), 0] *= 2.0
    (tmp_path / "rock.ply").write_bytes(mesh.export(file_type="ply"))
    ran = vsr("run", "rock", "--site", site(tmp_path, "rock.ply"))
    assert ran.code == 0, ran.err
    (place,) = re.findall(
        "; doubtful: the vertex at (1, .*?) m stands out by 0.5", ran.out + ran.err
    )
    assert place
    assert "stands out by" in read(derived / "scan" / "rock.nc").attrs["repaired"]


def test_vertices_split_by_texture_are_merged(
    tmp_path: Path, vsr: Callable[..., object], derived: Path
) -> None:
    """Each corner of each face has its own vertex, normal and texture coordinate."""
    mesh = prism(HEIGHT, SHIFT)
    lines, corner = [], 0
    for face, normal in zip(mesh.faces, mesh.face_normals, strict=True):
        for vertex in mesh.vertices[face]:
            corner += 1
            lines += [
                "v {} {} {}".format(*vertex),
                "vn {} {} {}".format(*normal),
                f"vt {corner / 50} {corner / 70}",
            ]
        lines.append("f " + " ".join(f"{n}/{n}/{n}" for n in range(corner - 2, corner + 1)))
    (tmp_path / "rock.obj").write_text("\n".join(lines))
    see_that_it_is_the_prism(weighed(vsr, tmp_path, derived, "rock.obj"))


@pytest.mark.parametrize("turned", [(0,), (3,), (1, 6)])
def test_single_faces_are_turned(
    tmp_path: Path, vsr: Callable[..., object], derived: Path, turned: tuple[int, ...]
) -> None:
    mesh = prism(HEIGHT, SHIFT)
    faces = np.array(mesh.faces)
    for face in turned:
        faces[face] = faces[face][::-1]
    wrong = trimesh.Trimesh(mesh.vertices, faces, process=False)
    (tmp_path / "rock.ply").write_bytes(wrong.export(file_type="ply"))
    rock = weighed(vsr, tmp_path, derived, "rock.ply")
    see_that_it_is_the_prism(rock)
    assert "turned" in rock.attrs["repaired"]


def test_upright_within_reach_is_set_down(
    tmp_path: Path, vsr: Callable[..., object], derived: Path
) -> None:
    mesh = trimesh.creation.box(extents=(0.6, 0.6, 1.0))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(6.0), [1, 0, 0]))
    (tmp_path / "rock.ply").write_bytes(mesh.export(file_type="ply"))
    rock = weighed(vsr, tmp_path, derived, "rock.ply")
    assert rock.attrs["turned_to_rest_deg"] == pytest.approx(6.0, abs=1e-3)
    np.testing.assert_allclose(np.abs(rock["vertex"].values[:, 2]), 0.5, atol=1e-6)


@pytest.mark.skipif(not ORIGINAL.is_file(), reason=f"reference data absent: {ORIGINAL.name}")
def test_double_rock_weighs_what_was_published(
    tmp_path: Path, vsr: Callable[..., object], derived: Path
) -> None:
    """Mass and inertia of the public model, which are this shape at 2600 kg/m3."""
    published = np.array(
        [[260.473, -12.88, -83.689], [-12.88, 313.424, -26.81], [-83.689, -26.81, 134.045]]
    )
    where = tmp_path / "scan.yaml"
    where.write_text(f"rock: {{shape: mesh, mesh: {ORIGINAL}, density: 2600}}\n")
    assert vsr("run", "rock", "--site", where).code == 0
    rock = read(derived / "scan" / "rock.nc")
    assert rock.attrs["mass_kg"] == pytest.approx(1437.596, rel=0.005)
    moments, axes = rock["principal_moment"].values, rock["principal_axis"].values
    np.testing.assert_allclose(moments, np.linalg.eigvalsh(published), rtol=0.005)
    # Back from the rest pose to the frame of the file, by the surface that both hold.
    mesh = trimesh.load(ORIGINAL, process=False)
    given = np.unique(np.array(mesh.vertices), axis=0)
    hull = trimesh.convex.convex_hull(given)
    still = hull.vertices - mesh.center_mass
    turned = rock["vertex"].values
    order = np.argsort(np.linalg.norm(still, axis=1)), np.argsort(np.linalg.norm(turned, axis=1))
    u, _, vt = np.linalg.svd(still[order[0]].T @ turned[order[1]])
    back = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    np.testing.assert_allclose(turned[order[1]] @ back.T, still[order[0]], atol=1e-5)
    tensor = back @ axes @ np.diag(moments) @ axes.T @ back.T
    np.testing.assert_allclose(tensor, published, rtol=0.005)
