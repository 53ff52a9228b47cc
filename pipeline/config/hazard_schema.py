"""What hazard is asked of a rock: curves, its age, and the PGV/PGA that comes with a PGA."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from pipeline.config.bounds import LARGEST_PGA, SMALLEST_PGA
from pipeline.config.sections import Lax, Section

Years = Annotated[float, Field(ge=1, le=1e8)]
"""An age [year]: no landform that carries a rock is older."""

_Source = Annotated[str, Field(max_length=400)]
_Peak = Annotated[float, Field(ge=SMALLEST_PGA, le=LARGEST_PGA)]
_Ratio = Annotated[float, Field(gt=0, le=100)]
_LogSd = Annotated[float, Field(gt=0, le=5)]


class NormalAge(Section):
    """An age with its standard deviation."""

    kind: Literal["normal"] = Field(description="kind of age")
    mean: Years = Field(description="mean of the age [year]")
    sd: float = Field(0.0, ge=0, le=1e8, description="its standard deviation; 0 is exact [year]")
    source: _Source = Field("", description="where the age comes from, for the page")


class LognormalAge(Section):
    """An age whose logarithm is normal."""

    kind: Literal["lognormal"] = Field(description="kind of age")
    median: Years = Field(description="median of the age [year]")
    log_sd: float = Field(ge=0, le=5, description="standard deviation of its logarithm [1]")
    source: _Source = Field("", description="where the age comes from, for the page")


class BoundedAge(Section):
    """An age of which only bounds are known, all between them equally likely."""

    kind: Literal["bounds"] = Field(description="kind of age")
    low: Years = Field(description="least age [year]")
    high: Years = Field(description="largest age [year]")
    source: _Source = Field("", description="where the age comes from, for the page")

    @model_validator(mode="after")
    def _in_order(self) -> BoundedAge:
        if self.high < self.low:
            raise ValueError("the largest age is not below the least; exchange low and high")
        return self


class SampledAge(Section):
    """Equally likely ages, such as those of a dating program."""

    kind: Literal["samples"] = Field(description="kind of age")
    values: Annotated[tuple[Years, ...], Lax] = Field(
        min_length=1, max_length=100_000, description="equally likely ages [year]"
    )
    source: _Source = Field("", description="where the age comes from, for the page")


Age = Annotated[NormalAge | LognormalAge | BoundedAge | SampledAge, Field(discriminator="kind")]


class HazardRock(Section):
    """Another rock at the same place, which felt the same earthquakes."""

    site: str = Field(min_length=1, description="its site, by name or by the path of its YAML")
    age: Age = Field(description="how long it has stood")


class Comparison(Section):
    """The same rock with other settings, whose answer stands beside."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9 .,()_-]{0,60}$",
        description="what is changed, in words, e.g. friction 0.4",
    )
    study: str | None = Field(None, description="study, by name or by the path of its YAML")
    set: Annotated[tuple[str, ...], Lax] = Field((), description="settings, each key=value")


class RatioConfig(Section):
    """PGV/PGA of the shaking at a PGA: lognormal, straight in ln PGA between the values given."""

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
            raise ValueError("each PGA has a median and a log_sd; give lists of one length")
        return self

    @field_validator("pga")
    @classmethod
    def _ascend(cls, pga: tuple[float, ...]) -> tuple[float, ...]:
        if any(b <= a for a, b in pairwise(pga)):
            raise ValueError("PGA ascend; sort them")
        return pga


class HazardConfig(Section):
    """Which branches of a hazard model leave a rock the chance to have stood for its age."""

    curves: str | None = Field(
        None,
        description="folder of hazard curves of OpenQuake or nshmp-haz, or OpenQuake's "
        "calc_N.hdf5; relative to the file that names it",
    )
    age: Age | None = Field(None, description="how long the rock has stood as it stands")
    least_survival: float = Field(
        0.05,
        gt=0,
        lt=1,
        description="chance of having survived below which a branch is rejected [1]",
    )
    component: Literal["RotD50", "GMRotI50", "geometric mean", "larger", "RotD100"] = Field(
        "RotD50", description="horizontal component that the curves are for; it is stated, not used"
    )
    pgv_pga: RatioConfig | None = Field(
        None,
        description="PGV/PGA at each PGA; null to take it from curves of PGV or disaggregation",
    )
    disaggregation: str | None = Field(
        None,
        description="OpenQuake's Mag_Dist CSV of PGA, or a folder with it; null for the folder of "
        "the curves",
    )
    rocks: Annotated[tuple[HazardRock, ...], Lax] = Field(
        (), max_length=8, description="other rocks at the same place, asked together with this one"
    )
    compare: Annotated[tuple[Comparison, ...], Lax] = Field(
        (), max_length=20, description="other settings of this rock, whose answers stand beside"
    )
