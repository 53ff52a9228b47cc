"""The overturning boundary of a row: what is right there, and from where on outcomes agree with it.

A row is one direction and one PGV/PGA; its boundary is the PGA between standing and toppling. From
there outwards outcomes are compared with what is right, until they agree: how far that is, as a
share of the boundary, is an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vsr_core import GRAVITY
from vsr_core.outcome import Outcome
from vsr_core.run.cases import Case
from vsr_core.verification.rocking_block import Block, first_overturning_pga, rocking_response

Topples = Callable[[float], bool | None]
"""From a PGA [m/s^2] to whether the rock topples. Of a run None is no verdict, and never right; of
a reference it is no answer, and either outcome passes."""

OFFSETS = (0.00125, 0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.08)
"""Distances from the boundary at which outcomes are compared, as shares of it."""

WORST = 0.12
"""Error noted where outcomes differ even at the largest of these."""

WINDOW, HALVINGS = 0.1, 6
"""Half the range, as a share, in which the reference's boundary is bisected, and how often."""

STRONGEST = 4.0 * GRAVITY
"""Strongest pulse tried [m/s^2]."""


@dataclass(frozen=True)
class Answer:
    """What is right on a row.

    Attributes
    ----------
    boundary : float [m/s^2]; nan if nothing topples the rock
    right : Topples
    exact : bool, whether by Housner's equation
    spread : float, how far the references are apart, relative; 0 if exact
    """

    boundary: float
    right: Topples
    exact: bool
    spread: float


def answer(
    case: Case,
    pgv_pga: float,
    coarse: Topples,
    bisected: Sequence[Topples],
    asked: Sequence[Topples],
) -> Answer:
    """What is right on a row: by Housner's equation where it applies, else by references.

    Parameters
    ----------
    case : Case
    pgv_pga : float [s]
    coarse : Topples, finds about where the boundary is
    bisected : references whose boundary is sought there; that of the row is their mean
    asked : references asked for the outcome; where they differ there is no answer
    """
    block = rocking_block(case)
    if block is not None:
        boundary = first_overturning_pga(block, pgv_pga, STRONGEST, 0.005 * GRAVITY)
        return Answer(
            _reached(boundary),
            lambda pga: rocking_response(block, pga, pgv_pga).overturned,
            exact=True,
            spread=0.0,
        )
    near = bisect(coarse, 0.9 * min(-case.static_limits[0], case.static_limits[1]), STRONGEST, 9)
    ends = (1.0 - WINDOW) * near, (1.0 + WINDOW) * near
    found = [bisect(reference, *ends, HALVINGS) for reference in bisected]
    boundary = float(np.mean(found))

    def agreed(pga: float) -> bool | None:
        outcomes = {_counts_as_toppled(reference(pga)) for reference in asked}
        return outcomes.pop() if len(outcomes) == 1 else None

    return Answer(_reached(boundary), agreed, exact=False, spread=float(np.ptp(found)) / boundary)


def _reached(boundary: float) -> float:
    """The boundary [m/s^2], or nan where even the strongest pulses hardly topple the rock."""
    return boundary if boundary < 0.9 * STRONGEST else math.nan


def verdict(outcome: Outcome) -> bool | None:
    """Whether a run toppled the rock; None without a verdict."""
    return None if outcome.overturned < 0 else outcome is Outcome.OVERTURNED


def bisect(topples: Topples, low: float, high: float, halvings: int) -> float:
    """PGA [m/s^2] between one that stands and one that topples, from ``low`` and ``high``."""
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _counts_as_toppled(topples(middle)) else (middle, high)
    return 0.5 * (low + high)


def _counts_as_toppled(outcome: bool | None) -> bool:
    """A run without a verdict does: it must not pass for one that stands."""
    return outcome is None or bool(outcome)


def levels(boundary: float) -> list[tuple[float, float]]:
    """PGAs [m/s^2] at which outcomes are compared, nearest first: below and above the boundary."""
    return [(boundary * (1.0 - offset), boundary * (1.0 + offset)) for offset in OFFSETS]


def agrees_from(topples: Topples, right: Topples, boundary: float) -> float:
    """Least offset at which an outcome is right, the larger of both sides of the boundary.

    Parameters
    ----------
    topples : Topples, what is judged
    right : Topples
    boundary : float [m/s^2]
    """
    return max(_one_side(topples, right, side) for side in zip(*levels(boundary), strict=True))


def _one_side(topples: Topples, right: Topples, side: Sequence[float]) -> float:
    for offset, pga in zip(OFFSETS, side, strict=True):
        found = topples(pga)
        if found is not None and right(pga) in (None, found):
            return offset
    return WORST


def rocking_block(case: Case) -> Block | None:
    """Housner's block that a scene is; None if it is another.

    A scene is one for a box that rocks about an edge across the shaking, on a pedestal that it
    grips: friction above b/h, no restitution, no rolling friction, no servo.
    """
    full, contact = case.full, case.full.contact
    half_x, half_y, half_z = (float(half) for half in np.abs(full.rock.vertices).max(axis=0))
    straight = abs(math.cos(full.yaw)) > 1.0 - 1e-12
    across = abs(math.sin(full.yaw)) > 1.0 - 1e-12
    half = half_x if straight else half_y
    rocks = half < 0.95 * half_z and contact.friction > 1.15 * half / half_z
    plain = contact.restitution == contact.rolling_friction == 0.0 and full.drive is None
    if full.rock.shape == "box" and rocks and plain and (straight or across):
        return Block(half, half_z)
    return None
