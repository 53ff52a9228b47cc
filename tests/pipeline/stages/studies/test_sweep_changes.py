"""How far boundaries move along a dimension of a sweep, on rows whose answers are plain."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from pipeline.config.sweep import Dimension
from pipeline.stages.studies.sweeps.changes import Change, about, along, changes, collapsed, spread
from pipeline.stages.studies.sweeps.study import _by_record, _named
from vsr_core import GRAVITY
from vsr_core.fragility.boundary import middle

PGA = np.linspace(0.1, 1.0, 10)
RATIO = [0.1, 0.2, 0.4, 0.8]
SIZE = Dimension("size", {"rock.radius": (1, 4)}, ("1", "4"), 0, gridded=False)

RUNS = ("outcome", "overturned")
AT_ONCE, NEVER = (np.nan, 0.1), (1.0, np.inf)


def study(*places: list[tuple[float, float]], error: float = np.nan) -> xr.Dataset:
    """Rows by the last PGA that leaves the rock standing and the first that topples it [g]."""
    last, first = np.moveaxis(np.array(places), -1, 0)
    overturned = (first[..., None] <= PGA + 1e-9).astype(int)
    dims = ("size", "pgv_pga")
    data = xr.Dataset(
        {
            "first_overturning_pga": (dims, middle(PGA, last, first)),
            "first_overturning_pga_lower": (dims, last),
            "first_overturning_pga_upper": (dims, first),
            "overturned": ((*dims, "pga"), overturned),
            "outcome": ((*dims, "pga"), overturned),
            "boundary_error": ("size", np.full(len(places), error)),
            "time_step": ("size", np.full(len(places), 0.001)),
        },
        {"pgv_pga": RATIO, "pga": PGA},
    )
    sweep: Any = SimpleNamespace(dimensions=(SIZE,))
    return along(data, sweep, SIZE)


def compared(*places: list[tuple[float, float]], error: float = np.nan) -> list[Change]:
    return changes(study(*places, error=error), SIZE)


def test_rows_are_apart_where_their_intervals_are() -> None:
    same, above, beside = (0.3, 0.4), (0.5, 0.6), (0.4, 0.5)
    reference, other = compared([same] * 4, [same, above, beside, NEVER])
    assert reference.is_reference
    assert (reference.mean, reference.apart, reference.rows) == (0.0, 0, 4)
    assert (other.apart, other.rows, other.lost) == (2, 4, 1)
    ratios = np.array(
        [1.0, (0.3 / 0.12) ** 0.5, (0.2 / 0.12) ** 0.5]
    )  # no row that never topples has one
    assert other.mean == pytest.approx(ratios.prod() ** (1.0 / 3.0) - 1.0)
    assert reference.toppled == pytest.approx(0.7)
    assert other.toppled == pytest.approx((7 + 5 + 6) / 40)
    assert reference.interval == pytest.approx(0.05 / 0.12**0.5)
    assert np.isnan(reference.error)


def test_a_row_that_only_topples_elsewhere_has_no_change() -> None:
    """A boundary is no share of one that was never reached."""
    same = (0.3, 0.4)
    other = compared([same, same, same, NEVER], [same] * 4)[1]
    assert (other.mean, other.low, other.high) == (0.0, 0.0, 0.0)
    assert (other.apart, other.rows, other.lost, other.gained) == (1, 4, 0, 1)
    assert np.isnan(compared([NEVER] * 4, [same] * 4)[1].mean)


def test_an_error_of_the_time_step_widens_the_intervals() -> None:
    """0.5 g less 15 % lies below 0.4 g and 15 %."""
    places = [(0.3, 0.4)] * 4, [(0.5, 0.6)] * 3 + [NEVER]
    assert compared(*places)[1].apart == 4
    assert compared(*places, error=0.15)[1].apart == 1


def test_a_row_that_topples_at_once_lies_below_the_grid() -> None:
    other = compared([(0.3, 0.4)] * 4, [AT_ONCE] * 4)[1]
    assert (other.apart, other.rows, other.lost, other.toppled) == (4, 4, 0, 1.0)
    assert np.isnan(other.mean)
    none = "No PGV/PGA level has a boundary at both size 1 and another."
    assert none in about(SIZE, [other], None, [])


def test_sentences_tell_a_change_from_its_error() -> None:
    same = [(0.3, 0.4)] * 4
    said = about(SIZE, compared(same, same), None, [])
    assert "does not move" in said
    assert "At no PGV/PGA level is the change beyond the intervals (not all" in said
    said = about(SIZE, compared(same, same, error=0.01), None, [])
    assert "At no PGV/PGA level is the change beyond the numerical errors and the intervals" in said
    said = about(SIZE, compared(same, [(0.5, 0.6)] * 2 + same[:2]), None, [])
    assert "moves by +26 % at 4" in said  # the fourth root of 0.30 / 0.12, less 1
    assert "at half or more of the PGV/PGA levels at 4" in said
    said = about(SIZE, compared(same, [NEVER] * 4), None, [])
    assert "At 4 nothing topples up to the highest PGA tried there." in said


def test_what_topples_beyond_the_grid_topples() -> None:
    said = about(SIZE, compared([NEVER] * 4, [(1.4, 1.6)] * 4), None, [])
    assert "No PGV/PGA level has a boundary at both" in said
    assert "At 1 nothing topples up to the highest PGA tried there." in said


def not_run(data: xr.Dataset, place: int, levels: list[int]) -> xr.Dataset:
    """The study without runs of a place at some PGV/PGA."""
    here = (data["size"] == place) & data["pgv_pga"].isin([RATIO[level] for level in levels])
    return data.where(~here).assign({name: data[name].where(~here, -1) for name in RUNS})


def test_levels_of_one_member_alone_are_no_change() -> None:
    """One boundary, bent between levels: straight lines between those of the reference miss it."""
    curve = [(0.8, 0.9), (0.3, 0.4), (0.2, 0.3), (0.1, 0.2)]
    both = study(curve, curve).assign_coords(size=[0, 1])
    some = changes(not_run(not_run(both, 0, [1]), 1, [0, 3]), SIZE)
    assert (some[1].mean, some[1].low, some[1].high) == (0.0, 0.0, 0.0)
    assert (some[1].apart, some[1].rows) == (0, 1)
    none = changes(not_run(not_run(both, 0, [1, 2]), 1, [0, 3]), SIZE)
    assert np.isnan([none[1].mean, none[1].low, none[1].high]).all()
    assert (none[1].apart, none[1].rows, none[1].without) == (0, 0, 0)
    said = about(SIZE, none, None, [])
    assert "At 4 the change is not known: no PGV/PGA level has decided runs both there" in said
    assert "beyond" not in said


def test_runs_by_their_number_are_no_rows_of_records() -> None:
    """As displacements are kept: a run has its record and PGV/PGA beside it."""
    runs = xr.Dataset({"record": ("run", ["a", "b"]), "pgv_pga": ("run", [0.1, 0.2])})
    swept: Any = None
    for parts in ([runs, runs], [runs.drop_vars("record"), runs]):
        for found, part in zip(_by_record(swept, parts), parts, strict=True):
            xr.testing.assert_identical(found, part)


def test_levels_that_were_not_seen_to_topple_are_named_as_such() -> None:
    """One ended below the reference's boundary: whether it topples there is not known."""
    same, cut = [(0.3, 0.4)] * 4, (0.2, np.inf)
    three = Dimension("size", {"rock.radius": (1, 4, 9)}, ("1", "4", "9"), 0, gridded=False)
    said = about(three, changes(study(same, [*same[:3], cut], [NEVER] * 4), three), None, [])
    words = "that do not topple up to the highest PGA tried there: 1 of 4 at 4."
    assert f"This excludes PGV/PGA levels {words}" in said
    assert "no longer" not in said
    assert "At 9 nothing topples up to the highest PGA tried there." in said


