"""A folder of recorded shake-table tests: records, outcomes, scans, and what is assumed of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr
from pandas.api.types import is_numeric_dtype

from pipeline.config import in_si
from pipeline.config.layers import Origin, Site, load_file
from pipeline.config.paths import located, shown
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.config.sections import LARGEST_PGA, LONGEST_PULSE, SHORTEST_PULSE, SMALLEST_PGA
from pipeline.stages.mesh import mesh_files
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import Input
from vsr_core.errors import InvalidInput, reason
from vsr_core.motions.records.record import check_sampling
from vsr_core.rock.solid import checked

if TYPE_CHECKING:
    import trimesh

RECORDS, OUTCOMES, ASSUMED = "records.nc", "outcomes.csv", "table.yaml"

SCAN = re.compile(r"sp(\d+)\.ply")

LIMITS = {"pga_g": (SMALLEST_PGA, LARGEST_PGA), "pgv_pga_s": (SHORTEST_PULSE, LONGEST_PULSE)}
"""Of columns of the outcomes."""

PUBLISHED = re.compile(r"(?P<name>[a-z]+)_s(?P<specimen>\d+)_(?P<setting>\w+)")
"""A column of someone's predictions for a specimen, such as dem_s1_kn10."""


@dataclass(frozen=True, eq=False)
class Tests:
    """What a folder holds.

    Attributes
    ----------
    pga, pgv_pga : tuple of float [g], [s]
    published : dict from (specimen, predictor) to predictions, 1 for overturned
    interval : float [s], between samples
    """

    number: tuple[int, ...]
    motion: tuple[str, ...]
    pga: tuple[float, ...]
    pgv_pga: tuple[float, ...]
    observed: dict[int, tuple[int, ...]]
    published: dict[tuple[int, str], tuple[int, ...]]
    interval: float
    specimens: tuple[int, ...]
    config: ShakeTableConfig = field(repr=False)


def site_of(folder: Path) -> Site:
    """A site for the tests in a folder, so that its products have their place."""
    folder = located(Path.cwd(), str(folder), "--table", "")
    if not folder.is_dir():
        raise not_found("--table", "", shown(folder))
    for name in (RECORDS, OUTCOMES):
        if not (folder / name).is_file():
            raise _problem(folder / name, "", "", "file not found", "put it there")
    if not scans_in(folder):
        raise _problem(
            folder, "", "no scan", "there is one for each specimen", "call it sp1.ply, in metres"
        )
    return Site(name=folder.name, file=shown(folder), path=folder, settings=assumptions(folder))


@dataclass(frozen=True)
class Folder(Input):
    """A folder of tests, and the files in it that count."""

    path: Path

    def digests(self) -> dict[str, str]:
        """Digests of the files, by their names."""
        names = [RECORDS, OUTCOMES, ASSUMED, *(scan.name for scan in scans_in(self.path).values())]
        paths = [self.path / name for name in names]
        return {path.name: digest_file(path) for path in paths if path.is_file()}


def find(origin: Origin) -> Folder:
    """The tests that a site stands for."""
    return Folder(origin.folder)


def scans_in(folder: Path) -> dict[int, Path]:
    """Scans by the number of their specimen."""
    found = {
        m: path
        for path in folder.glob("sp*.ply")
        if (m := SCAN.fullmatch(path.name)) and path.is_file()
    }
    return {
        int(match[1]): path for match, path in sorted(found.items(), key=lambda p: int(p[0][1]))
    }


def assumptions(folder: Path) -> ShakeTableConfig:
    """What is assumed of the tests in a folder; the defaults where it says nothing."""
    path = folder / ASSUMED
    if not path.is_file():
        return ShakeTableConfig()
    return load_file(str(path), folder, "table", ShakeTableConfig)[0]


def scan(path: Path) -> trimesh.Trimesh:
    """A closed scan of a specimen in metres."""
    try:
        return checked(mesh_files.read(path))[0]
    except InvalidInput as error:
        raise InputError.from_invalid(shown(path), "", error) from None


def tests_in(folder: Path) -> Tests:
    """The tests of a folder that have both a record and a row of outcomes."""
    path = folder / OUTCOMES
    table = _outcomes(path)
    known, interval = _recorded(folder)
    table = table[table["test"].isin(known)].drop_duplicates("test").sort_values("test")
    if not len(table):
        raise _problem(path, "test", "no test with a record", "some have one", "number them alike")
    specimens = tuple(scans_in(folder))
    observed = {
        number: _flags(path, table, f"specimen{number}")
        for number in specimens
        if f"specimen{number}" in table
    }
    published = {
        (int(match["specimen"]), f"{match['name']} {match['setting']}"): _flags(path, table, name)
        for name in table.columns
        if (match := PUBLISHED.fullmatch(str(name)))
    }
    return Tests(
        tuple(map(int, table["test"])),
        tuple(map(str, table["ground_motion"])),
        tuple(map(float, table["pga_g"])),
        tuple(map(float, table["pgv_pga_s"])),
        observed,
        published,
        round(interval, 9),
        specimens,
        assumptions(folder),
    )


