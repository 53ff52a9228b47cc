"""Files of stochastic event sets: what is read of them, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from pipeline.config import long_tables
from pipeline.config.layers import load_site
from pipeline.config.problems import InputError
from pipeline.stages.hazard import curve_folder, event_files
from tests.support.bad_input import bounded
from tests.support.event_sets import EventSet
from vsr_core import GRAVITY
from vsr_core.hazard.events import Events

YEARS = 100.0

FILES = {
    "ruptures_5.csv": "#,,\"risk_investigation_time=1.0, investigation_time=50.0, "
    "ses_per_logic_tree_path=2\"\n"
    "rup_id,multiplicity,mag,centroid_lon,centroid_lat,centroid_depth,trt,strike,dip,rake\n"
    "8,3,6.5,-120.0,35.0,8.0,Active Shallow Crust,0.0,90.0,180.0\n"
    "30,2,7.0,-121.0,35.0,8.0,Active Shallow Crust,0.0,90.0,180.0\n",
    "events_5.csv": "#,,\"generated_by='OpenQuake engine 3.26.2'\"\n"
    "event_id,rup_id,rlz_id,year,ses_id\n"
    "0,8,1,110,1\n1,8,0,20,1\n2,8,1,150,2\n3,30,0,90,2\n4,30,1,190,1\n",
    "gmf-data_5.csv": "#,,\"generated_by='OpenQuake engine 3.26.2'\"\n"
    "event_id,gmv_PGA,gmv_PGV,gmv_SA(1.0),custom_site_id\n"
    "3,0.3,30.0,0.4,9q6\n0,0.1,8.0,0.1,9q6\n1,0.2,15.0,0.2,9q6\n2,0.0,5.0,0.1,9q6\n"
    "4,0.4,50.0,0.5,9q6\n",
    "realizations_5.csv": "rlz_id,branch_path,weight\n0,A~0,0.4\n1,A~1,0.6\n",
    "sitemesh_5.csv": "custom_site_id,lon,lat\n9q6,-121.0,35.0\n",
}  # fmt: skip


def written(folder: Path, **others: str) -> Path:
    for name, text in FILES.items():
        (folder / name).write_text(others.get(name[:3], text), encoding="utf-8")
    return folder


def by_number(events: Events) -> list[tuple[float, ...]]:
    pgv = events.pgv if events.pgv is not None else np.zeros(len(events.pga))
    columns = events.branch, events.rupture, events.pga / GRAVITY, pgv
    return sorted(tuple(np.round(row, 6).tolist()) for row in np.column_stack(columns))


def test_events_are_those_of_their_branches_and_ruptures(tmp_path: Path) -> None:
    """One without PGA topples nothing; the second rupture runs through the site."""
    found = event_files.load(written(tmp_path), None)
    events, hazard = found.events, found.model
    assert events.years == YEARS
    assert by_number(events) == [
        (0, 0, 0.2, 0.15), (0, 1, 0.3, 0.3), (1, 0, 0.1, 0.08), (1, 1, 0.4, 0.5)
    ]  # fmt: skip
    assert [(one.name, one.path, one.weight) for one in hazard.branches] == [
        ("0", "A~0", 0.4), ("1", "A~1", 0.6)
    ]  # fmt: skip
    assert hazard.location == (-121.0, 35.0)
    assert hazard.unused == (
        "column gmv_SA(1.0) of gmf-data_5.csv left out, as it says nothing here",
        "1 event without PGA left out",
    )
    assert events.ruptures is not None
    kilometres = 111.195 * np.cos(np.radians(35.0))
    np.testing.assert_allclose(events.ruptures.distances, [kilometres, 0.0], rtol=1e-6)
    for branch, strongest in zip(hazard.branches, (0.3, 0.4), strict=True):
        rates = branch.pga.rate_at(GRAVITY * np.array([0.15, 0.95 * strongest]))
        number = 2 if branch.name == "0" else 1
        np.testing.assert_allclose(rates, [number / YEARS, 1.0 / YEARS], rtol=1e-9)


def test_parts_and_an_order_of_rows_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = EventSet(2_000.0).write(tmp_path)
    whole = event_files.load(folder, None)
    path = folder / "gmf-data_1.csv"
    *first, last = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*first[:2], last, *first[2:]]))
    monkeypatch.setattr(long_tables, "PART", 17)
    parts = event_files.load(folder, None)
    assert parts is not whole
    for name in ("pga", "pgv", "branch", "rupture"):
        np.testing.assert_array_equal(getattr(parts.events, name), getattr(whole.events, name))
    np.testing.assert_array_equal(parts.events.ratio_anew(), whole.events.ratio_anew())
    assert len(whole.events.pga) > 100


def test_a_calculation_has_the_events_of_its_tables(tmp_path: Path) -> None:
    own = EventSet(2_000.0, ruptures=300)
    folder = event_files.load(own.write(tmp_path / "out"), None)
    path = own.write_calculation(tmp_path / "calc_7.hdf5")
    stored = event_files.load(path, None)
    assert [one.weight for one in stored.model.branches] == pytest.approx([0.3, 0.4, 0.3])
    assert stored.model.branches[0].path == "b~slow"
    assert stored.model.location == pytest.approx(folder.model.location)
    one, other = folder.events, stored.events
    assert other.years == one.years
    np.testing.assert_array_equal(other.branch, one.branch)
    for name in ("pga", "pgv"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-5)
    assert one.ruptures is not None
    assert other.ruptures is not None
    distances = (of.ruptures.distances[of.rupture] for of in (one, other) if of.ruptures)
    np.testing.assert_allclose(*distances, atol=0.02)  # longitudes are in 4 bytes


def test_what_is_no_calculation_of_events_is_refused(tmp_path: Path) -> None:
    path = EventSet(2_000.0, ruptures=300).write_calculation(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "a") as file:
        file["gmf_data/PGA"][3] = -1.0
    with pytest.raises(InputError, match=r"gmv_PGA: got -1.0 in row 4"):
        event_files.load(path, None)
    with h5py.File(path, "a") as file:
        del file["gmf_data/PGA"]
    with pytest.raises(InputError, match=r"it is an event_based calculation"):
        event_files.load(path, None)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match=r"gmf_data: got an invalid file"):
        event_files.load(path, None)


def test_pgv_places_and_ruptures_may_be_missing(tmp_path: Path) -> None:
    without = FILES["gmf-data_5.csv"].replace("gmv_PGV", "gmv_SA(0.3)")
    events = event_files.load(written(tmp_path, gmf=without), None).events
    assert events.pgv is None
    (tmp_path / "sitemesh_5.csv").unlink()
    found = event_files.load(tmp_path, YEARS)
    assert found.model.location is None
    assert found.events.ruptures is None
    (tmp_path / "ruptures_5.csv").unlink()
    with pytest.raises(InputError, match=r"set hazard\.effective_time"):
        event_files.load(tmp_path, None)
    again = event_files.load(tmp_path, YEARS).events
    assert by_number(again) == by_number(events)


def test_branches_without_weight_are_left_out_with_their_events(tmp_path: Path) -> None:
    weights = "rlz_id,branch_path,weight\n1,A~1,1.0\n0,A~0,0.0\n"
    found = event_files.load(written(tmp_path, rea=weights), None)
    assert [one.name for one in found.model.branches] == ["1"]
    assert by_number(found.events) == [(0, 0, 0.1, 0.08), (0, 1, 0.4, 0.5)]
    assert "1 realization of weight 0 left out, with 2 events" in found.model.unused


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("gmf-data", "\n3,0.3", "\n9,0.3", "event_id: got event 9; it is one of those in events_5"),
        ("gmf-data", "\n3,0.3", "\n0,0.3", "event_id: got 0 twice"),
        ("gmf-data", "3,0.3", "3,-0.3", "gmv_PGA: got -0.3 in row 1"),
        ("gmf-data", "3,0.3", "3,inf", "gmv_PGA: got inf in row 1"),
        ("gmf-data", "3,0.3", "3,strong", "could not convert string to float: 'strong'"),
        ("gmf-data", "3,0.3", "3,29.4", "gmv_PGA: got 29.4 in row 1"),
        ("gmf-data", "3,0.3,30.0,0.4,9q6", "3,0.3,30.0,0.4", "fewer fields in row 1"),
        ("gmf-data", "3,0.3,30.0,0.4", "3,0.3,30.0,0.4,0.5", "a table that cannot be read"),
        ("gmf-data", "1,0.2,15.0", "1,0.2,1,15.0", "Expected 5 fields in line 5, saw 6"),
        ("gmf-data", "0.4,50.0,0.5,9q6\n", "0.4,50.0,0.5,9q6", "a last line without its end"),
        ("gmf-data", "gmv_PGA", "PGA", "gmv_PGA: got no such column"),
        ("gmf-data", "gmv_PGV", "gmv_PGA", "gmv_PGA: got a column twice"),
        ("events", "\n0,8,1,110,1", "\n0,8,1,110,1,1", "fewer fields in row 2"),
        ("events", "\n1,8,0,", "\n1,8,5,", "rlz_id: got 5 of event 1"),
        ("events", "\n1,8,0,", "\n-1,8,0,", "or equal to 0; correct it in the file"),
        ("events", "\n1,8,0,", "\n0,8,0,", "event_id: got 0 twice"),
        ("events", "\n1,8,", "\n1,9,", "rup_id: got no 9"),
        ("events", "4,30,1,190", "4,30,1,250", "year: got years 140 apart"),
        ("events", "\n1,8,0,", "\n1.5,8,0,", "a table that cannot be read"),
        ("events", "year", "year,ses_id", "ses_id: got a column twice"),
        ("realizations", "0,A~0,0.4", "0,A~0,0.3\n2,A~2,0.1", "no event of realization 2"),
        ("realizations", "0.4", "0.3", "sum to 1"),
        ("ruptures", "time=50.0", "time=-50.0", "-50.0 times 2"),
        ("ruptures", "\n30,2,", "\n8,2,", "rup_id: got 8 twice"),
        ("ruptures", "35.0,8.0", "95.0,8.0", "centroid_lat: got 95.0 in row 1"),
        ("gmf-data", "0.4,50.0,0.5,9q6", "0.4,50.0,0.5,9q7", "got '9q6' and '9q7'; all shaking is"),
        ("sitemesh", "9q6", "9q7", "got '9q7' and '9q6'; all shaking is at one site"),
        ("ruptures", "\n30,2,", "\n30,4,", "rup_id: got 2 events of rupture 30; it has 4"),
        ("ruptures", "\n30,2,", "\n30,0,", "multiplicity: got 0 in row 2"),
        (
            "sitemesh",
            "-121.0,35.0",
            "-121.0,45.0",
            "km from 45, -121; no event is felt beyond 1,000 km",
        ),
        ("sitemesh", "35.0\n", "35.0\n9q7,-121.1,35.0\n", "lon, lat: got 2 sites"),
    ],
)
def test_what_breaks_a_rule_is_refused_in_one_line(
    tmp_path: Path, file: str, old: str, new: str, words: str
) -> None:
    path = written(tmp_path) / f"{file}_5.csv"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(words)) as error:
        event_files.load(tmp_path, None)
    assert str(error.value).count("\n") == 0
    assert str(tmp_path) in str(error.value)


@pytest.mark.parametrize("name", ["gmf-data", "events", "realizations"])
def test_a_file_that_is_missing_or_there_twice_is_named(tmp_path: Path, name: str) -> None:
    path = written(tmp_path) / f"{name}_5.csv"
    (tmp_path / f"{name}_6.csv").write_text(path.read_text())
    with pytest.raises(InputError, match=f"got 2 files {name}"):
        event_files.load(tmp_path, None)
    path.unlink()
    (tmp_path / f"{name}_6.csv").unlink()
    with pytest.raises(InputError, match=f"{name}: got no such file"):
        event_files.load(tmp_path, None)


@pytest.mark.parametrize(
    "name",
    ["Ruptures_5.csv", "rupture_5.csv", "ruptures_5 (1).csv", "ruptures_5.txt", "br\udcfcche.csv"],
)
def test_ruptures_of_another_name_are_told(tmp_path: Path, name: str) -> None:
    """Without them nothing is known of magnitudes; a name may be in no UTF-8."""
    (written(tmp_path) / "ruptures_5.csv").rename(tmp_path / name)
    (tmp_path / "about.txt").write_text("a note")
    age = "hazard.age={kind: normal, mean: 5000}"
    events = (f"hazard.events={tmp_path}", "hazard.effective_time=100")
    given = ("hazard.curves=null", *events, age)
    site = load_site("double_rock", None, given)
    told = [line for line in curve_folder.find(site.config.hazard, site).unused if "name" in line]
    assert told == [f"{name!r} left out, as nothing reads a file of that name there"]


def test_fields_without_rows_are_refused_and_a_strange_column_is_named(tmp_path: Path) -> None:
    """A column whose name is damaged has no part, so that PGV is drawn from PGA."""
    path = EventSet(400.0, ruptures=40).write(tmp_path) / "gmf-data_1.csv"
    text = path.read_text()
    path.write_text(text.replace("gmv_PGV", "gmv_PGU"))
    (said,) = (one for one in event_files.load(tmp_path, None).model.unused if "column" in one)
    assert said == "column gmv_PGU of gmf-data_1.csv left out, as it says nothing here"
    path.write_text("".join(text.splitlines(keepends=True)[:2]))
    with pytest.raises(InputError, match="no rows"):
        event_files.load(tmp_path, None)


@pytest.mark.parametrize("name", ["gmf-data", "events", "ruptures", "sitemesh"])
def test_files_of_two_calculations_are_refused(tmp_path: Path, name: str) -> None:
    """By the number of a name, and by the checksum that OpenQuake writes in the first line."""
    path = written(tmp_path) / f"{name}_5.csv"
    path.rename(tmp_path / f"{name}_6.csv")
    with pytest.raises(InputError, match=rf"number: got 5 of .*_5.csv and 6 of {name}_6.csv"):
        event_files.load(tmp_path, None)
    (tmp_path / f"{name}_6.csv").unlink()
    for one, text in FILES.items():
        checksum = 18 if one == path.name else 17
        (tmp_path / one).write_text(f"#,checksum={checksum}\n{text}")
    with pytest.raises(InputError, match=rf"checksum: got 17 of .*_5.csv and 18 of {name}_5.csv"):
        event_files.load(tmp_path, None)


def test_shaking_at_another_site_is_refused_in_every_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a table of sites, the first row tells the site; a part may begin with another."""
    monkeypatch.setattr(long_tables, "PART", 2)
    path = written(tmp_path) / "gmf-data_5.csv"
    (tmp_path / "sitemesh_5.csv").unlink()
    assert len(event_files.load(tmp_path, None).events.pga) == 4
    text = path.read_text()
    path.write_text(text.replace("1,0.2,15.0,0.2,9q6\n2,0.0,5.0,0.1,9q6",
                                 "1,0.2,15.0,0.2,9q7\n2,0.0,5.0,0.1,9q7"))  # fmt: skip
    with pytest.raises(InputError, match=r"custom_site_id: got '9q6' and '9q7'"):
        event_files.load(tmp_path, None)


