"""Surrogate sites against what they state, and scans of them against the sites."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import shapely
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, KDTree

from vsr_core.rock.body import convex_hull
from vsr_core.rock.tipping import tipping
from vsr_core.rock.triangles import self_intersections
from vsr_core.surrogates import SITES, double_rock_terrain
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.surrogates.double_rock_terrain import GAP, LIP_HEIGHT, NICHE_WIDTH, NICHE_X, NICHE_Y
from vsr_core.surrogates.ground import offset, resampled, rounded
from vsr_core.surrogates.raw_scan import RawScan, scan
from vsr_core.surrogates.surrogate_site import SurrogateSite

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@functools.cache
def made(name: str) -> SurrogateSite:
    return SITES[name]()


@functools.cache
def scanned(name: str, **changes: float) -> RawScan:
    return scan(made(name), **changes)  # type: ignore[arg-type]


@pytest.fixture(
    params=["double_rock_terrain", pytest.param("granite_dells", marks=pytest.mark.slow)]
)
def name(request: pytest.FixtureRequest) -> str:
    """Of a site that is scanned."""
    return str(request.param)


@pytest.fixture(params=SITES)
def site(request: pytest.FixtureRequest) -> SurrogateSite:
    return made(request.param)


def edges(faces: Indices) -> tuple[Indices, Indices]:
    """Edges of a mesh, shape (n, 2), ascending, and how many faces each joins."""
    every = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(every, axis=0, return_counts=True)


def loops(sides: Indices) -> int:
    """Number of closed loops that sides form; every vertex must be on two of them."""
    vertices, number = np.unique(sides, return_inverse=True)
    number = number.reshape(-1, 2)
    assert (np.bincount(number.ravel()) == 2).all()
    joined = coo_array((np.ones(len(number)), tuple(number.T)), shape=(len(vertices),) * 2)
    return int(connected_components(joined, directed=False)[0])


def is_one_sheet(faces: Indices) -> bool:
    """Connected, each edge in one or two faces, one border loop, no holes (Euler number 1)."""
    sides, count = edges(faces)
    joined = coo_array((np.ones(len(sides)), tuple(sides.T)))
    size = int(faces.max()) + 1
    joined.resize((size, size))
    labels = connected_components(joined, directed=False)[1]
    used = np.unique(faces)
    euler = len(used) - len(sides) + len(faces)
    return bool(
        len(np.unique(labels[used])) == 1
        and count.max() == 2
        and loops(sides[count == 1]) == 1
        and euler == 1
    )


def merged(raw: RawScan) -> tuple[Array, Indices]:
    """The scan in the site frame, vertices at one place made one."""
    places, number = np.unique(raw.vertices, axis=0, return_inverse=True)
    return places - raw.offset, number.reshape(-1)[raw.faces]


def heights(site: SurrogateSite, places: Array) -> Array:
    """Height of the terrain [m] at places, shape (n, 2), from the triangle over each."""
    corners = site.terrain_vertices[site.terrain_faces]
    near = (corners.max(axis=1)[:, :2] >= places.min(axis=0)).all(axis=1) & (
        corners.min(axis=1)[:, :2] <= places.max(axis=0)
    ).all(axis=1)
    corners = corners[near]
    a, b, c = corners[:, 0, :2], corners[:, 1, :2], corners[:, 2, :2]
    matrix = np.linalg.inv(np.stack([b - a, c - a], axis=-1))
    found = np.full(len(places), np.nan)
    for k, place in enumerate(places):
        share = np.einsum("nij,nj->ni", matrix, place - a)
        over = np.flatnonzero((share >= -1e-9).all(axis=1) & (share.sum(axis=1) <= 1.0 + 1e-9))
        rise = corners[over, 1:, 2] - corners[over, :1, 2]
        found[k] = (corners[over, 0, 2] + (share[over] * rise).sum(axis=1)).max()
    return found


def hull_of(site: SurrogateSite) -> trimesh.Trimesh:
    return trimesh.Trimesh(site.rock_vertices, site.rock_faces, process=False).convex_hull


def test_rock_is_a_closed_solid_over_the_origin(site: SurrogateSite) -> None:
    rock = trimesh.Trimesh(site.rock_vertices, site.rock_faces, process=False)
    assert rock.is_volume
    assert rock.euler_number == 2
    assert len(self_intersections(site.rock_vertices, site.rock_faces)) == 0
    np.testing.assert_allclose(rock.center_mass[:2], 0.0, atol=1e-9)
    assert rock.vertices[:, 2].min() == 0.0


def test_double_rock_is_the_rock_of_its_site() -> None:
    site = made("double_rock_terrain")
    rock = trimesh.Trimesh(site.rock_vertices, site.rock_faces, process=False)
    alone = trimesh.Trimesh(*double_rock(), process=False)
    assert rock.volume == pytest.approx(alone.volume)
    assert rock.center_mass[2] == pytest.approx(alone.center_mass[2])
    np.testing.assert_allclose(rock.moment_inertia, alone.moment_inertia, rtol=1e-6)


def test_boulder_is_precarious_and_uneven() -> None:
    site = made("granite_dells")
    rock = trimesh.Trimesh(site.rock_vertices, site.rock_faces, process=False)
    hull = convex_hull(site.rock_vertices - rock.center_mass)
    angles = np.degrees(tipping(hull, np.radians(np.arange(0.0, 360.0, 10.0))).angle)
    assert 12.0 < angles.min() < angles.max() < 25.0
    assert angles.max() > 1.2 * angles.min()
    assert 1.5 < rock.extents.max() < 2.0
    assert rock.volume < 0.98 * rock.convex_hull.volume


def test_base_touches_along_the_contact_rim(site: SurrogateSite) -> None:
    rim = site.contact_rim
    assert (rim[:, 2] == 0.0).all()
    after = np.roll(rim, -1, axis=0)
    assert np.sum(rim[:, 0] * after[:, 1] - rim[:, 1] * after[:, 0]) > 0.0
    low = site.rock_vertices[site.rock_vertices[:, 2] == 0.0, :2]
    hull = ConvexHull(low)
    assert len(np.unique(np.vstack([low[hull.vertices], rim[:, :2]]), axis=0)) == len(rim)


def test_terrain_is_one_sheet_that_looks_up(site: SurrogateSite) -> None:
    vertices, faces = site.terrain_vertices, site.terrain_faces
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals[:, 2].min() > 0.0
    assert len(np.unique(faces)) == len(vertices)
    assert is_one_sheet(faces)
    plan = 0.5 * normals[:, 2].sum()
    assert plan == pytest.approx(np.prod(np.ptp(vertices[:, :2], axis=0)))
    assert len(faces) < 40_000


def test_terrain_does_not_cross_itself(site: SurrogateSite) -> None:
    assert len(self_intersections(site.terrain_vertices, site.terrain_faces)) == 0


def test_relief() -> None:
    double, granite = made("double_rock_terrain"), made("granite_dells")
    assert 11.0 < np.ptp(double.terrain_vertices[:, 2]) < 13.5
    assert 5.0 < np.ptp(granite.terrain_vertices[:, 2]) < 8.0


def test_rock_stands_clear_of_the_terrain_by_the_stated_clearance(site: SurrogateSite) -> None:
    hull = hull_of(site)
    for rock in (trimesh.Trimesh(site.rock_vertices, site.rock_faces, process=False), hull):
        low = np.array(rock.vertices)[rock.vertices[:, 2] < 0.9]
        apart = low[:, 2] - heights(site, low[:, :2])
        assert apart.min() == pytest.approx(site.clearance, abs=2e-6)
        seated = low[:, 2] == 0.0
        np.testing.assert_allclose(apart[seated], site.clearance, atol=2e-6)
        near = (site.terrain_vertices[site.terrain_faces].min(axis=1) < rock.bounds[1]).all(axis=1)
        near &= (site.terrain_vertices[site.terrain_faces].max(axis=1) > rock.bounds[0]).all(axis=1)
        both = np.vstack([rock.vertices, site.terrain_vertices])
        faces = np.vstack([rock.faces, len(rock.vertices) + site.terrain_faces[near]])
        crossing = self_intersections(both, faces)
        assert not (crossing[:, 0] < len(rock.faces)).any()


def test_nothing_but_the_base_is_near_the_ground(site: SurrogateSite) -> None:
    # A lean by a degree presses no other part of the hull into the ground around the seat.
    hull = hull_of(site)
    low = np.array(hull.vertices)[(hull.vertices[:, 2] > 0.02) & (hull.vertices[:, 2] < 0.3)]
    apart = low[:, 2] - heights(site, low[:, :2])
    assert apart.min() > np.radians(1.0)


def test_boulder_stands_on_the_crown_of_its_dome() -> None:
    site = made("granite_dells")
    near = np.hypot(*site.terrain_vertices[:, :2].T) < 1.0
    assert site.terrain_vertices[near, 2].max() == pytest.approx(-site.clearance, abs=2e-6)


def flanks(site: SurrogateSite, height: float) -> tuple[Array, Array]:
    """Level cuts of the rock's hull and of the terrain near it, as points."""
    near = np.abs(site.terrain_vertices[site.terrain_faces][..., :2]).max(axis=(1, 2)) < 1.1
    terrain = trimesh.Trimesh(site.terrain_vertices, site.terrain_faces[near], process=False)
    cuts = []
    for mesh in (hull_of(site), terrain):
        segments = trimesh.intersections.mesh_plane(mesh, [0, 0, 1], [0, 0, height])
        share = np.linspace(0.0, 1.0, 5)[:, None, None]
        cuts.append(((1 - share) * segments[:, 0, :2] + share * segments[:, 1, :2]).reshape(-1, 2))
    return cuts[0], cuts[1]


