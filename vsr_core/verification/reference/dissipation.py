"""Energy never grows: hulls of random corners that tumble down rough slopes.

Neither a rebound nor friction can give a rock energy. The law of impact that Bullet has, Newton's
restitution with Coulomb's friction, keeps that for a point under the centre of mass, but not
elsewhere (Kane & Levinson 1985): at restitutions near one, where it does not, only the compiled
engine promises it.

References
----------
Kane & Levinson (1985), Dynamics: Theory and Applications, 4.12; Stronge (2000), Impact Mechanics.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial.transform import Rotation

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene, State
from vsr_core.surrogates.ground import rough
from vsr_core.terrain.surface import Terrain
from vsr_core.verification.reference import OWN, REBOUNDS, case
from vsr_core.verification.reference._run import Path, in_parts, run, sheet, whole
from vsr_core.verification.rocks import hull

CORNERS, SIZE = 14, (0.6, 0.45, 0.35)
"""Random corners of a hull, on an ellipsoid of these half axes [m]."""

ANGLE = math.radians(25.0)
"""Of the slope on the average."""

HILLS, HIGH = 2.0, 0.07
"""Longest wave of the ground and its root mean square height [m]."""

STANDS_OUT = 0.01
"""By which convex parts may stand out of the ground [m]."""

DROP, DURATION = 1.2, 1.2
"""Height of the centre of mass above the ground at the start [m], and time of a run [s]."""

START = -2.5
"""Place of the start along the slope [m]."""

GROUNDS = 2
"""Different slopes."""

IMPACT = 3
"""Readings of which the highest counts: an engine may take the approach of an impact in one step
and give the rebound in the next, and what is read between them is neither."""


@cache
def _ground(number: int, cut: bool) -> Terrain:
    """Rough slope down +x, as triangles of half a metre or as their convex parts."""
    along, across = np.linspace(-3.5, 3.0, 14), np.linspace(-2.0, 2.0, 9)
    vertices, faces = sheet(along, -math.tan(ANGLE) * along, across)
    vertices[:, 2] += HIGH * rough(vertices[:, :2], HILLS, 3, number)
    whole_sheet = Terrain(vertices, faces)
    if not cut:
        return whole_sheet
    return Terrain(vertices, faces, in_parts(whole_sheet, STANDS_OUT))


@cache
def _tumbler(number: int) -> Rock:
    """Hull of random corners on an ellipsoid."""
    corners = np.random.default_rng(number).normal(size=(CORNERS, 3))
    corners *= np.array(SIZE) / np.linalg.norm(corners, axis=1, keepdims=True)
    return hull(corners, as_scanned=True)


@cache
def _scene(number: int, contact: Contact, cut: bool) -> Scene:
    terrain, rng = _ground(number % GROUNDS, cut), np.random.default_rng(number)
    height = float(terrain.surfaces(START, 0.0)[0][-1]) + DROP
    start = State(
        np.array([START, 0.0, height]),
        Rotation.random(random_state=number).as_matrix(),
        np.array([rng.uniform(0.0, 3.0), rng.uniform(-0.5, 0.5), 0.0]),
        3.0 * rng.normal(size=3),
    )
    return Scene(_tumbler(number), contact, pedestal="terrain", start=start, terrain=terrain)


def energy(rock: Rock, path: Path) -> Array:
    """Kinetic and potential energy per unit mass.

    Returns
    -------
    ndarray, shape (n,) [m^2/s^2]
    """
    angular_velocity = np.einsum("nij,ni->nj", path.rotation @ rock.axes, path.angular_velocity)
    turning = (angular_velocity**2 * (rock.inertia / rock.mass)).sum(axis=1)
    return 0.5 * ((path.velocity**2).sum(axis=1) + turning) + GRAVITY * path.position[:, 2]


def rise(number: int, contact: Contact, cut: bool, engine: str, time_step: float) -> float:
    """Largest rise of the energy of one hull above what it had before, over g times its radius.

    Parameters
    ----------
    cut : bool, whether the ground is convex parts, else triangles
    time_step : float [s]
    """
    steps, step = whole(DURATION, time_step)
    path = run(engine, _scene(number, contact, cut), step, np.zeros(steps))
    rock = _tumbler(number)
    held = sliding_window_view(energy(rock, path), IMPACT).max(axis=1)
    return float((held - np.minimum.accumulate(held)).max()) / (GRAVITY * rock.radius)


def worst(hulls: int, contact: Contact, cut: bool, engine: str, time_step: float) -> float:
    """Largest rise of the energy of any of some hulls, over g times its radius."""
    return max(rise(number, contact, cut, engine, time_step) for number in range(hulls))


CASES = tuple(
    case(f"energy on rough {'parts' if cut else 'triangles'}, e = {e:g}", "it never grows", 0.02,
         worst, 6, Contact(0.6, e), cut, engines=engines)
    for e, cut, engines in ((0.0, True, REBOUNDS), (0.38, False, REBOUNDS), (0.8, False, OWN))
)  # fmt: skip
