"""A rock and a terrain in two files: where the rock comes to stand, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr
from conftest import Ran
from scipy.spatial.transform import Rotation
from support.small_scan import FAR as SURVEYED
from support.small_scan import write_ply

from pipeline import ROOT
from pipeline.stages.mesh import scan_figures, seating
from pipeline.stages.mesh.products import SCAN_PAGE
from pipeline.workflow.datasets import read
from vsr_core.rock import solid
from vsr_core.scan.weighing import Seen

Array = np.ndarray
Vsr = Callable[..., Ran]
Refused = Callable[..., str]

SIZE = np.array([0.4, 0.3, 0.6])
CORNER = np.array([3.0, 4.0, 5.0])
"""Of the rock's file, where its lowest corner is: a file's origin is wherever it is."""

FAR = SURVEYED + 0.013  # of more digits than single precision holds

SLOPE = np.radians(12.0)
SETTLED = 0.004
"""By what a rock that is let go a millimetre above the ground may come to rest elsewhere [m]."""


def block() -> trimesh.Trimesh:
    mesh = trimesh.creation.box(SIZE)
    mesh.apply_translation(CORNER + 0.5 * SIZE)
    return mesh


def ground(slope: float = 0.0, cells: int = 8) -> trimesh.Trimesh:
    """A square sheet of 6 m around the origin of its file that rises along x."""
    along = np.linspace(-3.0, 3.0, cells + 1)
    x, y = (values.ravel() for values in np.meshgrid(along, along, indexing="ij"))
    corner = np.arange(len(x)).reshape(cells + 1, cells + 1)
    a, b = corner[:-1, :-1].ravel(), corner[1:, :-1].ravel()
    c, d = corner[1:, 1:].ravel(), corner[:-1, 1:].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return trimesh.Trimesh(np.column_stack([x, y, np.tan(slope) * x]), faces, process=False)


def site(
    folder: Path,
    pose: str,
    terrain: trimesh.Trimesh | None = None,
    shift: Array | None = None,
    pedestal: str = "mesh: ground.ply",
) -> Path:
    write_ply(folder / "rock.ply", block())
    write_ply(folder / "ground.ply", terrain or ground(), shift)
    path = folder / "two.yaml"
    path.write_text(
        f"rock: {{shape: mesh, mesh: rock.ply, density: 2000{pose and ', pose: '}{pose}}}\n"
        f"pedestal: {{shape: mesh, {pedestal}}}\n"
    )
    return path


def pose_of(centre: Array, turn: Rotation, more: str = "") -> str:
    """The pose of a rock whose centre is there."""
    origin = centre - turn.apply(CORNER + 0.5 * SIZE)
    place, quaternion = np.round(origin, 6).tolist(), np.round(turn.as_quat(), 9).tolist()
    return f"{{position: {place}, quaternion: {quaternion}{more}}}"


def rest(derived: Path) -> tuple[Array, Rotation]:
    """Where the rock's centre rests, in the terrain's coordinates, and its turn in settling."""
    found = read(derived / "two" / "terrain.nc")
    start = found["start_position"].values[0] + found.attrs["origin_in_scan"]
    return start, Rotation.from_quat(found["start_quaternion"].values[0])


TURN = Rotation.from_euler("z", 35.0, degrees=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gap", "cells"),
    [
        *((0.0, 1), (0.02, 60), (-0.004, 1), (-0.004, 60)),
        pytest.param(0.0, 60, marks=pytest.mark.slow),
        pytest.param(0.02, 1, marks=pytest.mark.slow),
    ],
)
def test_a_rock_stands_where_its_pose_says(
    tmp_path: Path, vsr: Vsr, derived: Path, gap: float, cells: int
) -> None:
    """On level ground it settles straight down, or is raised, wherever the files' origins are."""
    centre = np.array([0.7, -0.4, 0.5 * SIZE[2] + gap]) + FAR
    where = site(tmp_path, pose_of(centre, TURN), ground(cells=cells), FAR)
    ran = vsr("prep", "--site", where)
    assert ran.code == 0, ran.err
    place, turned = rest(derived)
    np.testing.assert_allclose(place[:2], centre[:2], atol=SETTLED)
    lowest = gap if gap < 0.0 and cells > 1 else 0.0  # there the ground gives way
    assert lowest - SETTLED < place[2] - FAR[2] - 0.5 * SIZE[2] < SETTLED
    assert turned.magnitude() < np.radians(0.5)
    rock = read(derived / "two" / "rock.nc")
    across = np.ptp(rock["vertex"].values, axis=0)
    cos, sin = np.cos(np.radians(35.0)), np.sin(np.radians(35.0))
    assert across[0] == pytest.approx(cos * SIZE[0] + sin * SIZE[1], abs=1e-6)
    page = (derived / "two" / SCAN_PAGE).read_text()
    assert 'id="ground"' in page
    assert f"{1e3 * abs(gap):.1f} mm" in page


