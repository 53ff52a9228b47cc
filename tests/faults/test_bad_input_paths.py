"""A pipe, a device or a file of a terabyte at every path that is given is refused in a line."""

from __future__ import annotations

import itertools
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np
import obspy
import pytest
import trimesh

from pipeline import ROOT
from pipeline.stages.studies.validation.recorded_tests import OUTCOMES, RECORDS
from tests.support.bad_input import bounded
from tests.support.recorded_tests import recorded_tests
from tests.support.suites import slow_but

Refused = Callable[..., str]

MADE_UP = ROOT / "data" / "raw" / "hazard" / "made_up"
EVENTS = ROOT / "data" / "raw" / "hazard" / "made_up_events"
BOX = "rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}\n"
AS_IS = "processing: {order: none, highpass: null, lowpass: null}, pga: 1"
AGE = "age: {kind: normal, mean: 9000, source: invented}"


def motion(given: str) -> str:
    return f"{BOX}motion: {{kind: record, {given}, {AS_IS}}}\n"


def hazard(given: str) -> str:
    return f"{BOX}hazard: {{curves: made_up, {AGE}, {given}}}\n"


class Given(NamedTuple):
    """A path of a command.

    Attributes
    ----------
    bad : str, the file that is none
    site : str, what names it, of those that stand in a site's YAML
    words : str, in the refusal
    """

    bad: str
    site: str
    command: str
    words: str = ""


SITES = {
    "rock.mesh": Given(
        "bad.ply", "rock: {shape: mesh, mesh: bad.ply, density: 2000}\n", "plan rock", "rock.mesh"
    ),
    "pedestal.mesh": Given(
        "bad.ply",
        "rock: {shape: mesh, mesh: box.ply, density: 2000, pose: {position: [0, 0, 1]}}\n"
        "pedestal: {shape: mesh, mesh: bad.ply}\n",
        "plan rock",
        "pedestal.mesh",
    ),
    "uncertainty.scan.replica": Given(
        "bad.ply",
        "rock: {shape: mesh, mesh: box.ply, density: 2000}\n"
        "uncertainty: {scan: {replica: bad.ply}}\n",
        "plan uncertainty",
        "uncertainty.scan.replica",
    ),
    "motion.files": Given("bad.at2", motion("files: bad.at2"), "plan motions", "motion.files"),
    "motion.files of a table": Given(
        "bad.csv",
        f"{BOX}motion: {{kind: table, files: bad.csv, pga: 1}}\n",
        "plan motions",
        "motion.files",
    ),
    "motion.files, a folder": Given(
        "records/bad.at2", motion("files: records"), "plan motions", "motion.files"
    ),
    "motion.records.file": Given(
        "bad.v2", motion("records: [{file: bad.v2}]"), "plan motions", "motion.records"
    ),
    "motion.records.components": Given(
        "bad.at2", motion("records: [{components: {x: bad.at2}}]"), "plan motions", "motion.records"
    ),
    "motion.response.file": Given(
        "bad.xml",
        motion("files: one.mseed, response: {file: bad.xml, corners: [0.1, 0.2, 20, 30]}"),
        "plan motions",
        "motion.response.file",
    ),
    "observations.motion": Given(
        "bad.at2",
        f"{BOX}observations: [{{kind: shake, motion: bad.at2, direction: 0, outcome: stood}}]\n",
        "plan observations",
        "observations.0.motion",
    ),
    "hazard.curves": Given(
        "bad.hdf5", f"{BOX}hazard: {{curves: bad.hdf5, {AGE}}}\n", "plan hazard"
    ),
    "hazard.events": Given(
        "bad.hdf5", f"{BOX}hazard: {{events: bad.hdf5, {AGE}}}\n", "plan hazard"
    ),
    "hazard.disaggregation": Given("bad.csv", hazard("disaggregation: bad.csv"), "plan hazard"),
    "hazard.faults": Given("bad.csv", hazard("faults: bad.csv"), "plan exclusion"),
    "hazard.ground_motion": Given("bad.csv", hazard("ground_motion: bad.csv"), "plan exclusion"),
    "hazard.age.file": Given(
        "bad.csv",
        f"{BOX}hazard: {{curves: made_up, age: {{kind: samples, file: bad.csv}}}}\n",
        "plan hazard",
    ),
    "hazard.history.until.file": Given(
        "bad.csv",
        hazard("history: [{site: box.yaml, until: {kind: samples, file: bad.csv}}]"),
        "plan hazard",
    ),
    "hazard.history.site": Given(
        "bad.yaml",
        hazard("history: [{site: bad.yaml, until: {kind: normal, mean: 2000}}]"),
        "plan hazard",
    ),
    "hazard.rocks.archive": Given(
        "bad.csv", hazard(f"rocks: [{{site: A, archive: bad.csv, {AGE}}}]"), "plan hazard"
    ),
    "hazard.rocks.site": Given(
        "bad.yaml", hazard(f"rocks: [{{site: bad.yaml, {AGE}}}]"), "plan hazard"
    ),
    "hazard.compare.study": Given(
        "bad.yaml", hazard("compare: [{name: other, study: bad.yaml}]"), "plan hazard"
    ),
    **{
        f"curves, {name}": Given(f"made_up/{name}", hazard("rocks: []"), "plan hazard")
        for name in ("hazard_curve-rlz-000-PGA_1.csv", "realizations_1.csv", "about.txt")
    },
    "curves of nshmp-haz": Given(
        "nshmp/PGA/curves.csv", f"{BOX}hazard: {{curves: nshmp, {AGE}}}\n", "plan hazard"
    ),
    **{
        f"events, {name}": Given(
            f"events/{name}_1.csv", f"{BOX}hazard: {{events: events, {AGE}}}\n", "plan hazard"
        )
        for name in ("gmf-data", "events", "ruptures", "realizations", "sitemesh")
    },
}

