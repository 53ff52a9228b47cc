"""One rock beside the site's own, and whether two of them are one and the same."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.config.hazard_schema import History
from pipeline.config.layers import Origin, Site
from pipeline.config.observation_schema import Observations
from pipeline.config.outside import text
from pipeline.config.problems import InputError, Problem, edited_since
from pipeline.config.yaml_text import parse
from pipeline.stages.archive.archived_rock import answered
from pipeline.stages.fragility.summary import Fits
from pipeline.stages.hazard.rock_fragility import RockFragility, of_photograph, of_rock
from pipeline.stages.mesh.products import RockData
from pipeline.stages.uncertainty.draws import EnsembleData
from pipeline.workflow import graph, keys, site_folder
from pipeline.workflow.store import Store


@dataclass(frozen=True)
class Other:
    """A fragility beside the site's own.

    Attributes
    ----------
    derived : str, folder of derived data relative to that of the site's own products
    earlier : tuple of Other, stages in which a rock was exhumed, the latest first
    """

    name: str
    site: Site
    derived: str
    uncertain: bool = False
    earlier: tuple[Other, ...] = ()

    @property
    def stage(self) -> str:
        """Stage that makes its fragility."""
        return "uncertainty" if self.uncertain else "fragility"

    @property
    def key(self) -> str:
        """Of its fragility, by its settings and files as they are."""
        return graph.identities(self.stage, self.site)[self.stage].key

    @property
    def history(self) -> History:
        """When its stages ended."""
        return self.site.config.hazard.history

    @property
    def observed(self) -> Observations:
        """What weighs its draws."""
        return self.site.config.observations if self.uncertain else ()

    def folder(self, own: Path) -> Path:
        """Folder of its products, which another site of its name has not."""
        derived = Path(os.path.normpath(own / self.derived))
        return site_folder.store_of(self.site, derived, None).folder

    def fragility(self, own: Path) -> RockFragility:
        """What its products say.

        Parameters
        ----------
        own : Path, of the site's own products
        """
        folder = self.folder(own)
        manifest = Store(folder).manifest(self.stage)
        if manifest is None or manifest["key"] != self.key:
            given = f"{self.stage} of other files or settings than {self.site.name} has by now"
            raise edited_since(str(folder), given)
        ensemble = EnsembleData(folder) if self.uncertain else None
        return of_rock(RockData(folder), Fits(folder), ensemble)


@dataclass(frozen=True)
class Archived:
    """A rock of an archive, whose fragility no runs are needed for.

    Attributes
    ----------
    before : str, digest of the archive when it was found
    age : float or None, mean age that the archive has [year]
    medians : tuple of float [g], of its boundaries, from the weaker direction to the stronger
    """

    name: str
    path: Path
    before: str
    observed: Observations = ()
    history: History = ()
    earlier: tuple[Other, ...] = ()
    age: float | None = None
    medians: tuple[float, ...] = ()

    def fragility(self, own: Path) -> RockFragility:
        """What the equations say; nothing is beside the site's ``own`` products."""
        found = of_photograph(answered(self.path, self.name))
        keys.check_same(self.path, [self.path], [self.before])
        return found


def alike(origin: Origin, *rocks: Other) -> Iterator[str]:
    """Rocks that are alike in all that their fragilities are made of, in words.

    Refuses one whose file states what another one's does, and names the same files.
    """
    for other, one in combinations(rocks, 2):
        sites = one.site, other.site
        stated, stated_by_other = (parse(text(site.path)) for site in sites)
        if stated == stated_by_other and (
            one.key == other.key or one.site.folder == other.site.folder
        ):
            file, given = origin.file_of("hazard.rocks"), f"{one.name}, a copy of {other.name}"
            rule, remedy = "each rock is counted once", "leave it out"
            raise InputError(Problem(file, "hazard.rocks", given, rule, remedy))
        if one.key == other.key:
            yield f"hazard.rocks: {one.name} is as {other.name} in shape, settings and runs"


def alike_in_archive(rocks: Sequence[Archived]) -> Iterator[str]:
    """Rocks of an archive that topple as another one does, from side to side, in words."""
    for other, one in combinations(rocks, 2):
        if one.medians == other.medians:
            yield f"hazard.rocks: {one.name} topples as {other.name} does, in either direction"


def alike_in_shape(rocks: Mapping[str, xr.Dataset]) -> Iterator[str]:
    """Rocks of the same size that tip at the same acceleration in each direction, in words.

    Parameters
    ----------
    rocks : dict, from names to what ``rock.nc`` holds
    """
    for (name, other), (own, one) in combinations(rocks.items(), 2):
        size = one.attrs["volume_m3"] / other.attrs["volume_m3"]
        ease = one["tipping_pga"].values / other["tipping_pga"].values
        if abs(size - 1.0) < _SAME and (np.abs(ease - 1.0) < _SAME).all():
            said = f"{own} has the size of {name}, and tips as easily in each direction"
            yield f"hazard.rocks: {said}: each rock is counted once"


_SAME = 0.01
"""Share by which a rock differs that was scanned, or scaled, twice."""
