"""A disaggregation of OpenQuake's, of PGA by magnitude and distance, as CSV.

``Mag_Dist-mean-0_1.csv`` has columns ``imt, iml, poe, mag, dist`` and the mean, or one for each
realization, whose weights are in the first line (older: ``poe`` first, and one file a level): the
probability that a level is exceeded by earthquakes of a bin of magnitude and distance.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from pipeline.config.outside import SUM, Row, Share, checked, refused, rows, table, text
from pipeline.config.sections import Refused
from pipeline.stages.hazard.event_tables import Place
from pipeline.stages.hazard.hazard_model import LEVELS, UNITS, check_digits
from pipeline.stages.hazard.openquake import YEARS, check_calculation
from pipeline.workflow.grammar import counted, listed
from vsr_core.arrays import Array

PATTERN = "Mag_Dist-*.csv"

MIDDLE = 0.1
"""How far from the middle of its borders a bin may be, in widths: it may have few digits."""

WHOLE = 1.25
"""Factor within which the bins of a level together have its probability. They differ by some per
cent, as OpenQuake finds the level between those of a curve; by more beyond the curve's ends."""

_EDGES = re.compile(r"(mag|dist)_bin_edges=\[([^\[\]]*)\]")
_WEIGHTS = re.compile(r"\bweights=\[([^\[\]]*)\]")
_STATISTIC = re.compile(r"mean|rlz-?\d+|poe-?\d+|max|std|quantile-?[\d.]+")
_COLUMNS = ("imt", "iml", "mag", "dist")
_NO_POE = "poe", "nan"
"""A field of OpenQuake's where levels were given, and not their probabilities."""


@dataclass(frozen=True, eq=False)
class Disaggregation:
    """Shares of earthquakes at levels of PGA.

    Attributes
    ----------
    magnitudes, distances : ndarray, shape (n,) [1] and [km], middles of the bins
    levels : ndarray, shape (k,) [m/s^2], ascending
    shares : ndarray, shape (k, n), rows sum to 1
    rates : ndarray, shape (k,) [1/year], of exceedance; NaN where the files do not tell
    location : tuple of float [degree], longitude and latitude; None where no first line tells
    unused : what else is in the files, in words
    """

    magnitudes: Array
    distances: Array
    levels: Array
    shares: Array
    rates: Array
    location: tuple[float, float] | None = None
    unused: tuple[str, ...] = ()


def disaggregation_files(path: Path) -> list[Path]:
    """The files of a disaggregation: itself, or those in a folder."""
    return [path] if path.is_file() else sorted(path.glob(PATTERN))


class Bin(Row):
    """A row of a disaggregation of PGA."""

    iml: float = Field(gt=0, le=LEVELS["PGA"][2], description="level of PGA [g]")
    poe: Share = Field(0.0, description="probability that it is exceeded [1]")
    mag: float = Field(ge=0, le=11, description="magnitude of the bin")
    dist: float = Field(ge=0, le=20_100, description="distance of the bin [km]")
    shares: tuple[Share, ...] = Field(
        min_length=1, description="one or more columns of probabilities, after imt, iml, mag, dist"
    )
    weights: tuple[Annotated[float, Field(gt=0, le=1)], ...] = Field(
        (), description="weights of the realizations in the first line"
    )
    years: float = Field(
        np.nan, ge=1e-3, le=1e6, description="years of the probabilities in the first line"
    )

    @model_validator(mode="after")
    def _weighed(self) -> Bin:
        if self.weights and len(self.weights) != len(self.shares):
            rule = f"there is one for each of {len(self.shares)} realizations"
            raise Refused(rule, "export it again", "weights", f"{len(self.weights)}")
        return self

    @property
    def share(self) -> float:
        """The mean of the columns."""
        return float(np.average(self.shares, weights=self.weights or None))

    @property
    def number(self) -> float:
        """Mean number of earthquakes in the years of their probabilities; infinite of a sure one.

        Of ten times as many years a bin has ten times the earthquakes, and not ten times the
        chance.
        """
        with np.errstate(divide="ignore"):
            each = -np.log1p(-np.array(self.shares))
        return float(np.average(each, weights=self.weights or None))


class Edges(Row):
    """Borders of the bins of a disaggregation, as its first line tells them."""

    mag: tuple[float, ...] = Field(min_length=2, description="magnitudes between bins")
    dist: tuple[float, ...] = Field(min_length=2, description="distances between bins [km]")


