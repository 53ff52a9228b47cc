"""Survival of the rocks at a site under each branch of a hazard model, and what that changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.config.hazard_schema import Age, BoundedAge, LognormalAge, NormalAge
from pipeline.config.observation_schema import Earthquake, Observations
from pipeline.stages.hazard.hazard_model import HazardModel
from pipeline.stages.hazard.rock_fragility import DRAWN, RockFragility
from pipeline.stages.hazard.shaking_ratio import ShakingRatio
from vsr_core.arrays import Array, Mask
from vsr_core.hazard.curve import HazardCurve, mean_curve, posterior_weights
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.survival import (
    Standing,
    lognormal_ages,
    normal_ages,
    survival_of,
    uniform_ages,
)
from vsr_core.hazard.toppling import RowFragility, any_of, averaged, toppling

REACH = 10.0
"""How far beyond the first and last level of a curve a fragility is known, as a factor: components
and scale factors move curves along it."""

LARGEST_TO_AVERAGE = 1.2
"""PGA in the direction in which it is largest over that of the average component, RotD100/RotD50:
1.19 in the median of records (Boore & Kishida 2017, Bull. Seismol. Soc. Am. 107)."""

BASE_CASE = "base case"

AS_SCANNED = "rock: as scanned, without uncertainty"
AS_TESTED = "rock: with its uncertainty, its base as tests have found rocks"
"""The cases in which the fits of one rock replace its ensemble, or it replaces them."""

DRAWN_ANEW = "rock: drawn anew in each earthquake"
"""The case in which a draw is a rock in one earthquake, and not for all of its age."""

AGES = (5.0, 95.0)
"""Percentiles of the age for a young and an old rock."""


@dataclass(frozen=True, eq=False)
class DatedRock:
    """A rock with its fragility and its equally likely ages.

    Attributes
    ----------
    ages : ndarray, shape (n,) [year]
    """

    name: str
    fragility: RockFragility
    ages: Array


@dataclass(frozen=True, eq=False)
class BranchResults:
    """Survival under each branch, and the posterior of the model.

    Attributes
    ----------
    rates : ndarray, shape (branches,) [1/year], of toppling while all rocks stand
    survival : ndarray, shape (branches,)
    rejected : ndarray of bool, shape (branches,)
    weights : ndarray, shape (branches,), posterior, 0 where rejected
    after : HazardCurve, the posterior mean; None where every branch is rejected
    """

    rates: Array
    survival: Array
    rejected: Mask
    weights: Array
    after: HazardCurve | None


@dataclass(frozen=True, eq=False)
class SurvivalAnalysis:
    """Rocks that stand at the site of a hazard model.

    Attributes
    ----------
    minimum : float, probability of survival below which a branch is rejected
    component : float, PGA along the direction of shaking over that of the curves
    """

    model: HazardModel
    rocks: tuple[DatedRock, ...]
    table: RatioTable
    minimum: float
    component: float = 1.0

    @cached_property
    def curves(self) -> list[HazardCurve]:
        """Curves of PGA of the branches."""
        return [one.pga for one in self.model.branches]

    @cached_property
    def weights(self) -> Array:
        """Prior weights of the branches."""
        return np.array([one.weight for one in self.model.branches])

    @cached_property
    def before(self) -> HazardCurve:
        """Prior mean curve of the model."""
        return mean_curve(self.curves, self.weights, self.model.levels)

    def fragility_in_pga(self, rock: DatedRock, rows: RowFragility) -> Callable[[Array], Array]:
        """Fragility over the PGA of the curves, averaged over PGV/PGA."""
        span = self.model.levels[[0, -1]] * np.array([1.0 / REACH, REACH])
        along_shaking = averaged(rows, rock.fragility.ratios, self.table, span)
        if self.component == 1.0:
            return along_shaking
        return lambda level: along_shaking(self.component * level)

    @cached_property
    def standing(self) -> list[Standing]:
        """The rocks with their fragilities in PGA."""
        return [
            Standing(self.fragility_in_pga(rock, rock.fragility.mean), rock.ages)
            for rock in self.rocks
        ]

    @property
    def drawn(self) -> bool:
        """Whether the others are draws, of which one is the rock, and not ends of intervals."""
        return all(rock.fragility.source == DRAWN for rock in self.rocks)

    @cached_property
    def others(self) -> list[list[Standing]]:
        """The rocks with each of their other fragilities.

        Several rocks have the others in turn, the fewer again from the first. Of two ensembles the
        members are paired at random, as what is unknown of two rocks is not the same.
        """
        number = max(len(rock.fragility.others) for rock in self.rocks)
        rng, turns = np.random.default_rng(1), []
        for rock in self.rocks:
            own = [
                Standing(self.fragility_in_pga(rock, one), rock.ages)
                for one in rock.fragility.others
            ]
            turn = np.resize(np.arange(len(own)), number)
            paired = rock is self.rocks[0] or rock.fragility.source != DRAWN
            turns.append([own[i] for i in (turn if paired else rng.permutation(turn))])
        return [list(rocks) for rocks in zip(*turns, strict=True)]

    def survival_of_others(self) -> Array:
        """Survival under each branch with each of the other fragilities, (others, branches)."""
        return np.array([[survival_of(one, rocks) for one in self.curves] for rocks in self.others])

    def survival(self, curve: HazardCurve) -> float:
        """Probability that all rocks stand under a curve.

        What is not known of a rock stays as it is through all earthquakes: of draws it is the mean
        of their survivals.
        """
        if self.drawn:
            return float(np.mean([survival_of(curve, rocks) for rocks in self.others]))
        return survival_of(curve, self.standing)

    def survival_alone(self, rock: int, curve: HazardCurve, ages: Array) -> Array:
        """Probability that one of the rocks stands for each of some ages."""
        rocks = [rocks[rock] for rocks in self.others] if self.drawn else [self.standing[rock]]
        rates = np.array([toppling(curve, one.fragility).rate for one in rocks])
        return np.asarray(np.exp(-rates[:, None] * ages).mean(axis=0))

    def results(self) -> BranchResults:
        """Survival under each branch, and the branches weighted by it."""
        return self.reweighted(np.array([self.survival(curve) for curve in self.curves]))

    def reweighted(self, survival: Array) -> BranchResults:
        """The branches weighted by a given survival under each."""
        together = any_of([rock.fragility for rock in self.standing])
        rates = np.array([toppling(curve, together).rate for curve in self.curves])
        new = posterior_weights(self.weights, survival, self.minimum)
        after = None
        if not new.rejected.all():
            after = mean_curve(self.curves, new.weights, self.model.levels)
        return BranchResults(rates, survival, new.rejected, new.weights, after)

    def with_first(self, **changes: RockFragility | Array) -> SurvivalAnalysis:
        """The same analysis, the first rock changed."""
        changed = replace(self.rocks[0], **changes)  # type: ignore[arg-type]
        return replace(self, rocks=(changed, *self.rocks[1:]))


@dataclass(frozen=True, eq=False)
class Case:
    """The analysis with one thing changed."""

    name: str
    analysis: SurvivalAnalysis
    results: BranchResults


def cases(
    analysis: SurvivalAnalysis, ratio: ShakingRatio, compared: Mapping[str, RockFragility]
) -> list[Case]:
    """All cases of the sensitivity study, the base case first.

    Parameters
    ----------
    compared : mapping, from the name of a case to the rock's fragility then
    """
    found = [Case(BASE_CASE, analysis, analysis.results())]
    if analysis.drawn:
        anew = np.array([survival_of(curve, analysis.standing) for curve in analysis.curves])
        found.append(Case(DRAWN_ANEW, analysis, analysis.reweighted(anew)))
    changes = _changes(analysis, ratio, compared)
    return found + [Case(name, one, one.results()) for name, one in changes]


def _changes(
    analysis: SurvivalAnalysis, ratio: ShakingRatio, compared: Mapping[str, RockFragility]
) -> Iterator[tuple[str, SurvivalAnalysis]]:
    for name, fragility in compared.items():
        yield name, analysis.with_first(fragility=fragility)
    first, ordered = analysis.rocks[0], _by_weakness(analysis)
    if len(ordered) > 1:
        for word, (yaw, rows) in (("most", ordered[0]), ("least", ordered[-1])):
            name = f"direction: all shaking at yaw {yaw:g}°, the {word} fragile"
            others = first.fragility.others_by_yaw.get(yaw, first.fragility.others)
            own = replace(first.fragility, mean=rows, others=others)
            yield name, analysis.with_first(fragility=own)
    factor = LARGEST_TO_AVERAGE
    yield (
        f"component: PGA at the rock is {factor:g} times that of the curves, as in the largest "
        "horizontal direction",
        replace(analysis, component=factor),
    )
    yield (
        f"component: PGA at the rock is 1/{factor:g} of that of the curves, as if these were for "
        "the largest horizontal direction",
        replace(analysis, component=1.0 / factor),
    )
    for name, table in ratio.alternatives.items():
        yield name, replace(analysis, table=table)
    if len(first.ages) > 1:
        for share in AGES:
            age = np.percentile(first.ages, [share])
            yield f"age: {age[0]:,.0f} years, its {share:g} % value", analysis.with_first(ages=age)


def _by_weakness(analysis: SurvivalAnalysis) -> list[tuple[float, RowFragility]]:
    """Directions [degree] of the first rock, the one from which it topples most often first."""
    rock = analysis.rocks[0]
    rates = {
        yaw: toppling(analysis.before, analysis.fragility_in_pga(rock, rows)).rate
        for yaw, rows in rock.fragility.by_yaw.items()
    }
    return sorted(rock.fragility.by_yaw.items(), key=lambda item: -rates[item[0]])


def ages_of(age: Age) -> Array:
    """Equally likely ages [year]."""
    if isinstance(age, NormalAge):
        return normal_ages(age.mean, age.sd)
    if isinstance(age, LognormalAge):
        return lognormal_ages(age.median, age.log_sd)
    if isinstance(age, BoundedAge):
        return uniform_ages(age.low, age.high)
    return np.array(age.values)


def years_observed(observed: Observations) -> int:
    """Years in which earthquakes were seen to leave the rock standing."""
    return len({one.year for one in observed if isinstance(one, Earthquake)})


def exposed(age: Age, observed: Observations, *, drawn: bool) -> Array:
    """Equally likely ages [year] without the years that the draws were weighed by already.

    Parameters
    ----------
    drawn : bool, whether the rock is the draws that observations weigh
    """
    return np.maximum(ages_of(age) - (years_observed(observed) if drawn else 0), 0.0)
