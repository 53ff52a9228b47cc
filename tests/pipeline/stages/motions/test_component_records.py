"""Records along several axes: their files, their products, and every refusal."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import record_files as files

from pipeline.config.layers import load_site
from pipeline.config.problems import InputError
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Cell
from pipeline.workflow import graph
from pipeline.workflow.datasets import read
from vsr_core import GRAVITY
from vsr_core.outcome import Outcome

Vsr = Callable[..., Any]
Refused = Callable[..., str]

ROCK = "rock: {shape: box, size: [0.5, 0.5, 1.0], density: 2110}\nyaw: 0\n"
STEP = "simulation: {time_step: 0.0014}\n"
NONE = "processing: {order: none, highpass: null, lowpass: null}"
XYZ = "components: {x: x.csv, y: y.csv, z: z.csv}"


def wave(size: float, number: int = 401) -> files.Array:
    """A full cosine [m/s^2], which ends at rest."""
    return size * GRAVITY * np.cos(np.linspace(0.0, 2.0 * np.pi, number))


WAVES = {"x": wave(0.2), "y": wave(-0.3), "z": wave(0.5)}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three components in files of their own, and in one."""
    for axis, values in WAVES.items():
        (tmp_path / f"{axis}.csv").write_text(files.csv(values, 0.005))
    rows = np.column_stack([0.005 * np.arange(401), WAVES["z"], WAVES["x"], WAVES["y"]])
    head = "time [s],HNZ [m/s2],HNE [m/s2],HNN [m/s2]"
    np.savetxt(tmp_path / "one.csv", rows, "%.7g", ",", header=head, comments="")
    return tmp_path


def site(folder: Path, records: str, pga: str = "[0.2, 0.6, 1.0]", name: str = "rock") -> str:
    path = folder / f"{name}.yaml"
    motion = f"motion: {{kind: record, records: [{records}], {NONE}, pga: {pga}}}\n"
    path.write_text(f"{ROCK}{STEP}{motion}")
    return str(path)


def samples(path: str, pga: float = 0.6) -> files.Array:
    """Acceleration [g] of the motion of a site, shape (401, 3)."""
    motion = motion_grid.of_site(load_site(path)).motion(Cell(0, pga))
    values = motion.acceleration(0.005 * np.arange(401)) / GRAVITY
    return values.reshape(401, -1)


EAST = "{file: one.csv, components: {x: HNE, y: HNN, z: HNZ}}"


@pytest.mark.parametrize("records", [f"{{{XYZ}}}", EAST, "{file: one.csv}"])
def test_one_factor_scales_all_to_the_larger_horizontal_component(
    folder: Path, records: str
) -> None:
    """y is the larger, so that 0.6 g is twice of each."""
    found = samples(site(folder, records))
    expected = np.column_stack([2.0 * values / GRAVITY for values in WAVES.values()])
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_the_azimuth_turns_x_from_that_of_the_scan(folder: Path) -> None:
    """By 90 degrees to the left x is +y and y is -x; the vertical and the PGA stay."""
    found = samples(site(folder, f"{{{XYZ}, azimuth: 90}}"))
    x, y, z = (2.0 * values / GRAVITY for values in WAVES.values())
    np.testing.assert_allclose(found, np.column_stack([-y, x, z]), atol=1e-6)


def digest_of(site: str) -> str:
    loaded = load_site(site)
    found = motion_grid.find(loaded.config.motion, loaded.origin)
    assert found is not None
    return found.records[0].digest


ALONE = "components: {x: acceleration}"


@pytest.mark.parametrize(
    "records", [f"{{{XYZ}}}", f"{{file: x.csv, {ALONE}}}, {{file: y.csv, {ALONE}, azimuth: 90}}"]
)
def test_links_whose_files_are_exchanged_are_other_components(folder: Path, records: str) -> None:
    """As of an archive that holds files by their content, and links by their names."""
    place, found = site(folder, records), set()
    for order in ("xyz", "yxz"):
        for axis, other in zip("xyz", order, strict=True):
            stored = folder / f"{other}.stored.csv"
            stored.write_text(files.csv(WAVES[other], 0.005))
            (folder / f"{axis}.csv").unlink()
            (folder / f"{axis}.csv").symlink_to(stored)
        found.add(graph.identities("motions", load_site(place))["motions"].key)
    assert len(found) == 2