def test_levels_that_a_mean_leaves_out_are_told_with_the_reason() -> None:
    """Neither topples, only the other does, and the lowest PGA topples one, or both."""
    same, low = (0.3, 0.4), AT_ONCE
    said = about(SIZE, compared([NEVER, NEVER, same, low], [NEVER, same, same, low]), None, [])
    words = "that do not topple at the reference up to the highest PGA tried: 1 of 4 at 4."
    assert f"PGV/PGA levels {words}" in said
    assert "PGV/PGA levels that topple at the lowest PGA tried: 1 of 4 at 4." in said
    assert "tried there" not in said
    found = compared([same, same, low, NEVER], [low, NEVER, same, low])[1]
    assert (found.lost, found.gained, found.lowest, found.without) == (1, 1, 2, 4)


def test_what_holds_at_one_place_of_another_dimension_says_so() -> None:
    same = [(0.3, 0.4)] * 4
    said = about(SIZE, compared(same, [NEVER] * 4), None, ["turn 0 deg", "grip 0.3"])
    assert said.startswith("At turn 0 deg and grip 0.3: ")


def test_places_where_the_boundary_moves_alike_are_all_named() -> None:
    same, more = [(0.3, 0.4)] * 4, [(0.5, 0.6)] * 4
    three = Dimension("size", {"rock.radius": (1, 4, 9)}, ("1", "4", "9"), 0, gridded=False)
    said = about(three, changes(study(same, more, more), three), None, [])
    assert "moves by +58 % at 4 and 9." in said  # the root of 0.30 / 0.12, less 1


