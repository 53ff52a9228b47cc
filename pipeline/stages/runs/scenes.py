"""From a configuration to scenes: which physics a site asks for, and what identifies it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from pipeline.config.in_si import contact
from pipeline.config.layers import Site
from pipeline.config.problems import InputError
from pipeline.config.schema import Config
from pipeline.stages.mesh.products import load_rock, load_terrain
from pipeline.stages.motions import shaking
from pipeline.workflow import keys
from pipeline.workflow.code_roots import RUN_CODE, TERRAIN_CODE
from pipeline.workflow.store import Store
from vsr_core import GRAVITY, engines
from vsr_core.errors import InvalidInput
from vsr_core.rock import reduction
from vsr_core.rock.solid import standing
from vsr_core.run import displacement
from vsr_core.run.cases import Case, Settings, TerrainCase, prepare
from vsr_core.run.cases import TerrainCase as Ground
from vsr_core.run.input_checks import COARSEST_SHARE, check, check_unshaken, longest_step
from vsr_core.run.reductions import TABLE_FRAME_REDUCTIONS, TERRAIN_REDUCTIONS, Reduction
from vsr_core.scene import Scene


def code(config: Config) -> tuple[str, ...]:
    """Roots of the code that determines the runs of a configuration."""
    roots = TERRAIN_CODE if config.on_terrain else RUN_CODE
    return (*roots, f"vsr_core.engines.{config.simulation.engine}:build")


def identity(config: Config, store: Store) -> dict[str, Any]:
    """What all runs of a configuration share, but for direction, friction, motion and time step."""
    rock, _ = load_rock(store)
    parts = (rock.vertices, rock.inertia, rock.axes)
    engine = config.simulation.engine
    return {
        "rock": [
            keys.digest_bytes(rock.shape.encode(), *(part.tobytes() for part in parts)),
            rock.mass,
        ],
        "pedestal": _terrain_identity(store) if config.on_terrain else config.pedestal.shape,
        "contact": [config.contact.restitution, config.contact.rolling_friction],
        "drive": config.servo.model_dump() if config.drive == "servo" else config.drive,
        "simulation": [engine, config.simulation.reduce],
        "engine": engines.load(engine).VERSION,
        "code": keys.digest(keys.code(code(config))),
    }


def _terrain_identity(store: Store) -> str:
    ground = load_terrain(store)
    starts = (
        array for start in ground.starts.values() for array in (start.position, start.rotation)
    )
    arrays = (ground.terrain.vertices, ground.terrain.faces, *ground.terrain.parts, *starts)
    return keys.digest_bytes(*(array.tobytes() for array in arrays))


def prepared(config: Config, store: Store, yaw: float, friction: float) -> Case:
    """The case of one yaw [degree] and friction on a flat pedestal."""
    rock, limits = load_rock(store)
    drive = config.servo.servo() if config.drive == "servo" else None
    if config.on_terrain:
        rock = standing(rock)
    scene = Scene(rock, contact(config, friction), math.radians(yaw), drive=drive)
    return prepare(scene, limits, reduce=config.simulation.reduce)


def on_terrain(config: Config, store: Store, yaw: float, friction: float) -> Ground:
    """The rock on its terrain, for shaking at one yaw [degree] and friction."""
    rock, limits = load_rock(store)
    ground = load_terrain(store)
    reduce = config.simulation.reduce
    terrain = ground.terrain if reduce else replace(ground.terrain, parts=())
    seat = Scene(
        reduction.on_its_seat(rock) if reduce else rock,
        contact(config, friction),
        math.radians(yaw),
        "terrain",
        start=ground.starts[friction],
        terrain=terrain,
    )
    if not reduce:
        return TerrainCase(seat, seat, limits.toppled_tilt)
    flight = replace(seat, rock=reduction.in_flight(rock))
    step = COARSEST_SHARE * math.sqrt(rock.radius / GRAVITY)
    return TerrainCase(seat, flight, limits.toppled_tilt, displacement.limits_on_seat(seat, step))


def left_out(config: Config, case: Case) -> tuple[Reduction, ...]:
    """What the runs of a configuration leave out; ``case`` is that of a flat pedestal."""
    if config.motion.kind == "table":  # proofs are for motions along x
        return tuple(r for r in case.reductions if r not in TABLE_FRAME_REDUCTIONS[1:])
    if not config.on_terrain:
        return case.reductions
    return TERRAIN_REDUCTIONS if config.simulation.reduce else ()


def check_scene(site: Site, store: Store) -> Case:
    """See that scene, engine and a given time step go together, before any run.

    Returns
    -------
    Case
        Of the first direction and friction.

    Raises
    ------
    InputError
        If they do not.
    """
    config, simulation = site.config, site.config.simulation
    cases = [
        prepared(config, store, yaw, friction)
        for yaw in config.yaw
        for friction in config.contact.friction
    ]
    strongest = shaking.strongest(shaking.of_site(site))
    key = "simulation.engine"
    try:
        engines.load(simulation.engine).build(cases[0].scene, 1e-3, 1)
        given = simulation.time_step
        key = key if given == "auto" else "simulation.time_step"
        for case in cases:
            step = longest_step(case.full, simulation.engine) if given == "auto" else given
            settings = Settings(step, simulation.reduce, simulation.engine)
            for motion in strongest:
                check(case, settings, motion)
        check_unshaken(cases[0], settings, strongest[0])
    except InvalidInput as error:
        raise InputError.from_invalid(site.file, key, error) from None
    return cases[0]


def engine_version(site: Site) -> dict[str, str]:
    """Version of the engine that a site names, for the identity of a stage."""
    name = site.config.simulation.engine
    try:
        return {f"engine {name}": engines.load(name).VERSION}
    except InvalidInput as error:
        raise InputError.from_invalid(site.file, "simulation.engine", error) from None
