"""From a configuration to scenes: which physics a site asks for, and what identifies it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pipeline import keys
from pipeline.config import Config
from pipeline.layers import Site
from pipeline.problems import InputError
from pipeline.store import Store
from vsr_core.errors import Unfit

if TYPE_CHECKING:
    from vsr_core.simulate import Case

RUN_CODE = (
    "vsr_core.simulate:prepare",
    "vsr_core.simulate:simulate",
    "vsr_core.bounds:barrier",
    "vsr_core.motion:CosinePulse",
)
"""What determines a run, besides the engine."""


def code(engine: str) -> tuple[str, ...]:
    """Roots of the code that determines a run in an engine."""
    return (*RUN_CODE, f"vsr_core.engines.{engine}:build")


def identity(config: Config, store: Store) -> dict[str, Any]:
    """What all runs of a configuration share, but for direction, friction, motion and time step."""
    from pipeline.stages.rock import load_rock
    from vsr_core import engines

    rock, _ = load_rock(store)
    parts = (rock.vertices, rock.inertia, rock.axes)
    engine = config.simulation.engine
    return {
        "rock": [
            keys.digest_bytes(rock.shape.encode(), *(part.tobytes() for part in parts)),
            rock.mass,
        ],
        "pedestal": config.pedestal.shape,
        "contact": [config.contact.restitution, config.contact.rolling_friction],
        "drive": config.servo.model_dump() if config.drive == "servo" else config.drive,
        "simulation": [engine, config.simulation.reduce],
        "engine": engines.load(engine).VERSION,
        "code": keys.digest(keys.code(code(engine))),
    }


def prepared(config: Config, store: Store, yaw: float, friction: float) -> Case:
    """The case of one yaw [degree] and friction."""
    from pipeline.stages.rock import load_rock
    from vsr_core.scene import Contact, Scene
    from vsr_core.simulate import prepare

    rock, limits = load_rock(store)
    contact = Contact(friction, config.contact.restitution, config.contact.rolling_friction)
    drive = config.servo.servo() if config.drive == "servo" else None
    scene = Scene(rock, contact, math.radians(yaw), drive=drive)
    return prepare(scene, limits, reduce=config.simulation.reduce)


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
    from vsr_core import engines
    from vsr_core.motion import CosinePulse
    from vsr_core.precheck import check, longest_step
    from vsr_core.simulate import Settings

    config, simulation = site.config, site.config.simulation
    cases = [
        prepared(config, store, yaw, friction)
        for yaw in config.yaw
        for friction in config.contact.friction
    ]
    key = "simulation.engine"
    try:
        engines.load(simulation.engine).build(cases[0].scene, 1e-3, 1)
        given = simulation.time_step
        key = key if given == "auto" else "simulation.time_step"
        for case in cases:
            step = longest_step(case.full, simulation.engine) if given == "auto" else given
            settings = Settings(step, simulation.reduce, simulation.engine)
            for pgv_pga in {config.motion.pgv_pga[0], config.motion.pgv_pga[-1]}:
                check(case, settings, CosinePulse.from_g(config.motion.pga[-1], pgv_pga))
    except Unfit as error:
        raise InputError.from_unfit(site.file, key, error) from None
    return cases[0]


def engine_version(site: Site) -> dict[str, str]:
    """Version of the engine that a site names, for the identity of a stage."""
    from vsr_core import engines

    name = site.config.simulation.engine
    try:
        return {f"engine {name}": engines.load(name).VERSION}
    except Unfit as error:
        raise InputError.from_unfit(site.file, "simulation.engine", error) from None