def test_a_record_is_known_by_its_first_component(folder: Path) -> None:
    """Whatever is beside it, and however it is turned; by what is in the file, and no name."""
    (folder / "other").mkdir()
    for axis in "xy":
        (folder / "other" / f"{axis}.csv").write_text(files.csv(1.5 * WAVES["z"], 0.005))
    (folder / "copy.csv").write_bytes((folder / "x.csv").read_bytes())

    def known(records: str) -> str:
        return digest_of(site(folder, records))

    same = (
        f"{{{XYZ}}}",
        f"{{{XYZ}, azimuth: 20}}",
        "{components: {x: copy.csv, y: other/y.csv}}",
        "{components: {x: x.csv}}",
    )
    others = "{components: {x: other/x.csv}}", EAST, "{components: {y: y.csv}}"
    assert len(set(map(known, same))) == 1
    assert len(set(map(known, (*others, same[0])))) == len(others) + 1
    alone = f"motion: {{kind: record, files: one.csv, component: HNE, {NONE}, pga: [1]}}\n"
    (folder / "alone.yaml").write_text(f"{ROCK}{STEP}{alone}")
    assert digest_of(str(folder / "alone.yaml")) == known(EAST)


def test_what_is_not_recorded_rests(folder: Path) -> None:
    found = samples(site(folder, "{components: {y: y.csv}}"))
    assert not found[:, [0, 2]].any()
    np.testing.assert_allclose(np.abs(found[:, 1]).max(), 0.6)
    assert samples(site(folder, "{components: {x: x.csv}}")).shape == (401, 1)


@pytest.mark.slow
def test_products_tell_components_and_what_the_vertical_does(
    folder: Path, vsr: Vsr, derived: Path
) -> None:
    """What they change is counted again, by a study that has no vertical component."""
    path = site(folder, f"{{{XYZ}, azimuth: 20}}", pga="{start: 0.3, stop: 1.5, num: 13}")
    assert vsr("run", "fragility", "--site", path, "--workers", 0).code == 0
    motions = read(derived / "rock" / "motions.nc")
    expected = np.column_stack(list(WAVES.values()))
    np.testing.assert_allclose(motions["component_acceleration"].values, expected, atol=1e-6)
    assert motions["azimuth"].values.tolist() == [20.0]
    responses = read(derived / "rock" / "responses.nc")
    toppled = responses["outcome"].values == Outcome.OVERTURNED
    level = responses["overturned_without_vertical"].values == 1
    changed = int((toppled != level).sum())
    few = ("run", "responses", "--site", path, "--workers", 0, "--set", "simulation.keep=boundary")
    assert vsr(*few, into=folder / "few").code == 0
    kept = read(folder / "few" / "rock" / "responses.nc")
    for name in ("overturned", "overturned_without_vertical"):
        np.testing.assert_array_equal(kept[name].values, responses[name].values)
    page = " ".join((derived / "rock" / "report.html").read_text().split())
    assert f"<strong>{changed} of 13 runs</strong>" in page
    assert "azimuth of x 20 deg" in page
    two, grid = (
        "{components: {x: x.csv, y: y.csv}, azimuth: 20}",
        "{start: 0.3, stop: 1.5, num: 13}",
    )
    path = site(folder, two, pga=grid, name="level")
    assert vsr("run", "responses", "--site", path, "--workers", 0).code == 0
    alone = read(derived / "level" / "responses.nc")
    np.testing.assert_array_equal(alone["overturned"].values == 1, level)
    assert "overturned_without_vertical" not in alone


def test_a_plan_says_that_nothing_is_proved(folder: Path, vsr: Vsr) -> None:
    several = vsr("plan", "fragility", "--site", site(folder, f"{{{XYZ}}}")).out
    assert "switched off: what is proved" in several
    assert "uplift and sliding limits" not in several
    alone = vsr("plan", "fragility", "--site", site(folder, "{components: {x: x.csv}}")).out
    assert "switched off" not in alone
    assert "uplift and sliding limits" in alone