def test_supports_stand_before_and_behind_the_rock() -> None:
    site = made("double_rock_terrain")
    rock, ground = flanks(site, 0.36)
    for side in (rock[:, 0].max(), rock[:, 0].min()):
        ahead = ground[(ground[:, 0] * side > 0.0) & (np.abs(ground[:, 1]) < 0.3)]
        gap = np.linalg.norm(ahead[:, None] - rock, axis=2).min()
        assert 0.015 < gap < GAP + 0.05
    beside = ground[(np.abs(ground[:, 0] + 0.2) < 0.12)]
    assert np.abs(beside[:, 1]).min(initial=9.0) > rock[:, 1].max() + 0.25


def test_supports_walls_are_steep() -> None:
    site = made("double_rock_terrain")
    corners = site.terrain_vertices[site.terrain_faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normals, axis=1)
    near = np.abs(corners[..., :2]).max(axis=(1, 2)) < 1.0
    steep = near & (normals[:, 2] < 2.0 * area * np.cos(np.radians(85.0)))
    assert area[steep].sum() > 1.0  # m^2: some 4 m of walls


@pytest.mark.parametrize("height", [0.35, 0.6])
def test_supports_are_as_high_as_asked(height: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(double_rock_terrain, "FRONT_HEIGHT", height)
    monkeypatch.setattr(double_rock_terrain, "BACK_HEIGHT", height)
    site = double_rock_terrain.site()
    for side in (1.0, -1.0):
        x = site.terrain_vertices[:, 0] + 0.2
        front = (x * side > 0.3) & (np.hypot(x, site.terrain_vertices[:, 1]) < 0.95)
        front &= np.abs(site.terrain_vertices[:, 1]) < 0.5
        top = site.terrain_vertices[front, 2].max()
        assert height - 0.02 < top < height + 0.1
    hull = hull_of(site)
    low = np.array(hull.vertices)[hull.vertices[:, 2] < 0.9]
    assert (low[:, 2] - heights(site, low[:, :2])).min() == pytest.approx(site.clearance, abs=2e-6)


def test_niche_is_a_bench_behind_a_lip() -> None:
    site = made("double_rock_terrain")
    x = np.linspace(NICHE_X - 2.0, NICHE_X + 2.0, 81)
    for aside in (-0.3, 0.0, 0.3):
        y = NICHE_Y + aside * NICHE_WIDTH
        z = heights(site, np.column_stack([x, np.full(len(x), y)]))
        middle = z[np.abs(x - NICHE_X) < 0.3]
        assert np.ptp(middle) < 0.15
        outside = x > NICHE_X + 0.3
        lip = z[outside].max()
        assert lip - middle.mean() == pytest.approx(LIP_HEIGHT, abs=0.2)
        assert z[-1] < middle.mean() - 0.3
        assert z[0] > middle.mean() + 0.7
    # The rock's way there, about 6 m, is bent: longer than the straight one to where it lies.
    floor = heights(site, np.array([[NICHE_X, NICHE_Y]]))[0]
    down = 0.74 - (floor + 0.4)
    assert 3.5 < np.hypot(NICHE_X, down) < 6.0


@pytest.mark.parametrize("name", SITES)
def test_sites_are_repeatable(name: str) -> None:
    first, second = made(name), SITES[name]()
    for field in ("rock_vertices", "rock_faces", "terrain_vertices", "terrain_faces"):
        assert getattr(first, field).tobytes() == getattr(second, field).tobytes()
    np.testing.assert_array_equal(first.terrain_vertices, np.round(first.terrain_vertices, 6))


def test_too_narrow_a_gap_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(double_rock_terrain, "GAP", -0.1)
    with pytest.raises(ValueError, match="widen the gap"):
        double_rock_terrain.site()


def test_scan_is_one_open_sheet_in_projected_coordinates(name: str) -> None:
    raw = scanned(name)
    vertices, faces = merged(raw)
    assert is_one_sheet(faces)
    assert raw.vertices.dtype == np.float64
    assert raw.vertices[:, 1].min() > 3e6
    assert np.abs(vertices).max() < 30.0


def test_scan_has_the_faults_of_an_export(name: str) -> None:
    raw = scanned(name)
    vertices, faces = merged(raw)
    assert len(np.unique(raw.faces)) == len(raw.vertices) > 1.02 * len(vertices)  # split
    for part in (raw.rock, ~raw.rock):
        sides = faces[part][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        _, count = np.unique(sides, axis=0, return_counts=True)
        assert (count == 2).any()  # wound against a neighbour


def test_scan_shows_neither_the_base_nor_the_seat(name: str) -> None:
    raw = scanned(name, noise=0.0)
    vertices, faces = merged(raw)
    site = made(name)
    base = shapely.Polygon(site.contact_rim)
    under = shapely.contains_xy(base, vertices[:, :2]) & (vertices[:, 2] < 0.009)
    assert not under.any()
    assert vertices[faces[raw.rock]][..., 2].min() > 0.009
    truth = np.vstack([site.rock_vertices, site.terrain_vertices])
    seated = shapely.contains_xy(base, truth[:, :2]) & (truth[:, 2] < 0.015)
    assert seated.any()


def test_rock_ends_in_one_loop_at_the_seam(name: str) -> None:
    raw = scanned(name, noise=0.0)
    vertices, faces = merged(raw)
    shared = {tuple(s) for s in edges(faces[raw.rock])[0].tolist()} & {
        tuple(s) for s in edges(faces[~raw.rock])[0].tolist()
    }
    seam = np.array(sorted(shared))
    assert loops(seam) == 1
    height = vertices[np.unique(seam), 2]
    assert 0.009 < height.min() <= height.max() < 0.06
    rock, count = edges(faces[raw.rock])
    assert {tuple(s) for s in rock[count == 1].tolist()} == shared  # and nowhere else
    assert loops(edges(faces)[0][edges(faces)[1] == 1]) == 1


def test_scan_without_noise_lies_on_the_site(name: str) -> None:
    raw = scanned(name, noise=0.0, spacing=10.0)
    site = made(name)
    truth = np.vstack([site.rock_vertices, site.terrain_vertices])
    seen = raw.vertices - raw.offset
    apart, nearest = KDTree(truth).query(seen)
    rock = trimesh.Trimesh(site.rock_vertices, site.rock_faces, process=False)
    assert trimesh.proximity.closest_point(rock, seen[apart > 1e-8])[1].max() < 1e-8
    hidden = np.setdiff1d(np.arange(len(truth)), nearest)
    assert np.hypot(*truth[hidden, :2].T).max() < 0.7
    assert truth[hidden, 2].max() < 0.015


@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_noise_is_as_asked_half_of_it_smooth(name: str, noise: float) -> None:
    still, moved = scanned(name, noise=0.0), scanned(name, noise=noise)
    np.testing.assert_array_equal(still.faces, moved.faces)
    shift = moved.vertices - still.vertices
    error = np.linalg.norm(shift, axis=1)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(noise, rel=0.1)
    corners = still.vertices[still.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.einsum("nj,nkj->nk", normal, shift[still.faces])
    assert np.mean(along**2) > 0.8 * noise**2
    near = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1) < 0.1
    close = along[near & (np.abs(normal[:, 2]) > 0.5)]
    correlation = np.mean(close[:, 0] * close[:, 1]) / np.mean(close[:, :2] ** 2)
    assert correlation == pytest.approx(0.5, abs=0.15)


@pytest.mark.slow
def test_spacing_bounds_the_edges_and_changes_no_surface(name: str) -> None:
    coarse, fine = scanned(name, noise=0.0, spacing=10.0), scanned(name, noise=0.0, spacing=0.2)
    vertices, faces = merged(fine)
    sides = vertices[edges(faces)[0]]
    assert np.linalg.norm(sides[:, 0] - sides[:, 1], axis=1).max() < 0.2 + 1e-8
    assert is_one_sheet(faces)
    areas = []
    for raw in (coarse, fine):
        for part in (raw.rock, ~raw.rock):
            mesh = trimesh.Trimesh(raw.vertices - raw.offset, raw.faces[part], process=False)
            areas.append(mesh.area)
    assert areas[:2] == pytest.approx(areas[2:], rel=1e-6)
    assert len(fine.faces) > 1.5 * len(coarse.faces)


@pytest.mark.slow
def test_a_seed_fixes_every_byte(name: str) -> None:
    first, second, other = scanned(name), scan(made(name)), scan(made(name), seed=1)
    for field in ("vertices", "faces", "colours", "rock"):
        assert getattr(first, field).tobytes() == getattr(second, field).tobytes()
        assert getattr(first, field).tobytes() != getattr(other, field).tobytes()


def test_colours_tell_rock_from_ground(name: str) -> None:
    raw = scanned(name)
    light = raw.colours.mean(axis=1)[raw.faces].mean(axis=1)
    threshold = 0.5 * (light[raw.rock].mean() + light[~raw.rock].mean())
    assert raw.colours.shape == raw.vertices.shape
    assert np.mean(light[raw.rock] < threshold) > 0.95
    assert np.mean(light[~raw.rock] > threshold) > 0.95


def test_outlines() -> None:
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    np.testing.assert_allclose(
        offset(square, 0.1), [[-0.1, -0.1], [2.1, -0.1], [2.1, 2.1], [-0.1, 2.1]]
    )
    assert len(resampled(square, 0.5)) == 16
    cut = ConvexHull(rounded(square))
    assert cut.volume == pytest.approx(4.0 - 4 * 0.5 * 0.5**2)
