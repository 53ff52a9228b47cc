"""A study: the scenes, motions and time steps of a configuration, and the runs it asks for."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from pipeline.config.schema import Config
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Shaking
from pipeline.stages.runs.runner import Kind, Run, run_missing
from pipeline.stages.runs.scenes import Group, Scenes, groups, identity, load_scenes
from pipeline.stages.runs.step_choice import time_steps
from pipeline.workflow import keys
from pipeline.workflow.stage import Job, Product
from pipeline.workflow.store import Store
from vsr_core.run.cases import Settings


@dataclass(frozen=True, eq=False)
class GridRuns:
    """The runs of a scene, one for each cell of a grid, made anew whenever they are gone through.

    A key begins with four bytes of the scene's digest, so that its runs are neighbours in the
    database; what follows is a digest of the scene and the motion.

    Attributes
    ----------
    scene : bytes, digest of all that its runs share
    tokens : bytes, what tells the motion of each cell, one after the other and equally long
    """

    scene: bytes
    motions: Shaking
    tokens: bytes

    def __iter__(self) -> Iterator[Run]:
        width = len(self.tokens) // motion_grid.count(self.motions)
        starts = range(0, len(self.tokens), width)
        keys_of_runs = run_keys(self.scene, (self.tokens[at : at + width] for at in starts))
        return map(Run, keys_of_runs, motion_grid.each_cell(self.motions))


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
    """What a configuration asks for, read once from the products that it is made of.

    Attributes
    ----------
    scenes : Scenes, with rock, energy barrier and terrain
    time_steps : dict, from friction to time step [s]; nan where it has to be measured first
    """

    scenes: Scenes
    motions: Shaking
    time_steps: dict[float, float]
    groups: tuple[Group, ...]
    _tokens: bytes
    _identity: dict[str, Any]

    def wanted(self, group: Group) -> GridRuns:
        """The runs of a group, one for each cell of the grid."""
        scene = scene_digest(self._identity, group, self.time_steps[group.friction])
        return GridRuns(scene, self.motions, self._tokens)

    def settings(self, friction: float) -> Settings:
        """How the runs of a friction are computed."""
        config, step = self.scenes.config, self.time_steps[friction]
        assert not math.isnan(step)
        return Settings(step, config.simulation.reduce, config.engine)


def load_study(config: Config, store: Store) -> Study:
    """Read what a study is from the products of the stages before its runs."""
    scenes, motions = load_scenes(config, store), motion_grid.of_store(config, store)
    return Study(
        scenes,
        motions,
        time_steps(config, store),
        groups(config),
        _tokens(motions),
        shared_identity(scenes, motions),
    )


def shared_identity(scenes: Scenes, motions: Shaking) -> dict[str, Any]:
    """Tell what all runs of a study share, but for group and time step."""
    return {**identity(scenes), "motion": motions.identity()}


def _tokens(motions: Shaking) -> bytes:
    told = bytearray()
    for cell in motion_grid.each_cell(motions):
        told += motions.token(cell)
    return bytes(told)


def run_study(job: Job, kind: Kind[Any], place: Callable[[Scenes, Group], Any]) -> Product:
    """Do the missing runs of a study.

    Parameters
    ----------
    kind : Kind, whose function takes what ``place`` gives, Settings and the motions; and cells
    """
    study = load_study(job.config, job.store)

    def shared(group: Group) -> tuple[Any, Settings, Shaking]:
        return place(study.scenes, group), study.settings(group.friction), study.motions

    done = run_missing(job, kind, study.groups, study.wanted, shared)
    return Product({}, done.summary, retry=done.crashed)
