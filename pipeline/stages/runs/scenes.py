"""From a configuration to scenes: which physics a site asks for, and what identifies it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from pipeline.config import in_si
from pipeline.config.layers import Origin, Site
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import COMPILED, SceneSettings
from pipeline.stages.mesh import seating
from pipeline.stages.mesh.products import Ground, Standing
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Shaking
from pipeline.workflow import graph, keys
from pipeline.workflow.keys import RUN_CODE, TERRAIN_CODE
from pipeline.workflow.stage import Job
from vsr_core import engines
from vsr_core.errors import InvalidInput
from vsr_core.rock import reduction
from vsr_core.rock.body import Rock
from vsr_core.rock.solid import block, standing
from vsr_core.run import displacement
from vsr_core.run.cases import Case, Settings, TerrainCase, prepare
from vsr_core.run.input_checks import (
    check,
    check_drive,
    check_engine,
    check_step,
    check_unshaken,
    longest_step,
)
from vsr_core.run.reductions import PROOFS, TERRAIN_REDUCTIONS, Reduction
from vsr_core.run.time_step import step_unit
from vsr_core.scene import Scene
from vsr_core.source import tracing
from vsr_core.table.servo import Servo

MOST_RUNS = 10_000_000
"""Runs of one direction and friction, of which some 20 bytes a run are held, and pictures drawn."""


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
    """What the scenes of all groups of a study are built from."""

    settings: SceneSettings
    standing: Standing
    ground: Ground | None = None

    @property
    def rock(self) -> Rock:
        """The rock in the pose in which it stands."""
        return self.standing.rock

    @cached_property
    def level_rock(self) -> Rock:
        """The rock as it stands on a flat pedestal."""
        return standing(self.rock) if self.settings.on_terrain else self.rock

    @cached_property
    def seated_rock(self) -> Rock:
        """The rock as it stands on its seat in runs."""
        whole = self.ground is not None and self.ground.whole_seam
        reduce = self.settings.simulation.reduce
        return seating.seated(self.rock, reduce=reduce, whole_seam=whole)

    @cached_property
    def flying_rock(self) -> Rock:
        """The rock in runs once it has toppled."""
        return reduction.in_flight(self.rock) if self.settings.simulation.reduce else self.rock

    def with_contact(self, **changes: Any) -> Scenes:
        """The same with another contact."""
        return replace(self, settings=self.settings.with_contact(**changes))


def groups(yaw: tuple[float, ...], settings: SceneSettings) -> tuple[Group, ...]:
    """List the groups of a study."""
    return tuple(Group(one, friction) for one in yaw for friction in settings.contact.friction)


def flat_scene(scenes: Scenes, group: Group, drive: Servo | None = None) -> Scene:
    """Set the rock on a flat pedestal."""
    contact = in_si.contact(scenes.settings.contact, group.friction)
    return Scene(scenes.level_rock, contact, in_si.angle(group.yaw), drive=drive)


def flat_case(scenes: Scenes, group: Group) -> Case:
    """Prepare the scene of a group on a flat pedestal, driven as the configuration says."""
    scene = flat_scene(scenes, group, _servo(scenes.settings))
    return prepare(scene, scenes.standing.barrier, reduce=scenes.settings.simulation.reduce)


def _servo(settings: SceneSettings) -> Servo | None:
    return None if settings.servo is None else in_si.servo(settings.servo)


def reach(scenes: Scenes) -> float:
    """Largest PGA that the force of the servo gives table and rock [g], infinite without a limit.

    Returns
    -------
    float [g]
    """
    servo = _servo(scenes.settings)
    if servo is None:
        return math.inf
    return in_si.in_g(servo.force_limit / (servo.mass + scenes.level_rock.mass))


def terrain_case(scenes: Scenes, group: Group) -> TerrainCase:
    """Set the rock on its terrain for the shaking of a group."""
    ground, rock, settings = scenes.ground, scenes.rock, scenes.settings
    assert ground is not None
    toppled, reduce = scenes.standing.barrier.toppled_tilt, settings.simulation.reduce
    seat = Scene(
        scenes.seated_rock,
        in_si.contact(settings.contact, group.friction),
        in_si.angle(group.yaw),
        "terrain",
        start=ground.starts[settings.contact.friction.index(group.friction)],
        terrain=ground.terrain,
    )
    if not reduce:
        return TerrainCase(seat, seat, toppled)
    flight = replace(seat, rock=scenes.flying_rock)
    engine = settings.engine
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
    config, rock, ground = scenes.settings, scenes.rock, scenes.ground
    touching = rock.pieces if ground else ()
    parts = (rock.vertices, rock.inertia, rock.axes, *touching)
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
        "drive": config.drive if config.servo is None else config.servo.model_dump(),
        "simulation": [engine, config.simulation.reduce],
        "engine": engines.load(engine).VERSION,
        "code": keys.digest(tracing.reached(code(engine, terrain=ground is not None))),
    }


def alone_at(scenes: Scenes, place: int) -> Scenes:
    """Those of one friction, by its place among all."""
    one, contact = slice(place, place + 1), scenes.settings.contact
    contact = contact.model_copy(update={"friction": contact.friction[one]})
    ground = scenes.ground and replace(scenes.ground, starts=scenes.ground.starts[one])
    return replace(scenes, settings=scenes.settings._replace(contact=contact), ground=ground)


def _ground_identity(ground: Ground) -> str:
    starts = (array for start in ground.starts for array in (start.position, start.rotation))
    terrain = ground.terrain
    arrays = (terrain.vertices, terrain.faces, *starts)
    return keys.digest_bytes(*(array.tobytes() for array in arrays), bytes([ground.whole_seam]))


class LeftOut(NamedTuple):
    """Something that the runs of a configuration leave out of the scene, in words."""

    reduction: Reduction
    what: str

    def __str__(self) -> str:
        return f"{self.what}: {self.reduction.why}"


def left_out(settings: SceneSettings, case: Case, *, one_way: bool) -> list[LeftOut]:
    """List what the runs of a study leave out of the scene.

    Parameters
    ----------
    one_way : bool, whether all motions are along one axis
    """
    reductions = case.reductions
    if settings.on_terrain:
        reductions = TERRAIN_REDUCTIONS if settings.simulation.reduce else ()
    if settings.engine == COMPILED:  # which takes all corners
        reductions = tuple(r for r in reductions if r is not Reduction.HULL_VERTICES)
    if not one_way:
        reductions = tuple(r for r in reductions if r not in PROOFS)
    every = len(case.full.rock.vertices)
    gone = every - len(case.scene.rock.vertices)
    counted = {Reduction.HULL_VERTICES: f"{gone} of {every} {Reduction.HULL_VERTICES.what}"}
    return [LeftOut(reduction, counted.get(reduction, reduction.what)) for reduction in reductions]


def refuse_engine(scenes: Scenes, origin: Origin) -> None:
    """Refuse a scene that the engine cannot hold, before any run."""
    settings = scenes.settings
    case = flat_case(scenes, Group(0.0, settings.contact.friction[0]))
    drive = case.scene.drive
    try:
        engines.load(settings.engine).build(case.scene, drive.period if drive else 1e-3, 1)
    except InvalidInput as error:
        key = "simulation.engine"
        raise InputError.from_invalid(origin.file_of(key), key, error) from None


def refuse_motions(
    scenes: Scenes, yaw: tuple[float, ...], motions: Shaking, origin: Origin
) -> None:
    """Refuse motions that go not together with scenes, engine and a given time step."""
    simulation, engine = scenes.settings.simulation, scenes.settings.engine
    cases = [flat_case(scenes, group) for group in groups(yaw, scenes.settings)]
    strongest, given = motion_grid.strongest(motions), simulation.time_step
    key = "simulation.engine" if given == "auto" else "simulation.time_step"
    try:
        for case in cases:
            check_engine(case.full, engine, strongest[0])
    except InvalidInput as error:
        where = "simulation.engine"
        raise InputError.from_invalid(origin.file_of(where), where, error) from None
    try:
        for case in cases:
            step = longest_step(case.full, engine) if given == "auto" else given
            settings = Settings(step, simulation.reduce, engine)
            for motion in strongest:
                check(case, settings, motion)
        check_unshaken(cases[0], settings, strongest[0])
    except InvalidInput as error:
        raise InputError.from_invalid(origin.file_of(key), key, error) from None
    if cases[0].full.drive is not None:
        refuse_force(scenes, motions.pga[-1], origin)
        key = "servo.kp"
        try:
            for motion in strongest:
                check_drive(cases[0].full, motion)
        except InvalidInput as error:
            raise InputError.from_invalid(origin.file_of(key), key, error) from None


def refuse_force(scenes: Scenes, pga: float, origin: Origin) -> None:
    """Refuse a servo whose force cannot give table and rock the largest PGA [g] of the grid."""
    most = reach(scenes)
    if pga <= most:
        return
    key, servo = "servo.force_limit", _servo(scenes.settings)
    assert servo is not None
    given = f"{servo.force_limit:g} N for {servo.mass + scenes.level_rock.mass:.4g} kg"
    rule = f"it gives table and rock {most:.3g} g at most, and they are to have {pga:.3g} g"
    remedy = f"give {servo.force_limit * pga / most:.3g} N or more, or end motion.pga lower"
    raise InputError(Problem(origin.file_of(key), key, given, rule, remedy))


def refuse_runs(job: Job) -> None:
    """Refuse what can be told once the rock of a site is made."""
    config = job.config
    scenes = Scenes(config.scene, graph.built(Standing, job))
    refuse_engine(scenes, job.site)
    refuse_motions(scenes, config.yaw, motion_grid.of_site(job.site), job.site)


def refuse_number(site: Site) -> None:
    """Refuse more runs than can be done."""
    if (count := motion_grid.count(motion_grid.of_site(site))) > MOST_RUNS:
        rule = f"a direction and friction has at most {MOST_RUNS:,}, which are held in memory"
        remedy = "part the study in several, or thin out its grid"
        raise InputError(Problem(site.file_of("motion"), "motion", f"{count:,} runs", rule, remedy))


def _refuse_turns(site: Site, motions: Shaking) -> None:
    """Refuse a table that turns, under a terrain."""
    try:
        for motion in motion_grid.strongest(motions):
            displacement.refuse_turns(motion)
    except InvalidInput as error:
        raise InputError.from_invalid(site.file_of("motion"), "motion", error) from None


def refuse_step(site: Site) -> None:
    """Refuse motions that a terrain, or a block at a given time step, does not go together with.

    That is what can be said before the rock is made.
    """
    motions, settings = motion_grid.of_site(site), site.config.scene
    if settings.on_terrain:
        _refuse_turns(site, motions)
    size, step = site.config.rock.size, settings.simulation.time_step
    if size is None or site.config.rock.shape != "box" or step == "auto":
        return
    rock = block(size, site.config.rock.density)
    how = Settings(step, settings.simulation.reduce, settings.engine)
    contact = in_si.contact(settings.contact, settings.contact.friction[0])
    try:
        for yaw in site.config.yaw:
            scene = Scene(rock, contact, in_si.angle(yaw), drive=_servo(settings))
            for motion in motion_grid.strongest(motions):
                check_step(scene, how, motion)
    except InvalidInput as error:
        key = "simulation.time_step"
        raise InputError.from_invalid(site.file_of(key), key, error) from None
