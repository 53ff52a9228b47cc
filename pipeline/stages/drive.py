"""Drive: how well the servo's table follows its motions, and what that does to the boundary."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from pipeline import pages, writers
from pipeline.cluster import Batch
from pipeline.config import Config, PulseConfig
from pipeline.datasets import described, netcdf
from pipeline.layers import Site
from pipeline.problems import InputError
from pipeline.scenes import contact
from pipeline.stage import Job, Product, Stage
from pipeline.stages.rock import load_rock

if TYPE_CHECKING:
    import xarray as xr

    from vsr_core.bounds import Barrier
    from vsr_core.motion import GroundMotion
    from vsr_core.scene import Rock, Scene
    from vsr_core.servo import Servo
    from vsr_core.simulate import Case
    from vsr_core.tracking import Track

FILE, TABLE, PAGE = "drive.nc", "drive.csv", "drive.html"

PULSE = (0.2, 0.8)
"""PGA [g] and PGV/PGA [s] of the paper's Fig. 7a."""

SYNTHETIC = (0.4, 1.2)
"""The same of the motion that the paper's Fig. 7b shows; where the rock stands it, a larger PGA."""

LARGER, LARGEST = 1.25, 3.0
"""Factor from one PGA to the next, and the last [g]."""

AFTER = 3.0
"""Time shown after a motion [s]."""

STEP_SHARE = 0.003
"""Time step of the runs, in units of sqrt(radius / g); no longer than the control period."""

ROWS, LEVELS, HALVINGS = 8, 10, 4
"""Of the boundary: its PGV/PGA, the PGA tried at first, and how often the interval is halved."""

JUMP = 0.1
"""Acceleration at t = 0, as a share of the largest, from which on it is a jump."""

DEFAULT_RATIOS = (0.1, 1.0)
"""Ends of the PGV/PGA [s] where the motions are records."""

COLUMNS = ("case", "loop_hz", "command_hz", "pga_g", "pgv_m_per_s", "spectral_radius",
           "rms_m_per_s", "max_m_per_s", "first_m_per_s", "first_share", "push_m_per_s",
           "recovery_s", "peak_tilt_deg", "note")  # fmt: skip

Record = dict[str, Any]
Interval = tuple[float, float]  # last balanced and first overturning PGA [g]


class Drive(NamedTuple):
    """A way to drive the table; None is the table's own frame."""

    name: str
    servo: Servo | None


def make(job: Job) -> Product:
    """Follow a pulse and a rougher motion, and look for the boundary with and without a servo."""
    from pipeline.figures import drive as figures
    from pipeline.figures.style import pictures, svg_uri

    rock, limits = _rock(job)
    drives = _drives(job.config.servo.servo())
    tracks, records = _tracks(job, rock, limits, drives)
    rows = _rows(job, rock, limits, drives)
    dataset = described(_dataset(tracks, rows), job, "Driven table")
    drawn = {
        "drive_tracking": figures.tracking(dataset),
        "drive_disturbance": figures.disturbed(dataset),
        "drive_boundary": figures.boundaries(dataset),
    }
    page = {
        "site": job.site.name,
        "records": records,
        "pictures": {name: svg_uri(figure) for name, figure in drawn.items()},
        "pga": records[-1]["pga_g"],
        "wanted_pga": SYNTHETIC[0],
        "tried": job.config.motion.pga[-1],
        "mass": rock.mass,
        "table_mass": drives[-1].servo.mass if drives[-1].servo else math.nan,
        "shift": _shift(dataset),
        "rows": _listed(dataset),
        "drives": [drive.name for drive in drives],
    }
    files = {
        FILE: netcdf(dataset),
        TABLE: writers.table(COLUMNS, records),
        PAGE: writers.text(pages.filled(PAGE, page)),
    }
    for name, figure in drawn.items():
        files |= pictures(name, figure)
    worst = max(record["rms_m_per_s"] for record in records if not record["note"])
    return Product(files, f"rms errors up to {worst:.2g} m/s; boundary {_shift(dataset)}")


def run_rows(shared: Any, items: tuple[tuple[str, float], ...]) -> list[Interval]:
    """Where the boundary lies in rows, on a worker; an item is a drive's name and a PGV/PGA [s]."""
    cases, levels, step = shared
    return [_boundary(cases[name], ratio, levels, step) for name, ratio in items]


def _boundary(case: Case, ratio: float, levels: list[float], step: float) -> Interval:
    from vsr_core.motion import CosinePulse
    from vsr_core.outcome import Outcome
    from vsr_core.simulate import Settings, simulate

    def topples(pga: float) -> bool:
        response = simulate(case, CosinePulse.from_g(pga, ratio), Settings(step))
        return response.outcome is Outcome.OVERTURNED

    last = 0.0
    for first in levels:
        if topples(first):
            break
        last = first
    else:
        return last, math.nan
    for _ in range(HALVINGS):
        middle = 0.5 * (last + first)
        last, first = (last, middle) if topples(middle) else (middle, first)
    return last, first


