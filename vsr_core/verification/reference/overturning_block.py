"""The PGA that overturns a block, against Housner's equation, closed forms and similar blocks.

References
----------
Housner (1963), Bull. Seismol. Soc. Am. 53(2), 403-417.
Zhang & Makris (2001), J. Eng. Mech. 127(5): blocks under one-cycle pulses, with and without impact.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Response
from vsr_core.run.boundary_search import halved, verdict
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.scene import Contact, Scene
from vsr_core.verification.reference import case
from vsr_core.verification.rocking_forms import slender_overturns, slender_pga_without_impact
from vsr_core.verification.rocks import GRIPPING, box

BLOCKS = (
    (2.0, 2.0),
    (0.5, 2.5),
    (5.0, 3.0),
    (0.2, 3.5),
    (1.0, 4.0),
    (0.05, 5.0),
    (3.0, 6.5),
    (0.1, 8.0),
)
"""Height [m] and slenderness, height over width, of the blocks; they are as deep as wide."""

PERIODS = (0.4, 0.42, 0.44, 0.46, 0.48, 0.5, 0.515, 0.53)
"""PGV/PGA in units of sqrt(R / g). There one impact decides for all blocks. Shorter pulses overturn
stocky ones at several g or never; longer ones overturn slender ones after many impacts."""

WINDOW, HALVINGS = 0.05, 7
"""Half the range, as a share of the answer, in which a boundary is sought; how often it is
halved."""

SLENDER = (0.2, 4.0)
"""Width and height of a block of alpha = 0.05 [m]."""

PERIOD = 0.45
"""PGV/PGA of its pulses in units of sqrt(R / g). It overturns after one impact from 1.57 times
g alpha on, is safe again from 5.9, and overturns at once from 8.3 on."""


@cache
def _prepared(block: Block) -> Case:
    width = 2.0 * block.half_width
    scene = Scene(box(width, width, 2.0 * block.half_height), Contact(GRIPPING))
    return prepare(scene, barrier(scene.rock), reduce=True)


def _error(block: Block, pgv_pga: float, answer: float, engine: str, time_step: float) -> float:
    """Relative error of a boundary [m/s^2] as found in an engine.

    ``WINDOW`` if it is beyond, or if unresolved runs keep it from being found.
    """
    settings = Settings(time_step, engine=engine)

    def topples(pga: float) -> bool | None:
        return verdict(simulate(_prepared(block), CosinePulse(pga, pgv_pga), settings).outcome)

    found = halved(topples, (1.0 - WINDOW) * answer, (1.0 + WINDOW) * answer, HALVINGS)
    return abs(found.middle / answer - 1.0) if found.decided else WINDOW


def boundaries(
    blocks: tuple[tuple[float, float], ...],
    periods: tuple[float, ...],
    engine: str,
    time_step: float,
) -> Array:
    """Relative errors of first-overturning PGAs.

    Parameters
    ----------
    blocks : height [m] and slenderness of each
    time_step : float [s]
        Of a block of 1 x 1 x 2 m; those of others are the same share of sqrt(R / g).

    Returns
    -------
    ndarray, shape (blocks, periods)
    """
    share = time_step / _unit(_block(*BLOCKS[0]))
    errors = []
    for height, slenderness in blocks:
        block = _block(height, slenderness)
        unit = _unit(block)
        errors.append(
            [
                _error(block, x * unit, _answer(height, slenderness, x), engine, share * unit)
                for x in periods
            ]
        )
    return np.array(errors)


def _median(engine: str, time_step: float) -> float:
    """Median relative error of the 64 boundaries. Errors end at 0.05."""
    return float(np.median(boundaries(BLOCKS, PERIODS, engine, time_step)))


def _worst(engine: str, time_step: float) -> float:
    """Largest relative error of the 64 boundaries. Errors end at 0.05."""
    return float(boundaries(BLOCKS, PERIODS, engine, time_step).max())


@cache
def _answer(height: float, slenderness: float, period: float) -> float:
    """First-overturning PGA [m/s^2] of Housner's equation."""
    block = _block(height, slenderness)
    # One impact decides: the lowest overturning interval is much wider than the step.
    highest, step = 5.0 * block.uplift, 0.1 * block.uplift
    return first_overturning_pga(block, period * _unit(block), highest, step)


