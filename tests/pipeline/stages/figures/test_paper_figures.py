"""What figures of the paper draw and find, on small datasets whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from pipeline.config.layers import load_site
from pipeline.stages.figures import (
    diagrams,
    fig_07,
    fig_08,
    fig_11,
    fig_12,
    fig_13,
    fig_14,
    fig_15,
    fig_16,
    fig_friction,
    paper,
    table_1,
)
from pipeline.workflow.parameters import Values
from pipeline.workflow.registry import BY_NAME
from vsr_core.fragility.boundary import locate
from vsr_core.outcome import Outcome

PGA = np.linspace(0.1, 1.0, 10)
RATIOS = np.linspace(0.1, 1.0, 10)


def responses(*grids: NDArray[np.int_], yaw: tuple[float, ...] = (0.0,)) -> xr.Dataset:
    """Responses of one friction, a grid a yaw."""
    dims = ("yaw", "friction", "pgv_pga", "pga")
    coordinates = {"yaw": list(yaw), "friction": [0.6], "pgv_pga": RATIOS, "pga": PGA}
    first = np.array([locate(PGA, grid).pga for grid in grids])[:, None]
    found = {"overturned": (dims, np.array(grids)[:, None])}
    return xr.Dataset(
        found | {"first_overturning_pga": (dims[:3], first)}, coordinates, {"searched_to_g": 1.0}
    )


def beyond(level: float) -> NDArray[np.int_]:
    """A rock that overturns from a PGA on."""
    return np.tile((level < PGA).astype(int), (RATIOS.size, 1))


def drawn(axes: Axes, gid: str) -> NDArray[np.float64]:
    (line,) = [line for line in axes.get_lines() if line.get_gid() == gid]
    return np.asarray(line.get_xdata(), float)


@pytest.mark.parametrize("name", paper.names())
def test_every_figure_names_what_there_is(name: str) -> None:
    figure = paper.load(name)
    assert figure.TITLE
    assert callable(figure.draw)
    assert callable(figure.findings)
    for source in figure.SOURCES.values():
        assert source.stage in BY_NAME
        assert load_site(source.site, source.study or None).name == source.site
    assert all(path.is_file() for path in paper.inputs(figure))
    for told, own in paper.settings(figure).items():
        assert all(map(Values(load_site(figure.SOURCES[told].site).settings).holds, own))


def test_figures_are_found_by_what_a_user_calls_them() -> None:
    assert paper.find("15") == ["fig_15", "fig_15a"]
    assert paper.find("fig_08") == paper.find("08") == paper.find("8") == ["fig_08"]
    assert paper.find("1") == ["table_1"]
    assert paper.find("friction") == ["fig_friction"]
    assert paper.names()[0] == "fig_07"
    assert paper.names().index("table_1") < paper.names().index("fig_friction")


@pytest.mark.parametrize(
    ("size", "pga"), [((1.0, 2.0), (0.93, 0.73, 0.67)), ((1.0, 3.0), (0.68, 0.52, 0.47))]
)
def test_housner_s_curve_is_that_integrated_apart(
    size: tuple[float, float], pga: tuple[float, ...]
) -> None:
    """Of event-located integration by other code, in steps of 0.01 g, at 0.15, 0.20 and 0.25 s."""
    found = diagrams.housner(*size, np.array([0.15, 0.20, 0.25]), 1.5)
    np.testing.assert_array_equal(np.ceil(100.0 * found), 100.0 * np.array(pga))
    assert np.isnan(diagrams.housner(*size, np.array([0.05]), 1.0)).all()


def cuboids(**levels: float) -> dict[str, xr.Dataset]:
    return {name: responses(beyond(levels[key])) for name, key in
            zip(fig_12.SIZES, ("b", "c", "d", "e"), strict=True)}  # fmt: skip


@pytest.mark.slow
def test_fig_12_draws_the_paper_s_axes_and_housner() -> None:
    figure = fig_12.draw(cuboids(b=0.6, c=0.4, d=0.5, e=0.4))
    _, *panels = figure.axes
    assert [axes.get_title() for axes in panels] == [
        "(b) 1x1x2 m", "(c) 1x1x3 m", "(d) 0.5x0.5x1 m", "(e) 1x2x3 m",
    ]  # fmt: skip
    for axes in panels:
        assert axes.get_xlim()[1] == axes.get_ylim()[1] == pytest.approx(1.05)
    assert panels[2].get_xlabel() == "PGA [g]"
    assert panels[2].get_ylabel() == "PGV/PGA [s]"
    for axes, expected in zip(panels[:2], (73, 52), strict=True):  # at 0.2 s, to the next 0.01 g
        assert np.ceil(100.0 * drawn(axes, "housner")[1]) == expected


@pytest.mark.slow
def test_fig_12_finds_by_its_rules_only() -> None:
    found = [one.found for one in fig_12.findings(cuboids(b=0.6, c=0.4, d=0.5, e=0.4))]
    assert found[:4] == [True, True, True, False]  # there is no island
    found = [one.found for one in fig_12.findings(cuboids(b=0.4, c=0.6, d=0.5, e=0.4))]
    assert found[:3] == [False, False, False]


def test_fig_13_tells_a_cluster_from_stray_cells() -> None:
    sizes = {0.0: [60], 300.0: [50, 7, 1]}
    assert fig_13._cluster(sizes).found
    assert not fig_13._cluster({0.0: [60, 9], 300.0: [50, 4]}).found
    assert "0° (9 cells)" in fig_13._cluster({0.0: [60, 9], 300.0: [50, 4]}).measured


def test_fig_13_sees_balanced_runs_before_the_main_zone() -> None:
    grid = beyond(0.35)
    assert fig_13.before_balanced(grid) == (0, 0)
    grid[2:5, 5] = 0  # of the toppled columns 3 to 9; two lie below it
    assert fig_13.before_balanced(grid) == (3, 6)
    assert fig_13._returns({300.0: (3, 6)}).found
    assert not fig_13._returns({300.0: (2, 20)}).found
    grid[2, 5] = -1  # undecided is no balanced run
    assert fig_13.before_balanced(grid) == (2, 4)


def test_fig_11_compares_where_the_robot_can_go() -> None:
    """1.2 g and 0.5 m/s: at 0.1 s up to 0.51 g, at 1 s up to 0.051 g."""
    can = diagrams.feasible(PGA, RATIOS)
    assert can[0].sum() == 5
    assert not can[-1].any()
    data = {"print": responses(beyond(0.25), beyond(0.45), yaw=(0.0, 270.0))}
    everywhere, feasible, _ = fig_11.findings(data)
    assert everywhere.found
    assert feasible.found
    swapped = {"print": responses(beyond(0.45), beyond(0.25), yaw=(0.0, 270.0))}
    assert [one.found for one in fig_11.findings(swapped)[:2]] == [False, False]


def test_fig_11_draws_each_boundary_where_its_name_says() -> None:
    yaw = (45.0, 270.0, 0.0)
    medians = {45.0: 0.2, 270.0: 0.8, 0.0: 0.5}
    dims = ("yaw", "friction", "pgv_pga", "model")
    line = np.tile(np.reshape([medians[one] for one in yaw], (3, 1, 1, 1)), (1, 1, RATIOS.size, 1))
    fit = xr.Dataset(
        {"median_pga": (dims, line)},
        {"yaw": list(yaw), "pgv_pga": RATIOS, "pga": PGA, "model": ["logistic"]},
    )
    data = {
        "print": responses(*[beyond(0.5)] * 3, yaw=yaw),
        "fit": fit,
        "rock": xr.Dataset(attrs={"shape_source": "made up"}),
    }
    axes = fig_11.draw(data).axes[0]
    for side in fig_11.YAWS:
        assert (drawn(axes, f"logistic-{side:g}") == medians[side]).all()


def test_fig_11_counts_tests_and_the_runs_nearest_to_them() -> None:
    """Of 83 tests at yaw 0 deg, 46 overturned; all runs do, then none."""
    for limit, virtual, found in ((0.0, 100, False), (9.0, 0, True)):
        grids = beyond(limit), beyond(0.45)
        tested = fig_11.findings({"print": responses(*grids, yaw=(0.0, 270.0))})[2]
        assert tested.found is found
        assert f"of 83 tests against {virtual} %" in tested.measured
    series = diagrams.physical_tests("yaw 0")
    assert (len(series.toppled), series.toppled.sum()) == (83, 46)
    assert not len(diagrams.physical_tests("yaw 270").toppled)


def test_fig_14_puts_runs_on_their_grid() -> None:
    pga, ratio = np.meshgrid(PGA, RATIOS)
    codes = np.where(pga > 0.55, Outcome.OVERTURNED, Outcome.DISPLACED)
    codes[0, 0] = Outcome.UNSETTLED
    shuffled = np.random.default_rng(1).permutation(codes.size)
    runs = xr.Dataset(
        {name: ("run", values.ravel()[shuffled]) for name, values in
         (("pga", pga), ("pgv_pga", ratio), ("outcome", codes))}
    )  # fmt: skip
    columns, rows, outcomes = fig_14.gridded(runs)
    np.testing.assert_array_equal(columns, PGA)
    np.testing.assert_array_equal(rows, RATIOS)
    expected = beyond(0.55)
    expected[0, 0] = -1
    np.testing.assert_array_equal(outcomes, expected)


def test_fig_8_tells_a_rise_from_a_block_that_never_overturns() -> None:
    grid = beyond(0.35)
    grid[0] = 0
    assert fig_08._rise(responses(grid), "").found  # the shortest pulse is beyond the grid
    assert fig_08._rise(responses(beyond(0.35)), "").found is False
    assert fig_08._rise(responses(beyond(2.0)), "").found is None


def moved(codes: dict[float, list[Outcome]]) -> xr.Dataset:
    """Runs over terrain, their outcomes by PGA; the speeds are the PGA in m/s."""
    pga = [level for level, outcomes in codes.items() for _ in outcomes]
    every = [code for outcomes in codes.values() for code in outcomes]
    return xr.Dataset(
        {"pga": ("run", pga), "outcome": ("run", every), "largest_speed": ("run", pga)}
    )


def test_fig_15_compares_speeds_only_where_rocks_toppled() -> None:
    up, over = Outcome.BALANCED, Outcome.OVERTURNED
    _, more, faster = fig_15.findings(
        {"displacement": moved({0.6: [up, up, over], 0.75: [up, over, over]})}
    )
    assert (more.found, faster.found) == (True, True)
    _, more, faster = fig_15.findings({"displacement": moved({0.6: [up], 0.75: [over]})})
    assert (more.found, faster.found) == (True, None)
    _, more, faster = fig_15.findings({"displacement": moved({0.75: [over]})})
    assert (more.found, faster.found) == (None, None)


@pytest.mark.filterwarnings("ignore:One or more sample arguments is too small")
def test_of_trajectories_that_there_are_not_nothing_is_found() -> None:
    stood = moved({0.6: [Outcome.BALANCED] * 3})
    names = ("pgv_pga", "trajectory_length", "terminal_distance")
    stood = stood.assign({name: ("run", np.ones(3)) for name in names})
    stood.attrs["observed_boulder"] = {"position": [0, 0], "position_sd": 1}
    terrain = xr.Dataset(attrs={"origin_in_scan": [0.0, 0.0, 0.0]})
    found = fig_16.findings({"displacement": stood, "terrain": terrain})
    found += table_1.findings({"displacement": stood})
    assert [one.found for one in found] == [None] * 9


def test_fig_14_finds_nothing_where_flat_ground_topples_nothing() -> None:
    pga, ratio = (axis.ravel() for axis in np.meshgrid(PGA, RATIOS))
    runs = xr.Dataset(
        {"pga": ("run", pga), "pgv_pga": ("run", ratio),
         "outcome": ("run", np.full(pga.size, Outcome.OVERTURNED))}
    )  # fmt: skip
    flat = responses(beyond(2.0), beyond(2.0), yaw=(0.0, 90.0))
    found = fig_14.findings({"0": runs, "90": runs, "flat": flat})
    assert [one.found for one in found] == [None, None, None]


@pytest.mark.parametrize(
    ("flat", "terrain", "found"),
    [
        (Outcome.OVERTURNED, Outcome.DISPLACED, True),
        (Outcome.OVERTURNED, Outcome.OVERTURNED, False),
        (Outcome.BALANCED, Outcome.UNSTABLE, False),
        (Outcome.OVERTURNED, Outcome.UNSTABLE, None),
        (Outcome.CRASHED, Outcome.BALANCED, None),
    ],
)
def test_fig_7_takes_no_failed_run_for_a_rock_that_stands(
    flat: Outcome, terrain: Outcome, found: bool | None
) -> None:
    def of(outcome: Outcome) -> xr.Dataset:
        dims = ("yaw", "friction", "pgv_pga", "pga")
        return xr.Dataset({"outcome": (dims, np.full((1, 1, 1, 1), outcome))})

    data = {"pulse on flat ground": of(flat), "pulse on the terrain": of(terrain)}
    assert fig_07._outcomes(data, "pulse", "a pulse").found is found


def test_without_a_decided_run_nothing_is_found() -> None:
    unknown = {name: responses(np.full((10, 10), -1)) for name in fig_12.SIZES}
    found = [one.found for one in fig_12.findings(unknown)]
    assert found == [None, None, None, False, None]  # there is no island among no cells


def test_friction_has_a_threshold_where_the_share_jumps() -> None:
    frictions = [0.1, 0.3, 0.6, 0.8, 1.2, 2.0]

    def at(levels: list[float]) -> xr.Dataset:
        grids = np.array([beyond(level) for level in levels])[None]
        dims = ("yaw", "friction", "pgv_pga", "pga")
        return xr.Dataset(
            {"overturned": (dims, grids)},
            {"yaw": [0.0], "friction": frictions, "pgv_pga": RATIOS, "pga": PGA},
        )

    jumps = dict.fromkeys(fig_friction.ROCKS, at([2.0, 0.95, 0.55, 0.55, 0.55, 0.55]))
    assert [one.found for one in fig_friction.findings(jumps)] == [True, True]
    grows = dict.fromkeys(fig_friction.ROCKS, at([2.0, 0.95, 0.85, 0.75, 0.65, 0.55]))
    assert [one.found for one in fig_friction.findings(grows)] == [True, False]


def course(kick: float, lasts: float) -> xr.Dataset:
    """A table that follows to 1 mm/s, but for a kick at 2 s, when the rock lies."""
    time = np.arange(0.0, 4.0, 0.001)
    wanted = np.sin(time)
    error = 1e-3 * np.cos(40.0 * time) + np.where(time >= 2.0, kick, 0.0) * np.exp(
        -(time - 2.0).clip(0.0) / lasts
    )
    return xr.Dataset(
        {"time": ("sample", time), "commanded_velocity": ("sample", wanted),
         "table_velocity": ("sample", wanted + error),
         "tilt": ("sample", np.where(time >= 1.9, 1.2, 0.0))}
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kick", "lasts", "found"), [(0.05, 0.05, True), (0.001, 0.05, False), (0.05, 1.0, False)]
)
def test_a_disturbance_stands_out_and_is_over_soon(kick: float, lasts: float, found: bool) -> None:
    assert fig_07._disturbance(course(kick, lasts)).found is found


def between_rests(case: xr.Dataset, length: int) -> xr.Dataset:
    """A course with a table at rest before and after it."""
    rest = {"commanded_velocity": 0.0, "table_velocity": 0.0, "time": 0.0, "tilt": (0.0, 1.2)}
    found = case.pad(sample=length, constant_values=rest)
    return found.assign(time=("sample", 0.001 * np.arange(found.sizes["sample"])))


@pytest.mark.parametrize("length", [0, 20_000])
def test_fig_7_counts_errors_of_the_time_of_shaking_alone(length: int) -> None:
    """Errors of 1 mm/s in a cosine have an rms of 0.71 mm/s, however long the table rests."""
    case = between_rests(course(0.05, 0.05), length)
    assert " 0.71 mm/s rms before" in fig_07._disturbance(case).measured
    pulse = between_rests(course(0.0, 0.05), length).assign(case_drive="servo")
    assert fig_07._overlap([pulse]).measured == "servo: 0.07 % of PGV"


def test_fig_7_draws_both_motions_and_magnifies_the_disturbance() -> None:
    cases = [course(0.0, 1.0), course(0.05, 0.02)]
    drive = xr.concat(cases, "sample").assign(
        row_size=("case", [case.sizes["sample"] for case in cases]),
        case_motion=("case", ["pulse", "record far"]),
        case_drive=("case", ["servo", "servo"]),
    )
    rock = xr.Dataset(attrs={"shape_source": "made up"})
    whole, record, near = fig_07.draw({"drive": drive, "rock": rock}).axes
    assert "0.2 g" in whole.get_title()
    assert "“far”" in record.get_title()
    assert {axes.get_ylabel() for axes in (whole, record, near)} == {"velocity [m/s]"}
    assert near.get_xlim() == pytest.approx((1.95, 2.05))  # the kick is at 2 s
    measured = [line for line in near.get_lines() if line.get_gid() == "measured"]
    assert np.ptp(np.asarray(measured[0].get_ydata())) > 0.05
    (box,) = record.patches
    assert box.get_bbox().x0 == pytest.approx(1.95)


@pytest.mark.parametrize(
    ("found", "word"),
    [(True, "reproduced"), (False, "not reproduced"), (None, "not testable here")],
)
def test_a_verdict_in_words(found: bool | None, word: str) -> None:
    assert paper.Finding("", "", "", "", found).verdict == word