REFUSED = {
    "a vertical alone": ("{components: {z: z.csv}}", "", "motion.records.0.components", "larger"),
    "an unknown axis": ("{components: {x: x.csv, w: y.csv}}", "", "components.w", "unknown key"),
    "no file": ("{azimuth: 3}", "", "motion.records.0", "components"),
    "a missing file": ("{components: {x: x.csv, y: none.csv}}", "", "motion.records", "none.csv"),
    "an azimuth in another unit": (f"{{{XYZ}, azimuth: 720}}", "", "azimuth", "720"),
    "another length": (f"{{{XYZ}}}", "length", "motion.records", "a length of 401 samples in x"),
    "another step": (f"{{{XYZ}}}", "step", "motion.records", "time step of 0.005 s in x"),
    "another start": (f"{{{XYZ}}}", "start", "motion.records", "start of 0 s in x and of 0.1 s"),
    "an end that lacks": (f"{{{XYZ}}}", "end", "motion.records", "z without its first or last"),
    "a drift": (f"{{{XYZ}}}", "drift", "motion.records", "z, a motion that ends at"),
    "no such channel": ("{file: one.csv, components: {x: HN1}}", "", "motion.records", "HN1"),
    "one file twice": ("{components: {x: x.csv, y: x.csv}}", "", "motion.records", "same samples"),
    "one motion twice": (f"{{{XYZ}}}, {EAST}", "", "motion.records", "the same motion"),
    "one name twice": (f"{{{XYZ}}}, {{{XYZ}}}", "", "motion.records", "x more than once"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_record_is_refused(folder: Path, refused: Refused, case: str) -> None:
    records, change, *words = REFUSED[case]
    z, step, late = WAVES["z"], 0.005, 0.0
    if change == "length":
        z = wave(0.5, 400)
    elif change == "step":
        step = 0.01
    elif change == "start":
        late = 0.1
    elif change == "drift":
        z = z + 0.3
    rows = [f"{late + i * step:.6g},{value:.7g}" for i, value in enumerate(z.tolist())]
    if change == "end":
        rows[-1] = f"{400 * step:.6g},nan"
    (folder / "z.csv").write_text("\n".join(["time [s],a [m/s2]", *rows]) + "\n")
    path = site(folder, records)
    refused("run", "fragility", "--site", path, words=("rock.yaml", *words))


AT2 = "Made up, 11/21/2026, Nowhere Creek, 000"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("Northridge, 1/17/1994, Pacoima Dam, 000", "Pacoima Dam.*one instrument and event"),
        ("Made up, 11/21/2026, Nowhere Creek, 270", "090 as x and 270 as y"),
        ("Made up, 11/21/2026, Nowhere Creek, 180", "to the left of x; exchange x and y"),
        ("Made up, 11/21/2026, Nowhere Creek, 045", "090 as x and 045 as y"),
        (
            "Made up, 11/21/2026, Nowhere Creek, UP",
            "UP as y, which is vertical; x and y are horizontal",
        ),
        (AT2, ""),
    ],
)
def test_components_are_of_one_instrument(folder: Path, line: str, words: str) -> None:
    for axis in "xy":
        text = files.at2(WAVES[axis], 0.005)
        place = line if axis == "y" else AT2.replace("000", "090")
        (folder / f"{axis}.at2").write_text(text.replace(text.splitlines()[1], place))
    path = site(folder, "{components: {x: x.at2, y: y.at2}}")
    if not words:
        assert samples(path).shape == (401, 3)
        return
    with pytest.raises(InputError, match=words):
        samples(path)


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        ("E", "N", ""),
        ("N", "E", "exchange"),
        ("000", "090", "exchange"),
        ("1", "2", ""),
        ("W", "N", "exchange"),
        ("N", "W", ""),
    ],
)
def test_columns_of_a_table_may_name_directions(folder: Path, x: str, y: str, words: str) -> None:
    rows = "".join(
        f"{0.005 * k:.6g},{a:.7g},{b:.7g}\n"
        for k, (a, b) in enumerate(zip(WAVES["x"], WAVES["y"], strict=True))
    )
    (folder / "both.csv").write_text(f"time [s],{x} [m/s2],{y} [m/s2]\n{rows}")
    path = site(folder, f'{{file: both.csv, components: {{x: "{x}", y: "{y}"}}}}')
    if not words:
        assert samples(path).shape[0] == 401
        return
    with pytest.raises(InputError, match=words):
        samples(path)


