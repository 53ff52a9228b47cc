"""Stochastic event sets of OpenQuake: simulated earthquakes with their shaking at a site, as CSV.

``gmf-data_1.csv`` has ``event_id, gmv_PGA, gmv_PGV`` (g and cm/s) and the site; ``events_1.csv``
the rupture and the realization of each event, and its year. The header of ``ruptures_1.csv`` has
``investigation_time`` and ``ses_per_logic_tree_path``, whose product is the effective time: the
years that each realization was simulated for. Years of the realizations follow each other.
``ruptures_1.csv`` has magnitudes and middles, ``realizations_1.csv`` the weights, and
``sitemesh_1.csv`` the place.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import Field

from pipeline.config import long_tables
from pipeline.config.outside import Row, refused, rows, table, text
from pipeline.stages.hazard import openquake
from pipeline.stages.hazard.hazard_model import LEVELS, Realization

NEEDED, MORE = ("gmf-data", "events", "realizations"), ("ruptures", "sitemesh")
"""Files of a folder that have to be there, and that may be."""

_TIMES = {name: re.compile(rf"\b{name}{openquake.STATED}")
          for name in ("investigation_time", "ses_per_logic_tree_path")}  # fmt: skip

_Id = Field(ge=0, le=2**62)


class Shaken(Row):
    """A row of ground-motion fields."""

    event_id: int = _Id
    gmv_PGA: float = Field(ge=0, le=LEVELS["PGA"][2], description="peak ground acceleration [g]")  # noqa: N815
    gmv_PGV: float | None = Field(None, ge=0, le=LEVELS["PGV"][2], description="PGV in cm/s")  # noqa: N815
    custom_site_id: str | None = None
    site_id: str | None = None


class Event(Row):
    """A row of events."""

    event_id: int = _Id
    rup_id: int = _Id
    rlz_id: int = _Id
    year: int = Field(0, ge=0, le=2**62)


class Rupture(Row):
    """A row of ruptures."""

    rup_id: int = _Id
    multiplicity: int = Field(1, ge=1, le=2**62, description="events of it, or more")
    mag: float = Field(gt=0, le=11, description="magnitude")
    centroid_lon: float = Field(ge=-180, le=360, description="longitude of the middle [degree]")
    centroid_lat: float = Field(ge=-90, le=90, description="latitude of the middle [degree]")
    strike: float = Field(ge=-360, le=360, description="strike [degree]")
    dip: float = Field(ge=0, le=90, description="dip [degree]")


class Place(Row):
    """A row of sites."""

    custom_site_id: str | None = None
    lon: float = Field(ge=-180, le=360, description="longitude of the site [degree]")
    lat: float = Field(ge=-90, le=90, description="latitude of the site [degree]")


@dataclass(frozen=True, eq=False)
class EventTables:
    """What an event set consists of, wherever it is.

    Attributes
    ----------
    paths : dict, of files by what they hold, for what is refused
    times : tuple of str, investigation time and number of event sets, where both are told
    parts : callable, from what a table holds and the schema of its rows to its columns, in parts
    unused : tuple of str, what is told of shaking that has no part, in words
    """

    paths: dict[str, Path]
    times: tuple[str, ...]
    weights: list[Realization]
    place: Place | None
    parts: Callable[[str, type[Row]], Iterator[dict[str, Any]]]
    unused: tuple[str, ...] = ()


def of_folder(folder: Path) -> EventTables:
    """Tables in CSV."""
    paths = files(folder)
    told = long_tables.header(paths["ruptures"])[0] if "ruptures" in paths else ""
    return EventTables(
        paths,
        tuple(found[1] for one in _TIMES.values() if (found := one.search(told))),
        openquake.realizations(folder),
        _place(paths["sitemesh"]) if "sitemesh" in paths else None,
        partial(_parts, paths),
        tuple(
            f"column {name} of {paths['gmf-data'].name} left out, as it says nothing here"
            for name in long_tables.header(paths["gmf-data"])[1]
            if name not in Shaken.model_fields
        ),
    )


def _parts(paths: dict[str, Path], name: str, row: type[Row]) -> Iterator[dict[str, Any]]:
    return long_tables.parts(paths[name], row)


def files(folder: Path) -> dict[str, Path]:
    """The files of an event set, by what they hold."""
    if not folder.is_dir():
        rule = "events are in a folder, as OpenQuake exports them"
        raise refused(folder, "", "folder not found", rule, "check the path")
    found = {}
    for name in (*NEEDED, *MORE):
        of_name = [one for one in sorted(folder.glob(f"{name}*.csv")) if _is(name, one)]
        if len(of_name) > 1:
            given, rule = f"{len(of_name)} files {name}", "a folder holds one calculation"
            raise refused(folder, name, given, rule, "leave the others out")
        if of_name:
            found[name] = of_name[0]
        elif name in NEEDED:
            rule = "OpenQuake's is named gmf-data_1.csv, with events_1.csv and realizations_1.csv"
            raise refused(folder, name, "no such file", rule, "export it from the same calculation")
    openquake.check_calculation(folder, found.values())
    return found


def _is(name: str, path: Path) -> bool:
    return bool(re.fullmatch(rf"{name}(_\d+)?\.csv", path.name))


def _place(path: Path) -> Place:
    sites = rows(path, Place, table(path, text(path)))
    if len(sites) != 1:
        given, rule = f"{len(sites)} sites", "all events are at one site"
        raise refused(path, "lon, lat", given, rule, "export those of the rock's site only")
    return sites[0]
