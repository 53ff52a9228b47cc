"""A folder of shake-table tests: motions, outcomes, scans, and what is assumed of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import compress
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from pydantic import Field

from pipeline.config import in_si
from pipeline.config.folder_names import check_links, check_names, marked, unread
from pipeline.config.layers import Origin, Site, load_file
from pipeline.config.outside import Row, refused, rows, table, text
from pipeline.config.paths import located, shown
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.problems import InputError, not_found
from pipeline.config.sections import LARGEST_PGA, LONGEST_PULSE, SHORTEST_PULSE, SMALLEST_PGA
from pipeline.stages.mesh import mesh_files
from pipeline.stages.studies.validation.table_motions import RECORDS, commanded, motions, recorded
from pipeline.workflow.grammar import counted
from pipeline.workflow.keys import check_same, digest_file
from pipeline.workflow.stage import Input
from vsr_core.arrays import Mask
from vsr_core.errors import InvalidInput
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.rock.solid import checked
from vsr_core.table.stepper import Stepper

if TYPE_CHECKING:
    import trimesh

OUTCOMES, ASSUMED = "outcomes.csv", "table.yaml"

SCAN, SPECIMEN = re.compile(r"sp(\d{1,9})\.ply"), re.compile(r"specimen(?P<specimen>\d{1,9})")

ALIKE, ALONE = 3.0, 10.0
"""Factors within which peaks of records are the PGA of their tests: in the middle, and of each. A
spike that a filter took from the PGA of a published test is 8.5 times as large."""

PUBLISHED = re.compile(r"(?P<name>[a-z]+)_s(?P<specimen>\d{1,9})_(?P<setting>\w+)")
"""A column of someone's predictions for a specimen, such as dem_s1_kn10."""


_IN_EACH = ("azimuth_deg", "ground_motion", "series")
"""Columns without a blank: in one of a spreadsheet's merged cells all rows but the first are."""

_BLANK = ("", "-", "na", "nan", "n/a", "#n/a", "null", "none")
"""What programs write for nothing, in small letters."""

_FLAGS = {"0": 0, "1": 1, "0.0": 0, "1.0": 1}
_MISSING = {"": -1, "nan": -1, "NaN": -1, "NA": -1}


class TestRow(Row):
    """A row of the outcomes; further columns are of specimens, and others' predictions."""

    test: int = Field(ge=0, le=10_000_000, description="number of the test, a whole one")
    ground_motion: str = Field("", max_length=1000, description="name of the motion")
    pga_g: float = Field(ge=SMALLEST_PGA, le=LARGEST_PGA, description="its PGA [g]")
    pgv_pga_s: float = Field(ge=SHORTEST_PULSE, le=LONGEST_PULSE, description="its PGV/PGA [s]")
    azimuth_deg: float | None = Field(
        None, ge=-360, le=360, description="direction of the drive from the scan's +x [degree]"
    )
    series: str = Field("", max_length=1000, description="name of its series")
    has_record: int = Field(1, ge=0, le=1, description="1 if it is among the records, or 0")


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
    unused : what else is in the folder, in words
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
    unused: tuple[str, ...] = ()

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
    if not folder.exists():
        raise not_found("--table", "", shown(folder))
    if not folder.is_dir():
        raise refused(folder, "", "no folder", "tests are in one", "correct the path")
    if not (folder / OUTCOMES).is_file():
        raise refused(folder / OUTCOMES, "", "", "file not found", "put it there")
    check_links((folder / RECORDS, folder / ASSUMED, *folder.glob("sp*.ply")))
    if not scans_in(folder):
        rule, remedy = "there is one for each specimen", "call it sp1.ply, in metres"
        raise refused(folder, "", "no scan", rule, remedy)
    check_names(folder, (RECORDS, ASSUMED))
    return Site(name=folder.name, file=shown(folder), path=folder, settings=assumptions(folder))


@dataclass(frozen=True)
class Folder(Input):
    """A folder of tests, the files in it that count, and the names of others, which are told."""

    path: Path
    unread: tuple[str, ...]

    def digests(self) -> dict[str, str]:
        """Digests of the files, by their names."""
        read = {path.name: digest_file(path) for path in files_of(self.path) if path.is_file()}
        return marked(self.unread) | read


def files_of(folder: Path) -> list[Path]:
    """The files of a folder of tests that are read, there or not."""
    return [*(folder / name for name in (RECORDS, OUTCOMES, ASSUMED)), *scans_in(folder).values()]


