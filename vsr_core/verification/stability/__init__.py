"""Stiff and extreme cases, each with a verdict by measurement.

A module holds one family of cases and offers them as ``CASES``; modules are found by their name,
those with an underscore are shared parts. A case measures something whose answer is known: a closed
form, Housner's block, a sliding mass, a sampled loop, or the same scene computed finer. It is

- right, if the answer is within the tolerance;
- flagged, if the program refused it or ended it without an outcome, and says why and what to do;
- silently wrong, if it is neither. There must be none.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from types import ModuleType

from vsr_core.errors import InvalidInput


class Verdict(Enum):
    """What became of a case."""

    RIGHT = "right"
    FLAGGED = "flagged"
    WRONG = "silently wrong"


@dataclass(frozen=True)
class Measured:
    """What a case found.

    Attributes
    ----------
    measured, expected : float, in the unit that the case's reference states
    error : float, as the reference states it; not a number if the answer is of the wrong kind
    note : str
    """

    measured: float
    expected: float
    error: float
    note: str = ""


@dataclass(frozen=True)
class Finding:
    """Verdict of a case, with the numbers behind it; for a flag the reason and the remedy."""

    verdict: Verdict
    measured: float
    expected: float
    error: float
    note: str


@dataclass(frozen=True)
class Case:
    """A stiff or extreme case.

    Attributes
    ----------
    name : str, unique
    family : str, name of its module
    parameter : str, what is varied in the family
    value : float, of that, in ``unit``
    unit : str
    reference : str, what is measured, its reference, and what the error is relative to
    tolerance : float, largest error that is right
    measure : callable, raises ``InvalidInput`` where the program refuses or gives no outcome
    """

    name: str
    family: str
    parameter: str
    value: float
    unit: str
    reference: str
    tolerance: float
    measure: Callable[[], Measured]

    def run(self) -> Finding:
        """Measure and judge."""
        try:
            found = self.measure()
        except InvalidInput as refusal:
            return Finding(Verdict.FLAGGED, math.nan, math.nan, math.nan, str(refusal))
        right = found.error <= self.tolerance
        verdict = Verdict.RIGHT if right else Verdict.WRONG
        return Finding(verdict, found.measured, found.expected, found.error, found.note)


def families() -> dict[str, str]:
    """What each family of cases is about, by name: the first line of its module's docstring."""
    return {
        module.CASES[0].family: (module.__doc__ or "").partition("\n")[0].rstrip(".")
        for module in _modules()
    }


def cases() -> dict[str, Case]:
    """All cases by name, family by family."""
    return {case.name: case for module in _modules() for case in module.CASES}


def _modules() -> list[ModuleType]:
    """A module a family, in the order of their families' names."""
    names = (module.name for module in pkgutil.iter_modules(__path__))
    found = (importlib.import_module(f"{__name__}.{n}") for n in names if not n.startswith("_"))
    return sorted(found, key=lambda module: str(module.CASES[0].family))
