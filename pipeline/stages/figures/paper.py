"""The parts of a figure's module: its datasets, drawing and findings on the paper's claims.

A figure is a module ``fig_*`` or ``table_*`` of this room; it is found by its name. It holds

- ``TITLE``, a line for the page;
- ``SOURCES``, a dict of ``Source`` by the names under which its functions are given the datasets;
- ``draw(data)``, from the datasets to a matplotlib ``Figure``;
- ``findings(data)``, from the datasets to a list of ``Finding``;
- perhaps ``INPUTS``, files that it reads besides;
- perhaps ``SITE_KEYS``, a dict of the keys of settings that it reads, by the dataset whose site has
  them; it finds their values in the attributes of that dataset.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import xarray as xr
from matplotlib.figure import Figure

Data = Mapping[str, xr.Dataset]

RECORDED = "recorded_motion"
"""The study whose motions ``vsr figures --record`` replaces."""

FOUND, NOT_FOUND, NOT_TESTABLE = "reproduced", "not reproduced", "not testable here"


@dataclass(frozen=True)
class Source:
    """A dataset that a figure draws, made as any command makes it."""

    site: str
    stage: str
    study: str = ""

    @property
    def folder(self) -> str:
        """Name of the folder of its products: a study has one of its own, beside the site's."""
        return f"{self.site}-{self.study}" if self.study else self.site

    @property
    def files(self) -> tuple[str, ...]:
        """Names of its files there; a boundary is drawn on the responses that it is from."""
        return (
            ("responses.nc", "boundary.nc") if self.stage == "boundary" else (f"{self.stage}.nc",)
        )


@dataclass(frozen=True)
class Finding:
    """A claim of the paper and the result computed here.

    Attributes
    ----------
    found : bool or None, by that rule; None where it cannot be tested here
    """

    where: str
    claim: str
    rule: str
    measured: str
    found: bool | None

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        if self.found is None:
            return NOT_TESTABLE
        return FOUND if self.found else NOT_FOUND


def by_rule(holds: bool, *measures: float) -> bool | None:
    """Whether a claim is found, unless a measure that its rule compares is not known.

    Parameters
    ----------
    *measures : float, what it compares; nan where no run tells

    Returns
    -------
    >>> by_rule(0.2 < 0.5, 0.2), by_rule(math.nan < 0.5, math.nan)
    (True, None)
    """
    return None if any(map(math.isnan, measures)) else bool(holds)


class PaperFigure(Protocol):
    """The interface of a figure's module."""

    TITLE: str
    SOURCES: Mapping[str, Source]

    def draw(self, data: Data) -> Figure:
        """Draw it."""

    def findings(self, data: Data) -> list[Finding]:
        """Compare it with what the paper claims."""


def names() -> list[str]:
    """Names of all figures and tables, in the order of the paper, ours last.

    >>> [name for name in names() if name.startswith("fig_1")][:2]
    ['fig_10', 'fig_11']
    """
    folder = [str(Path(__file__).parent)]
    known = [module.name for module in pkgutil.iter_modules(folder)]
    figures = (name for name in known if name.startswith(("fig_", "table_")))
    return sorted(figures, key=lambda name: (not _number(name)[:1].isdigit(), name[:1], name))


def find(name: str) -> list[str]:
    """Names of the figures that a user means: ``12``, ``table_1``, ``friction``.

    A number brings its parts too.

    >>> find("8"), find("table_1"), find("99")
    (['fig_08'], ['table_1'], [])
    """
    known = names()
    if name in known:
        return [name]
    number = name.removeprefix("fig_").zfill(2)
    return [one for one in known if _number(one).rstrip("abcdef") == number] or [
        one for one in known if _number(one) in (name, number)
    ]


def load(name: str) -> PaperFigure:
    """Module of a figure."""
    return cast(PaperFigure, importlib.import_module(f"{__package__}.{name}"))


def inputs(figure: PaperFigure) -> tuple[Path, ...]:
    """Files that a figure reads besides its datasets."""
    return cast(tuple[Path, ...], getattr(figure, "INPUTS", ()))


def settings(figure: PaperFigure) -> Mapping[str, tuple[str, ...]]:
    """Keys of the settings that a figure reads, by its names of datasets."""
    return cast(Mapping[str, tuple[str, ...]], getattr(figure, "SITE_KEYS", {}))


def _number(name: str) -> str:
    return name.partition("_")[2]
