"""Impulses at all points of contact of a step, solved together.

Laws at each point, with the velocity u that the step leads to less the one ``wanted``, along the
normal (0) and two tangents: no approach, no pull, impulse only where no gap opens,
0 <= u_0, 0 <= p_0, u_0 p_0 = 0 (Signorini), and Coulomb's cone |p_t| <= friction p_0, on whose
border friction is against the sliding. They hold where p is what is left of p - r u on that cone,
for any r > 0 (Alart & Curnier). Newton's method finds out which points are open, grip or slide, and
for these six equations give the velocity of the rock. Where it finds no end it begins anew from
where simple sweeps lead; and where it still finds none, as along an edge with many points some of
which are about to slide, these go on to the end.

Points that are alike are treated alike. One after another, by Gauss and Seidel's method, a corner
that is solved first can bear all, in a way that obeys all laws where there is much friction, and a
symmetric block turns about it; and slender rocks take hundreds of sweeps.

References
----------
Moreau (1988), in: Nonsmooth Mechanics and Applications, CISM Courses 302, 1-82.
Alart & Curnier (1991), Comput. Methods Appl. Mech. Eng. 92, 353-375.
"""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.engines.nonsmooth.body import GRIPS, OPEN, SLIDES, Point, Points, RockState, excess
from vsr_core.engines.nonsmooth.sweeps import begin, go_back, save, sweep, sweep_together

STIFFNESS = 1e4
"""By how much, per mass, a point that shall stick is held where it is: an error of its velocity
shrinks by as much in each of Newton's steps."""

LEAK = 0.1
"""Share of an impulse that is not carried from one of Newton's steps to the next: where more points
than needed bear a rock, this divides its weight among them, at the price of a velocity of
``LEAK / STIFFNESS`` times the impulse."""

REACH = 0.3
"""The number r, per mass."""

NEWTON, TURNING = 10, 1e-4
"""Newton's steps, at most, and the change of the direction of sliding below which they end."""

TOGETHER = 10
"""Sweeps over all points at once with which the search begins anew."""

SWEEPS, SWEPT = 25, 100.0
"""Sweeps over one point after another before Newton's method is tried again, and the change of a
velocity below which they end, in units of the tolerance."""


@compiled
def solve(rock: RockState, points: Points, friction: float, rounds: int, tolerance: float) -> bool:
    """Impulses at the active points, and the velocity that they lead to.

    Parameters
    ----------
    rock : RockState, with the velocity without impulses in ``free``; its velocity, with
        the impulses to begin with, is changed
    tolerance : float [m/s], error allowed of the velocity of a point

    Returns
    -------
    bool, whether it was solved in time
    """
    if _newton(rock, points, friction, tolerance):
        return True
    rock.hard += 1
    begin(rock, points)
    for _ in range(TOGETHER):
        sweep_together(rock, points, friction)
    for _ in range(rounds):
        solved = sweep(rock, points, friction, SWEEPS, SWEPT * tolerance)
        save(rock, points)
        if solved or _newton(rock, points, friction, tolerance):
            return True
        go_back(rock, points)
    rock.unsolved += 1
    return False


@compiled
def _newton(rock: RockState, points: Points, friction: float, tolerance: float) -> bool:
    """Newton's method for velocity and impulses; whether it ended with all laws obeyed."""
    slides, _ = _judge(rock, points, friction)
    for _ in range(NEWTON):
        _equations(rock, points, friction)
        if slides:
            _solve_general(rock.system, rock.right)
        else:
            _solve_symmetric(rock.system, rock.right)
        for k in range(6):
            rock.velocity[k] += rock.right[k]
        error = _renew(rock, points, friction)
        slides, changed = _judge(rock, points, friction)
        if not changed and error <= tolerance:
            return True
    return False


@compiled
def _judge(rock: RockState, points: Points, friction: float) -> tuple[bool, bool]:
    """Which points are open, grip and slide, by p - r u; whether any slides, whether any changed.

    Of a sliding one ``trial`` then holds how its friction follows its direction, and that.
    """
    slides = changed = False
    for at in range(rock.active):
        point = points[points[at].active]
        trial, impulse = point.trial, point.impulse
        p = impulse[0] - REACH * excess(point, 0, rock.velocity)
        q = impulse[1] - REACH * excess(point, 1, rock.velocity)
        r = impulse[2] - REACH * excess(point, 2, rock.velocity)
        size = math.sqrt(q * q + r * r)
        if p <= 0.0:
            state = OPEN
        elif size <= friction * p:
            state = GRIPS
        else:
            state = SLIDES
            slides = True
            q, r = q / size, r / size
            turn = abs(q - trial[1]) + abs(r - trial[2])
            changed = changed or (friction > 0.0 and turn > TURNING)
            trial[0], trial[1], trial[2] = REACH * friction * p / size, q, r
        if state != point.state:
            point.state = state
            changed = True
    return slides, changed