@pytest.mark.parametrize(("channel", "words"), [("DWN", "points down"), ("000", "vertical")])
def test_the_vertical_component_points_up(folder: Path, channel: str, words: str) -> None:
    for axis, name in zip("xyz", ("090", "000", channel), strict=True):
        text = files.at2(WAVES[axis], 0.005)
        place = AT2.replace("000", name)
        (folder / f"{axis}.at2").write_text(text.replace(text.splitlines()[1], place))
    with pytest.raises(InputError, match=f"{channel} as z.*{words}"):
        samples(site(folder, "{components: {x: x.at2, y: y.at2, z: z.at2}}"))


def test_components_are_of_one_station(folder: Path) -> None:
    obspy = pytest.importorskip("obspy")
    for other in ({"station": "OTH"}, {"channel": "HHN"}, {}):
        heads = [
            {"channel": "HNE", "station": "NWC"},
            {"channel": "HNN", "station": "NWC", **other},
        ]
        traces = [
            obspy.Trace(WAVES[a].astype("f4"), {"delta": 0.005, **h})
            for a, h in zip("xy", heads, strict=True)
        ]
        obspy.Stream(traces).write(str(folder / "one.mseed"), format="MSEED")
        found = load_site(site(folder, "{file: one.mseed}"), settings=("motion.unit=m/s2",))
        if other:
            with pytest.raises(InputError, match="of one instrument"):
                motion_grid.of_site(found)
    assert motion_grid.of_site(found).rows


def test_files_or_records(folder: Path, refused: Refused) -> None:
    path = site(folder, f"{{{XYZ}}}")
    both = 'motion.files=["x.csv"]'
    refused("plan", "--site", path, "--set", both, words=("motion", "give one of the two"))


def test_channels_of_other_spans_are_refused(folder: Path, refused: Refused) -> None:
    """A single one of them could be taken: what others lack is cut then."""
    obspy = pytest.importorskip("obspy")
    stream = obspy.Stream()
    for code, values in zip(("HNE", "HNN", "HNZ"), WAVES.values(), strict=True):
        head = {"channel": code, "station": "NWC", "delta": 0.005}
        stream.append(obspy.Trace(values.astype("f4"), head))
    stream.write(str(folder / "one.mseed"), format="MSEED")
    unit = "--set", "motion.unit=m/s2"
    path = site(folder, "{file: one.mseed}")
    load_site(path, settings=("motion.unit=m/s2",))
    found = motion_grid.of_site(load_site(path, settings=("motion.unit=m/s2",)))
    assert json.dumps(found.rows) == '["one"]'
    whole = found.motion(Cell(0, 0.3)).acceleration(0.005 * np.arange(401))
    np.testing.assert_allclose(whole, np.column_stack(list(WAVES.values())), atol=1e-5)
    stream[2].data = stream[2].data[:-7]
    stream.write(str(folder / "one.mseed"), format="MSEED")
    words = "motion.records", "14 samples are not in all"
    refused("run", "fragility", "--site", path, *unit, words=words)


def test_a_terrain_takes_a_table_in_translation(tmp_path: Path) -> None:
    path = tmp_path / "hill.yaml"
    path.write_text(
        "rock: {shape: mesh, mesh: scan.ply, density: 2000}\n"
        "pedestal: {shape: mesh, cut: proposal}\n"
        "motion: {kind: table, pulses: [{axis: x}, {axis: z}], pga: 1, pgv_pga: 0.2}\n"
    )
    assert load_site(str(path)).config.on_terrain
    with pytest.raises(InputError, match=r"motion: .*does not turn; leave out roll"):
        load_site(str(path), settings=("motion.pulses=[{axis: x}, {axis: roll}]",))
