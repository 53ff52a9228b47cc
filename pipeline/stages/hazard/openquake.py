"""Hazard curves of OpenQuake: exported to CSV by present and older versions, or as it stores them.

A CSV file has the curves of one realization and one measure. Its first line gives the years of the
probabilities, ``investigation_time=50.0``, and the measure, ``imt='PGA'``; its second names the
columns ``lon, lat, depth, poe-0.005, ...`` (older: ``lon:float32, ..., PGA-0.005:float32``), and
each further line is a site. Peak accelerations are in g, velocities in cm/s. The weights are in
``realizations_1.csv``.

In ``calc_N.hdf5``, ``hcurves-rlzs`` holds probabilities of exceedance for each site, realization,
measure and level; ``weights`` those of the realizations, and ``oqparam`` the levels and the years:
JSON, or in older versions a table of names and values as Python writes them.
"""

from __future__ import annotations

import ast
import csv
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.stages.hazard.hazard_model import (
    UNITS,
    Branch,
    HazardModel,
    normalized,
    reading,
    refused,
)
from vsr_core.hazard.curve import HazardCurve, curve_of_probabilities

NEAR = 1e-4
"""Distance in degrees within which two locations are one."""

SUFFIXES = (".hdf5", ".h5")

_STORED = "hcurves-rlzs"
_NAME = re.compile(r"hazard_curve-(mean|rlz-(\d+))-(\w+?)(?:_\d+)?\.csv")
_YEARS = re.compile(r"investigation_time\s*=\s*([^\s,'\"]+)")
_MEASURE = re.compile(r"imt\s*=\s*['\"]*([A-Za-z]+(?:\([^)]*\))?)")
_LEVEL = re.compile(r"(?:poe|[A-Z]\w*(?:\([^)]*\))?)-([0-9.eE+-]+)(?::\w+)?")


@dataclass(frozen=True)
class _Curve:
    curve: HazardCurve
    location: tuple[float, float]
    path: Path


def is_there(folder: Path) -> bool:
    """Whether a folder has such curves."""
    return any(_NAME.fullmatch(path.name) for path in folder.iterdir())


def load(folder: Path) -> HazardModel:
    """All realizations of a folder, or the mean curve where there are none."""
    curves = _curves(folder)
    numbers = sorted({number for number, measure in curves if number >= 0 and measure == "PGA"})
    if not numbers and (-1, "PGA") not in curves:
        rule, remedy = "the probability of toppling is for PGA", "export the curves of PGA"
        raise refused(folder, "imt", "no curves of PGA", rule, remedy)
    location = next(iter(curves.values())).location
    if not numbers:
        return HazardModel((_branch(curves, -1, "the mean", 1.0),), location)
    weights = _weights(folder)
    if incomplete := set(numbers) ^ set(weights):
        given = f"realization {min(incomplete)} without curve or weight"
        rule = "each has a curve of PGA and a weight in realizations_1.csv"
        raise refused(folder, "rlz_id", given, rule, "export both from one calculation")
    return normalized(folder, [_branch(curves, n, *weights[n]) for n in numbers], location)


def load_calculation(path: Path) -> HazardModel:
    """All realizations of OpenQuake's own file of a calculation."""
    import h5py

    rule = "it is a classical calculation of OpenQuake with individual_rlzs = true"
    with (
        reading(path, _STORED, rule, "run it so, or export its curves to CSV"),
        h5py.File(path) as file,
    ):
        settings, levels = _settings(file)
        probabilities = np.asarray(file[_STORED], dtype=np.float64)
        measures = json.loads(file[_STORED].attrs["json"])["imt"]
        number = probabilities.shape[1]
        weights = np.asarray(file["weights"], dtype=np.float64).reshape(number, -1)[:, 0]
        location = float(file["sitecol"]["lon"][0]), float(file["sitecol"]["lat"][0])
        paths = _paths(file, number)
        years = float(settings["investigation_time"])
    if len(probabilities) != 1:
        given, rule = f"{len(probabilities)} sites", "all curves are of one site"
        raise refused(path, "sitecol", given, rule, "calculate the rock's site only")
    if "PGA" not in measures:
        given, rule = f"curves of {', '.join(measures)}", "the probability of toppling is for PGA"
        raise refused(path, "imt", given, rule, "calculate PGA too")
    branches = []
    for i in range(number):
        curves = {}
        for measure, poes in zip(measures, probabilities[0, i], strict=True):
            if measure in UNITS:
                at = UNITS[measure] * np.asarray(levels[measure])
                with reading(path, f"poe of {measure}", "probabilities are numbers"):
                    curves[measure] = curve_of_probabilities(at, poes[: len(at)], years)
        own = float(weights[i]), curves["PGA"], curves.get("PGV")
        branches.append(Branch(str(i), paths[i], *own))
    return normalized(path, branches, location)


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
            given = f"the curve that is in {found[key].path.name} too"
            raise refused(path, "", given, "a folder holds one calculation", "remove one")
        found[key] = _curve(path, name[3])
        first = next(iter(found.values()))
        if not np.allclose(first.location, found[key].location, rtol=0.0, atol=NEAR):
            given = f"{found[key].location}, and {first.location} in {first.path.name}"
            remedy = "give the curves of one site"
            raise refused(path, "lon, lat", given, "all curves are of one site", remedy)
    return found


