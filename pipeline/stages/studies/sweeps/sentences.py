"""Sentences on the results of a sweep."""

from __future__ import annotations

import math

import numpy as np

from pipeline.config.sweep import Dimension, Sweep
from pipeline.stages.studies.sweeps.changes import Change, places, quantity
from pipeline.workflow.grammar import counted, listed

HALF = 0.5
"""Share of the PGV/PGA levels that must differ significantly for a change to count."""

RARE = 0.1
"""Share of the PGV/PGA levels below which a change is called rare."""

MOST_NAMED = 6
"""Values that a sentence names."""


def headline(sweep: Sweep, found: list[str], site: str) -> str:
    """The first sentence of the page.

    Parameters
    ----------
    found : list of str, what is said of each dimension; none where no boundary was computed
    """
    if not found:
        sizes = [
            f"{counted(len(one.labels), 'value')} of {quantity(one.key)[0]}"
            for one in sweep.dimensions
        ]
        return f"{site} at {listed(sizes)}."
    return " ".join(found)


def about(dimension: Dimension, changes: list[Change], spread: tuple[float, float] | None) -> str:
    """Say how far the boundary moves along a dimension, and whether that is more than its error."""
    own = ""
    if spread is not None and np.isfinite(spread[0]):
        own = (
            f"The normalised boundaries differ by {100 * spread[0]:.2f} % in the "
            f"median and {100 * spread[1]:.2f} % at most."
        )
    sentences = (_moved(dimension, changes), _none(changes), _beyond(changes), own)
    return " ".join(filter(None, sentences))


def _moved(dimension: Dimension, changes: list[Change]) -> str:
    """Largest shifts of the boundary, averaged over its rows."""
    reference = places(dimension)[dimension.reference]
    known = [one for one in changes if not one.is_reference and np.isfinite(one.mean)]
    if not known:
        return f"No PGV/PGA level has a boundary at both {dimension.name} {reference} and another."
    least, most = (pick(known, key=lambda one: one.mean) for pick in (min, max))
    against = f"Compared with {dimension.name} {reference}, the boundary, averaged over PGV/PGA,"
    if _percent(least.mean) == _percent(most.mean) == "0 %":
        return f"{against} does not move."
    if least is most:
        return f"{against} moves by {_percent(most.mean)} at {most.label}."
    low, high = (f"{_percent(one.mean)} at {one.label}" for one in (least, most))
    return f"{against} moves by {low} to {high}."


def _none(changes: list[Change]) -> str:
    """Where nothing topples."""
    safe = [one.label for one in changes if one.toppled == 0.0]
    if safe:
        return f"At {_named(safe)} nothing topples within the grid."
    most = max(changes, key=lambda one: one.lost)
    if most.lost == 0:
        return ""
    return f"This excludes PGV/PGA levels that no longer topple: {most.lost} at {most.label}."


def _beyond(changes: list[Change]) -> str:
    """Whether the changes are more than errors."""
    others = [one for one in changes if not one.is_reference and one.rows]
    strong = [one.label for one in others if one.share >= HALF]
    if not others:
        return ""
    beyond = "beyond the numerical errors and the spacing of the grid"
    if any(math.isnan(one.error) for one in changes):
        beyond = "beyond the spacing of the grid (not all numerical errors were measured)"
    touched = max(others, key=lambda one: one.share)
    where = f"{touched.apart} of {counted(touched.rows, 'PGV/PGA level')} at {touched.label}"
    if strong:
        return f"The change is {beyond} at half or more of the PGV/PGA levels at {_named(strong)}."
    if touched.apart == 0:
        return f"At no PGV/PGA level is the change {beyond}."
    if touched.share < RARE:
        return f"A change {beyond} is rare: at most {where}."
    return f"The change is {beyond} at up to {where}."


def _named(labels: list[str]) -> str:
    """Values in a sentence; of many, their number."""
    return f"{len(labels)} values" if len(labels) > MOST_NAMED else listed(labels)


def _percent(share: float) -> str:
    """A change in per cent with its sign.

    >>> _percent(0.0123), _percent(-0.2), _percent(1e-9)
    ('+1.2 %', '\N{MINUS SIGN}20 %', '0 %')
    """
    if abs(share) < 5e-4:
        return "0 %"
    text = f"{100 * share:+.2g} %" if abs(share) < 1 else f"{100 * share:+.0f} %"
    return text.replace("-", "\N{MINUS SIGN}")
