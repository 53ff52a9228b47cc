"""What a run can end as, and what decided it. The values are stored; never renumber them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from vsr_core.arrays import Indices, Mask

DISPLACED_SHARE = 0.1
"""A rock still upright is displaced once its base slid by this share of its radius."""

AT_REST = ("peak_tilt", "final_tilt", "slip")
"""Quantities of runs whose rock stays upright, up to where it rests."""

OF_TRAVEL = ("end_position", "trajectory")
"""Quantities of runs over a terrain whose rock leaves its place, up to where it rests."""

QUANTITIES = AT_REST + OF_TRAVEL


class Outcome(IntEnum):
    """Final state of the rock.

    ``unsettled``: neither at rest nor provably bound to a side when time ran out.
    ``unstable``: the numerical guards failed at every step tried. ``crashed``: the worker died.
    None of these three is ever counted as balanced.
    """

    BALANCED = 0
    OVERTURNED = 1
    DISPLACED = 2
    UNSETTLED = 3
    UNSTABLE = 4
    CRASHED = 5

    @property
    def overturned(self) -> int:
        """1 overturned, 0 upright, -1 undecided."""
        if self is Outcome.OVERTURNED:
            return 1
        return 0 if self in (Outcome.BALANCED, Outcome.DISPLACED) else -1


class Movement(IntEnum):
    """How a rock left its seat; told by ``vsr_core.run.movement``."""

    STAYED = 0
    ROLLED_OVER = 1
    FELL = 2
    SLID = 3

    @property
    def words(self) -> str:
        """The same for a sentence."""
        return self.name.lower().replace("_", " ")


class DecidedBy(IntEnum):
    """The rule that ended a run, or kept it from starting."""

    SIMULATION = 0, "simulated until at rest, on a terrain toppled or gone, out of time, or failed"
    NO_UPLIFT_BOUND = 1, "not run: provably too weak to lift or slide the rock"
    ENERGY_BOUND = 2, "stopped early: too little energy left to change the outcome"
    NO_RETURN = 3, "stopped early: falling, past any support"

    how: str

    def __new__(cls, value: int, how: str) -> DecidedBy:
        """A rule with its words."""
        rule = int.__new__(cls, value)
        rule._value_, rule.how = value, how
        return rule


def ran_whole(outcome: Indices, decided_by: Indices, *, on_terrain: bool) -> Mask:
    """Whether runs went on until nothing moved any more, so that their peaks are known.

    Parameters
    ----------
    on_terrain : bool, where a run ends as soon as the rock has toppled
    """
    early = (decided_by == DecidedBy.ENERGY_BOUND) | (decided_by == DecidedBy.NO_RETURN)
    lost = (outcome == Outcome.UNSTABLE) | (outcome == Outcome.CRASHED)
    whole: Mask = ~early & ~lost
    return whole & (outcome != Outcome.OVERTURNED) if on_terrain else whole


class FoundBy(IntEnum):
    """How the outcome of a draw in a cell is known."""

    SIMULATED = 0
    PROVED = 1
    INFERRED = 2


class StopReason(IntEnum):
    """What ended a run over the terrain."""

    REST = 0
    LEFT_TERRAIN = 1
    TIME = 2
    UNDONE = 3


@dataclass(frozen=True)
class Response:
    """Result of one run.

    Attributes
    ----------
    peak_tilt, final_tilt : float [rad]
        Of the rock's vertical axis, up to the moment the outcome was decided.
    slip : float [m]
        Largest horizontal travel of the base's centre relative to the table, up to then.
    steps : int
        Steps of the successful attempt, retries excluded; 0 if the run did not start.
    """

    outcome: Outcome
    decided_by: DecidedBy
    peak_tilt: float
    final_tilt: float
    slip: float
    steps: int
