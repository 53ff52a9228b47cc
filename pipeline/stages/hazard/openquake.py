"""Hazard curves of OpenQuake: exported to CSV by present and older versions, or as it stores them.

A CSV file has the curves of one realization and one measure. Its first line gives the years of the
probabilities, ``investigation_time=50.0``, and the measure, ``imt='PGA'``; its second names the
columns ``lon, lat, depth, poe-0.005, ...`` (older: ``lon:float32, ..., PGA-0.005:float32``), and
each further line is a site. Peak accelerations are in g, velocities in cm/s. The weights are in
``realizations_1.csv``.

In ``calc_N.hdf5``, ``hcurves-rlzs`` holds probabilities of exceedance for each site, realization,
measure and level; ``oqparam`` the levels and the years.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config.outside import (
    check_file,
    check_hdf5,
    checked,
    opened,
    refused,
    rows,
    table,
    text,
)
from pipeline.stages.hazard.calculation_file import (
    check_sites,
    described,
    number_of,
    numbers,
    paths_of,
    reading,
    settings_of,
    weights_of,
)
from pipeline.stages.hazard.hazard_model import (
    MEAN,
    UNITS,
    GivenCurve,
    HazardModel,
    Realization,
    check_digits,
    held,
    model,
)
from pipeline.workflow.grammar import listed
from vsr_core.arrays import Array

SUFFIXES = (".hdf5", ".h5")

_STORED, _STATISTICS = "hcurves-rlzs", "hcurves-stats"
_NAME = re.compile(r"hazard_curve-(mean|rlz-(\d+))-(\w+?)(?:_\d+)?\.csv")
STATED = r"\s*=\s*((?:[^\s,'\"]|,(?=\d))+)"
"""What a first line says of a name, with a decimal comma, which is no number."""

YEARS = re.compile(rf"\binvestigation_time{STATED}")
_MEASURE = re.compile(r"imt\s*=\s*['\"]*([A-Za-z]+(?:\([^)]*\))?)")
_KINDS = r"(?:mean|max|std|quantile|rlz)[\w.-]*"
_KIND = re.compile(rf"(?:^[#\",\s]*(?={_KINDS}\s*,)|kind\s*=\s*['\"]*)([\w.-]+)")
"""What a curve is of, by name, or older: first of all, ``# rlz-000, investigation_time=50.0``."""

_LEVEL = re.compile(r"([A-Za-z]\w*(?:\([^)]*\))?)-(.+)")
_PLACES = ("lon", "lat", "depth", "custom_site_id", "site_id")

_MOST_BRANCHES = 20_000
"""Realizations, which take two minutes of computing until their page."""

_MOST_LEVELS = 5_000_000
"""Levels of PGA and PGV of all realizations, which are checked one by one."""

_HEAD = 10_000
"""Characters in which a first line ends, and comments would follow it."""

_LARGEST = 64 * 1024**3
"""Bytes of a calculation, of whose arrays only some are read."""

_WEIGHTS = "realizations*.csv"

_NUMBER = re.compile(r"_(\d+)\.csv")
_SAID = {
    "checksum": re.compile(r"\bchecksum\s*=\s*(\d+)"),
    "lon": re.compile(r"\blon\s*=\s*([^\s,'\"]+)"),
    "lat": re.compile(r"\blat\s*=\s*([^\s,'\"]+)"),
}
"""What a first line says of its calculation, and of the site where it has one only."""

_OFF, _EXACT, _TINY = 2e-3, 1e-4, 1e-7
"""How far a mean curve may be from the mean of the realizations, as weights have few digits, or in
OpenQuake's own file, where all have seven; and besides in probability, as older files have seven
decimals."""

_OLDER = {"ordinal": "rlz_id"}


def is_there(folder: Path) -> bool:
    """Whether a folder has such curves."""
    return any(_NAME.fullmatch(path.name) for path in folder.iterdir())