@pytest.mark.slow
@pytest.mark.parametrize("slope", [0.0, 0.3])
@pytest.mark.parametrize("together", [False, True], ids=["own file", "one scan"])
def test_the_ground_that_may_bear_a_rock_stays_as_it_was_scanned(
    slope: float, together: bool
) -> None:
    """A plane with waves around it, which have fewer triangles and no gaps."""
    rock = solid.box(SIZE, 2000.0).rock
    sheet = ground(slope, cells=40)
    x, y, _ = sheet.vertices.T
    sheet.vertices[:, 2] += 0.1 * np.sin(2.0 * x) * np.sin(3.0 * y) * (np.hypot(x, y) > 0.6)
    corners, faces = (("v", "xyz"), sheet.vertices), (("f", "abc"), sheet.faces)
    scanned = xr.Dataset({"terrain_vertex": corners, "terrain_face": faces})
    if together:
        scanned["terrain_unseen"] = ("f", np.zeros(len(sheet.faces), dtype=np.int8))
    light = seating.bed(scanned, rock, reduce=True, whole_seam=False).ground
    assert len(light.faces) < 0.7 * len(sheet.faces)
    for x, y in np.random.default_rng(1).uniform(-0.25, 0.25, (200, 2)):
        np.testing.assert_allclose(light.surfaces(x, y)[0], [np.tan(slope) * x], atol=1e-12)
    made = trimesh.Trimesh(light.vertices, light.faces, process=False)
    assert (made.face_normals[:, 2] > 0.0).all()
    edges, times = np.unique(made.edges_sorted, axis=0, return_counts=True)
    assert times.max() == 2
    at_border = np.abs(made.vertices[edges[times == 1]][:, :, :2])
    np.testing.assert_allclose(at_border.max(axis=(1, 2)), 3.0)


@pytest.mark.slow
@pytest.mark.parametrize("whole", [False, True])
def test_ground_that_nobody_saw_stays_where_all_of_it_bears(whole: bool) -> None:
    """Where points bear it lies lower in any case, and small waves of it have fewer triangles."""
    sheet = ground(cells=40)
    unseen = np.abs(sheet.triangles_center[:, :2]).max(axis=1) < 0.3
    x, y, _ = sheet.vertices.T
    sheet.vertices[:, 2] = 0.002 * np.sin(20.0 * x) * np.cos(30.0 * y)
    scanned = xr.Dataset(
        {
            "terrain_vertex": (("v", "xyz"), sheet.vertices),
            "terrain_face": (("f", "abc"), sheet.faces),
            "terrain_unseen": ("f", unseen.astype(np.int8)),
        }
    )
    rock = solid.box(SIZE, 2000.0).rock
    light = seating.bed(scanned, rock, reduce=True, whole_seam=whole).ground
    kept = {tuple(corner) for corner in light.vertices.tolist()}
    own = {tuple(corner) for corner in sheet.vertices[np.unique(sheet.faces[unseen])].tolist()}
    assert (own <= kept) == whole


