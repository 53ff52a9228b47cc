"""Fragilities beside a site's own that its hazard reads: of other rocks, and of other settings."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.layers import Origin, Site, load_site
from pipeline.stages.fragility.summary import Fits
from pipeline.stages.hazard.rock_fragility import RockFragility, of_fits, of_members
from pipeline.stages.uncertainty.draws import EnsembleData
from pipeline.workflow import graph
from pipeline.workflow.stage import Input


@dataclass(frozen=True)
class Other:
    """A fragility beside the site's own.

    Attributes
    ----------
    derived : str, folder of derived data relative to that of the site's own products
    """

    name: str
    site: Site
    derived: str
    uncertain: bool = False

    @property
    def stage(self) -> str:
        """Stage that makes its fragility."""
        return "uncertainty" if self.uncertain else "fragility"

    def folder(self, own: Path) -> Path:
        """Folder of its products."""
        return own / self.derived / self.site.name

    def fragility(self, own: Path) -> RockFragility:
        """What its products say.

        Parameters
        ----------
        own : Path, of the site's own products
        """
        folder = self.folder(own)
        return of_members(EnsembleData(folder).data) if self.uncertain else of_fits(Fits(folder))


@dataclass(frozen=True)
class Others(Input):
    """Other rocks at the place, and the rock with other settings."""

    rocks: tuple[Other, ...]
    compared: tuple[Other, ...]

    def digests(self) -> dict[str, str]:
        """Keys of their products."""
        return {
            f"{one.derived}/{one.site.name}": graph.identities(one.stage, one.site)[one.stage].key
            for one in (*self.rocks, *self.compared)
        }


def find(hazard: HazardConfig, origin: Origin) -> Others:
    """What a site's hazard names beside the site itself."""
    rocks = []
    for rock in hazard.rocks:
        name = rock.site
        if name.endswith((".yaml", ".yml")):
            name = str(origin.folder_of("hazard.rocks") / name)
        other = load_site(name)
        rocks.append(Other(other.name, other, "..", other.config.uncertain))
    assert origin.request is not None
    file, study, settings = origin.request
    compared = [
        Other(one.name, load_site(file, one.study or study, (*settings, *one.set)), folder)
        for one in hazard.compare
        for folder in (folder_of(one.name),)
    ]
    return Others(tuple(rocks), tuple(compared))


def folder_of(name: str) -> str:
    """Folder of a comparison, below the site's own products.

    Examples
    --------
    >>> folder_of("friction 0.4")
    'compared/friction_0.4'
    """
    return "compared/" + re.sub(r"[^A-Za-z0-9._-]", "_", name)
