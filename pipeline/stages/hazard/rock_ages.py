"""How long a rock has stood, and as what: its age, and the stages in which it was exhumed."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.config.hazard_schema import Age, BoundedAge, History, LognormalAge, NormalAge
from pipeline.config.layers import Site
from pipeline.config.observation_schema import Earthquake, Observations
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard.ground_shaking import check_peaks
from vsr_core.arrays import Array
from vsr_core.hazard.survival import (
    in_order,
    independent,
    lognormal_ages,
    normal_ages,
    uniform_ages,
)

PRESENT = 1950
"""Year that ages are counted to, as dating does [CE]."""

_OTHER = 0.05
"""Share by which two means of an age may differ, as by rounding or the kind of distribution."""

LEAST_IN_ORDER = 0.1
"""Share of draws in which stages follow each other, below which they contradict each other."""


def refuse(site: Site) -> None:
    """Refuse stages that contradict each other, and earthquakes before the rock stood so.

    And motions of a table whose PGA is not that of the ground.
    """
    check_peaks(site)
    check_stages(site, site.config.hazard.age)


def check_stages(site: Site, age: Age | None) -> None:
    """The same of a rock of an age, whose stages its own file names."""
    history = site.config.hazard.history
    if age and history:
        _check_order(site, age)
    check_earthquakes(
        site, history[0].until if history else age, " as it stands" if history else ""
    )


def check_earthquakes(
    site: Site, since: Age | None, so: str = "", until: Age | None = None
) -> None:
    """Refuse earthquakes that a rock was observed to survive before it stood so, or after."""
    oldest = ages_of(since).max() if since else math.inf
    youngest = ages_of(until).min() if until else -math.inf
    early = f"a rock of at most {oldest:,.0f} years{so} did not stand before {PRESENT - oldest:.0f}"
    late = f"the rock stood so until {youngest:,.0f} years before {PRESENT} at the latest"
    key = "observations"
    problems = [
        Problem(
            site.file_of(key),
            f"{key}.{number}.year",
            f"{one.year}",
            early if one.year < PRESENT - oldest else late,
            "leave the earthquake out, or correct its year or the rock's age",
        )
        for number, one in enumerate(site.config.observations)
        if isinstance(one, Earthquake) and not youngest <= PRESENT - one.year <= oldest
    ]
    if problems:
        raise InputError(*problems)


def _check_order(site: Site, age: Age) -> None:
    times = _times(age, site.config.hazard.history)
    kept, drawn = len(in_order(times)), independent([*map(len, times)]).shape[1]
    if kept < LEAST_IN_ORDER * drawn:
        key, given = "hazard.history", f"stages in their order in {kept} of {drawn} draws"
        rule = "the latest comes first, and each ended after the one before it, and after the age"
        raise InputError(Problem(site.file_of(key), key, given, rule, "exchange or correct them"))


def ages_of(age: Age) -> Array:
    """Equally likely ages [year]."""
    if isinstance(age, NormalAge):
        return normal_ages(age.mean, age.sd)
    if isinstance(age, LognormalAge):
        return lognormal_ages(age.median, age.log_sd)
    if isinstance(age, BoundedAge):
        return uniform_ages(age.low, age.high)
    return np.array(age.values)


def other_age(name: str, age: Age, listed: float | None) -> Iterator[str]:
    """Whether the mean age of a rock of an archive is another one there, in words."""
    drawn = ages_of(age)
    mean = float(drawn.mean())
    middles = mean, float(np.median(drawn)), getattr(age, "mean", mean)
    if listed is not None and all(abs(one - listed) > _OTHER * listed for one in middles):
        yield f"hazard.rocks: {name} is {mean:,.0f} years old, and {listed:,.0f} in its archive"


def _times(age: Age | None, history: History) -> list[Array]:
    return [ages_of(one) for one in (*(stage.until for stage in history), age) if one]


def years_observed(observed: Observations) -> int:
    """Years in which earthquakes were seen to leave the rock standing."""
    return len({one.year for one in observed if isinstance(one, Earthquake)})


def back_to(age: Age, history: History, *observed: Observations) -> Array:
    """Years before present to which the stages of a rock reach back, the present one first.

    Years of earthquakes that weighed the draws of a stage already are left out.

    Parameters
    ----------
    *observed : Observations of the draws of each stage; none where a rock is as scanned

    Returns
    -------
    ndarray, shape (n, stages) [year], rows equally likely, the age last
    """
    times = _times(age, history)
    found = in_order(times) if history else times[0][:, None]
    return np.maximum(found - np.cumsum([*map(years_observed, observed)]), 0.0)


def of_age(age: Age) -> str:
    """An age as the page states it.

    >>> of_age(NormalAge(kind="normal", mean=20000.0, sd=3000.0))
    '20,000 ± 3,000 years (normal, one standard deviation)'
    """
    if isinstance(age, NormalAge):
        if age.sd == 0.0:
            return f"{age.mean:,.0f} years, taken as exact"
        return f"{age.mean:,.0f} ± {age.sd:,.0f} years (normal, one standard deviation)"
    if isinstance(age, LognormalAge):
        spread = f"lognormal, standard deviation {age.log_sd:g} of its logarithm"
        return f"{age.median:,.0f} years ({spread})"
    if isinstance(age, BoundedAge):
        return f"{age.low:,.0f} to {age.high:,.0f} years, all equally likely"
    low, middle, high = np.percentile(age.values, [5, 50, 95])
    samples = f"{len(age.values):,} samples, 5-95 %: {low:,.0f} to {high:,.0f}"
    return f"{middle:,.0f} years (median of {samples})"