LINES = {
    "--site": Given("bad.yaml", "", "plan --site bad.yaml"),
    "--study": Given("bad.yaml", "", "plan --site box.yaml --study bad.yaml"),
    "--table of hardware": Given("bad.yaml", "", "feasible --site box.yaml --table bad.yaml"),
    "--curves": Given("bad.h5", "", "plan hazard --site aged.yaml --set hazard.curves=bad.h5"),
    **{
        f"--table, {name}": Given(f"tests/{name}", "", "run validation --table tests")
        for name in (OUTCOMES, RECORDS, "table.yaml", "sp1.ply")
    },
    "archive": Given("bad.csv", "", "archive bad.csv"),
    "check": Given("bad.zip", "", "check bad.zip"),
    "compare, one": Given("bad.zip", "", "compare bad.zip whole --to page.html"),
    "compare, other": Given("bad.zip", "", "compare whole bad.zip --to page.html"),
    "--scheduler-file": Given(
        "bad.json", "", "run responses --site box.yaml --scheduler-file bad.json"
    ),
    "figures --record": Given("bad.at2", "", "figures --fig 7 --record bad.at2 --workers 0"),
}

READ = SITES | LINES

WRITTEN = {
    "--log-file": Given("bad.log", "", "plan --site box.yaml --log-file bad.log"),
    "--graph": Given("bad.svg", "", "plan --site box.yaml --graph bad.svg"),
    "compare --to": Given("bad.html", "", "compare whole whole --to bad.html"),
    "export --to": Given("bad.zip", "", "export whole --to bad.zip"),
}


def sparse(path: Path) -> None:
    """A file of a terabyte, of holes, which take no room."""
    with path.open("wb") as file:
        file.truncate(1 << 40)


KINDS: dict[str, Callable[[Path], Any]] = {
    "a pipe": os.mkfifo,
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a terabyte": sparse,
}
EACH = list(itertools.product(READ, KINDS))


@contextmanager
def within(seconds: int) -> Iterator[None]:
    """Fail where it takes longer, as for who waits for a pipe; CPU time is bounded elsewhere."""

    def late(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with sound files of each kind."""
    place = tmp_path / "here"
    for name in ("tests", "records", "whole/.stages", "nshmp/PGA", "made_up", "events"):
        (place / name).mkdir(parents=True)
    monkeypatch.chdir(place)
    (place / "box.yaml").write_text(BOX)
    (place / "aged.yaml").write_text(f"{BOX}hazard: {{{AGE}}}\n")
    box = trimesh.creation.box((0.5, 0.5, 1.0))
    box.export(place / "box.ply")
    recorded_tests(place / "tests")
    box.export(place / "tests" / "sp1.ply")
    (place / "tests" / "table.yaml").write_text("# as usual\n")
    trace = obspy.Trace(np.sin(0.1 * np.arange(1000.0)), {"delta": 0.01, "channel": "HNE"})
    trace.write(str(place / "one.mseed"), format="MSEED")
    for name, source in (("made_up", "made_up"), ("events", "made_up_events")):
        for path in (ROOT / "data" / "raw" / "hazard" / source).iterdir():
            (place / name / path.name).symlink_to(path)
    return place


def command(here: Path, given: Given) -> list[str]:
    """The words of a command, its site written."""
    if not given.site:
        return given.command.split()
    (here / "site.yaml").write_text(given.site)
    return [*given.command.split(), "--site", "site.yaml"]


@pytest.mark.parametrize(("name", "kind"), slow_but(EACH[::4], EACH))
def test_what_is_no_regular_file_or_too_large_is_refused(
    here: Path, refused: Refused, name: str, kind: str
) -> None:
    given = READ[name]
    (here / given.bad).unlink(missing_ok=True)
    KINDS[kind](here / given.bad)
    with within(seconds=60), bounded(seconds=10.0, mebibytes=300.0):
        refused(*command(here, given), words=(given.words,))


@pytest.mark.parametrize("name", slow_but([*READ][::4], [*READ]))
def test_what_a_bad_disk_does_not_give_is_refused(here: Path, refused: Refused, name: str) -> None:
    """A regular file of which the system says that reading it is an input/output error."""
    given = READ[name]
    (here / given.bad).unlink(missing_ok=True)
    (here / given.bad).symlink_to("/proc/self/mem")
    refused(*command(here, given), words=())


@pytest.mark.parametrize("kind", ["a pipe", "a device"])
@pytest.mark.parametrize("name", WRITTEN)
def test_nothing_is_written_to_a_pipe_or_a_device(
    here: Path, refused: Refused, name: str, kind: str
) -> None:
    given = WRITTEN[name]
    KINDS[kind](here / given.bad)
    with within(seconds=60):
        refused(*command(here, given), words=(given.bad,))
    assert (here / given.bad).exists()
