"""Pictures of motion: the depth buffer by its definition, shadows and views by geometry."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
import trimesh
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from numpy.typing import NDArray
from PIL import Image
from support import tumbling

from pipeline.drawing import rendering, style
from pipeline.drawing.painting import backdrop, painted, smaller
from pipeline.drawing.rendering import clearest, depths_of, drawn, faces_of
from pipeline.drawing.view import View, axes_of, fitted, round_number
from pipeline.stages.displacement import timelapse
from pipeline.stages.displacement.timelapse import SPEEDS, Track, pose_times, track

Array = NDArray[np.float64]
ANGLE = st.floats(-7.0, 7.0)
HIGH = st.floats(-1.5, 1.5)


def plane(half: float, cells: int = 1, level: float = 0.0) -> tuple[Array, NDArray[np.int64]]:
    """Level square of ground around the origin."""
    side = np.linspace(-half, half, cells + 1)
    x, y = np.meshgrid(side, side, indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return np.stack([x, y, np.full_like(x, level)], axis=-1).reshape(-1, 3), faces


def joined(*meshes: tuple[Array, NDArray[np.int64]]) -> tuple[Array, NDArray[np.int64]]:
    whole = trimesh.util.concatenate([trimesh.Trimesh(*mesh, process=False) for mesh in meshes])
    return np.array(whole.vertices), np.array(whole.faces)


def block(size: tuple[float, float, float], centre: tuple[float, float, float]):  # type: ignore[no-untyped-def]
    mesh = trimesh.creation.box(size)
    return np.array(mesh.vertices) + centre, np.array(mesh.faces)


@given(ANGLE, HIGH)
@settings(max_examples=30, deadline=None, derandomize=True)
def test_view_is_a_right_handed_frame_in_which_z_stays_upright(
    azimuth: float, elevation: float
) -> None:
    axes = axes_of(azimuth, elevation)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-12)
    assert axes[0, 2] == 0.0
    assert axes[1, 2] > 0.0
    assert axes[2, 2] == pytest.approx(math.sin(elevation))
    assert math.atan2(axes[2, 1], axes[2, 0]) == pytest.approx(
        math.atan2(math.sin(azimuth), math.cos(azimuth)), abs=1e-9
    )


def test_from_the_south_east_is_right_and_north_is_far() -> None:
    view = View(axes_of(-0.5 * math.pi, 0.0), np.zeros(3), 0.5, (20, 40))
    seen = view.project(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]))
    np.testing.assert_allclose(
        seen, [[20, 10, 0], [22, 10, 0], [20, 10, -1], [20, 8, 0]], atol=1e-12
    )


@given(ANGLE, HIGH, st.integers(0, 799))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_points_of_pixels_project_to_their_middle(azimuth: float, high: float, pixel: int) -> None:
    view = View(axes_of(azimuth, high), np.array([3.0, -1.0, 2.0]), 0.1, (20, 40))
    point = view.points(np.array([pixel]), np.array([1.7]))
    expected = [pixel % 40 + 0.5, pixel // 40 + 0.5, 1.7]
    np.testing.assert_allclose(view.project(point)[0], expected, atol=1e-9)


@given(ANGLE, HIGH, st.integers(0, 10_000))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_a_fitted_view_holds_all_points_and_wastes_nothing(
    azimuth: float, high: float, seed: int
) -> None:
    points = np.random.default_rng(seed).normal(size=(30, 3)) * [9.0, 2.0, 1.0]
    seen = fitted(axes_of(azimuth, high), points, (90, 160), 0.1).project(points)[:, :2]
    free = np.array([seen.min(axis=0), [160.0, 90.0] - seen.max(axis=0)])
    assert (free > 9.0 - 1e-6).all()
    assert free.min() == pytest.approx(9.0)
    np.testing.assert_allclose(free[0], free[1])


def by_definition(view: View, vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, Array]:
    """Nearest face and depth of each pixel by barycentric coordinates; -2 where sides decide."""
    rows, columns = view.shape
    row, column = np.divmod(np.arange(rows * columns), columns)
    best, depth = np.full(rows * columns, -1), np.full(rows * columns, -np.inf)
    unsure = np.zeros(rows * columns, dtype=bool)
    for number, corners in enumerate(view.project(vertices)[faces]):
        matrix = np.vstack([corners[:, :2].T, np.ones(3)])
        if np.linalg.det(matrix) >= 0.0:  # rows run downwards
            continue
        weights = np.linalg.solve(matrix, [column + 0.5, row + 0.5, np.ones(len(row))])
        inside = (weights > 0.0).all(axis=0)
        unsure |= (np.abs(weights) < 1e-6).any(axis=0) & (weights > -1e-5).all(axis=0)
        here = corners[:, 2] @ weights
        unsure |= inside & (np.abs(here - depth) < 1e-3)
        nearer = inside & (here > depth)
        best[nearer], depth[nearer] = number, here[nearer]
    best[unsure] = -2
    return best, depth


@pytest.mark.parametrize("fragments", [50, rendering._FRAGMENTS])
def test_each_pixel_shows_the_nearest_face_that_looks_at_the_eye(
    fragments: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rendering, "_FRAGMENTS", fragments)
    random = np.random.default_rng(5)
    vertices = random.normal(size=(60, 3))
    faces = random.permutation(np.arange(60)).reshape(-1, 3)
    view = View(axes_of(0.7, 0.4), np.zeros(3), 0.045, (48, 64))  # some stick out on all sides
    buffer = drawn(view, vertices, faces)
    expected, depth = by_definition(view, vertices, faces)
    sure = expected != -2
    assert (expected >= 0).mean() > 0.3
    assert sure.mean() > 0.95
    filled = buffer != rendering._EMPTY
    np.testing.assert_array_equal(filled[sure], expected[sure] >= 0)
    both = sure & filled
    np.testing.assert_array_equal(faces_of(buffer[both]), expected[both])
    np.testing.assert_allclose(depths_of(buffer[both]), depth[both], atol=1e-5)


def test_faces_that_meet_leave_no_hole_and_the_back_is_not_drawn() -> None:
    view = View(axes_of(0.3, 1.0), np.zeros(3), 0.1, (60, 60))
    vertices, faces = plane(20.0, 23)
    assert (drawn(view, vertices, faces) != rendering._EMPTY).all()
    assert (drawn(view, vertices, faces[:, ::-1]) == rendering._EMPTY).all()


def test_a_mesh_drawn_onto_another_hides_it_only_where_it_is_nearer() -> None:
    view = View(axes_of(0.0, 1.4), np.zeros(3), 0.1, (40, 40))
    ground = drawn(view, *plane(5.0))
    low, high = plane(1.0, level=-0.5), plane(1.0, level=0.5)
    np.testing.assert_array_equal(drawn(view, *low, ground), ground)
    above = drawn(view, *high, ground)
    changed = above != ground
    assert 0.7 * 400 < changed.sum() < 1.1 * 400
    assert (faces_of(above[changed]) >= rendering.LATER).all()


def test_a_shadow_is_as_long_as_the_block_is_high_under_a_sun_at_45_degrees() -> None:
    view = View(axes_of(-0.5 * math.pi, math.radians(60.0)), np.zeros(3), 0.02, (400, 500))
    sun = axes_of(math.pi, math.radians(45.0))  # from -x
    corners = np.array([[-1.0, -1, 0], [3, 1, 2]])
    behind = backdrop(view, sun, plane(10.0), corners, contour=50.0)
    vertices, faces = block((0.5, 1.0, 1.5), (0.0, 0.0, 0.75))
    picture = painted(behind, vertices[None], faces, np.array([[1.0, 0.0, 0.0]]))

    def at(x: float, y: float, z: float = 0.0) -> Array:
        column, row, _ = view.project(np.array([x, y, z]))
        return picture[int(row), int(column)]

    lit, dark = at(-1.0, 0.0), at(1.0, 0.0)
    assert dark.max() < 0.75 * lit.min()
    for x, y, shaded in (
        (0.3, 0.0, True),
        (1.70, 0.0, True),
        (1.80, 0.0, False),  # 0.25 + 1.5 from the axis of the block
        (1.0, 0.45, True),
        (1.0, 0.55, False),
        (1.0, -0.45, True),
        (1.0, -0.55, False),
        (-0.4, 0.0, False),
    ):
        np.testing.assert_allclose(at(x, y), dark if shaded else lit, atol=1e-6, err_msg=f"{x} {y}")
    front, top = at(0.0, -0.5, 0.7), at(0.0, 0.0, 1.5)
    assert front[1] == top[1] == 0.0  # its own colour
    assert top[0] > front[0]  # the sun reaches the top and only grazes the front


def test_smaller_keeps_means() -> None:
    picture = np.random.default_rng(1).random((6, 9, 3))
    small = smaller(picture, 3)
    assert small.shape == (2, 3, 3)
    np.testing.assert_allclose(small[1, 2], picture[3:, 6:].mean(axis=(0, 1)))


def test_thinning_keeps_the_shape() -> None:
    vertices, faces = plane(10.0, 60, level=2.0)
    fewer_vertices, fewer_faces = rendering.thinned(vertices, faces, 1_000)
    assert len(fewer_faces) <= 1_000
    np.testing.assert_allclose(fewer_vertices[:, 2], 2.0)
    area = 0.5 * np.linalg.det(fewer_vertices[fewer_faces] - [0.0, 0.0, 1.0])  # level, at z = 1
    assert (area > 0.0).all()  # none turned over
    assert area.sum() == pytest.approx(400.0, rel=0.15)
    same = rendering.thinned(vertices, faces, len(faces))
    assert same[0] is vertices


@pytest.mark.parametrize(("value", "expected"), [(1.0, 1.0), (1.99, 1.0), (0.021, 0.02), (73, 50)])
def test_round_numbers(value: float, expected: float) -> None:
    assert round_number(value) == pytest.approx(expected)


def test_the_eye_goes_to_the_side_from_which_the_path_is_seen() -> None:
    path = np.column_stack([np.linspace(0.0, 6.0, 30), np.zeros(30), np.full(30, 0.5)])
    way = np.array([1.0, 0.0])
    open_ground = plane(20.0, 8)
    azimuth, elevation = clearest(open_ground, path, 0.5, way)
    assert math.degrees(azimuth) == pytest.approx(-90.0)  # the way runs to the right
    south = joined(open_ground, block((30.0, 1.0, 12.0), (3.0, -3.0, 0.0)))
    azimuth, elevation = clearest(south, path, 0.5, way)
    assert math.sin(azimuth) > 0.5
    view = fitted(axes_of(azimuth, elevation), path, (90, 160), 0.1)
    assert rendering.in_sight(view, drawn(view, *south), path).all()
    from_south = fitted(axes_of(-0.5 * math.pi, elevation), path, (90, 160), 0.1)
    assert not rendering.in_sight(from_south, drawn(from_south, *south), path).any()


# ---- One run


@pytest.fixture(scope="module")
def displacement() -> xr.Dataset:
    return tumbling.displacement(runs=3, samples=120)


@pytest.fixture(scope="module")
def terrain() -> xr.Dataset:
    return tumbling.terrain()


def test_a_track_is_its_run(displacement: xr.Dataset) -> None:
    motion = track(displacement, 2)
    start = int(displacement["row_size"][:2].sum())
    assert len(motion.time) == int(displacement["row_size"][2])
    assert motion.position[5, 2] == float(displacement["z"][start + 5])
    vertices = np.array(tumbling.rock()["surface_vertex"], dtype=float)
    x, y, z, w = displacement["quaternion"].values[start + 40]
    matrix = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    expected = vertices @ matrix.T + motion.position[40]
    np.testing.assert_allclose(motion.poses(motion.time[[40]], vertices)[0], expected, atol=1e-12)


@given(st.floats(0.0, 4.0))
@settings(max_examples=20, deadline=None, derandomize=True)
def test_poses_between_samples_are_rigid_and_on_the_way(time: float) -> None:
    motion = track(tumbling.displacement(runs=2, samples=60), 2)
    vertices = np.array(tumbling.rock()["surface_vertex"], dtype=float)
    pose = motion.poses(np.array([time]), vertices)[0]
    apart = np.linalg.norm(pose[:, None] - pose[None], axis=-1)
    np.testing.assert_allclose(
        apart, np.linalg.norm(vertices[:, None] - vertices[None], axis=-1), atol=1e-9
    )
    np.testing.assert_allclose(pose.mean(axis=0), motion.places(np.array([time]))[0], atol=1e-9)


def test_poses_stand_apart_from_start_to_end(displacement: xr.Dataset) -> None:
    motion = track(displacement, 3)
    times = pose_times(motion, 0.8)
    assert times[0] == motion.time[0]
    assert times[-1] == motion.time[-1]
    assert (np.diff(times) > 0.0).all()
    gaps = np.linalg.norm(np.diff(motion.places(times), axis=0), axis=1)
    assert 4 <= len(times) <= 12
    assert gaps.min() > 0.6 * 0.8
    assert gaps.max() < 3.0 * 0.8
    still = Track(motion.time[:2], motion.position[[0, 0]], motion.turn[:2], np.zeros(2))
    np.testing.assert_array_equal(pose_times(still, 0.8), still.time)


def artist(figure: Figure, gid: str):  # type: ignore[no-untyped-def]
    return [part for part in figure.findobj() if part.get_gid() == gid]


@pytest.fixture(scope="module")
def pictured(displacement: xr.Dataset, terrain: xr.Dataset) -> tuple[Figure, View]:
    """A figure and its view."""
    views, scene = [], timelapse._scene

    def seen(*given: object) -> object:
        made = scene(*given)  # type: ignore[arg-type]
        views.append(made.behind.view)
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timelapse, "_scene", seen)
        rock, source = tumbling.rock(), "surrogate <of> both"
        return timelapse.timelapse(displacement, terrain, rock, 2, source), views[0]


@pytest.fixture(scope="module")
def figure(pictured: tuple[Figure, View]) -> Figure:
    return pictured[0]


@pytest.fixture(scope="module")
def view(pictured: tuple[Figure, View]) -> View:
    return pictured[1]


def test_the_picture_is_1600_pixels_wide(figure: Figure, full_pictures: None) -> None:
    picture = Image.open(io.BytesIO(style.png(figure)))
    assert picture.size == (1600, 1070)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timelapse, "WIDTH", 400)
    monkeypatch.setattr(timelapse, "HEIGHT", 225)


def test_the_picture_is_always_the_same(
    displacement: xr.Dataset, terrain: xr.Dataset, small: None
) -> None:
    one, again = (
        style.png(timelapse.timelapse(displacement, terrain, tumbling.rock(), 2, "surrogate"))
        for _ in range(2)
    )
    assert one == again


def test_words_say_the_run(figure: Figure) -> None:
    words = " ".join(part.get_text() for part in figure.findobj(Text))
    for said in ("PGA 0.5 g", "PGV/PGA 0.25 s", "yaw 30°", "friction 0.6", "surrogate <of> both",
                 "m/s", "rest after 4.30 s", "start, 0.00 s", "end, 4.30 s"):  # fmt: skip
        assert said in words


def test_no_words_overlap(figure: Figure) -> None:
    figure.set_dpi(style.DPI)
    figure.draw_without_rendering()
    boxes = [
        part.get_window_extent()
        for part in figure.findobj(Text)
        if part.get_text() and part.get_visible() and part.get_gid() != "time"
    ]
    assert len(boxes) > 12
    for number, one in enumerate(boxes):
        assert not [box for box in boxes[number + 1 :] if box.padded(-2).overlaps(one.padded(-2))]


def test_path_scale_and_arrow_are_where_the_view_puts_them(
    figure: Figure, displacement: xr.Dataset, view: View
) -> None:
    motion = track(displacement, 2)
    (path,) = artist(figure, "path")
    assert isinstance(path, LineCollection)
    pieces = np.array(path.get_segments())
    seen = view.project(motion.position)[:, :2] / timelapse.SMOOTH
    assert len(pieces) == len(seen) - 1  # nothing hides this one
    np.testing.assert_allclose(pieces[:, 0], seen[:-1])
    assert seen[-1, 0] - seen[0, 0] > 0.6 * timelapse.WIDTH  # across the picture, to the right
    bar, words = artist(figure, "scale")
    length = float(words.get_text().removesuffix(" m"))
    sideways = view.project(np.stack([np.zeros(3), length * view.axes[0]]))[:, 0]
    assert np.ptp(bar.get_xdata()) == pytest.approx(np.ptp(sideways) / timelapse.SMOOTH)
    (arrow,) = artist(figure, "shaking")
    assert isinstance(arrow, Annotation)
    drawn_way = np.array(arrow.xy) - arrow.xyann
    yaw = math.radians(30.0)
    ends = view.project(np.array([[0.0, 0, 0], [math.cos(yaw), -math.sin(yaw), 0.0]]))[:, :2]
    expected = (ends[1] - ends[0]) * [1.0, -1.0]
    np.testing.assert_allclose(
        drawn_way / np.linalg.norm(drawn_way), expected / np.linalg.norm(expected), atol=1e-9
    )


def test_rocks_stand_where_they_were_in_the_colour_of_their_speed(
    figure: Figure, displacement: xr.Dataset, view: View
) -> None:
    (image,) = artist(figure, "picture")
    picture = np.array(image.get_array())
    motion = track(displacement, 2)
    times = pose_times(motion, 0.5 * float(np.linalg.norm(tumbling.SIZE)))
    assert len(times) > 3
    for time in times:
        column, row = view.project(motion.places(np.array([time]))[0])[:2] / timelapse.SMOOTH
        shown = picture[int(row), int(column)]
        speed = np.interp(time, motion.time, motion.speed) / motion.speed.max()
        own = np.array(SPEEDS(speed)[:3])
        # Light changes how bright a colour is and hardly its hue.
        angle = shown @ own / np.linalg.norm(shown) / np.linalg.norm(own)
        assert angle > 0.985, (time, shown, own)


def test_what_the_ground_hides_is_dotted(displacement: xr.Dataset, small: None) -> None:
    """In a canyon deeper than any eye can look into, the path in it is hidden from all sides."""
    canyon = joined(
        plane(30.0, 30),
        block((40.0, 1.0, 24.0), (8.0, -3.0, 0.0)),
        block((40.0, 1.0, 24.0), (8.0, 3.0, 0.0)),
    )
    terrain = xr.Dataset(
        {
            "terrain_vertex": (("terrain_corner", "xyz"), canyon[0]),
            "terrain_face": (("terrain_face_number", "three"), canyon[1]),
        }
    )
    figure = timelapse.timelapse(displacement, terrain, tumbling.rock(), 1, "made up")
    (hidden,) = artist(figure, "hidden path")
    assert len(hidden.get_segments()) > 50
    assert not artist(figure, "path")[0].get_segments()


def test_a_run_that_stays_is_drawn(
    displacement: xr.Dataset, terrain: xr.Dataset, small: None
) -> None:
    data = style.png(timelapse.timelapse(displacement, terrain, tumbling.rock(), 0, "made up"))
    assert len(np.unique(np.array(Image.open(io.BytesIO(data)).convert("RGB")).reshape(-1, 3))) > 50


# ---- The animation


def frames(data: bytes) -> tuple[list[Array], float]:
    """Frames, and how long they last [s]."""
    film = Image.open(io.BytesIO(data))
    pictures, lasting = [], 0.0
    for number in range(film.n_frames):
        film.seek(number)
        film.load()
        pictures.append(np.array(film.convert("RGB"), dtype=float) / 255.0)
        lasting += film.info["duration"] / 1000.0
    return pictures, lasting


@pytest.mark.slow
def test_the_rock_of_the_animation_goes_its_way_in_real_time(
    displacement: xr.Dataset, terrain: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timelapse, "FRAMES_A_SECOND", 10)
    data = timelapse.animation(displacement, terrain, tumbling.rock(), 1)
    assert len(data) < 1_600_000
    pictures, lasting = frames(data)
    motion = track(displacement, 1)
    assert lasting == pytest.approx(float(motion.time[-1]) + 1.0, abs=0.1)  # the end stays a while
    assert pictures[0].shape == (400, 640, 3)
    view = timelapse._scene(displacement, terrain, tumbling.rock(), 1, timelapse.FILM).behind.view
    hue = np.array(to_rgb(style.BASE)) / np.linalg.norm(to_rgb(style.BASE))
    moved = []
    for share in (0.0, 0.5, 1.0):
        picture = pictures[round(share * (len(pictures) - 1))]
        rock = picture @ hue / np.maximum(np.linalg.norm(picture, axis=-1), 1e-9) > 0.985
        middle = np.argwhere(rock).mean(axis=0)[::-1]
        time = np.array([share * motion.time[-1]])
        expected = view.project(motion.places(time)[0])[:2] / timelapse.SMOOTH
        np.testing.assert_allclose(middle, expected, atol=12.0)
        moved.append(middle)
    assert np.linalg.norm(moved[2] - moved[0]) > 200.0


@pytest.mark.slow
def test_a_long_fall_is_shown_faster(
    displacement: xr.Dataset, terrain: xr.Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timelapse, "LONGEST", 1.5)
    pictures, lasting = frames(timelapse.animation(displacement, terrain, tumbling.rock(), 1))
    assert lasting == pytest.approx(1.5 + 1.0, abs=0.1)
    assert np.abs(pictures[-1] - pictures[0]).max() > 0.3  # from the start to the end all the same