def test_a_table_of_weights_may_end_without_a_line_end(tmp_path: Path) -> None:
    """As an editor may save it, where the last number has the digits of the others."""
    expected = by_number(event_files.load(written(tmp_path), None).events)
    path = tmp_path / "realizations_5.csv"
    path.write_text(path.read_text().rstrip("\n"))
    assert by_number(event_files.load(tmp_path, None).events) == expected


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("gmv_PGA", 9.80665), "1 is exceeded at most 0.01 times a year anywhere"),
        (("gmv_PGV", 0.01), "in cm/s the first is up to 100, the last 5 to 2000"),
        (("gmv_PGA", 0.01), "the last 0.05 to 20"),
    ],
)
def test_other_units_are_not_plausible(
    tmp_path: Path, change: tuple[str, float], words: str
) -> None:
    """PGA in m/s^2 or percent of g, PGV in m/s."""
    folder = EventSet(2_000.0).write(tmp_path)
    path = folder / "gmf-data_1.csv"
    first, names, *rows = path.read_text().splitlines()
    at = names.split(",").index(change[0])
    for i, row in enumerate(rows):
        cells = row.split(",")
        cells[at] = f"{float(cells[at]) * change[1]:.5E}"
        rows[i] = ",".join(cells)
    path.write_text("\n".join([first, names, *rows, ""]))
    with pytest.raises(InputError, match=words):
        event_files.load(folder, None)