def find(origin: Origin) -> Folder:
    """The tests that a site stands for."""
    return Folder(origin.folder, unread(origin.folder, files_of(origin.folder)))


def scans_in(folder: Path) -> dict[int, Path]:
    """Scans by the number of their specimen."""
    names = [path.name for path in folder.glob("sp*.ply") if path.is_file()]
    return {number: folder / name for number, name in _numbered(folder, SCAN, names).items()}


def _numbered(path: Path, pattern: re.Pattern[str], names: Iterable[str]) -> dict[int, str]:
    """What belongs to a specimen, by its number."""
    found: dict[int, str] = {}
    for name in sorted(names):
        if match := pattern.fullmatch(name):
            number = int(match[1])
            if number in found:
                given, rule = f"{found[number]} and {name}", "a specimen has a number of its own"
                raise refused(path, "", given, rule, "rename or remove one")
            found[number] = name
    return dict(sorted(found.items()))


def assumptions(folder: Path) -> ShakeTableConfig:
    """What is assumed of the tests in a folder; the defaults where it says nothing."""
    path = folder / ASSUMED
    if not path.exists():
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
    path, specimens = folder / OUTCOMES, tuple(scans_in(folder))
    cells = table(path, text(path))
    if not cells:
        raise refused(path, "", "a table without a row", "it has a row for each test", "add them")
    found = rows(path, TestRow, cells, once=("test",))
    _check_blanks(path, cells)
    _check_names(path, found)
    there = (folder / RECORDS).exists()
    both = [one for one in zip(found, cells, strict=True) if one[0].has_record or not there]
    both.sort(key=lambda one: one[0].test)
    found, used = [row for row, _ in both], [fields for _, fields in both]
    observed = {
        number: _flags(path, used, name, _FLAGS | _MISSING)
        for number, name in _numbered(path, SPECIMEN, cells[0]).items()
        if number in specimens
    }
    published: dict[tuple[int, str], tuple[int, ...]] = {}
    for name in cells[0]:
        if match := PUBLISHED.fullmatch(name):
            key = int(match["specimen"]), f"{match['name']} {match['setting']}"
            if key in published:
                rule = f"each specimen has a column of {key[1]}"
                raise refused(path, name, f"specimen {key[0]} again", rule, "rename or remove one")
            published[key] = _flags(path, used, name, _FLAGS)
    if there:
        _check_records(folder, {row.test for row in found})
    elif "has_record" in cells[0] and any(row.has_record for row in found):
        rule, remedy = "what is recorded has a record", f"add {RECORDS}, or leave out the column"
        raise refused(path, "has_record", f"1, and no {RECORDS}", rule, remedy)
    return Tests(
        tuple(row.test for row in found),
        tuple(row.ground_motion or f"{row.pga_g} g, {row.pgv_pga_s} s" for row in found),
        tuple(row.pga_g for row in found),
        tuple(row.pgv_pga_s for row in found),
        tuple(row.azimuth_deg for row in found),
        tuple(row.series for row in found),
        observed,
        published,
        specimens,
        assumptions(folder),
        tuple(_unused(len(cells) - len(used), cells[0], specimens, observed)),
    )


def _check_records(folder: Path, listed: set[int]) -> None:
    """Refuse records that are not those of the tests in the table."""
    known, path = recorded(folder)[0], folder / OUTCOMES
    remedy = "number them alike, or tell rows without one by a column has_record of 0 and 1"
    if not known & listed:
        raise refused(path, "test", "no test with a record", "some have one", remedy)
    for numbers, given in (
        (listed - known, "without a record"),
        (known - listed, "with a record, and without a row that has one"),
    ):
        if numbers:
            rule = f"{OUTCOMES} and {RECORDS} are of the same tests"
            raise refused(path, "test", f"{min(numbers)} {given}", rule, remedy)


def _check_peaks(folder: Path, tests: Tests, found: dict[int, GroundMotion]) -> None:
    """Refuse records in another unit than they say, or of other tests, by PGA."""
    ratios = peak_ratios(tests, found)
    farthest = max(ratios, key=lambda number: abs(math.log(ratios[number])))
    for ratio, factor, of, remedy in (
        (median(ratios.values()), ALIKE, "median", f"correct their unit, or {OUTCOMES}"),
        (ratios[farthest], ALONE, f"test {farthest}", "mend or drop the test"),
    ):
        if not 1.0 / factor <= ratio <= factor:
            given = f"peaks of {ratio:.3g} times pga_g ({of})"
            rule = f"they agree within a factor of {factor:g}"
            raise refused(folder / RECORDS, "acceleration", given, rule, remedy)


