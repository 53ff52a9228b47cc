"""Hazard curves to be tested with a rock, the rock's age, and PGV/PGA at each PGA."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from pipeline.config.sections import (
    LARGEST_PGA,
    LARGEST_RATIO,
    LEAST_RATIO,
    SMALLEST_PGA,
    Lax,
    Outside,
    Refused,
    Section,
)

Years = Annotated[float, Field(ge=1, le=1e8)]
"""An age [year]: no landform that carries a rock is older."""

YOUNGEST, LONGEST = 150, 1e6
"""Years: landforms that carry a rock are rarely younger, and no rock that may topple has stood for
longer."""

MOST_SAMPLES = 100_000

_Source = Annotated[str, Field(max_length=400)]
_Peak = Annotated[float, Field(ge=SMALLEST_PGA, le=LARGEST_PGA)]
_Ratio = Annotated[float, Field(ge=LEAST_RATIO, le=LARGEST_RATIO)]
_LogSd = Annotated[float, Field(gt=0, le=5)]


def refuse_wide(mean: float, sd: float, key: str) -> None:
    """Refuse an age of which a third would be below 0, in years.

    Raises
    ------
    Refused
    """
    if sd > 2.0 * mean:
        rule, remedy = "it is at most twice the mean", "exchange mean and sd, or give bounds"
        raise Refused(rule, remedy, key, f"{sd:g}")


class NormalAge(Section):
    """An age with its standard deviation."""

    kind: Literal["normal"] = Field(description="kind of age")
    mean: Years = Field(description="mean of the age [year]")
    sd: float = Field(0.0, ge=0, le=1e8, description="its standard deviation; 0 is exact [year]")
    source: _Source = Field("", description="source of the age, for the page")

    @model_validator(mode="after")
    def _is_of_a_rock_that_stands(self) -> Self:
        refuse_wide(self.mean, self.sd, "sd")
        return self


class LognormalAge(Section):
    """An age whose logarithm is normal."""

    kind: Literal["lognormal"] = Field(description="kind of age")
    median: Years = Field(description="median of the age [year]")
    log_sd: float = Field(ge=0, le=5, description="standard deviation of its logarithm [1]")
    source: _Source = Field("", description="source of the age, for the page")


class BoundedAge(Section):
    """An age distributed uniformly between two bounds."""

    kind: Literal["bounds"] = Field(description="kind of age")
    low: Years = Field(description="minimum age [year]")
    high: Years = Field(description="maximum age [year]")
    source: _Source = Field("", description="source of the age, for the page")

    @model_validator(mode="after")
    def _in_order(self) -> BoundedAge:
        if self.high < self.low:
            raise Refused("the maximum age must not be below the minimum", "exchange low and high")
        return self


class SampledAge(Section):
    """Equally likely samples of the age, e.g. of a dating program: values, or a file of them."""

    kind: Literal["samples"] = Field(description="kind of age")
    values: Annotated[tuple[Years, ...], Lax] = Field(
        (), min_length=1, max_length=MOST_SAMPLES, description="equally likely ages [year]"
    )
    file: Outside | None = Field(
        None,
        description="in place of values: CSV with a column `age_a` of equally likely ages; "
        "relative to the file that names it",
    )
    source: _Source = Field("", description="source of the age, for the page")


Age = Annotated[NormalAge | LognormalAge | BoundedAge | SampledAge, Field(discriminator="kind")]


class HazardRock(Section):
    """Another rock at the same location, shaken by the same earthquakes."""

    site: str = Field(
        min_length=1,
        description="its site, by name or by the path of its YAML; with `archive` its name there",
    )
    archive: Outside | None = Field(
        None,
        description="table of rocks known by a photograph that holds it, as `make archive` takes "
        "it; relative to the file that names it",
    )
    age: Age = Field(description="age of its position")


class EarlierStage(Section):
    """The rock as it stood before more of it came out of the ground."""

    site: str = Field(
        min_length=1,
        description="site of the rock as it stood then, e.g. with its base raised, by name or by "
        "the path of its YAML",
    )
    until: Age = Field(description="years before present when it ended, as an age")


History = Annotated[tuple[EarlierStage, ...], Lax]


class Comparison(Section):
    """The same rock with other settings, for comparison."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9 .,()_-]{0,60}$", description="label, e.g. friction 0.4"
    )
    study: str | None = Field(
        None,
        description="study over that of the command and over its settings, by name or by the "
        "path of its YAML, relative to the file that names it; where it does not go with their "
        "motion, compared without that",
    )
    set: Annotated[tuple[str, ...], Lax] = Field((), description="settings, each key=value")


