"""The shape of a specimen, as far as its scans give it, and one recorded shake-table test of it.

Two specimens cut to one form are one shape scanned twice: the difference of the scans shows how
well either gives the base, and a shape between them is likelier than each. A rock stands on three
points of its base, so that millimetres there decide which way it topples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
import trimesh
from trimesh.proximity import closest_point
from trimesh.registration import icp
from trimesh.transformations import rotation_matrix, translation_matrix

from vsr_core import GRAVITY
from vsr_core.arrays import Array, Indices
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import Barrier
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records.components import ComponentMotion
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.outcome import Response
from vsr_core.rock.body import Rock, convex_hull, drawn_in
from vsr_core.rock.solid import integrals
from vsr_core.rock.tipping import settle
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.scene import Contact, Scene
from vsr_core.table.stepper import SteppedPulse
from vsr_core.validation.priors import Member

ALIKE = 0.01
"""Scans whose distance is below this share of their size are of one form."""

SAME_SCAN = 1e-5
"""Share of its size by which points of a scan that is saved twice may differ, as by rounding."""

BASE_SHARE = 0.06
"""Height of the base, as a share of the rock's."""

SCAN_ERROR = 0.002
"""Error of a scan at the base [m] where there is no second scan to estimate it from."""

ERROR_LENGTH = 0.045
"""Length over which errors of a scan are alike [m]: the distance at which the difference of the two
public scans of granite specimens, 10 to 50 mm apart, has lost two thirds of its correlation."""

WAVES = 200
"""Plane waves that make a random field."""

_SOME, _WAYS, _FEW = 400, 12, 15
"""Points of a replica, ways in which it is turned, and steps, by which it is known how it lies."""

TRIES = 50
"""Random shapes drawn until one stands."""


@dataclass(frozen=True, eq=False)
class Form:
    """A scan and what is known of its error.

    Attributes
    ----------
    vertices, normals : ndarray, shape (n, 3) [m], [1]
    faces : ndarray of int, shape (m, 3)
    other : ndarray, shape (n, 3) [m], nearest points of a scan of the same form, else ``vertices``
    error : float [m], standard deviation of one scan at the base
    spread : float [m], of the errors that are added to a draw: none where draws lie between two
        scans. A scan is rougher than its rock by its own error, and one more would have the rock
        stand on bumps that are not there, wider and safer than it does.
    replica : bool, whether there is another scan of the form
    length : float [m], over which errors of the scan are alike
    """

    vertices: Array
    normals: Array
    faces: Indices
    other: Array
    error: float
    spread: float
    replica: bool
    length: float = ERROR_LENGTH


def form(
    scan: trimesh.Trimesh,
    replica: trimesh.Trimesh | None,
    error: float = SCAN_ERROR,
    length: float = ERROR_LENGTH,
) -> Form:
    """The shape of a specimen by its scan, and by that of a specimen of the same form.

    Parameters
    ----------
    scan : Trimesh [m], closed, z up
    replica : Trimesh [m] or None
        Laid onto the scan, z up as that; taken only if the two are ``ALIKE``,
        and not one scan that is saved twice, turned or not.
    error, length : float [m], standard deviation of the scan's error at the base, and the length
        over which errors are alike, where there is no replica
    """
    vertices = np.array(scan.vertices)
    normals, faces = np.array(scan.vertex_normals), np.array(scan.faces, dtype=np.int64)
    if replica is not None and not _is_one_scan(vertices, replica.vertices):
        moved = replica.copy()
        moved.apply_transform(_onto(scan, replica))
        other, distance, _ = closest_point(moved, vertices)
        if np.median(distance) < ALIKE * np.ptp(vertices, axis=0).max():
            low = vertices[:, 2] < vertices[:, 2].min() + BASE_SHARE * np.ptp(vertices[:, 2])
            apart = np.einsum("ij,ij->i", other - vertices, normals)[low]
            half = float(apart.std()) / np.sqrt(2.0)
            return Form(vertices, normals, faces, other, half, 0.0, True)
    return Form(vertices, normals, faces, vertices, error, error, False, length)


def _onto(scan: trimesh.Trimesh, replica: trimesh.Trimesh) -> Array:
    """The motion that lays a replica onto a scan, shape (4, 4), by iterated closest points.

    These end near where they begin: with the two middles together, turned about the vertical in the
    way from which some of the points come nearest.
    """
    points = np.array(replica.vertices)
    some = points[np.linspace(0, len(points) - 1, min(_SOME, len(points))).astype(int)]
    how = {"threshold": 1e-12, "scale": False, "reflection": False}
    together = translation_matrix(scan.center_mass - replica.center_mass)
    found = []
    for angle in np.arange(_WAYS) * 2.0 * np.pi / _WAYS:
        start = rotation_matrix(angle, (0.0, 0.0, 1.0), scan.center_mass) @ together
        onto, _, cost = icp(some, scan, initial=start, max_iterations=_FEW, **how)
        found.append((cost, onto))
    start = min(found, key=itemgetter(0))[1]
    return np.asarray(icp(points, scan, initial=start, max_iterations=100, **how)[0])


