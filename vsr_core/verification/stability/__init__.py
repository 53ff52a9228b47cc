"""Stiff and extreme cases, each with a verdict by measurement.

A module holds one family of cases and offers them as ``CASES``; modules are found by their name,
those with an underscore are shared parts. A case measures something whose answer is known: a closed
form, Housner's block, a sliding mass, a sampled loop, or the same scene computed finer. It is

- right, if the answer is within the tolerance;
- flagged, if the program refused it or ended it without an outcome, and says why and what to do;
- silently wrong, if it is neither. There must be none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial

from vsr_core.errors import InvalidInput
from vsr_core.verification import modules


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
class ExtremeCase:
    """A stiff or extreme case.

    Attributes
    ----------
    reference : str, what is measured, its reference, and what the error is relative to
    tolerance : float, largest error that is right
    measure : callable, raises ``InvalidInput`` where the program refuses or gives no outcome
    family : str, name of its module, put there by ``cases``
    together : str, cases of one such name share what takes long, and are measured in one process
    """

    name: str
    parameter: str
    value: float
    unit: str
    reference: str
    tolerance: float
    measure: Callable[[], Measured]
    family: str = ""
    together: str = ""

    def run(self) -> Finding:
        """Measure and judge."""
        try:
            found = self.measure()
        except InvalidInput as refusal:
            return Finding(Verdict.FLAGGED, math.nan, math.nan, math.nan, str(refusal))
        right = found.error <= self.tolerance
        verdict = Verdict.RIGHT if right else Verdict.WRONG
        return Finding(verdict, found.measured, found.expected, found.error, found.note)


Varied = tuple[str, str, str, float]
"""What cases have in common: parameter, its unit, reference and tolerance."""


def sweep(
    name: str,
    varied: Varied,
    values: Iterable[float],
    measure: Callable[..., Measured],
    engines: Iterable[str] = ("bullet",),
) -> tuple[ExtremeCase, ...]:
    """Cases that differ in one value, engine by engine.

    Parameters
    ----------
    name : str, in which {x} stands for the value, {m} for a thousand times it, {engine} for that
    varied : parameter, its unit, reference and tolerance
    measure : callable (value, engine), as of ``ExtremeCase``
    """
    parameter, unit, reference, tolerance = varied
    return tuple(
        ExtremeCase(
            name.format(x=value, m=1e3 * value, engine=engine),
            parameter,
            value,
            unit,
            reference,
            tolerance,
            partial(measure, value, engine),
        )
        for engine in engines
        for value in values
    )


def families() -> dict[str, str]:
    """What the families of cases are about.

    Returns
    -------
    dict of str, the first line of each module's docstring, by the module's name
    """
    return {
        name: (module.__doc__ or "").partition("\n")[0].rstrip(".")
        for name, module in modules(__name__).items()
    }


def cases() -> dict[str, ExtremeCase]:
    """All cases, family by family."""
    return {
        case.name: replace(case, family=name)
        for name, module in modules(__name__).items()
        for case in module.CASES
    }
