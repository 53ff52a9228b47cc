"""Files from outside that are read as tables, as a user may have them, and what is read of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import trimesh

from pipeline import ROOT, cli
from pipeline.bundles import checking
from pipeline.config.age_files import samples
from pipeline.stages.archive import rock_list
from pipeline.stages.hazard import curve_folder, event_files, fault_files
from pipeline.stages.hazard.disaggregation import load_disaggregation
from pipeline.stages.mesh import sources
from pipeline.stages.studies.validation.recorded_tests import OUTCOMES
from pipeline.stages.studies.validation.recorded_tests import tests_in as read_tests
from pipeline.stages.studies.validation.table_motions import RECORDS, identity, motions
from pipeline.workflow import front_page
from pipeline.workflow.keys import digest_file
from pipeline.workflow.store import manifest_text, read_manifest
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
        for dist, share in (("10.0", 5e-4), ("30.0", 0.0))
    ]
    (folder / "Mag_Dist-mean-0_1.csv").write_text("\n".join(rows) + "\n")
    return folder


def manifest(folder: Path) -> Path:
    facts = {"config": {}, "inputs": {}, "versions": {}, "code": {}, "needs": {"rock": "k"}}
    whole = {"key": "k", "facts": facts, "files": {"a.nc": "x"}, "unresolved": 0, "retry": 0}
    path = folder / "derived" / "box" / ".stages" / "one.json"
    path.parent.mkdir(parents=True)
    path.write_text(manifest_text(whole))
    return path


BOX = "rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}\n"
AGED = f"{BOX}hazard: {{age: {{kind: normal, mean: 9000}}, "

AGES = "age_a\n12000\n10500\n11250\n13100\n"
FAULTS = (
    "name,magnitude,distance_km,rate_per_year,mechanism\n"
    "Near,6.4,6,0.0004,strike-slip\nNear,7.0,6,0.00008,\nFar,7.4,25,0.012,reverse\n"
)
EXPECTED = "magnitude,distance_km,pga_g,pga_log_sd,pgv_cm_s,pgv_log_sd\n" + "".join(
    f"{m},{d},{0.1 * m / d:.4f},0.55,{1.5 * m * m / d:.3f},0.60\n"
    for m in (5, 6, 7)
    for d in (10, 30)
)
ROCKS = (
    "name,alpha_1_deg,alpha_2_deg,r_1_m,r_2_m,height_m,azimuth_deg,friction,age_mean_a,age_sd_a\n"
    "Ridge,12.5,17.0,0.84,0.86,1.6,40,,14000,2500\nSaddle,18.0,24.0,0.46,0.48,0.9,300,0.7,,\n"
    "Old,12.5,17.0,0.84,0.86,1.6,200,0.65,12000,1500\n"
)


def text_file(name: str, content: str) -> Callable[[Path], Path]:
    """Write a file of text; its path."""

    def write(folder: Path) -> Path:
        (folder / name).write_text(content, encoding="utf-8")
        return folder / name

    return write


def bundle(folder: Path) -> Path:
    """The results of a box, exported."""
    made = [*box(folder), "--derived", str(folder / "derived")]
    assert cli.main(made) == cli.DONE
    assert cli.main(["export", str(folder / "derived/box"), "--to", str(folder / "box.zip")]) == 0
    return folder / "box.zip"


def box(folder: Path) -> list[str]:
    """A command that makes a box."""
    (folder / "box.yaml").write_text(BOX)
    return ["run", "rock", "--site", str(folder / "box.yaml"), "--workers", "0"]


def note(folder: Path) -> Path:
    """A mesh with the note of where it is from."""
    trimesh.creation.box((1.0, 1.0, 2.0)).export(folder / "rock.ply")
    own = digest_file(folder / "rock.ply")
    facts = {"from": "somebody", "url": "https://example.org", "sha256": own}
    (folder / "origin.json").write_text(json.dumps(facts))
    return folder / "rock.ply"


def index(folder: Path) -> Path:
    """Results of a box, listed."""
    assert cli.main([*box(folder), "--derived", str(folder / "derived")]) == cli.DONE
    assert front_page.renew(folder / "derived") is not None
    return folder / "derived"


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


def of_index(path: Path) -> Any:
    """The page, made anew from what is known of the last one."""
    (path / "index.html").unlink()
    page = front_page.renew(path)
    assert page is not None
    return page.read_text(encoding="utf-8")


def of_bundle(path: Path) -> Any:
    """What would be made otherwise here; None where the bundle is told to be damaged."""
    wrong, lines = checking.check(path)
    return None if wrong else lines


def of_note(path: Path) -> str | None:
    """Where a mesh is from; None where nothing is known of that."""
    label = sources._label(path)
    return None if label.startswith("scan ") else label


def of_records(path: Path) -> Any:
    """Numbers of the tests, and digests of their motions."""
    return {number: identity(one) for number, one in motions(path, None).items()}


def of_faults(path: Path) -> Any:
    return fault_files._faults(path)


def of_ground_motion(path: Path) -> Any:
    found = fault_files._model(path)
    values = found.values.reshape(-1, 4).tolist()
    places = [(m, d) for m in found.magnitudes.tolist() for d in found.distances.tolist()]
    return list(zip(places, values, strict=True))


def events(folder: Path) -> Path:
    return EventSet(400.0, ruptures=40).write(folder)


def stored_events(folder: Path) -> Path:
    return EventSet(400.0, ruptures=40).write_calculation(folder / "calc_7.hdf5")


def of_events(path: Path) -> Any:
    found = event_files.load(path, None)
    one = found.events
    pgv = np.zeros(len(one.pga)) if one.pgv is None else one.pgv
    columns = one.pga, pgv, one.branch, one.rupture
    branches = [(branch.name, branch.path, branch.weight) for branch in found.model.branches]
    assert one.ruptures is not None
    told = one.years, found.model.location, branches, one.ruptures.distances.tolist()
    return told, sorted(zip(*(np.asarray(column).tolist() for column in columns), strict=True))


class Reader(NamedTuple):
    """A file, and who reads it.

    Attributes
    ----------
    write : callable, writes what is read into a folder; its path
    damaged : str, which file of it is damaged
    read : callable, from that path to what it says
    command : words of a command that reads it, ``{}`` for the folder; they name ``site.yaml``, too
    site : str, that site
    seen : str, what of whole lines that are lost, or there twice, is seen: "lines" each; "rows" a
        cut within a row, after which the rows before it are there; "cut" a cut; "" none
    """

    write: Callable[[Path], Path]
    damaged: str
    read: Callable[[Path], Any]
    command: str
    site: str = BOX
    seen: str = "lines"


HAZARD, EXCLUSION = (f"plan {name} --site {{}}/site.yaml" for name in ("hazard", "exclusion"))
OF_CURVES = AGED + "curves: .}\n"
OF_EVENTS = AGED + "events: .}\n"
OF_TESTS = "run validation --table {} --workers 0"

READERS = {
    "events": Reader(events, "events_1.csv", of_events, HAZARD, OF_EVENTS),
    # of events that are too weak there are no fields, so that a lost line of these is not seen
    "fields": Reader(events, "gmf-data_1.csv", of_events, HAZARD, OF_EVENTS, ""),
    "stored events": Reader(
        stored_events, "calc_7.hdf5", of_events, HAZARD, AGED + "events: calc_7.hdf5}\n", ""
    ),
    "ruptures": Reader(events, "ruptures_1.csv", of_events, HAZARD, OF_EVENTS),
    "site of events": Reader(events, "sitemesh_1.csv", of_events, HAZARD, OF_EVENTS),
    "curve": Reader(curves, CURVE.format(0), of_model, HAZARD, OF_CURVES),
    "realizations": Reader(curves, "realizations_1.csv", of_model, HAZARD, OF_CURVES),
    "about": Reader(curves, "about.txt", of_model, HAZARD, OF_CURVES, ""),
    "nshmp": Reader(nshmp, "PGA/curves.csv", of_model, HAZARD, OF_CURVES),
    "calculation": Reader(
        calculation, "calc_7.hdf5", of_model, HAZARD, AGED + "curves: calc_7.hdf5}\n", ""
    ),
    "disaggregation": Reader(
        lambda folder: disaggregation(curves(folder)),
        "Mag_Dist-mean-0_1.csv",
        of_disaggregation,
        HAZARD,
        OF_CURVES,
    ),
    "ages": Reader(
        text_file("ages.csv", AGES),
        "ages.csv",
        samples,
        EXCLUSION,
        f"{BOX}hazard: {{age: {{kind: samples, file: ages.csv}}}}\n",
        "rows",
    ),
    "faults": Reader(
        text_file("faults.csv", FAULTS),
        "faults.csv",
        of_faults,
        EXCLUSION,
        AGED + "faults: faults.csv}\n",
        "rows",
    ),
    "ground motion": Reader(
        text_file("expected.csv", EXPECTED),
        "expected.csv",
        of_ground_motion,
        EXCLUSION,
        AGED + "ground_motion: expected.csv}\n",
        "rows",
    ),
    "rocks": Reader(
        text_file("rocks.csv", ROCKS),
        "rocks.csv",
        lambda path: tuple(rock_list.read(path).rocks),
        "archive {}/rocks.csv",
        seen="rows",
    ),
    "outcomes": Reader(
        recorded_tests, OUTCOMES, lambda path: vars(read_tests(path)) | {"unused": ()}, OF_TESTS
    ),
    "records": Reader(recorded_tests, RECORDS, of_records, OF_TESTS, seen="cut"),
    "bundle": Reader(bundle, "box.zip", of_bundle, "check {}/box.zip"),
    "note": Reader(
        note,
        "origin.json",
        of_note,
        "run rock --site {}/site.yaml --workers 0",
        "rock: {shape: mesh, mesh: rock.ply, density: 2000}\n",
        "cut",
    ),
    "manifest": Reader(manifest, "derived/box/.stages/one.json", read_manifest, "index"),
    "index": Reader(index, "derived/.index.json", of_index, "index"),
}