def files(folder: Path) -> list[Path]:
    """The files of curves of PGA and PGV, and of their weights."""
    curves = [path for path, _ in _named(folder)]
    return [*curves, *sorted(folder.glob(_WEIGHTS))] if curves else []


def load(folder: Path) -> HazardModel:
    """All realizations of a folder, or the mean curve where there are none."""
    curves, unused = _curves(folder), list[str]()
    if not any(measure == "PGA" for _, measure in curves):
        rule, remedy = "the probability of toppling is for PGA", "export the curves of PGA"
        raise refused(folder, "imt", "no curves of PGA", rule, remedy)
    if all(number == MEAN for number, _ in curves):
        check_calculation(folder, (path for path, _ in curves.values()))
        of_weights = sorted(folder.glob(_WEIGHTS))
        unused += [f"{path.name} left out, as the mean is the only curve" for path in of_weights]
        mean = Realization(rlz_id=MEAN, branch_path="the mean", weight=1.0)
        return model(folder, curves, [mean], *unused, *held(curves))
    weights = realizations(folder)
    check_calculation(folder, files(folder))
    if {number for number, measure in curves if measure == "PGV"} == {MEAN}:
        unused.append("the mean curve of PGV left out, as no realization has one")
    numbers = {number for number, measure in curves if number != MEAN and measure == "PGA"}
    if incomplete := numbers ^ {row.rlz_id for row in weights}:
        given = f"realization {min(incomplete)} without curve or weight"
        rule = "each has a curve of PGA and a weight in realizations_1.csv"
        raise refused(folder, "rlz_id", given, rule, "export both from one calculation")
    unused += [*_other_means(curves, weights, _OFF), *held(curves)]
    return model(folder, curves, sorted(weights, key=lambda row: row.rlz_id), *unused)


def _other_means(
    curves: dict[tuple[int, str], tuple[Path, GivenCurve]], rows: list[Realization], most: float
) -> Iterator[str]:
    """Mean curves that are not of the realizations, by probabilities or rates, in words.

    Parameters
    ----------
    most : float, share by which they may be off
    """
    weights = np.array([row.weight for row in rows])
    weights /= weights.sum() or 1.0  # of none it is refused later
    for path, mean in (curves[key] for key in curves if key[0] == MEAN):
        each = [curves.get((row.rlz_id, mean.measure), (path, None))[1] for row in rows]
        given = [one.values for one in each if one and len(one.values) == len(mean.values)]
        if len(given) < len(rows):
            continue  # without realizations, or refused for its levels
        told, poes = np.array(mean.values), np.array(given)
        means = weights @ poes, -np.expm1(weights @ np.log1p(-np.minimum(poes, 1.0 - _TINY)))
        off = min(float(((abs(one - told) - _TINY) / (told + _TINY)).max()) for one in means)
        if off > most:
            yield (
                f"the mean of {mean.measure} in {path.name} is up to {100.0 * off:.3g} % off the "
                "mean of the realizations, which count: a curve or a weight may be of another "
                "calculation"
            )


def check_calculation(folder: Path, paths: Iterable[Path]) -> dict[str, str]:
    """Refuse files of several calculations, by the numbers of their names and by first lines.

    Returns
    -------
    dict, of what these say, ``checksum``, ``lon`` and ``lat``
    """
    said: dict[str, dict[str, str]] = {}
    for path in paths:
        with opened(path, _LARGEST) as file:
            head = file.read(_HEAD).decode("utf-8", "replace")
        _check_stated_once(path, head)
        first = head.split("\n", 1)[0]
        told = {what: pattern.search(first) for what, pattern in _SAID.items()}
        for what, one in {"number": _NUMBER.search(path.name), **told}.items():
            if one:
                said.setdefault(what, {}).setdefault(one[1], path.name)
    for what, kinds in said.items():
        if len(kinds) > 1:
            given = listed([f"{kind} of {kinds[kind]}" for kind in sorted(kinds)[:2]])
            rule, remedy = "all are of one calculation and site", "export them from the same one"
            raise refused(folder, what, given, rule, remedy)
    return {what: next(iter(kinds)) for what, kinds in said.items()}


