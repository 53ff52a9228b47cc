"""A hazard model at one site, as its logic-tree branches; its files are refused in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.config.problems import InputError, Problem
from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import HazardCurve

UNITS = {"PGA": GRAVITY, "PGV": 0.01}
"""Intensity measures that are read, and their units in m/s^2 and m/s."""

WEIGHTS_SUM = 1e-3
"""How far weights may be from a sum of 1, as they are written with few digits."""


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
    location : tuple of float [degree], longitude and latitude
    """

    branches: tuple[Branch, ...]
    location: tuple[float, float]

    @property
    def levels(self) -> Array:
        """Levels of PGA at which some branch has a rate [m/s^2]."""
        return max((one.pga.levels for one in self.branches), key=len)


def normalized(source: Path, branches: list[Branch], location: tuple[float, float]) -> HazardModel:
    """A model of branches whose weights then sum to 1 exactly."""
    total = sum(branch.weight for branch in branches)
    if not abs(total - 1.0) <= WEIGHTS_SUM:
        given, remedy = f"weights that sum to {total:g}", "export all realizations"
        raise refused(source, "weight", given, "those of all branches sum to 1", remedy)
    whole = tuple(replace(branch, weight=branch.weight / total) for branch in branches)
    return HazardModel(whole, location)


def refused(file: Path, key: str, given: str, rule: str, remedy: str) -> InputError:
    """An error in a file of a hazard model."""
    return InputError(Problem(str(file), key, given, rule, remedy))


@contextmanager
def reading(file: Path, key: str, rule: str, remedy: str = "export it again") -> Iterator[None]:
    """Refuse a file, in one line, whatever reading it raises."""
    try:
        yield
    except InvalidInput as error:
        raise InputError.from_invalid(str(file), key, error) from None
    except (OSError, ValueError, LookupError, SyntaxError, TypeError) as error:
        raise refused(file, key, f"an invalid file ({error})", rule, remedy) from None
