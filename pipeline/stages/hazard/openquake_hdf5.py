"""Hazard curves in OpenQuake's own file of a calculation, ``calc_N.hdf5``.

``hcurves-rlzs`` holds probabilities of exceedance for each site, realization, measure and level;
``weights`` those of the realizations, and ``oqparam`` the levels and the years: JSON, or in older
versions a table of names and values as Python writes them.
"""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.stages.hazard.hazard_model import UNITS, Branch, HazardModel, refused, weighed
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import HazardCurve, curve_of_probabilities

SUFFIXES = (".hdf5", ".h5")

_CURVES = "hcurves-rlzs"


def load(path: Path) -> HazardModel:
    """All realizations of a calculation."""
    import h5py

    try:
        with h5py.File(path) as file:
            settings, levels = _settings(file)
            curves = np.asarray(file[_CURVES])
            measures = json.loads(file[_CURVES].attrs["json"])["imt"]
            weights = np.asarray(file["weights"], dtype=np.float64).reshape(curves.shape[1], -1)
            sites = file["sitecol"]
            place = float(sites["lon"][0]), float(sites["lat"][0])
            paths = _paths(file, curves.shape[1])
            years = float(settings["investigation_time"])
    except (OSError, KeyError, ValueError, SyntaxError, TypeError) as error:
        raise refused(
            path,
            _CURVES,
            f"a file without what is needed ({error})",
            "it is a classical calculation of OpenQuake with individual_rlzs = true",
            "run it so, or export its curves to CSV",
        ) from None
    if curves.shape[0] != 1:
        raise refused(
            path,
            "sitecol",
            f"{curves.shape[0]} sites",
            "all curves are of one place",
            "calculate the rock's site only",
        )
    if "PGA" not in measures:
        raise refused(
            path,
            "imt",
            f"curves of {', '.join(measures)}",
            "toppling is asked for PGA",
            "calculate PGA too",
        )
    branches = []
    for number in range(curves.shape[1]):
        found = {
            measure: _curve(path, measure, levels[measure], curves[0, number, i], years)
            for i, measure in enumerate(measures)
            if measure in UNITS
        }
        branches.append(
            Branch(
                str(number),
                paths[number],
                float(weights[number, 0]),
                found["PGA"],
                found.get("PGV"),
            )
        )
    return weighed(path, branches, place)


def _curve(path: Path, measure: str, levels: Array, poes: Array, years: float) -> HazardCurve:
    at = UNITS[measure] * np.asarray(levels)
    try:
        return curve_of_probabilities(at, np.asarray(poes[: len(at)], dtype=np.float64), years)
    except InvalidInput as error:
        raise refused(path, f"poe of {measure}", error.given, error.rule, error.remedy) from None


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