def rewritten(path: Path, change: Callable[[float, float, int], tuple[float, float]]) -> Path:
    """PGA and PGV of each event changed, given the number of its realization."""
    branch = dict(row.split(",")[::2][:2] for row in lines(path / "events_1.csv"))
    first, names, *rows = (path / "gmf-data_1.csv").read_text().splitlines()
    for at, row in enumerate(rows):
        number, pga, pgv, site = row.split(",")
        changed = change(float(pga), float(pgv), int(branch[number]))
        rows[at] = ",".join([number, *map(str, changed), site])
    (path / "gmf-data_1.csv").write_text("\n".join([first, names, *rows, ""]))
    return path


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines()[2:]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda pga, pgv, of: (0.0, pgv), "gmv_PGA: got none above 0 in realization 0"),
        (lambda pga, pgv, of: (pga, 0.0), "gmv_PGV: got none above 0 in realization 0"),
        (lambda pga, pgv, of: (pga * (of != 0), pgv), "gmv_PGA: got none above 0 in realization 0"),
        (lambda pga, pgv, of: (pga, pgv * (of != 0)), "gmv_PGV: got none above 0 in realization 0"),
        (
            lambda pga, pgv, of: (pga, pgv * (pga > 0.1)),
            r"gmv_PGV: got 0 in \d+ events with PGA of",
        ),
    ],
)
def test_shaking_that_is_lost_is_refused(
    tmp_path: Path, change: Callable[[float, float, int], tuple[float, float]], words: str
) -> None:
    with pytest.raises(InputError, match=words) as error:
        event_files.load(rewritten(EventSet(2_000.0).write(tmp_path), change), None)
    assert str(error.value).count("\n") == 0


