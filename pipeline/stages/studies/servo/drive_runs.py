"""Runs of the stage of drives: what a servo's table does in some motions, and to the boundary."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pipeline.config import in_si
from pipeline.config.motion_schema import MotionConfig, RecordConfig
from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions.motion_grid import MotionFiles
from pipeline.stages.runs.scenes import Group, Scenes, flat_scene
from pipeline.workflow.progress import telling
from pipeline.workflow.stage import Work
from pipeline.workflow.workers import Batch
from vsr_core.judge.proofs import Barrier
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.run.boundary_search import Bracket, first_boundary, verdict
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.input_checks import PERIOD_SHARE
from vsr_core.run.overturning import simulate
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Scene
from vsr_core.table.servo import PUBLISHED, Servo, spectral_radius
from vsr_core.verification.tracking import TableHistory, disturbance, errors, push, synthetic, track

A_PULSE, ROUGH, RECORD = "pulse", "rough motion", "record"
"""The motions that are followed: a pulse, and a made motion or one of the site's records."""

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

LEAST = 0.01
"""PGA tried first at least, as a share of the largest: the limit of what nothing holds is 0."""

JUMP = 0.1
"""Acceleration at t = 0, as a share of the largest, from which on it is a jump."""

DEFAULT_RATIOS = (0.1, 1.0)
"""Ends of the PGV/PGA [s] where the motions are records."""

COLUMNS = ("case", "loop_hz", "command_hz", "pga_g", "pgv_m_per_s", "spectral_radius",
           "rms_m_per_s", "max_m_per_s", "first_m_per_s", "first_share", "push_m_per_s",
           "recovery_s", "peak_tilt_deg", "note")  # fmt: skip

Record = dict[str, Any]


class Drive(NamedTuple):
    """A way to drive the table; None is the table's own frame."""

    name: str
    servo: Servo | None


class Followed(NamedTuple):
    """A motion that a table was driven through, and the name of the drive."""

    motion: str
    drive: str

    def __str__(self) -> str:
        return f"{self.motion}, {self.drive}"


def run_rows(shared: Any, items: tuple[tuple[str, float], ...]) -> list[Bracket]:
    """Find where the boundary lies in rows, on a worker.

    Parameters
    ----------
    shared : dict of Case by the name of its drive, PGAs to try [g], and the time step [s]
    items : tuple of (name of a drive, PGV/PGA [s])

    Returns
    -------
    list of Bracket [g]
    """
    cases, levels, step = shared
    return [_boundary(cases[name], ratio, levels, step) for name, ratio in items]


def _boundary(case: Case, ratio: float, levels: list[float], step: float) -> Bracket:
    def topples(pga: float) -> bool | None:
        return verdict(simulate(case, CosinePulse.from_g(pga, ratio), Settings(step)).outcome)

    return first_boundary(topples, levels, HALVINGS)


def drives(own: Servo) -> list[Drive]:
    """List the table's frame, the published servo in two ways, and the site's as the last."""
    names = {
        PUBLISHED: "published servo, a command each period",
        replace(PUBLISHED, hold=5): "published servo, commands at 200 Hz",
    }
    names[own] = names.pop(own, "this site's servo")
    served = [Drive(name, servo) for servo, name in names.items()]
    return [Drive("table's own frame", None), *served]


class Rough(NamedTuple):
    """A motion of many waves: its name, the PGA [g] from which it is raised, and its samples."""

    name: str
    pga: float
    trace: Trace


def rough(motion: MotionConfig, files: MotionFiles | None) -> Rough:
    """The record of the largest PGV/PGA of a site, or a made motion where it has none.

    Of several components the table of one axis takes the larger horizontal one.
    """
    if files is not None and files.records:
        longest = files.records[-1]  # they ascend
        name = f"{RECORD} {longest.name}"
        if longest.components is not None:
            peaks = np.abs(longest.components.acceleration[:, :2]).max(axis=0)
            name += f" (component {'xy'[int(peaks.argmax())]} alone)"
        return Rough(name, motion.pga[0], longest.trace)
    pga, ratio = SYNTHETIC
    return Rough(ROUGH, pga, synthetic(ratio))


