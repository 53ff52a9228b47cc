"""What is right near the overturning boundary of a row, and from where on outcomes agree with it.

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
from vsr_core.run.boundary_search import Topples, halved
from vsr_core.run.cases import Case, TerrainCase
from vsr_core.run.rocking_block import Block, first_overturning_pga, rocking_response

Passing = Callable[[float], frozenset[bool]]
"""From a PGA [m/s^2] to the outcomes that pass there, True for toppling: one that is right, both
where references differ, and none where a reference is unresolved. Where both pass nothing agrees:
no error is told below what the references know."""

OFFSETS = (0.00125, 0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.08)
"""Distances from the boundary at which outcomes are compared, as shares of it."""

WORST = 0.12
"""Error noted where outcomes differ even at the largest of these."""

WINDOW, HALVINGS = 0.1, 8
"""Half the range, as a share, in which the reference's boundary is searched, and how often it is
halved: to less than the nearest pulses are apart, as both would else end alike beside it."""

WINDOWS = 5
"""Such ranges looked at, each about the end of the one before at which the boundary was."""

BAND = 0.005
"""Width, as a share, of a lowest band of toppling that Housner's block is searched for."""

STRONGEST = 4.0 * GRAVITY
"""Strongest pulse tried [m/s^2]."""

HIGHEST = 0.9 * STRONGEST
"""Highest boundary told [m/s^2]: pulses around it are no stronger than that."""


@dataclass(frozen=True)
class Answer:
    """What is right on a row.

    Attributes
    ----------
    boundary : float [m/s^2]; nan if nothing topples the rock
    exact : bool, whether by Housner's equation
    spread : float, how far the references are apart, relative; 0 if exact, and ``WINDOW`` where
        they are so far apart, or further, that no range looked at holds them all
    """

    boundary: float
    passing: Passing
    exact: bool
    spread: float


def answer(
    case: Case,
    pgv_pga: float,
    coarse: Topples,
    searched: Sequence[Topples],
    asked: Sequence[Topples],
) -> Answer:
    """Tell what is right on a row: by Housner's equation where it applies, else by references.

    Parameters
    ----------
    pgv_pga : float [s]
    coarse : Topples, finds about where the boundary is
    """
    block = rocking_block(case)
    if block is not None:
        boundary = first_overturning_pga(block, pgv_pga, STRONGEST, BAND * block.uplift)
        return Answer(
            _reached(boundary),
            lambda pga: frozenset({rocking_response(block, pga, pgv_pga).overturned}),
            exact=True,
            spread=0.0,
        )
    return by_references(case, coarse, searched, asked)


def by_references(
    case: Case | TerrainCase, coarse: Topples, searched: Sequence[Topples], asked: Sequence[Topples]
) -> Answer:
    """Tell what is right on a row by references alone, of toppling or of another event."""
    limits, margin = case.static_limits, 1.5 * 0.5**HALVINGS
    near = halved(coarse, 0.9 * min(-limits[0], limits[1]), STRONGEST, 9).middle
    for _ in range(WINDOWS):
        ends = (1.0 - WINDOW) * near, (1.0 + WINDOW) * near
        found = [halved(reference, *ends, HALVINGS).middle for reference in searched]
        boundary = float(np.mean(found))
        if all(abs(one / near - 1.0) < WINDOW * (1.0 - margin) for one in found):
            break
        near = boundary  # at an end: it may lie beyond
    else:
        return Answer(_reached(boundary), lambda pga: frozenset(), exact=False, spread=WINDOW)

    def passing(pga: float) -> frozenset[bool]:
        outcomes = [reference(pga) for reference in asked]
        known = frozenset(outcome for outcome in outcomes if outcome is not None)
        return frozenset() if None in outcomes else known

    return Answer(_reached(boundary), passing, exact=False, spread=float(np.ptp(found)) / boundary)


def _reached(boundary: float) -> float:
    """The boundary [m/s^2], or nan where it is above ``HIGHEST`` if there is one."""
    return boundary if boundary < HIGHEST else math.nan


def levels(boundary: float) -> list[tuple[float, float]]:
    """List the PGAs at which outcomes are compared, nearest first.

    Parameters
    ----------
    boundary : float [m/s^2]

    Returns
    -------
    list of (below, above) the boundary [m/s^2]
    """
    return [(boundary * (1.0 - offset), boundary * (1.0 + offset)) for offset in OFFSETS]


def agrees_from(topples: Topples, passing: Passing, boundary: float) -> float:
    """Find the least offset at which an outcome is right, the larger of both sides.

    Parameters
    ----------
    topples : Topples, what is judged; unresolved it is never right
    boundary : float [m/s^2]
    """
    return max(_one_side(topples, passing, side) for side in zip(*levels(boundary), strict=True))


def _one_side(topples: Topples, passing: Passing, side: Sequence[float]) -> float:
    for offset, pga in zip(OFFSETS, side, strict=True):
        if passing(pga) == {topples(pga)}:
            return offset
    return WORST


def rocking_block(case: Case) -> Block | None:
    """Find Housner's block that a scene is.

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