def test_similar_rocks_have_one_curve_in_their_own_units() -> None:
    """Four times the radius: the same boundary at twice the PGV/PGA."""
    level = 0.3 / np.array(RATIO)
    rock = study([(0.3, 0.4)] * 4, [(0.3, 0.4)] * 4)
    curves = np.array([level, 2.0 * level])
    alike = rock.assign(
        first_overturning_pga=(("size", "pgv_pga"), curves),
        rock_radius=("size", [GRAVITY, 4.0 * GRAVITY]),
        static_pga=0.5,
    )
    own = collapsed(alike)
    assert own is not None
    assert own["time"].values.tolist() == [1.0, 2.0]
    assert spread(own, SIZE) == pytest.approx((0.0, 0.0), abs=1e-12)
    other = collapsed(
        alike.assign(first_overturning_pga=(("size", "pgv_pga"), [level, 2.2 * level]))
    )
    assert other is not None
    assert spread(other, SIZE) == pytest.approx((0.1, 0.1))
    between = collapsed(alike.assign(rock_radius=("size", [GRAVITY, 3.0 * GRAVITY])))
    assert between is not None
    assert np.isnan(spread(between, SIZE)).all()  # no row of one is at the time of another's
    assert collapsed(alike.assign(rock_radius=("size", [1.0, 1.0]))) is None
    assert collapsed(alike.drop_vars("static_pga")) is None  # shaken along other axes than x


@pytest.mark.parametrize("name", ["mu", "friction"])
def test_runs_of_a_displacement_keep_their_own_friction(name: str) -> None:
    """They lie along no dimension of the sweep, and a grid does."""
    swept = Dimension(name, {"contact.friction": (0.3, 0.5)}, ("0.3", "0.5"), 0, gridded=True)
    sweep = SimpleNamespace(dimensions=(swept,))
    own = np.array([[0.3, 0.5, 0.5], [0.3, 0.3, 0.5]])
    runs = xr.Dataset({"friction": (("e", "run"), own), "slip": (("e", "run"), 2.0 * own)})
    assert _named(runs, sweep).friction.values.tolist() == own.tolist()  # type: ignore[arg-type]
    grid = xr.Dataset({"slip": ("friction", [1.0, 2.0])}, {"friction": [0.3, 0.5]})
    assert _named(grid, sweep)[name].values.tolist() == [0.3, 0.5]  # type: ignore[arg-type]