@lru_cache(maxsize=2)
def accelerations(folder: Path, variable: str | None) -> dict[int, Any]:
    """Accelerations of the table by test, ndarrays of shape (n,) [m/s^2].

    Parameters
    ----------
    variable : str or None
        Its name in the records; by default the merged one, else that of the accelerometer.
    """
    path = folder / RECORDS
    with _records(folder) as records:
        name = variable or (
            "acceleration_merged" if "acceleration_merged" in records else "acceleration"
        )
        if name not in records:
            raise _problem(path, name, "nothing", "the variable is there", "name another")
        if set(records[name].dims) != {"test", "time"} or records[name].dtype.kind not in "iuf":
            given, rule = "no table of numbers", "it holds numbers by test and time"
            raise _problem(path, name, given, rule, "name another")
        values = records[name].transpose("test", "time").values
        counts, numbers = records["n_samples"].values, records["test"].values
    found = {}
    for number, count, row in zip(numbers, counts, values, strict=True):
        if not np.isfinite(row[: int(count)]).all():
            given = f"values that are no numbers in test {int(number)}"
            raise _problem(path, name, given, "they are numbers", "mend or drop the test")
        peak = float(np.abs(row[: int(count)]).max())
        if not in_si.acceleration(SMALLEST_PGA) <= peak <= in_si.acceleration(LARGEST_PGA):
            given = f"a peak of {peak:.3g} m/s2 in test {int(number)}"
            rule = f"it is {SMALLEST_PGA:g} to {LARGEST_PGA:g} g"
            raise _problem(path, name, given, rule, "correct the unit, or drop the test")
        found[int(number)] = np.array(row[: int(count)], dtype=np.float64)
    return found


def _outcomes(path: Path) -> pd.DataFrame:
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        given = f"a file that cannot be read ({reason(error)})"
        raise _problem(path, "", given, "it is a table in CSV", "correct it") from None
    for name in ("test", "ground_motion", "pga_g", "pgv_pga_s"):
        if name not in table.columns:
            raise _problem(path, name, "nothing", "the column is there", "add it")
        if name == "ground_motion":
            continue
        if not is_numeric_dtype(table[name]) or not np.isfinite(table[name]).all():
            given, rule = "values that are no numbers", "they are numbers"
            raise _problem(path, name, given, rule, "correct the column")
        low, high = LIMITS.get(name, (-np.inf, np.inf))
        if not table[name].between(low, high).all():
            given = f"{table[name].min():g} to {table[name].max():g}"
            raise _problem(path, name, given, f"it is {low:g} to {high:g}", "correct the unit")
    return table


def _recorded(folder: Path) -> tuple[set[int], float]:
    """Numbers of the tests that have a record, and its time step [s]."""
    path = folder / RECORDS
    with _records(folder) as records:
        for name in ("test", "time", "n_samples"):
            values = records.variables.get(name)
            if values is None:
                raise _problem(path, name, "nothing", "the variable is there", "add it")
            if values.dtype.kind not in "iuf" or not np.isfinite(values).all():
                given, rule = "values that are no numbers", "they are numbers"
                raise _problem(path, name, given, rule, "correct them")
        known = {int(number) for number in records["test"].values.ravel()}
        time, counts = (records[name].values.ravel() for name in ("time", "n_samples"))
    if len(known) < len(counts):
        rule, remedy = "a test has one record", "number them anew"
        raise _problem(path, "test", "a number twice", rule, remedy)
    if not len(counts) or not 2 <= counts.min() <= counts.max() <= len(time):
        rule = f"each test has from 2 to {len(time)}, as there are times"
        raise _problem(path, "n_samples", "other numbers of samples", rule, "correct them")
    interval = float(time[1] - time[0])
    try:
        check_sampling(interval, counts.max())
    except InvalidInput as error:
        raise InputError.from_invalid(shown(path), "time", error) from None
    return known, interval


def _records(folder: Path) -> xr.Dataset:
    try:
        return xr.open_dataset(folder / RECORDS, decode_times=False)
    except (OSError, ValueError, RuntimeError) as error:
        given = f"a file that cannot be read ({reason(error)})"
        raise _problem(folder / RECORDS, "", given, "it is NetCDF", "correct it") from None


def _flags(path: Path, table: Any, name: str) -> tuple[int, ...]:
    values = tuple(table[name])
    if any(value not in (0, 1) for value in values):
        raise _problem(
            path, name, "values other than 0 and 1", "1 is overturned, 0 not", "correct the column"
        )
    return tuple(map(int, values))


def _problem(path: Path, key: str, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(shown(path), key, given, rule, remedy))
