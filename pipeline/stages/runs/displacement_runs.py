"""Displacement runs: cells of the grid that are not stored yet, each followed to its end."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from pipeline.config.layers import Site
from pipeline.config.problems import InputError, Problem
from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs.runner import Kind, StoredRuns
from pipeline.stages.runs.study import Study, run_study
from pipeline.workflow.rows import DisplacementRow
from pipeline.workflow.stage import Product, Work
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.displacement import displace
from vsr_core.run.movement import Trajectory


def follow_batch(
    shared: tuple[TerrainCase, Settings, Shaking], cells: tuple[Cell, ...]
) -> list[tuple[Any, ...]]:
    """Simulate the displacement runs of some cells, on a worker."""
    place, settings, motions = shared
    rows = []
    for cell in cells:
        found = displace(place, motions.motion(cell), settings)
        r, packed = found.response, pack(found.trajectory)
        rows.append((int(r.outcome), r.peak_tilt, r.slip, r.steps, int(found.stop), packed))
    return rows


KIND = Kind("displacement_runs", "displacement runs", DisplacementRow, follow_batch, batch=4)


class Journeys(StoredRuns):
    """The displacement runs of a study, with their trajectories."""


def make(work: Work, study: Study) -> Product:
    """Do the missing displacement runs."""
    return run_study(work, study, KIND, study.wanted, study.shared)


def refuse(site: Site) -> None:
    """Refuse a rock that has no terrain to travel over, and runs that are not all kept."""
    shape = site.config.pedestal.shape
    if shape != "mesh":
        file, rule = site.file_of("pedestal.shape"), "a rock travels over a terrain"
        remedy = "set pedestal.shape: mesh, with the terrain in the rock's scan"
        raise InputError(Problem(file, "pedestal.shape", shape, rule, remedy))
    if (keep := site.config.simulation.keep) != "all":
        file, rule = site.file_of("simulation.keep"), "each displacement run is kept with its path"
        raise InputError(Problem(file, "simulation.keep", keep, rule, "set simulation.keep: all"))


SAMPLE = np.dtype(
    [
        ("time", "<f8"),
        ("position", "<f4", 3),
        ("quaternion", "<f4", 4),
        ("velocity", "<f4", 3),
        ("angular_velocity", "<f4", 3),
        ("contact", "i1"),
    ]
)
"""A sample of ``vsr_core.run.movement.Trajectory``: micrometres and microradians are enough."""


def pack(trajectory: Trajectory) -> bytes:
    """Compressed samples of a trajectory."""
    samples = np.empty(len(trajectory.time), SAMPLE)
    samples["time"], samples["position"] = trajectory.time, trajectory.position
    samples["quaternion"], samples["velocity"] = trajectory.quaternion, trajectory.velocity
    samples["angular_velocity"], samples["contact"] = (
        trajectory.angular_velocity,
        trajectory.contact,
    )
    return zlib.compress(samples.tobytes(), 1)


def unpack(packed: bytes) -> np.ndarray:
    """Samples of a trajectory, shape (n,) of ``SAMPLE``.

    Returns
    -------
    ndarray, shape (n,)
    """
    return np.frombuffer(zlib.decompress(packed), SAMPLE)
