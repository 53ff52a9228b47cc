"""Rocks of known shape, scanned with faults: what closing gives and says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh

from vsr_core.scan.closing import Closing
from vsr_core.scan.topology import border
from vsr_core.scan.weighing import Refused, measured
from vsr_core.scan.whole_rock import (
    LARGEST_HOLE,
    WholeRock,
    other_closings,
    unseen,
    whole_rock,
    without_chords,
    without_slits,
)

Array = np.ndarray

RADIUS, FLOOR = 0.5, -0.35


@cache
def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)


@cache
def stone() -> trimesh.Trimesh:
    """A ball on a flat base."""
    points = np.array(ball().vertices)
    points[:, 2] = np.maximum(points[:, 2], FLOOR)
    return trimesh.Trimesh(points, ball().faces, process=False)


def less(mesh: trimesh.Trimesh, gone: Array) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces[~gone], process=False)


def holed(
    mesh: trimesh.Trimesh, toward: tuple[float, float, float], width: float
) -> trimesh.Trimesh:
    """Without the faces within half a width of where a direction leaves the ball."""
    at = RADIUS * np.array(toward) / np.linalg.norm(toward)
    return less(mesh, np.linalg.norm(mesh.triangles_center - at, axis=1) < 0.5 * width)


def made(mesh: trimesh.Trimesh, closing: Closing = "caps") -> WholeRock:
    return whole_rock(lambda: mesh, closing, str)


def see_that_it_is(found: WholeRock, true: trimesh.Trimesh) -> None:
    one, other = measured(found.rock, 1.0), measured(true, 1.0)
    assert one.volume == pytest.approx(other.volume, rel=1e-12)
    np.testing.assert_allclose(one.centre_of_mass + found.offset, other.centre_of_mass, atol=1e-12)
    np.testing.assert_allclose(one.tipping, other.tipping, atol=1e-9)


def test_a_closed_scan_is_taken_as_it_is() -> None:
    found = made(stone())
    assert np.array_equal(found.rock.vertices, stone().vertices)
    assert np.array_equal(found.rock.faces, stone().faces)
    assert (found.repaired, found.holes) == ((), ())
    assert not found.added.any()


def one_face_missing() -> trimesh.Trimesh:
    return less(stone(), np.arange(len(stone().faces)) == 400)


def many_faces_missing() -> trimesh.Trimesh:
    gone = np.random.default_rng(1).random(len(stone().faces)) < 0.002
    return less(stone(), gone)


def inside_out() -> trimesh.Trimesh:
    return trimesh.Trimesh(stone().vertices, stone().faces[:, ::-1], process=False)


def with_a_speck() -> trimesh.Trimesh:
    speck = trimesh.creation.icosphere(subdivisions=1, radius=0.01)
    speck.apply_translation((1.0, 0.0, 0.0))
    return trimesh.util.concatenate([stone(), speck])


def inside_out_and_open_above() -> trimesh.Trimesh:
    """The open edge leaves its normals in the mean down, as those of an open sheet turned over."""
    top = int(np.argmax(stone().triangles_center[:, 2]))
    return less(inside_out(), np.arange(len(stone().faces)) == top)


def a_vertex_on_an_edge() -> trimesh.Trimesh:
    """One of two faces at an edge divided there, the other not: a hole without an area."""
    faces = np.array(stone().faces)
    one, two, three = faces[700]
    points = np.concatenate([stone().vertices, stone().vertices[[one, two]].mean(axis=0)[None]])
    new = len(points) - 1
    halves = np.array([[one, new, three], [new, two, three]])
    return trimesh.Trimesh(
        points, np.concatenate([np.delete(faces, 700, 0), halves]), process=False
    )


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        (one_face_missing, "holes filled between the vertices of their rims: 1"),
        (many_faces_missing, "holes filled"),
        (inside_out, "all faces turned outward"),
        (with_a_speck, "1 loose piece dropped"),
        (inside_out_and_open_above, "all faces turned outward"),
        (a_vertex_on_an_edge, "holes filled"),
    ],
)
@pytest.mark.parametrize("away", [(0.0, 0.0, 0.0), (712345.25, 3894567.5, 251.5)])
def test_faults_of_an_export_leave_the_rock_what_it_is(
    fault: Callable[[], trimesh.Trimesh], told: str, away: tuple[float, float, float]
) -> None:
    given = fault().copy()
    given.apply_translation(away)
    true = stone().copy()
    found = made(given)
    assert told in "; ".join(found.repaired)
    shift = found.offset - away
    found = replace(found, offset=shift)
    if any(away):  # where a survey's coordinates hold nanometres
        assert measured(found.rock, 1.0).volume == pytest.approx(true.volume, rel=1e-7)
        np.testing.assert_allclose(found.rock.center_mass + shift, true.center_mass, atol=1e-7)
    else:
        see_that_it_is(found, true)


@pytest.mark.parametrize("width", [0.13, 0.15])
def test_what_a_hole_may_lack_is_what_a_ball_lacks(width: float) -> None:
    """A cap of small slope has three quarters of the cone that is told; edges make it steeper."""
    given = holed(ball(), (1.0, 0.3, 0.5), width)
    found = made(given)
    lacking = ball().volume - found.rock.volume
    (told,) = unseen(found, measured(found.rock, 1.0))
    assert width < told.hole.width < width + 0.08  # faces are up to 0.04 m wide
    assert 0.0 < lacking < told.volume < 4.0 * lacking


def test_what_the_hole_of_a_corner_may_lack() -> None:
    """A cube of 1 m less a corner with edges e: a tetrahedron of e^3 / 6."""
    e = 0.13
    cut = trimesh.creation.box((1.0, 1.0, 1.0)).slice_plane(
        (0.5 - e, 0.5, 0.5), -np.ones(3) / np.sqrt(3.0)
    )
    found = made(cut)
    assert found.rock.volume == pytest.approx(1.0 - e**3 / 6.0, rel=1e-9)
    (told,) = unseen(found, measured(found.rock, 1.0))
    assert e**3 / 6.0 < told.volume < 2.0 * e**3 / 6.0


@pytest.mark.parametrize("closing", ["caps", "hull"])
def test_a_rock_open_beneath_stands_on_the_plane_of_its_rim(closing: Closing) -> None:
    """The usual scan, of a rock on a table: a flat rim has no other hull than its plane."""
    base = (stone().triangles[:, :, 2] <= FLOOR).all(axis=1)
    given = less(stone(), base)
    if closing == "hull":
        with pytest.raises(Refused, match=r"lies in a plane; .*; close it with caps"):
            made(given, closing)
        return
    found = made(given, closing)
    one, true = measured(found.rock, 1.0), measured(stone(), 1.0)
    assert one.volume == pytest.approx(true.volume, rel=2e-3)
    np.testing.assert_allclose(one.centre_of_mass + found.offset, true.centre_of_mass, atol=5e-4)
    np.testing.assert_allclose(one.tipping, true.tipping, atol=np.radians(0.5))
    (hole,) = found.holes
    assert hole.beneath
    below = found.rock.triangles_center[found.added]
    np.testing.assert_allclose(below[:, 2] + found.offset[2], FLOOR, atol=1e-9)
    assert found.added.sum() > 10


def test_other_closings_bound_a_base_that_a_rough_cut_left() -> None:
    """Cut along rough ground: the true rock stands between those of two closings, or near."""
    x, y, _ = stone().triangles_center.T
    rough = FLOOR + 0.03 + 0.012 * np.sin(23.0 * x) * np.cos(19.0 * y + 1.0)
    given = less(stone(), stone().triangles_center[:, 2] < rough)
    found = made(given)
    solid = measured(found.rock, 1.0)
    (told,) = unseen(found, solid)
    hull, poisson = other_closings(found, "caps", solid, 1.0)
    assert (hull.closing, poisson.closing) == ("hull", "poisson")
    assert hull.measure is not None
    # What the cut took away is known here, and to no one else.
    left = stone().slice_plane((0, 0, FLOOR + 0.03), (0, 0, 1), cap=True)
    lost = stone().volume - left.volume
    for one in (solid, hull.measure):
        assert one.volume == pytest.approx(
            stone().volume - lost, abs=3.0 * told.volume + 0.2 * lost
        )
    assert 0.0 < told.volume < 0.02 * solid.volume


def test_a_wide_hole_is_refused_with_its_place_and_size() -> None:
    far = np.array([712345.0, 3894567.0, 251.0])
    given = holed(stone(), (1.0, 0.0, 0.0), 0.3)
    given.apply_translation(far)
    with pytest.raises(Refused) as refused:
        made(given)
    (place,) = refused.value.places
    np.testing.assert_allclose(place - far, (RADIUS, 0.0, 0.0), atol=0.03)
    assert "a hole 0.3" in refused.value.given
    assert f"{LARGEST_HOLE:.0%}" in refused.value.rule
    assert refused.value.seen.parts["rock"].all()


SHEET = trimesh.Trimesh([[0, 0, 0], [1, 0, 0.5], [0, 1, 0]], [[0, 1, 2]], process=False)
FOLDED = trimesh.Trimesh([*SHEET.vertices, [1, 1, 0]], [[0, 1, 2], [1, 3, 2]], process=False)


@pytest.mark.parametrize(
    ("mesh", "said"),
    [(SHEET, r"flat mesh \(volume 0 m3\)"), (FOLDED, "move pedestal.cut where there is one")],
    ids=["one triangle", "two"],
)
@pytest.mark.parametrize("closing", ["caps", "hull"])
@pytest.mark.filterwarnings("error")
def test_few_triangles_are_refused_as_what_they_are(
    mesh: trimesh.Trimesh, said: str, closing: Closing
) -> None:
    """One has no volume; two of a rock alone have no face away from the rim, nor a cut to move."""
    with pytest.raises(Refused, match=said):
        made(mesh, closing)


def test_a_hole_in_a_base_that_was_seen_is_filled_without_moving_it() -> None:
    base = stone().triangles_center[:, :2]
    given = less(stone(), (np.hypot(*base.T) < 0.05) & (stone().triangles_center[:, 2] < 0.0))
    see_that_it_is(made(given), stone())


def test_a_slit_closes_where_its_sides_lie() -> None:
    """A vertex doubled, the faces about it shared out between the two: a hole without an area."""
    faces, vertex = np.array(stone().faces), int(stone().faces[700, 0])
    about = np.flatnonzero((faces == vertex).any(axis=1))
    middle = stone().triangles_center[about] - stone().vertices[vertex]
    half = about[middle @ middle[0] > 0.0]
    points = np.concatenate([stone().vertices, stone().vertices[[vertex]]])
    faces[half] = np.where(faces[half] == vertex, len(points) - 1, faces[half])
    assert len(border(faces)) == 4
    assert len(border(without_slits(points, faces))) == 0


@pytest.mark.slow
def test_edges_from_rim_to_rim_are_divided() -> None:
    """Every second face along a cut left standing as a tooth, whose third edge spans the rim."""
    rng = np.random.default_rng(2)
    low = stone().triangles_center[:, 2] < FLOOR + 0.05 * rng.random(len(stone().faces))
    cut = less(stone(), low)
    points, faces = without_chords(np.array(cut.vertices), np.array(cut.faces))
    split = trimesh.Trimesh(points, faces, process=False)
    assert len(faces) > len(cut.faces)
    assert split.area == pytest.approx(cut.area, rel=1e-12)
    assert made(cut).rock.is_watertight
