"""The run to replay: a cell of a study's grid, and perhaps another one beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline.config.outside import checked
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import Config
from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs.scenes import Group
from pipeline.workflow.datasets import rows_of
from vsr_core import engines
from vsr_core.arrays import Array

NEIGHBOUR = "neighbour"
"""Selects the nearest cell with the other outcome."""

AS_PRINTED = 1e-3
"""Share by which a number may differ from that of the grid, which is printed to three digits."""

RESULTS = ("outcome", "decided_by", "steps", "peak_tilt", "final_tilt", "slip")
"""What a run done again is compared in."""

_NAMES = {"yaw": "yaw", "friction": "friction", "pgv_pga": "PGV/PGA", "pga": "PGA"}
_UNITS = {"yaw": "deg", "pgv_pga": "s", "pga": "g"}
_FEW = 12


@dataclass(frozen=True)
class Choice:
    """A run of a study."""

    group: Group
    cell: Cell
    engine: str

    def among(self, responses: xr.Dataset) -> dict[str, Any]:
        """The results of this run that the study keeps, by their names in ``Response``."""
        at = responses.sel(yaw=self.group.yaw, friction=self.group.friction, pga=self.cell.pga)
        own = at.isel({rows_of(responses): self.cell.row})
        names = {name: name for name in RESULTS}
        names |= {"peak_tilt": "tilt_until_decided", "slip": "slip_until_decided"}
        found = {name: own[stored].item() for name, stored in names.items()}
        if found["steps"] < 0:  # not of the sample of those of which all is kept
            return {name: found[name] for name in ("outcome", "decided_by")}
        return found


def chosen(config: Config, shaking: Shaking, given: Mapping[str, str | None]) -> Choice:
    """The run of a study at given coordinates.

    Parameters
    ----------
    given : mapping from yaw, friction, pgv_pga or record, and pga to what was given for them;
        what has one value only may be left out
    """
    own = shaking.dimension
    other = "record" if own == "pgv_pga" else "pgv_pga"
    if (wrong := given.get(other)) is not None:
        rule = f"the runs of this study are selected by {own}"
        remedy = f"give {_option(own)} in its place"
        raise InputError(Problem(_option(other), "", wrong, rule, remedy))
    yaw = _at("yaw", config.yaw, given.get("yaw"))
    friction = _at("friction", config.contact.friction, given.get("friction"))
    row = _at(own, shaking.rows, given.get(own))
    pga = _at("pga", shaking.pga, given.get("pga"))
    group = Group(config.yaw[yaw], config.contact.friction[friction])
    return Choice(group, Cell(row, shaking.pga[pga]), config.engine)


def other(config: Config, shaking: Shaking, first: Choice, request: str) -> Choice:
    """The run that differs from another one in the given coordinates.

    Parameters
    ----------
    request : str, such as ``engine=bullet`` or ``yaw=30,pga=0.5``
    """
    changed = _pairs(request, shaking)
    coordinates = {
        "yaw": repr(first.group.yaw),
        "friction": repr(first.group.friction),
        shaking.dimension: str(shaking.rows[first.cell.row]),
        "pga": repr(first.cell.pga),
    }
    engine = changed.pop("engine", first.engine)
    if engine not in engines.names():
        rule, remedy = f"the engines are {', '.join(engines.names())}", "choose one of these"
        raise InputError(Problem("--and", "engine", engine, rule, remedy))
    values = {name: getattr(config, name) for name in Config.model_fields}
    simulation = config.simulation.model_copy(update={"engine": engine})
    checked(Path("--and"), Config, values | {"simulation": simulation})
    second = replace(chosen(config, shaking, coordinates | changed), engine=engine)
    if second == first:
        rule = "a second run differs from the first"
        raise InputError(Problem("--and", "", request, rule, _KINDS))
    return second


_KINDS = "give e.g. engine=bullet, pga=0.5 or neighbour"


def _pairs(request: str, shaking: Shaking) -> dict[str, str]:
    known = ("engine", "yaw", "friction", shaking.dimension, "pga")
    parts = [part.partition("=")[::2] for part in request.split(",")]
    pairs = {key.strip(): value.strip() for key, value in parts}
    if len(pairs) < len(parts) or not all(key in known and value for key, value in pairs.items()):
        rule = f"it is {NEIGHBOUR}, or key=value of {', '.join(known)}, parted by commas"
        raise InputError(Problem("--and", "", repr(request), rule, _KINDS))
    return pairs


def neighbour(overturned: Array, pga: Sequence[float], first: Choice) -> Choice:
    """The cell with the other outcome, of the nearest PGA in its row, else the nearest of its yaw.

    Parameters
    ----------
    overturned : ndarray of int, shape (rows, pga), of the runs of its yaw and friction
    """
    column = pga.index(first.cell.pga)
    side = int(overturned[first.cell.row, column])
    rows, columns = np.nonzero(overturned == 1 - side)
    if side < 0 or not len(rows):
        rule = "a neighbour has the other outcome, and at this yaw and friction no run has"
        raise InputError(Problem("--and", "", NEIGHBOUR, rule, "name the second run, e.g. yaw=30"))
    is_own = rows == first.cell.row
    stronger = np.round(np.abs(np.array(pga)[columns] - first.cell.pga), 9)  # of two the weaker
    cells = np.hypot(rows - first.cell.row, columns - column)
    nearest = int(np.lexsort((np.where(is_own, stronger, cells), ~is_own))[0])
    return Choice(first.group, Cell(int(rows[nearest]), pga[columns[nearest]]), first.engine)


def _at(name: str, values: Sequence[Any], given: str | None) -> int:
    """Place of a value among those of the grid."""
    if given is None:
        if len(values) == 1:
            return 0
        rule = f"a run has one {_NAMES.get(name, name)}: {_listed(name, values)}"
        raise InputError(Problem(_option(name), "", "nothing", rule, "choose one"))
    if name == "record":
        if given in values:
            return list(values).index(given)
        rule = f"the records of the study are {_listed(name, values)}"
        raise InputError(Problem(_option(name), "", given, rule, "choose one of these"))
    try:
        number = float(given)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        rule = f"{_NAMES[name]} is a number: {_listed(name, values)}"
        raise InputError(Problem(_option(name), "", repr(given), rule, "choose one"))
    apart = np.abs(np.array(values) - number)
    if name == "yaw":  # 270 is -90
        apart = np.minimum(apart % 360.0, -apart % 360.0)
    place = int(np.argmin(apart))
    if apart[place] > max(AS_PRINTED * abs(values[place]), 1e-9):
        rule = f"the grid of the study has {_NAMES[name]} {_listed(name, values)}"
        nearest = f"the nearest is {values[place]:.6g}"
        raise InputError(Problem(_option(name), "", given, rule, nearest))
    return place


def _listed(name: str, values: Sequence[Any]) -> str:
    unit = f" {_UNITS[name]}" if name in _UNITS else ""
    if len(values) <= _FEW:
        return ", ".join(v if isinstance(v, str) else f"{v:.6g}" for v in values) + unit
    if isinstance(values[0], str):
        return ", ".join(values[:_FEW]) + f" and {len(values) - _FEW} more"
    return f"{values[0]:.6g} to {values[-1]:.6g}{unit}, {len(values)} values"


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