def tracks(
    scenes: Scenes, group: Group, drives: list[Drive], waves: Rough, most: float
) -> tuple[dict[Followed, TableHistory], list[Record]]:
    """Follow the table through the pulse with each servo, and through the rough motion.

    Parameters
    ----------
    drives : list of Drive, the first the table's own frame, the last the site's servo
    most : float [g], largest PGA that its force gives
    """
    step, limits = STEP_SHARE * step_unit(scenes.level_rock), scenes.standing.barrier
    found: dict[Followed, TableHistory] = {}
    records = []
    pulse = CosinePulse.from_g(*PULSE)
    for drive in drives[1:]:
        assert drive.servo is not None
        scene = flat_scene(scenes, group, drive.servo)
        name = Followed(A_PULSE, drive.name)
        found[name] = track(scene, pulse, step, AFTER)
        records.append(_record(name, scene, limits, PULSE[0], found[name], pulse))
    slow = replace(PUBLISHED, period=0.005)
    refused = dict.fromkeys(COLUMNS, math.nan) | {
        "case": f"{A_PULSE}, published gains, the loop itself at 200 Hz",
        "loop_hz": 1.0 / slow.period,
        "command_hz": 1.0 / slow.command_period,
        "pga_g": PULSE[0],
        "pgv_m_per_s": pulse.peak_acceleration * pulse.pgv_pga,
        "spectral_radius": spectral_radius(slow),
        "note": "unstable, so refused",
    }
    last = drives[-1].servo
    assert last is not None
    scene = flat_scene(scenes, group, last)
    pga, motion, course = _toppling(scene, limits, step, waves, min(most, LARGEST))
    name = Followed(waves.name, drives[-1].name)
    found[name] = course
    return found, [*records, refused, _record(name, scene, limits, pga, course, motion)]


def _toppling(
    scene: Scene, limits: Barrier, step: float, waves: Rough, most: float
) -> tuple[float, GroundMotion, TableHistory]:
    """The rough motion at the first PGA that topples the rock, or the largest."""
    pga = min(waves.pga, most)
    while True:
        motion = RecordedMotion.scaled(waves.trace, pga)
        followed = track(scene, motion, step, AFTER)
        if peak_tilt(followed, limits) > limits.toppled_tilt or LARGER * pga > most:
            return pga, motion, followed
        pga *= LARGER


def peak_tilt(followed: TableHistory, limits: Barrier) -> float:
    """Largest tilt [rad] of a rock that is on the pedestal: it may slide off, and turn as it falls.

    Returns
    -------
    float [rad]
    """
    on = np.logical_and.accumulate(followed.height > 0.9 * limits.floor)
    return float(followed.tilt[on].max(initial=0.0))


def _record(
    name: Followed,
    scene: Scene,
    limits: Barrier,
    pga: float,
    followed: TableHistory,
    motion: GroundMotion,
) -> Record:
    servo = scene.drive
    assert servo is not None
    error = errors(followed)
    pushed = disturbance(followed.time, push(followed, scene))
    start = float(abs(motion.acceleration(np.zeros(1))[0]))
    jumps = start > JUMP * motion.peak_acceleration
    return {
        "case": str(name),
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
        "peak_tilt_deg": in_si.in_degrees(peak_tilt(followed, limits)),
        "note": "",
    }


def rows(
    work: Work, motion: MotionConfig, scenes: Scenes, group: Group, drives: list[Drive]
) -> dict[tuple[str, float], Bracket]:
    """Find the boundary in cosine pulses for each drive and PGV/PGA.

    Parameters
    ----------
    drives : list of Drive, the first the table's own frame

    Returns
    -------
    dict, from the name of a drive and a PGV/PGA [s] to a Bracket [g]

    Raises
    ------
    InputError
        Where a drive follows none of the pulses.
    """
    limits_of = scenes.standing.barrier
    cases = {
        drive.name: prepare(flat_scene(scenes, group, drive.servo), limits_of, reduce=True)
        for drive in drives
    }
    own = None if isinstance(motion, RecordConfig) else motion.pgv_pga
    ends = own or DEFAULT_RATIOS
    held = max(drive.servo.command_period for drive in drives if drive.servo)
    if held > PERIOD_SHARE * ends[-1]:
        given = f"a command every {1e3 * held:.4g} ms for pulses of a PGV/PGA up to {ends[-1]:g} s"
        rule = f"a servo follows a pulse at periods up to {PERIOD_SHARE:g} of it"
        remedy = "raise command_rate, or give longer pulses"
        raise InputError(Problem(work.origin.file_of("servo"), "servo", given, rule, remedy))
    shortest = max(ends[0], held / PERIOD_SHARE, 0.05 * ends[-1])
    ratios = np.geomspace(shortest, ends[-1], ROWS if shortest < ends[-1] else 1)
    limits = cases[drives[0].name].static_limits
    lowest, last = in_si.in_g(min(-limits[0], limits[1])), motion.pga[-1]
    levels = np.geomspace(np.clip(lowest, LEAST * last, 0.5 * last), last, LEVELS).tolist()
    items = [(name, float(ratio)) for ratio in ratios for name in cases]
    told = f"boundary of {len(ratios)} PGV/PGA with {len(drives)} drives"
    shared = cases, levels, STEP_SHARE * step_unit(scenes.level_rock)
    batches = (Batch("drives", (item,)) for item in items)
    with telling(work.stage, told, work.log):
        done = work.cluster.each(run_rows, batches, lambda name: shared)
        found = {item: bracket or Bracket(math.nan, math.nan) for _, item, bracket in done}
    return {item: found[item] for item in items}
