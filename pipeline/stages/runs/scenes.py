"""From a configuration to scenes: which physics a site asks for, and what identifies it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from pipeline.config import in_si
from pipeline.config.layers import Site
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import COMPILED, Config
from pipeline.stages.mesh.products import Ground, load_rock, load_terrain
from pipeline.stages.motions import motion_grid
from pipeline.workflow import keys
from pipeline.workflow.code_roots import RUN_CODE, TERRAIN_CODE
from pipeline.workflow.store import Store
from vsr_core import engines
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import Barrier
from vsr_core.rock import reduction
from vsr_core.rock.body import Rock
from vsr_core.rock.solid import block, standing
from vsr_core.run import displacement
from vsr_core.run.cases import Case, Settings, TerrainCase, prepare
from vsr_core.run.input_checks import check, check_engine, check_step, check_unshaken, longest_step
from vsr_core.run.reductions import PROOFS, TERRAIN_REDUCTIONS, Reduction
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Scene
from vsr_core.source import tracing
from vsr_core.table.servo import Servo

MOST_RUNS = 10_000_000
"""Runs of one direction and friction, whose dataset is made in memory, some 100 bytes a run."""


class Group(NamedTuple):
    """What tells the runs of one scene from those of the others of a study.

    Attributes
    ----------
    yaw : float [degree]
    friction : float [1]
    """

    yaw: float
    friction: float


@dataclass(frozen=True, eq=False)
class Scenes:
    """What the scenes of all groups of a configuration are built from, read once."""

    config: Config
    rock: Rock
    barrier: Barrier
    ground: Ground | None

    @cached_property
    def level_rock(self) -> Rock:
        """The rock as it stands on a flat pedestal."""
        return standing(self.rock) if self.config.on_terrain else self.rock


def load_scenes(config: Config, store: Store, *, level: bool = False) -> Scenes:
    """Read the rock, and its terrain where it stands on one.

    Parameters
    ----------
    store : Store, which holds the products of the stages ``rock`` and ``terrain``
    level : bool, whether only scenes on a flat pedestal are wanted, for which no terrain is read
    """
    ground = load_terrain(store) if config.on_terrain and not level else None
    return Scenes(config, *load_rock(store), ground)


def groups(config: Config) -> tuple[Group, ...]:
    """List the groups of a study."""
    return tuple(Group(yaw, friction) for yaw in config.yaw for friction in config.contact.friction)


def flat_scene(scenes: Scenes, group: Group, drive: Servo | None = None) -> Scene:
    """Set the rock on a flat pedestal."""
    contact = in_si.contact(scenes.config.contact, group.friction)
    return Scene(scenes.level_rock, contact, in_si.angle(group.yaw), drive=drive)


def flat_case(scenes: Scenes, group: Group) -> Case:
    """Prepare the scene of a group on a flat pedestal, driven as the configuration says."""
    config = scenes.config
    drive = in_si.servo(config.servo) if config.drive == "servo" else None
    scene = flat_scene(scenes, group, drive)
    return prepare(scene, scenes.barrier, reduce=config.simulation.reduce)


def terrain_case(scenes: Scenes, group: Group) -> TerrainCase:
    """Set the rock on its terrain for the shaking of a group."""
    ground, rock, toppled = scenes.ground, scenes.rock, scenes.barrier.toppled_tilt
    assert ground is not None
    reduce = scenes.config.simulation.reduce
    seat = Scene(
        reduction.on_its_seat(rock) if reduce else rock,
        in_si.contact(scenes.config.contact, group.friction),
        in_si.angle(group.yaw),
        "terrain",
        start=ground.starts[group.friction],
        terrain=ground.terrain if reduce else replace(ground.terrain, parts=(), light=None),
    )
    if not reduce:
        return TerrainCase(seat, seat, toppled)
    flight = replace(seat, rock=reduction.in_flight(rock))
    engine = scenes.config.engine
    step = engines.load(engine).LADDER.longest * step_unit(rock)
    still = displacement.limits_on_seat(seat, step, engine)
    return TerrainCase(seat, flight, toppled, still)


def code(engine: str, *, terrain: bool) -> tuple[str, ...]:
    """Name the roots of the code that determines runs.

    Returns
    -------
    tuple of str, as ``tracing.reached`` takes them
    """
    return (*(TERRAIN_CODE if terrain else RUN_CODE), f"vsr_core.engines.{engine}:build")


def identity(scenes: Scenes) -> dict[str, Any]:
    """Tell what all runs of a study share, but for group, motion and time step."""
    config, rock, ground = scenes.config, scenes.rock, scenes.ground
    parts = (rock.vertices, rock.inertia, rock.axes)
    engine = config.engine
    return {
        "rock": [
            keys.digest_bytes(rock.shape.encode(), *(part.tobytes() for part in parts)),
            rock.mass,
        ],
        "pedestal": _ground_identity(ground) if ground else config.pedestal.shape,
        "contact": [
            config.contact.restitution,
            config.contact.restitution_law,
            config.contact.rolling_friction,
        ],
        "drive": config.servo.model_dump() if config.drive == "servo" else config.drive,
        "simulation": [engine, config.simulation.reduce],
        "engine": engines.load(engine).VERSION,
        "code": keys.digest(tracing.reached(code(engine, terrain=ground is not None))),
    }


def _ground_identity(ground: Ground) -> str:
    starts = (
        array for start in ground.starts.values() for array in (start.position, start.rotation)
    )
    terrain = ground.terrain
    light = (terrain.light.vertices, terrain.light.faces) if terrain.light else ()
    arrays = (terrain.vertices, terrain.faces, *light, *terrain.parts, *starts)
    return keys.digest_bytes(*(array.tobytes() for array in arrays))


class LeftOut(NamedTuple):
    """Something that the runs of a configuration leave out of the scene, in words."""

    reduction: Reduction
    what: str

    def __str__(self) -> str:
        return f"{self.what}: {self.reduction.why}"


def left_out(config: Config, case: Case) -> list[LeftOut]:
    """List what the runs of a configuration leave out of the scene."""
    reductions = case.reductions
    if config.engine == COMPILED:  # which takes all corners
        reductions = tuple(r for r in reductions if r is not Reduction.HULL_VERTICES)
    if config.motion.kind == "table":
        reductions = tuple(r for r in reductions if r not in PROOFS)
    elif config.on_terrain:
        reductions = TERRAIN_REDUCTIONS if config.simulation.reduce else ()
    every = len(case.full.rock.vertices)
    gone = every - len(case.scene.rock.vertices)
    counted = {Reduction.HULL_VERTICES: f"{gone} of {every} {Reduction.HULL_VERTICES.what}"}
    return [LeftOut(reduction, counted.get(reduction, reduction.what)) for reduction in reductions]


def check_scenes(site: Site, scenes: Scenes) -> None:
    """See that scenes, engine and a given time step go together, before any run."""
    simulation, engine = scenes.config.simulation, scenes.config.engine
    shaking = motion_grid.of_site(site)
    if (count := motion_grid.count(shaking)) > MOST_RUNS:
        rule = f"a direction and friction has at most {MOST_RUNS:,}, which are held in memory"
        remedy = "part the study in several, or thin out its grid"
        raise InputError(Problem(site.file_of("motion"), "motion", f"{count:,} runs", rule, remedy))
    cases = [flat_case(scenes, group) for group in groups(scenes.config)]
    strongest = motion_grid.strongest(shaking)
    key = "simulation.engine"
    try:
        drive = cases[0].scene.drive
        engines.load(engine).build(cases[0].scene, drive.period if drive else 1e-3, 1)
        for case in cases:
            check_engine(case.full, engine, strongest[0])
        given = simulation.time_step
        key = key if given == "auto" else "simulation.time_step"
        for case in cases:
            step = longest_step(case.full, engine) if given == "auto" else given
            settings = Settings(step, simulation.reduce, engine)
            for motion in strongest:
                check(case, settings, motion)
        check_unshaken(cases[0], settings, strongest[0])
    except InvalidInput as error:
        raise InputError.from_invalid(site.file_of(key), key, error) from None


def engine_version(site: Site) -> dict[str, str]:
    """Tell the version of the engine that a site names, for the identity of a stage.

    What can be said of a given time step before the rock is made is said here, before any work.
    """
    name = site.config.engine
    try:
        version = engines.load(name).VERSION
    except InvalidInput as error:
        file = site.file_of("simulation.engine")
        raise InputError.from_invalid(file, "simulation.engine", error) from None
    _check_step_of_block(site)
    return {f"engine {name}": version}


def _check_step_of_block(site: Site) -> None:
    config, step = site.config, site.config.simulation.time_step
    if config.rock.size is None or config.rock.shape != "box" or step == "auto":
        return
    rock = block(config.rock.size, config.rock.density)
    settings = Settings(step, config.simulation.reduce, config.engine)
    drive = in_si.servo(config.servo) if config.drive == "servo" else None
    contact = in_si.contact(config.contact, config.contact.friction[0])
    strongest = motion_grid.strongest(motion_grid.of_site(site))
    try:
        for yaw in config.yaw:
            for motion in strongest:
                check_step(Scene(rock, contact, in_si.angle(yaw), drive=drive), settings, motion)
    except InvalidInput as error:
        file = site.file_of("simulation.time_step")
        raise InputError.from_invalid(file, "simulation.time_step", error) from None
