"""`vsr run displacement` on a small scan: trajectories, correlations, and Table 1 on its page.

Everything that the products say of the runs is computed again from the samples in
``displacement.nc``, by other means.
"""

from __future__ import annotations

import csv
import json
import math
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import rankdata
from support.small_scan import FAR, survey, tapered, write_ply

from pipeline import cli
from pipeline.drawing import style
from pipeline.stages.displacement import timelapse
from pipeline.stages.mesh import scan_figures
from pipeline.workflow.datasets import read
from vsr_core.outcome import Outcome

Array = NDArray[np.float64]

SITE = """
rock: {shape: mesh, mesh: scan.ply, density: 2000}
pedestal: {shape: mesh, cut: {kind: plane, point: POINT, normal: NORMAL}}
motion: {pga: [0.01, 0.9, 1.0, 1.2], pgv_pga: [0.2, 0.25, 0.35]}
yaw: 40
simulation: {time_step: 0.0015}
"""
EMPTY = Figure(figsize=(0.1, 0.1))
"""In place of pictures that have tests of their own."""

STATISTICS = ("trajectory_length", "largest_speed", "terminal_distance")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, few_samples: None) -> Path:
    """Products of twelve runs on a small site."""
    place = tmp_path_factory.mktemp("hill")
    write_ply(place / "scan.ply", survey(), FAR)
    up = tapered().up
    point, normal = str((FAR + 0.02 * up).tolist()), str(up.tolist())
    site = SITE.replace("POINT", point).replace("NORMAL", normal)
    (place / "hill.yaml").write_text(site)
    line = ["run", "displacement", "--site", str(place / "hill.yaml"), "--workers", "0"]
    with pytest.MonkeyPatch.context() as patch:
        for name in ("separation", "closed_rock", "seat"):  # of the page of the scan
            patch.setattr(scan_figures, name, lambda *given: EMPTY)
        patch.setattr(timelapse, "timelapse", lambda *given: EMPTY)
        patch.setattr(timelapse, "animation", lambda *given: style.png(EMPTY))
        assert cli.main([*line, "--derived", str(place / "derived")]) == cli.DONE
    return place / "derived" / "hill"


@pytest.fixture(scope="module")
def runs(folder: Path) -> xr.Dataset:
    return read(folder / "displacement.nc")


def tracks(runs: xr.Dataset) -> list[xr.Dataset]:
    """Samples of each run."""
    ends = np.cumsum(runs["row_size"].values)
    assert ends[-1] == runs.sizes["sample"]
    return [
        runs.isel(sample=slice(end - size, end))
        for end, size in zip(ends, runs["row_size"].values, strict=True)
    ]


def place(track: xr.Dataset) -> Array:
    return np.column_stack([track[axis].values.astype(float) for axis in "xyz"])


def toppled(runs: xr.Dataset) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = runs["outcome"].values == Outcome.OVERTURNED
    return found


def test_every_cell_has_a_run_of_its_own(runs: xr.Dataset) -> None:
    cells = list(zip(runs["pgv_pga"].values.tolist(), runs["pga"].values.tolist(), strict=True))
    expected = [(r, a) for r in (0.2, 0.25, 0.35) for a in (0.01, 0.9, 1.0, 1.2)]
    np.testing.assert_allclose(cells, expected)
    assert (runs["yaw"] == 40.0).all()
    assert runs["pga"].attrs["units"] == "g"
    assert runs["pgv_pga"].attrs["units"] == "s"
    weak = runs["pga"].values < 0.1
    assert not toppled(runs)[weak].any()
    assert toppled(runs)[~weak].sum() >= 7  # enough for lines
    strongest = toppled(runs)[runs["pga"].values == 1.2]
    assert strongest.all()


def test_a_trajectory_begins_on_the_seat_and_goes_the_way_of_its_velocity(runs: xr.Dataset) -> None:
    for track, fell in zip(tracks(runs), toppled(runs), strict=True):
        time, path = track["time"].values, place(track)
        turn = Rotation.from_quat(track["quaternion"].values)  # x y z w
        assert time[0] == 0.0
        assert (np.diff(time) > 0.0).all()
        assert np.hypot(*path[0, :2]) < 0.05
        assert turn[0].magnitude() < math.radians(5.0)
        upward = turn.apply([0.0, 0.0, 1.0])[:, 2]
        assert (upward.min() < math.cos(0.7)) == fell
        speed = np.linalg.norm(track["velocity"].values, axis=1)
        np.testing.assert_allclose(track["speed"].values, speed, rtol=1e-5, atol=1e-6)
        if len(time) > 2:
            mean = 0.5 * (track["velocity"].values[1:] + track["velocity"].values[:-1])
            moved = path[0] + np.cumsum(mean * np.diff(time)[:, None], axis=0)
            assert np.linalg.norm(moved - path[1:], axis=1).max() < 0.1