def load_calculation(path: Path) -> HazardModel:
    """All realizations of OpenQuake's own file of a calculation."""
    import h5py

    check_file(path, _LARGEST)
    check_hdf5(path)
    rule = "it is a classical calculation of OpenQuake with individual_rlzs = true"
    with reading(path, _STORED, rule), h5py.File(path) as file:
        settings, levels = settings_of(file)
        poes, lon, lat = (numbers(file[name]) for name in (_STORED, "sitecol/lon", "sitecol/lat"))
        measures = described(file[_STORED], "rlz_id")["imt"]
        sites, number, of_measures, length = poes.shape
        if type(measures) is not list or not len(measures) == len(set(measures)) == of_measures:
            raise ValueError(f"{of_measures} curves of {measures}")
        weights = weights_of(file)
        if len(weights) != number:
            raise ValueError(f"{len(weights)} weights of {number} realizations")
        paths = paths_of(file, settings, weights)
        years = number_of(settings["investigation_time"])
        known = {name: [number_of(level) for level in levels[name]] for name in measures}
        mean = _mean(file, poes.shape)
    check_sites(path, sites, lon.size, lat.size)
    if number > _MOST_BRANCHES:
        given, rule = f"{number:,} realizations", f"there are at most {_MOST_BRANCHES:,}"
        raise refused(path, _STORED, given, rule, "sample the logic tree, or export the mean curve")
    if "PGA" not in measures:
        given, rule = f"curves of {', '.join(measures)}", "the probability of toppling is for PGA"
        raise refused(path, "imt", given, rule, "calculate PGA too")
    used = [name for name in measures if name in UNITS]
    if (count := number * len(used) * length) > _MOST_LEVELS:
        given, rule = f"{count:,} values of PGA and PGV", f"at most {_MOST_LEVELS:,} are read"
        raise refused(path, _STORED, given, rule, "calculate fewer levels, or sample the tree")
    place = {"years": years, "lon": lon.item(), "lat": lat.item()}
    curves = {}
    values = poes[0][:, [measures.index(name) for name in used]].tolist()
    for at, of_branch in enumerate(values):
        for measure, own in zip(used, of_branch, strict=True):
            one = {"measure": measure, "levels": known[measure], "values": own}
            curves[at, measure] = path, checked(path, GivenCurve, place | one)
    if mean is not None:
        for measure in used:
            own = mean[measures.index(measure)].tolist()
            one = {"measure": measure, "levels": known[measure], "values": own}
            curves[MEAN, measure] = path, checked(path, GivenCurve, place | one)
    branches = [
        checked(path, Realization, {"rlz_id": at, "branch_path": name, "weight": weight})
        for at, (name, weight) in enumerate(zip(paths, weights.tolist(), strict=True))
    ]
    told = (*_other_means(curves, branches, _EXACT), *held(curves))
    return model(path, curves, branches, *told)


def _mean(file: Any, shape: tuple[int, ...]) -> Array | None:
    """The mean curves of a calculation of one site by measure and level, where it has them."""
    if _STATISTICS not in file:
        return None
    values = numbers(file[_STATISTICS])
    names = described(file[_STATISTICS], "stat")["stat"]
    sites, _, measures, levels = shape
    if values.shape != (sites, len(names), measures, levels):
        raise ValueError(f"{_STATISTICS} of {values.shape} beside {_STORED} of {shape}")
    return np.array(values[0, names.index("mean")]) if "mean" in names else None


_COMMENT = re.compile(r"^[ \t\"]*#.*", re.MULTILINE)
_KEY = re.compile(
    r"\b(investigation_time|ses_per_logic_tree_path|imt|kind|checksum|lon|lat|weights|\w+_bin_edges)"
    r"\s*=\s*(\[[^\[\]]*\]|[^\s,\[]*)"
)
"""What is read of comments, the first line among them, and its value."""