def held(values: list[str]) -> list[str]:
    at = max(range(len(values) - 40), key=lambda one: float(values[one]))
    return [*values[:at], *[values[at]] * 40, *values[at + 40 :]]


@pytest.mark.parametrize("name", ["gmv_PGA", "gmv_PGV"])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda values: values, None),
        (lambda values: sorted(values, key=float), "follows the numbers of events"),
        (sorted, "follows the numbers of events"),
        (lambda values: [*values[:100], *values[50:100], *values[150:]], "is that of others"),
        (held, "is that of others"),
    ],
)
def test_shaking_that_was_sorted_or_stands_twice_is_told(
    tmp_path: Path, name: str, change: Callable[[list[str]], list[str]], words: str | None
) -> None:
    folder = EventSet(2_000.0).write(tmp_path)
    path, at = folder / "gmf-data_1.csv", ["gmv_PGA", "gmv_PGV"].index(name) + 1
    first, names, *rows = path.read_text().splitlines()
    cells = sorted((row.split(",") for row in rows), key=lambda row: int(row[0]))
    for row, value in zip(cells, change([row[at] for row in cells]), strict=True):
        row[at] = value
    path.write_text("\n".join([first, names, *map(",".join, cells), ""]))
    told = [line for line in event_files.load(folder, None).model.unused if name in line]
    assert len(told) == (words is not None)
    assert all(words in line for line in told)