def load_disaggregation(path: Path) -> Disaggregation:
    """Read a disaggregation by magnitude and distance."""
    found: list[Bin] = []
    unused: list[str] = []
    told = check_calculation(path, disaggregation_files(path))
    place = checked(path, Place, told, text=True) if {"lon", "lat"} <= told.keys() else None
    for file in disaggregation_files(path):
        of_pga, others = _bins(file)
        found += of_pga
        unused += others
    bins = pd.DataFrame(
        [(row.iml, row.mag, row.dist, row.share, row.number, row.poe, row.years) for row in found],
        columns=["iml", "mag", "dist", "share", "number", "poe", "years"],
    )
    _check(path, bins)
    unused += _other_wholes(bins)
    together = _together(bins)
    if not together.isna().all():
        _require_doubt(path, bins["number"])
        bins = bins.assign(share=bins["number"])
    grid = bins.groupby(["iml", "mag", "dist"])["share"].sum().unstack(["mag", "dist"])
    if (bins["share"] == 0.0).any() and grid.isna().any(axis=None):
        rule = "a file that holds empty bins holds all"
        raise refused(path, "mag, dist", "bins that are missing", rule)
    grid = grid.fillna(0.0)
    if empty := int((grid.sum(axis=1) == 0.0).sum()):
        unused.append(f"{counted(empty, 'disaggregated level')} that nothing exceeds left out")
    grid = grid[grid.sum(axis=1) > 0.0]
    magnitudes, distances = (
        grid.columns.get_level_values(name).to_numpy(dtype=np.float64) for name in ("mag", "dist")
    )
    values = grid.to_numpy()
    levels = UNITS["PGA"] * grid.index.to_numpy(dtype=np.float64)
    shares = values / values.sum(axis=1, keepdims=True)
    poe = bins.groupby("iml")["poe"].max().where(lambda told: told > 0.0, together)
    years = bins.groupby("iml")["years"].max()
    rates = (-np.log1p(-poe.where(poe < 1.0)) / years).loc[grid.index].to_numpy(dtype=np.float64)
    location = None if place is None else (place.lon, place.lat)
    return Disaggregation(magnitudes, distances, levels, shares, rates, location, tuple(unused))


def _check(path: Path, bins: pd.DataFrame) -> None:
    """Refuse bins that stand twice, levels of two probabilities, and files without a share."""
    if len(twice := bins[bins.duplicated(["iml", "mag", "dist"])]):
        given = "{:g} g, M {:g}, {:g} km in two files".format(*twice.iloc[0, :3])
        remedy = "name one of them in hazard.disaggregation"
        raise refused(path, "iml, mag, dist", given, "a bin is in one file", remedy)
    poes = bins.groupby("iml")["poe"].agg(["min", "max"]).reset_index()
    if len(odd := poes[poes["min"] < poes["max"]]):
        level, least, most = odd.iloc[0]
        given = f"{f'{least:g}' if least else 'none'} and {most:g} at {level:g} g"
        raise refused(path, "poe", given, "bins of a level share its poe", "export it again")
    if not bins["share"].sum() > 0.0:
        rule = "OpenQuake's is named Mag_Dist-mean-0_1.csv and has rows of PGA"
        remedy = "export it, or leave disaggregation out"
        raise refused(path, "imt", "no disaggregation of PGA", rule, remedy)


def _together(bins: pd.DataFrame) -> pd.Series[float]:
    """Probability that an earthquake of any bin exceeds a level, by level.

    NaN of conditional ("traditional") shares, whose sum is 1 at each level.
    """
    shares = bins.groupby("iml")["share"]
    sums = shares.sum()
    conditional = ((sums == 0.0) | ((sums - 1.0).abs() <= SUM)).all()
    return shares.agg(lambda part: np.nan if conditional else 1.0 - np.prod(1.0 - part))


def _require_doubt(path: Path, numbers: pd.Series[float]) -> None:
    """Refuse a bin of an earthquake that is sure, of which there may be any number."""
    if np.isinf(numbers).any():
        rule, remedy = "it is below 1, or has no rate", "export it for fewer years"
        raise refused(path, "poe", "a bin of a probability of 1", rule, remedy)


def _other_wholes(bins: pd.DataFrame) -> Iterator[str]:
    """Levels whose bins together have another probability than they state, in words."""
    for level, whole in _together(bins).items():
        poe = float(bins.loc[bins["iml"] == level, "poe"].iloc[0])
        if poe and not 1.0 / WHOLE <= whole / poe <= WHOLE and whole == whole:
            said = f"bins of {level:g} g have a probability of {whole:.3g} together"
            yield f"{said}, and a poe of {poe:.3g}: one is wrong, or bins leave earthquakes out"


