"""What a run needs of its motion, time step, contact and servo: refused before it starts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from vsr_core import GRAVITY, engines
from vsr_core.errors import InvalidInput
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.rock.body import Rock
from vsr_core.rock.tipping import tipping
from vsr_core.run.cases import Case, Settings
from vsr_core.run.sampling import first_step, samples, sampling
from vsr_core.scene import Contact, Scene
from vsr_core.table.servo import Servo, loop

PERIOD_SHARE = 0.4
"""Longest control period, as a share of the motion's shortest time. At it a servo that takes an
error away in one period moves a block's boundary by 1.3 %, at 0.8 by 7 %."""

PERFORMED = (0.5, 1.5)
"""Least and largest share of the PGA that a servo's table reaches, in the mean of a command period
and were its force not limited. The published servo reaches 0.96 to 1.08 of it in any pulse that
``PERIOD_SHARE`` leaves it."""

ASTRAY = 0.5
"""Largest error of a servo's velocity, as a share of the PGV; at most 0.16 of the published one."""

REBOUND_ERROR = 0.03
"""Error allowed of the rebound from a spring, as a share of the speed of approach."""

LATE = 0.2
"""Longest step of a well damped spring, as a share of the inverse of its frequency. At it a rebound
is wrong by at most 0.026 of the speed of approach, at 0.7 by 0.07."""

UNSHAKEN_TIME = 20.0
"""Time for which a rock has to stand where nothing shakes it, in units of sqrt(radius / g). One
that an engine holds on too small a base falls in 4 to 12."""

UNSHAKEN_LEAN = 0.01
"""Tilt [rad] that it may have by then, as a share of the tangent of its least tipping angle. What
stands keeps to a fiftieth of that."""

SINK_SHARE = 0.002
"""Depth allowed of a point on a spring that bears the whole rock, as a share of its radius. A
landing goes some five times as deep, to where a run is stopped."""


def check(case: Case, settings: Settings, motion: GroundMotion) -> None:
    """Refuse what no outcome could be trusted of, or what would end as ``UNSTABLE``.

    The servo's own loop is checked by ``prepare``. A step too coarse for the motion is none of
    this: ``simulate`` refines it.

    Parameters
    ----------
    motion : GroundMotion, the one with the shortest times where there are several

    Raises
    ------
    InvalidInput
        With what was given, the limit and what to change.
    """
    scene = case.full
    _check_motion(motion, scene.drive)
    check_engine(scene, settings.engine, motion)
    time_step = check_step(scene, settings, motion)
    if scene.contact.stiffness is not None:
        _check_springs(scene.contact, scene.contact.stiffness, scene.rock, time_step)


def check_engine(scene: Scene, engine: str, motion: GroundMotion) -> None:
    """Refuse a motion that an engine lacks, or a friction at which it topples what slides."""
    if motion.columns == 9 and engine == "mujoco":
        rule = "it has no forces of a table that turns"
        raise InvalidInput(f"a table that turns in {engine}", rule, "use simulation.engine: auto")
    slenderness, sliding = _slenderness(scene), engines.load(engine).SLIDING_SHARE
    if sliding * slenderness < scene.contact.friction < slenderness:
        raise InvalidInput(
            f"a friction of {scene.contact.friction:g} for a rock that tips at {slenderness:.3g} g",
            f"it slides before it tips, and {engine} lifts what slides",
            "use simulation.engine: auto",
        )


def check_step(scene: Scene, settings: Settings, motion: GroundMotion) -> float:
    """Refuse a time step at which the engine does not rock a rock right.

    Returns
    -------
    float [s], the step that this motion begins with

    Raises
    ------
    InvalidInput
        With the step and the longest.
    """
    time_step = first_step(motion, scene.drive, settings.time_step)
    longest = longest_step(scene, settings.engine)
    if time_step > longest * (1.0 + 1e-9):
        rule = f"this rock rocks too fast for more than {1e3 * longest:.4g} ms"
        remedy = "shorten the step, or let it be chosen (simulation.time_step: auto)"
        raise InvalidInput(f"a time step of {1e3 * time_step:.4g} ms", rule, remedy)
    return time_step


