"""From a scan to rock and ground: what `vsr prep` makes, shows, accepts and refuses."""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from html import unescape
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from conftest import Ran
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull
from support import scan_shapes
from support.small_scan import FAR, NOISE, STONE, survey, tapered, write_ply

from pipeline import ROOT, cli
from pipeline.config.layers import load_site
from pipeline.stages.mesh import scan_figures, scan_page
from pipeline.stages.mesh.scan_page import _yaml
from pipeline.stages.mesh.sources import Source, find
from pipeline.workflow import graph
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.datasets import read
from pipeline.workflow.stage import Job
from pipeline.workflow.store import Store
from vsr_core.errors import InvalidInput
from vsr_core.rock.reduction import FLIGHT_SHARE, SEAT_SHARE
from vsr_core.scan import cleaning
from vsr_core.scan.cuts import Colour, Plane
from vsr_core.scan.preparation import Prepared, prepare_scan
from vsr_core.scan.proposal import Alternative, alternatives
from vsr_core.scan.separation import Separation, by_cut, nearest, settled, whole
from vsr_core.scan.weighing import DIRECTIONS, measured
from vsr_core.terrain.surface import Terrain

pytestmark = pytest.mark.usefixtures("few_samples")

Array = np.ndarray
Refused = Callable[..., str]

DENSITY = 2000.0
NOBODY = str  # told what is being done
MASS, PLACE, INERTIA = 0.03, 0.01, 0.05
"""What such a coarse, noisy scan gives of the rock: shares of its mass and its largest moment of
inertia, centre of mass [m]."""


@lru_cache(maxsize=1)
def prepared() -> Prepared:
    return prepare_scan(survey, None, closing="caps", density=DENSITY, tell=NOBODY)


def site(folder: Path, pedestal: str = "", rock: str = "mesh: scan.ply", more: str = "") -> Path:
    path = folder / "hill.yaml"
    path.write_text(
        f"rock: {{shape: mesh, {rock}, density: {DENSITY:g}}}\n"
        f"pedestal: {{shape: mesh{', ' if pedestal else ''}{pedestal}}}\n"
        f"motion: {{pga: [0.3], pgv_pga: [0.3]}}\n{more}"
    )
    return path


def run(*arguments: object) -> Ran:
    """As the fixture ``vsr``, for what a whole module shares."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = cli.main([*map(str, arguments)])
    return Ran(code, out.getvalue(), err.getvalue())


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.rglob("*") if path.is_file()}


@dataclass(frozen=True)
class Shown:
    """A scan in projected coordinates, prepared without a cut."""

    site: Path
    derived: Path
    ran: Ran
    page: str

    @property
    def products(self) -> Path:
        return self.derived / "hill"

    def moved(self, folder: Path) -> Shown:
        """The same in another folder; no site is left where it was."""
        shutil.copytree(self.derived, folder / "derived")
        settings = folder / "derived" / "hill" / ".stages" / "settings.json"
        gone = settings.read_text().replace(str(self.site), str(folder / "gone.yaml"))
        settings.write_text(gone)
        return replace(self, site=site(folder), derived=folder / "derived")


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    folder = tmp_path_factory.mktemp("shown")
    write_ply(folder / "scan.ply", survey(), FAR)
    where = site(folder)
    ran = run("prep", "--site", where, "--derived", folder / "derived")
    page = folder / "derived" / "hill" / "prep.html"
    return Shown(where, folder / "derived", ran, page.read_text() if page.exists() else "")


@pytest.fixture(autouse=True)
def _no_pictures_of_refusals(monkeypatch: pytest.MonkeyPatch) -> None:
    """``test_closed_rock.py`` looks at one."""
    monkeypatch.setattr(scan_figures, "scan_from_sides", lambda *given: Figure(figsize=(0.1, 0.1)))


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page without pictures, where they are no subject."""
    for name in ("separation", "closed_rock", "seat"):
        monkeypatch.setattr(scan_figures, name, lambda prepared, source: Figure(figsize=(0.1, 0.1)))


def see_that_it_is_the_rock(folder: Path, shift: Array = FAR) -> None:
    """The rock in ``scan.nc`` weighs and lies as the true one."""
    scan, true = read(folder / "scan.nc"), tapered().solid
    rock = trimesh.Trimesh(scan["rock_vertex"].values, scan["rock_face"].values, process=False)
    assert rock.is_watertight
    assert rock.volume == pytest.approx(true.volume, rel=MASS)
    place = np.array(rock.center_mass) + scan.attrs["origin_in_scan"] - shift
    np.testing.assert_allclose(place, true.center_mass, atol=PLACE)
    inertia, known = (np.array(solid.moment_inertia) for solid in (rock, true))
    assert np.abs(inertia - known).max() < INERTIA * np.abs(known).max()


# Proposed, looked at, accepted


def test_a_proposal_is_shown_and_nothing_more(shown: Shown) -> None:
    assert shown.ran.code == 0, shown.ran.err
    assert shown.ran.out == ""
    assert str(shown.products / "prep.html") in shown.ran.err
    assert "to accept it, set pedestal.cut: proposal" in shown.ran.err.splitlines()[-1]
    assert names(shown.products) == {
        *("prep.html", "scan.nc", "scan.json"),
        *("config.yaml", "settings.json"),
    }
    assert read(shown.products / "scan.nc").attrs["accepted"] == 0
    see_that_it_is_the_rock(shown.products)