def _is_one_scan(one: Array, other: Array) -> bool:
    """Whether points lie about their middle as others do, in any order and turned in any way."""
    if len(one) != len(other):
        return False
    first, second = (
        np.sort(np.linalg.norm(points - points.mean(axis=0), axis=1)) for points in (one, other)
    )
    return bool(np.abs(first - second).max() < SAME_SCAN * first[-1])


def drawn(of: Form, member: Member, density: float) -> Rock:
    """A rock as it may be, at rest on a level pedestal.

    Parameters
    ----------
    density : float [kg/m^3]

    Raises
    ------
    InvalidInput
        If no shape drawn stands near its pose in the scan, or none on a base drawn in.
    """
    middle = (1.0 - member.mixing) * of.vertices + member.mixing * of.other
    rng = np.random.default_rng(member.seed)
    for _ in range(TRIES):
        error = member.error * of.spread * random_field(of.vertices, of.length, rng)
        body = trimesh.Trimesh(middle + of.normals * error[:, None], of.faces, process=False)
        volume, own, inertia = integrals(body)
        centre = own + member.centre
        try:
            hull = convex_hull(np.array(body.vertices) - centre)
            turn, _ = settle(hull)
            if member.inset:
                standing = hull.turned(turn)
                height = -float(standing.vertices[:, 2].min())
                hull = convex_hull(drawn_in(standing, member.inset * height)).turned(turn.T)
                turn, _ = settle(hull)
        except InvalidInput:
            continue
        moments, axes = np.linalg.eigh(density * turn @ inertia @ turn.T)
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        return Rock("hull", hull.turned(turn).vertices, density * volume, moments, axes)
    if member.inset:
        drawn(of, replace(member, inset=0.0), density)  # refuses one that does not stand as scanned
        given = f"a base drawn in by {member.inset:.3g} of the height of the centre of mass"
        rule, remedy = "the specimen stands on what is left", "reduce inset (uncertainty.inset)"
        raise InvalidInput(given, rule, remedy)
    given = f"a specimen that does not stand in any of {TRIES} shapes"
    rule = "it stands as scanned, to within the errors of the scan and of its centre of mass"
    remedy = "turn the scan so that the specimen stands, z up, or reduce centre_of_mass"
    raise InvalidInput(given, rule, remedy)


def random_field(points: Array, length: float, rng: np.random.Generator) -> Array:
    """Gaussian random field of unit variance, shape (n,), correlated as exp(-(r / length)^2 / 2).

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m]
    length : float [m]

    Notes
    -----
    Sum of plane waves with random directions and phases (Shinozuka 1971).
    """
    waves = rng.normal(size=(WAVES, 3)) / length
    phases = rng.uniform(0.0, 2.0 * np.pi, WAVES)
    return np.asarray(np.sqrt(2.0 / WAVES) * np.cos(points @ waves.T + phases).sum(axis=1))


ENGINE = "nonsmooth"
"""Engine in which the tests are simulated."""

STEP_SHARE = 0.01
"""Time step as a share of sqrt(radius / g), 2.4 ms for a rock of a metre. Half of it changes the
outcome of single doubtful tests, as a grain of sand would, and hardly how many overturn."""


def standing_case(rock: Rock, limits: Barrier, member: Member) -> Case:
    """A rock on a level table, turned so that its drive is along +x.

    Parameters
    ----------
    limits : Barrier, of the rock
    """
    contact = Contact(member.friction, member.restitution)
    return prepare(Scene(rock, contact, -member.direction), limits, reduce=True)


def shaken(case: Case, motions: Sequence[GroundMotion]) -> list[Response]:
    """Responses to motions of the table."""
    step = STEP_SHARE * math.sqrt(case.full.rock.radius / GRAVITY)
    return simulate_all(case, motions, Settings(step, engine=ENGINE))


def amplified(motion: GroundMotion, factor: float) -> GroundMotion:
    """A motion of the table in a test, its acceleration times a factor."""
    match motion:
        case RecordedMotion(trace):
            return RecordedMotion(Trace(factor * trace.acceleration, trace.interval))
        case ComponentMotion(along):
            x, y, z = (
                RecordedMotion(Trace(factor * one.trace.acceleration, one.trace.interval))
                for one in along
            )
            return ComponentMotion((x, y, z))
        case CosinePulse():
            return replace(motion, pga=factor * motion.pga)
        case SteppedPulse():
            return replace(motion, gain=factor * motion.gain)
    raise TypeError(f"no motion of a test: {motion!r}")