def check_drive(scene: Scene, motion: GroundMotion) -> None:
    """Refuse a servo that does not perform a motion, with the rock at rest on its table.

    Parameters
    ----------
    scene : Scene, with a servo whose command period is short enough for the motion

    Raises
    ------
    InvalidInput
        With the gains, the share of the PGA that the table reaches, and what to change.
    """
    drive = scene.drive
    assert drive is not None
    number = sampling(motion, drive, drive.period).pulse_samples
    standing = replace(drive, mass=drive.mass + scene.rock.mass)
    commands = samples(motion, drive, drive.period, number)
    made, free = (
        loop(replace(standing, force_limit=most), commands)
        for most in (drive.force_limit, math.inf)
    )
    wanted = motion.velocity(drive.period * np.arange(1, number + 1, dtype=np.float64))
    ends = slice(drive.hold - 1, None, drive.hold)
    peaks = [np.abs(np.diff(speed[ends], prepend=0.0)).max() for speed in (free, wanted)]
    share = float(peaks[0] / peaks[1])
    astray = float(np.abs(made - wanted)[ends].max() / np.abs(wanted).max())
    if not PERFORMED[0] <= share <= PERFORMED[1] or astray > ASTRAY:
        raise InvalidInput(
            f"kp = {drive.kp:g}, ki = {drive.ki:g} and kd = {drive.kd:g} on {standing.mass:.4g} "
            f"kg, by which the table reaches {share:.3g} of the PGA and is off by {astray:.2g} PGV",
            f"a servo reaches {PERFORMED[0]:g} to {PERFORMED[1]:g} of it and is off by "
            f"{ASTRAY:g} at most, or its motion is another",
            f"{'raise kp' if share < 1.0 else 'lower ki, or give kp = mass / period'}, and see "
            "vsr run drive",
        )


def check_unshaken(case: Case, settings: Settings, motion: GroundMotion) -> None:
    """Refuse a rock that falls by itself in its engine: no shaking would be what toppled it.

    An engine has tolerances of its own, below which a base is a point: Bullet drops a block of
    1:100, whose base is narrower than the gap within which it takes corners for one.

    Parameters
    ----------
    motion : GroundMotion, which it is to be shaken by: steps are as fine as for that

    Raises
    ------
    InvalidInput
        If it leans after ``UNSHAKEN_TIME``. Not for a rock that does not start at rest.
    """
    scene = case.scene
    if scene.start is not None:
        return
    taken = sampling(motion, scene.drive, first_step(motion, scene.drive, settings.time_step))
    world = engines.load(settings.engine).build(
        scene, taken.interval / taken.substeps, taken.substeps, settings.solver
    )
    samples = math.ceil(UNSHAKEN_TIME * math.sqrt(scene.rock.radius / GRAVITY) / taken.interval)
    world.advance([0.0] * samples)
    lean = math.hypot(*world.state().rotation[:2, 2].tolist())
    if not lean <= UNSHAKEN_LEAN * _slenderness(scene):
        raise InvalidInput(
            f"a rock that leans by {lean:.2g} rad in {settings.engine} where nothing shakes it",
            f"it tips at {_slenderness(scene):.2g} rad, and stands until it is shaken",
            "shorten the step, use another engine, or see whether its base is that narrow",
        )


def longest_step(scene: Scene, engine: str) -> float:
    """Longest time step [s] at which an engine rocks the rock of a scene right.

    Returns
    -------
    float [s]
    """
    library = engines.load(engine)
    share = min(library.LADDER.longest, library.SLENDER_SHARE * _slenderness(scene))
    return share * math.sqrt(scene.rock.radius / GRAVITY)


def softest(rock: Rock) -> float:
    """Least stiffness [N/m] of a point of contact that a rock may stand on.

    Returns
    -------
    float [N/m]
    """
    return rock.mass * GRAVITY / (SINK_SHARE * rock.radius)


def longest_step_on_springs(contact: Contact, mass: float) -> float:
    """Longest time step [s] that resolves how a rock rebounds from springs at four points.

    Stepped implicitly, a spring of frequency w loses as much as one with w h / 2 of the critical
    damping, which changes the rebound e by e pi w h / 2. And Bullet finds a landing up to a step
    late: up to w h = ``LATE`` that changes the rebound by no more than that.

    Parameters
    ----------
    mass : float [kg], of the rock

    Returns
    -------
    float [s]
    """
    assert contact.stiffness is not None
    frequency = math.sqrt(4.0 * contact.stiffness / mass)
    resolved = 2.0 * REBOUND_ERROR / (math.pi * rebound(contact, mass))
    return min(resolved, LATE) / frequency