def test_shaking_beyond_any_is_told(tmp_path: Path) -> None:
    """As of numbers that lost their exponents."""
    folder = rewritten(
        EventSet(2_000.0).write(tmp_path),
        lambda pga, pgv, of: (pga, 1e-3) if pga < 0.02 else (9.0 if pga > 0.9 else pga, pgv),
    )
    told = " ".join(event_files.load(folder, None).model.unused)
    assert "with PGA of up to 9 g, and records rarely exceed 4 g" in told
    assert "events with PGV/PGA from " in told


@pytest.mark.parametrize("kept", [1, 2, "0", "2"])
def test_a_realization_whose_shaking_is_lost_is_named(tmp_path: Path, kept: int | str) -> None:
    """The first rows alone, or all but those of a realization."""
    folder = EventSet(2_000.0).write(tmp_path)
    branch = dict(row.split(",")[::2][:2] for row in lines(folder / "events_1.csv"))
    path = folder / "gmf-data_1.csv"
    rows = path.read_text().splitlines(keepends=True)
    own = rows[2:][:kept] if isinstance(kept, int) else []
    own = own or [row for row in rows[2:] if branch[row.split(",")[0]] != kept]
    path.write_text("".join([*rows[:2], *own]))
    with pytest.raises(InputError, match="gmv_PGA: got none above 0 in realization"):
        event_files.load(folder, None)