def test_nothing_runs_on_a_proposal_that_is_not_accepted(shown: Shown) -> None:
    before = names(shown.products)
    ran = run("run", "displacement", "--site", shown.site, "--derived", shown.derived)
    assert ran.code == 2
    said = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
    assert len(said) == 1
    page = "look at prep.html, which `vsr prep` makes"
    for word in (str(shown.site), "pedestal.cut: got nothing; ", page, "pedestal.cut: proposal"):
        assert word in said[0]
    assert said[0].count("; ") == 2
    assert names(shown.products) == before


@pytest.mark.slow
def test_planning_says_so_too(shown: Shown, tmp_path: Path, quick: None) -> None:
    ran = run("plan", "displacement", "--site", shown.site, "--derived", tmp_path / "derived")
    assert ran.code == 2
    assert "pedestal.cut: got nothing; " in ran.err.splitlines()[-1]
    assert names(tmp_path) == set()  # and names no page that is there for its own use only
    assert "/prep.html" not in ran.err


def test_a_second_look_makes_nothing(shown: Shown) -> None:
    before = {p: p.stat().st_mtime_ns for p in shown.products.rglob("*") if p.is_file()}
    ran = run("prep", "--site", shown.site, "--derived", shown.derived)
    assert ran.code == 0
    assert {p: p.stat().st_mtime_ns for p in before} == before
    assert not [line for line in ran.err.splitlines() if line.startswith("scan: ")]


@pytest.mark.slow
def test_an_accepted_proposal_brings_the_terrain(tmp_path: Path, quick: None) -> None:
    write_ply(tmp_path / "scan.ply", survey(), FAR)
    where = site(tmp_path, "cut: proposal")
    derived = tmp_path / "derived"
    ran = run("prep", "--site", where, "--derived", derived)
    assert ran.code == 0, ran.err
    assert str(derived / "hill" / "terrain.nc") in ran.err.splitlines()[-1]
    see_that_it_is_the_rock(derived / "hill")
    rock, terrain = (read(derived / "hill" / f"{name}.nc") for name in ("rock", "terrain"))
    assert rock.attrs["mass_kg"] == pytest.approx(DENSITY * tapered().solid.volume, rel=MASS)
    faces = terrain["terrain_face"].values.astype(np.int64)
    ground = Terrain(terrain["terrain_vertex"].values, faces)
    height, upward = ground.surfaces(0.0, 0.0)  # there is one beneath the rock, which no scan saw
    assert upward.tolist() == [True]
    up = tapered().up
    place = np.array([0.0, 0.0, height[0]]) + terrain.attrs["origin_in_scan"] - FAR
    assert place @ up == pytest.approx(0.0, abs=0.01)


@pytest.mark.slow
def test_subprocess(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pipeline", "prep", "--derived", str(tmp_path / "derived")]
    bad = site(tmp_path, rock="mesh: nowhere.ply")
    ran = subprocess.run(
        [*command, "--site", str(bad)], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert (ran.returncode, ran.stdout) == (2, "")
    assert len(ran.stderr.splitlines()) == 1
    assert "nowhere.ply" in ran.stderr


# Cuts by hand


def cut_by(kind: str) -> str:
    """Cuts from what is known of the rock, in projected coordinates."""
    truth = tapered()
    foot = np.array(truth.solid.vertices)[np.array(truth.solid.vertices) @ truth.up < 1e-6] + FAR
    outline = foot[ConvexHull(foot[:, :2]).vertices, :2]
    wider = outline + 0.03 * (outline - outline.mean(axis=0))
    low, high = foot.min(axis=0) - 0.02, foot.max(axis=0) + np.array([0.02, 0.02, 2.0])
    low[2] = foot[:, 2].max() + 0.003  # of a foot that slopes, all else that is higher is lost
    given = {
        "plane": {"point": (FAR + 0.02 * truth.up).tolist(), "normal": truth.up.tolist()},
        "box": {"low": low.tolist(), "high": high.tolist()},
        "polygon": {"corners": wider.tolist()},
        "colour": {"rgb": list(STONE), "tolerance": 30},
    }[kind]
    return f"cut: {yaml.safe_dump({'kind': kind, **given}, default_flow_style=True, width=10**6)}"


SLOW = pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind",
    ["plane", pytest.param("box", marks=SLOW), pytest.param("polygon", marks=SLOW), "colour"],
)
def test_cuts_by_hand_give_the_same_rock(tmp_path: Path, quick: None, kind: str) -> None:
    write_ply(tmp_path / "scan.ply", survey(), FAR)
    where = site(tmp_path, cut_by(kind).strip())
    store = Store(tmp_path / "derived" / "hill")
    store.open()
    job = Job(load_site(str(where)), store, Cluster(0), lambda line: None)
    graph.make("scan", job)  # without the terrain, which takes longer
    see_that_it_is_the_rock(tmp_path / "derived" / "hill")
    assert read(tmp_path / "derived" / "hill" / "scan.nc").attrs["accepted"] == 1


def blocks(page: str) -> list[str]:
    return [unescape(text) for text in re.findall(r'<pre class="cut">(.*?)</pre>', page, re.DOTALL)]


def test_every_cut_on_the_page_can_be_pasted(shown: Shown, tmp_path: Path) -> None:
    kinds = []
    for number, block in enumerate(blocks(shown.page)):
        path = tmp_path / f"{number}.yaml"
        path.write_text(f"rock: {{shape: mesh, mesh: scan.ply, density: 2000}}\n{block}\n")
        kinds.append(load_site(str(path)).config.pedestal.cut.kind)
    assert kinds == ["plane", "box", "polygon", "colour"]


def test_a_cut_on_the_page_is_the_one_tried() -> None:
    """Of a print 40 mm high, whose cut is known to a micrometre."""
    cut = Plane((0.0123456, -0.0234567, 0.0012345), (0.0012345, 0.0234567, 0.9997241))
    pasted = yaml.safe_load(_yaml(cut))["pedestal"]["cut"]
    np.testing.assert_allclose(pasted["point"], cut.point, atol=6e-7)
    np.testing.assert_allclose(pasted["normal"], cut.normal, atol=6e-7)


def test_a_cut_on_the_page_is_where_the_rock_is(shown: Shown) -> None:
    truth, cuts = tapered(), [yaml.safe_load(b)["pedestal"]["cut"] for b in blocks(shown.page)]
    plane, box, polygon, colour = cuts
    point, normal = np.array(plane["point"]) - FAR, np.array(plane["normal"])
    assert np.linalg.norm(normal - truth.up) < 0.03
    assert 0.0 < point @ truth.up < 0.04
    corners = np.array(truth.solid.vertices) + FAR
    assert (np.array(box["low"])[:2] < corners.min(axis=0)[:2]).all()
    assert (np.array(box["high"]) > corners.max(axis=0)).all()
    # few corners around the foot, a little outside it
    x, y = np.array(polygon["corners"]).T - FAR[:2, None]
    assert 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) == pytest.approx(
        0.72 * 0.6 * truth.up[2], rel=0.15
    )
    np.testing.assert_allclose(colour["rgb"], STONE, atol=15)