def _rock(job: Job) -> tuple[Rock, Barrier]:
    from vsr_core.solid import standing

    rock, limits = load_rock(job.store)
    return (standing(rock) if job.config.on_terrain else rock), limits


def _drives(own: Servo) -> list[Drive]:
    """The table's frame, the published servo in two ways, and the site's if it is another."""
    from vsr_core.servo import PUBLISHED

    drives = [
        Drive("table's own frame", None),
        Drive("published servo, a command each period", PUBLISHED),
        Drive("published servo, commands at 200 Hz", replace(PUBLISHED, hold=5)),
    ]
    if own not in [drive.servo for drive in drives]:
        drives.append(Drive("this site's servo", own))
    return drives


def _scene(config: Config, rock: Rock, servo: Servo | None) -> Scene:
    from vsr_core.scene import Scene

    friction = contact(config, config.contact.friction[0])
    return Scene(rock, friction, math.radians(config.yaw[0]), drive=servo)


def _step(rock: Rock) -> float:
    from vsr_core import GRAVITY

    return STEP_SHARE * math.sqrt(rock.radius / GRAVITY)


def _tracks(
    job: Job, rock: Rock, limits: Barrier, drives: list[Drive]
) -> tuple[dict[str, Track], list[Record]]:
    """The table's way through the pulse with each servo, and through the rough motion."""
    from vsr_core.motion import CosinePulse
    from vsr_core.servo import PUBLISHED, spectral_radius
    from vsr_core.tracking import track

    found: dict[str, Track] = {}
    records = []
    pulse = CosinePulse.from_g(*PULSE)
    for drive in drives[1:]:
        assert drive.servo is not None
        scene = _scene(job.config, rock, drive.servo)
        name = f"pulse, {drive.name}"
        found[name] = track(scene, pulse, _step(rock), AFTER)
        records.append(_record(name, scene, PULSE[0], found[name], pulse))
    slow = replace(PUBLISHED, period=0.005)
    refused = dict.fromkeys(COLUMNS, math.nan) | {
        "case": "pulse, published gains, the loop itself at 200 Hz",
        "loop_hz": 1.0 / slow.period,
        "command_hz": 1.0 / slow.command_period,
        "pga_g": PULSE[0],
        "pgv_m_per_s": pulse.peak_acceleration * pulse.pgv_pga,
        "spectral_radius": spectral_radius(slow),
        "note": "unstable, so refused",
    }
    last = drives[-1].servo
    assert last is not None
    scene = _scene(job.config, rock, last)
    pga, motion, rough = _toppling(scene, limits, _step(rock))
    name = f"rough motion, {drives[-1].name}"
    found[name] = rough
    return found, [*records, refused, _record(name, scene, pga, rough, motion)]


def _toppling(scene: Scene, limits: Barrier, step: float) -> tuple[float, GroundMotion, Track]:
    """The made motion at the first PGA that topples the rock, or the largest."""
    from vsr_core.records.motion import RecordedMotion
    from vsr_core.tracking import synthetic, track

    pga, ratio = SYNTHETIC
    trace = synthetic(ratio)
    while True:
        motion = RecordedMotion.scaled(trace, pga)
        followed = track(scene, motion, step, AFTER)
        if followed.tilt.max() > limits.toppled_tilt or LARGER * pga > LARGEST:
            return pga, motion, followed
        pga *= LARGER


def _record(name: str, scene: Scene, pga: float, followed: Track, motion: GroundMotion) -> Record:
    import numpy as np

    from vsr_core.servo import spectral_radius
    from vsr_core.tracking import disturbance, errors, push

    servo = scene.drive
    assert servo is not None
    error = errors(followed)
    pushed = disturbance(followed.time, push(followed, scene))
    start = float(abs(motion.acceleration(np.zeros(1))[0]))
    jumps = start > JUMP * motion.peak_acceleration
    return {
        "case": name,
        "loop_hz": 1.0 / servo.period,
        "command_hz": 1.0 / servo.command_period,
        "pga_g": pga,
        "pgv_m_per_s": float(np.abs(followed.wanted).max()),
        "spectral_radius": spectral_radius(servo),
        "rms_m_per_s": error.rms,
        "max_m_per_s": error.largest,
        "first_m_per_s": error.first if jumps else math.nan,
        "first_share": error.first_share if jumps else math.nan,
        "push_m_per_s": pushed.peak,
        "recovery_s": pushed.recovery,
        "peak_tilt_deg": math.degrees(float(followed.tilt.max())),
        "note": "",
    }


