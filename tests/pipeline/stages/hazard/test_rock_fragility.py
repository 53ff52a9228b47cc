"""A rock's fragility, as its products hold it, on cases worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

from pipeline.config.problems import InputError
from pipeline.stages.hazard.rock_fragility import of_members
from tests.support.standing_rocks import ensemble, numbered
from vsr_core import GRAVITY


def test_cells_without_a_verdict_do_not_count() -> None:
    fell = np.array([[[1, -1], [0, 1]]], dtype=np.int8)[:, :, None, :]  # one member, two yaws
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), fell),
            "member_boundary": (("member", "yaw", "pgv_pga"), [[[0.4], [0.7]]]),
            "theta": (("yaw", "pgv_pga"), np.full((2, 1), 1.0)),
            "beta": (("yaw", "pgv_pga"), np.full((2, 1), 1.0)),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.1], "pga": [0.5, 1.0]},
        {"searched_from_g": 0.5, "searched_to_g": 1.0},
    )
    (member,) = of_members(numbered(data)).others
    np.testing.assert_allclose(member(GRAVITY * np.array([0.5, 1.0])), [[0.5, 1.0]])


def test_a_cell_without_a_verdict_above_a_boundary_is_not_known_to_stand() -> None:
    """Two of three draws have none at 1 g, one stands there again; all topple from 0.4 g on.

    A fourth has no verdict at all and is none of the mean.
    """
    fell = np.array([[0, 1, -1], [0, 1, -1], [0, 1, 0], [-1, -1, -1]])[:, None, None, :]
    edges = np.array([0.4, 0.4, 0.4, np.nan])[:, None, None]
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), fell),
            "member_boundary": (("member", "yaw", "pgv_pga"), edges),
            "theta": (("yaw", "pgv_pga"), [[0.4]]),
            "beta": (("yaw", "pgv_pga"), [[0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1], "pga": [0.25, 0.5, 1.0]},
        {"searched_from_g": 0.25, "searched_to_g": 1.0},
    )
    rock, levels = of_members(numbered(data)), GRAVITY * np.array([0.3, 0.6, 0.9])
    each = [one(levels)[0] for one in rock.others[:3]]
    np.testing.assert_array_equal(each, [[0, 1, 1], [0, 1, 1], [0, 1, 0]])
    np.testing.assert_allclose(rock.mean(levels)[0], np.mean(each, axis=0))


def test_beyond_what_was_tried_half_of_what_stands_falls_where_half_would() -> None:
    """Tried are 0.5 and 1 g; the fit has 1/2 at 1 g and Phi(1) at e g, Phi(-2) at exp(-2) g."""
    fell = np.array([[1], [0]], np.int8)  # from one of two directions, at both levels
    falls = np.broadcast_to(fell[None, :, None, :], (1, 2, 1, 2))
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), falls),
            "member_boundary": (("member", "yaw", "pgv_pga"), [[[0.4], [np.inf]]]),
            "theta": (("yaw", "pgv_pga"), np.ones((2, 1))),
            "beta": (("yaw", "pgv_pga"), np.ones((2, 1))),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.1], "pga": [0.5, 1.0]},
        {"searched_from_g": 0.5, "searched_to_g": 1.0},
    )
    rock = of_members(numbered(data))
    levels = GRAVITY * np.array([np.exp(-2.0), 0.5, 0.7, 1.0, np.e])
    expected = [
        0.5 * norm.cdf(-2.0) / norm.cdf(np.log(0.5)),
        0.5,
        0.5,
        0.5,
        1.0 - 0.5 * norm.cdf(-1.0) / 0.5,
    ]
    (member,) = rock.others
    np.testing.assert_allclose(member(levels)[0], expected)
    np.testing.assert_allclose(rock.mean(levels)[0], expected)


def test_the_mean_of_draws_counts_those_that_slide_and_never_topple() -> None:
    """A lognormal of all would have 6 % fall at half the PGA that the others need."""
    boundary = np.append(np.geomspace(0.55, 0.7, 27), np.full(5, np.inf))[:, None, None]
    pga = np.array([0.25, 0.5, 1.0, 2.0, 4.0])
    data = xr.Dataset(
        {
            "overturned": (
                ("member", "yaw", "pgv_pga", "pga"), (pga > boundary[..., None]).astype(np.int8)
            ),
            "member_boundary": (("member", "yaw", "pgv_pga"), boundary),
            "theta": (("yaw", "pgv_pga"), [[0.9]]),
            "beta": (("yaw", "pgv_pga"), [[0.8]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.3], "pga": pga},
        {"searched_from_g": 0.25, "searched_to_g": 4.0},
    )  # fmt: skip
    rock, levels = of_members(numbered(data)), GRAVITY * np.array([0.3, 0.5, 0.8, 4.0, 6.0])
    np.testing.assert_allclose(rock.mean(levels[:4])[0], [0.0, 0.0, 27 / 32, 27 / 32])
    each = np.mean([one(levels) for one in rock.others], axis=0)
    np.testing.assert_allclose(rock.mean(levels), each)


def test_a_row_without_a_verdict_goes_by_the_fit_between_its_neighbours() -> None:
    pga = np.array([0.25, 0.5, 1.0])
    boundary = np.array([[[0.4, np.nan]]])
    cells = np.where(np.isnan(boundary)[..., None], -1, pga > boundary[..., None]).astype(np.int8)
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), cells),
            "member_boundary": (("member", "yaw", "pgv_pga"), boundary),
            "theta": (("yaw", "pgv_pga"), [[0.4, 0.4]]),
            "beta": (("yaw", "pgv_pga"), [[0.1, 0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1, 0.2], "pga": pga},
        {"searched_from_g": 0.25, "searched_to_g": 1.0},
    )
    with pytest.raises(InputError, match="no direction with a fragility"):
        of_members(numbered(data.assign(theta=np.nan * data["theta"])))
    rock, levels = of_members(numbered(data)), GRAVITY * np.array([0.3, 0.45, 2.0])
    for rows in (rock.mean, *rock.others, *rock.by_yaw.values()):
        np.testing.assert_allclose(rows(levels)[0], [0.0, 1.0, 1.0])
        np.testing.assert_allclose(rows(levels)[1], norm.cdf(10.0 * np.log(levels / GRAVITY / 0.4)))


def test_draws_of_one_direction_go_on_by_its_own_fit() -> None:
    """None fell up to 1 g in either direction, of which one has a median of 2 g, and one of 8 g."""
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), np.zeros((1, 2, 1, 2), np.int8)),
            "member_boundary": (("member", "yaw", "pgv_pga"), np.full((1, 2, 1), np.inf)),
            "theta": (("yaw", "pgv_pga"), [[2.0], [8.0]]),
            "beta": (("yaw", "pgv_pga"), np.full((2, 1), 0.5)),
        },
        {"yaw": [0.0, 90.0], "pgv_pga": [0.1], "pga": [0.5, 1.0]},
        {"searched_from_g": 0.5, "searched_to_g": 1.0},
    )
    rock, levels = of_members(numbered(data)), np.array([1.0, 2.0, 4.0])
    for yaw, median in ((0.0, 2.0), (90.0, 8.0), (-270.0, 8.0)):
        (draw,) = rock.towards(yaw).others
        stands = norm.sf(2.0 * np.log(levels / median))
        np.testing.assert_allclose(draw(GRAVITY * levels)[0], 1.0 - stands / stands[0])


def test_a_record_and_its_mirror_image_are_one_row_whatever_their_names() -> None:
    """Each stands for half of the shaking of their PGV/PGA, in either order."""
    levels = GRAVITY * np.array([0.2, 0.5, 1.0])
    found = []
    for medians in ([0.4, 0.8, 1.0], [0.8, 0.4, 1.0]):
        data = xr.Dataset(
            {
                "overturned": (
                    ("member", "yaw", "pgv_pga", "pga"),
                    np.zeros((1, 1, 3, 2), np.int8),
                ),
                "member_boundary": (("member", "yaw", "pgv_pga"), [[medians]]),
                "theta": (("yaw", "pgv_pga"), [medians]),
                "beta": (("yaw", "pgv_pga"), np.full((1, 3), 0.5)),
            },
            {"yaw": [0.0], "pgv_pga": [0.1, 0.1 * (1 + 1e-12), 0.3], "pga": [0.1, 2.0]},
            {"searched_from_g": 0.1, "searched_to_g": 2.0},
        )
        rock = of_members(numbered(data))
        np.testing.assert_allclose(rock.ratios, [0.1, 0.3])
        found.append([rows(levels) for rows in (rock.mean, rock.by_yaw[0.0], *rock.others)])
    chance = [levels > GRAVITY * median for median in (0.4, 0.8)]
    np.testing.assert_allclose(found[0][0][0], np.mean(chance, axis=0))
    np.testing.assert_allclose(found[0], found[1])


def test_a_direction_of_which_nothing_is_known_is_all_of_them() -> None:
    rock = ensemble([0.5])
    assert rock.towards(45.0) is rock


def test_a_member_falls_from_its_boundary_on_also_between_the_cells() -> None:
    """It topples from 0.3 g on, stands again about the cell at 0.8 g, and topples beyond."""
    pga = np.array([0.2, 0.4, 0.8, 1.6])
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), np.array([[[[0, 1, 0, 1]]]])),
            "member_boundary": (("member", "yaw", "pgv_pga"), [[[0.3]]]),
            "theta": (("yaw", "pgv_pga"), [[0.3]]),
            "beta": (("yaw", "pgv_pga"), [[0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1], "pga": pga},
        {"searched_from_g": 0.1, "searched_to_g": 4.0},
    )
    (member,) = of_members(numbered(data)).others
    levels = GRAVITY * np.array([0.25, 0.299, 0.301, 0.45, 0.7, 0.9, 1.3, 3.0])
    np.testing.assert_array_equal(member(levels)[0], [0, 0, 1, 1, 0, 0, 1, 1])


def test_draws_that_topple_at_the_least_pga_are_no_fragility() -> None:
    """Where below it they do is assumed, and more draws that do would make it surer."""
    edges = np.full((4, 1, 1), 0.3)
    data = xr.Dataset(
        {
            "overturned": (("member", "yaw", "pgv_pga", "pga"), np.ones((4, 1, 1, 2))),
            "member_boundary": (("member", "yaw", "pgv_pga"), edges),
            "theta": (("yaw", "pgv_pga"), [[0.3]]),
            "beta": (("yaw", "pgv_pga"), [[0.1]]),
        },
        {"yaw": [0.0], "pgv_pga": [0.1], "pga": [0.34, 0.5]},
        {"searched_from_g": 0.34, "searched_to_g": 4.0},
    )
    data = numbered(data)
    data["member_boundary_lower"] = data["member_boundary"].where(np.arange(4)[:, None, None] > 0)
    with pytest.raises(InputError, match=r"fragility\.lowest: got 25% of the boundaries"):
        of_members(data)
