"""What is asked of a hazard model: its branches, the rocks at its place, and their ages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipeline.config.hazard_schema import Age, BoundedAge, LognormalAge, NormalAge
from pipeline.stages.hazard.hazard_model import HazardModel
from pipeline.stages.hazard.rock_fragility import DRAWN, RockFragility
from vsr_core.arrays import Array, Mask
from vsr_core.hazard.averaging import RowFragility, averaged
from vsr_core.hazard.branches import mean_curve, reweighed
from vsr_core.hazard.curve import HazardCurve
from vsr_core.hazard.ratio import RatioTable
from vsr_core.hazard.survival import (
    Standing,
    lognormal_ages,
    normal_ages,
    survival_of,
    uniform_ages,
)
from vsr_core.hazard.toppling import any_of, toppling

REACH = 10.0
"""How far beyond the first and last level of a curve a fragility is known, as a factor: components
and scale factors move curves along it."""


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
class Answer:
    """What a hazard model is after its rocks were asked.

    Attributes
    ----------
    rates : ndarray, shape (branches,) [1/year], of toppling while all rocks stand
    survival : ndarray, shape (branches,)
    rejected : ndarray of bool, shape (branches,)
    weights : ndarray, shape (branches,), 0 where rejected
    after : HazardCurve, the mean with these weights; None where every branch is rejected
    """

    rates: Array
    survival: Array
    rejected: Mask
    weights: Array
    after: HazardCurve | None


@dataclass(frozen=True, eq=False)
class Question:
    """Rocks that stand at the place of a hazard model.

    Attributes
    ----------
    least : float, chance of survival below which a branch is rejected
    component : float, PGA along the direction of shaking over that of the curves
    """

    model: HazardModel
    rocks: tuple[DatedRock, ...]
    table: RatioTable
    least: float
    component: float = 1.0

    @cached_property
    def curves(self) -> list[HazardCurve]:
        """Curves of PGA of the branches."""
        return [one.pga for one in self.model.branches]

    @cached_property
    def weights(self) -> Array:
        """Weights of the branches, as the model has them."""
        return np.array([one.weight for one in self.model.branches])

    @cached_property
    def before(self) -> HazardCurve:
        """Mean curve of the model."""
        return mean_curve(self.curves, self.weights, self.model.levels)

    def one_measure(self, rock: DatedRock, rows: RowFragility) -> Callable[[Array], Array]:
        """Fragility in the PGA of the curves."""
        span = self.model.levels[[0, -1]] * np.array([1.0 / REACH, REACH])
        felt = averaged(rows, rock.fragility.ratios, self.table, span)
        if self.component == 1.0:
            return felt
        return lambda level: felt(self.component * level)

    @cached_property
    def standing(self) -> list[Standing]:
        """The rocks with their fragilities in PGA."""
        return [
            Standing(self.one_measure(rock, rock.fragility.mean), rock.ages) for rock in self.rocks
        ]

    def chance(self, curve: HazardCurve) -> float:
        """Chance that all rocks stand under a curve."""
        return survival_of(curve, self.standing)

    def answer(self) -> Answer:
        """Survival under each branch, and the branches weighed by it."""
        return self.weighed(np.array([self.chance(curve) for curve in self.curves]))

    def weighed(self, survival: Array) -> Answer:
        """The branches weighed by a survival.

        Parameters
        ----------
        survival : ndarray, shape (branches,)
        """
        together = any_of([rock.fragility for rock in self.standing])
        rates = np.array([toppling(curve, together).rate for curve in self.curves])
        new = reweighed(self.weights, survival, self.least)
        kept = not new.rejected.all()
        after = mean_curve(self.curves, new.weights, self.model.levels) if kept else None
        return Answer(rates, survival, new.rejected, new.weights, after)

    def survivals(self) -> Array:
        """Survival under each branch with each of the other fragilities.

        Several rocks have the others in turn, the fewer again from the first. Of two ensembles the
        members are paired at random, as what is unknown of two rocks is not the same.

        Returns
        -------
        ndarray, shape (others, branches)
        """
        number = max(len(rock.fragility.others) for rock in self.rocks)
        rng, turns = np.random.default_rng(1), []
        for rock in self.rocks:
            turn = np.resize(np.arange(len(rock.fragility.others)), number)
            paired = rock is self.rocks[0] or rock.fragility.source != DRAWN
            turns.append(turn if paired else rng.permutation(turn))
        found = []
        for chosen in zip(*turns, strict=True):
            rocks = [
                Standing(self.one_measure(rock, rock.fragility.others[i]), rock.ages)
                for rock, i in zip(self.rocks, chosen, strict=True)
            ]
            found.append([survival_of(curve, rocks) for curve in self.curves])
        return np.array(found)

    def with_rows(self, rows: RowFragility) -> Question:
        """The same, of the first rock with another fragility."""
        return self.with_first(fragility=replace(self.rocks[0].fragility, mean=rows))

    def with_first(
        self, fragility: RockFragility | None = None, ages: Array | None = None
    ) -> Question:
        """The same, with the first rock changed."""
        first = self.rocks[0]
        changed = DatedRock(
            first.name,
            first.fragility if fragility is None else fragility,
            first.ages if ages is None else ages,
        )
        return replace(self, rocks=(changed, *self.rocks[1:]))


def ages_of(age: Age) -> Array:
    """Equally likely ages.

    Returns
    -------
    ndarray, shape (n,) [year]
    """
    if isinstance(age, NormalAge):
        return normal_ages(age.mean, age.sd)
    if isinstance(age, LognormalAge):
        return lognormal_ages(age.median, age.log_sd)
    if isinstance(age, BoundedAge):
        return uniform_ages(age.low, age.high)
    return np.array(age.values)
