"""Simulated earthquakes of a hazard model: events with their branches, ruptures and shaking."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config.outside import Row, check_sum, checked, refused
from pipeline.config.sections import LEAST_RATIO
from pipeline.stages.hazard import event_calculation, event_doubts, event_tables, openquake
from pipeline.stages.hazard.event_tables import Event, EventTables, Rupture, Shaken
from pipeline.stages.hazard.hazard_model import (
    LEVELS,
    UNITS,
    GivenCurve,
    HazardModel,
    Realization,
    model,
)
from pipeline.workflow.grammar import counted
from pipeline.workflow.keys import check_same, digest_file
from vsr_core.arrays import Array, Indices
from vsr_core.hazard.events import Events, Ruptures, distance_of
from vsr_core.motions.named_columns import plain_number

LOWEST, STEP = 0.005, 1.05
"""Least PGA of a curve of events [g], and the factor between its levels."""

_CHANCE = 1e-6
"""Of events of equally likely years to span no more than they do, below which they are refused."""

_FEW = 10
"""Events whose PGV may be 0 although their PGA is strong, beside a quarter of all such."""


FARTHEST = 1_000
"""Distance [km] of a rupture that shakes a site: calculations stop at 200 to 500 km."""


@dataclass(frozen=True, eq=False)
class EventSet:
    """Branches with the curves of their events, and the events."""

    model: HazardModel
    events: Events


def files(path: Path) -> list[Path]:
    """The files that decide what is read."""
    return [path] if path.is_file() else list(event_tables.files(path).values())


def load(path: Path, years: float | None) -> EventSet:
    """Read and check an event set, in a folder or in a file of OpenQuake's.

    Parameters
    ----------
    years : effective time of each realization, where no file has it [year]
    """
    return _loaded(path, tuple(map(digest_file, files(path))), years)


@lru_cache(maxsize=1)
def _loaded(path: Path, digests: tuple[str, ...], given: float | None) -> EventSet:
    """The same, once for all that ask for it in a process."""
    in_file = path.is_file() and path.suffix in openquake.SUFFIXES
    told = event_calculation.tables(path) if in_file else event_tables.of_folder(path)
    years = _years(told, given)
    weights = sorted(told.weights, key=lambda row: row.rlz_id)
    check_sum(told.paths["gmf-data"], "weight", [row.weight for row in weights])
    known = _events(told, weights, years)
    at, pga, pgv = _shaken(told, known["event_id"])
    rupture, ruptures = _ruptures(told, known["rup_id"])
    kept = (pga > 0.0) & (known["branch"][at] >= 0)
    events = Events(
        UNITS["PGA"] * pga[kept],
        UNITS["PGV"] * pgv[kept] if pgv is not None else None,
        known["branch"][at[kept]],
        rupture[at[kept]],
        years,
        ruptures,
    )
    check_same(path, files(path), digests)
    unused = list(told.unused)
    if zero := sum(not row.weight for row in weights):
        lost = counted(int((known["branch"] < 0).sum()), "event")
        unused.append(f"{counted(zero, 'realization')} of weight 0 left out, with {lost}")
    if weak := len(known["event_id"]) - len(at):
        unused.append(f"{counted(weak, 'event')} without a row of shaking, as too weak")
    if none := int((pga == 0.0).sum()):
        unused.append(f"{counted(none, 'event')} without PGA left out")
    unused += [*known["doubts"], *event_doubts.doubts(pga, pgv)]
    return EventSet(_model(told, events, weights, unused), events)


def _years(told: EventTables, given: float | None) -> float:
    """Effective time of each realization."""
    path = told.paths.get("ruptures", told.paths["events"])
    if len(told.times) < 2:
        if given is None:
            rule = "the header of ruptures_1.csv gives it with ses_per_logic_tree_path"
            remedy = "set hazard.effective_time, the years that each realization is simulated for"
            raise refused(path, "investigation_time", "nothing", rule, remedy)
        return given
    one, number = told.times
    try:
        years = plain_number(one) * plain_number(number)
    except ValueError:
        years = float("nan")
    if not 0.0 < years < 1e12:
        shown = f"{one} times {number}"
        raise refused(path, "investigation_time", shown, "they are numbers above 0")
    if given is not None and abs(given / years - 1.0) > 1e-6:
        rule, remedy = f"the files say {years:g}", "leave hazard.effective_time out"
        raise refused(path, "hazard.effective_time", f"{given:g}", rule, remedy)
    return years


def _all(told: EventTables, name: str, row: type[Row], number: str) -> dict[str, Any]:
    """All of a table, in the order of numbers, each of which is there once."""
    path, found = told.paths[name], list(told.parts(name, row))
    if not found or not len(found[0][number]):
        raise refused(path, "", "no rows", "there is one or more")
    whole = {name: np.concatenate([part[name] for part in found]) for name in found[0]}
    if not (np.diff(whole[number]) > 0).all():
        order = np.argsort(whole[number], kind="stable")
        whole = {name: values[order] for name, values in whole.items()}
    ids = whole[number]
    if len(twice := np.flatnonzero(ids[1:] == ids[:-1])):
        raise refused(path, number, f"{ids[twice[0]]} twice", "it is in one row")
    return whole


def _places(sought: Indices, among: Indices) -> tuple[Indices, Indices]:
    """Where numbers are among others, which are in order; and which of them are not there."""
    at = np.minimum(np.searchsorted(among, sought), len(among) - 1)
    return at, np.flatnonzero(among[at] != sought)


def _events(told: EventTables, weights: list[Realization], years: float) -> dict[str, Any]:
    """Events in the order of their numbers, each with its branch, -1 in one of weight 0."""
    path, found = told.paths["events"], _all(told, "events", Event, "event_id")
    ids = found["event_id"]
    numbers = np.array([row.rlz_id for row in weights])
    at, lost = _places(found["rlz_id"], numbers)
    if len(lost):
        given = f"{found['rlz_id'][lost[0]]} of event {ids[lost[0]]}"
        raise refused(path, "rlz_id", given, "it is one of the realizations with a weight")
    _check_years(path, found, at, years)
    held = np.bincount(at, minlength=len(numbers))
    kept = [row.rlz_id for row in weights if row.weight > 0.0]
    if empty := [one for one in kept if not held[np.searchsorted(numbers, one)]]:
        rule, remedy = "each realization has events", "simulate more years, or export all events"
        raise refused(path, "rlz_id", f"no event of realization {empty[0]}", rule, remedy)
    branch = np.full(len(numbers), -1)
    branch[np.searchsorted(numbers, kept)] = np.arange(len(kept))
    doubts = event_doubts.of_years(found["year"], found["rlz_id"], years) if "year" in found else ()
    return {
        "event_id": ids,
        "rup_id": found["rup_id"],
        "branch": branch[at].astype(np.int32),
        "doubts": [*doubts],
    }


def _check_years(path: Path, found: dict[str, Any], at: Indices, years: float) -> None:
    """Refuse years that are not those of an effective time; each realization has its own."""
    if "year" not in found:
        return
    of = [found["year"][at == one] for one in np.unique(at)]
    of = [one for one in of if len(one) >= 2]
    spans = [int(one.max() - one.min()) for one in of]
    remedy = "correct hazard.effective_time, or export it again"
    if spans and max(spans) >= years:
        rule = f"each realization is of {years:g} years"
        raise refused(path, "year", f"years {max(spans)} apart", rule, remedy)
    for one, span in zip(of, spans, strict=True):
        # the range of n equally likely values: n r^(n-1) - (n-1) r^n
        number, share = len(one), (span + 1) / years
        if share ** (number - 1) * (number - (number - 1) * share) < _CHANCE / len(of):
            rule = f"{number} events of {years:g} years span more of them"
            raise refused(path, "year", f"years up to {span} apart only", rule, remedy)


def _shaken(told: EventTables, ids: Indices) -> tuple[Indices, Array, Array | None]:
    """Place among the events, PGA [g] and PGV [cm/s] of each event that is felt, in their order."""
    path, places, pga, pgv = told.paths["gmf-data"], [], [], []
    place = told.place.custom_site_id if told.place else None
    sites = {"custom_site_id": place} if place else {}
    for part in told.parts("gmf-data", Shaken):
        at, lost = _places(part["event_id"], ids)
        if len(lost):
            given = f"event {part['event_id'][lost[0]]}"
            rule = f"it is one of those in {told.paths['events'].name}"
            raise refused(path, "event_id", given, rule)
        _check_site(path, part, sites)
        places.append(at.astype(np.int32))
        pga.append(part["gmv_PGA"].astype(np.float32))
        if "gmv_PGV" in part:
            pgv.append(part["gmv_PGV"].astype(np.float32))
    if not sum(map(len, places)):
        raise refused(path, "", "no rows", "there is one for each event that is felt")
    at, accelerations = np.concatenate(places), np.concatenate(pga)
    velocities = np.concatenate(pgv) if pgv else None
    if (seen := np.bincount(at)).max() > 1:
        rule, remedy = "an event is in one row", "export those of the rock's site only"
        raise refused(path, "event_id", f"{ids[np.argmax(seen)]} twice", rule, remedy)
    if velocities is not None:
        _check_pgv(path, accelerations, velocities)
    if (np.diff(at) < 0).any():  # what is drawn for an event is not to depend on its row
        order = np.argsort(at)
        at, accelerations = at[order], accelerations[order]
        velocities = velocities[order] if velocities is not None else None
    return at, accelerations, velocities


def _check_pgv(path: Path, pga: Array, pgv: Array) -> None:
    """Refuse PGV of 0, which is less than the least that is kept, where PGA is strong."""
    least = np.min(pgv, initial=np.inf, where=pgv > 0.0)
    strong = UNITS["PGA"] * pga * LEAST_RATIO > UNITS["PGV"] * least
    lost = strong & (pgv == 0.0)
    if lost.sum() > _FEW + strong.sum() // 4:
        number = counted(int(lost.sum()), "event")
        given = f"0 in {number} with PGA of up to {pga[lost].max():.2g} g"
        rule = f"0 is less than the least that is told, {least:.2g} cm/s"
        raise refused(path, "gmv_PGV", given, rule)


def _check_site(path: Path, part: dict[str, Any], sites: dict[str, str]) -> None:
    """Refuse shaking at two sites.

    Parameters
    ----------
    sites : dict, the site of each column that tells one; those of the first row are put in
    """
    for name in {"custom_site_id", "site_id"} & part.keys():
        if not len(part[name]):
            continue
        own = sites.setdefault(name, part[name][0])
        others = part[name][part[name] != own]
        if len(others):
            rule, remedy = "all shaking is at one site", "export that of the rock's site only"
            raise refused(path, name, f"{own!r} and {others[0]!r}", rule, remedy)


def _ruptures(told: EventTables, of_events: Indices) -> tuple[Indices, Ruptures | None]:
    """Place of each event's rupture, and magnitudes and distances where they are told."""
    path, place = told.paths.get("ruptures"), told.place
    if path is None or place is None:
        return np.unique(of_events, return_inverse=True)[1].astype(np.int32), None
    found = _all(told, "ruptures", Rupture, "rup_id")
    ids = found["rup_id"]
    at, lost = _places(of_events, ids)
    if len(lost):
        rule = "each rupture of an event is there"
        raise refused(path, "rup_id", f"no {of_events[lost[0]]}", rule)
    if "multiplicity" in found:
        short = np.bincount(at, minlength=len(ids)) - found["multiplicity"]
        if len(few := np.flatnonzero(short < 0)):
            one, told_of = ids[few[0]], found["multiplicity"][few[0]]
            given, rule = f"{told_of + short[few[0]]} events of rupture {one}", f"it has {told_of}"
            raise refused(told.paths["events"], "rup_id", given, rule, "export all events")
    east = (place.lon - found["centroid_lon"] + 180.0) % 360.0 - 180.0
    north = place.lat - found["centroid_lat"]
    east = east * np.cos(np.radians(place.lat))
    distance = distance_of(found["mag"], east, north, found["strike"], found["dip"])
    if (farthest := float(distance[at].max())) > FARTHEST:
        given = f"a rupture {farthest:,.0f} km from {place.lat:g}, {place.lon:g}"
        rule = f"no event is felt beyond {FARTHEST:,} km"
        raise refused(path, "centroid_lon, centroid_lat", given, rule, "correct the site")
    return at.astype(np.int32), Ruptures(found["mag"], distance)