def rebound(contact: Contact, mass: float) -> float:
    """Coefficient of restitution of a rock that drops on springs and dashpots at four points.

    The rock leaves when the force is zero: dashpots do not pull.

    Parameters
    ----------
    mass : float [kg], of the rock

    Returns
    -------
    float, speed after over speed before

    References
    ----------
    Schwager & Poeschel (2007), Granular Matter 9(6), 465-469.

    Examples
    --------
    Springs without dashpots lose nothing:

    >>> rebound(Contact(0.6, stiffness=1e6), 1000.0)
    1.0
    """
    assert contact.stiffness is not None
    zeta = contact.damping / math.sqrt(contact.stiffness * mass)
    if zeta < 1.0:
        root = math.sqrt(1.0 - zeta**2)
        return math.exp(-2.0 * zeta / root * math.atan2(root, zeta))
    if zeta == 1.0:
        return math.exp(-2.0)
    root = math.sqrt(zeta**2 - 1.0)
    return math.exp(-2.0 * zeta / root * math.atanh(root / zeta))


def _slenderness(scene: Scene) -> float:
    """Steady acceleration [g] that tips the rock along the shaking: tan(alpha) of a block."""
    along = np.array([-scene.yaw, math.pi - scene.yaw])
    return float(tipping(scene.rock.hull, along).overturning.min())


def _check_motion(motion: GroundMotion, drive: Servo | None) -> None:
    times = (motion.duration, motion.shortest_time, motion.peak_acceleration)
    known = all(math.isfinite(value) for value in times) and min(times[:2]) > 0.0
    if known:
        taken = sampling(motion, drive, first_step(motion, drive, math.inf))
        values = samples(motion, drive, taken.interval, taken.pulse_samples)
        known = bool(np.isfinite(values).all())
    if not known:
        given = "a motion with values that are not numbers"
        rule = "its acceleration, duration and shortest time must be finite"
        raise InvalidInput(given, rule, "fill its gaps, or cut it before them")
    if drive is not None and motion.columns > 1:
        given = "a servo for a motion in several axes"
        raise InvalidInput(given, "its table slides along x", "set drive: table_frame")
    if drive is not None and drive.command_period > PERIOD_SHARE * motion.shortest_time:
        what = "control" if drive.hold == 1 else "command"
        raise InvalidInput(
            f"a {what} period of {1e3 * drive.command_period:.4g} ms for a motion whose shortest "
            f"time is {1e3 * motion.shortest_time:.4g} ms",
            f"a servo follows it at periods up to {PERIOD_SHARE:g} of that",
            "shorten the period, or leave out the shortest motions",
        )


def _check_springs(contact: Contact, stiffness: float, rock: Rock, time_step: float) -> None:
    given = f"a contact stiffness of {stiffness:g} N/m under {rock.mass:.4g} kg"
    if contact.restitution > 0.0:
        rule = "springs make the rebound themselves"
        remedy = "state their damping in place of the restitution"
        raise InvalidInput(f"{given} and a restitution of {contact.restitution:g}", rule, remedy)
    if not (0.0 < stiffness < math.inf and 0.0 <= contact.damping < math.inf):
        rule = "the stiffness must be above 0, the damping not below, both finite"
        remedy = "state them in N/m and N s/m"
        raise InvalidInput(f"{given} with a damping of {contact.damping:g} N s/m", rule, remedy)
    if stiffness < softest(rock):
        raise InvalidInput(
            given,
            f"a point that bears all of it sinks by {1e3 * rock.mass * GRAVITY / stiffness:.3g} "
            f"mm, and a rock of this size may by {1e3 * SINK_SHARE * rock.radius:.3g} mm",
            f"raise it to {softest(rock):.3g} N/m or more",
        )
    longest = longest_step_on_springs(contact, rock.mass)
    if time_step > longest * (1.0 + 1e-9):
        rule = f"its rebound is right to {REBOUND_ERROR:.0%} at steps up to {1e3 * longest:.3g} ms"
        remedy = "shorten the step, soften the springs or damp them"
        raise InvalidInput(f"{given} at a time step of {1e3 * time_step:.4g} ms", rule, remedy)
