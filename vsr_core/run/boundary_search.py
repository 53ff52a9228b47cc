"""The search for a boundary: where a rock that stands becomes one that topples.

An unresolved run (unsettled, unstable, crashed) counts for neither side: no end of a bracket
is ever set by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from vsr_core.outcome import Outcome

Topples = Callable[[float], bool | None]
"""From a level, such as a PGA, to whether the rock topples there; None unresolved."""

ASIDE = (0.25, 0.75)
"""Where in a bracket a level is tried next if that in its middle is unresolved."""


@dataclass(frozen=True)
class Bracket:
    """Two levels with a boundary between them.

    Attributes
    ----------
    stands : float, highest level known at which the rock stands
    topples : float, lowest one above it at which it topples; nan if there is none
    decided : bool, false where the search ended early, among unresolved runs only
    """

    stands: float
    topples: float
    decided: bool = True

    @property
    def middle(self) -> float:
        """Level half-way between the two."""
        return 0.5 * (self.stands + self.topples)


def verdict(outcome: Outcome) -> bool | None:
    """Tell whether a run toppled the rock; None where that is unresolved.

    >>> [verdict(o) for o in (Outcome.OVERTURNED, Outcome.DISPLACED, Outcome.UNSETTLED)]
    [True, False, None]
    """
    return None if outcome.overturned < 0 else outcome is Outcome.OVERTURNED


def left_its_place(outcome: Outcome) -> bool | None:
    """Tell whether a run toppled or displaced the rock.

    >>> [left_its_place(o) for o in (Outcome.BALANCED, Outcome.DISPLACED, Outcome.UNSTABLE)]
    [False, True, None]
    """
    return None if outcome.overturned < 0 else outcome is not Outcome.BALANCED


def halved(
    topples: Topples, low: float, high: float, halvings: int, tolerance: float = 0.0
) -> Bracket:
    """Halve a bracket again and again.

    Parameters
    ----------
    low, high : float, levels at which the rock is taken to stand and to topple
    tolerance : float, width of the bracket as a share of its upper end at which it is narrow enough

    >>> halved(lambda level: level > 3.1, 0.0, 8.0, 3)
    Bracket(stands=3.0, topples=4.0, decided=True)

    No end is a level without a verdict:

    >>> found = halved(lambda level: None if 3.0 < level < 5.0 else level > 3.1, 0.0, 8.0, 3)
    >>> 0.0 < found.stands <= 3.0, 5.0 <= found.topples < 8.0
    (True, True)
    >>> halved(lambda level: None, 0.0, 8.0, 3)
    Bracket(stands=0.0, topples=8.0, decided=False)
    """
    for _ in range(halvings):
        if high - low <= tolerance * high:
            break
        for tried in (0.5 * (low + high), *(low + share * (high - low) for share in ASIDE)):
            found = topples(tried)
            if found is not None:
                break
        else:
            return Bracket(low, high, decided=False)
        low, high = (low, tried) if found else (tried, high)
    return Bracket(low, high)


def first_boundary(topples: Topples, levels: Iterable[float], halvings: int) -> Bracket:
    """Go up until the rock topples, then halve. A band of toppling between levels is passed over.

    Parameters
    ----------
    levels : iterable of float, ascending; below the first the rock is taken to stand from 0 on

    >>> first_boundary(lambda level: level > 3.1, [1.0, 2.0, 4.0, 8.0], 1)
    Bracket(stands=3.0, topples=4.0, decided=True)
    """
    stands = 0.0
    for level in levels:
        found = topples(level)
        if found:
            return halved(topples, stands, level, halvings)
        if found is not None:
            stands = level
    return Bracket(stands, math.nan)
