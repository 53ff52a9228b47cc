"""The study of a sweep: its dataset, what its members share, and what similarity says of it."""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr
from conftest import Ran
from matplotlib.figure import Figure

from pipeline.config.slips import IDLE, UNUSED
from pipeline.workflow.run_store import RUNS
from tests.support import record_files

SITE = """rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}
motion: {pga: [0.2, 0.3, 0.4, 0.6], pgv_pga: [0.1, 0.2, 0.3, 0.5]}
yaw: [0, 90]
simulation: {engine: nonsmooth, time_step: 0.008}
"""
SWEEP = """sweep:
  bounce: {contact.restitution: [0.0, 0.3]}
  friction: {contact.friction: [0.2, 0.6]}
"""


class Study:
    """A site, and studies of it."""

    def __init__(self, vsr: Callable[..., Ran], site: str, folder: Path, derived: Path) -> None:
        self.vsr, self.site, self.folder, self.derived = vsr, site, folder, derived

    def run(self, text: str, *more: str, name: str = "study") -> Ran:
        """Make a study; what was said."""
        (self.folder / f"{name}.yaml").write_text(text)
        ran = self.vsr("run", "study", *self.line(name), "--workers", "0", *more)
        assert ran.code == 0, ran.err
        return ran

    def line(self, name: str = "study") -> tuple[str, ...]:
        return ("--site", self.site, "--study", str(self.folder / f"{name}.yaml"))

    def data(self, name: str = "study") -> xr.Dataset:
        return xr.load_dataset(self.made / name / "study.nc", mask_and_scale=False)

    def page(self, name: str) -> str:
        return (self.made / name / "study.html").read_text(encoding="utf-8")

    @property
    def made(self) -> Path:
        return self.derived / "rock" / "studies"

    def stored(self) -> int:
        """Runs in the one database of the site, its folder and all beneath it."""
        (database,) = self.derived.rglob(RUNS)
        assert database.parent == self.derived / "rock"
        with closing(sqlite3.connect(database)) as runs:
            ((count,),) = runs.execute("SELECT count(*) FROM runs")
        return int(count)

    def done(self, stage: str = "runs") -> int:
        """Runs that were simulated or proved, by all commands together."""
        lines = [
            json.loads(line)
            for log in self.derived.rglob("log.jsonl")
            for line in log.read_text().splitlines()
        ]
        return sum(line["runs"] for line in lines if line["stage"] == stage)