@pytest.mark.slow
def test_alternatives_tell_the_truth_about_themselves() -> None:
    """Each is tried again here; an honest one that gives the rock gives its volume too."""
    assert prepared().alternatives
    for other in prepared().alternatives:
        again = prepare_scan(survey, other.cut, closing="caps", density=DENSITY, tell=NOBODY)
        area = again.rock.area_faces[~again.added].sum()
        known = prepared().rock.area_faces[~prepared().added].sum()
        assert other.reason == ""
        assert other.area == pytest.approx(area / known, rel=0.02)
        assert other.away < 0.1
        assert again.rock.volume == pytest.approx(tapered().solid.volume, rel=MASS)


def test_how_far_a_cut_is_from_another() -> None:
    """High up the rock no hollow draws a seam: cuts stay where they are, as far as is known."""
    up, height = tapered().up, 0.45
    mesh = survey()
    low = by_cut(mesh, Plane(tuple(height * up), tuple(up)))
    plane, _, polygon = (other for other in alternatives(mesh, low) if not is_colour(other))
    raised = np.array(plane.cut.point) @ up - height
    assert raised > 0.005
    assert raised < plane.away < raised + 0.01
    again = settled(by_cut(mesh, plane.cut))
    assert plane.area == pytest.approx(areas_of(again) / areas_of(low), rel=1e-9)
    assert plane.area < 1.0
    assert polygon.area > 1.1  # a prism takes the walls below too
    assert polygon.away > 0.3