def _rows(
    job: Job, rock: Rock, limits: Barrier, drives: list[Drive]
) -> dict[tuple[str, float], Interval]:
    """The boundary's interval for each drive and PGV/PGA."""
    import numpy as np

    from vsr_core import GRAVITY
    from vsr_core.precheck import PERIOD_SHARE
    from vsr_core.simulate import prepare

    cases = {
        drive.name: prepare(_scene(job.config, rock, drive.servo), limits, reduce=True)
        for drive in drives
    }
    motion = job.config.motion
    ends = motion.pgv_pga if isinstance(motion, PulseConfig) else DEFAULT_RATIOS
    held = max(drive.servo.command_period for drive in drives if drive.servo)
    ratios = np.geomspace(max(ends[0], held / PERIOD_SHARE, 0.05 * ends[-1]), ends[-1], ROWS)
    still = cases[drives[0].name].still
    lowest = min(-still[0], still[1]) / GRAVITY
    levels = np.geomspace(min(lowest, 0.5 * motion.pga[-1]), motion.pga[-1], LEVELS).tolist()
    items = [(name, float(ratio)) for ratio in ratios for name in cases]

    def batches() -> Iterator[Batch]:
        for item in items:
            yield Batch(item, "drives", (item,))

    job.log(f"drive: boundary of {len(ratios)} PGV/PGA with {len(drives)} drives")
    found: dict[tuple[str, float], Interval] = {}
    shared = (cases, levels, _step(rock))
    for batch, results in job.cluster.run(run_rows, batches(), lambda name: shared):
        found[batch.tag] = results[0] if results else (math.nan, math.nan)
    return {item: found[item] for item in items}


def _dataset(tracks: dict[str, Track], rows: dict[tuple[str, float], Interval]) -> xr.Dataset:
    import numpy as np
    import xarray as xr

    names = list(dict.fromkeys(name for name, _ in rows))
    ratios = list(dict.fromkeys(ratio for _, ratio in rows))
    ends = np.array([[rows[name, ratio] for ratio in ratios] for name in names])

    def joined(part: str) -> Any:
        return np.concatenate([getattr(track, part) for track in tracks.values()])

    sampled = {
        "time": "time",
        "wanted_velocity": "wanted",
        "command": "command",
        "table_velocity": "measured",
        "servo_force": "force",
        "tilt": "tilt",
    }
    return xr.Dataset(
        {
            "row_size": ("case", [len(track.time) for track in tracks.values()]),
            **{name: ("sample", joined(part)) for name, part in sampled.items()},
            "last_balanced_pga": (("drive", "pgv_pga"), ends[..., 0]),
            "first_overturning_pga": (("drive", "pgv_pga"), ends[..., 1]),
        },
        {"case": list(tracks), "drive": names, "pgv_pga": ratios},
    )


def _shift(dataset: xr.Dataset) -> str:
    """Change of the boundary from the table's frame to a servo, in words."""
    import numpy as np

    middle = 0.5 * (dataset["last_balanced_pga"] + dataset["first_overturning_pga"]).values
    change = 100.0 * (middle[1:] / middle[0] - 1.0)
    change = change[np.isfinite(change)]
    if not change.size:
        return "outside the grid"
    worst = change[np.abs(change).argmax()]
    return f"shifted by {np.median(change):+.1f} % in the median row and by {worst:+.1f} % at most"


def _listed(dataset: xr.Dataset) -> list[list[float]]:
    """Rows of the page's table: PGV/PGA and the boundary with each drive [g]."""
    middle = 0.5 * (dataset["last_balanced_pga"] + dataset["first_overturning_pga"]).values
    return [
        [float(ratio), *(float(value) for value in middle[:, i])]
        for i, ratio in enumerate(dataset["pgv_pga"].values)
    ]


def _inputs(site: Site) -> dict[str, str]:
    """The template, and the servo, which the configuration leaves out where it is idle.

    Raises
    ------
    InputError
        For a servo whose sampled loop is unstable.
    """
    from vsr_core.errors import Unfit
    from vsr_core.servo import check

    servo = site.config.servo.servo()
    try:
        check(servo)
    except Unfit as error:
        raise InputError.from_unfit(site.file, "servo", error) from None
    return {PAGE: pages.digest(PAGE), "servo": repr(sorted(asdict(servo).items()))}


STAGE = Stage(
    name="drive",
    make=make,
    needs=("rock",),
    reads=("pedestal", "contact", "motion", "yaw"),
    code=(
        "pipeline.stages.drive:run_rows",
        "vsr_core.engines.bullet:build",
        "vsr_core.engines.bullet:SOLVER",
    ),
    inputs=_inputs,
    versions=("pybullet", "matplotlib", "jinja2"),
)