def _block(height: float, slenderness: float) -> Block:
    return Block(0.5 * height / slenderness, 0.5 * height)


def _unit(block: Block) -> float:
    """Unit of time of a block, sqrt(R / g) [s]."""
    return math.sqrt(block.radius / GRAVITY)


def _at_once(engine: str, time_step: float) -> float:
    """Relative error of the PGA that overturns a slender block at once. Errors end at 0.05."""
    block = Block(0.5 * SLENDER[0], 0.5 * SLENDER[1])
    pgv_pga = PERIOD * _unit(block)
    return _error(block, pgv_pga, slender_pga_without_impact(block, pgv_pga), engine, time_step)


def _after_impact(engine: str, time_step: float) -> float:
    """Relative error of the PGA that overturns it after one impact. Errors end at 0.05."""
    block = Block(0.5 * SLENDER[0], 0.5 * SLENDER[1])
    pgv_pga = PERIOD * _unit(block)

    def topples(pga: float) -> bool:
        return slender_overturns(block, pga, pgv_pga)

    answer = halved(topples, 1.01 * block.uplift, 3.0 * block.uplift, 40).middle
    return _error(block, pgv_pga, answer, engine, time_step)


GRID = "Housner's equation, eight blocks of 5 cm to 5 m and slenderness 2 to 8, eight PGV/PGA"
CLOSED = "closed form of the linearised equation (Zhang & Makris 2001), alpha = 0.05."

_BOUNDARIES = (
    case("first-overturning PGA, median of 64", GRID, 4e-3, _median),
    case("first-overturning PGA, worst of 64", GRID, 0.01, _worst),
    case("slender block, overturned at once", CLOSED, 2e-3, _at_once),
    case("slender block, overturned after an impact", CLOSED, 6e-3, _after_impact, step=2.5e-4),
)


SIMILAR_FRICTION = 0.6
"""That of the paper."""

SIMILAR_PULSES = ((0.6, 0.15), (0.8, 0.2), (1.1, 0.2), (0.65, 0.3), (1.3, 0.3), (0.7, 0.4))
"""PGA [g] and PGV/PGA [s] of the pulses on the larger block; some overturn it."""


@cache
def _similar(width: float) -> Case:
    scene = Scene(box(width, width, 2.0 * width), Contact(SIMILAR_FRICTION))
    return prepare(scene, barrier(scene.rock), reduce=True)


def _similar_run(width: float, pulse: CosinePulse, engine: str, time_step: float) -> Response:
    return simulate(_similar(width), pulse, Settings(time_step, engine=engine))


def _similarity(engine: str, time_step: float) -> float:
    """Largest difference of the peak tilts of two blocks, relative to alpha; 1 if outcomes differ.

    The step is that of the larger block.
    """
    alpha, half = math.atan(0.5), math.sqrt(0.5)
    apart = []
    for pga, pgv_pga in SIMILAR_PULSES:
        large = _similar_run(1.0, CosinePulse.from_g(pga, pgv_pga), engine, time_step)
        small = _similar_run(0.5, CosinePulse.from_g(pga, half * pgv_pga), engine, half * time_step)
        if large.outcome is not small.outcome:
            return 1.0
        apart.append(abs(large.peak_tilt - small.peak_tilt) / alpha)
    return max(apart)


SIMILAR = "1x1x2 m at PGV/PGA = x moves as 0.5x0.5x1 m at x / sqrt(2): dimensional analysis"

CASES = (*_BOUNDARIES, case("similar blocks", SIMILAR, 1e-6, _similarity))
