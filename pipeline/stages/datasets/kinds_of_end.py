"""Kinds of ends of runs: the outcomes, and of overturned runs how the rock left its seat."""

from __future__ import annotations

from vsr_core.arrays import Indices, Mask
from vsr_core.outcome import Movement, Outcome

OFF_ITS_SEAT = (Movement.ROLLED_OVER, Movement.FELL, Movement.SLID)


def kinds(outcome: Indices, movement: Indices) -> dict[str, Mask]:
    """Name the kinds of ends that occur, and find the runs of each.

    Overturned runs are parted where not all of them rolled over.

    Examples
    --------
    >>> import numpy as np
    >>> found = kinds(np.array([0, 1, 1, 2]), np.array([0, 1, 3, 3]))
    >>> {name: int(runs.sum()) for name, runs in found.items()}
    {'balanced': 1, 'overturned: rolled over': 1, 'overturned: slid': 1, 'displaced': 1}
    """
    found: dict[str, Mask] = {}
    for one in Outcome:
        runs = outcome == one
        name = one.name.lower()
        if one is Outcome.OVERTURNED and (movement[runs] != Movement.ROLLED_OVER).any():
            found |= {f"{name}: {way.words}": runs & (movement == way) for way in OFF_ITS_SEAT}
        else:
            found[name] = runs
    return {name: runs for name, runs in found.items() if runs.any()}


def ways(outcome: Indices, movement: Indices) -> dict[Movement, int]:
    """Count the overturned runs by how the rock left its seat."""
    left = outcome == Outcome.OVERTURNED
    return {way: int((left & (movement == way)).sum()) for way in OFF_ITS_SEAT}


def in_words(counts: dict[Movement, int]) -> str:
    """Counts of ``ways`` in words.

    Examples
    --------
    >>> in_words({Movement.ROLLED_OVER: 30, Movement.FELL: 2, Movement.SLID: 1200})
    '30 rolled over, 2 fell, 1,200 slid'
    """
    return ", ".join(f"{count:,} {way.words}" for way, count in counts.items())
