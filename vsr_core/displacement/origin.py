"""Where an observed fallen rock came from, and under which shaking.

The forward model is many runs: from a start, under a motion, to an end. The place where a fallen
rock was observed inverts them by Bayes' rule,

    P(cell | place)  ~  P(cell) * mean over the runs of the cell of N(end - place; sigma),

where a cell is a start, a PGA and a PGV/PGA. The kernel is cut off at ``REACH`` sigma, so that a
place that no run explains gets no answer instead of the least bad one. ``sigma`` is the uncertainty
of the place and of the forward model together: a run predicts where the rock comes to rest only to
within the scatter of its bounces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array, Mask
from vsr_core.errors import InvalidInput

REACH = 3.0
"""Distance, in sigma, beyond which an end does not explain a place."""

FEW = 10.0
"""Effective runs below which an answer is said to rest on few."""

_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Forward:
    """Runs whose resting place is known; all arrays over the runs.

    A run that ended before the rock lay still, or unresolved, does not belong here.

    Attributes
    ----------
    start : ndarray of int, shape (n,), number of the start
    pga : ndarray, shape (n,) [g]
    pgv_pga : ndarray, shape (n,) [s]
    end : ndarray, shape (n, 2) [m], x and y at rest; NaN if the rock left the terrain, so that it
        rests nowhere on it. A rock that did not topple rests where it stands.
    """

    start: NDArray[np.int64]
    pga: Array
    pgv_pga: Array
    end: Array

    def __post_init__(self) -> None:
        shapes = (self.start.shape, self.pga.shape, self.pgv_pga.shape, self.end.shape[:1])
        if len(set(shapes)) > 1 or self.end.shape[1:] != (2,):
            given = f"arrays of shapes {(*shapes[:3], self.end.shape)}"
            rule = "each run has a start, a PGA, a PGV/PGA and an end of two coordinates"
            raise InvalidInput(given, rule, "give arrays (n,), (n,), (n,) and (n, 2)")
        if len(self.start) == 0:
            raise InvalidInput(
                "no forward run", "the inverse needs forward runs", "run a grid first"
            )


@dataclass(frozen=True)
class ObservedBoulder:
    """A fallen rock that was observed.

    Attributes
    ----------
    place : (float, float) [m], x and y
    sigma : float [m], standard deviation of each coordinate
    association_probability : float, prior probability that it is the rock of the runs
    area : float [m^2], over which another rock could as well lie; needed if that is below 1

    Raises
    ------
    InvalidInput
        If ``sigma``, a probability or ``area`` is out of range.
    """

    place: tuple[float, float]
    sigma: float
    association_probability: float = 1.0
    area: float = math.inf

    def __post_init__(self) -> None:
        if not (0.0 < self.sigma < math.inf and np.isfinite(self.place).all()):
            given = f"a place {self.place} known to {self.sigma} m"
            remedy = "give sigma in metres, at least the accuracy of the survey"
            raise InvalidInput(given, "a place is finite and its uncertainty above 0", remedy)
        if not 0.0 < self.association_probability <= 1.0 or not self.area > 0.0:
            raise InvalidInput(
                f"association probability {self.association_probability} and area {self.area} m2",
                "a probability above 0 and an area above 0",
                "correct them",
            )
        if self.association_probability < 1.0 and math.isinf(self.area):
            given = f"association probability {self.association_probability} without an area"
            rule = "another rock may lie anywhere on an area"
            raise InvalidInput(given, rule, "give the plan area of the terrain [m2]")


@dataclass(frozen=True, eq=False)
class Origin:
    """What a place says about the start and the shaking.

    Attributes
    ----------
    start : ndarray of int, shape (s,)
    pga : ndarray, shape (p,) [g]
    pgv_pga : ndarray, shape (r,) [s]
    probability : ndarray, shape (s, r, p), sums to 1; 0 in cells without a run; all NaN if there
        is no answer
    weight : ndarray, shape (n,), share of each run in the answer; 0 where there is none
    evidence : float [1/m^2], density of the rock's ends at the place, before the observation
    association_probability : float, posterior; NaN if it
        was certain and yet no run explains the place
    near : int, runs that end within ``REACH`` sigma of the place
    nearest : float [m], from the place to the nearest end; inf without any
    effective : float, effective sample size: the number of equal weights that scatter as much
    statement : str, a sentence on what the answer rests on
    """

    start: NDArray[np.int64]
    pga: Array
    pgv_pga: Array
    probability: Array
    weight: Array
    evidence: float
    association_probability: float
    near: int
    nearest: float
    effective: float
    statement: str

    @property
    def answered(self) -> bool:
        """Whether any run explains the place."""
        return self.evidence > 0.0

    @property
    def of_motion(self) -> Array:
        """Probability of each motion whatever the start, shape (r, p)."""
        total: Array = self.probability.sum(axis=0)
        return total

    def region(self, share: float) -> Mask:
        """Mark the most probable motions, which together hold a share of the probability.

        Motions as probable as the last one needed are all in it.

        Returns
        -------
        ndarray of bool, shape (r, p)
        """
        motion = self.of_motion
        if not self.answered:
            return np.zeros(motion.shape, dtype=bool)
        ranked = np.sort(motion, axis=None)[::-1]
        last = int(np.searchsorted(np.cumsum(ranked), share * (1.0 - _ROUNDING)))
        least = ranked[min(last, ranked.size - 1)]
        inside: Mask = (motion >= least * (1.0 - _ROUNDING)) & (motion > 0.0)
        return inside


def trace(forward: Forward, found: ObservedBoulder, prior: Array | None = None) -> Origin:
    """Probability of each start and motion, given where the fallen rock was observed.

    Parameters
    ----------
    prior : ndarray, shape (s, r, p), optional
        Not negative, of any sum, over the sorted starts, PGV/PGA and PGA of the runs. Alike in
        all cells that hold a run if not given. Cells without a run get nothing: what happens
        there is not known.

    Raises
    ------
    InvalidInput
        If the prior is of another shape, negative, or zero wherever there are runs.

    Examples
    --------
    >>> pga, zeros = np.array([0.4, 0.8]), np.zeros(2)
    >>> ends = np.array([[2.0, 0.0], [8.0, 0.0]])
    >>> runs = Forward(np.zeros(2, dtype=int), pga, zeros + 0.3, ends)
    >>> trace(runs, ObservedBoulder((7.5, 0.0), 1.0)).of_motion
    array([[0., 1.]])
    """
    start, at_start = np.unique(forward.start, return_inverse=True)
    ratio, at_ratio = np.unique(forward.pgv_pga, return_inverse=True)
    pga, at_pga = np.unique(forward.pga, return_inverse=True)
    cell = (at_start, at_ratio, at_pga)
    runs = np.zeros((len(start), len(ratio), len(pga)))
    np.add.at(runs, cell, 1.0)
    before = _prior(runs, prior)

    distance = np.hypot(*(forward.end - found.place).T)
    distance[np.isnan(distance)] = np.inf
    near, nearest = int((distance <= REACH * found.sigma).sum()), float(distance.min())
    weight = before[cell] / runs[cell] * _kernel(distance, found.sigma)
    evidence = float(weight.sum())
    effective, after = 0.0, np.full(runs.shape, np.nan)
    association = math.nan if found.association_probability == 1.0 else 0.0
    if evidence > 0.0:
        weight = weight / evidence
        effective = 1.0 / float(weight @ weight)
        other = (1.0 - found.association_probability) / found.area
        known = found.association_probability * evidence
        association = known / (known + other)
        after = (1.0 - association) * before  # another rock says nothing of this one
        np.add.at(after, cell, association * weight)
    statement = _statement(found, near, nearest, effective)
    return Origin(
        start, pga, ratio, after, weight, evidence, association, near, nearest, effective, statement
    )


def _prior(runs: Array, prior: Array | None) -> Array:
    """Probability of the cells that hold runs, summing to 1."""
    covered = runs > 0.0
    if prior is None:
        return covered / covered.sum()
    if prior.shape != runs.shape or not (prior >= 0.0).all():
        rule = f"it is not negative and of shape {runs.shape}: starts, PGV/PGA, PGA"
        raise InvalidInput(f"a prior of shape {prior.shape}", rule, "give one number a cell")
    total = float(prior[covered].sum())
    if not 0.0 < total < math.inf:
        given = "a prior of zero in every cell with a run"
        rule = "what is impossible beforehand stays impossible"
        raise InvalidInput(given, rule, "run the motions that the prior allows")
    return np.where(covered, prior / total, 0.0)


def _kernel(distance: Array, sigma: float) -> Array:
    """Density [1/m^2] of a place at ``distance`` from an end, nothing beyond the reach."""
    scaled = distance / sigma
    share = 1.0 - math.exp(-0.5 * REACH**2)
    height = 1.0 / (2.0 * math.pi * sigma**2 * share)
    return np.where(scaled <= REACH, height * np.exp(-0.5 * scaled**2), 0.0)


def _statement(found: ObservedBoulder, near: int, nearest: float, effective: float) -> str:
    reach = f"{REACH:g} sigma ({REACH * found.sigma:.3g} m)"
    if not near:
        where = (
            f"the nearest ends {nearest:.3g} m away" if math.isfinite(nearest) else "none is on it"
        )
        return f"No answer: no forward run ends within {reach} of the place; {where}."
    if effective == 0.0:
        return f"No answer: the {near} runs that end within {reach} have no prior probability."
    text = f"{near} forward runs end within {reach} of the place"
    text += f", equivalent to {effective:.1f} of equal weight"
    return f"{text}: few, so more runs may change the answer." if effective < FEW else f"{text}."