def peak_ratios(tests: Tests, found: dict[int, GroundMotion]) -> dict[int, float]:
    """Peaks of records as a share of PGA, by test."""
    return {
        number: in_si.in_g(found[number].peak_acceleration) / pga
        for number, pga in zip(tests.number, tests.pga, strict=True)
    }


def _check_blanks(path: Path, cells: list[dict[str, str]]) -> None:
    """Refuse a blank in what each row has or none."""
    for name in _IN_EACH:
        for number, fields in enumerate(cells, start=1):
            if (given := fields.get(name, "x")).lower() in _BLANK:
                given = f"{given or 'nothing'} in row {number}"
                rule, remedy = "it is in each row, or in none", "add it, or leave out the column"
                raise refused(path, name, given, rule, remedy)


def _check_names(path: Path, found: list[TestRow]) -> None:
    """Refuse names of motions and series that differ in capitals or blanks only."""
    for key in ("ground_motion", "series"):
        known: dict[str, str] = {}
        for row in found:
            name = getattr(row, key)
            other = known.setdefault(" ".join(name.casefold().split()), name)
            if other != name:
                rule, remedy = "each has one spelling", "correct it in all rows"
                raise refused(path, key, f"{other!r} and {name!r}", rule, remedy)


def _unused(
    unrecorded: int,
    names: Iterable[str],
    specimens: tuple[int, ...],
    observed: dict[int, tuple[int, ...]],
) -> Iterator[str]:
    """What the table holds that has no part in the validation."""
    if unrecorded:
        yield f"{counted(unrecorded, 'row')} of {OUTCOMES} with has_record of 0 left out"
    for name in names:
        left_out = f"column {name} of {OUTCOMES} left out, as"
        if match := SPECIMEN.fullmatch(name) or PUBLISHED.fullmatch(name):
            specimen = int(match["specimen"])
            outcomes = observed.get(specimen, ())
            if specimen not in specimens:
                yield f"{left_out} there is no scan of that specimen"
            elif max(outcomes, default=-1) < 0:
                yield f"{left_out} there is no outcome of that specimen"
            elif SPECIMEN.fullmatch(name) and (without := outcomes.count(-1)):
                yield f"{counted(without, 'test')} without an outcome in {name}: predicted only"
        elif name not in TestRow.model_fields:
            yield f"{left_out} it says nothing here"


def motions_of(folder: Path, known: tuple[str, ...] = ()) -> dict[int, GroundMotion]:
    """How the table moved in each test.

    Parameters
    ----------
    known : digests of the files that tell it, where they were taken before

    Raises
    ------
    InputError
        For files that break a rule, or that were written over since their digests.
    """
    return _motions_of(folder, known or digests_of_motions(folder))


def digests_of_motions(folder: Path) -> tuple[str, ...]:
    """Digests of the files that tell how the table moved."""
    return tuple(map(digest_file, _decisive(folder)))


def _decisive(folder: Path) -> list[Path]:
    paths = (folder / name for name in (RECORDS, OUTCOMES, ASSUMED))
    return [path for path in paths if path.is_file()]


@lru_cache(maxsize=2)
def _motions_of(folder: Path, digests: tuple[str, ...]) -> dict[int, GroundMotion]:
    """The same, once for all that ask for it in a process."""
    tests = tests_in(folder)
    if (folder / RECORDS).is_file():
        found = motions(folder, assumptions(folder).acceleration)
        _check_peaks(folder, tests, found)
    else:
        told = tests.config.stepper
        stepper = Stepper(told.rate, told.step, told.overhead) if told else None
        rows = zip(tests.number, tests.pga, tests.pgv_pga, strict=True)
        found = {number: commanded(pga, ratio, stepper) for number, pga, ratio in rows}
    check_same(folder, _decisive(folder), digests)
    return found


def _flags(
    path: Path, cells: list[dict[str, str]], name: str, known: dict[str, int]
) -> tuple[int, ...]:
    """A column of outcomes; -1 for an empty cell where those are known."""
    for row in cells:
        if row[name] not in known:
            rule = "1 is overturned, 0 not" + (", empty a test to predict" if "" in known else "")
            given = f"{row[name]!r} of test {row['test']}"
            raise refused(path, name, given, rule, "correct the column")
    return tuple(known[row[name]] for row in cells)
