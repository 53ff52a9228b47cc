"""A folder of hazard curves of any known format, the file of a calculation, or an event set.

nshmp-haz writes ``PGA/curves.csv``, annual rates of exceedance. Its first line names the columns
``name, lon, lat`` and the levels, in g and cm/s; each further line is a site. There are no
branches: the curve is the mean of the model.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from pipeline.config.folder_names import check_links, in_a_line, marked, unread
from pipeline.config.hazard_schema import HazardConfig
from pipeline.config.in_si import in_g
from pipeline.config.layers import Origin
from pipeline.config.outside import checked, refused, table, text
from pipeline.config.paths import located
from pipeline.config.problems import InputError, Problem
from pipeline.stages.hazard import event_files, openquake
from pipeline.stages.hazard.disaggregation import (
    Disaggregation,
    disaggregation_files,
    load_disaggregation,
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
from pipeline.workflow.grammar import counted
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import FilesInput
from vsr_core.hazard.events import Events

ABOUT = "about.txt"
"""Text in a folder of curves that says where they come from; the page shows it."""

OTHERS = ("quantile_*", "hazard_map-*", "hazard_uhs-*", "hazard_curve-*-SA(*", "SA*/curves.csv")
"""What OpenQuake and nshmp-haz write besides, and nobody takes for curves of PGA or PGV."""

NEARBY = 0.1
"""Degrees within which a disaggregation counts for a site: farther off are other earthquakes."""

OTHERWISE = 2.0
"""Factor within which a disaggregation and curves of one hazard agree: means of other weights."""

_LONGEST_ABOUT = 100_000
"""Bytes of that text."""


def load(path: Path) -> HazardModel:
    """The hazard model in a folder, or in a file of OpenQuake's."""
    if path.is_file() and path.suffix in openquake.SUFFIXES:
        return openquake.load_calculation(path)
    if not path.is_dir():
        rule = "curves are in a folder, or in OpenQuake's calc_N.hdf5"
        there = "a file of another name" if path.is_file() else "neither folder nor regular file"
        given = there if path.exists() else "folder not found"
        raise refused(path, "", given, rule, "check the path")
    try:
        of_openquake = openquake.is_there(path)
    except OSError as error:
        rule, remedy = "it is a folder that you may read", "change its permissions"
        given = f"a folder that cannot be read ({error.strerror})"
        raise refused(path, "", given, rule, remedy) from None
    check_links(path / part for name in UNITS for part in (name, f"{name}/curves.csv"))
    of_nshmp = (path / "PGA" / "curves.csv").is_file()
    if of_openquake and of_nshmp:
        given, rule = "curves of OpenQuake and PGA/curves.csv", "a folder holds one hazard"
        raise refused(path, "", given, rule, "leave the others out")
    if of_openquake:
        return openquake.load(path)
    if of_nshmp:
        return _nshmp(path)
    rule = "OpenQuake's are named hazard_curve-rlz-000-PGA_1.csv, nshmp-haz's PGA/curves.csv"
    raise refused(path, "", "no hazard curves", rule, "give the folder that they were exported to")


def files(path: Path) -> list[Path]:
    """The files that decide what is read."""
    if path.is_file():
        return [path]
    of_nshmp = [path / name / "curves.csv" for name in UNITS]
    found = openquake.files(path) or of_nshmp
    return [one for one in (*found, path / ABOUT) if one.is_file()]


def about(path: Path) -> str:
    """Description of the curves, on one line; empty if there is none."""
    note = path / ABOUT
    return " ".join(text(note, _LONGEST_ABOUT).split()) if note.exists() else ""


def _nshmp(folder: Path) -> HazardModel:
    """The mean curve of a folder of nshmp-haz."""
    paths = {measure: folder / measure / "curves.csv" for measure in UNITS}
    curves = {
        (MEAN, measure): (path, _nshmp_curve(path, measure))
        for measure, path in paths.items()
        if path.exists()
    }
    mean = Realization(rlz_id=MEAN, branch_path="the mean", weight=1.0)
    return model(folder, curves, [mean], *held(curves))


def _nshmp_curve(path: Path, measure: str) -> GivenCurve:
    sites = table(path, text(path), lambda name: name.strip().lower())
    if len(sites) != 1:
        rule, remedy = "one line of rates follows", "export the curves of the rock's site only"
        raise refused(path, "lon, lat", f"{len(sites)} sites", rule, remedy)
    cells = sites[0]
    levels = [name for name in cells if name not in ("name", "lon", "lat")]
    place = {name: cells[name] for name in ("lon", "lat") if name in cells}
    given = {
        "place": cells.get("name", ""),
        "measure": measure,
        "levels": levels,
        "values": [cells[name] for name in levels],
    }
    curve = checked(path, GivenCurve, place | given, text=True)
    check_digits(path, [cells[name] for name in levels])
    return curve


@dataclass(frozen=True, eq=False)
class Curves(FilesInput):
    """A hazard model's curves, or events, and disaggregation, read and checked.

    Attributes
    ----------
    events : Events, where they are what the curves are of
    disaggregated : Path, of the disaggregation, if there is one
    unread : names of other files of the folders
    unused : what else files and folders hold, in words
    """

    path: Path
    before: dict[str, str]
    model: HazardModel
    events: Events | None
    disaggregated: Path | None
    about: str
    unread: tuple[str, ...]
    unused: tuple[str, ...]

    def files_read(self) -> tuple[Path, ...]:
        return (self.path, self.disaggregated or self.path)

    def digests(self) -> dict[str, str]:
        """Digests of the files, by their names."""
        read = _read(self.path, self.disaggregated, of_events=self.events is not None)
        return _digests(read, self.unread)


