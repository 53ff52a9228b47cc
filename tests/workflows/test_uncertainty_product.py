"""`vsr run uncertainty` on a block: its own grid, Housner's equation, all cells run, symmetry."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import xarray as xr
from matplotlib.figure import Figure
from shapely.geometry import Polygon
from support.small_scan import FAR, survey, tapered, write_ply

from pipeline.stages.mesh import scan_figures
from pipeline.stages.studies.validation.recorded_tests import ShakeTableConfig
from pipeline.stages.uncertainty import draws, ensemble, uncertainty
from pipeline.stages.uncertainty.draw_runs import Search
from pipeline.stages.uncertainty.uncertainty_page import directions, yaws
from pipeline.workflow import pages
from vsr_core import GRAVITY
from vsr_core.outcome import FoundBy
from vsr_core.run import rocking_block
from vsr_core.uncertainty import step_error
from vsr_core.validation.priors import Priors

SITE = """
rock: {shape: box, size: [0.25, 0.8, 1.0], density: 2000}
contact: {friction: 10}
motion: {pga: {start: 0.1, stop: 0.7, num: 7}, pgv_pga: {start: 0.1, stop: 0.4, num: 3}}
yaw: [0, 90]
simulation: {engine: nonsmooth, time_step: 0.002}
"""

FIXED = {
    "friction": "[10, 10]",
    "restitution": "[0, 0]",
    "azimuth": "{mean: 0, sd: 0}",
    "amplitude": "{mean: 1, sd: 0}",
    "centre_of_mass": "0",
    "inset": "[0, 0]",
    "members": "8",
}


def priors(**free: str) -> list[str]:
    """Settings that hold all unknowns fixed but these."""
    every = {**FIXED, **free}
    return [
        part for key, value in every.items() for part in ("--set", f"uncertainty.{key}={value}")
    ]


def product(ran: Any, derived: Path, *, unresolved: bool = False) -> xr.Dataset:
    """The product of a command, of which some runs may be unresolved."""
    assert ran.code == 0 or (unresolved and ran.code == 1), ran.err
    return xr.load_dataset(derived / "rock" / "uncertainty.nc", mask_and_scale=False)


@pytest.mark.slow
def test_nothing_unknown_is_the_grid_itself(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path
) -> None:
    """Every draw has the outcomes of the responses, and a bracket that meets the site's own."""
    site = write_site(SITE)
    ran = vsr("run", "uncertainty", "--site", site, *priors())
    found = product(ran, derived)
    assert ran.code == 0
    nominal = xr.load_dataset(derived / "rock" / "responses.nc", mask_and_scale=False)
    same = np.broadcast_to(nominal["overturned"].values[:, 0], found["overturned"].shape)
    np.testing.assert_array_equal(found["overturned"].values, same)
    np.testing.assert_array_equal(found["probability"].values, same[0])
    own = xr.load_dataset(derived / "rock" / "boundary.nc").isel(friction=0)
    low, high = (found[f"member_boundary_{end}"].values for end in ("lower", "upper"))
    assert (low < own["first_overturning_pga_upper"].values).all()
    assert (high > own["first_overturning_pga_lower"].values).all()
    wide = float(found["draw_error"] + found["draw_islands"])  # a block has islands, too
    assert float(found["boundary_resolution"]) == max(wide, 0.01)
    assert np.log(high / low).max() <= np.log1p(max(wide, 0.01))
    assert not list(found["unknown"].values)
    notes = (derived / "rock").rglob("*")
    assert any(path.name == "uncertainty.html" for path in notes)
    again = vsr("run", "uncertainty", "--site", site, *priors())
    assert "draws" not in again.err.split("->")[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "friction", "said"),
    [
        ("friction: 10", "friction: 0.1", "[0.1, 0.1]", "In no direction and under no motion do"),
        ("friction: 10", "friction: 0.5", "[0.5, 0.5]", "(of the motions under which"),
    ],
)
def test_a_width_is_of_motions_under_which_draws_topple(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    old: str,
    new: str,
    friction: str,
    said: str,
) -> None:
    site = write_site(SITE.replace(old, new))
    ran = vsr("run", "uncertainty", "--site", site, *priors(members="2", friction=friction))
    assert not np.isfinite(product(ran, derived)["boundary_high"].values).all()
    page = (derived / "rock" / "uncertainty.html").read_text(encoding="utf-8")
    assert f"{said} 95&nbsp;% of the draws topple" in page
    nowhere = said.startswith("In no")
    assert ("2 draws; under no motion do 95 % of them topple" in ran.err) == nowhere