@pytest.mark.slow
def test_a_rock_that_falls_lies_on_the_slope(tmp_path: Path, vsr: Vsr, derived: Path) -> None:
    """Its base on the slope, its centre half its height above, whatever the z that was given."""
    centre = np.array([0.2, 0.3, 40.0])
    where = site(tmp_path, pose_of(centre, TURN, ", drop: true"), ground(SLOPE))
    assert vsr("prep", "--site", where).code == 0
    place, _ = rest(derived)
    up = np.array([-np.sin(SLOPE), 0.0, np.cos(SLOPE)])
    assert place @ up == pytest.approx(0.5 * SIZE[2], abs=SETTLED)
    placed = read(derived / "two" / "placed.nc")
    turned = np.radians(placed.attrs["turned_by_fall_deg"])
    assert SLOPE - 1e-3 < turned < SLOPE + np.radians(2.0)  # about its toe, which is aslant
    assert np.abs(place[:2] - centre[:2]).max() < 0.2  # its toe lands first, and it turns about it


def test_vertices_of_faces_that_were_lost_are_told(tmp_path: Path, vsr: Vsr) -> None:
    """As of an OBJ file of ground that is cut between two faces."""
    terrain = ground()
    terrain.update_faces(terrain.triangles_center[:, 0] < 2.25)
    pose = pose_of(np.array([0.0, 0.0, 0.5 * SIZE[2]]), Rotation.identity())
    ran = vsr("run", "rock", "--site", site(tmp_path, pose, terrain))
    assert ran.code == 0, ran.err
    assert "9 of 81 vertices, which no face has, left out" in ran.out + ran.err


@pytest.mark.slow
def test_files_that_agree_need_no_pose(tmp_path: Path, vsr: Vsr, derived: Path) -> None:
    terrain = ground()
    terrain.apply_translation(CORNER - np.array([0.0, 0.0, 0.002]))
    assert vsr("prep", "--site", site(tmp_path, "", terrain)).code == 0
    np.testing.assert_allclose(rest(derived)[0], CORNER + 0.5 * SIZE, atol=SETTLED)


POSED = pose_of(np.array([0.0, 0.0, 0.5 * SIZE[2]]), TURN)

