"""Stochastic event sets as OpenQuake stores them, in its ``calc_N.hdf5``.

``events`` has the rupture, realization and year of each event; ``gmf_data`` PGA [g] and PGV [cm/s]
by number of the event, in older versions as ``gmv_0`` and so on, in the order of ``imts``;
``ruptures`` magnitudes, and ``rupgeoms`` their surfaces: the number of surfaces, two sizes of each,
and longitudes, latitudes and depths of its points, by rows from the top.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config import long_tables
from pipeline.config.outside import Row, check_file, check_hdf5, checked
from pipeline.stages.hazard import calculation_file
from pipeline.stages.hazard.event_tables import Event, EventTables, Place, Rupture, Shaken
from pipeline.stages.hazard.hazard_model import Realization
from pipeline.stages.hazard.hdf5_files import attribute, content
from vsr_core.arrays import Array

_RULE = "it is an event_based calculation of OpenQuake with ground motions of PGA"

_MOST = 50_000_000
"""Events whose columns are held at once."""

_MOST_RUPTURES = 2_000_000

_KEYS = {"events": "events", "ruptures": "ruptures", "gmf-data": "gmf_data"}


def tables(path: Path) -> EventTables:
    """What the file of a calculation holds."""
    import h5py

    check_file(path, long_tables.LARGEST)
    check_hdf5(path)
    with calculation_file.reading(path, "gmf_data", _RULE), h5py.File(path) as file:
        settings, _ = calculation_file.settings_of(file)
        lon, lat = (calculation_file.numbers(file[f"sitecol/{name}"]) for name in ("lon", "lat"))
        weights = calculation_file.weights_of(file)
        names = calculation_file.paths_of(file, settings, weights)
        years, sets = (
            calculation_file.number_of(settings[name])
            for name in ("investigation_time", "ses_per_logic_tree_path")
        )
        unused = tuple(_other_statements(file, years, sets, len(weights)))
    calculation_file.check_sites(path, lon.size, lat.size)
    return EventTables(
        dict.fromkeys(_KEYS, path),
        (str(years), str(sets)),
        [
            checked(path, Realization, {"rlz_id": at, "branch_path": name, "weight": weight})
            for at, (name, weight) in enumerate(zip(names, weights.tolist(), strict=True))
        ],
        checked(path, Place, {"lon": lon.item(), "lat": lat.item()}),
        partial(_parts, path),
        unused,
    )


def _other_statements(file: Any, years: float, sets: float, realizations: int) -> Iterator[str]:
    """What the shaking was computed for, where it is other than what the file has, in words."""
    stated, number = file["gmf_data"], len(file["events"])
    known = {
        "num_events": (number, "events", "some may be lost"),
        "investigation_time": (years, "years of a set", "one may be wrong"),
        "effective_time": (years * sets * realizations, "years in all", "one may be wrong"),
    }
    for name, (own, what, doubt) in known.items():
        told = float(attribute(stated, name)) if name in stated.attrs else own
        if abs(told - own) > _ROUNDED * own:
            yield f"gmf_data is of {told:.15g} {what}, and the file has {own:.15g}: {doubt}"


_ROUNDED = 1e-6
"""How far numbers may be apart, as a share."""


def _parts(path: Path, name: str, row: type[Row]) -> Iterator[dict[str, Any]]:
    """Columns of a table, all at once, as a table in CSV names them."""
    import h5py

    read = {Event: _events, Shaken: _shaken, Rupture: _ruptures}[row]
    with calculation_file.reading(path, _KEYS[name], _RULE), h5py.File(path) as file:
        found = read(file)
        shapes = {values.shape for values in found.values()}
        if len(shapes) > 1 or len(shapes.pop()) != 1:
            raise ValueError("columns that are none, or of several lengths")
        if not all(values.dtype.kind in "if" for values in found.values()):
            raise ValueError("a column of no numbers")
    long_tables.check(path, row, found, np.zeros(len(next(iter(found.values()))), bool), 0)
    yield found


def _events(file: Any) -> dict[str, Any]:
    events = content(file["events"], _MOST)
    named = {"event_id": "id", "rup_id": "rup_id", "rlz_id": "rlz_id", "year": "year"}
    return {name: _whole(events[own]) for name, own in named.items()}


def _whole(numbers: Array) -> Array:
    if numbers.dtype.kind not in "iu":
        raise ValueError(f"{numbers.dtype} for whole numbers")
    return numbers.astype(np.int64)


def _shaken(file: Any) -> dict[str, Any]:
    shaken = file["gmf_data"]
    measures = str(attribute(shaken, "imts")).split() if "imts" in shaken.attrs else []
    found = {"event_id": _whole(content(shaken["eid"], _MOST))}
    for name in ("PGA", "PGV"):
        older = f"gmv_{measures.index(name)}" if name in measures else name
        own = name if name in shaken else older
        if name == "PGA" or own in shaken:
            found[f"gmv_{name}"] = content(shaken[own], _MOST)
    if "sid" in shaken and len(np.unique(content(shaken["sid"], _MOST))) > 1:
        raise ValueError("shaking at several sites")
    return found


def _ruptures(file: Any) -> dict[str, Any]:
    ruptures, geometry = (content(file[name], _MOST_RUPTURES) for name in ("ruptures", "rupgeoms"))
    if ruptures["geom_id"].min() < 0:  # which would count from the end
        raise ValueError("a surface below the first")
    lain = np.array([_lie(geometry[at]) for at in ruptures["geom_id"]]).T
    names = ("centroid_lon", "centroid_lat", "strike", "dip")
    own = {"rup_id": _whole(ruptures["id"]), "mag": ruptures["mag"].astype(np.float64)}
    if "n_occ" in ruptures.dtype.names:
        own["multiplicity"] = _whole(ruptures["n_occ"])
    return own | dict(zip(names, lain, strict=True))


def _lie(surface: Array) -> tuple[float, float, float, float]:
    """Longitude and latitude of the middle, strike and dip of the first surface of a rupture."""
    number, rows, columns = (int(one) for one in surface[:3])
    points = surface[1 + 2 * number :].reshape(3, -1)[:, : rows * columns]
    lon, lat, depth = points.astype(np.float64)
    # four corners are in one row of the two upper and the two lower ones
    right, below = (1, 2) if rows == 1 else (columns - 1, (rows - 1) * columns)
    parallel = np.cos(np.radians(lat[0]))
    strike = np.arctan2((lon[right] - lon[0]) * parallel, lat[right] - lat[0])
    east, north = (lon[below] - lon[0]) * parallel, lat[below] - lat[0]
    beside = 111.195 * abs(east * np.cos(strike) - north * np.sin(strike))
    dip = np.arctan2(depth[below] - depth[0], beside)
    return lon.mean(), lat.mean(), np.degrees(strike), np.degrees(dip)
