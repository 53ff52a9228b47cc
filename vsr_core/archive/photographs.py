"""Rocks known by a photograph: what it does not show is assumed, with a spread."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from vsr_core.archive.equations import HIGHEST, OPEN, Equations
from vsr_core.archive.profiles import Profiles
from vsr_core.arrays import Array, Mask

ODDS = 1.959964
"""Standard deviations to either side of a normal variable that hold 95 % of it."""


@dataclass(frozen=True)
class Assumed:
    """A value that is taken where none is given, and its standard deviation."""

    value: float
    sd: float
    what: str


ASSUMED = {
    "alpha_2": Assumed(1.0, 0.3, "tan(alpha_2) by tan(alpha_1)"),
    "height": Assumed(0.49, 0.04, "height of the centre of mass by that of the rock"),
    "inertia": Assumed(0.33, 0.05, "moment of inertia about the centre of mass by m r_1 r_2"),
    "friction": Assumed(0.6, 0.1, "friction of rock on pedestal"),
    "roundness": Assumed(0.05, 0.05, "radius of the base's edges by the height of the centre"),
}
"""What a photograph may not show. Heights and inertias are those of the shapes drawn, within a
rounding; friction is the project's own; the others are guesses, with the spread of one."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What is known of some rocks, shape (n,) or (n, 2); nan where it is not.

    Attributes
    ----------
    alpha : ndarray, shape (n, 2) [rad], of sides 1 and 2; the second may be nan
    radius : ndarray, shape (n, 2) [m]
    height : ndarray, shape (n,) [m], of the rock; used where no radius is known
    friction, roundness : ndarray, shape (n,)
    """

    alpha: Array
    radius: Array
    height: Array
    friction: Array
    roundness: Array

    def unknown(self) -> dict[str, Mask]:
        """For each thing assumed, of which rocks it is."""
        return {
            "alpha_2": np.isnan(self.alpha[:, 1]),
            "height": np.asarray(np.isnan(self.radius).all(axis=1)),
            "inertia": np.ones(len(self.height), dtype=bool),
            "friction": np.isnan(self.friction),
            "roundness": np.isnan(self.roundness),
        }

    def profiles(self, **off: float) -> Profiles:
        """Profiles with what is assumed; the pulse begins with a push to side 1.

        Parameters
        ----------
        off : by how many standard deviations something is off where it is assumed
        """

        def taken(name: str, given: Array) -> Array:
            one = ASSUMED[name]
            value = max(one.value + off.get(name, 0.0) * one.sd, 0.0)
            return np.where(np.isnan(given), value, given)

        first = np.tan(self.alpha[:, 0])
        other = first * taken("alpha_2", np.tan(self.alpha[:, 1]) / first)
        tan_alpha = np.column_stack([first, other])
        centre = self.radius / np.hypot(1.0, tan_alpha)
        by_height = self.height * taken("height", np.full_like(self.height, np.nan))
        known = np.where(np.isnan(centre), centre[:, ::-1], centre)
        radius = np.hypot(1.0, tan_alpha) * np.where(np.isnan(known), by_height[:, None], known)
        share = ASSUMED["inertia"].value + off.get("inertia", 0.0) * ASSUMED["inertia"].sd
        # A pulse to side 1 makes the rock lean to side 2 first.
        return Profiles(
            tan_alpha[:, ::-1],
            radius[:, ::-1],
            share * radius.prod(axis=1),
            taken("roundness", self.roundness),
            taken("friction", self.friction),
        )


@dataclass(frozen=True, eq=False)
class Answers:
    """Boundaries of rocks known by a photograph, shape (n, 2, m): pushed first to side 1, to 2.

    Attributes
    ----------
    static : ndarray, shape (n,) [g], g tan(alpha_min), to which long pulses lead
    boundary : ndarray [g], nan where none is known to topple it
    low, high : ndarray [g], the boundary is between them with 95 %; high is nan where it is open,
        as the equations end, or friction may be less than a rock needs that topples, or too many
        other shapes have no boundary where the equations give one
    equation : ndarray, 95 % of errors of ln boundary are below, of the equations on other shapes
    none : ndarray, share of other shapes that no run toppled where the equations give this
        boundary; nan where they give none
    unseen : dict of ndarray, standard deviation of ln boundary by what is assumed
    slides : ndarray of bool, shape (n,), whether the rock slides and does not topple
    sliding : ndarray, shape (n,), share of the frictions assumed with which it does; of one that is
        given, 0 or 1
    """

    static: Array
    boundary: Array
    low: Array
    high: Array
    equation: Array
    none: Array
    unseen: dict[str, Array]
    slides: Mask
    sliding: Array

    @property
    def unseen_sd(self) -> Array:
        """Standard deviation of ln boundary by all that is assumed."""
        return np.asarray(np.sqrt(sum(sd**2 for sd in self.unseen.values())))

    @property
    def log_sd(self) -> Array:
        """That of a lognormal fragility where there is a boundary: of assumptions and equations."""
        return np.asarray(np.hypot(self.unseen_sd, self.equation / ODDS))


def answers(seen: Seen, equations: Equations, pgv_pga: Array) -> Answers:
    """Boundaries of rocks, with what is not known of them told apart from the equations' error.

    Parameters
    ----------
    pgv_pga : ndarray, shape (m,) [s]
    """
    best = seen.profiles()
    static = best.weakest
    boundary = _both_ways(equations, best, pgv_pga)
    known = np.stack(
        [
            equations.known(way, pgv_pga, boundary[:, number])
            for number, way in enumerate((best, best.mirrored()))
        ],
        axis=1,
    )
    unseen = dict(_spreads(seen, equations, pgv_pga))
    told = [equations.told_error(best, pgv_pga, boundary[:, number]) for number in range(2)]
    equation, none = np.stack(told, axis=2)  # u is that of both ways
    half = np.hypot(equation, ODDS * np.sqrt(sum(sd**2 for sd in unseen.values())))
    slides = np.asarray(best.friction <= static)
    nothing = ~known | slides[:, None, None]
    friction = ASSUMED["friction"]
    assumed = ndtr((static - friction.value) / friction.sd)
    sliding = np.where(np.isnan(seen.friction), assumed, slides)
    may_stand = 1.0 - (1.0 - sliding[:, None, None]) * (1.0 - none) >= OPEN
    least = seen.profiles(alpha_2=-ODDS).weakest  # below it no pulse topples the rock
    return Answers(
        static,
        np.where(nothing, math.nan, boundary),
        np.maximum(_within(boundary, static) * np.exp(-half), least[:, None, None]),
        np.where(nothing | may_stand, math.nan, boundary * np.exp(half)),
        equation,
        np.where(nothing, math.nan, none),
        unseen,
        slides,
        sliding,
    )


def _within(boundary: Array, static: Array) -> Array:
    """Boundaries, or up to where they were looked for."""
    return np.minimum(boundary, HIGHEST * static[:, None, None])


def _both_ways(equations: Equations, rocks: Profiles, pgv_pga: Array) -> Array:
    """Boundaries [g] of a pulse that begins towards side 1, and towards side 2, shape (n, 2, m)."""
    ways = (rocks, rocks.mirrored())
    return np.stack([equations.boundary(way, pgv_pga) for way in ways], axis=1)


def _spreads(seen: Seen, equations: Equations, pgv_pga: Array) -> Iterator[tuple[str, Array]]:
    """Standard deviation of ln boundary by each thing assumed, shape (n, 2, m).

    It is half of what a standard deviation to either side changes.
    """
    for name, where in seen.unknown().items():
        ends = [
            np.log(_both_ways(equations, seen.profiles(**{name: side}), pgv_pga))
            for side in (-1.0, 1.0)
        ]
        yield name, np.where(where[:, None, None], 0.5 * np.abs(ends[1] - ends[0]), 0.0)
