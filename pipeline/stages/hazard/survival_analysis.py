"""Survival of the rocks at a site under each branch of a hazard model, and what that changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from pipeline.stages.hazard.hazard_model import HazardModel
from pipeline.stages.hazard.rock_fragility import DRAWN, FITTED, RockFragility
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.hazard.curve import HazardCurve, mean_curve, posterior_weights
from vsr_core.hazard.shaking import EventShaking, Shaking
from vsr_core.hazard.survival import Rates, Spell, Stage, Standing, spells, survival_of
from vsr_core.hazard.toppling import Fragility, any_of

CATALOGUES = 200
"""Catalogues that are drawn again for a sampling error, which is then known to 5 %."""

_FACTORS, _LEAST = 9, 1e-300
"""Factors on rates between which ln survival is straight, and the least survival of which it is."""


@dataclass(frozen=True, eq=False)
class DatedRock:
    """A rock with its fragility and its equally likely ages.

    Attributes
    ----------
    ages : ndarray, shape (n,) [year]
    earlier : tuple of its fragility and when it ended, shape (n,) [years before present], for each
        stage in which it was exhumed, the latest first
    """

    name: str
    fragility: RockFragility
    ages: Array
    earlier: tuple[tuple[RockFragility, Array], ...] = ()

    @property
    def stages(self) -> tuple[RockFragility, ...]:
        """As it stands now, and in its earlier stages, the latest first."""
        return (self.fragility, *(one for one, _ in self.earlier))

    def within_tested(self) -> DatedRock:
        """The same, as if nothing more toppled beyond the largest PGA that was tried."""
        return self.in_each_stage(RockFragility.within_tested)

    def in_each_stage(self, of: Callable[[RockFragility], RockFragility]) -> DatedRock:
        """The same with another fragility in each of its stages."""
        earlier = tuple((of(one), until) for one, until in self.earlier)
        return replace(self, fragility=of(self.fragility), earlier=earlier)

    @property
    def numbers(self) -> Indices:
        """Of the draws, of which one is the rock, that all stages with draws have; or none."""
        drawn = [one.numbers for one in self.stages if one.source == DRAWN] or [np.array([], int)]
        had = np.all([np.isin(drawn[0], one) for one in drawn], axis=0)
        return drawn[0] if had.all() else drawn[0][had]

    @property
    def effective(self) -> float:
        """Effective number of its draws, some of which observations may have chosen repeatedly.

        That of the stage with the fewest, as if what it does to survival were all there is.
        """
        return min((one.effective for one in self.stages if one.source == DRAWN), default=0.0)

    @property
    def drawn(self) -> bool:
        """Whether it has draws."""
        return len(self.numbers) > 0

    def aged(self, age: Array) -> DatedRock:
        """The same at one age, shape (1,); of its stages the draws that had ended since."""
        if not self.earlier:
            return replace(self, ages=age)
        kept = self.earlier[-1][1] < age
        earlier = tuple((one, until[kept]) for one, until in self.earlier)
        return replace(self, ages=np.repeat(age, kept.sum()), earlier=earlier)


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
    shaking : Shaking, along the direction of shaking, under the branches of the model
    minimum : float, probability of survival below which a branch is rejected
    """

    model: HazardModel
    rocks: tuple[DatedRock, ...]
    shaking: Shaking
    minimum: float

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

    @cached_property
    def mean_shaking(self) -> Shaking:
        """That of the prior mean of the branches."""
        return self.shaking.mean(self.weights)

    @cached_property
    def standing(self) -> list[Standing]:
        """The rocks with their fragilities."""
        return [
            Standing(
                self.shaking.fragility(rock.fragility.mean, rock.fragility.ratios),
                rock.ages,
                tuple(
                    Stage(self.shaking.fragility(one.mean, one.ratios), until)
                    for one, until in rock.earlier
                ),
            )
            for rock in self.rocks
        ]

    def _of_others(self, rock: DatedRock, standing: Standing) -> list[Standing]:
        """A rock with each of its draws, or with all fits at either end of their intervals.

        What is unknown stays through its stages; one without draws has its mean beside others'.
        """
        if self.drawn and not rock.drawn:
            return [standing]
        kind = DRAWN if rock.drawn else FITTED
        numbers = rock.numbers if rock.drawn else np.arange(len(rock.fragility.others))
        each = [
            [self.shaking.fragility(one.others[i], one.ratios) for i in one.places(numbers)]
            if one.source == kind
            else [mean] * len(numbers)
            for one, mean in zip(rock.stages, standing.fragilities, strict=True)
        ]
        until = [one for _, one in rock.earlier]
        return [
            Standing(now, rock.ages, tuple(map(Stage, earlier, until)))
            for now, *earlier in zip(*each, strict=True)
        ]

    @property
    def drawn(self) -> bool:
        """Whether the others are draws, of which one is the rock."""
        return any(rock.drawn for rock in self.rocks)

    @cached_property
    def _each(self) -> list[list[Standing]]:
        """Each rock by itself with each of its other fragilities."""
        return [self._of_others(*both) for both in zip(self.rocks, self.standing, strict=True)]

    @cached_property
    def others(self) -> list[list[Standing]]:
        """The rocks with each of their other fragilities.

        The fewer come again, spread over all of them: those of an archive go from weak to strong.
        Members are paired at random, as what is unknown of two rocks is not the same.
        """
        number = max(map(len, self._each))
        rng, turns = np.random.default_rng(1), []
        for rock, own in zip(self.rocks, self._each, strict=True):
            turn = np.arange(number) * len(own) // number
            paired = rock is self.rocks[0] or not rock.drawn
            turns.append([own[i] for i in (turn if paired else rng.permutation(turn))])
        return [list(rocks) for rocks in zip(*turns, strict=True)]

    def survival_of_others(self) -> Array:
        """Survival under each branch with each of the other fragilities, (others, branches)."""
        return self._with_each(self.shaking.rates)

    def _with_each(self, rates: Rates) -> Array:
        return np.array([self.all_stand(rates, rocks) for rocks in self.others])

    @cached_property
    def _spells(self) -> list[Spell]:
        return spells(self.standing) if len(self.rocks) > 1 else []

    def all_stand(self, rates: Rates, rocks: list[Standing]) -> Array:
        """Probability that the rocks stand as given, at ages that they have in common."""
        return survival_of(rates, rocks, self._spells)

    def survival(self, rates: Rates) -> Array:
        """Probability that all rocks stand under each branch, shape (branches,).

        Of draws it is the mean of theirs, as what is unknown stays through all earthquakes.
        """
        if self.drawn:
            return np.asarray(self._with_each(rates).mean(axis=0))
        return self.all_stand(rates, self.standing)

    def survival_scaled(self, factor: float) -> float:
        """The same under the prior mean, all accelerations of which are multiplied."""
        return float(self.survival(self.mean_shaking.times(factor).rates)[0])

    def _alone(self, rock: int) -> list[Standing]:
        return self._each[rock] if self.rocks[rock].drawn else [self.standing[rock]]

    def survival_alone(self, rock: int) -> Array:
        """Probability that one of the rocks stands under each branch, shape (branches,)."""
        rocks = self._alone(rock)
        stood = sum(survival_of(self.shaking.rates, [one]) for one in rocks)
        return np.asarray(stood / len(rocks))

    def survival_for(self, rock: int, ages: Array) -> Array:
        """The same for some ages, shape (branches, ages); stages ended at their median times."""
        rocks, found = self._alone(rock), []
        for one in rocks:
            ended = np.array([[np.median(stage.until)] for stage in one.earlier])
            reach = np.vstack([*np.minimum(ended, ages), ages]) if one.earlier else ages[None]
            rates = [self.shaking.rates(stage) for stage in one.fragilities]
            years = np.diff(reach, axis=0, prepend=0.0)
            exposed = sum(np.multiply.outer(*stage) for stage in zip(rates, years, strict=True))
            found.append(np.exp(-exposed))
        return np.asarray(sum(found) / len(rocks))

    def results(self) -> BranchResults:
        """Survival under each branch, and the branches weighted by it."""
        return self.reweighted(self.survival(self.shaking.rates))

    @property
    def together(self) -> Fragility:
        """Probability that one or more of the rocks topple."""
        return any_of([rock.fragility for rock in self.standing])

    def reweighted(self, survival: Array) -> BranchResults:
        """The branches weighted by a given survival under each."""
        rates = self.shaking.rates(self.together)
        new = posterior_weights(self.weights, survival, self.minimum)
        after = None
        if not new.rejected.all():
            after = mean_curve(self.curves, new.weights, self.model.levels)
        return BranchResults(rates, survival, new.rejected, new.weights, after)

    def within_tested(self) -> SurvivalAnalysis:
        """The same, as if nothing more toppled beyond the largest PGA that was tried."""
        return replace(self, rocks=tuple(rock.within_tested() for rock in self.rocks))

    def with_first(self, rock: DatedRock) -> SurvivalAnalysis:
        """The same analysis, the first rock changed."""
        return replace(self, rocks=(rock, *self.rocks[1:]))