class RatioConfig(Section):
    """Lognormal PGV/PGA at a PGA, interpolated linearly in ln PGA."""

    pga: Annotated[tuple[_Peak, ...], Lax] = Field(
        min_length=1, description="peak ground accelerations, ascending [g]"
    )
    median: Annotated[tuple[_Ratio, ...], Lax] = Field(
        min_length=1, description="median of PGV/PGA at each [s]"
    )
    log_sd: Annotated[tuple[_LogSd, ...], Lax] = Field(
        min_length=1, description="standard deviation of ln PGV/PGA at each [1]"
    )

    @model_validator(mode="after")
    def _of_one_length(self) -> RatioConfig:
        if not len(self.pga) == len(self.median) == len(self.log_sd):
            raise Refused(
                "pga, median and log_sd need the same length", "give one value of each per PGA"
            )
        return self

    @field_validator("pga")
    @classmethod
    def _ascend(cls, pga: tuple[float, ...]) -> tuple[float, ...]:
        if any(b <= a for a, b in pairwise(pga)):
            raise Refused("PGA values must ascend", "sort them")
        return pga


class HazardConfig(Section):
    """Test of the branches of a hazard model with a rock that has survived for its age."""

    curves: Outside | None = Field(
        None,
        description="folder of hazard curves of OpenQuake or nshmp-haz, or OpenQuake's "
        "calc_N.hdf5; relative to the file that names it",
    )
    events: Outside | None = Field(
        None,
        description="in place of curves: folder of a stochastic event set of OpenQuake, or its "
        "calc_N.hdf5; relative to the file that names it",
    )
    effective_time: float | None = Field(
        None,
        gt=0,
        le=1e12,
        description="years that each realization of the events was simulated for; null to take "
        "what the header of the ruptures says [year]",
    )
    age: Age | None = Field(None, description="age of the rock in its present position")
    history: History = Field(
        (),
        max_length=8,
        description="earlier stages of a rock that came out of the ground, the latest first; the "
        "last of them began at the age",
    )
    minimum_survival_probability: float = Field(
        0.05, gt=0, lt=1, description="survival probability below which a branch is rejected [1]"
    )
    component: Literal["RotD50", "GMRotI50", "geometric mean", "larger", "RotD100"] = Field(
        "RotD50", description="horizontal component of the curves; reported, not used"
    )
    support: Literal["tested", "scan"] = Field(
        "tested",
        description="rocks whose survival weighs the branches: the draws of uncertainty, with "
        "bases as tests have found them, or the rigid scans; of the site's rock the other is a "
        "case beside",
    )
    pgv_pga: RatioConfig | None = Field(
        None, description="PGV/PGA at each PGA; null to derive it from PGV curves or disaggregation"
    )
    disaggregation: Outside | None = Field(
        None,
        description="OpenQuake's Mag_Dist CSV of PGA, or a folder with it; null for the folder of "
        "the curves",
    )
    faults: Outside | None = Field(
        None,
        description="CSV of faults near the rock, for `make exclusion`; relative to the file that "
        "names it",
    )
    ground_motion: Outside | None = Field(
        None,
        description="CSV of median PGA and PGV with their standard deviations by magnitude and "
        "distance, for `make exclusion`; null for equations for rock and strike-slip",
    )
    rocks: Annotated[tuple[HazardRock, ...], Lax] = Field(
        (),
        max_length=8,
        description="other rocks at the same location, tested together with this one",
    )
    compare: Annotated[tuple[Comparison, ...], Lax] = Field(
        (), max_length=20, description="other settings of this rock, for comparison"
    )