def test_statistics_are_those_of_the_samples(runs: xr.Dataset) -> None:
    for number, track in enumerate(tracks(runs)):
        path = place(track)
        steps = path[1:] - path[:-1]
        run = runs.isel(run=number)
        length = float(np.sqrt((steps**2).sum(axis=1)).sum())
        assert float(run["trajectory_length"]) == pytest.approx(length, rel=1e-6, abs=1e-9)
        fastest = float(track["speed"].max())
        assert float(run["largest_speed"]) == pytest.approx(fastest, rel=1e-6)
        apart = math.dist(path[0], path[-1])
        assert float(run["terminal_distance"]) == pytest.approx(apart, rel=1e-6, abs=1e-9)


def test_each_rock_that_left_its_seat_rolled_over_fell_or_slid(
    folder: Path, runs: xr.Dataset
) -> None:
    """By the tilts and heights of the samples, and the angles of ``rock.nc``."""
    rock = read(folder / "rock.nc")
    radius = np.linalg.norm(rock["vertex"].values, axis=1).max()
    limit = math.radians(float(rock["tipping_angle"].max()))
    limit = min(limit, rock.attrs["barrier_toppled_tilt"])
    left = {"rolled_over": 0, "fell": 0, "slid": 0}
    for number, (track, overturned) in enumerate(zip(tracks(runs), toppled(runs), strict=True)):
        run = runs.isel(run=number)
        up = Rotation.from_quat(track["quaternion"].values).inv().apply([0.0, 0.0, 1.0])
        tilt = math.acos(np.clip((up @ up[0]).min(), -1.0, 1.0))
        assert float(run["largest_tilt"]) > tilt - 1e-3  # it is looked at more often than kept
        flags = dict(
            zip(run["movement"].flag_values, run["movement"].flag_meanings.split(), strict=True)
        )
        told = flags[int(run["movement"])]
        if not overturned:
            assert told == ("slid" if int(run["outcome"]) == Outcome.DISPLACED else "stayed")
            continue
        left[told] += 1
        z, flies = track["z"].values.astype(float), track["contact"].values == 0
        end = np.flatnonzero(z[0] - z > 0.116 * radius)[:1].sum()
        sunk_in_air = sum(z[k - 1] - z[k] for k in range(1, end + 1) if flies[k])
        if tilt > limit:
            assert told == "rolled_over"
        else:
            assert told == ("fell" if sunk_in_air >= 0.5 * (z[0] - z[end]) else "slid")
    with (folder / "correlation.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            assert {way: int(row[f"n_{way}"]) for way in left} == left


def correlated(runs: xr.Dataset, statistic: str, regressor: str) -> dict[str, float]:
    """A line through the means of the runs that have one value of the regressor."""
    fell = toppled(runs)
    x, y = (runs[name].values[fell].astype(float) for name in (regressor, statistic))
    values = sorted(set(x.tolist()))
    means = np.array([y[x == value].mean() for value in values])
    slope, intercept = np.polyfit(values, means, 1)
    between = sum((x == v).sum() * (m - y.mean()) ** 2 for v, m in zip(values, means, strict=True))
    share = between / ((y - y.mean()) ** 2).sum()
    return {
        "n_groups": len(values),
        "n_runs": fell.sum(),
        "slope": slope,
        "intercept": intercept,
        "r2": np.corrcoef(values, means)[0, 1] ** 2,
        "spearman": np.corrcoef(rankdata(values), rankdata(means))[0, 1],
        "spearman_runs": np.corrcoef(rankdata(x), rankdata(y))[0, 1],
        "variance_between": share,
        "variance_within": 1.0 - share,
    }


def test_the_table_of_correlations_is_that_of_the_runs(folder: Path, runs: xr.Dataset) -> None:
    with (folder / "correlation.csv").open(newline="") as file:
        rows = {(row["statistic"], row["regressor"]): row for row in csv.DictReader(file)}
    assert set(rows) == {(s, r) for s in STATISTICS for r in ("pga", "pgv_pga")}
    for (statistic, regressor), row in rows.items():
        for name, value in correlated(runs, statistic, regressor).items():
            assert float(row[name]) == pytest.approx(value, rel=1e-4, abs=1e-6), (statistic, name)
        unit = runs[statistic].attrs["units"]
        assert row["intercept_unit"] == unit
        assert row["slope_unit"] == unit + {"pga": " g-1", "pgv_pga": " s-1"}[regressor]


class Tables(HTMLParser):
    """Cells of the tables of a page, row by row."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.inside = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "tr":
            self.rows.append([])
        self.inside = tag in ("td", "th")
        if self.inside:
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        self.inside &= tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.rows[-1][-1] += data.strip()


def test_table_1_of_the_page_is_that_of_the_runs(folder: Path, runs: xr.Dataset) -> None:
    rows = Tables((folder / "displacement.html").read_text(encoding="utf-8")).rows
    head = next(row for row in rows if row[:2] == ["statistic", "against"])
    at = {name: head.index(name) for name in ("R²", "slope", "ensembles", "η²")}
    shown = [row for row in rows if row and row[0].startswith("mean ")]
    assert len(shown) == 6
    for (statistic, regressor), row in zip(
        ((s, r) for s in STATISTICS for r in ("pga", "pgv_pga")), shown, strict=True
    ):
        found = correlated(runs, statistic, regressor)
        assert row[0].split()[1] == statistic.split("_")[0]
        assert row[1].startswith("PGV/PGA [s]" if regressor == "pgv_pga" else "PGA [g]")
        numbers = {name: float(row[k].replace("\N{MINUS SIGN}", "-")) for name, k in at.items()}
        assert numbers["R²"] == pytest.approx(found["r2"], abs=0.006)
        assert numbers["slope"] == pytest.approx(found["slope"], rel=0.006)
        assert numbers["ensembles"] == found["n_groups"]
        assert numbers["η²"] == pytest.approx(found["variance_between"], abs=0.006)


def test_the_page_counts_the_runs_beside_the_scene(folder: Path, runs: xr.Dataset) -> None:
    page = (folder / "displacement.html").read_text(encoding="utf-8")
    assert f"In <strong>{toppled(runs).sum()}</strong> of 12 runs the rock left its seat" in page
    assert (folder / "trajectories.html").stat().st_size > 10_000


def last_places(runs: xr.Dataset) -> Array:
    return np.array([place(track)[-1] for track in tracks(runs)])


def test_the_model_shows_each_rock_where_it_came_to_lie(folder: Path, runs: xr.Dataset) -> None:
    """Bodies of a file of glTF, whose y is up, in poses of the dataset."""
    line = ["run", "model", "--site", str(folder.parents[1] / "hill.yaml"), "--workers", "0"]
    assert cli.main([*line, "--derived", str(folder.parent)]) == cli.DONE
    scene = trimesh.load_scene(folder / "model.glb")
    ground = read(folder / "terrain.nc")["terrain_vertex"].values
    shown = {name: scene.geometry[part] for name, (_, part) in posed(scene).items()}
    lain = trimesh.transform_points(shown["terrain"].vertices, posed(scene)["terrain"][0])
    np.testing.assert_allclose(lain, ground[:, [0, 2, 1]] * [1, 1, -1], atol=1e-5)
    found = {name: pose for name, (pose, _) in posed(scene).items() if name.startswith("run ")}
    left = np.flatnonzero(toppled(runs))
    assert len(found) == len(left) > 0
    for run in left:
        (pose,) = (pose for name, pose in found.items() if name.startswith(f"run {run}:"))
        x, y, z = last_places(runs)[run]
        np.testing.assert_allclose(pose[:3, 3], (x, z, -y), atol=1e-5)
        turn = Rotation.from_quat(tracks(runs)[run]["quaternion"].values[-1])
        about_x = Rotation.from_euler("x", -90, degrees=True)
        np.testing.assert_allclose(pose[:3, :3], (about_x * turn).as_matrix(), atol=1e-5)


def posed(scene: trimesh.Scene) -> dict[str, tuple[Array, str]]:
    return {name: scene.graph.get(name) for name in scene.graph.nodes_geometry}


def test_ends_and_paths_lie_on_the_map_where_they_lay(folder: Path, runs: xr.Dataset) -> None:
    """On the central meridian of a zone of UTM, near the equator, where its scale is 0.9996."""
    pyogrio = pytest.importorskip("pyogrio", reason="needs the extra gis")
    pytest.importorskip("pyproj", reason="needs the extra gis")
    x, y, z = read(folder / "terrain.nc").attrs["origin_in_scan"].tolist()
    origin = [500_000.0 - x, -y, 700.0 - z]  # of the scan: the site's is on the equator
    line = ["run", "geodata", "--site", str(folder.parents[1] / "hill.yaml"), "--workers", "0"]
    line += ["--set", "georeference.crs=EPSG:32611", "--set", f"georeference.origin={origin}"]
    assert cli.main([*line, "--derived", str(folder.parent)]) == cli.DONE
    ends = json.loads((folder / "end_positions.geojson").read_text(encoding="utf-8"))["features"]
    at = np.array([end["geometry"]["coordinates"] for end in ends])
    east = np.radians(at[:, 0] + 117.0) * EQUATOR * 0.9996
    north = np.radians(at[:, 1]) * EQUATOR * (1.0 - ECCENTRICITY_2) * 0.9996
    found = np.column_stack([east, north, at[:, 2] - 700.0])
    np.testing.assert_allclose(found, last_places(runs), atol=2e-3)
    yaws = [end["properties"]["yaw_deg"] for end in ends]
    assert yaws == runs["yaw"].values.tolist()
    about, _, lines, columns = pyogrio.raw.read(folder / "displacement.gpkg", layer="trajectories")
    assert about["crs"] == "EPSG:32611"
    for run, path in zip(columns[0], shapely.from_wkb(lines), strict=True):
        own = np.add(place(tracks(runs)[run]), (500_000.0, 0.0, 700.0))
        np.testing.assert_allclose(shapely.get_coordinates(path, include_z=True), own, atol=1e-4)


@pytest.mark.parametrize("east", [500_000.0 + 2_000_000.0, 1e7])
def test_a_place_where_its_system_does_not_hold_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], east: float
) -> None:
    """The rock's scan has coordinates of its own; an origin beside them counts twice."""
    pytest.importorskip("pyproj", reason="needs the extra gis")
    line = ["run", "geodata", "--site", str(folder.parents[1] / "hill.yaml"), "--workers", "0"]
    line += ["--set", "georeference.crs=EPSG:32611", "--set", f"georeference.origin={[east, 0, 0]}"]
    assert cli.main([*line, "--derived", str(folder.parent)]) == cli.REFUSED
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("vsr: ")]
    (refusal,) = told
    assert "georeference.origin: got a rock at longitude" in refusal


