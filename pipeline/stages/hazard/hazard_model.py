"""A hazard model at one site, as its logic-tree branches, and the schema of its files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from pipeline.config.outside import Row, check_sum, refused
from pipeline.config.paths import shown
from pipeline.config.problems import InputError
from pipeline.config.sections import LARGEST_RATIO, LEAST_RATIO, Lax, Refused
from pipeline.workflow.grammar import counted
from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import HazardCurve, curve_of_probabilities, curve_of_rates
from vsr_core.hazard.ratio import ratio_of_curves

UNITS = {"PGA": GRAVITY, "PGV": 0.01}
"""Intensity measures that are read, and their units in m/s^2 and m/s."""

LEVELS = {"PGA": (1.0, 0.05, 20.0), "PGV": (100.0, 5.0, 2000.0)}
"""In g and cm/s: the first level of a curve is at most the first of these, the last from the second
to the third. Otherwise the levels are in another unit."""

STRONG, RARE = {"PGA": 1.0, "PGV": 100.0}, 0.01
"""Levels that are nowhere exceeded more often than every hundred years; known maps reach a third of
that."""

MOST_PGA = {475: 3.0, 2475: 5.0}
"""PGA [g] that a mean curve exceeds once in so many years at most: about twice the strongest of
published maps. Levels in m/s^2 taken for g are beyond it where shaking is moderate already."""

FAR = 7.0
"""Factor between the rates of a branch and those of the middle of all at the first level, from
which on it is told: branches differ by how many earthquakes there are, by a few times."""

MEAN = -1
"""In place of the number of a realization."""

NEAR = 1e-4
"""Distance in degrees within which two locations are one."""


@dataclass(frozen=True)
class Branch:
    """One end branch of a logic tree.

    Attributes
    ----------
    pga : HazardCurve [m/s^2]
    pgv : HazardCurve [m/s], where it is there
    """

    name: str
    path: str
    weight: float
    pga: HazardCurve
    pgv: HazardCurve | None = None


@dataclass(frozen=True)
class HazardModel:
    """Branches of a hazard model at one site.

    Attributes
    ----------
    location : tuple of float [degree], longitude and latitude; None where no file tells
    unused : tuple of str, what the files hold that has no part in it
    """

    branches: tuple[Branch, ...]
    location: tuple[float, float] | None
    unused: tuple[str, ...] = ()

    @property
    def levels(self) -> Array:
        """Levels of PGA at which some branch has a rate [m/s^2]."""
        return max((one.pga.levels for one in self.branches), key=len)


class Realization(Row):
    """A row of the weights of a logic tree."""

    rlz_id: int = Field(ge=MEAN, le=10_000_000, description="number of the realization")
    branch_path: str = Field(max_length=10_000, description="choices that lead to it")
    weight: float = Field(ge=0, le=1, description="weight, of all realizations they sum to 1 [1]")


class GivenCurve(Row):
    """A curve as a file gives it.

    Attributes
    ----------
    levels : in g, or in cm/s of PGV
    values : rates of exceedance, or their probabilities in so many years
    """

    model_config = ConfigDict(extra="forbid")

    measure: Literal["PGA", "PGV"]
    years: float | None = Field(None, ge=1e-3, le=1e6, description="years of the probabilities")
    lon: float = Field(ge=-180, le=360, description="longitude of the site [degree]")
    lat: float = Field(ge=-90, le=90, description="latitude of the site [degree]")
    depth: float = Field(0.0, ge=-1e4, le=1e4, description="depth of the site")
    place: str = Field("", description="number or name of the site")
    levels: Annotated[tuple[Annotated[float, Field(gt=0)], ...], Lax] = Field(
        min_length=2, max_length=10_000, description="two or more levels of the measure"
    )
    values: Annotated[tuple[Annotated[float, Field(ge=0, le=1000)], ...], Lax] = Field(
        description="annual rates, or probabilities, of exceeding them"
    )

    @model_validator(mode="after")
    def _plausible(self) -> GivenCurve:
        if len(self.levels) != len(self.values):
            given = f"{len(self.values)} values"
            rule = f"there is one for each of {len(self.levels)} levels"
            raise Refused(rule, "export it again", "values", given)
        curve = self.curve()
        first, least, most = LEVELS[self.measure]
        low, high = self.levels[0], self.levels[-1]
        if not (low <= first and least <= high <= most):
            unit = "g" if self.measure == "PGA" else "cm/s"
            rule = f"in {unit} the first is up to {first:g}, the last {least:g} to {most:g}"
            given = f"levels from {low:g} to {high:g}"
            raise Refused(rule, "convert them", "levels", given)
        often = float(curve.rate_at(np.array(UNITS[self.measure] * STRONG[self.measure])))
        if often > RARE:
            rule = f"{STRONG[self.measure]:g} is exceeded at most {RARE:g} times a year anywhere"
            given = f"{often:.3g} times a year"
            raise Refused(rule, "correct the units of levels or rates", "values", given)
        return self

    @property
    def certain(self) -> int:
        """How many of its first levels have a probability of 1, and so no rate."""
        return self.values.count(1.0) if self.years else 0

    def curve(self) -> HazardCurve:
        """The curve in SI, up to its last level that is ever exceeded."""
        levels = UNITS[self.measure] * np.array(self.levels)
        if self.years is None:
            return curve_of_rates(levels, np.array(self.values))
        return curve_of_probabilities(levels, np.array(self.values), self.years)


FEW = 1.0 / 3.0
"""Share of a curve's values that may have one digit, as 0.002 does: in files of seven digits some
are round by chance."""


def check_digits(path: Path, values: Sequence[str]) -> None:
    """Refuse rates, or probabilities, that were rounded to so many decimals that little is left."""
    digits = {one: re.sub(r"[eE].*|\D", "", one).lstrip("0") for one in values}
    numbers = [len(told) for told in digits.values() if told]
    if (few := numbers.count(1)) > FEW * len(numbers):
        given = f"{few} of {len(numbers)} different values with one digit only"
        rule = "two are needed, as one leaves a rate open by up to 50 %"
        raise refused(path, "values", given, rule, "export them with more digits, as 2.31E-03")


Curves = Mapping[tuple[int, str], tuple[Path, GivenCurve]]
"""By number of the realization, or `MEAN`, and measure: the file, and what it gives."""


def model(source: Path, curves: Curves, rows: list[Realization], *unused: str) -> HazardModel:
    """The model of the curves in some files.

    Parameters
    ----------
    rows : weights of the branches, whose sum is then 1 exactly
    unused : what else is in the files
    """
    _alike(list(curves.values()))
    told = {row.rlz_id: (row.rlz_id, "PGV") in curves for row in rows if row.weight > 0.0}
    if any(told.values()) and not all(told.values()):
        given = f"no curve of realization {next(one for one in told if not told[one])}"
        rule, remedy = "each has one of PGV, or none has", "export all, or remove those of PGV"
        raise refused(source, "PGV", given, rule, remedy)
    check_sum(source, "weight", [row.weight for row in rows])
    total = sum(row.weight for row in rows)
    branches, ended = [], dict.fromkeys(UNITS, 0)
    begun = {
        name: max(one.certain for _, one in of_measure)
        for name in UNITS
        if (of_measure := [curves[at, name] for at in told if (at, name) in curves])
    }
    for row in (row for row in rows if row.weight > 0.0):
        of_row = {name: curves[row.rlz_id, name] for name in begun}
        made = {name: _from(begun[name], *of_row[name]) for name in begun}
        for name, (_, one) in of_row.items():
            ended[name] += len(one.levels) - len(made[name].levels) - begun[name]
        pga, pgv = made["PGA"], made.get("PGV")
        if pgv:
            _together(of_row["PGV"][0], pga, pgv)
        called = "mean" if row.rlz_id == MEAN else str(row.rlz_id)
        branches.append(Branch(called, row.branch_path, row.weight / total, pga, pgv))
    _check_strength(source, branches)
    if zero := len(rows) - len(branches):
        unused = (*unused, f"{counted(zero, 'realization')} of weight 0 left out")
    unused += tuple(
        f"{counted(count, 'level')} of {name} {said}"
        for said, number in (
            ("left out at the beginning of all curves, as in some the probability is 1", begun),
            ("that nothing exceeds left out, at ends of curves", ended),
        )
        for name, count in number.items()
        if count
    )
    return HazardModel(tuple(branches), (one.lon, one.lat), (*unused, *_far_apart(branches)))


def _from(first: int, path: Path, given: GivenCurve) -> HazardCurve:
    """A curve from the level on from which all of a model have a rate, so that their mean has one.

    Raises
    ------
    InputError
        If fewer than two levels of it are left.
    """
    whole = given.curve()
    start = first - given.certain
    try:
        return HazardCurve(whole.levels[start:], whole.rates[start:])
    except InvalidInput:
        rule = "two levels have a rate in all of them, of a probability below 1"
        said = f"one of several curves, of which some have a probability of 1 at {first} levels"
        raise refused(path, "values", said, rule, "export them for fewer years") from None


def held(curves: Curves) -> Iterator[str]:
    """Curves whose values stay the same, to four digits or more, from one level to the next.

    At low levels they may, where all earthquakes exceed them; those of simulated events may, too.
    """
    found = []
    for path, one in curves.values():
        most = np.inf if one.years is None else 1.0  # near which probabilities have few digits
        pairs = zip(one.values, one.values[1:], strict=False)
        same = [value for below, value in pairs if below == value and 0.0 < value < one.values[0]]
        if number := sum(_digits(min(value, most - value)) >= _FINE for value in same):
            found.append(f"{counted(number, 'value')} of {one.measure} in {path.name}")
    if found:
        others = f", and some of {counted(len(found) - 1, 'other curve')}" if found[1:] else ""
        yield f"{found[0]}{others} as at the level below: values may be held"


_FINE = 4
"""Digits of values that are not alike by chance."""

_EXACT = 12
"""Decimals of 1 less a probability that are not of rounding."""


def _digits(value: float) -> int:
    return len(f"{round(value, _EXACT):.9e}".partition("e")[0].replace(".", "").rstrip("0"))


def _far_apart(branches: Sequence[Branch]) -> Iterator[str]:
    """That a branch has rates that are far from those of the others where these differ least."""
    for measure in ("PGA", "PGV"):
        curves = [one.pga if measure == "PGA" else one.pgv for one in branches]
        first = max((one.levels[0] for one in curves if one is not None), default=np.nan)
        rates = np.array(
            [np.nan if one is None else one.rate_at(np.array(first)) for one in curves]
        )
        off = rates / np.median(rates)
        worst = int(np.abs(np.log(off)).argmax())
        if off[worst] < 1.0 / FAR or off[worst] > FAR:
            yield (
                f"branch {branches[worst].name} exceeds the first level of {measure} "
                f"{off[worst]:.2g} times as often as the middle of all branches: its years may be "
                "others"
            )


def _check_strength(source: Path, branches: Sequence[Branch]) -> None:
    """Refuse curves whose mean shakes more strongly than any place is known to."""
    for years, most in MOST_PGA.items():
        rates = [float(one.pga.rate_at(np.array(UNITS["PGA"] * most))) for one in branches]
        mean = sum(one.weight * rate for one, rate in zip(branches, rates, strict=True) if rate > 0)
        if mean > 1.0 / years:
            given = f"{most:g} g exceeded once in {1.0 / mean:.0f} years by the mean curve"
            rule = f"that is rarer than once in {years:,} years on all published maps"
            raise refused(source, "levels", given, rule, "convert levels in m/s2 to g")


def _together(path: Path, pga: HazardCurve, pgv: HazardCurve) -> None:
    """Refuse curves of PGA and PGV one of which is in another unit."""
    try:
        ratio = float(np.exp(np.log(ratio_of_curves(pga, pgv, 1.0).medians).mean()))
    except InvalidInput as error:
        raise InputError.from_invalid(shown(path), "", error) from None
    if not LEAST_RATIO <= ratio <= LARGEST_RATIO:
        rule = f"it is {LEAST_RATIO:g} to {LARGEST_RATIO:g} s, with PGA in g and PGV in cm/s"
        given = f"PGV/PGA of {ratio:.2g} s where both are as rare"
        raise refused(path, "levels", given, rule, "convert the levels")


def _alike(curves: list[tuple[Path, GivenCurve]]) -> None:
    """Refuse curves of several calculations: of other places, years or levels."""
    rule, remedy = "all curves are of one calculation", "export them again"
    first = curves[0][1]
    of_measure = {one.measure: (path, one.levels) for path, one in reversed(curves)}
    for path, one in curves[1:]:
        other, levels = of_measure[one.measure]
        east = (one.lon - first.lon + 180.0) % 360.0 - 180.0
        if max(abs(east), abs(one.lat - first.lat)) > NEAR:
            given = f"{one.lon:g}, {one.lat:g}, and elsewhere {first.lon:g}, {first.lat:g}"
            raise refused(path, "lon, lat", given, "all curves are of one site", remedy)
        named = one.place and first.place and one.place.lower() != first.place.lower()
        if named or abs(one.depth - first.depth) > NEAR:
            sites = (f"{of.place or 'a site'}, depth {of.depth:g}" for of in (one, first))
            given = ", and elsewhere ".join(sites)
            raise refused(path, "lon, lat", given, "all curves are of one site", remedy)
        if one.years != first.years:
            given = f"{one.years:g} years, and elsewhere {first.years:g}"
            raise refused(path, "investigation_time", given, rule, remedy)
        if one.levels != levels and (
            len(one.levels) != len(levels)
            or not np.allclose(one.levels, levels, rtol=1e-5, atol=0.0)
        ):
            given = f"other levels than {shown(other)}"
            raise refused(path, "levels", given, rule, remedy)