def test_a_draw_that_topples_at_the_lowest_pga_has_no_boundary_known(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its band is open below, as it is above where draws never topple; widths are of the others."""
    grid = "motion.pga={start: 0.4, stop: 0.7, num: 4}"
    gain = priors(members="4", amplitude="{mean: 1, sd: 0.1}")
    told: dict[str, Any] = {}
    filled = pages.filled
    monkeypatch.setattr(
        pages, "filled", lambda name, *rest: told.update({name: rest[0]}) or filled(name, *rest)
    )
    own = ("--set", grid, "--set", "fragility.lowest=0.4", *gain)
    found = product(vsr("run", "uncertainty", "--site", write_site(SITE), *own), derived)
    lower, upper = (found[f"member_boundary_{end}"].values for end in ("lower", "upper"))
    lowest = np.isnan(lower) & np.isfinite(upper)
    assert lowest.all(axis=0).any()
    assert not lowest.any(axis=0).all()
    for name, counted in (("low", lowest.any(axis=0)), ("high", lowest.all(axis=0))):
        np.testing.assert_array_equal(found[f"boundary_{name}"].values == 0.0, counted)
    assert (found["member_boundary"].values > 0.0).all()
    ends = [found[f"boundary_{name}"].values for name in ("low", "high")]
    for row, low, high in zip(directions(found), *ends, strict=True):
        whole = (low > 0.0) & np.isfinite(high)
        width = np.exp(np.median(np.log(high[whole] / low[whole]))) if whole.any() else np.nan
        assert row["ratio"] == pytest.approx(width, nan_ok=True)
    page = (derived / "rock" / "uncertainty.html").read_text(encoding="utf-8")
    assert "but fewer than 5&nbsp;% at the lowest" in page
    assert "0: the draw topples at the lowest PGA tried, 0.4&nbsp;g, already" in page
    assert "4 draws are too few" in page
    assert "That takes 16 draws or more" in page
    assert "no indices are given: yaw" not in page
    assert "of the scan" not in page  # as a box has none
    assert "as scanned" not in page
    assert "The remainder" not in page
    unknown = found.assign(explained_share=("yaw", [0.3, np.nan]))
    shares = unknown["explained_share"]
    named = {"unsupported": yaws(unknown, shares < 0.5), "untried": yaws(unknown, shares.isnull())}
    assert named == {"unsupported": ["0"], "untried": ["90"]}
    index = {"name": "gain", "first": 0.5, "total": 0.5}
    known = (
        told["uncertainty.html"] | named | {"explained": 0.6, "ranked": [index], "leaders": [index]}
    )
    page = filled("uncertainty.html", known)
    assert "no indices are given: yaw 0&nbsp;deg; more draws" in page
    assert "At yaw 90&nbsp;deg that is unknown" in page
    assert "The remainder" not in page  # a box's base is exact
    assert "mainly the shape of the base" in filled("uncertainty.html", known | {"box": False})


@pytest.mark.slow
def test_a_gain_moves_the_boundary_of_housner(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A block that rocks about an edge and knows its pulse but for a gain, with all cells run."""
    monkeypatch.setattr(ensemble, "CHECKED", 1.0)
    monkeypatch.setattr(ensemble, "followed_share", lambda levels: 1.0)
    ran = vsr(
        "run", "uncertainty", "--site", write_site(SITE), *priors(amplitude="{mean: 1, sd: 0.1}")
    )
    found = product(ran, derived)
    assert found["unknown"].values.tolist() == ["gain of the motion"]
    assert not (found["found_by"] == FoundBy.INFERRED).any()
    block = rocking_block.Block(0.125, 0.5)
    gain, pga = found["drawn_amplitude"].values, found["pga"].values
    ratio, felt = float(found["pgv_pga"][1]), np.outer(gain, pga) * GRAVITY
    sides = found["overturned"].values[:, 0, 1]
    for side, strength in zip(sides.ravel(), felt.ravel(), strict=True):
        about = {
            rocking_block.rocking_response(block, share * strength, ratio, rtol=1e-6).overturned
            for share in (0.98, 1.0, 1.02)
        }
        assert side in about
    edges = found["member_boundary"].values[:, 0, 1]
    for strength in (gain * edges * GRAVITY).tolist():
        about = {
            rocking_block.rocking_response(block, share * strength, ratio, rtol=1e-6).overturned
            for share in np.linspace(0.98, 1.02, 9).tolist()
        }
        assert about == {False, True}
    np.testing.assert_allclose(gain * edges, np.median(gain * edges), rtol=0.01)
    inferred = found["pga"].values >= found["member_boundary"].values[..., None]
    proved = found["found_by"].values == FoundBy.PROVED
    islands = (inferred != (found["overturned"].values == 1)) & ~proved
    assert found["inferred_wrong"].values.sum() == islands.sum()
    assert islands.mean() < 0.02
    late = int(found["levels_not_first"].values.sum())
    assert re.search(rf"followed {late} (is|are) not the first; all lie ", ran.err)
    ends = [found[f"member_boundary_{end}"].values for end in ("lower", "upper")]
    assert found["levels_followed"].values.sum() == np.isfinite(ends).all(axis=0).sum()


@pytest.mark.slow
def test_what_the_rule_spares_is_counted_where_it_is_wrong(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same draws with few cells run and with all: they differ in inferred cells only."""
    given = priors(friction="[0.3, 0.9]", restitution="[0, 0.2]", centre_of_mass="0.02")
    site = write_site(SITE)
    monkeypatch.setattr(ensemble, "CHECKED", 0.0)
    monkeypatch.setattr(ensemble, "followed_share", lambda levels: 0.0)
    few = product(vsr("run", "uncertainty", "--site", site, *given), derived)
    assert few["inferred_tested"].values.sum() == 0
    monkeypatch.setattr(ensemble, "CHECKED", 1.0)
    (derived / "rock" / "uncertainty.nc").unlink()
    every = product(vsr("run", "uncertainty", "--site", site, *given), derived)
    differ = few["overturned"].values != every["overturned"].values
    inferred = few["found_by"].values == FoundBy.INFERRED
    assert inferred.mean() > 0.2
    assert not differ[~inferred].any()
    assert differ.sum() == every["inferred_wrong"].values.sum()
    assert every["inferred_tested"].values.sum() == inferred.sum()
    assert differ.sum() <= 0.02 * inferred.sum()
    assert (np.diff(every["surface"].values, axis=1) >= 0.0).all()


@pytest.mark.slow
def test_density_as_a_whole_is_nothing_to_a_rock(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path
) -> None:
    """Mass and inertia go together: on a table that moves as prescribed the same cells topple."""
    given = priors(friction="[0.3, 0.9]", restitution="[0, 0.2]", centre_of_mass="0.02")
    found = []
    for density in (2000, 2700):
        site = write_site(SITE.replace("2000", str(density)))
        ran = vsr("run", "uncertainty", "--site", site, *given)
        assert f"{0.25 * 0.8 * density:.0f} kg" in ran.err
        found.append(product(ran, derived))
    light, heavy = (one["overturned"].values for one in found)
    assert 0.1 < light.mean() < 0.9
    np.testing.assert_array_equal(heavy, light)
    light, heavy = found  # whose searches begin from other brackets of the site's own
    np.testing.assert_array_less(light["member_boundary_lower"], heavy["member_boundary_upper"])
    np.testing.assert_array_less(heavy["member_boundary_lower"], light["member_boundary_upper"])


@pytest.mark.slow
@pytest.mark.parametrize("levels", ["[0.3]", pytest.param("[0.15, 0.4]", marks=pytest.mark.slow)])
def test_a_grid_of_few_levels_has_its_page(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path, levels: str
) -> None:
    site = write_site(SITE)
    given = ("--set", f"motion.pgv_pga={levels}", "--set", "uncertainty.members=2")
    ran = vsr("run", "uncertainty", "--site", site, *given)
    assert ran.code == 0, ran.err
    assert "<img" in (derived / "rock" / "uncertainty.html").read_text(encoding="utf-8")


WEDGE = """
rock: {shape: mesh, mesh: wedge.ply, density: 2000}
contact: {friction: 0.8}
motion: {pga: {start: 0.1, stop: 1.2, num: 12}, pgv_pga: [0.15, 0.4]}
yaw: [0, 30, 180, 210]
simulation: {engine: nonsmooth, time_step: 0.002}
uncertainty: {scan: {error: 0}}
"""


@pytest.mark.slow
def test_the_direction_drawn_is_that_in_which_a_rock_without_symmetry_is_shaken(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A prism on a right-angled triangle, with all cells run.

    Shaken 30 degrees counter-clockwise of +x at a yaw of 30 degrees, it is shaken along the +x of
    its scan, as at a yaw of 0; and against it, as at 180, in every other draw.
    """
    monkeypatch.setattr(ensemble, "CHECKED", 1.0)
    triangle = Polygon([(0.0, 0.0), (0.6, 0.0), (0.0, 0.25)])
    trimesh.creation.extrude_polygon(triangle, 0.8).export(tmp_path / "wedge.ply")
    given = priors(
        azimuth="{mean: 30, sd: 0}",
        polarity_reversal_probability="0.5",
        friction="[0.8, 0.8]",
        members="4",
    )
    found = product(vsr("run", "uncertainty", "--site", write_site(WEDGE), *given), derived)
    nominal = xr.load_dataset(derived / "rock" / "responses.nc", mask_and_scale=False)
    along = nominal["overturned"].isel(friction=0)
    sides = [along.sel(yaw=yaw).values for yaw in (0, 30, 180)]
    assert min((one != other).sum() for one, other in itertools.combinations(sides, 2)) >= 2
    backward = found["drawn_reversed"].values
    assert sorted(backward) == [0, 0, 1, 1]
    for draw, turned in zip(found["overturned"], backward.tolist(), strict=True):
        for yaw in (30, 210):
            expected = along.sel(yaw=(yaw - 30 + 180 * turned) % 360)
            np.testing.assert_array_equal(draw.sel(yaw=yaw), expected)


@pytest.mark.slow
def test_draws_are_searched_from_the_site_at_the_friction_nearest_to_theirs(
    vsr: Callable[..., Any],
    write_site: Callable[..., str],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At a friction of 0.1 nothing topples, so that the table at hand tells which one was taken."""
    asked, shown = [], []

    def outcomes(wanted: Search) -> ensemble.Ensemble:
        asked.append(wanted)
        return ensemble.outcomes(wanted)

    def bands(dataset: xr.Dataset, responses: xr.Dataset) -> Figure:
        shown.append(responses)
        return Figure()

    monkeypatch.setattr(uncertainty, "outcomes", outcomes)
    monkeypatch.setattr(uncertainty.page, "bands", bands)
    site = write_site(SITE.replace("friction: 10", "friction: [0.1, 10]"))
    found = product(vsr("run", "uncertainty", "--site", site, *priors(members="2")), derived)
    nominal = xr.load_dataset(derived / "rock" / "responses.nc", mask_and_scale=False)
    slippery, rough = (nominal["overturned"].sel(friction=one).values for one in (0.1, 10.0))
    assert not slippery.any()
    assert rough.any()
    np.testing.assert_array_equal(asked[0].nominal, rough)
    assert float(shown[0]["friction"]) == 10.0
    # g times width over height of the block along x, then along y; either way the same
    expected = np.log([0.25 / 1.0, 0.8 / 1.0])
    np.testing.assert_allclose(np.exp(asked[0].given[:4]), np.exp(np.tile(expected, (4, 1))))
    np.testing.assert_array_equal(found["overturned"].values, np.stack([rough, rough]))


def test_priors_of_the_shake_table_are_in_the_same_words() -> None:
    """The defaults of recorded tests are those of the physics, but for what tests have taught."""
    assert draws.priors(ShakeTableConfig()) == Priors(
        azimuth=(math.radians(-7.5), math.radians(7.5)),
        polarity_reversal_probability=0.1,
        error=1.0,
        inset=(0.0, 0.034),
    )


HILL = """
rock: {shape: mesh, mesh: scan.ply, density: 2000}
pedestal: {shape: mesh, cut: {kind: plane, point: POINT, normal: NORMAL}}
contact: {friction: 0.7}
motion: {pga: {start: 0.5, stop: 0.98, num: 9}, pgv_pga: [0.4, 0.6]}
yaw: 40
simulation: {time_step: 0.004}
"""
RIM = "{rim: 1, points: 0, whole: 0}"


@pytest.fixture
def hill(
    write_site: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    few_samples: None,
) -> str:
    """A rock on its seat in a terrain of one scan."""
    for name in ("separation", "closed_rock", "seat"):  # of the page of the scan
        monkeypatch.setattr(scan_figures, name, lambda *given: Figure(figsize=(0.1, 0.1)))
    for name in ("FEW", "LEVELS"):  # at an eighth of the step runs on terrain take long
        monkeypatch.setattr(step_error, name, 1)
    write_ply(tmp_path / "scan.ply", survey(), FAR)
    up = tapered().up
    point = str((FAR + 0.02 * up).tolist())
    return write_site(HILL.replace("POINT", point).replace("NORMAL", str(up.tolist())))


@pytest.mark.slow
def test_nothing_unknown_of_a_rock_on_its_seat_is_the_site_itself(
    vsr: Callable[..., Any], hill: str, derived: Path
) -> None:
    """Every draw is laid and settled anew, and finds its runs stored to the last bit."""
    fixed = priors(
        friction="[0.7, 0.7]", seat=RIM, scan="{error: 0}", restitution="[0, 0]", members="2"
    )
    ran = vsr("run", "uncertainty", "--site", hill, *fixed)
    found = product(ran, derived)
    nominal = xr.load_dataset(derived / "rock" / "responses.nc", mask_and_scale=False)
    own = nominal["overturned"].values[:, 0]
    assert 0 < own.sum() < own.size
    np.testing.assert_array_equal(found["overturned"].values, np.stack([own, own]))
    assert not list(found["unknown"].values)


@pytest.mark.slow
def test_cells_beyond_the_range_of_the_search_are_those_of_a_wider_one(
    vsr: Callable[..., Any], write_site: Callable[..., str], derived: Path
) -> None:
    """A boundary is looked for in the whole grid at least, so that no cell stands untried."""
    free = priors(members="4", azimuth="{mean: 0, sd: 10}")
    found = []
    for bounds in (("0.1", "0.7"), ("0.3", "0.4")):
        given = zip(("fragility.lowest", "fragility.highest"), bounds, strict=True)
        more = [part for key, value in given for part in ("--set", f"{key}={value}")]
        ran = vsr("run", "uncertainty", "--site", write_site(SITE), *free, *more)
        found.append(product(ran, derived))
    wide, narrow = found
    assert wide["probability"].values[..., -1].max() > 0.0
    for name in ("overturned", "probability", "found_by", "member_boundary", "theta"):
        np.testing.assert_array_equal(wide[name].values, narrow[name].values)


@pytest.mark.slow
def test_a_larger_error_of_the_seam_alone_scatters_the_draws_more(
    vsr: Callable[..., Any], hill: str, derived: Path
) -> None:
    spread = []
    for error in ("0.001", "0.02"):
        given = priors(friction="[0.7, 0.7]", seat=RIM, scan=f"{{error: {error}}}", members="5")
        found = product(vsr("run", "uncertainty", "--site", hill, *given), derived, unresolved=True)
        assert found["unknown"].values.tolist() == ["seat"]
        toppled = (found["overturned"].values == 1).sum(axis=(1, 2, 3))
        spread.append(float(toppled.std()))
    assert spread[1] > spread[0]


@pytest.mark.slow
def test_seats_are_drawn_of_a_rock_on_its_terrain_by_any_workers(
    vsr: Callable[..., Any], hill: str, derived: Path
) -> None:
    free = ("--set", "uncertainty.members=8")
    here = product(vsr("run", "uncertainty", "--site", hill, *free), derived, unresolved=True)
    assert set(here["drawn_seat"].values) >= {"rim", "whole"}
    assert "seat" in here["unknown"].values
    page = (derived / "rock" / "uncertainty.html").read_text()
    assert "3 to 6 points of it" in page
    for path in (*(derived / "rock").glob("runs.sqlite*"), derived / "rock" / "uncertainty.nc"):
        path.unlink()
    ran = vsr("run", "uncertainty", "--site", hill, *free, "--workers", "2")
    again = product(ran, derived, unresolved=True)
    np.testing.assert_array_equal(again["overturned"].values, here["overturned"].values)


def test_a_terrain_of_another_file_has_no_seam_to_draw(refused: Callable[..., str]) -> None:
    words = ("pedestal.mesh", "a terrain in a file of its own")
    refused("run", "uncertainty", "--site", "granite_boulder", words=words)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("uncertainty.friction=[0.9,0.1]", ("uncertainty.friction", "lower end")),
        ("uncertainty.members=1", ("uncertainty.members", "2")),
        (
            "uncertainty.amplitude={mean: 1, sd: 0.5}",
            ("uncertainty.amplitude", "five standard deviations"),
        ),
        ("uncertainty.scan.replica=none.ply", ("uncertainty.scan.replica", "not found")),
        ("uncertainty.scan.eror=1", ("uncertainty.scan.eror", "error")),
        (f"uncertainty.seat={RIM.replace('1', '0')}", ("uncertainty.seat", "bears")),
    ],
)
def test_bad_priors_are_refused(
    refused: Callable[..., str], write_site: Callable[..., str], setting: str, words: tuple[str]
) -> None:
    refused("run", "uncertainty", "--site", write_site(SITE), "--set", setting, words=words)