@pytest.mark.parametrize(("north", "code"), [(0.0, cli.DONE), (5_621_521.0, cli.REFUSED)])
def test_a_system_holds_where_its_metres_are_metres(
    folder: Path, capsys: pytest.CaptureFixture[str], north: float, code: int
) -> None:
    """Mercator's, of the whole world: at the equator, and at 45 degrees north."""
    pytest.importorskip("pyproj", reason="needs the extra gis")
    line = ["run", "geodata", "--site", str(folder.parents[1] / "hill.yaml"), "--workers", "0"]
    line += ["--set", "georeference.crs=EPSG:3857"]
    x, y, _ = read(folder / "terrain.nc").attrs["origin_in_scan"].tolist()
    line += ["--set", f"georeference.origin={[-13_024_380.0 - x, north - y, 0.0]}"]
    assert cli.main([*line, "--derived", str(folder.parent)]) == code
    assert ("in which a metre on the ground at" in capsys.readouterr().err) == bool(north)


@pytest.mark.parametrize(
    ("crs", "east", "north"),
    [("EPSG:31281", 0.0, 5_230_000.0), ("EPSG:27572", 653_000.0, 2_626_000.0)],
)
def test_a_system_may_have_a_meridian_and_an_angle_of_its_own(
    folder: Path, crs: str, east: float, north: float
) -> None:
    """Austria's of Ferro, on its central meridian; and at Lille France's in grads, 0.2 % off."""
    pytest.importorskip("pyproj", reason="needs the extra gis")
    x, y, z = read(folder / "terrain.nc").attrs["origin_in_scan"].tolist()
    line = ["run", "geodata", "--site", str(folder.parents[1] / "hill.yaml"), "--workers", "0"]
    line += ["--set", f"georeference.crs={crs}"]
    line += ["--set", f"georeference.origin={[east - x, north - y, 700.0 - z]}"]
    assert cli.main([*line, "--derived", str(folder.parent)]) == cli.DONE


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:99999999", "EPSG:2229", "EPSG:2053", "UTM 11"])
def test_what_is_no_system_of_metres_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], crs: str
) -> None:
    pytest.importorskip("pyproj", reason="needs the extra gis")
    line = ["run", "geodata", "--site", str(folder.parents[1] / "hill.yaml"), "--workers", "0"]
    line += ["--derived", str(folder.parent / "none"), "--set", f"georeference.crs={crs}"]
    assert cli.main(line) == cli.REFUSED
    told = capsys.readouterr().err
    assert told.startswith("vsr: --set: georeference.crs: got ")
    assert told.count("\n") == 1
    assert not (folder.parent / "none").exists()


EQUATOR, ECCENTRICITY_2 = 6_378_137.0, 0.00669437999014
"""Of the ellipsoid of WGS 84: radius [m] of its equator, and its first eccentricity squared."""
