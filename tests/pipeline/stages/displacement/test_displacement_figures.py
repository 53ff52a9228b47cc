"""Figures and page of large displacement, on made-up falls down a plane."""

from __future__ import annotations

import base64
import io
import itertools
import json
import time
import warnings
from collections.abc import Iterator
from html.parser import HTMLParser

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import NDArray
from PIL import Image

from pipeline.drawing import ground_map, style
from pipeline.stages.datasets.displaced_runs import (
    STOPS,
    chosen,
    ends,
    forward,
    groups,
    left_seat,
    overturned_runs,
)
from pipeline.stages.displacement.correlation_figures import (
    ensemble_means,
    power,
    trajectory_lengths,
)
from pipeline.stages.displacement.displacement_report import Slot, page
from pipeline.stages.displacement.origin_maps import origin_maps
from pipeline.stages.displacement.trajectory_maps import (
    PGA_EDGES,
    end_positions,
    side_view,
    trajectories,
)
from pipeline.workflow.datasets import catalogue
from vsr_core import outcome
from vsr_core.displacement.correlation import correlations
from vsr_core.displacement.origin import ObservedBoulder, trace
from vsr_core.outcome import Movement, Outcome, StopReason

pytestmark = pytest.mark.usefixtures("small_pictures")

Array = NDArray[np.float64]

SOURCE = "surrogate terrain"

SLOPE = 0.4
"""Of the made-up plane: it falls toward +x."""

HEIGHT = 0.7
"""Of the centre of mass above the ground [m]."""


