"""Rocks cut into convex pieces, what is chosen for contact, and ground beside a waist."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from support import grounds

from vsr_core.errors import InvalidInput
from vsr_core.rock.reduction import SEAT_SHARE, on_its_seat
from vsr_core.rock.solid import from_mesh
from vsr_core.scan import pieces, seat
from vsr_core.scan.contact_shape import Wanted, contact_shape
from vsr_core.scan.pieces import TooManyPieces, convex_pieces
from vsr_core.terrain.surface import Terrain

Array = NDArray[np.float64]


@cache
def turned(*profile: tuple[float, float], sides: int = 24) -> trimesh.Trimesh:
    """Solid that a line through radii and heights [m] encloses as it turns about z."""
    around = 2.0 * np.pi * np.arange(sides) / sides
    rings = [
        np.column_stack([r * np.cos(around), r * np.sin(around), 0.0 * around + z])
        for r, z in profile
    ]
    bottom, top = (0.0, 0.0, profile[0][1]), (0.0, 0.0, profile[-1][1])
    faces = []
    for k, j in itertools.product(range(len(profile) - 1), range(sides)):
        a, b = k * sides + j, k * sides + (j + 1) % sides
        faces += [(a, b, b + sides), (a, b + sides, a + sides)]
    last = (len(profile) - 1) * sides
    low = len(profile) * sides
    for j in range(sides):
        faces += [(low, (j + 1) % sides, j), (low + 1, last + j, last + (j + 1) % sides)]
    return trimesh.Trimesh(np.vstack([*rings, bottom, top]), faces)


def waisted(neck: float = 0.15) -> trimesh.Trimesh:
    """Two drums on top of each other with a neck between them."""
    return turned((0.4, 0.0), (0.4, 0.5), (neck, 0.5), (neck, 0.8), (0.4, 0.8), (0.4, 1.3))


@pytest.mark.slow
def test_a_solid_of_three_drums_is_three_pieces() -> None:
    rock = waisted()
    assert rock.is_volume
    found = convex_pieces(rock, 0.02)
    assert 3 <= len(found.corners) <= 4
    volumes = [ConvexHull(piece).volume for piece in found.corners]
    assert sum(volumes) == pytest.approx(rock.volume, rel=0.01)
    assert rock.convex_hull.volume > 1.2 * rock.volume
    assert found.error <= 0.02


@pytest.mark.slow
def test_a_plane_foot_stays_plane_however_the_rock_lies() -> None:
    """To the last digit: it would rock on corners that stand off their plane by 50 um."""
    drums = (0.3, 0.0), (0.32, 0.2), (0.2, 0.5), (0.2, 0.6), (0.36, 0.95), (0.36, 1.35)
    rock = turned(*drums, sides=12).copy()
    foot = np.flatnonzero(rock.vertices[:, 2] == 0.0)
    rock.apply_scale([1.1, 1.0, 1.0])
    rock.apply_transform(trimesh.transformations.rotation_matrix(np.radians(6.0), [0.0, 1.0, 0.0]))
    corners = np.concatenate(convex_pieces(rock, 0.02).corners)
    rim = {tuple(point) for point in np.array(rock.vertices)[foot] if np.hypot(*point[:2]) > 0.1}
    assert len(rim) == 12
    assert rim <= {tuple(point) for point in corners.tolist()}


def test_the_error_of_pieces_bounds_what_is_between_them_and_the_rock() -> None:
    rng = np.random.default_rng(5)
    rock = turned((0.4, 0.0), (0.25, 0.2), (0.2, 0.3), (0.25, 0.4), (0.4, 0.6), sides=16)
    found = convex_pieces(rock, 0.08)
    hulls = [trimesh.convex.convex_hull(piece) for piece in found.corners]
    points = rng.uniform(*rock.bounds, (4_000, 3))
    planes = [ConvexHull(piece).equations for piece in found.corners]
    beyond = np.min([(points @ p[:, :3].T + p[:, 3]).max(axis=1) for p in planes], axis=0)
    inside = rock.contains(points)
    one_only = points[inside != (beyond <= 0.0)]
    assert len(one_only)
    off = [trimesh.proximity.closest_point(body, one_only)[1] for body in (rock, *hulls)]
    # what is in one of both only is no farther from the other than that is told
    assert np.minimum(off[0], np.min(off[1:], axis=0)).max() <= found.error


def test_a_rock_that_is_no_few_pieces_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "MOST_PIECES", 2)
    with pytest.raises(TooManyPieces, match="2 convex pieces"):
        convex_pieces(waisted(), 0.02)


@pytest.mark.slow
def test_a_waist_that_is_thinner_than_the_error_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"waist .* thin"):
        convex_pieces(waisted(0.02), 0.06)


def nose(height: float) -> Terrain:
    """Level ground, and a nose of a wall far away that goes to x = -0.25 at a height."""
    line = [(-3.0, 2.5), (-1.5, 2.5), (-1.5, height + 0.05), (-0.25, height)]
    line += [(-1.5, height - 0.05), (-1.5, 0.0), (3.0, 0.0)]
    return grounds.extruded(np.array(line), 2.0)


@pytest.mark.parametrize(
    ("ground", "wanted", "told"),
    [
        (grounds.level(), "auto", "no ground comes into"),
        (nose(1.9), "auto", "no ground comes into"),
        (nose(0.65), "auto", r"pieces .* as ground comes \d+ mm into"),
        (nose(0.65), "hull", "hull, as asked for"),
    ],
)
def test_pieces_are_taken_where_ground_comes_into_the_hull(
    ground: Terrain, wanted: Wanted, told: str
) -> None:
    none = np.zeros(len(ground.faces), dtype=bool)
    found = contact_shape(waisted(), ground, none, wanted, 0.05)
    assert re.search(told, found.told)
    assert bool(found.pieces) == ("pieces" in told)


def test_a_convex_rock_is_its_hull() -> None:
    drum, ground = turned((0.4, 0.0), (0.4, 1.3)), nose(0.65)
    none = np.zeros(len(ground.faces), dtype=bool)
    found = contact_shape(drum, ground, none, "auto", 0.05)
    assert not found.pieces
    assert "within" in found.told


@pytest.mark.slow
def test_ground_in_a_waist_stays_where_pieces_touch() -> None:
    ground, rock = nose(0.65), waisted()
    ground = Terrain(ground.vertices - [0.0, 0.0, 0.001], ground.faces)
    hull = np.array(rock.convex_hull.vertices)
    cut = convex_pieces(rock, 0.02).corners
    moved = {
        name: np.abs(
            seat.seat(ground, (), hull, hull, "whole", own).ground.vertices - ground.vertices
        ).max()
        for name, own in {"hull": (), "pieces": cut}.items()
    }
    assert moved["pieces"] < 1e-3
    assert moved["hull"] > 0.1


@pytest.mark.slow
def test_lighter_pieces_are_near_the_whole_ones() -> None:
    solid = turned((0.4, 0.0), (0.5, 0.5), (0.2, 0.7), (0.5, 0.9), (0.4, 1.3), sides=50)
    rock = from_mesh(solid, 2000.0, as_scanned=True).rock
    whole = tuple(piece - solid.center_mass for piece in convex_pieces(solid, 0.05).corners)
    light = on_its_seat(replace(rock, pieces=whole))
    assert sum(map(len, light.pieces)) < sum(map(len, whole))
    for one, part in zip(whole, light.pieces, strict=True):
        planes = ConvexHull(part).equations
        assert (one @ planes[:, :3].T + planes[:, 3]).max() <= SEAT_SHARE * rock.radius
