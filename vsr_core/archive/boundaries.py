"""Boundaries of drawn rocks, resolved by runs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vsr_core import GRAVITY
from vsr_core.archive import profiles, shapes
from vsr_core.archive.equations import MOST_GRIP, SHORTEST
from vsr_core.archive.profiles import Profiles
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock.body import Rock
from vsr_core.run.boundary_search import first_boundary, verdict
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.input_checks import longest_step
from vsr_core.run.overturning import simulate_all
from vsr_core.scene import Contact, Scene

SEED = 3
"""Of all that is drawn."""

ORDER = ("box", "prism", "hull", "prism", "hull")
"""Families of the shapes, by their numbers."""

ENGINE = "nonsmooth"
"""Engine of the runs."""

STEP_SHARE = 0.014
"""Time step as a share of sqrt(radius / g), at most that by which the engine is known to rock."""

PERIODS = (0.2, SHORTEST)
"""Range of 1 / (p PGV/PGA), p the geometric mean of both rocking points'."""

ROWS = 10
"""PGV/PGA of a rock and direction, spread over that range."""

LADDER = np.append(0.98, 1.06 ** np.arange(41))
"""PGAs that are tried one after the other, in units of that which topples if it lasts."""

HALVINGS = 3
"""Of the step of the ladder in which the boundary is: to 0.7 %."""

AHEAD = 6
"""PGAs of the ladder that are run together."""

SLENDER = (math.tan(math.radians(3.0)), math.tan(math.radians(35.0)))
"""Range of tan(alpha) of the weaker side."""

FRICTION = (0.35, 1.1)
"""Range of friction."""

ROUNDEST = 0.4
"""Largest roundness of the edges of the base."""


@dataclass(frozen=True, eq=False)
class Resolved:
    """Boundaries of one rock in one direction.

    Attributes
    ----------
    family : str
    profile : Profiles, shape ()
    pgv_pga : ndarray, shape (n,) [s]
    stands, topples : ndarray, shape (n,) [g]
        Ends of the interval of first overturning; the latter is nan where the ladder has none.
    runs : int
    """

    family: str
    profile: Profiles
    pgv_pga: Array
    stands: Array
    topples: Array
    runs: int


def of_number(number: int) -> list[Resolved]:
    """Draw the rock of a number and resolve its boundaries in two opposite directions."""
    random, family = np.random.default_rng([SEED, number]), ORDER[number % len(ORDER)]
    while True:
        try:
            shape = shapes.FAMILIES[family](random)
        except InvalidInput:  # it does not stand as it was drawn
            continue
        friction = random.uniform(*FRICTION)
        profile = profiles.of_rock(shape.rock, friction, shape.edge)
        if is_within(profile) and profiles.rests_flat(shape.rock):
            return of_rock(shape.rock, profile, random, family)


def is_within(profile: Profiles) -> bool:
    """Whether the equations are made for a rock like this."""
    weaker, other = np.sort(profile.tan_alpha)
    grips = weaker < MOST_GRIP * profile.friction
    return bool(
        grips and SLENDER[0] < weaker < SLENDER[1] and other < 1.0 and profile.roundness < ROUNDEST
    )


def of_rock(
    rock: Rock, profile: Profiles, random: np.random.Generator, family: str
) -> list[Resolved]:
    """Boundaries of a rock in +x and in -x, at PGV/PGA drawn in equal parts of their range."""
    limits, found = barrier(rock), []
    for yaw in (0.0, math.pi):
        seen = profile if yaw == 0.0 else profile.mirrored()
        low, high = np.log(PERIODS)
        parts = (np.arange(ROWS) + random.random(ROWS)) / ROWS
        pgv_pga = np.exp(-low - parts * (high - low)) / math.sqrt(seen.p.prod())
        case = prepare(Scene(rock, Contact(float(profile.friction)), yaw), limits, reduce=True)
        found.append(resolved(case, seen, pgv_pga, family))
    return found


def resolved(case: Case, profile: Profiles, pgv_pga: Array, family: str) -> Resolved:
    """Boundaries of a case at some PGV/PGA.

    Parameters
    ----------
    pgv_pga : ndarray, shape (n,) [s]
    """
    step = min(
        longest_step(case.full, ENGINE), STEP_SHARE * math.sqrt(case.full.rock.radius / GRAVITY)
    )
    tries = [
        _Tries(case, ratio, Settings(step, engine=ENGINE), float(profile.weakest) * LADDER)
        for ratio in pgv_pga.tolist()
    ]
    found = [first_boundary(one, one.levels, HALVINGS) for one in tries]
    ends = np.array([(one.stands, one.topples) for one in found])
    runs = sum(len(one.known) for one in tries)
    return Resolved(family, profile, pgv_pga, ends[:, 0], ends[:, 1], runs)


class _Tries:
    """Whether a PGA [g] topples a rock, asked of the next ones of a ladder at once."""

    def __init__(self, case: Case, pgv_pga: float, settings: Settings, ladder: Array) -> None:
        self.case, self.pgv_pga, self.settings = case, pgv_pga, settings
        self.levels: list[float] = ladder.tolist()
        self.known: dict[float, bool | None] = {}

    def __call__(self, pga: float) -> bool | None:
        if pga not in self.known:
            asked = [pga]
            if pga in self.levels:
                first = self.levels.index(pga)
                asked = self.levels[first : first + AHEAD]
            pulses = [CosinePulse.from_g(one, self.pgv_pga) for one in asked]
            found = simulate_all(self.case, pulses, self.settings)
            self.known.update(zip(asked, (verdict(one.outcome) for one in found), strict=True))
        return self.known[pga]
