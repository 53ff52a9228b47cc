"""Free fall, the spinning boxes of a published benchmark, and the rebound from a fall.

Linear and angular momentum and energy are exact; the orientation is that of Euler's equations,
integrated by SciPy to ten digits.

References
----------
github.com/scpeters/benchmark, "boxes": the inputs SIMPLE and COMPLEX, as they stand.
Euler's equations: Goldstein, Poole & Safko (2002), Classical Mechanics, 3rd ed., 5.5.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.rock.body import Rock
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import BOTH, REBOUNDS, Reference, case
from vsr_core.verification.reference._run import Path, largest, run, whole
from vsr_core.verification.rocks import STILL, Triple, box, sphere, upright

SIZE = (0.1, 0.4, 0.9)
"""Sides of the benchmark's box [m]."""

DURATION = 10.0
"""Time that the benchmark simulates [s]."""


@dataclass(frozen=True)
class BenchmarkThrow:
    """Input of the benchmark.

    Attributes
    ----------
    gravity : float [m/s^2]
    velocity : tuple of float [m/s], of the centre of mass at the start
    angular_velocity : tuple of float [rad/s], at the start
    """

    gravity: float
    velocity: Triple
    angular_velocity: Triple


SIMPLE = BenchmarkThrow(0.0, (-0.9, 0.4, 0.1), (0.5, 0.0, 0.0))
"""Without weight, spinning about the axis of largest inertia."""

COMPLEX = BenchmarkThrow(9.8, (-2.0, 2.0, 8.0), (0.1, 5.0, 0.1))
"""Thrown upwards, spinning about the unstable axis, that of middle inertia."""


@cache
def _scene(throw: BenchmarkThrow) -> Scene:
    start = upright(STILL, throw.velocity, throw.angular_velocity)
    return Scene(box(*SIZE), Contact(0.0), pedestal="none", start=start, gravity=throw.gravity)


def _thrown(throw: BenchmarkThrow, engine: str, time_step: float) -> Path:
    number, step = whole(DURATION, time_step)
    return run(engine, _scene(throw), step, np.zeros(number))


def _spins(throw: BenchmarkThrow, path: Path) -> Array:
    """Angular momentum of the box about its centre, over its mass, shape (n, 3) [m^2/s]."""
    rock = box(*SIZE)
    turn = path.rotation
    return np.einsum(
        "nij,j,nkj,nk->ni", turn, rock.inertia / rock.mass, turn, path.angular_velocity
    )


def _position(throw: BenchmarkThrow, engine: str, time_step: float) -> float:
    """Error of the position, relative to the largest displacement."""
    path = _thrown(throw, engine, time_step)
    t = path.time[:, None]
    exact = np.array(throw.velocity) * t - [0.0, 0.0, 0.5 * throw.gravity] * t**2
    return largest(path.position - exact) / largest(exact)


def _velocity(throw: BenchmarkThrow, engine: str, time_step: float) -> float:
    """Error of the velocity, relative to the largest speed."""
    path = _thrown(throw, engine, time_step)
    exact = np.array(throw.velocity) - [0.0, 0.0, throw.gravity] * path.time[:, None]
    return largest(path.velocity - exact) / largest(exact)


def _momentum(throw: BenchmarkThrow, engine: str, time_step: float) -> float:
    """Error of the angular momentum about the centre of mass, relative to its length."""
    spins = _spins(throw, _thrown(throw, engine, time_step))
    rock = box(*SIZE)
    exact = rock.inertia / rock.mass * throw.angular_velocity
    return largest(spins - exact) / float(np.linalg.norm(exact))


def _energy(throw: BenchmarkThrow, engine: str, time_step: float) -> float:
    """Error of the energy, relative to the kinetic energy at the start."""
    path = _thrown(throw, engine, time_step)
    rock = box(*SIZE)
    turning = np.einsum("ni,ni->n", _spins(throw, path), path.angular_velocity)
    moving = np.einsum("ni,ni->n", path.velocity, path.velocity)
    total = 0.5 * (turning + moving) + throw.gravity * path.position[:, 2]
    angular_velocity, speed = np.array(throw.angular_velocity), np.array(throw.velocity)
    exact = 0.5 * float(angular_velocity**2 @ rock.inertia / rock.mass + speed @ speed)
    return largest(total - exact) / exact


def _orientation(throw: BenchmarkThrow, engine: str, time_step: float) -> float:
    """Largest angle between the box and the one of Euler's equations, relative to one radian."""
    path = _thrown(throw, engine, time_step)
    exact = _euler(throw)(path.time)
    apart = np.einsum("nij,nik->njk", exact, path.rotation)
    sine = np.stack(
        [apart[:, 2, 1] - apart[:, 1, 2], apart[:, 0, 2] - apart[:, 2, 0],
         apart[:, 1, 0] - apart[:, 0, 1]], axis=1,
    )  # fmt: skip
    trace = np.einsum("njj->n", apart)
    return largest(np.arctan2(np.linalg.norm(sine, axis=1), trace - 1.0))


