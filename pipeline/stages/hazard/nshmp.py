"""Hazard curves as nshmp-haz writes them: ``PGA/curves.csv``, annual rates of exceedance.

Its first line names the columns ``name, lon, lat`` and the levels, in g and cm/s; each further line
is a place. There are no branches: the curve is the mean of the model.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from pipeline.stages.hazard.hazard_model import UNITS, Branch, HazardModel, refused
from vsr_core.errors import InvalidInput
from vsr_core.hazard.curve import HazardCurve


def is_there(folder: Path) -> bool:
    """Whether a folder has such curves."""
    return (folder / "PGA" / "curves.csv").is_file()


def load(folder: Path) -> HazardModel:
    """The curve of a folder."""
    curves, places = {}, {}
    for measure, unit in UNITS.items():
        path = folder / measure / "curves.csv"
        if path.is_file():
            curves[measure], places[measure] = _curve(path, unit)
    only = Branch("mean", "the mean", 1.0, curves["PGA"], curves.get("PGV"))
    return HazardModel((only,), places["PGA"])


def _curve(path: Path, unit: float) -> tuple[HazardCurve, tuple[float, float]]:
    try:
        names, *rows = [row for row in csv.reader(path.read_text("utf-8-sig").splitlines()) if row]
        at = {name.strip().lower(): i for i, name in enumerate(names)}
        first = at["lat"] + 1
        (row,) = rows
        levels = np.array([float(name) for name in names[first:]])
        rates = np.array([float(field) for field in row[first:]])
        place = float(row[at["lon"]]), float(row[at["lat"]])
        return HazardCurve(unit * levels[rates > 0.0], rates[rates > 0.0]), place
    except InvalidInput as error:
        raise refused(path, "rate", error.given, error.rule, error.remedy) from None
    except (OSError, ValueError, IndexError, KeyError) as error:
        raise refused(
            path,
            "lon, lat",
            f"a file that is no curve of one place ({error})",
            "it has name, lon, lat and levels, and one line of rates",
            "export the curves of the rock's site only",
        ) from None