def _curve(path: Path, measure: str) -> _Curve:
    header, names, rows = _lines(path)
    years, stated = _YEARS.search(header), _MEASURE.search(header)
    if not years:
        rule = "the first line gives the years of the probabilities"
        raise refused(path, "investigation_time", "nothing", rule, "export the file again")
    if stated and stated[1] != measure:
        rule = f"the file name says {measure}"
        raise refused(path, "imt", stated[1], rule, "rename the file, or export it again")
    levels = {
        i: float(level[1]) for i, name in enumerate(names) if (level := _LEVEL.fullmatch(name))
    }
    places = [i for i, name in enumerate(names) if name.split(":")[0] in ("lon", "lat")]
    if len(rows) != 1 or len(levels) < 2 or len(places) != 2:
        given, rule = f"{len(rows)} sites and {len(levels)} levels", "one site, two or more levels"
        raise refused(path, "lon, lat", given, rule, "export the curves of the rock's site only")
    with reading(path, "poe", "all fields are numbers"):
        at = UNITS[measure] * np.array([float(level) for level in levels.values()])
        poes = np.array([float(rows[0][i]) for i in levels])
        lon, lat = (float(rows[0][i]) for i in places)
        return _Curve(curve_of_probabilities(at, poes, float(years[1])), (lon, lat), path)


def _weights(folder: Path) -> dict[int, tuple[str, float]]:
    """Path and weight of each realization."""
    files = sorted(folder.glob("realizations*.csv"))
    if len(files) != 1:
        given = f"{len(files)} files realizations*.csv"
        rule, remedy = "one file has the weights", "export it from the same calculation"
        raise refused(folder, "realizations", given, rule, remedy)
    _, names, rows = _lines(files[0])
    at = {name.split(":")[0]: i for i, name in enumerate(names)}
    number = at.get("rlz_id", at.get("ordinal"))
    if number is None or not {"weight", "branch_path"} <= at.keys():
        given, rule = f"the columns {', '.join(names)}", "they are rlz_id, branch_path and weight"
        raise refused(files[0], "weight", given, rule, "export it again")
    with reading(files[0], "weight", "weights are numbers"):
        path, weight = at["branch_path"], at["weight"]
        return {int(row[number]): (row[path], float(row[weight])) for row in rows}


def _lines(path: Path) -> tuple[str, list[str], list[list[str]]]:
    """The first line, the names of columns, and the fields of the other lines."""
    with reading(path, "", "it is a text file"):
        text = path.read_text(encoding="utf-8-sig").splitlines()
    header = text[0] if text and text[0].lstrip('"').startswith("#") else ""
    rows = [row for row in csv.reader(text[1 if header else 0 :]) if row]
    return header, [name.strip() for name in rows[0]] if rows else [], rows[1:]


def _settings(file: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters of the calculation, and the levels of each measure."""
    stored = file["oqparam"][()]
    if isinstance(stored, bytes):
        settings = json.loads(stored)
        return settings, settings["hazard_imtls"]
    settings = {row[0].decode(): row[1].decode() for row in stored}
    return settings, ast.literal_eval(settings["hazard_imtls"])


def _paths(file: Any, number: int) -> list[str]:
    """Choices that lead to each realization, where each source model has all ground-motion models.

    Otherwise the realizations have their numbers only.
    """
    models = [row["path"].decode() for row in file["full_lt/sm_data"]]
    motions = [row["branch"].decode() for row in file["full_lt/gsim_lt"]]
    if len(models) * len(motions) != number:
        return [f"realization {i}" for i in range(number)]
    return [f"{model}~{motion}" for model in models for motion in motions]
