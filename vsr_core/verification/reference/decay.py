"""A block set down leaning rocks freely, and loses energy in its impacts only.

References
----------
Housner (1963), Bull. Seismol. Soc. Am. 53(2), 403-417: angular momentum about the new edge is kept
in an impact, so that the rate is multiplied by 1 - 1.5 sin(alpha)^2 for a uniform box.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array
from vsr_core.run.rocking_block import Block
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import case
from vsr_core.verification.reference._run import Path, run, whole
from vsr_core.verification.rocking_forms import free_amplitude, free_period
from vsr_core.verification.rocks import GRIPPING, box, leaning

SLENDER, STOCKY = Block(0.2, 1.0), Block(0.7, 1.0)
"""Blocks that keep 0.94 and 0.51 of their rate in an impact."""

LEAN = 0.6
"""At the start, as a share of alpha."""

IMPACTS = 2
"""That are measured."""


@cache
def _scene(block: Block) -> Scene:
    width = 2.0 * block.half_width
    rock = box(width, width, 2.0 * block.half_height)
    return Scene(rock, Contact(GRIPPING), start=leaning(rock, LEAN * block.alpha))


def _released(block: Block, engine: str, time_step: float) -> Path:
    """Path of a block from rest until its swing after the last impact is over."""
    falls = [free_period(block, amplitude) / 4.0 for amplitude in _amplitudes(block)]
    duration = falls[0] + 2.0 * sum(falls[1:])
    number, step = whole(duration, time_step)
    return run(engine, _scene(block), step, np.zeros(number))


def _amplitudes(block: Block) -> list[float]:
    """Of the start, and after each impact [rad]."""
    start = LEAN * block.alpha
    return [start, *(free_amplitude(block, start, n) for n in range(1, IMPACTS + 1))]


def _ratio(block: Block, engine: str, time_step: float) -> float:
    """Largest error of the rate kept in an impact, relative to 1 - 1.5 sin(alpha)^2.

    Rates before and after are those that the largest tilts on both sides have the energy for.
    """
    path = _released(block, engine, time_step)
    swings = np.split(path.lean, _impacts(path.lean))
    if len(swings) < IMPACTS + 1:
        return math.nan
    tops = np.array([np.abs(swing).max() for swing in swings[: IMPACTS + 1]])
    excess = np.cos(block.alpha - tops) - math.cos(block.alpha)
    kept = np.sqrt(excess[1:] / excess[:-1])
    return float(np.abs(kept / block.impact_ratio - 1.0).max())


def _timing(block: Block, engine: str, time_step: float) -> float:
    """Error of the time of the last impact, relative to it."""
    path = _released(block, engine, time_step)
    at = _impacts(path.lean)
    if len(at) < IMPACTS:
        return math.nan
    last = at[IMPACTS - 1]
    before, after = path.lean[last - 1], path.lean[last]
    share = before / (before - after)
    time = path.time[last - 1] + share * (path.time[last] - path.time[last - 1])
    falls = [free_period(block, top) / 4.0 for top in _amplitudes(block)]
    exact = falls[0] + 2.0 * sum(falls[1:IMPACTS])
    return abs(float(time) / exact - 1.0)


def _impacts(lean: Array) -> NDArray[np.int64]:
    """Readings just behind a passage through the upright."""
    return np.nonzero(lean[1:] * lean[:-1] < 0.0)[0] + 1


HOUSNER = "Housner (1963): angular momentum about the new edge, energy between impacts"

CASES = (
    case("free rocking, slender, ratio", HOUSNER, 5e-3, _ratio, SLENDER),
    case("free rocking, slender, timing", HOUSNER, 4e-3, _timing, SLENDER),
    case("free rocking, stocky, ratio", HOUSNER, 0.01, _ratio, STOCKY),
    case("free rocking, stocky, timing", HOUSNER, 4e-3, _timing, STOCKY),
)