def test_other_cuts_are_of_the_rock_that_the_point_is_on() -> None:
    """Beside a low block stands a pillar of more surface, which a plane parts from the ground."""
    line = np.arange(33) / 4 - 4
    x, y = (part.ravel() for part in np.meshgrid(line, line))
    low = (abs(x) < 1.1) & (abs(y) < 1.1)
    pillar = (abs(x - 2.1) < 0.45) & (abs(y) < 0.45)
    corner = np.arange(33 * 33).reshape(33, 33)
    a, b, c, d = (
        part.ravel()
        for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    vertices = np.column_stack([x, y, 0.5 * low + 2.6 * pillar])
    mesh, point = trimesh.Trimesh(vertices, faces, process=False), np.array([0.0, 0.0, 0.5])
    found = settled(by_cut(mesh, Plane((0.0, 0.0, 0.1), (0.0, 0.0, 1.0)), point))
    plane, *_ = alternatives(mesh, found, point)
    assert plane.away < 0.5
    assert plane.area < 1.0


def is_colour(other: Alternative) -> bool:
    return isinstance(other.cut, Colour)


def areas_of(found: Separation) -> float:
    return float(trimesh.Trimesh(found.vertices, found.faces[found.rock], process=False).area)


# What is refused, each in one line


def refuse(
    refused: Refused,
    folder: Path,
    mesh: trimesh.Trimesh,
    words: tuple[str, ...],
    pedestal: str = "",
) -> None:
    write_ply(folder / "scan.ply", mesh)
    where = site(folder, pedestal)
    page = "prep.html" if np.isfinite(mesh.vertices).any() else ""  # where there is much to see
    refused("prep", "--site", where, words=(str(where), *words), page=page)


def branching() -> trimesh.Trimesh:
    """A fin on every tenth face: three faces at an edge."""
    mesh = survey()
    own = np.array(mesh.faces)[::10]
    tips = np.array(mesh.vertices)[own].mean(axis=1) + np.array([0.0, 0.0, 0.1])
    fins = np.column_stack([own[:, :2], len(mesh.vertices) + np.arange(len(own))])
    return trimesh.Trimesh(
        np.concatenate([mesh.vertices, tips]), np.concatenate([mesh.faces, fins]), process=False
    )


def nowhere() -> trimesh.Trimesh:
    mesh = survey()
    return trimesh.Trimesh(np.full(mesh.vertices.shape, np.nan), mesh.faces, process=False)


def without_colours() -> trimesh.Trimesh:
    return trimesh.Trimesh(survey().vertices, survey().faces, process=False)


def smooth_ground() -> trimesh.Trimesh:
    truth = tapered()
    bare = scan_shapes.Truth(truth.solid, lambda x, y, z: -1.0, truth.ground, truth.up, 1.0)
    return scan_shapes.noisy(scan_shapes.scan(bare, 0.12), NOISE)


def two_rocks() -> trimesh.Trimesh:
    one, other = tapered((-0.55, 0.0)), tapered((0.55, 0.1))
    wide = scan_shapes.Truth(one.solid, one.rock, one.ground, one.up, 1.3)
    return scan_shapes.noisy(scan_shapes.scan(wide, 0.1, other), NOISE)


SCANS = {
    "closed": (lambda: tapered().solid, ("pedestal.cut", "without a rim", "closed rock")),
    "branching": (branching, ("rock.mesh", "scan.ply", "edges branch", "remesh")),
    "nowhere": (nowhere, ("rock.mesh", "scan.ply", "0 m large")),
    "no hollow": (smooth_ground, ("pedestal.cut", "no hollow", "give pedestal.cut")),
    "two rocks": (two_rocks, ("2 rocks", "set pedestal.point_on_rock")),
}


@pytest.mark.parametrize("name", SCANS)
def test_unfit_scan(tmp_path: Path, refused: Refused, name: str) -> None:
    make, words = SCANS[name]
    refuse(refused, tmp_path, make(), words)


CUTS = {
    "plane above": ("{kind: plane, point: [0, 0, 3], normal: [0, 0, 1]}", ("leaves no rock",)),
    "box elsewhere": ("{kind: box, low: [5, 5, 5], high: [6, 6, 6]}", ("leaves no rock",)),
    "plane below": ("{kind: plane, point: [0, 0, -1], normal: [0, 0, 1]}", ("the border",)),
    "box too wide": ("{kind: box, low: [-1.5, -0.5, 0], high: [0.5, 0.5, 2]}", ("the border",)),
    "no normal": ("{kind: plane, point: [0, 0, 0], normal: [0, 0, 0]}", ("without a normal",)),
    "box upside down": ("{kind: box, low: [1, 1, 1], high: [0, 0, 0]}", ("low is below high",)),
    "polygon crosses itself": (
        "{kind: polygon, corners: [[-1, -1], [1, 1], [1, -1], [-1, 1]]}", ("crosses itself",)
    ),
    "no such colour": ("{kind: colour, rgb: [0, 0, 255], tolerance: 20}", ("leaves no rock",)),
}  # fmt: skip


@pytest.mark.parametrize("name", CUTS)
def test_unfit_cut(tmp_path: Path, refused: Refused, name: str) -> None:
    cut, words = CUTS[name]
    refuse(refused, tmp_path, survey(), ("pedestal.cut: got ", *words), f"cut: {cut}")


def test_colour_of_a_scan_without_colours(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "scan.stl").write_bytes(without_colours().export(file_type="stl"))
    where = site(tmp_path, "cut: {kind: colour, rgb: [0, 0, 0]}", "mesh: scan.stl")
    words = ("pedestal.cut", "without colours", "another cut")
    refused("prep", "--site", where, words=words, page="prep.html")


def test_point_beside_every_rock(tmp_path: Path, refused: Refused) -> None:
    refuse(
        refused, tmp_path, survey(), ("no rock at", "tops found"), "point_on_rock: [0.9, 0.9, 0.0]"
    )


def test_places_of_rocks_are_in_the_scans_own_coordinates(tmp_path: Path, refused: Refused) -> None:
    write_ply(tmp_path / "scan.ply", two_rocks(), FAR)
    said = refused("prep", "--site", site(tmp_path), words=("2 rocks",), page="prep.html")
    places = re.findall(r"\((\S+), (\S+), (\S+)\)", said)
    tops = [np.array([float(x) for x in place]) - FAR for place in places]
    for at in ((-0.55, 0.0), (0.55, 0.1)):
        corners = np.array(tapered(at).solid.vertices)
        top = corners[corners[:, 2] > 0.9].mean(axis=0)
        assert min(np.linalg.norm(found - top) for found in tops) < 0.3


@pytest.mark.slow
def test_one_of_two_rocks() -> None:
    for at in ((-0.55, 0.0), (0.55, 0.1)):
        true = tapered(at).solid
        near = tuple(np.array(true.vertices)[np.argmax(true.vertices[:, 2])])
        found = prepare_scan(
            two_rocks, None, near=near, closing="caps", density=DENSITY, tell=NOBODY
        )
        place = np.array(found.rock.center_mass) + found.origin
        np.testing.assert_allclose(place, true.center_mass, atol=0.03)


def test_a_point_beside_a_cut_chooses_the_piece_that_holds_it() -> None:
    """A plane through two blocks that stand out of the ground, one larger than the other."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(25) / 4, np.arange(25) / 4))
    large = (abs(x - 1.5) < 0.9) & (abs(y - 1.5) < 0.9)
    small = (abs(x - 4.5) < 0.6) & (abs(y - 4.5) < 0.6)
    corner = np.arange(25 * 25).reshape(25, 25)
    a, b, c, d = (
        part.ravel()
        for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    vertices = np.column_stack([x, y, 1.0 * (large | small)])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    cut = Plane((0.0, 0.0, 0.3), (0.0, 0.0, 1.0))
    for point, middle in (((1.5, 1.5, 1.0), 1.5), ((4.5, 4.5, 1.0), 4.5), (None, 1.5)):
        found = by_cut(mesh, cut, None if point is None else np.array(point))
        corners = found.vertices[found.faces[found.rock]].reshape(-1, 3)
        assert (abs(corners[:, :2] - middle) < 1.2).all(), point
    with pytest.raises(InvalidInput, match=r"leaves pedestal\.point_on_rock to the"):
        by_cut(mesh, cut, np.array([3.0, 3.0, 0.0]))


def test_a_point_beside_a_cut_may_lie_on_lichen() -> None:
    """A ring of the ground's colour on a rock is rock; a point within it chooses what it rings."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(41) / 4, np.arange(41) / 4))
    corner = np.arange(41 * 41).reshape(41, 41)
    a, b, c, d = (
        part.ravel()
        for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    vertices = np.column_stack([x, y, np.zeros(len(x))])
    middle = vertices[faces].mean(axis=1)
    off = np.hypot(*(middle[:, :2] - 5.0).T)
    rock = (off < 3.0) & ~((off > 0.8) & (off < 1.6))
    alone, told = whole(vertices, faces, rock)
    on_ring, within = (nearest(middle, np.array([5.0 + at, 5.0, 0.0])) for at in (1.2, 0.0))
    found, words = whole(vertices, faces, rock, on_ring)
    np.testing.assert_array_equal(found, alone)
    assert words == told
    assert found[off < 2.7].all()
    inner, _ = whole(vertices, faces, rock, within)
    assert inner[off < 0.6].all()
    assert not inner[off > 1.0].any()


def test_a_point_beside_a_cut_chooses_one_of_two_rocks_that_touch() -> None:
    """The pocket between two rocks that touch in two vertices is neither's; lichen is rock."""
    rows = """
        ............
        ..AAAA......
        ..AAAA......
        ..AAApBBBB..
        ..AlApBBBB..
        ..AAAppBBB..
        ..AAAApBBB..
        ..AAAApBBB..
        ......BBBB..
        ............"""
    drawn = np.kron([[ord(one) for one in row] for row in rows.split()], np.ones((3, 3), dtype=int))
    corner = np.arange(31 * 37).reshape(31, 37)
    a, b, c, d = (
        part.ravel()
        for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    faces = np.vstack([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
    place = np.indices(corner.shape).reshape(2, -1).T[:, ::-1]
    vertices = np.column_stack([place, np.zeros(len(place))])
    letter = np.tile(drawn.ravel(), 2)
    rock = np.isin(letter, (ord("A"), ord("B")))
    middle = np.tile((np.indices(drawn.shape) % 3 == 1).all(axis=0).ravel(), 2)
    for own in (np.isin(letter, (ord("A"), ord("l"))), letter == ord("B")):
        for face in np.flatnonzero(own & middle)[::3]:
            found, _ = whole(vertices, faces, rock, int(face))
            assert own[found].all()
            assert found[own & middle].all()
    for face in np.flatnonzero(letter == ord("p"))[::10]:
        with pytest.raises(InvalidInput, match=r"leaves pedestal\.point_on_rock to the"):
            whole(vertices, faces, rock, int(face))


def test_point_beside_a_cut_is_in_the_scans_own_coordinates(
    tmp_path: Path, refused: Refused
) -> None:
    keys = "cut: {kind: plane, point: [0, 0, 0.1], normal: [0, 0, 1]}, point_on_rock: [0.9, 0.9, 0]"
    refuse(refused, tmp_path, survey(), ("pedestal.cut: got ", "to the ground"), keys)


@pytest.mark.parametrize("content", [b"", b"not a mesh", b"\x00\xff" * 50])
def test_file_that_is_no_scan(tmp_path: Path, refused: Refused, content: bytes) -> None:
    (tmp_path / "scan.ply").write_bytes(content)
    where = site(tmp_path)
    refused("prep", "--site", where, words=(str(where), "rock.mesh", "scan.ply"))


def test_box(refused: Refused, write_site: Callable[..., str]) -> None:
    words = ("rock.shape", "a box", "set rock.shape: mesh")
    refused("prep", "--site", write_site(), words=words)


def test_box_on_terrain(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "box.yaml"
    path.write_text("rock: {shape: box, size: [1, 1, 2], density: 2000}\npedestal: {shape: mesh}\n")
    refused("prep", "--site", path, words=("pedestal", "rock.shape: mesh"))


def test_scan_too_large_for_the_memory(
    tmp_path: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cleaning, "MEMORY", 100_000)
    refuse(refused, tmp_path, survey(), ("rock.mesh", "million faces", "decimate"))


def test_a_refused_scan_leaves_the_products_of_the_last_good_one(
    shown: Shown, tmp_path: Path
) -> None:
    here = shown.moved(tmp_path)
    write_ply(tmp_path / "scan.ply", tapered().solid)
    before = {p: p.read_bytes() for p in here.products.rglob("*") if p.is_file()}
    ran = run("prep", "--site", here.site, "--derived", here.derived)
    assert ran.code == 2
    page = here.products / "prep.html"
    assert "is refused" in page.read_text()
    del before[page]
    assert {p: p.read_bytes() for p in before} == before


# What is repaired


@pytest.mark.slow
def test_scan_with_the_usual_faults() -> None:
    """Split and lost vertices, faces without area, wound or given twice: the same rock."""
    mesh = survey()
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    rng = np.random.default_rng(3)
    split = rng.choice(len(faces), 60, replace=False)
    own = len(vertices) + np.arange(180).reshape(-1, 3)
    vertices = np.concatenate([vertices, vertices[faces[split]].reshape(-1, 3), [[np.nan] * 3]])
    faces[split] = own
    wrong = rng.choice(len(faces), 40, replace=False)
    faces[wrong] = faces[wrong, ::-1]
    flat = np.column_stack([faces[:20, 0], faces[:20, 1], faces[:20, 0]])
    lost = np.array([[faces[5, 0], faces[5, 1], len(vertices) - 1]])
    broken = trimesh.Trimesh(
        vertices, np.concatenate([faces, flat, lost, faces[100:103]]), process=False
    )
    found = prepare_scan(lambda: broken, None, closing="caps", density=DENSITY, tell=NOBODY)
    said = " ".join(found.notes)
    for word in ("not finite", "split vertices merged", "fewer than three points", "turned"):
        assert word in said
    assert found.rock.volume == pytest.approx(float(prepared().rock.volume), rel=1e-9)


# A user's scan, in place of a surrogate


def source_of(where: Path) -> Source:
    found = load_site(str(where))
    source = find(found.config.rock, found.config.pedestal, found)
    assert source is not None
    return source


@pytest.mark.slow
def test_a_scan_in_the_folder_takes_the_surrogates_place(
    tmp_path: Path, shown: Shown, quick: None
) -> None:
    where = site(tmp_path, rock="mesh: raw/, fallback: granite_dells")
    assert "surrogate" in source_of(where).label
    (tmp_path / "raw").mkdir()
    assert "surrogate" in source_of(where).label
    write_ply(tmp_path / "raw" / "mine.ply", survey(), FAR)
    before = shown.moved(tmp_path).derived
    where = site(tmp_path, rock="mesh: raw/, fallback: granite_dells")
    said = run("why", "rock", "--site", where, "--derived", before).out
    assert "scan: file mine.ply new" in said
    assert "scan: file scan.ply gone" in said
    ran = run("prep", "--site", where, "--derived", tmp_path / "anew")
    assert ran.code == 0, ran.err
    page = (tmp_path / "anew" / "hill" / "prep.html").read_text()
    assert "mine.ply" in page
    assert "surrogate" not in page.lower()
    see_that_it_is_the_rock(tmp_path / "anew" / "hill")


@pytest.mark.parametrize("name", ["rock.gltf", "rock.OFF", "rock.usdz", "cloud.laz", "scan.zip"])
def test_no_surrogate_stands_for_a_scan_in_a_format_that_is_not_read(
    tmp_path: Path, name: str
) -> None:
    where = site(tmp_path, rock="mesh: raw/, fallback: granite_dells")
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / name).touch()
    ran = run("plan", "rock", "--site", where, "--derived", tmp_path / "made")
    assert ran.code == 2
    assert ran.err.count("\n") == 1
    rule = "a mesh ends in .ply .stl .obj .dae .glb; convert it"
    assert f"raw/{name}; {rule}" in ran.err
    write_ply(tmp_path / "raw" / "mine.ply", survey(), FAR)
    assert "mine.ply" in source_of(where).label


def test_hidden_files_beside_a_scan_are_no_scans(tmp_path: Path) -> None:
    where = site(tmp_path, rock="mesh: raw/, fallback: granite_dells")
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "._mine.ply").touch()
    assert "surrogate" in source_of(where).label
    write_ply(tmp_path / "raw" / "mine.ply", survey(), FAR)
    assert "mine.ply" in source_of(where).label


@pytest.mark.slow
@pytest.mark.parametrize("name", ["double_rock_terrain", "granite_dells"])
def test_surrogate_sites(tmp_path: Path, name: str) -> None:
    ran = run("prep", "--site", name, "--derived", tmp_path)
    assert ran.code == 0, ran.err
    page = (tmp_path / name / "prep.html").read_text()
    assert "This is a surrogate, not a scan." in page
    assert (tmp_path / name / "terrain.nc").is_file()
    scan = read(tmp_path / name / "scan.nc")
    assert scan.attrs["accepted"] == 1


# What the steps do to each other


def test_rock_and_ground_meet_in_one_surface() -> None:
    for found in (prepared(),):
        terrain, rock = found.terrain, found.rock
        under = terrain.vertices[np.unique(terrain.faces[found.seat])]
        assert trimesh.proximity.closest_point(rock, under)[1].max() < 1e-9
        edges = np.sort(terrain.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        count = np.unique(edges, axis=0, return_counts=True)[1]
        assert count.max() == 2
        open_ = np.unique(edges, axis=0)[count == 1]
        rim = np.abs(terrain.vertices[open_][..., :2] + found.origin[:2]).max(axis=2)
        assert rim.min() > 0.8  # the scan's own border, and no gap around the rock


def test_all_faces_of_the_rock_are_seen_or_added() -> None:
    found = prepared()
    middle = np.array(found.rock.triangles_center) + found.origin
    height = middle @ tapered().up
    assert found.added.any()
    assert np.abs(height[found.added]).max() < 0.005
    normal = np.array(found.rock.face_normals) @ tapered().up
    assert normal[found.added].max() < -0.95
    assert (normal[~found.added] < -0.5).sum() == 0


def test_steps_follow_each_other() -> None:
    steps = prepared().steps
    clean_, separate, close, hull, seat, flight = steps
    rock = prepared().rock
    assert [step.name for step in steps[:3]] == ["clean", "separate", "close (caps)"]
    assert clean_.before.faces == len(survey().faces)
    assert clean_.after == separate.before
    assert separate.after == close.before
    assert separate.after.faces == int((~prepared().added).sum())
    assert close.after.faces == len(rock.faces)
    assert [step.after.watertight for step in steps[:3]] == [False, False, True]
    assert {step.after.mass for step in steps[2:]} == {close.after.mass}
    assert close.after.mass == pytest.approx(DENSITY * float(rock.volume))
    # A rock tips over its hull; on its seat all corners of the base are left.
    assert hull.tipping_change == pytest.approx(0.0, abs=1e-9)
    assert seat.tipping_change == pytest.approx(0.0, abs=1e-9)
    radius = float(np.linalg.norm(rock.vertices - rock.center_mass, axis=1).max())
    for step, share in ((seat, SEAT_SHARE), (flight, SEAT_SHARE + FLIGHT_SHARE)):
        assert step.hausdorff <= 1.001 * share * radius
        assert step.after.vertices <= step.before.vertices
    # The foot's middle is half its shorter side away from what was seen.
    assert 0.2 < close.hausdorff < 0.31


def test_a_box_weighs_and_tips_as_a_box_does() -> None:
    size, density = np.array([0.5, 0.8, 1.6]), 2500.0
    found = measured(trimesh.creation.box(size), density)
    mass = density * size.prod()
    assert found.mass == pytest.approx(mass)
    square = size**2
    np.testing.assert_allclose(np.diag(found.inertia), mass / 12.0 * (square.sum() - square))
    for k, half in ((0, 0.25), (18, 0.4), (36, 0.25), (54, 0.4)):
        assert np.degrees(DIRECTIONS[k]) == pytest.approx(90.0 * k / 18)
        assert found.tipping[k] == pytest.approx(np.arctan(half / 0.8))


def test_a_rock_on_a_steep_slope_still_has_tipping_angles() -> None:
    """They are those of level ground, in whatever pose it was scanned."""
    box = trimesh.creation.box((0.8, 0.8, 0.9))
    level = measured(box, 1.0).tipping
    box.apply_transform(trimesh.transformations.rotation_matrix(np.radians(28.0), [0, 1, 0]))
    np.testing.assert_allclose(measured(box, 1.0).tipping, level, atol=1e-6)


# The page and its pictures


def test_page_of_a_proposal(shown: Shown) -> None:
    page = shown.page
    assert 'id="accept"' in page
    assert "cut: proposal" in page
    assert 'src="http' not in page and 'href="http' not in page  # noqa: PT018
    scan = read(shown.products / "scan.nc")
    rock = trimesh.Trimesh(scan["rock_vertex"].values, scan["rock_face"].values, process=False)
    assert f"{rock.volume:.3g} m³" in page
    near = re.search(r"point_on_rock: \[(.*?)\]", page)
    assert near is not None
    top = np.array([float(x) for x in near[1].split(",")]) - FAR
    true = np.array(tapered().solid.vertices)
    assert top[2] == pytest.approx(true[:, 2].max(), abs=0.05)
    centre = re.search(r"<td>(712345\.\d+), (3894567\.\d+), (25\d\.\d+)</td>", page)
    assert centre is not None
    place = np.array([float(x) for x in centre.groups()]) - FAR
    np.testing.assert_allclose(place, tapered().solid.center_mass, atol=PLACE)


@pytest.mark.slow
def test_page_of_an_accepted_and_of_a_given_cut(quick: None) -> None:
    found = prepared()
    page = scan_page.page("hill", "made from figures", found, accepted=True, surrogate=True)
    assert 'id="accept"' not in page
    assert "configuration accepts it" in page
    assert "This is a surrogate, not a scan." in page
    up = tapered().up
    cut = Plane(tuple(0.02 * up), tuple(up))
    given = prepare_scan(survey, cut, closing="hull", density=DENSITY, tell=NOBODY)
    page = scan_page.page("<hill>", "scan of <mine>", given, accepted=True, surrogate=False)
    assert "The cut is the one that the site" in page
    assert "confidence" not in page
    assert "<hill>" not in page
    assert "scan of &lt;mine&gt;" in page
    rows = re.findall(r'<tr><td class="keep">(caps|hull|poisson)</td>', page)
    assert rows == ["hull", "caps", "poisson"]


def tipping_towards(solid: trimesh.Trimesh, up: Array, away: Array) -> float:
    """Slope [degree] at which a rock on its base topples over the edge that faces ``away``."""
    points = np.array(solid.vertices)
    foot = points[points @ up < 1e-6]
    reach = ((foot - np.array(solid.center_mass)) @ away).max()
    return float(np.degrees(np.arctan2(reach, np.array(solid.center_mass) @ up)))


def tippings_of(found: Prepared) -> Figure:
    chosen = found.steps[-1].after.tipping
    return scan_figures.tippings(found.closing, chosen, found.trials, "scan")


def test_tipping_angles_are_drawn_in_degrees_by_direction() -> None:
    figure = tippings_of(prepared())
    polar, change = figure.axes
    lines = [line for line in polar.get_lines() if line.get_gid() == "tipping"]
    wide = max(lines, key=lambda line: line.get_linewidth())
    turn, angle = wide.get_data()
    # The foot's sides face 20 deg and every 90 deg from there.
    for side in np.radians([20.0, 110.0, 200.0, 290.0]):
        k = int(np.argmin(np.abs(turn - side)))
        level = np.array([np.cos(side), np.sin(side), 0.0])
        away = level - (level @ tapered().up) * tapered().up
        expected = tipping_towards(tapered().solid, tapered().up, away / np.linalg.norm(away))
        assert angle[k] == pytest.approx(expected, abs=2.5)
    labels = [text.get_text() for text in change.get_legend().get_texts()]
    assert labels[0] == "caps (chosen)"
    np.testing.assert_allclose(change.get_lines()[0].get_ydata(), 0.0)


def test_a_rock_that_falls_is_said_to(quick: None) -> None:
    found = prepared()
    fallen = replace(found.steps[-1].after, tipping=np.full(len(DIRECTIONS), np.nan))
    found = replace(found, steps=(*found.steps[:-1], replace(found.steps[-1], after=fallen)))
    page = scan_page.page("hill", "scan", found, accepted=False, surrogate=False)
    assert "does not stand on level ground" in page
    assert "smallest static tipping angle" not in page
    figure = tippings_of(found)
    labels = [text.get_text() for text in figure.axes[1].get_legend().get_texts()]
    assert labels[0] == "caps (chosen): does not stand"


def share_of(picture: Array, colour: str) -> float:
    """Share of a picture in the hue of a colour, whatever the light."""
    from matplotlib.colors import to_rgb

    hue = np.array(to_rgb(colour)) / np.linalg.norm(to_rgb(colour))
    pixels = picture.reshape(-1, 3)
    lit = pixels / np.linalg.norm(pixels, axis=1, keepdims=True)
    return float((lit @ hue > 0.9995).mean())


def pictures(figure: object) -> list[Array]:
    return [np.asarray(axes.images[0].get_array()) for axes in figure.axes if axes.images]


def test_the_added_surface_is_seen_from_below_only() -> None:
    figure = scan_figures.closed_rock(prepared(), "scan")
    added = [share_of(picture, scan_figures.ADDED) for picture in pictures(figure)]
    rock = [share_of(picture, scan_figures.ROCK) for picture in pictures(figure)]
    assert max(added[:2]) < 1e-3  # an edge of it
    assert min(added[2:]) > 0.02
    assert min(rock[:2]) > 0.1
    assert rock[3] < 0.1 * added[3]  # it narrows upward: from below its foot hides all else


def test_the_seat_is_as_large_as_the_foot() -> None:
    figure = scan_figures.seat(prepared(), "scan")
    above = pictures(figure)[0]
    scale = next(t for t in figure.axes[0].texts if t.get_gid() == "scale")
    bar = figure.axes[0].get_lines()[-1].get_xdata()
    metre = (bar[1] - bar[0]) / float(scale.get_text().split()[0])
    area = share_of(above, scan_figures.ADDED) * above.shape[0] * above.shape[1] / metre**2
    assert area == pytest.approx(0.72 * 0.6 * tapered().up[2], rel=0.1)


@pytest.mark.slow
def test_the_seam_is_drawn_once_in_every_view() -> None:
    figure = scan_figures.separation(prepared(), "scan")
    edges = len(prepared().separation.seams[0].loop)
    assert len(pictures(figure)) == 4
    for axes in figure.axes:
        drawn = {line.get_gid(): len(line.get_segments()) for line in axes.collections}
        assert sum(drawn.values()) == edges
    above = {line.get_gid(): len(line.get_segments()) for line in figure.axes[1].collections}
    assert above["seam"] > 0.7 * edges  # it narrows upward: little hides its foot from above
    for axes in figure.axes[2:]:  # from a side the rock hides its other side
        drawn = {line.get_gid(): len(line.get_segments()) for line in axes.collections}
        assert 0.25 * edges < drawn["hidden seam"] < 0.75 * edges