@compiled
def _held(point: Point, friction: float, velocity: Array) -> tuple[float, float, float]:
    """Impulse by which a point is held to the velocity wanted, or braked if it slides."""
    kept = 1.0 - LEAK
    p = kept * point.impulse[0] - STIFFNESS * excess(point, 0, velocity)
    if point.state == SLIDES:
        return p, friction * p * point.trial[1], friction * p * point.trial[2]
    q = kept * point.impulse[1] - STIFFNESS * excess(point, 1, velocity)
    r = kept * point.impulse[2] - STIFFNESS * excess(point, 2, velocity)
    return p, q, r


@compiled
def _renew(rock: RockState, points: Points, friction: float) -> float:
    """Impulses that hold the velocity; the largest error of a velocity that they show [m/s]."""
    worst = 0.0
    for at in range(rock.active):
        point = points[points[at].active]
        impulse = point.impulse
        if point.state == OPEN:
            impulse[0] = impulse[1] = impulse[2] = 0.0
            continue
        p, q, r = _held(point, friction, rock.velocity)
        worst = max(worst, abs(p - impulse[0]), abs(q - impulse[1]), abs(r - impulse[2]))
        impulse[0], impulse[1], impulse[2] = p, q, r
    return worst / STIFFNESS


@compiled
def _equations(rock: RockState, points: Points, friction: float) -> None:
    """Newton's equations for the change of the velocity: M (v - free) = sum of rows times p."""
    system, right, inertia = rock.system, rock.right, rock.inertia
    for a in range(3):
        for b in range(6):
            system[a, b] = 0.0
        system[a, a] = 1.0
        right[a] = rock.free[a] - rock.velocity[a]
    for a in range(3):
        right[3 + a] = 0.0
        for b in range(3):
            system[3 + a, b] = 0.0
            system[3 + a, 3 + b] = inertia[a, b]
            right[3 + a] += inertia[a, b] * (rock.free[3 + b] - rock.velocity[3 + b])
    slides = False
    for at in range(rock.active):
        point = points[points[at].active]
        if point.state != OPEN:
            p, q, r = _held(point, friction, rock.velocity)
            for a in range(6):
                right[a] += point.rows[0, a] * p + point.rows[1, a] * q + point.rows[2, a] * r
        if point.state == GRIPS:
            _add_gripping(system, point.rows)
        slides = slides or point.state == SLIDES
    if slides:
        _add_sliding(rock, points, friction)


@compiled
def _add_gripping(system: Array, rows: Array) -> None:
    """Add what a gripping point does, to the lower triangle."""
    for a in range(6):
        x, y, z = STIFFNESS * rows[0, a], STIFFNESS * rows[1, a], STIFFNESS * rows[2, a]
        for b in range(a + 1):
            system[a, b] += x * rows[0, b] + y * rows[1, b] + z * rows[2, b]


@compiled
def _add_sliding(rock: RockState, points: Points, friction: float) -> None:
    """Add what sliding points do: their friction follows normal force and direction."""
    system = rock.system
    for a in range(6):
        for b in range(a):
            system[b, a] = system[a, b]
    for at in range(rock.active):
        point = points[points[at].active]
        if point.state != SLIDES:
            continue
        rows, trial = point.rows, point.trial
        share, y, z = trial[0], trial[1], trial[2]
        for b in range(6):
            along = y * rows[1, b] + z * rows[2, b]
            normal = STIFFNESS * rows[0, b]
            first = friction * y * normal + share * (rows[1, b] - along * y)
            second = friction * z * normal + share * (rows[2, b] - along * z)
            for a in range(6):
                system[a, b] += rows[0, a] * normal + rows[1, a] * first + rows[2, a] * second


@compiled
def _solve_symmetric(system: Array, right: Array) -> None:
    """Solve six equations in place by Cholesky's method; the lower triangle is used."""
    for a in range(6):
        for b in range(a):
            value = system[a, b]
            for k in range(b):
                value -= system[a, k] * system[b, k]
            system[a, b] = value * system[b, b]
        value = system[a, a]
        for k in range(a):
            value -= system[a, k] * system[a, k]
        system[a, a] = 1.0 / math.sqrt(value)
    for a in range(6):
        for k in range(a):
            right[a] -= system[a, k] * right[k]
        right[a] *= system[a, a]
    for a in range(5, -1, -1):
        for k in range(a + 1, 6):
            right[a] -= system[k, a] * right[k]
        right[a] *= system[a, a]


@compiled
def _solve_general(system: Array, right: Array) -> None:
    """Solve six equations in place by elimination, the largest number of a column first."""
    for a in range(6):
        best = a
        for b in range(a + 1, 6):
            if abs(system[b, a]) > abs(system[best, a]):
                best = b
        if best != a:
            for k in range(a, 6):
                system[a, k], system[best, k] = system[best, k], system[a, k]
            right[a], right[best] = right[best], right[a]
        for b in range(a + 1, 6):
            share = system[b, a] / system[a, a]
            for k in range(a + 1, 6):
                system[b, k] -= share * system[a, k]
            right[b] -= share * right[a]
    for a in range(5, -1, -1):
        for k in range(a + 1, 6):
            right[a] -= system[a, k] * right[k]
        right[a] /= system[a, a]