WRONG = {
    "floats": (pose_of(np.array([0.0, 0.0, 0.5]), TURN), {}, ("rock.pose", "floats 0.2 m")),
    "buried": (pose_of(np.array([0.0, 0.0, -0.5]), TURN), {}, ("rock.pose", "wholly inside")),
    "half buried": (pose_of(np.zeros(3), TURN), {}, ("rock.pose", "reaches into the rock")),
    "beyond": (
        pose_of(np.array([3.0, 0.0, 0.3]), TURN),
        {},
        ("rock.pose", "is beyond the terrain", "(3."),
    ),
    "falls beyond": (
        pose_of(np.array([9.0, 0.0, 0.3]), TURN, ", drop: true"),
        {},
        ("rock.pose", "100% is beyond the terrain"),
    ),
    "no terrain": (POSED, {"pedestal": "cut: proposal"}, ("rock.pose", "pedestal.mesh")),
    "a cut": (POSED, {"pedestal": "mesh: ground.ply, cut: proposal"}, ("pedestal", "not cut")),
    "no turn": ("{position: [0, 0, 0], quaternion: [0, 0, 0, 0]}", {}, ("quaternion", "length 1")),
    "no file": (POSED, {"pedestal": "mesh: other.ply"}, ("pedestal.mesh", "file not found")),
    "no ground": (POSED, {"pedestal": "fallback: moon"}, ("pedestal.fallback", "sine_hills")),
    "two pieces": (
        POSED,
        {"terrain": trimesh.util.concatenate([ground(), block()])},
        ("pedestal.mesh", "a closed piece 0.6 m large", "(3.20, 4.15, 5.30)"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(tmp_path: Path, refused: Refused, name: str) -> None:
    pose, other, words = WRONG[name]
    refused("prep", "--site", site(tmp_path, pose, **other), words=words)


def drums(neck: float) -> trimesh.Trimesh:
    """Two drums and a neck between them, of radius ``neck`` [m]."""
    radii = np.array([0.0, 0.4, 0.4, neck, neck, 0.4, 0.4, 0.0])
    heights = np.array([0.0, 0.0, 0.5, 0.5, 0.8, 0.8, 1.3, 1.3])
    return trimesh.creation.revolve(np.column_stack([radii, heights]), sections=16)


@pytest.mark.slow
def test_a_rock_with_a_waist_is_kept_as_pieces_or_refused(
    tmp_path: Path, vsr: Vsr, refused: Refused, derived: Path
) -> None:
    where = site(tmp_path, "{position: [0, 0, 0.001], quaternion: [0, 0, 0, 1]}")
    shape = ("--set", "rock.contact_shape=pieces", "--set", "rock.contact_error=0.1")
    write_ply(tmp_path / "rock.ply", drums(0.02))
    words = ("rock.contact_shape", "a waist", "mm thin", "smaller rock.contact_error")
    refused("run", "rock", "--site", where, *shape, words=words)
    write_ply(tmp_path / "rock.ply", drums(0.15))
    assert vsr("run", "rock", "--site", where, *shape).code == 0
    rock = read(derived / "two" / "rock.nc")
    pieces = rock["piece_vertex"].values
    assert np.unique(rock["piece"]).size >= 3
    # in the frame of the hull, that of the centre of mass, whose corners they have
    for limit in (np.min, np.max):
        np.testing.assert_allclose(limit(pieces, axis=0), limit(rock["vertex"], axis=0), atol=1e-5)
    assert "convex pieces" in rock.attrs["contact_shape"]
    assert "convex pieces" in vsr("plan", "displacement", "--site", where, *shape).out


def test_the_boulder_is_fetched_or_asked_for(vsr: Vsr, refused: Refused, derived: Path) -> None:
    """The shipped site falls on its hilltop; without the boulder its line says how to have it."""
    if not list((ROOT / "data" / "raw" / "granite_boulder").glob("*.ply")):
        words = ("rock.mesh", "no scan", "make fetch NAME=granite_boulder")
        refused("run", "rock", "--site", "granite_boulder", words=words)
        pytest.skip("the boulder is not there")
    assert vsr("prep", "--site", "granite_boulder").code == 0
    terrain = read(derived / "granite_boulder" / "terrain.nc")
    place = terrain["start_position"].values[0] + terrain.attrs["origin_in_scan"]
    np.testing.assert_allclose(place, [np.pi, 0.0, 1.165], atol=0.05)


def test_a_refused_scan_is_drawn_with_its_ground() -> None:
    mesh = trimesh.util.concatenate([ground(cells=20), block()])
    own = np.arange(len(mesh.faces)) >= len(ground(cells=20).faces)
    seen = Seen(
        np.array(mesh.vertices), np.array(mesh.faces), np.zeros(3), {"rock": own, "ground": ~own}
    )
    figure = scan_figures.scan_from_sides(seen, np.empty((0, 3)), "scan")
    assert len(figure.axes) == 3


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.0, 9.0])
def test_a_vertex_thrown_out_of_the_ground_is_told(tmp_path: Path, vsr: Vsr, height: float) -> None:
    terrain = ground(cells=12)
    at = np.linalg.norm(terrain.vertices - [1.5, 0.0, 0.0], axis=1).argmin()
    terrain.vertices[at, 2] = height
    pose = pose_of(np.array([0.0, 0.0, 0.5 * SIZE[2] + 0.01]), Rotation.identity(), ", drop: true")
    grid = ("--set", "motion={pga: 0.3, pgv_pga: 0.2}", "--workers", "0")
    ran = vsr("run", "displacement", "--site", site(tmp_path, pose, terrain), *grid)
    assert ran.code == 0, ran.err
    told = [line for line in (ran.out + ran.err).splitlines() if "stands out by 9" in line]
    assert len(told) == (height > 0.0)
