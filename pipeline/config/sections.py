"""What sections of a configuration are made of: keys that are known, and grids of values."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Strict

_DIGITS = 12

Lax = Strict(strict=False)
"""Of a tuple, which YAML writes as a list, and of a switch, which may be `off`."""


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
        raise ValueError("an empty grid has no runs; give at least one value")
    if len(set(values)) != len(values):
        raise ValueError("no value repeats; give each once")
    return values


def _ascending(values: tuple[float, ...]) -> tuple[float, ...]:
    if list(values) != sorted(values):
        raise ValueError("values must ascend; sort them")
    return values


Values = Annotated[tuple[float, ...], Lax, AfterValidator(_distinct)]
"""A number, a list or {start, stop, num}; becomes a dimension of the dataset."""

Grid = Annotated[Values, AfterValidator(_ascending)]
"""Values that ascend."""
