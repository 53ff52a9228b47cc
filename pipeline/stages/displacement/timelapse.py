"""One run that left the seat: several poses of the rock in one picture, and a short animation."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial.transform import Rotation, Slerp

from pipeline.drawing import style
from pipeline.drawing.painting import Backdrop, backdrop, painted, smaller
from pipeline.drawing.rendering import clearest, in_sight, thinned
from pipeline.drawing.view import View, axes_of, contour_step, fitted, reach, round_number
from pipeline.stages.datasets.displaced_runs import STOPS, chosen
from pipeline.workflow.datasets import is_shaken_along_x
from vsr_core.arrays import Array, Indices
from vsr_core.outcome import StopReason

WIDTH, HEIGHT, LEGEND = 1600, 900, 170
"""Pixels of the picture and of the strip below it."""

FILM = (640, 400)
"""Columns and rows of an animation."""

SMOOTH = 2
"""Side of the square of computed pixels that becomes one of the picture."""

FRAMES_A_SECOND = 25
LONGEST = 6.0
"""Length of an animation [s]; a longer run is shown faster, and its time stamp says so."""

MOST_FACES = 20_000
"""A finer rock is thinned: more is not seen."""

_SOFT = "#595959"


@dataclass(frozen=True, eq=False)
class _Scene:
    """The scene of both pictures of one run.

    Attributes
    ----------
    vertices, faces : of the rock, (n, 3) [m] and (m, 3)
    radius : float [m], of the rock about its centre of mass
    contour : float [m], height between two contours
    """

    motion: Track
    vertices: Array
    faces: Indices
    radius: float
    behind: Backdrop
    contour: float


@style.styled
def timelapse(
    displacement: xr.Dataset, terrain: xr.Dataset, rock: xr.Dataset, run: int, source: str
) -> Figure:
    """Draw poses of the rock along its trajectory over the terrain, coloured by speed.

    The eye looks across the trajectory, from where most of it is seen. The line is that of the
    centre of mass: it is drawn over the rocks, and dotted where the ground hides it.
    """
    scene = _scene(displacement, terrain, rock, run, (WIDTH, HEIGHT))
    motion, view = scene.motion, scene.behind.view
    scale = Normalize(0.0, max(float(motion.speed.max()), 0.1))
    times = pose_times(motion, scene.radius)
    poses = motion.poses(times, scene.vertices)
    colours = _paint(np.interp(times, motion.time, motion.speed), scale)
    picture = smaller(painted(scene.behind, poses, scene.faces, colours), SMOOTH)
    figure = Figure(figsize=(WIDTH / style.DPI, (HEIGHT + LEGEND) / style.DPI))
    strip = LEGEND / (HEIGHT + LEGEND)
    axes = figure.add_axes((0.0, strip, 1.0, 1.0 - strip))
    axes.imshow(picture, extent=(0, WIDTH, HEIGHT, 0), aspect="auto", gid="picture")
    axes.set_axis_off()
    axes.autoscale(False)
    _path(axes, scene, scale)
    _times(axes, view.project(poses)[..., :2] / SMOOTH, times)
    legend = figure.add_axes((0.0, 0.0, 1.0, strip))
    legend.set(xlim=(0, WIDTH), ylim=(0, LEGEND))
    legend.set_axis_off()
    _words(legend, displacement.isel(run=run), scene, source)
    yaw = math.radians(float(displacement["yaw"][run]))
    _compass(legend, view, yaw if is_shaken_along_x(displacement) else None)
    _scale_bar(legend, view)
    _speed_bar(figure, scale)
    return figure


def animation(displacement: xr.Dataset, terrain: xr.Dataset, rock: xr.Dataset, run: int) -> bytes:
    """Show the run in real time if it is short enough.

    Parameters
    ----------
    displacement, terrain, rock, run
        As for ``timelapse``.
    """
    scene = _scene(displacement, terrain, rock, run, FILM)
    time = scene.motion.time
    faster = max(1.0, float(time[-1] - time[0]) / LONGEST)
    times = np.append(np.arange(time[0], time[-1], faster / FRAMES_A_SECOND), time[-1])
    colour = np.array([to_rgb(style.BASE)])
    font = ImageFont.load_default(20)
    frames = []
    for now in times:
        pose = scene.motion.poses(np.array([now]), scene.vertices)
        picture = smaller(painted(scene.behind, pose, scene.faces, colour), SMOOTH)
        frame = Image.fromarray(np.rint(255.0 * picture).astype(np.uint8))
        stamp = f"{now:.2f} s" + (f", shown {faster:.1f} times as fast" if faster > 1.0 else "")
        ImageDraw.Draw(frame).text(
            (14, 10), stamp, fill=style.INK, font=font, stroke_width=3, stroke_fill="white"
        )
        frames.append(frame)
    lasting = [1000 // FRAMES_A_SECOND] * (len(frames) - 1) + [1000]
    film: Any = {"save_all": True, "append_images": frames[1:], "duration": lasting, "loop": 0}
    with io.BytesIO() as file:
        frames[0].save(file, format="WebP", quality=80, **film)
        return file.getvalue()


def _scene(
    displacement: xr.Dataset, terrain: xr.Dataset, rock: xr.Dataset, run: int, size: tuple[int, int]
) -> _Scene:
    """See the ground across the trajectory of the rock, under a sun at the left."""
    motion = track(displacement, run)
    ground = (terrain["terrain_vertex"].values, terrain["terrain_face"].values.astype(np.int64))
    radius = float(np.linalg.norm(rock["vertex"].values, axis=1).max())
    along = (motion.position[-1] - motion.position[0])[:2]
    if np.linalg.norm(along) < 0.3 * radius:
        yaw = math.radians(float(displacement["yaw"][run]))
        along = np.array([math.cos(yaw), -math.sin(yaw)])
    path = motion.places(np.linspace(motion.time[0], motion.time[-1], 120))
    azimuth, elevation = clearest(ground, path, radius, along)
    points = reach(path, radius)
    view = fitted(axes_of(azimuth, elevation), points, (SMOOTH * size[1], SMOOTH * size[0]), 0.1)
    sun = axes_of(azimuth - math.radians(55.0), math.radians(48.0))
    contour = contour_step(points)
    behind = backdrop(view, sun, ground, points, contour)
    surface = rock["surface_vertex"].values.astype(float), rock["surface_face"].values
    return _Scene(motion, *thinned(*surface, MOST_FACES), radius, behind, contour)


def _paint(speed: Array, scale: Normalize) -> Array:
    return np.array(SPEEDS(scale(speed)))[..., :3]


def _path(axes: Axes, scene: _Scene, scale: Normalize) -> None:
    motion, view = scene.motion, scene.behind.view
    points = view.project(motion.position)[:, :2] / SMOOTH
    lines = np.stack([points[:-1], points[1:]], axis=1)
    colours = _paint(0.5 * (motion.speed[:-1] + motion.speed[1:]), scale)
    visible = in_sight(view, scene.behind.seen, motion.position)
    visible = visible[:-1] & visible[1:]
    for keep, width in ((visible, 4.0), (~visible, 3.2)):  # under the line, to set it off
        axes.add_collection(
            LineCollection(list(lines[keep]), colors="white", linewidths=width, capstyle="round")
        )
    look: Any = {"colors": colours, "linewidths": 2.0, "capstyle": "round"}
    style.line_on_surface(axes, lines, visible, "path", **look)


def _times(axes: Axes, poses: Array, times: Array) -> None:
    """Write times over the poses: end and start first, then those that there is room for."""
    taken: list[tuple[float, float]] = []
    last = len(times) - 1
    for number in (last, *range(last)):
        left, top = poses[number].min(axis=0)
        x, y = 0.5 * float(left + poses[number][:, 0].max()), float(top) - 5.0
        if any(abs(x - other) < 95.0 and abs(y - high) < 30.0 for other, high in taken):
            continue
        taken.append((x, y))
        name = {0: "start, ", last: "end, "}.get(number, "")
        above: Any = {"ha": "center", "va": "bottom", "weight": "bold" if name else "normal"}
        axes.text(
            x, y, f"{name}{times[number]:.2f} s", path_effects=style.HALO, gid="time", **above
        )


def _words(axes: Axes, run: xr.Dataset, scene: _Scene, source: str) -> None:
    shaking = (
        f"PGA {float(run['pga']):.3g} g,  PGV/PGA {float(run['pgv_pga']):.3g} s,  "
        f"yaw {float(run['yaw']):.4g}°,  friction {float(run['friction']):.3g}"
    )
    path = (
        f"Path {float(run['trajectory_length']):.2f} m long, "
        f"{float(run['terminal_distance']):.2f} m from start to end, "
        f"up to {float(run['largest_speed']):.2f} m/s"
    )
    stop = STOPS[StopReason(int(run["stop_reason"]))].capitalize()
    stop = f"{stop} after {scene.motion.time[-1]:.2f} s"
    about = f"Line: centre of mass, dotted behind the ground. Contours every {scene.contour:g} m."
    axes.text(30, 140, shaking, weight="bold", size=10.5, va="center")
    for line, text in enumerate((path, stop, about, source)):
        colour = style.INK if line < 2 else _SOFT
        axes.text(30, 106 - 28 * line, text, color=colour, va="center")


def _compass(axes: Axes, view: View, yaw: float | None) -> None:
    """Axes of the site and the line of the shaking, if it has one, as the picture shows them."""
    middle, size = np.array([1020.0, 76.0]), 56.0
    turn = np.linspace(0.0, 2.0 * math.pi, 73)
    level = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=-1)
    axes.fill(*(middle + size * level @ view.axes[:2].T).T, fc="#f0eeea", ec=style.FAINT, lw=0.6)
    style.directions(axes, view.axes[:2].T, middle, size, 14.0, _SOFT)
    if yaw is None:
        return
    along = size * view.axes[:2] @ np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    arrow = {**style.BOTH_WAYS, "color": style.OVERTURNED, "lw": 1.8}
    axes.annotate("", middle + along, middle - along, arrowprops=arrow, gid="shaking")
    axes.text(1106, 76, "shaking", color=style.OVERTURNED, va="center")


def _scale_bar(axes: Axes, view: View) -> None:
    metre = 1.0 / (SMOOTH * view.pixel)  # in pixels of the picture
    length = round_number(180.0 / metre)
    start, end = 1225.0, 1225.0 + length * metre
    axes.plot([start, start, end, end], [66, 74, 74, 66], color=style.INK, lw=1.6, gid="scale")
    axes.text(0.5 * (start + end), 84, f"{length:g} m", ha="center", va="bottom", gid="scale")


def _speed_bar(figure: Figure, scale: Normalize) -> None:
    tall = HEIGHT + LEGEND
    axes = figure.add_axes((1440 / WIDTH, 66 / tall, 130 / WIDTH, 14 / tall))
    figure.colorbar(ScalarMappable(scale, SPEEDS), cax=axes, orientation="horizontal")
    axes.set_title("speed [m/s]", size=9.0)
    ends = np.array([0.0, 0.5, 1.0]) * float(scale.vmax or 0.0)
    axes.set_xticks(ends, [f"{value:.2g}" for value in ends])


SPEEDS = LinearSegmentedColormap.from_list(
    "speed", ["#3f51c7", "#8e44b8", "#d4518a", "#f58a49", "#f9d43c"]
)
"""From slow to fast: lighter with speed, and no colour of the ground."""


@dataclass(frozen=True, eq=False)
class Track:
    """Motion of one rock.

    Attributes
    ----------
    time : ndarray, shape (n,) [s]
    position : ndarray, shape (n, 3) [m], centre of mass
    turn : Rotation, n of them, from the rest pose
    speed : ndarray, shape (n,) [m/s]
    """

    time: Array
    position: Array
    turn: Rotation
    speed: Array

    def places(self, times: Array) -> Array:
        """Centre of mass at times.

        Parameters
        ----------
        times : ndarray, shape (k,) [s]

        Returns
        -------
        ndarray, shape (k, 3) [m]
        """
        return np.stack([np.interp(times, self.time, part) for part in self.position.T], axis=-1)

    def poses(self, times: Array, vertices: Array) -> Array:
        """Vertices of the rock at times.

        Parameters
        ----------
        times : ndarray, shape (k,) [s]
        vertices : ndarray, shape (n, 3) [m], at rest, from the centre of mass

        Returns
        -------
        ndarray, shape (k, n, 3) [m]
        """
        matrices = Slerp(self.time, self.turn)(times).as_matrix()
        return vertices @ np.swapaxes(matrices, 1, 2) + self.places(times)[:, None]


def track(displacement: xr.Dataset, run: int) -> Track:
    """Motion of one run."""
    own = chosen(displacement, np.arange(displacement.sizes["run"]) == run)
    return Track(
        own["time"].values,
        np.stack([own[name].values for name in "xyz"], axis=-1),
        Rotation.from_quat(own["quaternion"].values),
        own["speed"].values,
    )


def pose_times(motion: Track, radius: float) -> Array:
    """Times of poses that are about the size of the rock apart.

    Parameters
    ----------
    radius : float [m], of the rock

    Returns
    -------
    ndarray, shape (n,) [s], start and end among them
    """
    length = float(np.linalg.norm(np.diff(motion.position, axis=0), axis=1).sum())
    apart = max(length / 11.0, min(1.6 * radius, length / 3.0))
    chosen = [0]
    for number, place in enumerate(motion.position):
        if np.linalg.norm(place - motion.position[chosen[-1]]) > apart:
            chosen.append(number)
    last = motion.position[-1]
    if len(chosen) > 1 and np.linalg.norm(last - motion.position[chosen[-1]]) < 0.6 * apart:
        chosen.pop()
    return np.unique(motion.time[[*chosen, -1]])
