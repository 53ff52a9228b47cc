"""Raw scans with a known truth, from the scan to the verdicts of runs.

They take minutes, and are run where they are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import shapely
import trimesh

from vsr_core import GRAVITY, engines
from vsr_core.arrays import Array
from vsr_core.engines import nonsmooth
from vsr_core.errors import InvalidInput
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome, StopReason
from vsr_core.rock import reduction
from vsr_core.run import displacement
from vsr_core.run.cases import Settings, TerrainCase
from vsr_core.scene import Contact, Scene
from vsr_core.surrogates.field_scans import FieldScan, above_ground
from vsr_core.verification.stability import ExtremeCase, Measured
from vsr_core.verification.stability._field import (
    FRICTION,
    longest_step,
    on_its_points,
    prepared,
    pushes,
    settled,
    tipping_limit,
    turned,
)
from vsr_core.verification.stability._points import CONTACTS, tilts

FIELDS = {
    "smooth and clean": FieldScan(21, noise=0.0, roughness=0.003, edge=0.06),
    "noise of 1 mm": FieldScan(33, noise=0.001, edge=0.06),
    "noise of 3.5 mm": FieldScan(34, noise=0.0035, edge=0.06),
    "noise of 5 mm": FieldScan(22, noise=0.005, edge=0.06),
    "level ground, sunk 0": FieldScan(35, roughness=0.0, sunk=0.0, edge=0.06),
    "rough ground, sunk 1 cm": FieldScan(23, roughness=0.03, sunk=0.01, edge=0.06),
    "rougher ground": FieldScan(36, roughness=0.05, sunk=0.02, edge=0.06),
    "sunk 3 cm": FieldScan(24, sunk=0.03, edge=0.06),
    "sunk 3 cm, noise of 5 mm": FieldScan(37, sunk=0.03, noise=0.005, edge=0.06),
    "slope of 8 deg": FieldScan(38, slope=8.0, sunk=0.01, edge=0.06),
    "slope of 15 deg": FieldScan(25, slope=15.0, sunk=0.02, edge=0.06),
    "slope of 25 deg": FieldScan(26, slope=25.0, sunk=0.02, edge=0.06),
    "two walls": FieldScan(39, walls=2, sunk=0.01, edge=0.06),
    "three walls": FieldScan(27, walls=3, sunk=0.01),
    "three walls on a slope": FieldScan(40, walls=3, slope=10.0, sunk=0.01, edge=0.06),
    "a waist": FieldScan(28, waist=0.12, sunk=0.01, edge=0.06),
    "a waist on a slope": FieldScan(41, waist=0.1, slope=10.0, sunk=0.02, edge=0.06),
    "three pebbles": FieldScan(29, pebbles=True, edge=0.045),
    "three pebbles, rough": FieldScan(42, pebbles=True, roughness=0.02, edge=0.045),
    "holes in the scan": FieldScan(30, holes=4, edge=0.06),
    "holes and noise": FieldScan(43, holes=8, noise=0.004, edge=0.06),
    "squat": FieldScan(31, half_axes=(0.5, 0.45, 0.35), edge=0.06),
    "small, coarse": FieldScan(32, half_axes=(0.3, 0.25, 0.5)),
    "small, fine": FieldScan(32, half_axes=(0.3, 0.25, 0.5), edge=0.03),
}

SETTLING = 5.0
"""CPU time in which a rock must settle [s]."""

DIRECTIONS = np.radians(np.arange(0.0, 360.0, 45.0))

PULSES = ((1.5, 0.4), (2.0, 0.3), (2.0, 0.5), (3.0, 0.2))
"""PGA by the acceleration that tips the rock toward -x, and PGV/PGA by sqrt(radius / g)."""

_PUSH_TIME = 12.0  # sqrt(radius / g), for which a steady push acts
_LOOKS = 24  # in that time
_FALLEN = math.radians(1.0)
_HALVINGS = 5
_UPRIGHT = math.cos(math.radians(30.0))  # of a push: steeper sides can hold a rock by friction
_REST = 1.0  # s after a pulse
_LOOK = 5  # steps between looks at a tilt
_FINE = 0.025  # of the longest step
_HALF = 0.5  # of the longest step: at the longest, a limit can be 2 % low
_RETURNED = 0.95  # share of a tilt from which on it is told that a rock comes back
_TOUCHED = 2e-3  # rad, of a seat that settles
_SMALL = math.radians(0.3)  # swings below this are compared by it
_GRIP = 1.4  # friction by the acceleration that tips the rock, with which it does not slide
_LAYER = 0.03  # of an edge, by which the surface of a scan is off in the mean: it cuts off arcs
_SLIPPERY = 0.2  # friction in a niche: with more of it, what holds the rock has several answers

_DECIDED = (Outcome.BALANCED, Outcome.DISPLACED, Outcome.OVERTURNED)


class _Solid(NamedTuple):
    """Volume [m^3], centre of mass [m] and principal moments of inertia of unit density [m^5]."""

    volume: float
    centre: Array
    inertia: Array


class _Solids(NamedTuple):
    """A rock as it was made of its scan, the true one, and what cannot be known of it.

    ``above`` is the true one without what is in the ground; ``caps`` and ``hull`` are the rock with
    its underside closed in two ways, the same where one of them is refused; ``layer`` is the share
    of its volume in a layer as thick as a surface of such edges is off in the mean.
    """

    made: _Solid
    true: _Solid
    above: _Solid
    caps: _Solid
    hull: _Solid
    layer: float


def _solids(field: FieldScan) -> _Solids:
    raw, made = prepared(field)
    whole = trimesh.Trimesh(raw.rock_vertices, raw.rock_faces)
    own, true, above = map(_solid, (made.rock, whole, trimesh.Trimesh(*above_ground(field))))
    own = own._replace(centre=own.centre + made.origin)
    caps = made.steps[2].after
    hull = next((way.measure for way in made.trials if way.closing == "hull"), None) or caps
    one, other = (
        _Solid(way.volume, way.centre_of_mass, _moments(way.inertia)) for way in (caps, hull)
    )
    layer = _LAYER * field.edge * float(whole.area) / true.volume
    return _Solids(own, true, above, one, other, layer)


def _solid(mesh: trimesh.Trimesh) -> _Solid:
    return _Solid(float(mesh.volume), np.array(mesh.center_mass), _moments(mesh.moment_inertia))


def _moments(inertia: Array) -> Array:
    return np.array(np.linalg.eigvalsh(inertia))


def _volume(field: FieldScan) -> Measured:
    def apart(one: _Solid, other: _Solid) -> float:
        return abs(one.volume / other.volume - 1.0)

    solids = _solids(field)
    return _known(solids, apart, 1.0, solids.made.volume, solids.true.volume)


def _centre(field: FieldScan) -> Measured:
    solids = _solids(field)
    size = solids.true.volume ** (1.0 / 3.0)

    def apart(one: _Solid, other: _Solid) -> float:
        return float(np.linalg.norm(one.centre - other.centre)) / size

    return _known(solids, apart, 0.5, apart(solids.made, solids.true) * size, 0.0)


def _inertia(field: FieldScan) -> Measured:
    solids = _solids(field)
    own, expected = solids.made.inertia, solids.true.inertia
    worst = int(np.abs(own / expected - 1.0).argmax())

    def apart(one: _Solid, other: _Solid) -> float:
        return float(np.abs(one.inertia / other.inertia - 1.0).max())

    return _known(solids, apart, 3.0, float(own[worst]), float(expected[worst]))


def _known(
    solids: _Solids,
    apart: Callable[[_Solid, _Solid], float],
    layers: float,
    measured: float,
    expected: float,
) -> Measured:
    """By what cannot be known of the rock, and so many layers: those at its ends count for more."""
    off, scanned = apart(solids.made, solids.true), layers * solids.layer
    unseen = max(apart(solids.above, solids.true), apart(solids.hull, solids.caps))
    note = f"{off:.1%} off; unseen {unseen:.1%}, scanned to {scanned:.1%}"
    return Measured(measured, expected, off / (unseen + scanned), note)


def _settles(field: FieldScan) -> Measured:
    made = settled(field)
    start = made.scene.start
    assert start is not None
    shift = float(np.linalg.norm(start.position - [0.0, 0.0, made.rock.height]))
    angle = math.acos(min(1.0, 0.5 * (float(np.trace(start.rotation)) - 1.0)))
    off = max(shift / 1e-3, math.degrees(angle) / 0.2, made.seconds / SETTLING)
    note = f"{1e3 * shift:.2f} mm, {math.degrees(angle):.3f} deg"
    return Measured(made.seconds, 0.0, off, note)


def _energy(field: FieldScan) -> Measured:
    """Of a rock left alone on its seat, per mass, by what its potential grew or its speed is."""
    made = settled(field)
    world, highest = nonsmooth.build(made.scene, longest_step(made.rock), 1), 0.0
    start = world.state().position[2]
    for _ in range(100):
        world.advance([0.0] * 4)
        now = world.state()
        moving = 0.5 * float(now.velocity @ now.velocity)
        highest = max(highest, moving + GRAVITY * (float(now.position[2]) - start))
    return Measured(highest, 0.0, highest / (GRAVITY * made.rock.radius))


def _tips(field: FieldScan) -> Measured:
    """The steady push from which on the rock falls over, in the worst of eight directions.

    It stands on the points that push it upward; friction on the others would hold it down. Where
    those are not around its weight, it stands on all of them, and may be held longer.
    """
    made = settled(field)
    centre, points = np.array([0.0, 0.0, made.rock.height]), made.seat.points
    bears = pushes(made.seat)[:, 2] > _UPRIGHT
    wedged = not _around_weight(points[bears])
    bears |= wedged
    scene, worst = on_its_points(made, bears), Measured(math.nan, math.nan, 0.0)
    for turn in DIRECTIONS:
        toward = np.array([math.cos(turn), math.sin(turn), 0.0])
        expected = tipping_limit(points[bears], centre, toward)
        held = replace(scene, contact=Contact(2.0 * expected / GRAVITY + 1.0))
        low, high = 0.9 * expected, 1.1 * expected
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if _falls(held, -middle * toward) else (middle, high)
        found = 0.5 * (low + high)
        error = 1.0 - found / expected if wedged else abs(found / expected - 1.0)
        if error >= worst.error:
            note = f"toward {math.degrees(turn):.0f} deg"
            worst = Measured(found / GRAVITY, expected / GRAVITY, error, note)
    if wedged:
        return replace(worst, note="walls hold it no less in any direction")
    return worst


def _around_weight(points: Array) -> bool:
    return bool(shapely.contains_xy(shapely.convex_hull(shapely.MultiPoint(points[:, :2])), 0, 0))


def _falls(scene: Scene, push: Array) -> bool:
    """Whether a steady acceleration of the table [m/s^2] tips a rock at rest."""
    step = _HALF * longest_step(scene.rock)
    world = nonsmooth.build(scene, step, 1)
    begun = world.state()
    steps = math.ceil(_PUSH_TIME * math.sqrt(scene.rock.radius / GRAVITY) / step / _LOOKS)
    for _ in range(_LOOKS):
        world.shake(np.tile(push, (steps, 1)))
        if turned(world.state(), begun) > _FALLEN:
            return True
    return False


def _tilts(field: FieldScan) -> Measured:
    """The worst of four pulses, up to the first return; of its whole run the peaks are told.

    After an impact of several points at once two laws of impact go apart. Where a rock slides on
    steep points, or stands between walls, MuJoCo's own answer changes with its step and with the
    time constant of its contact; by as much none is judged.
    """
    made = settled(field)
    rock, points, upward = made.rock, made.seat.points, pushes(made.seat)
    centre = np.array([0.0, 0.0, rock.height])
    limit, unit = tipping_limit(points, centre, -np.eye(3)[0]), math.sqrt(rock.radius / GRAVITY)
    friction = _SLIPPERY if field.walls else max(FRICTION, _GRIP * limit / GRAVITY)
    scene, worst = replace(on_its_points(made), contact=Contact(friction)), None
    for by_limit, by_unit in PULSES:
        pulse = CosinePulse(by_limit * limit, by_unit * unit)
        ours = _tilts_in("nonsmooth", scene, _FINE * longest_step(rock), pulse)
        theirs, *others = (
            tilts(made.scene.rock, points, upward, friction, pulse, _REST, *law) for law in CONTACTS
        )
        shaken = pulse.duration / (pulse.duration + _REST)
        found, expected = swings(ours, theirs, shaken)
        unsure = max(abs(swings(other, theirs, shaken)[0] - expected) for other in others)
        error = max(0.0, abs(found - expected) - unsure) / max(expected, _SMALL)
        if worst is None or error >= worst.error:
            whole = ours.max(), theirs.max()
            worst, hardest = Measured(found, expected, error), pulse
    assert worst is not None
    bullets = _tilts_in("bullet", made.scene, longest_step(rock), hardest).max()
    told = "/".join(f"{math.degrees(peak):.3g}" for peak in (*whole, bullets))
    return replace(worst, note=f"whole run, ours/MuJoCo/Bullet on the ground as it is: {told} deg")


def swings(own: Array, other: Array, shaken: float) -> tuple[float, float]:
    """Largest of tilts in two engines until the rock of the other first comes back.

    Parameters
    ----------
    own, other : ndarray, angles [rad] over one time, evenly spaced
    shaken : float, share of that time in which the ground moves, and the return is looked for

    Examples
    --------
    >>> swings(np.array([0.1, 0.29, 0.1, 0.7]), np.array([0.2, 0.3, 0.1, 0.6]), 1.0)
    (0.29, 0.3)
    """
    largest = np.maximum.accumulate(other)
    back = np.flatnonzero((other < _RETURNED * largest) & (largest > _TOUCHED))
    until = min(shaken, (back[0] + 1) / len(other) if len(back) else 1.0)
    one, two = (float(tilts[: math.ceil(until * len(tilts))].max()) for tilts in (own, other))
    return one, two


def _tilts_in(engine: str, scene: Scene, step: float, pulse: CosinePulse) -> Array:
    """Angles from the start [rad], one every few steps."""
    world = engines.load(engine).build(scene, step, 1)
    begun, angles = world.state(), []
    middles = (np.arange(math.ceil((pulse.duration + _REST) / step)) + 0.5) * step
    values = pulse.acceleration(np.array(middles))
    for first in range(0, len(values), _LOOK):
        world.advance(values[first : first + _LOOK].tolist())
        angles.append(turned(world.state(), begun))
    return np.array(angles)


def _verdicts(field: FieldScan) -> Measured:
    """Of 64 runs, along x, those with an outcome, or that left the ground that was scanned.

    Raises
    ------
    InvalidInput
        Where others end without an outcome: their rows say so.
    """
    made = settled(field)
    step = longest_step(made.rock)
    still = displacement.limits_on_seat(made.scene, step, "nonsmooth")
    held = displacement.held_toward(made.scene, step, "nonsmooth")
    flight = replace(made.scene, rock=reduction.in_flight(made.rock))
    case = TerrainCase(made.scene, flight, 1.2, still)
    settings = Settings(0.3 * step, engine="nonsmooth")
    counts, decided, left = dict.fromkeys(Outcome, 0), 0, 0
    for pga in np.linspace(0.2, 1.6, 8):
        for ratio in np.linspace(0.05, 0.4, 8):
            found = displacement.displace(case, CosinePulse.from_g(pga, ratio), settings)
            counts[found.response.outcome] += 1
            if found.response.outcome in _DECIDED:
                decided += 1
            elif found.stop is StopReason.LEFT_TERRAIN:
                left += 1
    note = ", ".join(f"{n} {outcome.name.lower()}" for outcome, n in counts.items() if n)
    if left:
        note += f"; {left} of these left the scanned ground"
    if len(held):
        note += f"; walls hold it toward {len(held)} of 12 directions"
    if decided + left < 64:
        remedy = "look at their trajectories: a smooth base can roll to and fro for minutes"
        raise InvalidInput(note, "64 runs have an outcome each", remedy)
    return Measured(64.0, 64.0, 0.0, note)


_UNSEEN = "by what is unseen of it (in the ground, or between two closings) and"

_ASKED: dict[str, tuple[str, float, Callable[[FieldScan], Measured]]] = {
    "volume": (f"volume [m3]; the rock's formula; {_UNSEEN} a layer of 3 % of an edge on its "
               "surface", 1.0, _volume),
    "centre": ("centre of mass, its distance [m]; the formula's; over the volume's cube root, "
               f"{_UNSEEN} half that layer", 1.0, _centre),
    "inertia": ("moment of inertia of unit density, the worst of three [m5]; the formula's; "
                f"{_UNSEEN} three such layers", 1.0, _inertia),
    "settling": ("CPU time to settle [s]; none; the largest of it by 5 s, the shift by 1 mm "
                 "and the turn by 0.2 deg", 1.0, _settles),
    "energy": ("growth of energy at rest [J/kg]; none; by that of one radius", 1e-6,
               _energy),
    "tipping": ("steady push that tips it on its points at half the longest step, the worst of "
                "8 directions [g]; the polygon of the points; relative", 0.02, _tips),
    "tilt": ("tilt on its points from which it first comes back, the worst of 4 pulses "
             "[rad]; MuJoCo's; what it is off by beyond what twice MuJoCo's step, half or twice "
             "its contact's time constant change, relative, below 0.3 deg by that", 0.05, _tilts),
    "verdicts": ("runs with an outcome, or that left the ground of the scan; 64; the others", 0.0,
                 _verdicts),
}  # fmt: skip
"""Reference, tolerance and measure of what is asked of each scan."""

CASES: tuple[ExtremeCase, ...] = tuple(
    ExtremeCase(
        f"{name}: {asked}",
        "noise",
        field.noise,
        "m",
        reference,
        tolerance,
        partial(measure, field),
        together=name,
    )
    for name, field in FIELDS.items()
    for asked, (reference, tolerance, measure) in _ASKED.items()
)
