"""Rocks from meshes: mass properties against closed forms, checks against crafted faults."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vsr_core.errors import InvalidInput
from vsr_core.rock.solid import box, checked, from_mesh
from vsr_core.rock.triangles import self_intersections
from vsr_core.surrogates.double_rock import double_rock

Array = NDArray[np.float64]
SIDE = st.floats(0.05, 3.0)


def tensor(rock) -> Array:  # type: ignore[no-untyped-def]
    inertia: Array = rock.axes * rock.inertia @ rock.axes.T
    return inertia


def surrogate() -> trimesh.Trimesh:
    return trimesh.Trimesh(*double_rock(), process=False)


def standing(points: Array) -> trimesh.Trimesh:
    """Convex mesh on its face nearest to the centre of mass, which it always rests on."""
    mesh = trimesh.convex.convex_hull(points)
    away = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles[:, 0] - mesh.center_mass)
    down = mesh.face_normals[np.argmin(away)]
    mesh.vertices = Rotation.align_vectors([[0, 0, -1]], [down])[0].apply(mesh.vertices)
    return mesh


def by_tetrahedra(vertices: Array, faces: NDArray[np.int64]) -> tuple[float, Array, Array]:
    """Volume, centre and inertia at density 1, from exact moments of tetrahedra to the origin."""
    corners = vertices[faces]
    volumes = np.linalg.det(corners) / 6.0
    volume = volumes.sum()
    sums = corners.sum(axis=1)
    centre = volumes @ sums / 4.0 / volume
    squares = np.einsum("nki,nkj->nij", corners, corners) + np.einsum("ni,nj->nij", sums, sums)
    second = np.einsum("n,nij->ij", volumes / 20.0, squares)
    second -= volume * np.outer(centre, centre)
    return float(volume), centre, np.trace(second) * np.eye(3) - second


@given(SIDE, SIDE, SIDE, st.floats(100.0, 8000.0))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_box_and_its_mesh_have_the_closed_form(
    x: float, y: float, z: float, density: float
) -> None:
    solid = box((x, y, z), density)
    mass = density * x * y * z
    inertia = mass / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
    assert solid.rock.mass == pytest.approx(mass)
    np.testing.assert_allclose(tensor(solid.rock), inertia, rtol=1e-12, atol=1e-12 * mass)
    assert solid.rock.radius == pytest.approx(0.5 * math.hypot(x, y, z))
    assert solid.rock.height == pytest.approx(0.5 * z)
    mesh = trimesh.creation.box((x, y, z))
    mesh.apply_translation((3.0, -2.0, 7.0))
    meshed = from_mesh(mesh, density)
    assert meshed.volume == pytest.approx(x * y * z)
    assert meshed.turned == pytest.approx(0.0, abs=1e-9)
    assert meshed.rock.mass == pytest.approx(mass)
    scale = np.abs(inertia).max()
    np.testing.assert_allclose(tensor(meshed.rock), inertia, atol=1e-9 * scale)
    np.testing.assert_allclose(meshed.rock.vertices.min(axis=0), [-x / 2, -y / 2, -z / 2])


@given(st.floats(0.0, 360.0), st.floats(0.0, 4.5), st.floats(0.0, 360.0))
@settings(max_examples=8, deadline=None, derandomize=True)
def test_mass_properties_turn_with_the_rock(yaw: float, tilt: float, direction: float) -> None:
    """Turned by any yaw; and a scan tilted by less than the 5 deg that topple it comes back."""
    given_mesh = surrogate()
    level = from_mesh(given_mesh, 2110.0)
    axis = np.array([math.cos(math.radians(direction)), math.sin(math.radians(direction)), 0.0])
    turn = Rotation.from_rotvec(math.radians(tilt) * axis) * Rotation.from_euler(
        "z", yaw, degrees=True
    )
    mesh = given_mesh.copy()
    mesh.vertices = turn.apply(mesh.vertices) + np.array([1.0, 2.0, 3.0])
    turned = from_mesh(mesh, 2110.0)
    r = np.linalg.lstsq(level.vertices, turned.vertices, rcond=None)[0].T
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-9)
    assert turned.turned == pytest.approx(math.radians(tilt), abs=1e-6)
    np.testing.assert_allclose(r[2], [0.0, 0.0, 1.0], atol=1e-6)
    expected = r @ tensor(level.rock) @ r.T
    np.testing.assert_allclose(tensor(turned.rock), expected, atol=1e-8 * expected.max())
    assert turned.rock.mass == pytest.approx(level.rock.mass)
    assert turned.volume == pytest.approx(level.volume)
    low = turned.rock.vertices[:, 2] < turned.rock.vertices[:, 2].min() + 1e-6
    assert low.sum() >= 3


def test_mass_properties_against_tetrahedra() -> None:
    rng = np.random.default_rng(3)
    hulls = [standing(rng.standard_normal((40, 3))) for _ in range(5)]
    for mesh in [surrogate(), trimesh.creation.torus(1.0, 0.3), *hulls]:
        volume, centre, inertia = by_tetrahedra(np.array(mesh.vertices), np.array(mesh.faces))
        solid = from_mesh(mesh, 2000.0)
        assert solid.volume == pytest.approx(volume, rel=1e-9)
        assert solid.rock.mass == pytest.approx(2000.0 * volume, rel=1e-9)
        turn = np.linalg.lstsq(mesh.vertices - centre, solid.vertices, rcond=None)[0].T
        expected = 2000.0 * turn @ inertia @ turn.T
        np.testing.assert_allclose(tensor(solid.rock), expected, atol=1e-8 * expected.max())
        # Principal: moments ascending, a right-handed frame, diagonal in it.
        assert (np.diff(solid.rock.inertia) >= 0.0).all()
        assert np.linalg.det(solid.rock.axes) == pytest.approx(1.0)
        diagonal = solid.rock.axes.T @ expected @ solid.rock.axes
        np.testing.assert_allclose(
            diagonal, np.diag(solid.rock.inertia), atol=1e-8 * expected.max()
        )
        again = by_tetrahedra(solid.vertices, solid.faces)
        np.testing.assert_allclose(again[1], 0.0, atol=1e-9)


@pytest.mark.parametrize("away", [(40, 30, 20), (6e5, 2e5, 500), (512345.5, 5123456.25, 1234.5)])
def test_a_scan_in_coordinates_of_a_map_is_the_same_rock(away: tuple[float, ...]) -> None:
    """In a grid of a country and in UTM; multiples of a quarter of a metre round nothing off."""
    mesh = trimesh.creation.box((0.75, 0.5, 1.5))
    mesh.apply_translation((0.25, 0.5, 0.75))
    far = mesh.copy()
    far.vertices = np.array(mesh.vertices) + away
    here, there = (from_mesh(checked(one)[0], 2000.0) for one in (mesh, far))
    assert there.volume == pytest.approx(here.volume, rel=1e-9)
    np.testing.assert_allclose(there.rock.inertia, here.rock.inertia, rtol=1e-8)
    np.testing.assert_allclose(there.rock.vertices, here.rock.vertices, atol=1e-8)


def test_ellipsoids_converge_to_the_closed_form() -> None:
    """The volume and inertia of an inscribed polyhedron converge with the square of its edge."""
    a, b, c = 0.6, 0.8, 0.5
    volume = 4.0 / 3.0 * math.pi * a * b * c
    inertia = 2000.0 * volume / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    errors = []
    for subdivisions in (2, 3, 4):
        mesh = trimesh.creation.icosphere(subdivisions)
        mesh.apply_scale((a, b, c))
        solid = from_mesh(mesh, 2000.0)
        errors.append([1.0 - solid.volume / volume, *(1.0 - solid.rock.inertia / np.sort(inertia))])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    np.testing.assert_allclose(ratios, 4.0, rtol=0.06)
    assert np.abs(errors[-1]).max() < 0.01


def cross_by_brute_force(one: Array, other: Array) -> bool:
    """Whether an edge of either triangle meets the inside of the other: solved edge by edge."""
    for edged, pierced in ((one, other), (other, one)):
        for k in range(3):
            start, end = edged[k], edged[(k + 1) % 3]
            sides = np.column_stack([end - start, pierced[0] - pierced[1], pierced[0] - pierced[2]])
            if abs(np.linalg.det(sides)) < 1e-14:
                continue
            t, u, v = np.linalg.solve(sides, pierced[0] - start)
            if 0.0 < t < 1.0 and u > 0.0 and v > 0.0 and u + v < 1.0:
                return True
    return False


@pytest.mark.slow
@given(st.integers(0, 10**6), st.floats(0.02, 3.0), st.floats(1.0, 30.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_crossing_triangles_against_brute_force(seed: int, size: float, spread: float) -> None:
    """Soups from crowded to sparse, of triangles of very different sizes."""
    rng = np.random.default_rng(seed)
    count = 25
    sizes = size * spread ** rng.uniform(-1.0, 1.0, (count, 1, 1))
    triangles = rng.uniform(-1, 1, (count, 1, 3)) + sizes * rng.standard_normal((count, 3, 3))
    found = self_intersections(triangles.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    expected = {
        (i, j)
        for i, j in itertools.combinations(range(count), 2)
        if cross_by_brute_force(triangles[i], triangles[j])
    }
    assert {(int(i), int(j)) for i, j in found} == expected


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.icosphere(3),
        trimesh.creation.torus(1.0, 0.3),
        trimesh.creation.box((1.0, 1.0, 2.0)),
        surrogate(),
    ],
    ids=["sphere", "torus", "box", "surrogate"],
)
def test_clean_surfaces_do_not_cross_themselves(mesh: trimesh.Trimesh) -> None:
    assert len(self_intersections(np.array(mesh.vertices), np.array(mesh.faces))) == 0
    same, repaired = checked(mesh)
    assert repaired == ()
    assert same.volume == pytest.approx(mesh.volume)


def test_crafted_crossings_are_found() -> None:
    """One vertex of a sphere pulled through its far side; a torus whose tube overlaps itself."""
    sphere = trimesh.creation.icosphere(2)
    top = int(np.argmax(sphere.vertices[:, 2]))
    vertices = np.array(sphere.vertices)
    vertices[top] = (0.05, 0.03, -1.5)
    pairs = self_intersections(vertices, np.array(sphere.faces))
    spike = (sphere.faces == top).any(axis=1)
    assert len(pairs) > 0
    assert (spike[pairs].sum(axis=1) == 1).all()
    spindle = trimesh.creation.torus(1.0, 1.6)
    assert len(self_intersections(np.array(spindle.vertices), np.array(spindle.faces))) > 0
    with pytest.raises(InvalidInput, match="intersects itself"):
        checked(spindle)


def test_split_vertices_are_merged_and_turned_faces_mended() -> None:
    sphere = trimesh.creation.icosphere(2)
    soup = trimesh.Trimesh(
        np.array(sphere.triangles).reshape(-1, 3),
        np.arange(3 * len(sphere.faces)).reshape(-1, 3),
        process=False,
    )
    mesh, repaired = checked(soup)
    assert len(mesh.vertices) == len(sphere.vertices)
    assert len(repaired) == 1
    assert "merged" in repaired[0]
    faces = np.array(sphere.faces)
    faces[::7] = faces[::7, ::-1]
    mesh, repaired = checked(trimesh.Trimesh(sphere.vertices, faces, process=False))
    assert mesh.volume == pytest.approx(sphere.volume)
    assert len(repaired) == 1
    assert "wound" in repaired[0]


def broken(fault: str) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(2)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    if fault == "without faces":
        faces = faces[:0]
    elif fault == "open":
        faces = faces[1:]
    elif fault == "inside out":
        faces = faces[:, ::-1]
    elif fault == "not finite":
        vertices[5, 1] = np.nan
    elif fault == "separate bodies":
        faces = np.vstack([faces, faces + len(vertices)])
        vertices = np.vstack([vertices, 0.5 * vertices + (3.0, 0.0, 0.0)])
    elif fault == "m large":
        vertices *= 120.0
    elif fault == "branching":
        faces = np.vstack([faces, [faces[0, 0], faces[0, 1], faces[200, 0]]])
    return trimesh.Trimesh(vertices, faces, process=False)


@pytest.mark.parametrize(
    "fault",
    [
        "without faces",
        "open",
        "inside out",
        "not finite",
        "separate bodies",
        "m large",
        "branching",
    ],
)
def test_a_faulty_mesh_is_refused_by_its_fault(fault: str) -> None:
    with pytest.raises(InvalidInput, match=fault):
        checked(broken(fault))


def test_faces_of_other_vertices_are_refused_before_crossings_are_sought() -> None:
    """A vertex written twice moves all that follow by one; most faces then cross each other."""
    sphere = trimesh.creation.icosphere(4)
    order = np.random.default_rng(0).permutation(len(sphere.vertices))
    vertices = np.repeat(sphere.vertices[order], [2] + [1] * (len(order) - 1), axis=0)
    faces = np.argsort(order)[sphere.faces]
    with pytest.raises(InvalidInput, match="in a box of 24 m2; it is at most 10 times"):
        checked(trimesh.Trimesh(vertices, faces, process=False))
    whole = trimesh.Trimesh(sphere.vertices[order], faces, process=False)
    assert checked(whole)[0].volume == pytest.approx(sphere.volume)


def test_a_mesh_in_millimetres_is_asked_for_its_scale() -> None:
    with pytest.raises(InvalidInput, match="scale"):
        checked(broken("m large"))
