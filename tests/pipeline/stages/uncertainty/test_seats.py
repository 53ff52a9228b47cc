"""Seats of draws: even shares, the site's own without errors, and errors of the seam."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.grounds import incline

from pipeline.config.layers import load_site
from pipeline.config.priors_schema import SeatWeights, UncertaintyConfig
from pipeline.stages.mesh import seating
from pipeline.stages.mesh.seating import Bed
from pipeline.stages.uncertainty import seats
from pipeline.stages.uncertainty.uncertainty_page import by_seat
from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Rock
from vsr_core.rock.solid import block
from vsr_core.validation.priors import Member, Priors, best_guess

SLOPE = np.radians(5.0)
SIZE = (0.6, 0.5, 1.0)
SETTINGS = load_site("double_rock_terrain").config.scene.with_contact(friction=(0.7,))
CONFIG = UncertaintyConfig()


@cache
def rock() -> Rock:
    """A block that stands askew, square on its slope, with its centre of mass above the origin."""
    upright = block(SIZE, 2000.0)
    c, s = np.cos(SLOPE), np.sin(SLOPE)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return replace(upright, vertices=upright.vertices @ turn.T, axes=turn)


@cache
def bed() -> Bed:
    """Its slope, with the outline of its foot for a seam."""
    own = rock()
    foot = own.vertices[[0, 4, 6, 2]] + [0.0, 0.0, own.height]
    ground = incline(SLOPE, half=3.0, cells=60)
    up = np.array([0.0, 0.0, own.height - 0.5 / np.cos(SLOPE)])
    ground = replace(ground, vertices=ground.vertices + up)
    share = np.linspace(0.0, 1.0, 9)[:-1, None]
    sides = [a + share * (b - a) for a, b in zip(foot, np.roll(foot, -1, axis=0), strict=True)]
    return Bed(ground, (np.concatenate(sides),))


def member(
    error: float = 0.0, centre: tuple[float, ...] = (0.0, 0.0, 0.0), seed: int = 1
) -> Member:
    return replace(best_guess(Priors()), error=error, centre=np.array(centre), seed=seed)


def drawn(one: Member, bearing: seats.Bearing = "rim") -> seats.DrawnSeat:
    own = seats.weighed(rock(), one.centre)
    return seats.drawn(bed(), own, one, bearing, SETTINGS, CONFIG)


def test_every_seat_has_its_share_of_the_draws() -> None:
    """Shares that are multiples of a sixteenth are exact in 16 draws of a Sobol sequence."""
    weights = SeatWeights(rim=4, points=2, whole=2)
    found = Counter(seats.chosen(weights, 16))
    assert found == {"rim": 8, 3: 1, 4: 1, 5: 1, 6: 1, "whole": 4}
    assert seats.chosen(SeatWeights(rim=0, points=0, whole=1), 8) == ["whole"] * 8


def test_without_error_the_foot_of_a_block_bears_it_where_it_was() -> None:
    """Its outline is the foot's, less the distance that points keep from a seam."""
    found = drawn(member())
    start, own = found.ground.starts[0], rock()
    assert np.linalg.norm(start.position - [0.0, 0.0, own.height]) < 1e-3
    corners = own.vertices[[0, 4, 6, 2]]
    apart = np.linalg.norm(found.outline[:, None, :2] - corners[None, :, :2], axis=2)
    assert len(found.outline) == 4
    assert apart.min(axis=0).max() < 0.01


def test_an_error_moves_the_outline_by_as_much() -> None:
    """Corners move in plan by about the error that is told, 2 mm times the one of the member."""
    as_scanned = drawn(member()).outline
    moves = []
    for seed in range(6):
        outline = drawn(member(3.0, seed=seed)).outline
        near = np.linalg.norm(outline[:, None, :2] - as_scanned[None, :, :2], axis=2).min(axis=0)
        moves.extend(near.tolist())
    assert 0.003 < np.median(moves) < 0.015


def test_the_ground_moves_against_the_centre_of_mass() -> None:
    """What bears the rock lies where it was, seen from the ground, and the rock is not moved."""
    centre = (0.02, -0.01, 0.015)
    plain, moved = drawn(member()), drawn(member(centre=centre))
    shift = plain.ground.terrain.vertices[:100] - moved.ground.terrain.vertices[:100]
    np.testing.assert_allclose(shift, np.tile([0.02, -0.01, 0.0], (100, 1)), atol=1e-9)
    np.testing.assert_allclose(plain.outline - moved.outline, np.tile(centre, (4, 1)), atol=1e-6)


def test_a_rock_that_does_not_rest_on_few_points_bears_on_its_rim(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    laid = seating.laid

    def few_give_way(*given: Any) -> Any:
        if isinstance(given[-1], int):
            raise InvalidInput("", "", "")
        return laid(*given)

    monkeypatch.setattr(seating, "laid", few_give_way)
    assert drawn(member(), 3).bearing == "rim"


def test_a_rock_that_rests_on_no_seat_is_refused() -> None:
    """Its centre of mass lies beyond its foot."""
    with pytest.raises(InvalidInput, match="rests on no seat"):
        drawn(member(centre=(0.4, 0.0, 0.0)))


def test_a_seam_that_bears_as_a_whole_has_no_error() -> None:
    one, other = (drawn(member(error, seed=3), "whole") for error in (0.0, 5.0))
    assert one.bearing == other.bearing == "whole"
    np.testing.assert_array_equal(one.outline, other.outline)
    np.testing.assert_array_equal(one.ground.terrain.vertices, other.ground.terrain.vertices)


@pytest.mark.parametrize(("lower", "ratio"), [(0.59, 1.2), (np.nan, np.nan)])
def test_a_row_on_which_either_has_no_boundary_is_no_share_of_the_sites(
    lower: float, ratio: float
) -> None:
    """The site never topples on two rows; on the other the draw may topple at the lowest PGA."""
    ends = {
        "member_boundary_lower": [[[lower, 0.49, 0.89]]],
        "member_boundary": [[[0.6, 0.5, 0.9]]],
        "member_boundary_upper": [[[0.61, 0.51, 0.91]]],
    }
    edges = {name: (("member", "yaw", "pgv_pga"), values) for name, values in ends.items()}
    found = xr.Dataset({"drawn_seat": ("member", ["rim"]), **edges}, {"pgv_pga": [0.2, 0.4, 0.8]})
    own = xr.Dataset({"first_overturning_pga": (("yaw", "pgv_pga"), [[0.5, np.inf, np.inf]])})
    rim = by_seat(found, own)[0]
    assert (rim["members"], rim["ratio"]) == (1, pytest.approx(ratio, nan_ok=True))
