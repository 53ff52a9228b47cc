"""What sections of a configuration are made of: known keys, grids of values, and their bounds.

What lies beyond the bounds is a slip of unit or of typing. Within them all arithmetic keeps its
digits and a run ends in time that one would wait for.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import Annotated, Any, NamedTuple

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    SerializationInfo,
    Strict,
    model_validator,
)

_DIGITS = 12

Lax = Strict(strict=False)
"""Of a tuple, which YAML writes as a list, and of a switch, which may be `off`."""


class Refused(ValueError):
    """A value that breaks a rule.

    Parameters
    ----------
    rule, remedy : str
        Two short phrases without a full stop.
    key : str
        The key to blame within the section that is checked, where it is not the section itself;
        of several, apart by blanks, the one that was set last.
    given : str
        What was given, where it is more than that value.
    """

    def __init__(self, rule: str, remedy: str, key: str = "", given: str = "") -> None:
        super().__init__(f"{rule}; {remedy}")
        self.rule, self.remedy, self.key, self.given = rule, remedy, key, given


class Key(NamedTuple):
    """Of an annotation: the dotted key of the one setting that a parameter takes."""

    name: str


IN_KEYS = "keys"
"""Context of what keys of products hold of settings."""


def _as_told(path: str, info: SerializationInfo) -> str:
    return PurePath(path).name if info.context == IN_KEYS else path


Outside = Annotated[str, PlainSerializer(_as_told)]
"""A path of a file or folder. Of what it names, keys hold the content, and so its name alone."""


class Section(BaseModel):
    """A part of the configuration: unknown keys are refused, values never change.

    A number is a number: neither true nor text in quotes that looks like one.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Range(Section):
    """Evenly spaced values, both ends included."""

    start: float = Field(description="first value")
    stop: float = Field(description="last value")
    num: int = Field(ge=1, le=100_000, description="number of values")

    @model_validator(mode="after")
    def _both_ends(self) -> Range:
        if self.num == 1 and self.start != self.stop:
            raise Refused("both ends are included, so num must be 2 or more", "give a number alone")
        return self

    def values(self) -> tuple[float, ...]:
        """The values, rounded so that overlapping ranges share them exactly.

        Examples
        --------
        >>> Range(start=0.1, stop=0.7, num=3).values()
        (0.1, 0.4, 0.7)
        """
        if self.num == 1:
            return (round(self.start, _DIGITS),)
        step = (self.stop - self.start) / (self.num - 1)
        return tuple(round(self.start + step * i, _DIGITS) for i in range(self.num))


def as_values(given: Any) -> Any:
    """A number, a text or {start, stop, num} as a tuple; anything else as it is.

    Examples
    --------
    A range becomes its values:

    >>> as_values({"start": 0.0, "stop": 1.0, "num": 3}), as_values(0.6), as_values([1, 2])
    ((0.0, 0.5, 1.0), (0.6,), [1, 2])
    """
    if isinstance(given, dict):
        return Range(**given).values()
    if isinstance(given, (int, float, str)):
        return (given,)
    return given


def _distinct(values: tuple[float, ...]) -> tuple[float, ...]:
    if not values:
        raise Refused("a grid needs at least one value", "give one")
    if len(set(values)) != len(values):
        raise Refused("duplicate value", "give each value once")
    return values


def _ascending(values: tuple[float, ...]) -> tuple[float, ...]:
    if list(values) != sorted(values):
        raise Refused("values must ascend", "sort them")
    return values


Values = Annotated[tuple[float, ...], Lax, AfterValidator(_distinct)]
"""A number, a list or {start, stop, num}; becomes a dimension of the dataset."""

Grid = Annotated[Values, AfterValidator(_ascending)]
"""Values that ascend."""

LIGHTEST, DENSEST = 10.0, 30_000.0
"""Densities of a rock [kg m-3]: replicas of foam weigh more, no metal does."""

STRONG_PGA = 4.0
"""PGA [g] that records rarely exceed."""

SMALLEST_PGA, LARGEST_PGA = 1e-6, 10.0
"""Peak accelerations [g]: the ground's own noise reaches the first, no record the second."""

SHORTEST_PULSE, LONGEST_PULSE = 0.001, 10.0
"""PGV/PGA [s]: of a cosine pulse of 160 Hz, above what strong-motion records hold, and one of a
minute."""

LEAST_RATIO, LARGEST_RATIO = 0.01, 1.0
"""PGV/PGA [s] of an earthquake's shaking, and of levels that are as rare."""

SHORTEST_STEP = 1e-6
"""Time step [s]: with a shorter one ten seconds of shaking are more than ten million steps, and the
boundary has long stopped changing."""

MOST_SCENES = 10_000
"""Directions times frictions of a study, each a scene to prepare: a direction for every tenth of a
degree at two frictions."""

Density = Annotated[float, Field(ge=LIGHTEST, le=DENSEST)]

Coordinate = Annotated[float, Field(ge=-1e8, le=1e8)]
"""Along an axis of a scan [m]; easting and northing of maps reach 1e7."""

Length = Annotated[float, Field(ge=0, le=1000)]
"""A length [m] at the scale of a rock and its hillside."""

Corner = Annotated[float, Field(ge=1e-4, le=1000)]
"""Corner frequency of a filter [Hz]: from a period of three hours to beyond any record."""

Mass = Annotated[float, Field(ge=1e-3, le=1e9)]
"""A mass [kg]: of a pebble to that of the largest shake table with its building."""

Force = Annotated[float, Field(ge=1e-3, le=1e12)]
"""A force [N] of a table's actuators."""

LARGEST_GAIN = 1e15
"""Of a servo, in its units: that of the largest mass at the highest rate."""

Gain = Annotated[float, Field(ge=0, le=LARGEST_GAIN)]

Rate = Annotated[float, Field(ge=1e-3, le=1e6)]
"""Rate of a digital control loop [Hz]."""

Travel = Annotated[float, Field(ge=1e-6, le=1000)]
"""Velocity or length [m/s, m] of what a table's drive does."""