def _bins(path: Path) -> tuple[list[Bin], list[str]]:
    """Rows of PGA, and what else the file holds, in words."""
    lines = text(path)
    if lines.lstrip('"').startswith("#") and not lines.endswith(("\n", "\r")):
        raise refused(path, "", "a last line without its end", "OpenQuake ends each line")
    cells, first = table(path, lines), lines.partition("\n")[0]
    names = list(cells[0]) if cells else [*_COLUMNS]
    if "imt" not in names:
        raise refused(path, "imt", "no such column", f"there are {', '.join(_COLUMNS)}")
    shares = _shares(path, names)
    told = _WEIGHTS.search(first)
    weights = told[1].split(",") if told and any(name.startswith("rlz") for name in shares) else []
    known = {*_COLUMNS, "poe"}
    years = {"years": stated[1]} if (stated := YEARS.search(first)) else {}
    of_pga = [
        {name: cell for name, cell in row.items() if name in known and (name, cell) != _NO_POE}
        | {"shares": [row[name] for name in shares], "weights": weights, **years}
        for row in cells
        if row["imt"] == "PGA"
    ]
    found = rows(path, Bin, of_pga, once=("iml", "mag", "dist"))
    if "OpenQuake" in first:  # which writes six digits
        check_digits(path, [cell for row in of_pga for cell in row["shares"]])
    unused = [
        f"column {name} of {path.name} left out, as others count"
        for name in names
        if name not in known and name not in shares
    ]
    if absent := _absent(path, first, found):
        unused.append(f"{counted(absent, 'bin')} of PGA not in {path.name} taken as empty")
    if others := len(cells) - len(found):
        unused.append(f"{counted(others, 'row')} of other measures in {path.name} left out")
    unused += _other_weights(path, shares, found)
    if len(shares) > 1 and not weights:
        unused.append(f"realizations of {path.name} count alike, as its first line has no weights")
    return found, unused


def _other_weights(path: Path, names: list[str], found: list[Bin]) -> Iterator[str]:
    """Weights that are in another order than the realizations, or of some, in words."""
    numbers = [int(name.lstrip("rlz-")) for name in names if name.startswith("rlz")]
    if len({*numbers}) < len(numbers):
        given, rule = f"{listed(names)}", "a realization has one column"
        raise refused(path, "rlz", given, rule, "export it again")
    weights = found[0].weights if found else ()
    if weights and numbers != sorted(numbers):
        yield f"weights of {path.name} are taken in the order of its columns, {listed(names)}"
    if weights and (total := sum(weights)) > 1.0 + SUM:
        rule, remedy = "they sum to 1 at most", "export it again"
        raise refused(path, "weights", f"a sum of {total:g}", rule, remedy)
    if weights and total < 1.0 - SUM:
        yield f"weights of {path.name} sum to {total:g}, and count as shares of that"


def _shares(path: Path, names: list[str]) -> list[str]:
    """Columns of shares that count: of the mean, or else of realizations, or else the only one."""
    own = [name for name in names if name not in (*_COLUMNS, "poe")]
    remedy = "export Mag_Dist, of the mean"
    if strange := [name for name in own if not _STATISTIC.fullmatch(name)]:
        rule = "there are imt, iml, poe, mag, dist, and mean, or rlz0 and so on"
        raise refused(path, strange[0], "the column", rule, remedy)
    for kind in ("mean", "rlz"):
        if found := [name for name in own if name.startswith(kind)]:
            return found
    if len(own) > 1 or any(not name.startswith("poe") for name in own):
        rule = "shares are of the mean or of realizations"
        raise refused(path, "mean", f"{listed(own)} alone", rule, remedy)
    return own


def _absent(path: Path, first: str, found: list[Bin]) -> int:
    """Number of bins of the first line that have no row; no other row is there."""
    told = dict(_EDGES.findall(first))
    if len(told) < 2:
        return 0
    cut = {name: edges.split(",") for name, edges in told.items()}
    edges = checked(path, Edges, cut, text=True)
    for name, along in (("mag", np.array(edges.mag)), ("dist", np.array(edges.dist))):
        middles, widths = 0.5 * (along[1:] + along[:-1]), np.diff(along)
        for value in sorted({getattr(row, name) for row in found}):
            near = int(np.abs(middles - value).argmin())
            if not abs(middles[near] - value) <= MIDDLE * widths[near]:
                rule = f"by its first line the nearest is at {middles[near]:g}"
                raise refused(path, name, f"a bin at {value:g}", rule)
    whole = (len(edges.mag) - 1) * (len(edges.dist) - 1)
    numbers = Counter(row.iml for row in found).values()
    if any(0.0 in row.shares for row in found) and {*numbers} != {whole}:
        given = f"{min(numbers)} bins at a level"
        raise refused(path, "mag, dist", given, f"by its first line they are {whole}")
    return sum(whole - number for number in numbers)