def plane(reach: float = 12.0, bumps: float = 0.0, cells: int = 60) -> xr.Dataset:
    """A tilted terrain through the foot of the rock, perhaps with bumps."""
    x, y = np.meshgrid(
        np.linspace(-4.0, reach, cells), np.linspace(-6.0, 6.0, cells), indexing="ij"
    )
    z = -SLOPE * x + bumps * (np.sin(1.7 * x) * np.cos(1.3 * y) - np.sin(0.0))
    corner = np.arange(cells * cells).reshape(cells, cells)
    a, b, c, d = (
        corner[i : cells - 1 + i, j : cells - 1 + j].ravel()
        for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    return xr.Dataset(
        {
            "terrain_vertex": (
                ("terrain_corner", "xyz"),
                np.column_stack([x.ravel(), y.ravel(), z.ravel()]),
            ),
            "terrain_face": (
                ("terrain_face_number", "three"),
                np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(
                    "i4"
                ),
            ),
        }
    )


def falls(
    grid: int = 12, samples: int = 40, least: float = 0.9, seed: int = 0, yaw: float = 0.0
) -> xr.Dataset:
    """Runs of a grid of PGA and PGV/PGA; those of more than ``least`` m/s PGV go down the plane."""
    rng = np.random.default_rng(seed)
    pga, ratio = (
        axis.ravel()
        for axis in np.meshgrid(np.linspace(0.05, 1.0, grid), np.linspace(0.02, 1.0, grid))
    )
    pgv = 9.81 * pga * ratio
    fallen = pgv > least
    length = np.where(fallen, 2.0 + 0.9 * pgv + rng.normal(0.0, 0.4, pgv.size), 0.0)
    length = np.where(length > 6.0, length + 1.5, length)
    way = rng.normal(0.0, 0.2, pgv.size)
    size = np.where(fallen, samples, 2)
    part = np.concatenate([np.linspace(0.0, 1.0, n) for n in size])
    run = np.repeat(np.arange(pgv.size), size)
    gone = length[run] * (part - np.sin(2 * np.pi * part) / (2 * np.pi))
    x, y = gone * np.cos(way[run]), gone * np.sin(way[run]) + 0.15 * gone * np.sin(1.3 * gone)
    z = HEIGHT - SLOPE * x
    first = np.concatenate([[0], np.cumsum(size)[:-1]])
    step = np.linalg.norm(np.diff([x, y, z], axis=1, prepend=np.zeros((3, 1))), axis=0)
    step[first] = 0.0
    lasting = 0.5 + length
    speed = step / (lasting / size)[run]
    last = np.cumsum(size) - 1
    left = fallen & (x[last] > 9.0)
    stop = np.where(left, StopReason.LEFT_TERRAIN, StopReason.REST)
    stop[np.flatnonzero(fallen)[::17]] = StopReason.TIME
    outcome = np.where(fallen, Outcome.OVERTURNED, Outcome.BALANCED)
    movement = np.where(fallen, 1 + np.arange(pgv.size) % 7 % 3, Movement.STAYED)
    undone = np.flatnonzero(~fallen)[-2:]
    outcome[undone], stop[undone], movement[undone] = Outcome.UNSTABLE, StopReason.UNDONE, -1
    ones = np.ones(pgv.size)
    end = np.stack([x, y, z])[:, last]
    return xr.Dataset(
        {
            "pga": ("run", pga),
            "pgv_pga": ("run", ratio),
            "yaw": ("run", yaw * ones),
            "friction": ("run", 0.6 * ones),
            "row_size": ("run", size),
            "outcome": ("run", outcome.astype("i1")),
            "movement": ("run", movement.astype("i1")),
            "stop_reason": ("run", stop.astype("i1")),
            "trajectory_length": ("run", np.add.reduceat(step, first)),
            "largest_speed": ("run", np.maximum.reduceat(speed, first)),
            "terminal_distance": ("run", np.linalg.norm(end.T - [0.0, 0.0, HEIGHT], axis=1)),
            "time": ("sample", part * lasting[run]),
            "x": ("sample", x),
            "y": ("sample", y),
            "z": ("sample", z),
            "speed": ("sample", speed),
        },
        {"run": np.arange(pgv.size)},
    )


def joined(*parts: xr.Dataset) -> xr.Dataset:
    """Runs of several datasets, one after the other."""
    return xr.Dataset(
        {
            name: (variable.dims, np.concatenate([part[name].values for part in parts]))
            for name, variable in parts[0].data_vars.items()
        }
    )


def turned(data: xr.Dataset, angle: float) -> xr.Dataset:
    """Falls or a terrain turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    if "terrain_vertex" in data:
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return data.assign(
            terrain_vertex=(data["terrain_vertex"].dims, data["terrain_vertex"].values @ rotation.T)
        )
    return data.assign(x=c * data["x"] - s * data["y"], y=s * data["x"] + c * data["y"])


@pytest.fixture(autouse=True)
def no_warning() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.fixture(scope="module")
def runs() -> xr.Dataset:
    return falls()


@pytest.fixture(scope="module")
def ground() -> xr.Dataset:
    return plane()


def of(runs: xr.Dataset, number: int, name: str) -> Array:
    """Samples of one run."""
    first = int(runs["row_size"].values[:number].sum())
    samples: Array = runs[name].values[first : first + int(runs["row_size"].values[number])]
    return samples


def artists(axes: Axes, gid: str) -> list:  # type: ignore[type-arg]
    return [artist for artist in axes.get_children() if artist.get_gid() == gid]


def artist(axes: Axes, gid: str):  # type: ignore[no-untyped-def]
    found = artists(axes, gid)
    assert len(found) == 1, gid
    return found[0]


def texts(figure: Figure) -> str:
    return "\n".join(text.get_text() for text in figure.findobj(Text))


# runs


def test_some_runs_keep_their_own_samples(runs: xr.Dataset) -> None:
    mask = left_seat(runs)
    assert 10 < mask.sum() < runs.sizes["run"] - 10
    some = chosen(runs, mask)
    for place, number in enumerate(np.flatnonzero(mask)):
        np.testing.assert_array_equal(of(some, place, "x"), of(runs, number, "x"))
        assert float(some["pga"][place]) == float(runs["pga"][number])
    assert some.sizes["sample"] == some["row_size"].sum()


def test_ends_are_last_samples_or_the_start(runs: xr.Dataset) -> None:
    found = ends(runs)
    for number in range(runs.sizes["run"]):
        np.testing.assert_array_equal(found[number], [of(runs, number, n)[-1] for n in "xy"])
    standing = int(np.flatnonzero(~left_seat(runs))[5])
    size = runs["row_size"].values.copy()
    keep = np.repeat(np.arange(len(size)) != standing, size)
    size[standing] = 0
    bare = runs.isel(sample=keep).assign(row_size=("run", size))
    np.testing.assert_array_equal(ends(bare), found)


def test_groups_part_the_runs() -> None:
    both = joined(falls(6, yaw=90.0), falls(8))
    found = dict(groups(both))
    assert list(found) == ["yaw 0 deg", "yaw 90 deg"]
    assert [part.sizes["run"] for part in found.values()] == [64, 36]
    np.testing.assert_array_equal(found["yaw 90 deg"]["x"], falls(6)["x"])
    slippery = both.assign(friction=0.5 * both["friction"])
    names = [name for name, _ in groups(joined(both, slippery))]
    assert names[:2] == ["yaw 0 deg, friction 0.3", "yaw 0 deg, friction 0.6"]


def test_forward_runs_are_those_whose_rest_is_known(runs: xr.Dataset) -> None:
    shift = np.array([5.0, -2.0])
    found = forward([runs, runs], np.array([[0.0, 0.0], shift]))
    stop = runs["stop_reason"].values
    assert set(stop.tolist()) == set(StopReason)
    kept = np.isin(stop, (StopReason.REST, StopReason.LEFT_TERRAIN))
    np.testing.assert_array_equal(np.bincount(found.start), [kept.sum(), kept.sum()])
    np.testing.assert_array_equal(found.pga, np.tile(runs["pga"].values[kept], 2))
    expected = ends(runs)[kept]
    expected[stop[kept] == StopReason.LEFT_TERRAIN] = np.nan
    np.testing.assert_allclose(found.end, np.concatenate([expected, expected + shift]))


# terrain from above


def heights(ground: xr.DataArray, x: Array, y: Array) -> Array:
    """Between the points of the grid; NaN outside."""
    dims = ("row", "column")[: x.ndim]
    found: Array = ground.interp(x=(dims, x), y=(dims, y)).values
    return found


def test_relief_has_the_height_of_the_plane() -> None:
    window = ground_map.Window((-6.0, 10.0), (-8.0, 3.0))
    found = ground_map.relief(plane(), window)
    x, y = np.meshgrid(np.linspace(-3.9, 9.9, 31), np.linspace(-5.9, 2.9, 17))
    np.testing.assert_allclose(heights(found, x, y), -SLOPE * x, atol=1e-4)
    assert np.isnan(heights(found, np.array([-5.0, 5.0]), np.array([0.0, -7.0]))).all()
    assert np.isnan(heights(found, np.array([99.0]), np.array([0.0]))).all()


def test_relief_shows_the_upper_of_two_grounds() -> None:
    lower = plane()
    vertices, faces = lower["terrain_vertex"].values, lower["terrain_face"].values
    roof = vertices[:, :] + [0.0, 0.0, 2.0]
    roof[:, :2] *= 0.25  # over a quarter of the plane only
    both = xr.Dataset(
        {
            "terrain_vertex": (("terrain_corner", "xyz"), np.concatenate([vertices, roof])),
            "terrain_face": (
                ("terrain_face_number", "three"),
                np.concatenate([faces, faces + len(vertices)]),
            ),
        }
    )
    found = ground_map.relief(both, ground_map.Window((-4.0, 10.0), (-6.0, 6.0)))
    shown = heights(found, np.array([0.5, 5.0]), np.array([0.2, 0.2]))
    np.testing.assert_allclose(shown, [2.0 - SLOPE * 2.0, -SLOPE * 5.0], atol=1e-3)


def test_window_holds_its_points_and_is_no_strip() -> None:
    points = np.array([[0.0, 0.0], [20.0, 1.0]])
    window = ground_map.around(points, plane())
    assert window.x[0] < 0.0 < 20.0 < window.x[1]
    assert window.y[0] < 0.0 < 1.0 < window.y[1]
    width, height = window.size
    assert height == pytest.approx(0.6 * width)
    whole = ground_map.around(np.empty((0, 2)), plane())
    assert whole.x[0] < -4.0 < 12.0 < whole.x[1]


# paths


@pytest.mark.slow
def test_every_path_is_drawn_whole(runs: xr.Dataset, ground: xr.Dataset) -> None:
    figure = trajectories(runs, ground, SOURCE)
    fallen = chosen(runs, left_seat(runs))
    lines = artist(figure.axes[0], "paths")
    segments = np.array(lines.get_segments())
    # no line joins two runs, and what is left out cannot be seen
    steps = [np.hypot(np.diff(of(fallen, n, "x")), np.diff(of(fallen, n, "y")))
             for n in range(fallen.sizes["run"])]  # fmt: skip
    drawn = np.linalg.norm(np.diff(segments, axis=1)[:, 0], axis=1)
    assert drawn.sum() == pytest.approx(sum(step.sum() for step in steps), rel=0.01)
    assert drawn.max() < max(step.max() for step in steps) + 0.2
    ends_drawn = {tuple(np.round(end, 9)) for end in segments[:, 1]}
    assert {tuple(np.round(end, 9)) for end in ends(fallen)} <= ends_drawn
    assert lines.get_array().max() <= fallen["speed"].values.max()
    pixel = np.diff(figure.axes[0].get_xlim())[0] / (
        figure.axes[0].get_position().width * 9.4 * 160
    )
    fine = falls(samples=4000)
    many = artist(trajectories(fine, ground, SOURCE).axes[0], "paths").get_segments()
    assert len(many) < 2.5 * sum(step.sum() for step in steps) / (3.0 * pixel)


def test_ranges_of_pga_part_the_paths(runs: xr.Dataset, ground: xr.Dataset) -> None:
    pga = 1.3 * runs["pga"].values  # beyond the last edge
    strong = runs.assign(pga=("run", np.where((pga > 0.7) & (pga <= 0.8), 0.65, pga)))
    figure = trajectories(strong, ground, SOURCE)
    whole, *panels = figure.axes[:5]
    fallen = left_seat(strong)
    assert whole.get_title() == f"all runs that left the seat, N = {fallen.sum()}"
    counts = [int(axes.get_title().split("N = ")[1]) for axes in panels]
    pga = strong["pga"].values[fallen]
    edges = [*PGA_EDGES[:-1], pga.max()]
    assert counts == [
        ((pga > low) & (pga <= high)).sum() for low, high in itertools.pairwise(edges)
    ]
    assert sum(counts) == fallen.sum()
    scales = {id(artist(axes, "paths").norm) for axes in figure.axes[:5] if artists(axes, "paths")}
    assert len(scales) == 1
    for axes, count in zip(panels, counts, strict=True):
        assert len(artists(axes, "empty")) == (count == 0)
    assert 0 in counts


@pytest.mark.parametrize("yaw", [0.0, 90.0, 210.0])
def test_arrow_of_the_shaking(yaw: float, ground: xr.Dataset) -> None:
    figure = trajectories(falls(6, yaw=yaw), ground, SOURCE)
    arrow = artist(figure.axes[0], "shaking")
    along = np.subtract(arrow.xy, arrow.xyann)
    way = np.array([np.cos(np.radians(yaw)), -np.sin(np.radians(yaw))])
    assert abs(along @ way) == pytest.approx(np.hypot(*along))


def test_shaking_along_several_axes_has_no_arrow(ground: xr.Dataset) -> None:
    motion = {"kind": "record", "files": None, "records": [{"file": "one.mseed"}]}
    runs = falls(6).assign_attrs(vsr_config_json=json.dumps({"motion": motion}))
    for figure in (trajectories(runs, ground, SOURCE), end_positions(runs, ground, SOURCE)):
        assert not artists(figure.axes[0], "shaking")


def test_side_view_turns_with_the_site(runs: xr.Dataset) -> None:
    wide = plane(reach=16.0)
    axes = side_view(runs, wide, SOURCE).axes[0]
    base = np.array(artist(axes, "paths").get_segments())
    fallen = chosen(runs, left_seat(runs))
    assert base[:, :, 1].min() == pytest.approx(fallen["z"].values.min())
    middle = ends(fallen).mean(axis=0)
    furthest = (ends(fallen) @ middle / np.hypot(*middle)).max()
    assert base[:, :, 0].max() == pytest.approx(furthest)
    ground = artist(axes, "ground")
    slope = np.polyfit(*ground.get_xydata()[50:-50].T, 1)[0]
    assert slope == pytest.approx(-SLOPE * middle[0] / np.hypot(*middle), rel=1e-3)
    for angle in (0.7, 2.5):
        again = side_view(turned(runs, angle), turned(wide, angle), SOURCE).axes[0]
        segments = np.array(artist(again, "paths").get_segments())
        np.testing.assert_allclose(segments, base, atol=1e-9)


def test_ground_beside_the_paths(runs: xr.Dataset) -> None:
    """On a plane that falls askew the band is as high as the paths are wide, times its slope."""
    askew = 0.5
    fallen = chosen(runs, left_seat(runs))
    axes = side_view(runs, turned(plane(reach=16.0), askew), SOURCE).axes[0]
    middle = ends(fallen).mean(axis=0) / np.hypot(*ends(fallen).mean(axis=0))
    left = np.array([-middle[1], middle[0]])
    low, high = np.percentile(np.append(left @ [fallen["x"], fallen["y"]], 0.0), [2.0, 98.0])
    falls_toward = np.array([np.cos(askew), np.sin(askew)])
    band = artist(axes, "band").get_paths()[0].vertices
    at = np.median(band[:, 0])
    here = np.abs(band[:, 0] - at) < 1e-9
    heights = [-SLOPE * (at * middle + aside * left) @ falls_toward for aside in (low, high)]
    assert band[here, 1].min() == pytest.approx(min(heights), abs=1e-3)
    assert band[here, 1].max() == pytest.approx(max(heights), abs=1e-3)


def test_ends_by_how_the_rock_moved_and_what_ended_the_run(
    runs: xr.Dataset, ground: xr.Dataset
) -> None:
    figure = end_positions(runs, ground, SOURCE)
    stop, movement = runs["stop_reason"].values, runs["movement"].values
    legend = figure.axes[0].get_legend()
    assert legend is not None
    key = {
        text.get_text(): line
        for text, line in zip(legend.texts, legend.legend_handles, strict=True)
    }
    colour = {
        kind: to_rgb(key[f"{kind.words} ({(movement == kind).sum()})"].get_color())  # type: ignore
        for kind in Movement
    }
    assert len(set(colour.values())) == len(Movement)
    for reason in StopReason:
        dots = artist(figure.axes[0], reason.name.lower())
        of_it = stop == reason
        np.testing.assert_allclose(dots.get_offsets(), ends(runs)[of_it])
        assert f"{STOPS[reason]} ({of_it.sum()})" in key
        painted = [tuple(shade[:3]) for shade in dots.get_facecolors()]
        ink = to_rgb(style.INK)
        assert painted == [colour.get(kind, ink) for kind in movement[of_it]]


# way and shaking


def test_lengths_are_where_they_belong(runs: xr.Dataset) -> None:
    figure = trajectory_lengths(runs, SOURCE)
    fallen = overturned_runs(runs)
    for axes, (x, y, colour) in zip(
        figure.axes[:3],
        (
            (fallen.pga, fallen.pgv_pga, fallen.trajectory_length),
            (fallen.pga, fallen.trajectory_length, fallen.pgv_pga),
            (fallen.pgv_pga, fallen.trajectory_length, fallen.pga),
        ),
        strict=True,
    ):
        dots = artist(axes, "runs")
        np.testing.assert_array_equal(dots.get_offsets(), np.column_stack([x, y]))
        np.testing.assert_array_equal(dots.get_array(), colour)
    standing = artist(figure.axes[0], "standing")
    assert len(standing.get_xdata()) == runs.sizes["run"] - len(fallen.pga)


def test_means_and_their_lines(runs: xr.Dataset) -> None:
    figure = ensemble_means(runs, SOURCE)
    for axes, found in zip(figure.axes, correlations(overturned_runs(runs)), strict=True):
        drawn = np.concatenate([artist(axes, gid).get_xydata() for gid in ("means", "single")])
        expected = np.column_stack([found.ensembles.index, found.ensembles["mean"]])
        np.testing.assert_allclose(drawn[np.argsort(drawn[:, 0])], expected)
        x, y = artist(axes, "line").get_data()
        np.testing.assert_allclose(y, found.line.slope * x + found.line.intercept)
        low, high = found.line.band(x[:1])
        band = artist(axes, "band").get_paths()[0].vertices
        at_start = band[band[:, 0] == x[0], 1]
        assert (at_start.min(), at_start.max()) == pytest.approx((low[0], high[0]))
        numbers = artist(axes, "numbers").get_text()
        assert f"R² = {found.line.r2:.2f}" in numbers
        assert power(found.line.p) in numbers


def test_powers_of_ten() -> None:
    assert power(3.21e-22) == "3.2\N{MULTIPLICATION SIGN}10⁻²²"
    assert power(0.043) == "0.043"
    assert power(0.0) == "0"


# the inverse


def test_maps_of_the_origin(runs: xr.Dataset, ground: xr.Dataset) -> None:
    known, found = forward([runs], np.zeros((1, 2))), ObservedBoulder((7.0, 0.0), 0.8)
    origin = trace(known, found)
    figure = origin_maps(origin, known, found, ground, SOURCE)
    motions, places = figure.axes[:2]
    cells = artist(motions, "motions").get_array()
    assert cells.sum() == pytest.approx(100.0)
    undone = int((runs["stop_reason"] == StopReason.UNDONE).sum())
    late = int((runs["stop_reason"] == StopReason.TIME).sum())
    assert np.ma.count_masked(cells) == undone + late
    np.testing.assert_allclose(artist(places, "place").get_xydata(), [found.place])
    assert [ring.radius for ring in artists(places, "reach")] == pytest.approx([0.8, 2.4])
    near = artist(places, "near").get_offsets()
    assert len(near) == origin.near
    assert (np.hypot(*(near - found.place).T) <= 2.4).all()
    assert origin.statement in texts(figure).replace("\n", " ")


def test_region_is_outlined_cell_by_cell(ground: xr.Dataset) -> None:
    """One run near the place: its cell, four sides, around its PGA and PGV/PGA."""
    runs = falls(6)
    known = forward([runs], np.zeros((1, 2)))
    rests = np.flatnonzero(np.hypot(*np.nan_to_num(known.end).T) > 1.0)
    place = known.end[rests[0]]
    found = ObservedBoulder((float(place[0]), float(place[1])), 1e-3)
    figure = origin_maps(trace(known, found), known, found, ground, SOURCE)
    sides = np.array(artist(figure.axes[0], "region").get_segments())
    assert len(sides) == 4
    (left, bottom), (right, top) = sides.min(axis=(0, 1)), sides.max(axis=(0, 1))
    step = runs["pga"].values[1] - runs["pga"].values[0]
    assert right - left == pytest.approx(step)
    assert 0.5 * (left + right) == pytest.approx(known.pga[rests[0]])
    assert bottom < known.pgv_pga[rests[0]] < top


def test_no_answer_shows_no_map(runs: xr.Dataset, ground: xr.Dataset) -> None:
    known, found = forward([runs], np.zeros((1, 2))), ObservedBoulder((-3.0, 5.0), 0.1)
    figure = origin_maps(trace(known, found), known, found, ground, SOURCE)
    assert not artists(figure.axes[0], "motions")
    assert "no answer" in texts(figure)
    assert "No answer: no forward run ends within" in texts(figure)


# all of them


def every_figure(runs: xr.Dataset, ground: xr.Dataset) -> Iterator[Figure]:
    for draw in (trajectories, side_view, end_positions):
        yield draw(runs, ground, SOURCE)
    for draw in (trajectory_lengths, ensemble_means):
        yield draw(runs, SOURCE)
    known, found = forward([runs], np.zeros((1, 2))), ObservedBoulder((5.0, 0.0), 0.3)
    yield origin_maps(trace(known, found), known, found, ground, SOURCE)


@pytest.mark.slow
@pytest.mark.parametrize("least", [0.9, 9.5, 99.0], ids=["many", "one", "none"])
def test_figures_say_whose_terrain_it_is_whatever_they_hold(
    least: float, ground: xr.Dataset
) -> None:
    runs = falls(5, samples=10, least=least)
    assert (least < 1.0) == (left_seat(runs).sum() > 1)
    for figure in every_figure(runs, ground):
        assert [text.get_text() for text in figure.texts if text.get_gid() == "source"] == [SOURCE]
        picture = Image.open(io.BytesIO(style.png(figure)))
        assert 4 * picture.size[0] > 1000


@pytest.mark.slow
def test_text_lies_inside_the_figures(runs: xr.Dataset, ground: xr.Dataset) -> None:
    for figure in every_figure(runs, ground):
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        frame = figure.bbox
        for text in figure.texts:
            assert text.get_window_extent(canvas.get_renderer()).y0 >= frame.y0, text.get_text()
        (note,) = (text for text in figure.texts if text.get_gid() == "source")
        foot = note.get_window_extent(canvas.get_renderer()).y0
        for axes in figure.axes:
            box = axes.get_tightbbox(canvas.get_renderer())
            assert box is None or box.y1 <= foot, axes.get_title()  # however long the note is
            assert box is None or (
                box.x0 >= frame.x0 and box.x1 <= frame.x1 and box.y0 >= frame.y0
                and box.y1 <= frame.y1
            ), axes.get_title()  # fmt: skip


@pytest.mark.slow
def test_a_full_grid_is_drawn_in_seconds() -> None:
    runs, ground = falls(50, 1000, 3.6), plane(bumps=0.2, cells=200)
    start = time.process_time()
    for count, figure in enumerate(every_figure(runs, ground), 1):
        style.png(figure)
        assert time.process_time() - start < 5.0 * count


# the page


class Page(HTMLParser):
    """What a page shows and what it would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.text = ""
        self.cells: list[list[str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag == "tr":
            self.cells.append([])
        if tag in ("td", "th"):
            self.cells[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        if tag == "tr":
            self.cells.append([])

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.cells and self.cells[-1]:
            self.cells[-1][-1] += data.strip()

    @property
    def images(self) -> list[str]:
        return [attrs["src"] for tag, attrs in self.tags if tag == "img"]


def gif() -> bytes:
    with io.BytesIO() as file:
        Image.new("P", (4, 4)).save(file, format="gif")
        return file.getvalue()


HOSTILE = '<img src=x onerror="alert(1)">&'


@pytest.fixture(scope="module")
def text(runs: xr.Dataset, ground: xr.Dataset) -> str:
    """Page of a site with a hostile name, and with all that a page can hold."""
    slots = [
        Slot("Time-lapse", "One fall.", image=style.data_uri(gif(), "gif")),
        Slot("In three dimensions", link="displacement_3d.html"),
    ]
    found = ObservedBoulder((7.0, 0.0), 0.8)
    return page(HOSTILE, runs, ground, SOURCE, found, slots, surrogate=True)


def test_page_holds_all_it_shows(text: str) -> None:
    made = Page(text)
    assert len(made.images) == 4 + 1 + 1 + 1  # of the direction, the ends, the inverse, a slot
    for image in made.images:
        kind, _, data = image.removeprefix("data:image/").partition(";base64,")
        picture = Image.open(io.BytesIO(base64.b64decode(data, validate=True)))
        assert (picture.format or "").lower() == kind
    loads = ("src", "srcset", "data", "poster")
    assert not [
        attrs
        for _, attrs in made.tags
        for name in loads
        if not attrs.get(name, "data:").startswith("data:")
    ]
    links = [attrs["href"] for tag, attrs in made.tags if tag == "a"]
    assert links == ["../index.html", "displacement_3d.html"]
    assert not {"script", "link", "iframe"} & {tag for tag, _ in made.tags}
    assert "url(" not in text
    assert HOSTILE in made.text
    assert all("onerror" not in attrs for _, attrs in made.tags)
    for words in ("One fall.", "Ground motions consistent with the observed boulder"):
        assert words in made.text


def test_page_has_the_numbers(text: str, runs: xr.Dataset) -> None:
    made = Page(text)
    mask = left_seat(runs)
    stop = runs["stop_reason"].values
    median = np.median(runs["trajectory_length"].values[mask])
    rolled, fell, slid = np.bincount(runs["movement"].values[mask], minlength=4)[1:]
    assert len({rolled, fell, slid}) == 3
    assert (
        f"In {mask.sum()} of 144 runs the rock left its seat: {rolled} rolled over, {fell} fell, "
        f"{slid} slid. Medians of these runs: trajectory length {median:.3g} m" in made.text
    )
    cut = int((mask & (stop != StopReason.REST)).sum())
    assert f"{cut} of these runs ended before the rock came to rest" in made.text
    assert "2 of 144 runs are unresolved" in made.text
    counts = {row[0]: row[1:] for row in made.cells if len(row) == 6}
    ways = [f"overturned: {way}" for way in ("rolled over", "fell", "slid")]
    assert counts["how the run ended"] == ["balanced", *ways, "unstable"]
    out = runs["movement"].values[mask & (stop == StopReason.LEFT_TERRAIN)]
    left = [str((out == way).sum()) for way in (1, 2, 3)]
    assert counts["left the terrain"] == ["0", *left, "0"]
    total = [144 - mask.sum() - 2, rolled, fell, slid, 2]
    assert counts["total"] == [str(number) for number in total]
    rows = [row for row in made.cells if row and row[0].startswith("mean ")]
    assert [row[3] for row in rows] == ["0.90", "0.92", "0.82", "0.78", "0.73", "0.87"]
    for row, one in zip(rows, correlations(overturned_runs(runs)), strict=True):
        assert row[2] == f"{one.line.r2:.2g}"
        assert row[4] == power(one.line.p)
        assert row[7] == str(one.line.n_groups)
    origin = trace(forward([runs], np.zeros((1, 2))), ObservedBoulder((7.0, 0.0), 0.8))
    assert origin.statement in made.text
    far = np.hypot(*ends(runs)[mask].T) >= 7.0
    bounds = {row[0]: row[1] for row in made.cells if row and row[0] in ("PGA [g]", "PGV/PGA [s]")}
    assert bounds["PGA [g]"] == f"{runs['pga'].values[mask][far].min():.3g}"
    assert bounds["PGV/PGA [s]"] == f"{runs['pgv_pga'].values[mask][far].min():.3g}"


@pytest.mark.slow
def test_page_says_what_the_terrain_is(runs: xr.Dataset, ground: xr.Dataset) -> None:
    warning = "This is a surrogate terrain, not a scan."
    few = chosen(runs, runs["pga"].values > 0.9)
    assert warning in page("rock", few, ground, "Terrain of Double Rock", surrogate=True)
    scanned = page("rock", few, ground, "scan of a slope", surrogate=False)
    assert warning not in scanned
    assert "surrogate" not in scanned.lower()
    assert "No observed fallen rock was given:" in scanned


@pytest.mark.slow
def test_page_of_directions_that_topple_nothing(ground: xr.Dataset) -> None:
    both = joined(falls(4, 5, least=99.0), falls(4, 5, least=99.0, yaw=90.0))
    made = Page(
        page("rock", both, ground, SOURCE, ObservedBoulder((7.0, 0.0), 0.8), surrogate=True)
    )
    assert "In none of 32 runs did the rock leave its seat" in made.text
    assert "yaw 90 deg: the rock left its seat in 0 of 16 runs" in made.text
    assert "No line: no run overturned." in made.text
    assert "No answer" in made.text
    assert "nan" not in made.text.lower()


# names and units


def test_catalogue_knows_the_datasets() -> None:
    units = {
        **dict.fromkeys(("terrain_vertex", "x", "y", "z", "trajectory_length"), "m"),
        **dict.fromkeys(("terminal_distance",), "m"),
        **dict.fromkeys(("largest_speed", "velocity", "speed"), "m s-1"),
        "angular_velocity": "rad s-1",
        "time": "s",
        **dict.fromkeys(("terrain_face", "run", "row_size", "stop_reason", "contact"), "1"),
        **dict.fromkeys(("quaternion", "outcome", "steps", "friction"), "1"),
        "yaw": "degree",
        "pga": "g",
        "pgv_pga": "s",
    }
    for name, unit in units.items():
        assert catalogue()[name]["units"] == unit, name
        assert catalogue()[name]["long_name"], name
    assert "95" not in catalogue()["bound"]["long_name"]  # intervals are of 95 or of 90 %
    assert getattr(outcome, catalogue()["stop_reason"]["flags"]) is StopReason