@cache
def _euler(throw: BenchmarkThrow) -> Callable[[Array], Array]:
    """Orientation at times, shape (n,), as matrices, shape (n, 3, 3)."""
    rock = box(*SIZE)
    inertia = rock.inertia / rock.mass

    def motion(_: float, y: Array) -> Array:
        angular_velocity, turn = y[:3], y[3:].reshape(3, 3)
        rate = np.cross(inertia * angular_velocity, angular_velocity) / inertia
        x, y, z = angular_velocity
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.concatenate([rate, (turn @ cross).ravel()])

    start = np.concatenate([throw.angular_velocity, np.eye(3).ravel()])
    solved = solve_ivp(
        motion, (0.0, DURATION), start, "DOP853", dense_output=True, rtol=1e-12, atol=1e-13
    )
    return lambda times: solved.sol(np.clip(times, 0.0, DURATION))[3:].T.reshape(-1, 3, 3)


def _fall(engine: str, time_step: float) -> float:
    """Error of the height after a second of free fall, relative to g t^2 / 2."""
    scene = Scene(box(1.0, 1.0, 2.0), Contact(0.6), pedestal="none", start=upright(STILL))
    number, step = whole(1.0, time_step)
    path = run(engine, scene, step, np.zeros(number))
    return abs(float(path.position[-1, 2]) / (0.5 * GRAVITY) + 1.0)


FREE_FALL = "g t^2 / 2; an engine that updates the velocity first falls g t dt / 2 too far"
EULER = 'Euler\'s equations of a free body, inputs of github.com/scpeters/benchmark "boxes" '

_FLIGHTS = (
    case("free fall", FREE_FALL, 1.1e-3, _fall, order=1.0),
    case("box SIMPLE, position", f"{EULER}SIMPLE", 1e-9, _position, SIMPLE),
    case("box SIMPLE, velocity", f"{EULER}SIMPLE", 1e-9, _velocity, SIMPLE),
    case("box SIMPLE, momentum", f"{EULER}SIMPLE", 1e-9, _momentum, SIMPLE),
    case("box SIMPLE, energy", f"{EULER}SIMPLE", 1e-9, _energy, SIMPLE),
    case("box COMPLEX, position", f"{EULER}COMPLEX", 1.5e-4, _position, COMPLEX, order=1.0),
    case("box COMPLEX, velocity", f"{EULER}COMPLEX", 1e-9, _velocity, COMPLEX),
    case("box COMPLEX, momentum", f"{EULER}COMPLEX", 0.02, _momentum, COMPLEX, order=1.0),
    case("box COMPLEX, energy", f"{EULER}COMPLEX", 0.02, _energy, COMPLEX, order=1.0),
    case("box COMPLEX, orientation", f"{EULER}COMPLEX", 0.1, _orientation, COMPLEX,
         step=2.5e-4, order=1.0),
)  # fmt: skip


HEIGHT = 1.0
"""Of the fall [m]."""


def _rebound(rock: Rock, restitution: float, engine: str, time_step: float) -> float:
    """Error of the height of the first rebound, relative to the height of the fall."""
    start = upright((0.0, 0.0, rock.height + HEIGHT))
    scene = Scene(rock, Contact(0.6, restitution), start=start)
    down = math.sqrt(2.0 * HEIGHT / GRAVITY)
    # Up to the top of an exact rebound and a little on, but not to the next impact.
    number, step = whole(down * (1.0 + 1.2 * max(restitution, 0.5)), time_step)
    path = run(engine, scene, step, np.zeros(number))
    height = path.position[path.time > 1.1 * down, 2] - rock.height
    return abs(float(height.max()) / HEIGHT - restitution**2)


def _bounce(
    name: str, rock: Rock, e: float, tolerance: float, engines: tuple[str, ...] = REBOUNDS
) -> Reference:
    answer = "e^2 of the height of the fall."
    return case(f"bounce of a {name}, e = {e:g}", answer, tolerance, _rebound, rock, e,
                engines=engines)  # fmt: skip


CASES = (
    *_FLIGHTS,
    _bounce("sphere", sphere(0.1), 0.0, 0.02, BOTH),
    _bounce("sphere", sphere(0.1), 0.5, 1e-3),
    _bounce("sphere", sphere(0.1), 1.0, 0.01),
    _bounce("box on its face", box(1.0, 1.0, 0.5), 0.5, 2e-3),
)
