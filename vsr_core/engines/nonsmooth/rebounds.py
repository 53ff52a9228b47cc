"""Rebounds that give back no more energy than they may.

Newton's law, u_N+ = -e u_N-, says nothing of energy: where friction acts away from the centre of
mass, a rock can leave with more than it had (Kane & Levinson). So an impact is solved twice before
it is made, with its rebound and without. The second takes as much energy T- - T0 as there is to
take; the first must not give back more than a share of it,

    T+ - T0 <= k (T- - T0),

or all its points leave more slowly. With k = 1 no impact gains energy, and Newton's law holds
wherever it gains none itself. With k = e^2 restitution is a ratio of energies, as Stronge has it,
here of all of the energy and not of the work of the normal force alone. Without friction, and
where the impulse points at the centre of mass, both are Newton's law as it is.

An impact is made in two steps (see ``stepping``), and points that land one soon after the other are
not one impact. So what the impulses of a step give is also held against what those of the step
before took, by their work p (u- + u+) / 2.

References
----------
Kane & Levinson (1985), Dynamics: Theory and Applications, 4.12.
Stronge (1990), Proc. R. Soc. Lond. A 431, 169-181.
"""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled
from vsr_core.compiled.vectors import assign
from vsr_core.engines.nonsmooth.body import Body, Points, RockState
from vsr_core.engines.nonsmooth.impulses import solve
from vsr_core.engines.nonsmooth.sweeps import begin

TRIES = 8
"""Rebounds that are tried, at most; then there is none."""

CAUTION = 1.0 - 1e-3
"""Share of the rebound taken that would give back just as much as it may, if no point changed
between gripping and sliding on the way."""


@compiled
def hold_back(body: Body, rock: RockState, points: Points, rounds: int, tolerance: float) -> None:
    """Slow all rebounds of a step until they give back no more energy than they may.

    All of the impact is solved at the place where the step begins.

    Parameters
    ----------
    rock : RockState, with the velocity before the impact in ``approach``
    rounds : int, in the search for the impulses, at most
    tolerance : float [m/s], error allowed of the velocity of a point
    """
    if not _any_leaves(rock, points):
        return
    _set_aside(rock, points)
    assign(rock.free, rock.approach)
    begin(rock, points)
    before = _energy(rock, rock.approach)
    slack = tolerance * math.sqrt(2.0 * before)
    least = _hit(body, rock, points, 0.0, rounds, tolerance)
    assign(rock.lost, rock.velocity)
    given = max(0.0, body.returned * (before - least))
    share, tries = 1.0, 0
    while share > 0.0:
        after = _hit(body, rock, points, share, rounds, tolerance)
        if after <= least + given + slack:
            break
        tries += 1
        share = CAUTION * share * _part(rock, after - least, given) if tries < TRIES else 0.0
    _restore(rock, points)
    if share < 1.0:
        _slow(rock, points, share)


@compiled
def repay(body: Body, rock: RockState, points: Points, rounds: int, tolerance: float) -> None:
    """Have the impulses of a step give no more energy than those of the step before took.

    Otherwise the velocity is that between the one found and the one without rebounds which gives
    just as much; its impulses keep to the ground and to the cone as both do.
    """
    given = _work(rock, points)
    slack = tolerance * math.sqrt(2.0 * _energy(rock, rock.velocity))
    if given > rock.taken + slack and _any_leaves(rock, points):
        _set_aside(rock, points)
        for at in range(rock.active):
            point = points[points[at].active]
            point.wanted[0] -= point.after * point.leaving
        solve(rock, points, body.friction, rounds, tolerance)
        assign(rock.lost, rock.velocity)
        least = _work(rock, points)
        assign(rock.velocity, rock.set_aside[1])
        share = _part(rock, given - least, max(0.0, rock.taken - least))
        for k in range(6):
            rock.velocity[k] = rock.lost[k] + share * (rock.velocity[k] - rock.lost[k])
        for at in range(rock.active):
            point = points[points[at].active]
            for k in range(3):
                point.impulse[k] += share * (point.set_aside[k] - point.impulse[k])
        _slow(rock, points, share)
        given = _work(rock, points)
    goes_on = False
    for at in range(rock.active):
        goes_on = goes_on or points[points[at].active].rebound > 0.0
    rock.taken = max(0.0, rock.taken - given) if goes_on else 0.0


@compiled
def _work(rock: RockState, points: Points) -> float:
    """Work of all impulses of a step [m^2/s^2].

    What pushes the rock does so half before and half after them.
    """
    work = 0.0
    for at in range(rock.active):
        point = points[points[at].active]
        for k in range(3):
            twice = 0.0
            for j in range(3):
                twice += point.rows[k, j] * (rock.before[j] + rock.velocity[j])
                twice += point.rows[k, 3 + j] * (rock.turning[j] + rock.velocity[3 + j])
            work += 0.5 * (point.impulse[k] + point.given[k]) * twice
    return work


@compiled
def _any_leaves(rock: RockState, points: Points) -> bool:
    fastest = 0.0
    for at in range(rock.active):
        fastest = max(fastest, points[points[at].active].leaving)
    return fastest > 0.0


@compiled
def _set_aside(rock: RockState, points: Points) -> None:
    assign(rock.set_aside[0], rock.free)
    assign(rock.set_aside[1], rock.velocity)
    for at in range(rock.active):
        point = points[points[at].active]
        assign(point.set_aside, point.impulse)


@compiled
def _restore(rock: RockState, points: Points) -> None:
    assign(rock.free, rock.set_aside[0])
    assign(rock.velocity, rock.set_aside[1])
    for at in range(rock.active):
        point = points[points[at].active]
        assign(point.impulse, point.set_aside)


@compiled
def _hit(
    body: Body, rock: RockState, points: Points, share: float, rounds: int, tolerance: float
) -> float:
    """Energy per mass [m^2/s^2] after an impact with a share of its rebound."""
    for at in range(rock.active):
        point = points[points[at].active]
        point.wanted[0] = share * point.leaving
        point.wanted[1] = point.wanted[2] = 0.0
    solve(rock, points, body.friction, rounds, tolerance)
    return _energy(rock, rock.velocity)


@compiled
def _energy(rock: RockState, velocity: Array) -> float:
    inertia, twice = rock.inertia, 0.0
    for k in range(3):
        twice += velocity[k] * velocity[k]
        for j in range(3):
            twice += velocity[3 + k] * inertia[k, j] * velocity[3 + j]
    return 0.5 * twice


@compiled
def _part(rock: RockState, excess: float, given: float) -> float:
    """Part of the way from the velocity without rebound to this at which energy is ``given``.

    Energy is quadratic on the way, and ``excess`` [m^2/s^2] at its end.
    """
    for k in range(6):
        rock.right[k] = rock.velocity[k] - rock.lost[k]
    square = _energy(rock, rock.right)
    linear = excess - square
    root = math.sqrt(linear * linear + 4.0 * square * given)
    if linear < 0.0:
        return min(1.0, (root - linear) / (2.0 * square))
    return min(1.0, 2.0 * given / (linear + root)) if root > 0.0 else 0.0


@compiled
def _slow(rock: RockState, points: Points, share: float) -> None:
    """Have all points leave with a share of their speed, in this step and in the next."""
    for at in range(rock.active):
        point = points[points[at].active]
        less = (1.0 - share) * point.leaving
        point.leaving -= less
        point.base[0] -= point.after * less
        if point.rebound > 0.0:
            point.rebound -= less