def test_pgv_below_what_is_kept_is_0(tmp_path: Path) -> None:
    """As OpenQuake has it with a least intensity."""
    folder = EventSet(2_000.0).write(tmp_path)
    whole = event_files.load(folder, None).events
    assert whole.pgv is not None
    rewritten(folder, lambda pga, pgv, of: (pga, pgv * (pgv > 5.0)))
    found = event_files.load(folder, None).events
    assert found.pgv is not None
    np.testing.assert_array_equal(found.pgv, np.where(whole.pgv > 0.05, whole.pgv, 0.0))


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("gmf_data/PGA", lambda held: held[:-3], "columns that are none, or of several lengths"),
        ("gmf_data/PGV", lambda held: held[:-3], "columns that are none, or of several lengths"),
        ("gmf_data/PGA", lambda held: held[:, None], "columns that are none, or of several"),
        ("gmf_data/PGA", lambda held: held * 1j, "a column of no numbers"),
        ("gmf_data/eid", lambda held: 5, "columns that are none, or of several lengths"),
        ("gmf_data/eid", lambda held: held + 0.4, "float64 for whole numbers"),
        ("events", lambda held: held[:, None], "columns that are none, or of several lengths"),
        ("sitecol/lat", lambda held: held[:0], "sitecol: got 0 sites"),
        ("weights", lambda held: 0.0 * held, "weights that sum to 0"),
        ("gmf_data/PGA", lambda held: 0.0 * held, "gmv_PGA: got none above 0 in realization 0"),
    ],
)
def test_columns_of_a_calculation_that_are_none_are_refused(
    tmp_path: Path, name: str, change: Callable[[Any], Any], words: str
) -> None:
    path = EventSet(400.0, ruptures=40).write_calculation(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        held = file[name][()]
        del file[name]
        file[name] = change(held)
    with pytest.raises(InputError, match=words) as error:
        event_files.load(path, None)
    assert str(error.value).count("\n") == 0


BOMBS = {
    "events": [(name, "i8") for name in ("id", "rup_id", "rlz_id", "year")],
    "gmf_data/eid": "u4",
    "gmf_data/PGV": "f4",
    "ruptures": [("id", "i8"), ("geom_id", "i8"), ("mag", "f8")],
    "rupgeoms": h5py.vlen_dtype(np.float32),
}


@pytest.mark.parametrize("name", BOMBS)
def test_numbers_that_are_not_stored_are_not_read(tmp_path: Path, name: str) -> None:
    """A file of a few kilobytes that declares terabytes, all alike."""
    path = EventSet(400.0, ruptures=40).write_calculation(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        del file[name]
        file.create_dataset(name, (4 * 10**11,), BOMBS[name], chunks=(1000,))
    with bounded(seconds=2.0, mebibytes=200.0), pytest.raises(InputError, match=f"of {name}, of"):
        event_files.load(path, None)


def test_a_calculation_has_the_events_that_its_ruptures_say(tmp_path: Path) -> None:
    path = EventSet(400.0, ruptures=40).write_calculation(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        events = file["events"][()]
        lost = events["id"][events["rup_id"] == events["rup_id"][7]][0]
        held = {name: file[name][()] for name in ("gmf_data/eid", "gmf_data/PGA", "gmf_data/PGV")}
        held["gmf_data/sid"] = file["gmf_data/sid"][()]
        for name in ("events", *held):
            del file[name]
        file["events"] = events[events["id"] != lost]
        for name, values in held.items():
            file[name] = values[held["gmf_data/eid"] != lost]
    with pytest.raises(InputError, match=r"events of rupture \d+; it has \d+; export all events"):
        event_files.load(path, None)


@pytest.mark.parametrize("name", ["num_events", "investigation_time", "effective_time"])
@pytest.mark.parametrize("share", [1.0, 1.2])
def test_another_number_than_shaking_was_computed_for_is_told(
    tmp_path: Path, name: str, share: float
) -> None:
    """The time of all realizations is their number times that of one."""
    path = EventSet(400.0, ruptures=40).write_calculation(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        number, realizations = len(file["events"]), len(file["weights"])
        whole = {"num_events": number, "investigation_time": 1.0}
        whole["effective_time"] = 400.0 * realizations
        for one, value in whole.items():
            file["gmf_data"].attrs[one] = value * (share if one == name else 1.0)
    told = [line for line in event_files.load(path, None).model.unused if "gmf_data is" in line]
    assert len(told) == (share != 1.0)
    said = rf"gmf_data is of {whole[name] * share:g} .*, and the file has {whole[name]:g}: "
    assert all(re.match(said, line) for line in told)


def test_names_in_quotes_are_read(tmp_path: Path) -> None:
    """As R writes them."""
    plain = by_number(event_files.load(written(tmp_path), None).events)
    for name, text in FILES.items():
        lines = text.split("\n")
        at = 0 if name.startswith(("real", "site")) else 1
        lines[at] = ",".join(f'"{one}"' for one in lines[at].split(","))
        (tmp_path / name).write_text("\n".join(lines), encoding="utf-8")
    assert by_number(event_files.load(tmp_path, None).events) == plain


def test_shaking_of_a_calculation_is_at_one_site(tmp_path: Path) -> None:
    path = EventSet(400.0, ruptures=40).write_calculation(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        file["gmf_data/sid"][1] = 1
    with pytest.raises(InputError, match="shaking at several sites"):
        event_files.load(path, None)


def test_older_versions_number_their_measures(tmp_path: Path) -> None:
    """As OpenQuake 3.20 has them, here with PGV before PGA."""
    path = EventSet(400.0, ruptures=40).write_calculation(tmp_path / "calc_7.hdf5")
    new = event_files.load(path, None).events
    with h5py.File(path, "r+") as file:
        shaken = file["gmf_data"]
        shaken.attrs["imts"] = "SA(0.2) PGV PGA"
        shaken.move("PGV", "gmv_1")
        shaken.move("PGA", "gmv_2")
    old = event_files.load(path, None).events
    assert by_number(old) == by_number(new)
    assert old.pgv is not None


def test_a_surface_is_not_counted_from_the_end(tmp_path: Path) -> None:
    path = EventSet(400.0, ruptures=40).write_calculation(tmp_path / "calc_7.hdf5")
    with h5py.File(path, "r+") as file:
        ruptures = file["ruptures"][()]
        ruptures["geom_id"][0] -= 40
        file["ruptures"][()] = ruptures
    with pytest.raises(InputError, match="below the first"):
        event_files.load(path, None)


@pytest.mark.parametrize(("share", "told"), [(1.0, 0), (1.05, 1)])
def test_events_in_the_years_of_another_realization_are_told(
    tmp_path: Path, share: float, told: int
) -> None:
    """By years of a realization that its header has wrong; they follow each other."""
    folder = EventSet(2_000.0).write(tmp_path)
    path = folder / "ruptures_1.csv"
    path.write_text(path.read_text().replace("path=2000", f"path={2000 * share:.0f}"))
    lines = event_files.load(folder, None).model.unused
    said = f"in the {2000 * share:.0f} years of another realization"
    assert sum(said in line for line in lines) == told, lines


@pytest.mark.parametrize("number", ["20_00", "2000,5", "\N{FULLWIDTH DIGIT TWO}000"])
def test_an_effective_time_is_a_number(tmp_path: Path, number: str) -> None:
    """As the first line writes it, and no part of that."""
    folder = EventSet(2_000.0).write(tmp_path)
    path = folder / "ruptures_1.csv"
    text = path.read_text(encoding="utf-8").replace("path=2000", f"path={number}")
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"investigation_time: got .* are numbers above 0"):
        event_files.load(folder, None)


def test_an_effective_time_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    """One that the header contradicts, and one of which the years fill a fifth."""
    folder = EventSet(2_000.0).write(tmp_path)
    assert event_files.load(folder, 2_000.0).events.years == 2_000.0
    with pytest.raises(InputError, match=r"hazard.effective_time: got 1000; the files say 2000"):
        event_files.load(folder, 1_000.0)
    path = folder / "ruptures_1.csv"
    path.write_text(path.read_text().replace("path=2000", "path=10000"))
    with pytest.raises(InputError, match=r"apart only; \d+ events of 10000 years span"):
        event_files.load(folder, None)
    path.write_text(path.read_text().replace("ses_per_logic_tree_path", "ses"))
    with pytest.raises(InputError, match=r"each realization is of 1000 years"):
        event_files.load(folder, 1_000.0)
    with pytest.raises(InputError, match=r"events of 3900 years span more of them"):
        event_files.load(folder, 3_900.0)
    assert event_files.load(folder, 2_000.0).events.years == 2_000.0
