"""A folder of shake-table tests: motions, outcomes, scans, and what is assumed of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from pipeline.config.layers import Origin, Site, load_file
from pipeline.config.paths import located, shown
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.problems import InputError, not_found
from pipeline.config.sections import LARGEST_PGA, LONGEST_PULSE, SHORTEST_PULSE, SMALLEST_PGA
from pipeline.stages.mesh import mesh_files
from pipeline.stages.studies.validation.table_motions import (
    RECORDS,
    commanded,
    motions,
    problem,
    recorded,
)
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import Input
from vsr_core.arrays import Mask
from vsr_core.errors import InvalidInput, reason
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.rock.solid import checked
from vsr_core.table.stepper import Stepper

if TYPE_CHECKING:
    import trimesh

OUTCOMES, ASSUMED = "outcomes.csv", "table.yaml"

SCAN = re.compile(r"sp(\d+)\.ply")

LIMITS = {
    "pga_g": (SMALLEST_PGA, LARGEST_PGA),
    "pgv_pga_s": (SHORTEST_PULSE, LONGEST_PULSE),
    "azimuth_deg": (-360.0, 360.0),
}
"""Of columns of the outcomes."""

PUBLISHED = re.compile(r"(?P<name>[a-z]+)_s(?P<specimen>\d+)_(?P<setting>\w+)")
"""A column of someone's predictions for a specimen, such as dem_s1_kn10."""


@dataclass(frozen=True, eq=False)
class Tests:
    """What a folder holds.

    Attributes
    ----------
    pga, pgv_pga : tuple of float [g], [s]
    azimuth : tuple of float [degree]
        Of the drive in each test, from the scan's +x, counter-clockwise; None where none is given.
    series : tuple of str, name of the series that each test is of
    observed : dict from specimen to outcomes, 1 for overturned, -1 where none is given
    published : dict from (specimen, predictor) to predictions, 1 for overturned
    """

    number: tuple[int, ...]
    motion: tuple[str, ...]
    pga: tuple[float, ...]
    pgv_pga: tuple[float, ...]
    azimuth: tuple[float | None, ...]
    series: tuple[str, ...]
    observed: dict[int, tuple[int, ...]]
    published: dict[tuple[int, str], tuple[int, ...]]
    specimens: tuple[int, ...]
    config: ShakeTableConfig = field(repr=False)

    def only(self, chosen: Mask) -> Tests:
        """Some of the tests.

        Parameters
        ----------
        chosen : ndarray of bool, shape (tests,)
        """

        def part(values: Any) -> Any:
            if isinstance(values, dict):
                return {key: part(one) for key, one in values.items()}
            return tuple(compress(values, chosen))

        names = ("number", "motion", "pga", "pgv_pga", "azimuth", "series", "observed", "published")
        return replace(self, **{name: part(getattr(self, name)) for name in names})


def site_of(folder: Path) -> Site:
    """A site for the tests in a folder, so that its products have their place."""
    folder = located(Path.cwd(), str(folder), "--table", "")
    if not folder.is_dir():
        raise not_found("--table", "", shown(folder))
    if not (folder / OUTCOMES).is_file():
        raise problem(folder / OUTCOMES, "", "", "file not found", "put it there")
    if not scans_in(folder):
        raise problem(
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
    """The tests of a folder: of its table of outcomes, those with a record if there are records."""
    path = folder / OUTCOMES
    table = _outcomes(path)
    if (folder / RECORDS).is_file():
        table = table[table["test"].isin(recorded(folder)[0])]
        if not len(table):
            rule, remedy = "some have one", "number them alike"
            raise problem(path, "test", "no test with a record", rule, remedy)
    table = table.sort_values("test")
    specimens = tuple(scans_in(folder))
    observed = {
        number: _flags(path, table, f"specimen{number}", missing=True)
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
        tuple(map(float, table["azimuth_deg"])) if "azimuth_deg" in table else (None,) * len(table),
        tuple(map(str, table["series"])),
        observed,
        published,
        specimens,
        assumptions(folder),
    )


@lru_cache(maxsize=2)
def motions_of(folder: Path) -> dict[int, GroundMotion]:
    """How the table moved in each test."""
    if (folder / RECORDS).is_file():
        return motions(folder, assumptions(folder).acceleration)
    tests = tests_in(folder)
    told = tests.config.stepper
    stepper = Stepper(told.rate, told.step, told.overhead) if told else None
    rows = zip(tests.number, tests.pga, tests.pgv_pga, strict=True)
    return {number: commanded(pga, ratio, stepper) for number, pga, ratio in rows}


def _outcomes(path: Path) -> pd.DataFrame:
    """The table as it is, with columns for azimuth and series, and a name for each motion."""
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        given = f"a file that cannot be read ({reason(error)})"
        raise problem(path, "", given, "it is a table in CSV", "correct it") from None
    if "ground_motion" not in table and {"pga_g", "pgv_pga_s"} <= set(table):
        rows = zip(table["pga_g"], table["pgv_pga_s"], strict=True)
        table["ground_motion"] = [f"{pga} g, {ratio} s" for pga, ratio in rows]
    for name in ("test", "pga_g", "pgv_pga_s"):
        if name not in table.columns:
            raise problem(path, name, "nothing", "the column is there", "add it")
        _check_numbers(path, table, name)
    if not len(table):
        raise problem(path, "", "a table without a row", "it has a row for each test", "add them")
    if (table["test"] % 1 != 0).any():
        raise problem(path, "test", "a fraction", "tests have whole numbers", "number them anew")
    twice = table["test"][table["test"].duplicated()]
    if len(twice):
        rule, remedy = "each number is given once in a folder", "number the tests anew"
        raise problem(path, "test", f"{twice.iloc[0]:g} twice", rule, remedy)
    if "azimuth_deg" in table:
        _check_numbers(path, table, "azimuth_deg")
    table["series"] = table["series"].fillna("").astype(str) if "series" in table else ""
    return table


def _check_numbers(path: Path, table: pd.DataFrame, name: str) -> None:
    if not is_numeric_dtype(table[name]) or not np.isfinite(table[name]).all():
        given, rule = "values that are no numbers", "they are numbers"
        raise problem(path, name, given, rule, "correct the column")
    low, high = LIMITS.get(name, (-np.inf, np.inf))
    if not table[name].between(low, high).all():
        given = f"{table[name].min():g} to {table[name].max():g}"
        raise problem(path, name, given, f"it is {low:g} to {high:g}", "correct the unit")


def _flags(path: Path, table: Any, name: str, *, missing: bool = False) -> tuple[int, ...]:
    """A column of outcomes; -1 for an empty cell where those may be missing."""
    known = table[name].isin([0, 1])
    if not (known | table[name].isna() if missing else known).all():
        rule = "1 is overturned, 0 not" + (", empty a test to predict" if missing else "")
        raise problem(path, name, "values other than 0 and 1", rule, "correct the column")
    return tuple(table[name].where(known, -1).astype(int).tolist())
