"""A study: the scenes, motions and time steps of a configuration, and the runs it asks for."""

from __future__ import annotations

import hashlib
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Any

from pipeline.config.motion_schema import MotionConfig
from pipeline.config.schema import SceneSettings
from pipeline.config.sections import Key
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Cell, ComponentRecords, MotionData, Shaking
from pipeline.stages.runs.lines import Line, rule
from pipeline.stages.runs.runner import Kind, Run, Wanted, run_missing
from pipeline.stages.runs.scenes import (
    Group,
    Scenes,
    alone_at,
    flat_case,
    groups,
    identity,
    refuse_motions,
    terrain_case,
)
from pipeline.stages.runs.step_choice import TimeSteps
from pipeline.workflow import keys
from pipeline.workflow.engine_input import Engine
from pipeline.workflow.stage import Product, Work
from vsr_core.run.cases import Case, Settings, TerrainCase


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of a grid, with what tells the motion of each.

    Attributes
    ----------
    tokens : bytes, of one cell after the other and equally long
    """

    motions: Shaking
    tokens: bytes

    @classmethod
    def of(cls, motions: Shaking) -> Cells:
        """All cells of some motions."""
        told = bytearray()
        for cell in motion_grid.each_cell(motions):
            told += motions.token(cell)
        return cls(motions, bytes(told))


@dataclass(frozen=True, eq=False)
class GridRuns:
    """The runs of a scene, one for each cell of a grid, made anew whenever they are gone through.

    A key begins with four bytes of the scene's digest, so that its runs are neighbours in the
    database; what follows is a digest of the scene and the motion.

    Attributes
    ----------
    scene : bytes, digest of all that its runs share
    """

    scene: bytes
    cells: Cells

    def __iter__(self) -> Iterator[Run]:
        motions, tokens = self.cells.motions, self.cells.tokens
        width = len(tokens) // motion_grid.count(motions)
        starts = range(0, len(tokens), width)
        keys_of_runs = run_keys(self.scene, (tokens[at : at + width] for at in starts))
        return map(Run, keys_of_runs, motion_grid.each_cell(motions))


def run_keys(scene: bytes, tokens: Iterable[bytes]) -> Iterator[bytes]:
    """Keys of runs of one scene."""
    start, shared = scene[:4], hashlib.blake2b(scene, digest_size=12)
    for token in tokens:
        own = shared.copy()
        own.update(token)
        yield start + own.digest()


def scene_digest(shared: dict[str, Any], group: Group, time_step: float) -> bytes:
    """What the runs of a scene share.

    Parameters
    ----------
    time_step : float [s]
    """
    scene = {**shared, **group._asdict(), "time_step": repr(time_step)}
    return bytes.fromhex(keys.digest(scene))


@dataclass(frozen=True, eq=False)
class Study:
    """The scenes, motions and time steps of a configuration, each read once."""

    scenes: Scenes
    engine: Engine
    yaw: Annotated[tuple[float, ...], Key("yaw")]
    motion: MotionConfig
    motion_data: MotionData
    steps: TimeSteps

    @property
    def settings(self) -> SceneSettings:
        """What the scenes are set up by."""
        return self.scenes.settings

    @cached_property
    def motions(self) -> Shaking:
        """The motions, rows of a grid at every PGA."""
        return motion_grid.of_data(self.motion, self.motion_data)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Directions and frictions, of a scene each."""
        return groups(self.yaw, self.settings)

    @cached_property
    def cells(self) -> Cells:
        """The cells of the grid, which all groups have in common."""
        return Cells.of(self.motions)

    @cached_property
    def _identities(self) -> tuple[dict[str, Any], ...]:
        """What the runs of each friction share, but for group and time step."""
        alone = (alone_at(self.scenes, at) for at in range(len(self.settings.contact.friction)))
        return tuple(shared_identity(one, self.motions) for one in alone)

    def wanted(self, group: Group) -> GridRuns:
        """The runs of a group, one for each cell of the grid."""
        return GridRuns(self.scene(group), self.cells)

    def runs_of(self, group: Group, cells: Sequence[Cell]) -> list[Run]:
        """Runs of a group at any PGA, not only those of the grid."""
        tokens = map(self.motions.token, cells)
        return list(map(Run, run_keys(self.scene(group), tokens), cells))

    def lines(self, group: Group) -> list[Run]:
        """The same runs by rows of the grid, each a line along PGA."""
        motions, scene = self.motions, self.scene(group)
        along = repr((motions.pga, rule())).encode()
        rows, seed = range(len(motions.rows)), zlib.crc32(repr(tuple(group)).encode())
        tokens = (motions.token(Cell(row, motions.pga[-1])) + along for row in rows)
        items = (Line(row, seed) for row in rows)
        return list(map(Run, run_keys(scene, tokens), items))

    def scene(self, group: Group) -> bytes:
        """Digest of what the runs of a group share."""
        shared = self._identities[self.settings.contact.friction.index(group.friction)]
        return scene_digest(shared, group, self.time_step(group))

    def time_step(self, group: Group) -> float:
        """Time step of the runs of a group [s]; nan where it has to be measured first."""
        return self.steps.steps[self.settings.contact.friction.index(group.friction)]

    def how(self, group: Group) -> Settings:
        """How the runs of a group are computed."""
        step = self.time_step(group)
        assert not math.isnan(step)
        simulation = self.settings.simulation
        return Settings(step, simulation.reduce, self.settings.engine, whole=simulation.whole)

    def shared(self, group: Group) -> tuple[Case | TerrainCase, Settings, Shaking]:
        """What the runs of a group share."""
        place = terrain_case if self.settings.on_terrain else flat_case
        return place(self.scenes, group), self.how(group), self.motions


class LevelStudy(Study):
    """A study of records along several axes without their vertical components."""

    @classmethod
    def of(cls, study: Study) -> LevelStudy:
        """The same study, without them."""
        return cls(*(getattr(study, one.name) for one in fields(study)))

    @cached_property
    def motions(self) -> Shaking:
        """The motions, without what is vertical."""
        whole = motion_grid.of_data(self.motion, self.motion_data)
        assert isinstance(whole, ComponentRecords)
        return whole.level()


def shared_identity(scenes: Scenes, motions: Shaking) -> dict[str, Any]:
    """Tell what all runs of a study share, but for group and time step."""
    whole = scenes.settings.simulation.whole
    return {**identity(scenes), "motion": motions.identity(), "whole": whole}


def run_study(
    work: Work, study: Study, kind: Kind[Any], wanted: Wanted[Group], shared: Callable[[Group], Any]
) -> Product:
    """Do the missing runs of a study."""
    refuse_motions(study.scenes, study.yaw, study.motions, work.origin)
    done = run_missing(work, kind, study.groups, wanted, shared)
    return Product({}, done.summary, retry=done.crashed)