def find(hazard: HazardConfig, origin: Origin) -> Curves:
    """The curves, or events, that a site names; errors in them are told before anything runs."""
    if hazard.curves is None and hazard.events is None:
        rule = "a folder of hazard curves, or of events, is required"
        remedy = "give CURVES=folder (--curves) or EVENTS=folder (--events), or set the key"
        raise InputError(Problem(origin.file, "hazard.curves", "nothing", rule, remedy))
    if hazard.age is None:
        rule = "the age of the rock is required"
        remedy = "give AGE=years AGE_SD=years (--age, --age-sd), or set the key"
        raise InputError(Problem(origin.file, "hazard.age", "nothing", rule, remedy))
    if hazard.events is not None:
        if hazard.curves is not None:
            file, rule = origin.file_of("hazard.events"), "events stand in place of curves"
            given = "events beside curves"
            raise InputError(Problem(file, "hazard.events", given, rule, "set one of them to null"))
        path = _located(origin, "events", hazard.events)
    else:
        assert hazard.curves is not None
        path = _located(origin, "curves", hazard.curves)
    disaggregated = None
    if hazard.disaggregation is not None:
        disaggregated = _located(origin, "disaggregation", hazard.disaggregation)
    elif path.is_dir() and disaggregation_files(path):
        disaggregated = path
    read = _read(path, disaggregated, of_events=hazard.events is not None)
    others = tuple(dict.fromkeys(_unread(path, disaggregated, read)))
    before = _digests(read, others)
    if hazard.events is not None:
        simulated = event_files.load(path, hazard.effective_time)
        found, events = simulated.model, simulated.events
    else:
        found, events = load(path), None
    unused = (*found.unused, *in_a_line(others))
    if disaggregated is not None:
        of_earthquakes = load_disaggregation(disaggregated)
        _check_place(disaggregated, of_earthquakes.location, found.location)
        unused += of_earthquakes.unused + tuple(_other_rates(of_earthquakes, found))
    return Curves(path, before, found, events, disaggregated, about(path), others, unused)


def _other_rates(of_earthquakes: Disaggregation, model: HazardModel) -> Iterator[str]:
    """Disaggregated levels that the curves say are exceeded far more or less often, in words."""
    curves = [one.pga for one in model.branches]
    if unknown := int(np.isnan(of_earthquakes.rates).sum()):
        of = counted(unknown, "disaggregated level")
        yield f"{of} not held against the curves, as no years, or no poe below 1, are told"
    for level, rate in zip(of_earthquakes.levels, of_earthquakes.rates, strict=True):
        each = [np.exp(np.interp(np.log(level), np.log(c.levels), np.log(c.rates))) for c in curves]
        low = 0.0 if any(level > one.levels[-1] for one in curves) else min(each)
        high = np.inf if any(level < one.levels[0] for one in curves) else max(each)
        if not low / OTHERWISE <= rate <= high * OTHERWISE and rate > 0.0:
            yield (
                f"disaggregated {in_g(level):.3g} g is exceeded {rate:.2g} times a year, and by "
                f"the curves {low:.2g} to {high:.2g} times: one may be in other units, or of "
                "another calculation"
            )


def _check_place(
    disaggregated: Path, location: tuple[float, float] | None, of_curves: tuple[float, float] | None
) -> None:
    """Refuse a disaggregation of the earthquakes of another place than the curves."""
    if location is None or of_curves is None:
        return
    east, north = (one - other for one, other in zip(location, of_curves, strict=True))
    if max(abs((east + 180.0) % 360.0 - 180.0), abs(north)) > NEARBY:
        given = (
            f"{location[0]:g}, {location[1]:g}, and curves of {of_curves[0]:g}, {of_curves[1]:g}"
        )
        rule, remedy = "both are of the rock's site", "disaggregate the hazard there"
        raise refused(disaggregated, "lon, lat", given, rule, remedy)


def _read(path: Path, disaggregated: Path | None, *, of_events: bool) -> list[Path]:
    """The files of curves, or events, and of a disaggregation."""
    found = [*event_files.files(path), *path.glob(ABOUT)] if of_events else files(path)
    of_earthquakes = disaggregation_files(disaggregated) if disaggregated else []
    return [*found, *(one for one in of_earthquakes if one not in found)]


def _unread(path: Path, disaggregated: Path | None, read: list[Path]) -> Iterator[str]:
    """What else is in the folders of them, by name, but for exports that have no part here."""
    for folder in dict.fromkeys((path, disaggregated)):
        if folder and folder.is_dir():
            yield from unread(folder, [*read, *chain.from_iterable(map(folder.glob, OTHERS))])


def _digests(paths: list[Path], unread: tuple[str, ...]) -> dict[str, str]:
    """Digests of the files, by their names."""
    return marked(unread) | {_name(path): digest_file(path) for path in paths}


def _name(path: Path) -> str:
    """Its name, with the folder that tells nshmp-haz's measures apart."""
    return "/".join(path.parts[-2:]) if path.name == "curves.csv" else path.name


def _located(origin: Origin, key: str, name: str) -> Path:
    key = f"hazard.{key}"
    return located(origin.folder_of(key), name, origin.file_of(key), key)