@pytest.fixture
def study(
    vsr: Callable[..., Ran],
    write_site: Callable[..., str],
    tmp_path: Path,
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Study:
    def blank(figure: Figure) -> str:  # figures are drawn, but only rendering them takes long
        assert figure.axes
        return "data:,"

    monkeypatch.setattr("pipeline.stages.studies.sweeps.study.svg_uri", blank)
    return Study(vsr, write_site(SITE), tmp_path, derived)


def test_a_sweep_is_the_separate_runs_bit_for_bit(study: Study, tmp_path: Path) -> None:
    said = study.run(SWEEP).err.splitlines()[-3]
    data = study.data()
    assert data["overturned"].dims == ("bounce", "yaw", "friction", "pgv_pga", "pga")
    assert data["bounce"].values.tolist() == [0.0, 0.3]
    assert data["bounce"].attrs["keys"] == "contact.restitution"
    assert len(np.unique(data["overturned"])) == 2
    for bounce, friction in ((0.0, 0.2), (0.3, 0.6)):
        keys = (f"contact.restitution={bounce}", f"contact.friction={friction}")
        into = tmp_path / f"{bounce}-{friction}"
        line = ("--site", study.site, "--workers", "0", "--set", keys[0], "--set", keys[1])
        assert study.vsr("run", "responses", *line, into=into).code == 0
        alone = xr.load_dataset(into / "rock" / "responses.nc", mask_and_scale=False)
        part = data.sel(bounce=bounce, friction=[friction])
        for name in alone.data_vars:
            assert part[name].dtype == alone[name].dtype, name
            np.testing.assert_array_equal(part[name].values, alone[name].values, name)
    # the fits and the boundary are those of the members
    one = xr.load_dataset(study.made / "study" / "bounce=0.3" / "fragility.nc")
    part = data.sel(bounce=0.3)
    ends = ("first_overturning_pga_lower", "first_overturning_pga_upper")
    for name in ("first_overturning_pga", *ends, "median_pga", "log_loss"):
        np.testing.assert_array_equal(part[name].values, one[name].values, name)
    bracketed = one[ends[0]].notnull()
    middle = np.sqrt(one[ends[0]] * one[ends[1]]).where(bracketed)
    np.testing.assert_array_equal(one["first_overturning_pga"].where(bracketed), middle)
    _check_page(study, said.partition("; ")[2])


def _check_page(study: Study, headline: str) -> None:
    page = (study.made / "study" / "study.html").read_text()
    assert headline in page.replace("&#39;", "'")
    assert page.count("<img") == 6
    assert "levels without a known change" in page  # not unchanged
    assert "The boundary is the first-overturning PGA" in page
    assert "Compared with bounce 0, " in headline
    assert (
        "At 0.2 nothing topples up to the highest PGA tried there." in headline
    )  # a friction below 1:4, or 1:2
    assert "is that of the runs alone" in page  # as steps that are given have no error


@pytest.mark.slow
def test_nothing_is_run_or_made_twice(study: Study) -> None:
    line = ("--site", study.site, "--workers", "0")
    assert study.vsr("run", "responses", *line).code == 0
    assert study.stored() == study.done() == 2 * 4 * 4
    first = study.run("sweep: {bounce: {contact.restitution: [0.0, 0.3]}}").err
    assert "bounce=0: runs: as in rock" in first  # the site's own
    assert "bounce=0.3: motions: as in" in first
    assert study.done() == 2 * 32
    assert study.stored() == study.done() + study.done("boundary")

    wider = study.run("sweep: {bounce: {contact.restitution: [0.0, 0.3, 0.1]}}").err
    assert "bounce=0:" not in wider
    assert "bounce=0.3:" not in wider
    assert "bounce=0.1: runs: 32 runs done" in wider
    assert study.done() == 3 * 32
    between = study.done("boundary")
    assert study.stored() == study.done() + between

    # another study of the same site, though its members are others, has its runs already
    two = study.run("yaw: 90\nsweep: {e: {contact.restitution: [0.1, 0.3]}}", name="other").err
    assert two.count("runs: 0 runs done") == 2
    assert study.done() == 3 * 32
    assert study.done("boundary") == between
    _check_questions(study)
    before = (study.made / "study" / "study.html").stat().st_mtime_ns
    study.run("sweep: {bounce: {contact.restitution: [0.0, 0.3, 0.1]}}")
    assert (study.made / "study" / "study.html").stat().st_mtime_ns == before


def _check_questions(study: Study) -> None:
    told = study.vsr("status", *study.line()).out
    assert told.count("32 of 32 runs stored") == 3
    assert study.vsr("plan", *study.line()).out.count("runs: 32; 32 stored, 0 to do") == 3
    assert "study: up to date" in study.vsr("why", *study.line()).out
    more = (*study.line(), "--set", "motion.pga=[0.2, 0.3, 0.4, 0.52, 0.6]")
    why = study.vsr("why", *more).out.splitlines()
    assert sum("motion.pga changed: 1 value added" in line for line in why) >= 2
    assert "study: stage bounce=0.3 changed" in why
    assert "  runs: 32 of 40 are stored and stay; 8 to do" in why


SIMILAR = """
motion: {pga: [0.3, 0.32, 0.34, 0.36, 0.4, 0.5]}
sweep:
  size:
    rock.size: [[0.5, 0.5, 1.5], [2, 2, 6], [8, 8, 24]]
    simulation.time_step: [0.004, 0.008, 0.016]
    motion.pgv_pga: [[0.1, 0.2, 0.4], [0.2, 0.4, 0.8], [0.4, 0.8, 1.6]]
"""


@pytest.mark.slow
def test_similar_rocks_topple_alike(study: Study) -> None:
    """PGV/PGA and the time step as the square root of the size: no outcome differs."""
    study.run(SIMILAR, "--set", "yaw=0")
    data = study.data().squeeze(drop=True)
    grids = ([0.1, 0.2, 0.4], [0.2, 0.4, 0.8], [0.4, 0.8, 1.6])
    parts = [data.isel(size=n).sel(pgv_pga=list(grid)) for n, grid in enumerate(grids)]
    assert len(np.unique(parts[0]["overturned"])) == 2
    for part in parts[1:]:
        for name in ("overturned", "outcome", "decided_by", "first_overturning_pga"):
            np.testing.assert_array_equal(part[name].values, parts[0][name].values, name)
        tilts = (one["tilt_until_decided"].values for one in (part, parts[0]))
        np.testing.assert_allclose(*tilts, rtol=1e-6, atol=1e-4)
    assert (data["rock_radius"] / data["rock_radius"][0]).values.tolist() == [1.0, 4.0, 16.0]
    # what was not run is told from what was
    assert (data.isel(size=0).sel(pgv_pga=1.6)["outcome"] == -1).all()
    page = (study.made / "study" / "study.html").read_text()
    assert "The normalised boundaries differ by 0.00 % in the median and 0.00 % at most" in page


@pytest.mark.slow
def test_motions_of_several_kinds_stand_side_by_side(study: Study) -> None:
    """What only records have is told."""
    records = Path(__file__).parents[2] / "data" / "raw" / "records"
    ran = study.run(f"""
yaw: 0
sweep:
  shape:
    motion:
      - {{kind: cosine_pulse}}
      - {{kind: ricker_pulse}}
      - {{kind: record, files: {records}, pga: [0.2, 0.4],
          processing: {{order: standard, highpass: 0.1, lowpass: 25}}}}
""")
    data = study.data()
    (told,) = (line for line in ran.err.splitlines() if "as some members have none: " in line)
    named = set(told.partition("none: ")[2].split(", "))
    files = ("responses", "fragility")
    made = [path for path in study.made.rglob("*.nc") if path.stem in files]
    held = set().union(*(xr.load_dataset(path).variables for path in made))
    assert named - {"record_pgv_pga"} == held - set(data.variables) - {"record"}
    assert data["shape"].values.tolist() == ["cosine_pulse", "ricker_pulse", "record"]
    ran = (data["outcome"] >= 0).any(["yaw", "friction", "pga"])
    pulses = ran.sel(shape="cosine_pulse")
    assert data["pgv_pga"].values[pulses].tolist() == [0.1, 0.2, 0.3, 0.5]
    assert (pulses == ran.sel(shape="ricker_pulse")).all()
    assert not (pulses & ran.sel(shape="record")).any()


@pytest.mark.slow
def test_records_are_compared_with_themselves_however_they_are_processed(study: Study) -> None:
    """Also mirror images, which have one PGV/PGA, and whose boundaries are those of one yaw."""
    folder = study.folder / "recorded"
    folder.mkdir()
    wave = record_files.shaking(3, 100.0, 20.0, 2.0, 0.6)
    for name, one in (("wave", wave), ("mirror", -wave), ("slow", np.repeat(wave, 2))):
        (folder / f"{name}.csv").write_text(record_files.csv(one, 0.01, "a [m/s2]"))
    ran = study.run("""
yaw: 0
motion: {kind: record, files: recorded, pga: [0.3, 0.6, 0.9, 1.2]}
sweep:
  filter:
    motion.processing:
      - {order: standard, highpass: 0.1, lowpass: 20}
      - {order: standard, highpass: 0.3, lowpass: 20}
""")
    data = study.data().squeeze(["yaw", "friction"])
    assert data["record"].values.tolist() == [["mirror", "wave", "slow"]] * 2
    ratio = data["record_pgv_pga"].values
    np.testing.assert_array_equal(ratio[:, 0], ratio[:, 1])
    assert (ratio[1] < ratio[0]).all()
    first = data["first_overturning_pga"]
    assert np.isfinite(first).all()
    np.testing.assert_allclose(first[:, 0], first[:, 1], rtol=0.02)  # of a box that is symmetric
    moved = np.expm1(np.log(first[1].values / first[0].values).mean())
    said = re.search(r"averaged over PGV/PGA, moves by (.)([\d.]+) %", ran.err)
    assert said is not None, ran.err
    sign = {"+": 1.0, "\N{MINUS SIGN}": -1.0}[said[1]]
    assert sign * float(said[2]) == pytest.approx(100.0 * moved, rel=0.06)


@pytest.mark.slow
def test_a_record_that_the_reference_lacks_is_compared_with_no_other(study: Study) -> None:
    """Of two sets of records those in both are compared, beside another dimension, too."""
    folder = study.folder / "recorded"
    folder.mkdir()
    for number in range(4):
        wave = record_files.shaking(number, 100.0, 20.0, 1.0 + 0.5 * number, 0.6)
        (folder / f"r{number}.csv").write_text(record_files.csv(wave, 0.01, "a [m/s2]"))
    files = [[f"recorded/r{n}.csv" for n in one] for one in ((0, 2, 3), (0, 1, 2))]
    study.run(f"""
yaw: 0
motion: {{kind: record, pga: [0.5, 1.0, 2.0, 3.0],
  processing: {{order: standard, highpass: 0.1, lowpass: 20}}}}
sweep:
  chosen: {{motion.files: {json.dumps(files)}}}
  bounce: {{contact.restitution: [0.0, 0.1]}}
""")
    data = study.data()
    ran = (data["outcome"] >= 0).any(["yaw", "friction", "pga"]).isel(bounce=0)
    names = [one[one != ""] for one in data["record"].isel(bounce=0).values]
    assert [sorted(one.tolist()) for one in names] == [["r0", "r2", "r3"], ["r0", "r1", "r2"]]
    assert ran.values.sum(axis=1).tolist() == [3, 3]
    assert (ran.values.all(axis=0)).sum() == 2
    row = re.search(r"r1\.csv x [^<]*</td>(.*?)</tr>", study.page("study"), re.DOTALL)
    assert row is not None
    told = re.findall(r">([^<]*)</td>", row[1])
    assert told[4] == "2"  # levels that are compared: r1 lies between two of the reference


@pytest.mark.slow
def test_records_of_one_name_are_not_one_and_pulses_lie_between_none(study: Study) -> None:
    for folder, period in (("one", 1.0), ("other", 2.0)):
        (study.folder / folder).mkdir()
        for number in (1, 2):
            wave = record_files.shaking(number, 100.0, 20.0, number * period, 0.6)
            text = record_files.csv(wave, 0.01, "a [m/s2]")
            (study.folder / folder / f"r{number}.csv").write_text(text)
    order = "processing: {order: standard, highpass: 0.1, lowpass: 20}"
    study.run(f"""
yaw: 0
motion: {{kind: record, pga: [0.3, 0.6, 0.9, 1.2], {order}}}
sweep: {{place: {{motion.files: [one, other]}}}}
""")
    ran = (study.data()["outcome"] >= 0).any(["yaw", "friction", "pga"]).values
    assert (ran.sum(axis=1).tolist(), (ran.all(axis=0)).sum()) == ([2, 2], 0)
    assert "No PGV/PGA level has a boundary at both" in study.page("study")
    study.run(
        f"""
yaw: 0
sweep:
  kind:
    motion:
      - {{kind: record, files: one, pga: [0.3, 0.6, 0.9, 1.2], {order}}}
      - {{kind: cosine_pulse, pga: [0.3, 0.6, 0.9, 1.2], pgv_pga: [0.15, 0.2, 0.25]}}
""",
        name="kinds",
    )
    data = study.data("kinds")
    names = [sorted(filter(None, row.tolist())) for row in data["record"].values]
    assert names == [["r1", "r2"], []]
    assert "No PGV/PGA level has a boundary at both" in study.page("kinds")


def test_any_product_can_be_swept(study: Study) -> None:
    text = "sweep: {size: {rock.size: [[0.5, 1, 2], [0.5, 1, 3]]}}"
    (study.folder / "study.yaml").write_text(text)
    assert study.vsr("run", "rock", *study.line(), "--workers", "0").code == 0
    data = study.data()
    assert data["tipping_pga"].dims == ("size", "direction")
    np.testing.assert_allclose(data["tipping_pga"].sel(direction=0), [0.25, 0.5 / 3.0])
    page = study.page("study")
    assert "Members and data" in page
    assert "boundary" not in page  # which a rock has none of


def test_a_sweep_of_what_nothing_uses_is_refused(study: Study) -> None:
    """Gains of a servo, where none drives the table; where one does, and by `drive`, they count."""
    text = "simulation: {engine: auto}\nyaw: 0\nsweep:\n  gain: {servo.kp: [5.0e+7, 2.0e+7]}\n"
    (study.folder / "study.yaml").write_text(text)
    ran = study.vsr("run", "study", *study.line(), "--workers", "0")
    assert ran.code == 2
    (told,) = ran.err.splitlines()
    assert "study.yaml: sweep.gain: got servo.kp; fragility does not depend on it here" in told
    assert not list(study.derived.rglob("*.nc"))
    assert study.vsr("plan", *study.line()).code == 2
    assert study.vsr("plan", "drive", *study.line()).code == 0
    assert study.vsr("plan", *study.line(), "--set", "drive=servo").code == 0
    with (study.folder / "study.yaml").open("a") as file:
        file.write("  by: {drive: [table_frame, servo]}\n")
    assert study.vsr("plan", *study.line()).code == 0
    # the report's text reads it, and the boundary, which is compared, does not
    inset = "yaw: 0\nsweep:\n  inset: {uncertainty.inset: [[0.0, 0.0], [0.03, 0.034]]}\n"
    (study.folder / "study.yaml").write_text(inset)
    for product in ("study", "fragility"):
        ran = study.vsr("plan", product, *study.line())
        assert ran.code == 2
        assert "sweep.inset: got uncertainty.inset; fragility does not depend on it" in ran.err
    law = "contact.restitution_law: [newton, energetic]"
    both = "rock.scale: [1.0, 2.0], pedestal.point_on_rock: [[0, 0, 1], [0, 0, 2]]"
    for keys, rule in (
        ("rock.scale: [1.0, 2.0]", "rock.scale; a box is as large as rock.size says"),
        (both, "rock.scale, pedestal.point_on_rock; level ground has no part for it"),
        ("pedestal.seat: [rim, whole]", "pedestal.seat; level ground has no part for it"),
        ("rock.closing: [caps, hull]", "rock.closing; a box is not scanned"),
        (law, "contact.restitution_law; without restitution no law of it has a part"),
    ):
        (study.folder / "study.yaml").write_text(f"yaw: 0\nsweep:\n  scale: {{{keys}}}\n")
        ran = study.vsr("plan", *study.line())
        assert ran.code == 2
        assert f"sweep.scale: got {rule}" in ran.err


def test_laws_of_restitution_are_swept_where_something_rebounds(study: Study) -> None:
    """By restitution of the site, by that of draws, and in another dimension."""
    text = "yaw: 0\nsweep:\n  law: {contact.restitution_law: [newton, energetic]}\n"
    (study.folder / "study.yaml").write_text(text)
    assert study.vsr("plan", *study.line()).code == 2
    assert study.vsr("plan", *study.line(), "--set", "contact.restitution=0.2").code == 0
    assert study.vsr("plan", "uncertainty", *study.line()).code == 0
    with (study.folder / "study.yaml").open("a") as file:
        file.write("  bounce: {contact.restitution: [0.0, 0.2]}\n")
    assert study.vsr("plan", *study.line()).code == 0


UNUSED_BY = {
    "rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}": {
        "rock.closing": "hull",
        "rock.fallback": "granite_dells",
        "contact.restitution_law": "energetic",
    },
    "rock: {shape: mesh, mesh: post.ply, density: 2110}": {
        "pedestal.seat": "whole",
        "pedestal.fallback": "sine_hills",
        "rock.contact_shape": "pieces",
        "rock.contact_error": "0.2",
    },
}


@pytest.mark.parametrize("rock", UNUSED_BY, ids=("box", "scan"))
def test_what_cannot_be_swept_changes_nothing(study: Study, tmp_path: Path, rock: str) -> None:
    trimesh.creation.cylinder(0.3, 2.0, 8).export(study.folder / "post.ply")
    Path(study.site).write_text(SITE.replace(SITE.splitlines()[0], rock))
    line, found = ("--site", study.site, "--workers", "0"), []
    keys = [f"--set={key}={value}" for key, value in UNUSED_BY[rock].items()]
    for name, settings in (("as given", ()), ("set", keys)):
        ran = study.vsr("run", "responses", *line, *settings, into=tmp_path / name)
        assert ran.code == 0, ran.err
        assert "warning" not in ran.err
        found.append(xr.load_dataset(tmp_path / name / "rock" / "responses.nc"))
    assert len(np.unique(found[0]["overturned"])) == 2
    assert found[0].equals(found[1])


def test_every_key_that_is_refused_so_was_tried() -> None:
    refused = {key for keys, *_ in UNUSED[len(IDLE) :] for key in keys.split()}
    assert refused == set().union(*UNUSED_BY.values())


def test_a_member_of_which_the_product_is_not_made_is_refused(study: Study) -> None:
    """By each command: one without draws, or without observations, beside one that has some."""
    tilt = "[{kind: tilt, direction: 0, angle: 10, outcome: stood, sd: 2}]"
    density = "rock.density: [2000, 2500]"
    for product, more, dimension, rule in (
        ("uncertainty", "uncertainty: {members: 0}", density, "rocks are drawn, one a member"),
        ("uncertainty", "", "uncertainty.members: [4, 0]", "rocks are drawn, one a member"),
        ("observations", "uncertainty: {members: 4}", density, "by what was observed"),
        ("observations", "", f"observations: [{tilt}, []]", "by what was observed"),
    ):
        (study.folder / "study.yaml").write_text(f"{more}\nsweep:\n  one: {{{dimension}}}\n")
        for command in ("plan", "why", "status", "run"):
            ran = study.vsr(command, product, *study.line())
            assert ran.code == 2, (command, dimension)
            assert rule in ran.err.splitlines()[-1], (command, dimension)
    assert not list(study.derived.rglob("*.nc"))


@pytest.mark.slow
def test_a_member_that_becomes_the_site_becomes_the_reference(study: Study) -> None:
    found = []
    for own in ("", "contact: {restitution: 0.3}\n"):
        Path(study.site).write_text(SITE.replace("[0, 90]", "0") + own)
        study.run("sweep: {bounce: {contact.restitution: [0.0, 0.3]}}")
        found += re.findall(r">([^<>]*) \(reference\)", study.page("study"))
    assert found == ["0", "0.3"]


def test_what_differs_in_length_between_members_is_told(study: Study) -> None:
    for name, sections in (("post", 8), ("can", 40)):
        trimesh.creation.cylinder(0.3, 2.0, sections).export(study.folder / f"{name}.ply")
    Path(study.site).write_text("rock: {shape: mesh, mesh: post.ply, density: 2110}\n")
    (study.folder / "study.yaml").write_text("sweep: {form: {rock.mesh: [post.ply, can.ply]}}\n")
    ran = study.vsr("run", "rock", *study.line(), "--workers", "0")
    assert ran.code == 0, ran.err
    (told,) = (line for line in ran.err.splitlines() if "as members differ in length: " in line)
    named = set(re.split(", | and ", told.partition("what lies along ")[2]))
    post, can = (xr.load_dataset(path).sizes for path in study.made.rglob("rock.nc"))
    assert "face" in named
    assert named == {name for name in post if post[name] != can[name]}
    assert not named & set(study.data().dims)


@pytest.mark.slow
def test_no_member_runs_where_one_cannot(study: Study) -> None:
    """Bullet drops a block of 1:100, which is known once it is made: before any run."""
    (study.folder / "study.yaml").write_text(
        "simulation: {engine: bullet, time_step: 0.0005}\n"
        "sweep: {size: {rock.size: [[0.5, 1, 2], [0.02, 1, 2]]}}"
    )
    ran = study.vsr("run", "study", *study.line(), "--workers", "0")
    assert ran.code == 2
    assert "where nothing shakes it" in ran.err.splitlines()[-1]
    assert not list(study.derived.rglob(RUNS))


@pytest.mark.slow
def test_pages_of_members_lead_to_all_results(study: Study) -> None:
    """Also where the site has made the same page already, in another folder."""
    text = "sweep: {size: {rock.size: [[0.5, 1, 2], [0.5, 1, 3]]}}\nuncertainty: {members: 0}\n"
    (study.folder / "study.yaml").write_text(text)
    line = ("--set", "uncertainty.members=0", "--workers", "0")
    assert study.vsr("run", "exclusion", "--site", study.site, *line).code == 0
    assert study.vsr("run", "exclusion", *study.line(), "--workers", "0").code == 0
    pages = [*study.derived.rglob("exclusion.html"), *study.derived.rglob("study.html")]
    assert len(pages) == 4
    for page in pages:
        links = re.findall(r'href="([^"#]*)">All results<', page.read_text(encoding="utf-8"))
        assert [(page.parent / link).resolve() for link in links] == [study.derived / "index.html"]