def _check_stated_once(path: Path, lines: str) -> None:
    """Refuse comments that state a thing twice, and otherwise."""
    said: dict[str, str] = {}
    for key, value in (found for one in _COMMENT.findall(lines) for found in _KEY.findall(one)):
        own = value.strip("\"'")
        if said.setdefault(key, own) != own:
            given, rule = f"{said[key]} and {own}", "the first line states it"
            raise refused(path, key, given[:100], rule, "export it again")


def _curves(folder: Path) -> dict[tuple[int, str], tuple[Path, GivenCurve]]:
    """Curves by number of the realization, or of the mean, and measure."""
    found: dict[tuple[int, str], tuple[Path, GivenCurve]] = {}
    for path, name in _named(folder):
        key = MEAN if name[2] is None else int(name[2]), name[3]
        if key in found:
            given = f"the curve that is in {found[key][0].name} too"
            raise refused(path, "", given, "a folder holds one calculation", "remove one")
        found[key] = path, _curve(path, name[1], name[3])
    return found


def _named(folder: Path) -> Iterator[tuple[Path, re.Match[str]]]:
    """Files of curves of PGA and PGV, and what their names say."""
    for path in sorted(folder.glob("hazard_curve-*.csv")):
        if (name := _NAME.fullmatch(path.name)) and name[3] in UNITS:
            yield path, name


def _curve(path: Path, kind: str, measure: str) -> GivenCurve:
    lines = text(path)
    header = _header(lines)
    _check_stated_once(path, lines)
    if (years := YEARS.search(header)) is None:
        rule = "the first line gives the years of the probabilities"
        raise refused(path, "investigation_time", "nothing", rule)
    for key, pattern, named in (("imt", _MEASURE, measure), ("kind", _KIND, kind)):
        if (stated := pattern.search(header)) and stated[1] != named:
            rule = f"the file name says {named}"
            raise refused(path, key, stated[1], rule, "rename the file, or export it again")
    sites = table(path, lines, _untyped)
    if len(sites) != 1:
        given = f"{len(sites)} sites"
        rule, remedy = "all curves are of one site", "export the curves of the rock's site only"
        raise refused(path, "lon, lat", given, rule, remedy)
    cells = sites[0]
    levels = {name: found for name in cells if (found := _LEVEL.fullmatch(name))}
    for name in cells:
        of = levels[name][1] if name in levels else ""
        if name not in _PLACES and of not in ("poe", measure):
            rule = f"the columns are lon, lat, depth, and poe-0.1 for a level of {measure}"
            raise refused(path, name, "the column", rule)
    curve = checked(
        path,
        GivenCurve,
        {
            "measure": measure,
            "years": years[1],
            **{name: cells[name] for name in _PLACES[:3] if cells.get(name)},
            "place": " ".join(cells[name] for name in _PLACES[3:] if name in cells),
            "levels": [found[2] for found in levels.values()],
            "values": [cells[name] for name in levels],
        },
        text=True,
    )
    check_digits(path, [cells[name] for name in levels])
    return curve


def realizations(folder: Path) -> list[Realization]:
    """Path and weight of each realization."""
    files = sorted(folder.glob(_WEIGHTS))
    if len(files) != 1:
        given = f"{len(files)} files realizations*.csv"
        rule, remedy = "one file has the weights", "export it from the same calculation"
        raise refused(folder, "realizations", given, rule, remedy)
    (path,) = files
    cells = table(path, text(path), lambda name: _OLDER.get(_untyped(name), _untyped(name)))
    return rows(path, Realization, cells, once=("rlz_id",))


def _untyped(name: str) -> str:
    """Name of a column, ``poe-0.005:float32`` without the type of its numbers."""
    return re.sub(r":[^\d.].*", "", name)


def _header(lines: str) -> str:
    first = lines.split("\n", 1)[0]
    return first if first.lstrip('"').startswith("#") else ""
