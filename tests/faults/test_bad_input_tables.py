"""Tables from outside that are damaged are refused in a line, or say what the whole ones say.

A digit in place of another is no damage that a reader can see; a file that is cut is, and so is a
line that is lost or there twice.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline import ROOT
from pipeline.stages.hazard import curve_folder, event_files
from pipeline.stages.hazard.shaking_ratio import load_disaggregation
from pipeline.stages.studies.validation.recorded_tests import OUTCOMES
from pipeline.stages.studies.validation.recorded_tests import tests_in as read_tests
from pipeline.workflow.store import read_manifest
from tests.support.bad_input import bounded, broken, taken_or_refused
from tests.support.event_sets import EventSet
from tests.support.recorded_tests import recorded_tests

MADE_UP = ROOT / "data" / "raw" / "hazard" / "made_up"
CURVE = "hazard_curve-rlz-{:03d}-PGA_1.csv"


def curves(folder: Path) -> Path:
    """The first two of the shipped curves; the last line of one has no end."""
    for number in range(2):
        text = (MADE_UP / CURVE.format(number)).read_text(encoding="utf-8")
        (folder / CURVE.format(number)).write_text(text, encoding="utf-8")
    (folder / "realizations_1.csv").write_text("rlz_id,branch_path,weight\n0,A,0.25\n1,B,0.75\n")
    (folder / "about.txt").write_text("Made up.")
    return folder


def nshmp(folder: Path) -> Path:
    (folder / "PGA").mkdir()
    text = "name,lon,lat,0.01,0.1,1.0\nhere,-120.9,35.2,2.0e-1,4.0e-3,2.0e-5\n"
    (folder / "PGA" / "curves.csv").write_text(text)
    return folder


def calculation(folder: Path) -> Path:
    with h5py.File(folder / "calc_7.hdf5", "w") as file:
        file["hcurves-rlzs"] = np.array([[[[0.1, 4e-3, 2e-5]], [[0.2, 8e-3, 4e-5]]]], dtype="f4")
        file["hcurves-rlzs"].attrs["json"] = json.dumps({"imt": ["PGA"]})
        file["weights"] = np.array([0.25, 0.75])
        file["sitecol/lon"], file["sitecol/lat"] = [-120.9], [35.2]
        file["full_lt/sm_data"] = np.array([(b"b",)], dtype=[("path", "S9")])
        file["full_lt/gsim_lt"] = np.array([(b"A",), (b"B",)], dtype=[("branch", "S9")])
        settings_ = {"hazard_imtls": {"PGA": [0.01, 0.1, 1.0]}, "investigation_time": 1.0}
        file["oqparam"] = json.dumps(settings_)
    return folder / "calc_7.hdf5"


def disaggregation(folder: Path) -> Path:
    rows = ['#,,,,,"mag_bin_edges=[5.0, 6.0, 8.0], dist_bin_edges=[0.0, 20.0, 40.0]"']
    rows += ["imt,iml,poe,mag,dist,mean"]
    rows += [
        f"PGA,5.0E-01,1.0e-03,{mag},{dist},{share:.5E}"
        for mag in ("5.5", "7.0")
        for dist, share in (("10.0", 3e-4), ("30.0", 0.0))
    ]
    (folder / "Mag_Dist-mean-0_1.csv").write_text("\n".join(rows) + "\n")
    return folder


def manifest(folder: Path) -> Path:
    facts = {"config": {}, "inputs": {}, "versions": {}, "code": {}, "needs": {"rock": "k"}}
    whole = {"key": "k", "facts": facts, "files": {"a.nc": "x"}, "unresolved": 0, "retry": 0}
    (folder / "one.json").write_text(json.dumps(whole))
    return folder / "one.json"


class Reader(NamedTuple):
    """What is written, which of it is damaged, and what is read of it."""

    write: Callable[[Path], Path]
    damaged: str
    read: Callable[[Path], Any]


def of_model(path: Path) -> Any:
    found = curve_folder.load(path)
    return [
        (one.name, one.path, one.weight, one.pga.levels.tolist(), one.pga.rates.tolist())
        for one in found.branches
    ], curve_folder.about(path)


def of_disaggregation(path: Path) -> Any:
    """What a disaggregation says; None where it is told that bins are missing."""
    found = load_disaggregation(path)
    if any("taken as empty" in words for words in found.unused):
        return None
    parts = found.magnitudes, found.distances, found.levels, found.shares
    return [one.tolist() for one in parts]


def events(folder: Path) -> Path:
    return EventSet(400.0, ruptures=40).write(folder)


def stored_events(folder: Path) -> Path:
    return EventSet(400.0, ruptures=40).write_calculation(folder / "calc_7.hdf5")


def of_events(path: Path) -> Any:
    found = event_files.load(path, None)
    one = found.events
    columns = one.pga, one.pgv, one.branch, one.rupture
    branches = [(branch.name, branch.path, branch.weight) for branch in found.model.branches]
    assert one.ruptures is not None
    told = one.years, found.model.location, branches, one.ruptures.distances.tolist()
    return told, sorted(zip(*(np.asarray(column).tolist() for column in columns), strict=True))


READERS = {
    "events": Reader(events, "events_1.csv", of_events),
    "fields": Reader(events, "gmf-data_1.csv", of_events),
    "stored events": Reader(stored_events, "calc_7.hdf5", of_events),
    "ruptures": Reader(events, "ruptures_1.csv", of_events),
    "curve": Reader(curves, CURVE.format(0), of_model),
    "realizations": Reader(curves, "realizations_1.csv", of_model),
    "nshmp": Reader(nshmp, "PGA/curves.csv", of_model),
    "calculation": Reader(calculation, "calc_7.hdf5", of_model),
    "disaggregation": Reader(disaggregation, "Mag_Dist-mean-0_1.csv", of_disaggregation),
    "outcomes": Reader(
        recorded_tests, OUTCOMES, lambda path: vars(read_tests(path)) | {"unused": ()}
    ),
    "manifest": Reader(manifest, "one.json", read_manifest),
}


@st.composite
def lines_lost(draw: st.DrawFn, whole: bytes) -> bytes:
    """A file that is cut, or a line of which is lost or there twice."""
    lines = whole.splitlines(keepends=True)
    at = draw(st.integers(0, len(lines) - 1))
    return draw(
        st.sampled_from(
            (b"".join(lines[:at] + lines[at + 1 :]), b"".join([*lines[: at + 1], *lines[at:]]))
        )
        | st.integers(0, len(whole) - 1).map(lambda length: whole[:length])
    )


@lru_cache(maxsize=1)
def whole(folder: Path, name: str) -> tuple[Path, Path, bytes, Any]:
    """What is read, the file that is damaged, its content, and what the whole one says."""
    reader = READERS[name]
    path = reader.write(folder)
    file = folder / reader.damaged
    return path, file, file.read_bytes(), reader.read(path)


SOME = settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
MANY = settings(SOME, max_examples=20_000, derandomize=False)


def see(folder: Path, name: str, data: Any) -> None:
    path, file, content, said = whole(folder, name)
    # of events that are too weak there are no fields, so that a lost line of these is not seen
    seen = data.draw(st.booleans()) and name not in ("calculation", "stored events", "fields")
    file.write_bytes(data.draw((lines_lost if seen else broken)(content)))
    with bounded(seconds=2.0, mebibytes=200.0):
        found = taken_or_refused(lambda: READERS[name].read(path))
    assert found is None or not seen or found == said


@pytest.mark.parametrize("name", READERS)
@SOME
@given(data=st.data())
def test_damaged_table_is_refused_or_whole(tmp_path: Path, name: str, data: Any) -> None:
    see(tmp_path, name, data)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
@MANY
@given(data=st.data())
def test_hunt_of_damaged_tables(tmp_path: Path, name: str, data: Any) -> None:
    see(tmp_path, name, data)


def test_a_column_of_a_specimen_beyond_counting_is_named(tmp_path: Path) -> None:
    recorded_tests(tmp_path)
    text = (tmp_path / OUTCOMES).read_text()
    (tmp_path / OUTCOMES).write_text(text.replace("dem_s1_soft", f"specimen{'9' * 5000}"))
    assert any("says nothing here" in words for words in read_tests(tmp_path).unused)


def test_bins_without_a_row_are_named(tmp_path: Path) -> None:
    """A file that leaves empty bins out, and one that is cut after a row, are alike."""
    file = disaggregation(tmp_path) / "Mag_Dist-mean-0_1.csv"
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:3]))
    (words,) = load_disaggregation(tmp_path).unused
    assert words.startswith("3 bins of PGA not in Mag_Dist")
