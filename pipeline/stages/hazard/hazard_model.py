"""A hazard model at one place, as its branches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.config.problems import InputError, Problem
from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.hazard.curve import HazardCurve

UNITS = {"PGA": GRAVITY, "PGV": 0.01}
"""Measures that are read, and their units in m/s^2 and m/s."""


@dataclass(frozen=True)
class Branch:
    """One end of a logic tree.

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
    """Branches of a hazard model at one place.

    Attributes
    ----------
    place : tuple of float [degree], longitude and latitude
    """

    branches: tuple[Branch, ...]
    place: tuple[float, float]

    @property
    def levels(self) -> Array:
        """Levels of PGA at which some branch has a rate [m/s^2]."""
        return max((one.pga.levels for one in self.branches), key=len)


WEIGHTS_SUM = 1e-3
"""How far weights may be from a sum of 1, as they are written with few digits."""


def weighed(folder: Path, branches: list[Branch], place: tuple[float, float]) -> HazardModel:
    """A model of branches, whose weights then sum to 1 exactly.

    Parameters
    ----------
    place : tuple of float [degree]
    """
    total = sum(branch.weight for branch in branches)
    if not abs(total - 1.0) <= WEIGHTS_SUM:
        raise refused(
            folder,
            "weight",
            f"weights that sum to {total:g}",
            "those of all branches sum to 1",
            "export all realizations",
        )
    whole = (Branch(one.name, one.path, one.weight / total, one.pga, one.pgv) for one in branches)
    return HazardModel(tuple(whole), place)


def refused(file: Path, key: str, given: str, rule: str, remedy: str) -> InputError:
    """An error in a file of curves."""
    return InputError(Problem(str(file), key, given, rule, remedy))
