"""Products beside a site's own that its hazard reads: of other rocks, and of other settings."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from netCDF4 import Dataset

from pipeline.config.layers import Site, load_site
from pipeline.stages.fragility.products import FILE as FITS
from pipeline.stages.uncertainty.products import FILE as ENSEMBLE
from pipeline.workflow.keys import digest_file
from pipeline.workflow.store import Store

NOTED = "vsr_others_json"
"""Attribute of ``hazard.nc``: digests of what was read beside the site's own products."""


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

    def file(self, own: Path) -> Path:
        """File of its fragility."""
        return self.folder(own) / (ENSEMBLE if self.uncertain else FITS)


def rocks(site: Site) -> list[Other]:
    """Other rocks at the place, as the configuration names them."""
    found = []
    for rock in site.config.hazard.rocks:
        name = rock.site
        if name.endswith((".yaml", ".yml")):
            name = str(site.folder_of("hazard.rocks") / name)
        other = load_site(name)
        found.append(Other(other.name, other, "..", other.config.uncertain))
    return found


def compared(
    site: Site, file: str, study: str | None = None, settings: tuple[str, ...] = ()
) -> list[Other]:
    """The rock with the settings that the configuration compares."""
    return [
        Other(
            one.name,
            load_site(file, one.study or study, (*settings, *one.set)),
            folder_of(one.name),
        )
        for one in site.config.hazard.compare
    ]


def folder_of(name: str) -> str:
    """Folder of a comparison, below the site's own products.

    Examples
    --------
    >>> folder_of("friction 0.4")
    'compared/friction_0.4'
    """
    return "compared/" + re.sub(r"[^A-Za-z0-9._-]", "_", name)


def digests(own: Path, files: list[Path]) -> dict[str, str]:
    """Digests of the fragilities that were read, by their paths from the site's own products."""
    return {os.path.relpath(one, own): digest_file(one) for one in files}


def changed(store: Store) -> str:
    """What of it is no longer as it was read, or an empty string."""
    path = store.folder / "hazard.nc"
    if not path.is_file():
        return ""
    with Dataset(path) as file:
        noted = json.loads(getattr(file, NOTED, "{}"))
    return next(_faults(store.folder, noted), "")


def _faults(own: Path, noted: dict[str, str]) -> Iterator[str]:
    for name, digest in noted.items():
        path = own / name
        if not path.is_file() or digest_file(path) != digest:
            yield f"{name} changed"
