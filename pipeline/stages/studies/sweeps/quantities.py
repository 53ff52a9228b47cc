"""What is swept, by its name and unit, and each place along it."""

from __future__ import annotations

import re

from pipeline.config.refusals import meaning
from pipeline.config.sweep import GRIDS, Dimension
from pipeline.workflow.datasets import catalogue, labelled, spelled

_NUMBERS = re.compile(r"[-+.\dex ]+")


def quantity(key: str) -> tuple[str, str]:
    """What a swept key means, and its unit: as datasets have it, or else the configuration."""
    if key in GRIDS:
        entry = catalogue()[GRIDS[key]]
        return entry["long_name"], entry["units"]
    text, unit = meaning(key)
    return text.partition(";")[0], unit


def axis_label(dimension: Dimension) -> str:
    """Label of an axis along a dimension."""
    return labelled(*quantity(dimension.key))


def places(dimension: Dimension) -> list[str]:
    """What to call each place along a dimension, with the unit of its numbers.

    Returns
    -------
    >>> places(Dimension("yaw", {"yaw": (0, 90)}, ("0", "90"), 0, gridded=True))
    """
    unit = spelled(quantity(dimension.key)[1])
    return [
        f"{label} {unit}" if unit and _NUMBERS.fullmatch(label) else label
        for label in dimension.labels
    ]