def _model(
    told: EventTables, events: Events, weights: list[Realization], unused: list[str]
) -> HazardModel:
    """The branches with how often each level of PGA, and of PGV, is exceeded."""
    path, place = told.paths["gmf-data"], told.place
    kept = [row for row in weights if row.weight > 0.0]
    site = {"lon": place.lon, "lat": place.lat} if place else {"lon": 0.0, "lat": 0.0}
    curves = {}
    for measure, values in (("PGA", events.pga), ("PGV", events.pgv)):
        if values is None:
            continue
        own = values / UNITS[measure]
        strongest = np.zeros(len(kept))
        np.maximum.at(strongest, events.branch, own)
        if not strongest.all():
            given = f"none above 0 in realization {kept[int(np.argmin(strongest))].rlz_id}"
            rule, remedy = "each realization has some", "simulate more years, or export all shaking"
            raise refused(path, f"gmv_{measure}", given, rule, remedy)
        levels = _levels(own, strongest, LOWEST * LEVELS[measure][0])
        rates = events.rates(own, levels, len(kept))
        for row, of_branch in zip(kept, rates.tolist(), strict=True):
            one = {"measure": measure, "levels": levels.tolist(), "values": of_branch}
            curves[row.rlz_id, measure] = path, checked(path, GivenCurve, one | site)
    found = model(path, curves, weights)
    if place is None:
        found = replace(found, location=None)
    return replace(found, unused=tuple(unused))


def _levels(values: Array, strongest: Array, lowest: float) -> Array:
    """Levels of a curve up to the largest value, two or more of them below that of each branch."""
    high = float(strongest.max())
    low = min(max(float(values.min()), lowest), float(strongest.min()) / STEP**2)
    return np.geomspace(low, high, 2 + int(np.log(high / low) / np.log(STEP)))
