"""Hazard curves as OpenQuake exports them to CSV, of its present versions and of older ones.

A file has the curves of one realization and one measure. Its first line tells the years of the
probabilities, ``investigation_time=50.0``, and the measure, ``imt='PGA'``; its second names the
columns ``lon, lat, depth, poe-0.005, ...`` (older: ``lon:float32, ..., PGA-0.005:float32``), and
each further line is a place. Peak accelerations are in g, velocities in cm/s. The weights are in
``realizations_1.csv``.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.stages.hazard.hazard_model import UNITS, Branch, HazardModel, refused, weighed
from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import HazardCurve, curve_of_probabilities

NEAR = 1e-4
"""Distance in degrees within which two places are one."""

_NAME = re.compile(r"hazard_curve-(mean|rlz-(\d+))-(\w+?)(?:_\d+)?\.csv")
_YEARS = re.compile(r"investigation_time\s*=\s*([^\s,'\"]+)")
_MEASURE = re.compile(r"imt\s*=\s*['\"]*([A-Za-z]+(?:\([^)]*\))?)")
_LEVEL = re.compile(r"(?:poe|[A-Z]\w*(?:\([^)]*\))?)-([0-9.eE+-]+)(?::\w+)?")


@dataclass(frozen=True)
class _Curve:
    curve: HazardCurve
    place: tuple[float, float]
    path: Path


def is_there(folder: Path) -> bool:
    """Whether a folder has such curves."""
    return any(_NAME.fullmatch(path.name) for path in folder.iterdir())


def load(folder: Path) -> HazardModel:
    """All realizations of a folder, or the mean curve where there are none."""
    curves = _curves(folder)
    numbers = sorted({number for number, measure in curves if number >= 0 and measure == "PGA"})
    if not numbers and (-1, "PGA") not in curves:
        raise refused(
            folder, "imt", "no curves of PGA", "toppling is asked for PGA", "export those of PGA"
        )
    place = next(iter(curves.values())).place
    if not numbers:
        only = _branch(curves, -1, "the mean", 1.0)
        return HazardModel((only,), place)
    known = _weights(folder)
    missing = [number for number in numbers if number not in known]
    missing += [number for number in known if number not in numbers]
    if missing:
        raise refused(
            folder,
            "rlz_id",
            f"realization {missing[0]}, of which one is not there",
            "each has a curve of PGA and a weight in realizations_1.csv",
            "export both from one calculation",
        )
    return weighed(folder, [_branch(curves, n, *known[n]) for n in numbers], place)


def _branch(curves: dict[tuple[int, str], _Curve], number: int, path: str, weight: float) -> Branch:
    pgv = curves.get((number, "PGV"))
    name = "mean" if number < 0 else str(number)
    return Branch(name, path, weight, curves[number, "PGA"].curve, pgv.curve if pgv else None)


def _curves(folder: Path) -> dict[tuple[int, str], _Curve]:
    """Curves by number of the realization, -1 of the mean, and measure."""
    found: dict[tuple[int, str], _Curve] = {}
    for path in sorted(folder.iterdir()):
        name = _NAME.fullmatch(path.name)
        if not name or name[3] not in UNITS:
            continue
        key = int(name[2] or -1), name[3]
        if key in found:
            raise refused(
                path,
                "",
                f"the curve that is in {found[key].path.name} too",
                "a folder holds one calculation",
                "remove one",
            )
        found[key] = _curve(path, name[3])
        first = next(iter(found.values()))
        if max(abs(a - b) for a, b in zip(first.place, found[key].place, strict=True)) > NEAR:
            raise refused(
                path,
                "lon, lat",
                f"the place {found[key].place}, and {first.place} in {first.path.name}",
                "all curves are of one place",
                "give one site's curves",
            )
    return found


def _curve(path: Path, measure: str) -> _Curve:
    header, names, rows = _lines(path)
    years, told = _YEARS.search(header), _MEASURE.search(header)
    if not years:
        raise refused(
            path,
            "investigation_time",
            "nothing",
            "the first line tells the years of the probabilities",
            "export the file again",
        )
    if told and told[1] != measure:
        raise refused(
            path, "imt", told[1], f"the name says {measure}", "rename the file, or export it again"
        )
    columns = [i for i, name in enumerate(names) if _LEVEL.fullmatch(name)]
    places = [i for i, name in enumerate(names) if name.split(":")[0] in ("lon", "lat")]
    if len(rows) != 1 or len(columns) < 2 or len(places) != 2:
        raise refused(
            path,
            "lon, lat",
            f"{len(rows)} places and {len(columns)} levels",
            "there is one place, with two levels or more",
            "export the curves of the rock's site only",
        )
    try:
        levels = np.array([float(_LEVEL.fullmatch(names[i])[1]) for i in columns])  # type: ignore[index]
        poes = np.array([float(rows[0][i]) for i in columns])
        lon, lat = (float(rows[0][i]) for i in places)
        curve = curve_of_probabilities(UNITS[measure] * levels, poes, float(years[1]))
    except InvalidInput as error:
        raise refused(path, "poe", error.given, error.rule, error.remedy) from None
    except (ValueError, IndexError) as error:
        raise refused(
            path,
            "poe",
            f"a field that is no number ({error})",
            "all are numbers",
            "export it again",
        ) from None
    return _Curve(curve, (lon, lat), path)


def _weights(folder: Path) -> dict[int, tuple[str, float]]:
    """Path and weight of each realization."""
    files = sorted(folder.glob("realizations*.csv"))
    if len(files) != 1:
        raise refused(
            folder,
            "realizations",
            f"{len(files)} files realizations*.csv",
            "one has the weights of the realizations",
            "export it from the same calculation",
        )
    _, names, rows = _lines(files[0])
    at = {name.split(":")[0]: i for i, name in enumerate(names)}
    number = next((at[name] for name in ("rlz_id", "ordinal") if name in at), None)
    if number is None or "weight" not in at or "branch_path" not in at:
        raise refused(
            files[0],
            "weight",
            f"the columns {', '.join(names)}",
            "there are rlz_id, branch_path and weight",
            "export it again",
        )
    try:
        return {
            int(row[number]): (row[at["branch_path"]], float(row[at["weight"]])) for row in rows
        }
    except (ValueError, IndexError) as error:
        raise refused(
            files[0],
            "weight",
            f"a field that is no number ({error})",
            "it is one",
            "export it again",
        ) from None


def _lines(path: Path) -> tuple[str, list[str], list[list[str]]]:
    """The first line, the names of columns, and the fields of the other lines."""
    try:
        text = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise refused(
            path, "", f"a file that cannot be read ({error})", "it is text", "export it again"
        ) from None
    header = text[0] if text and text[0].lstrip('"').startswith("#") else ""
    rows = [row for row in csv.reader(text[1 if header else 0 :]) if row]
    return header, [name.strip() for name in rows[0]] if rows else [], rows[1:]