@dataclass(frozen=True, eq=False)
class Sampling:
    """How far another catalogue of earthquakes, as long, would differ: standard errors.

    Attributes
    ----------
    rates : ndarray, shape (branches,) [1/year], of toppling
    mean_rate : float [1/year], of the prior mean of the branches
    mean_rate_independent : float [1/year], the same if each earthquake were a rupture of its own
    survival : ndarray, shape (branches,)
    """

    rates: Array
    mean_rate: float
    mean_rate_independent: float
    survival: Array


def sampling(analysis: SurvivalAnalysis, results: BranchResults) -> Sampling | None:
    """Sampling errors of simulated earthquakes; curves have none.

    The rates of all draws of the rock are taken to be off together.
    """
    if not isinstance(analysis.shaking, EventShaking):
        return None
    together = analysis.together
    drawn = analysis.shaking.resampled(together, CATALOGUES)
    variance = analysis.weights**2 @ analysis.shaking.variance_of_independent(together)
    off = np.divide(drawn, results.rates, out=np.ones_like(drawn), where=results.rates > 0.0)
    factors = np.linspace(off.min(), off.max(), _FACTORS)
    known = [analysis.survival(partial(_times, one, analysis.shaking)) for one in factors]
    log_known = np.log(np.maximum(known, _LEAST))
    stood = [np.exp(np.interp(off[:, i], factors, log_known[:, i])) for i in range(off.shape[1])]
    mean = float((drawn @ analysis.weights).std())
    return Sampling(drawn.std(axis=0), mean, float(np.sqrt(variance)), np.std(stood, axis=1))


def _times(factor: float, shaking: Shaking, fragility: Fragility) -> Array:
    return factor * shaking.rates(fragility)
