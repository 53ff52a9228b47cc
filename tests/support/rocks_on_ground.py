"""Rocks on grounds, as sites of a displacement, and their runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import trimesh
from numpy.typing import NDArray

from support import grounds
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.rock import solid
from vsr_core.rock.body import Rock
from vsr_core.run import displacement
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.run.displacement import DisplacementRun
from vsr_core.run.time_step import step_unit
from vsr_core.surrogates.double_rock import double_rock
from vsr_core.terrain.surface import Terrain

Array = NDArray[np.float64]


@cache
def rock_of(name: str) -> tuple[Rock, Barrier]:
    if name == "box":
        rock = solid.box((0.5, 0.4, 1.0), 2110.0).rock
    elif name == "double rock":
        rock = solid.from_mesh(trimesh.Trimesh(*double_rock(), process=False), 2110.0).rock
    else:
        rock = grounds.lump(0)
    return rock, barrier(rock)


@cache
def ground_of(name: str) -> Terrain:
    """By name; ``... parts`` is the same as convex parts."""
    if name.endswith(" parts"):
        return grounds.in_parts(ground_of(name.removesuffix(" parts")), 0.004, 0.04)
    made: dict[str, Callable[[], Terrain]] = {
        "level": grounds.level,
        "perch": grounds.perch,
        "cliff": lambda: grounds.cliff(3.0, 0.3),
        "niche": lambda: grounds.niche(0.75, 0.4, lines=9),
    }
    return made[name]()


@cache
def site_of(rock: str, ground: str, yaw: float = 0.0, restitution: float = 0.0) -> TerrainCase:
    """A rock that has settled on a ground."""
    body, limits = rock_of(rock)
    made = grounds.site(body, ground_of(ground), yaw=yaw, restitution=restitution)
    rest = displacement.settled(made.seat, 0.006 * step_unit(body))
    scene = replace(made.seat, start=rest)
    return TerrainCase(scene, scene, limits.toppled_tilt)


def usual(
    rock: Rock, share: float = 0.002, *, reduce: bool = True, engine: str = "bullet"
) -> Settings:
    return Settings(share * step_unit(rock), reduce, engine)


def run(site: TerrainCase, pga_g: float, ratio: float, engine: str = "bullet") -> DisplacementRun:
    settings = usual(site.seat.rock, engine=engine)
    return displacement.displace(site, CosinePulse.from_g(pga_g, ratio), settings)


def cells(seed: int, count: int, low: float, high: float, longest: float = 0.5) -> Array:
    """Random PGA [g], PGV/PGA [s] and yaw [rad], shape (count, 3)."""
    rng = np.random.default_rng(seed)
    ratio = np.exp(rng.uniform(math.log(0.08), math.log(longest), count))
    pga, yaw = rng.uniform(low, high, count), rng.uniform(0.0, 2.0 * math.pi, count)
    return np.column_stack([pga, ratio, yaw])


def place(found: DisplacementRun, times: Array) -> Array:
    """Centre of mass at times [s], shape (n, 3) [m]."""
    path = found.trajectory
    return np.stack([np.interp(times, path.time, part) for part in path.position.T], axis=1)


def early(found: DisplacementRun, other: DisplacementRun, back: Array, radius: float) -> None:
    """Same side; the same way, but for a hundredth of the radius, until the impacts differ."""
    assert found.response.outcome.overturned == other.response.outcome.overturned
    times = np.linspace(0.0, 0.5, 40)
    apart = place(found, times) - place(other, times) @ back.T
    assert np.abs(apart).max() < 0.01 * radius


SOME = [(0.5, 0.2, 0.0), (0.9, 0.15, 1.0), (0.4, 0.3, 3.0), (0.18, 0.3, 0.5), (0.25, 0.08, 4.0)]
"""PGA [g], PGV/PGA [s] and yaw [rad] that topple the lump on its perch, but for the last."""


@cache
def known(pga: float, ratio: float, yaw: float) -> DisplacementRun:
    """A run of the lump on its perch."""
    return run(site_of("lump", "perch parts", yaw), pga, ratio)


TOPPLING = [("box", "cliff"), ("lump", "perch parts"), ("lump", "niche parts")]


def staying(rock: str, ground: str, yaw: float) -> TerrainCase:
    """A rock that settled, with the range of accelerations in which it stays."""
    site = site_of(rock, ground, yaw)
    return replace(
        site,
        static_limits=displacement.limits_on_seat(site.seat, 0.006 * step_unit(site.seat.rock)),
    )


def shaken_late(site: TerrainCase, pga_g: float, quiet: float) -> RecordedMotion:
    """A pulse of 0.3 s after a tremble well within the range of rest."""
    lowest, highest = site.static_limits
    before = np.where(np.arange(round(quiet / 0.01)) % 7 < 3, 0.8 * lowest, 0.8 * highest)
    pulse = CosinePulse.from_g(pga_g, 0.3)
    after = pulse.acceleration(0.01 * np.arange(200))
    return RecordedMotion(Trace(np.concatenate([before, after, [0.0]]), 0.01))


@cache
def late(pga_g: float) -> tuple[TerrainCase, DisplacementRun, DisplacementRun]:
    """With and without the time before the first push."""
    site = staying("lump", "perch parts", 0.0)
    motion = shaken_late(site, pga_g, 1.5)
    settings = Settings(1e-3)
    skipped = displacement.displace(site, motion, settings)
    return (
        site,
        skipped,
        displacement.displace(replace(site, static_limits=(0.0, 0.0)), motion, settings),
    )
