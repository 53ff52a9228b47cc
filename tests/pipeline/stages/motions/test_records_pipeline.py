"""Records through the pipeline: configuration, products, keys, report, and every refusal."""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support import record_files as files
from support.following import following

from pipeline import ROOT, cli
from pipeline.config.layers import known, load_site
from pipeline.config.problems import InputError
from pipeline.stages.fragility.fragility_figures import overturning_diagram
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import MotionData
from pipeline.stages.motions.record_figure import record_figure
from pipeline.stages.motions.record_inputs import Scaled, find, refuse_copies
from pipeline.stages.runs import scenes
from pipeline.workflow.datasets import read
from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.source import tracing

Refused = Callable[..., str]
Vsr = Callable[..., object]

PGA = (0.2, 0.4, 0.6, 0.8, 1.0)
RATIOS = (0.15, 0.3, 0.5)
ROCK = "rock: {shape: box, size: [0.5, 0.5, 1.0], density: 2110}\n"
STEP = "simulation: {time_step: 0.0014}\n"
NONE = "processing: {order: none, highpass: null, lowpass: null}"


def pulse_record(ratio: float) -> str:
    values = 0.3 * GRAVITY * np.cos(np.linspace(0.0, 2.0 * np.pi, 601))
    return files.csv(values, CosinePulse.from_g(0.3, ratio).duration / 600, "a [m/s2]")


def site(folder: Path, motion: str, name: str = "rock") -> str:
    path = folder / f"{name}.yaml"
    path.write_text(f"{ROCK}{STEP}motion: {{kind: record, {motion}}}\n")
    return str(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site under records that are cosine pulses, and its products."""
    folder = tmp_path_factory.mktemp("records")
    (folder / "motions").mkdir()
    for ratio in RATIOS:
        path = folder / "motions" / f"p{round(1e3 * ratio)}.csv"
        path.write_text(pulse_record(ratio))
    path = site(folder, f"files: motions, {NONE}, pga: {list(PGA)}")
    assert run(folder, path) == cli.DONE
    return folder


def run(folder: Path, path: str, product: str = "fragility", *settings: str) -> int:
    command = ["run", product, "--site", path, "--derived", str(folder / "derived")]
    return cli.main([*command, "--workers", "0", *settings])


def product(folder: Path, name: str) -> xr.Dataset:
    return read(folder / "derived" / "rock" / f"{name}.nc")


def test_records_of_pulses_do_what_the_pulses_do(folder: Path) -> None:
    path = folder / "pulses.yaml"
    motion = f"motion: {{kind: cosine_pulse, pga: {list(PGA)}, pgv_pga: {list(RATIOS)}}}\n"
    path.write_text(ROCK + STEP + motion)
    assert run(folder, str(path), "responses") == cli.DONE
    pulses = read(folder / "derived" / "pulses" / "responses.nc")
    records = product(folder, "responses")
    assert pulses["overturned"].dims == ("yaw", "friction", "pgv_pga", "pga")
    assert records["overturned"].dims == ("yaw", "friction", "record", "pga")
    assert records["overturned"].values.sum() > 2
    assert np.array_equal(records["overturned"].values, pulses["overturned"].values)


def test_responses_hold_names_and_measures(folder: Path) -> None:
    data = product(folder, "responses")
    assert data["record"].values.tolist() == ["p150", "p300", "p500"]
    for name in ("pgv_pga", "record_pga", "sa_1hz", "arias", "cav", "significant_duration"):
        assert data[name].dims == ("record",)
        assert name in data.coords
        assert data[name].attrs["units"]
    np.testing.assert_allclose(data["pgv_pga"].values, RATIOS, rtol=1e-4)
    np.testing.assert_allclose(data["record_pga"].values, 0.3, rtol=1e-6)
    # a pulse's Arias intensity: pi / (2 g) a^2 pi r
    arias = np.pi / (2 * GRAVITY) * (0.3 * GRAVITY) ** 2 * np.pi * np.array(RATIOS)
    np.testing.assert_allclose(data["arias"].values, arias, rtol=1e-4)
    np.testing.assert_allclose(data["cav"].values, 4 * 0.3 * GRAVITY * np.array(RATIOS), rtol=1e-4)


def test_fragility_has_records_as_rows(folder: Path) -> None:
    data, responses = product(folder, "fragility"), product(folder, "responses")
    assert data["first_overturning_pga"].dims == ("yaw", "friction", "record")
    assert data["probability"].dims == ("yaw", "friction", "model", "record", "pga")
    fell = responses["overturned"].values[0, 0] == 1
    for row, upper in zip(fell, data["first_overturning_pga_upper"].values[0, 0], strict=True):
        above = int(row.argmax()) if row.any() else len(PGA)
        assert PGA[above - 1] < upper <= (PGA[above] if row.any() else 4.0)
    np.testing.assert_array_equal(data["pgv_pga"].values, responses["pgv_pga"].values)
    with (folder / "derived" / "rock" / "fragility.csv").open() as file:
        rows = list(csv.DictReader(file))
    grid = [row for row in rows if row["model"] == "runs"]
    assert [row["record"] for row in grid] == ["p150", "p300", "p500"]


def test_motions_are_one_motion(folder: Path) -> None:
    data = product(folder, "motions")
    assert data["record_size"].values.tolist() == [601] * 3
    last = data["record_size"].values.cumsum()
    for number, end in enumerate(last):
        part = slice(end - 601, end)
        a, v, d = (data[n].values[part] for n in ("acceleration", "velocity", "displacement"))
        h = float(data["interval"].values[number])
        np.testing.assert_allclose(np.diff(v), 0.5 * h * (a[1:] + a[:-1]), atol=1e-12)
        steps = h * v[:-1] + h * h / 6.0 * (2.0 * a[:-1] + a[1:])
        np.testing.assert_allclose(np.diff(d), steps, atol=1e-12)
    assert data["spectral_acceleration"].dims == ("record", "oscillator_frequency")
    assert data["velocity"].attrs["long_name"] == "ground velocity"


def test_report_shows_records(folder: Path) -> None:
    text = (folder / "derived" / "rock" / "report.html").read_text(encoding="utf-8")
    assert "3 recorded motions" in text
    assert "single cosine pulses" not in text
    for ratio in RATIOS:
        assert f"Record p{round(1e3 * ratio)} as recorded" in text
    assert text.count("repaired: nothing") == 3


def test_figures_show_what_they_say(folder: Path) -> None:
    motions = product(folder, "motions")
    figure = record_figure(motions, 1)
    lines = {line.get_gid(): line for axes in figure.axes for line in axes.get_lines()}
    shown = lines["velocity"].get_ydata()
    assert np.abs(shown).max() == pytest.approx(float(motions["record_pgv"][1]))
    assert lines["acceleration"].get_ydata()[0] == pytest.approx(0.3, rel=1e-6)
    place = (0, 0)
    diagram = overturning_diagram(product(folder, "responses"), product(folder, "fragility"), place)
    names = [text.get_text() for text in diagram.axes[0].get_yticklabels()]
    assert [name.split("\n")[0] for name in names] == ["p150", "p300", "p500"]


@pytest.mark.slow
def test_runs_are_known_by_samples_not_by_names(folder: Path, tmp_path: Path, capsys) -> None:
    """Another name, place and spacing in the file: the same motion, no run is done again."""
    shutil.copytree(folder / "motions", tmp_path / "motions")
    path = site(tmp_path, f"files: motions, {NONE}, pga: {list(PGA)}")
    assert run(tmp_path, path, "responses") == cli.DONE
    assert "15 runs done" in capsys.readouterr().err
    (tmp_path / "elsewhere").mkdir()
    for ratio in RATIOS:
        text = pulse_record(ratio).replace(",", " , ").replace("time [s]", "time")
        (tmp_path / "elsewhere" / f"other{round(1e3 * ratio)}.csv").write_text(text)
    path = site(tmp_path, f"files: elsewhere, {NONE}, pga: {[*PGA, 1.2]}")
    assert run(tmp_path, path, "responses") == cli.DONE
    assert "3 runs done" in capsys.readouterr().err  # those at the new PGA
    changed = tmp_path / "elsewhere" / "other300.csv"
    lines = changed.read_text().splitlines()
    time, value = lines[301].split(" , ")
    lines[301] = f"{time},{float(value) * 1.0001:.7g}"
    changed.write_text("\n".join(lines))
    why = ["why", "responses", "--site", path, "--derived", str(tmp_path / "derived")]
    assert cli.main(why) == cli.DONE
    said = capsys.readouterr().out
    assert "motions: file other300.csv edited" in said
    assert "are stored and stay" not in said  # not known before the records are read anew
    assert run(tmp_path, path, "responses") == cli.DONE
    assert "6 runs done" in capsys.readouterr().err  # that record's


def test_every_function_that_a_recorded_motion_enters_is_in_its_key(folder: Path) -> None:
    from vsr_core.judge import proofs
    from vsr_core.rock import solid
    from vsr_core.run.cases import Settings, prepare
    from vsr_core.run.overturning import simulate
    from vsr_core.scene import Contact, Scene

    rock = solid.box((0.5, 0.5, 1.0), 2000.0).rock
    case = prepare(Scene(rock, Contact(0.6)), proofs.barrier(rock), reduce=True)
    motion = load_site(str(folder / "rock.yaml")).config.motion
    motions = motion_grid.of_data(motion, MotionData(folder / "derived" / "rock"))
    with following() as entered:
        for cell in motion_grid.cells(motions):
            simulate(case, motions.motion(cell), Settings(0.0014))
    assert {
        f"vsr_core.motions.records.trace:{name}" for name in ("Trace", "RecordedMotion")
    } < entered
    in_key = tracing.reached((*scenes.code("bullet", terrain=False), *motion_grid.RECORD_CODE))
    assert entered - set(in_key) == set()


def test_a_record_whose_name_no_product_can_hold_is_refused(
    tmp_path: Path, refused: Refused
) -> None:
    (tmp_path / "motions").mkdir()
    name = os.fsdecode(b"b\xe4d.csv")
    (tmp_path / "motions" / name).write_text(pulse_record(0.3))
    where = site(tmp_path, f"files: motions, {NONE}, pga: [1]")
    refused("run", "motions", "--site", where, words=("whose name is not in UTF-8",))


def test_the_vertical_one_in_a_folder_of_components_is_no_shaking_along_x(
    tmp_path: Path, refused: Refused
) -> None:
    """As networks pack them: two to the sides and one up, each in a file of its own."""
    (tmp_path / "quake").mkdir()
    for name in ("090", "UP"):
        text = files.at2(files.shaking(1, 100.0, 6.0, 5.0, 0.5), 0.01)
        (tmp_path / "quake" / f"RSN9_{name}.AT2").write_text(text.replace(", 090\n", f", {name}\n"))
    where = site(tmp_path, f"files: quake, {NONE}, pga: [1]")
    words = ("motion.files: got", "RSN9_UP.AT2, UP as x, which is vertical", "leave it out")
    refused("run", "motions", "--site", where, words=words)


def test_the_horizontal_files_of_a_station_are_two_records(tmp_path: Path, vsr: Vsr) -> None:
    """As K-NET packs them: of one name, and endings that are their components."""
    for name, direction, seed in (("NWC001.EW", "E-W", 1), ("NWC001.NS", "N-S", 2)):
        text = files.knet(files.shaking(seed, 100.0, 10.0, 6.0, 0.3), 0.01, direction)
        (tmp_path / name).write_text(text)
    band = "processing: {order: standard, highpass: 0.1, lowpass: 25}"
    where = site(tmp_path, f"files: [NWC001.EW, NWC001.NS], {band}, pga: [1]")
    ran = vsr("run", "motions", "--site", where)
    assert ran.code == 0, ran.err
    records = product(tmp_path, "motions")["record"].values.tolist()
    assert sorted(records) == ["NWC001.EW", "NWC001.NS"]


def test_above_and_below_the_ground_are_two_records(tmp_path: Path, vsr: Vsr) -> None:
    """As KiK-net packs them: 1 is in the hole, and 2 at the surface."""
    records = []
    for place in (1, 2):
        for seed, way in enumerate(("EW", "NS")):
            scale = files.shaking(2 * place + seed, 100.0, 10.0, 6.0, 0.3)
            text = files.knet(scale, 0.01, f"{way[0]}-{way[1]}")
            (tmp_path / f"AKT.{way}{place}").write_text(text)
        records.append(f"{{components: {{x: AKT.EW{place}, y: AKT.NS{place}}}}}")
    band = "processing: {order: standard, highpass: 0.1, lowpass: 25}"
    where = site(tmp_path, f"records: [{', '.join(records)}], {band}, pga: [1]")
    ran = vsr("run", "motions", "--site", where)
    assert ran.code == 0, ran.err
    assert sorted(product(tmp_path, "motions")["record"].values.tolist()) == ["AKT.EW1", "AKT.EW2"]


def test_a_channel_that_may_be_vertical_is_told(tmp_path: Path, vsr: Vsr) -> None:
    """DN is a hole in the ground here, and a channel that points down elsewhere."""
    text = pulse_record(0.3)
    for name in ("DN 090", "east"):
        (tmp_path / f"{name}.csv").write_text(text.replace("a [m/s2]", f"{name} [m/s2]"))
        text = pulse_record(0.4)
    where = site(tmp_path, f"files: [DN 090.csv, east.csv], {NONE}, pga: [1]")
    said = vsr("run", "motions", "--site", where)
    assert "DN 090 as x is taken as horizontal, though DN may mean vertical" in said.err
    assert "east as x" not in said.err


def test_plan_names_the_records(folder: Path, vsr: Vsr) -> None:
    said = vsr("plan", "--site", folder / "rock.yaml").out
    assert "records: 3, each at 5 PGA" in said
    assert "p300: 1.9 s, PGV/PGA 0.3 s" in said
    assert "runs: 15; 0 stored" in said


def test_study_of_the_samples_goes_with_every_flat_site() -> None:
    names = ["long", "near", "quick", "soft"]
    for name in known():
        if name.endswith("terrain") or name == "granite_dells":
            continue
        found = load_site(name, "records")
        assert [path.stem for path in find(found, found.config.motion.files)] == names
    motions = motion_grid.of_site(found)
    assert sorted(motions.rows) == names
    assert list(motions.pgv_pga) == sorted(motions.pgv_pga)


def test_samples_are_what_the_writer_writes(tmp_path: Path) -> None:
    files.write_samples(tmp_path)
    kept = ROOT / "data" / "raw" / "records"
    assert sorted(p.name for p in kept.iterdir()) == sorted(p.name for p in tmp_path.iterdir())
    for path in tmp_path.iterdir():
        if path.suffix == ".nc":
            new, old = xr.load_dataset(path), xr.load_dataset(kept / path.name)
            assert new.identical(old)
        else:
            assert path.read_bytes() == (kept / path.name).read_bytes()


def test_a_study_elsewhere_finds_its_own_files(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "one.csv").write_text(pulse_record(0.3))
    study = tmp_path / "study.yaml"
    study.write_text(f"motion: {{kind: record, files: mine, {NONE}, pga: 0.3}}\n")
    found = load_site("cuboid_1x1x2", str(study))
    assert motion_grid.of_site(found).rows == ("one",)


@pytest.mark.slow
def test_repairs_are_told(tmp_path: Path) -> None:
    lines = pulse_record(0.3).splitlines()
    (tmp_path / "holed.csv").write_text("\n".join([*lines[:200], *lines[202:]]))
    path = site(tmp_path, f"files: holed.csv, {NONE}, pga: [0.3]")
    assert run(tmp_path, path) == cli.DONE
    data = product(tmp_path, "motions")
    assert "2 time steps were left out" in str(data["repairs"].values[0])
    text = (tmp_path / "derived" / "rock" / "report.html").read_text(encoding="utf-8")
    assert "2 missing samples at" in text
    assert "bridged by a straight line" in text


def test_files_of_a_folder_that_are_no_records_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "mine"
    (mine / "more").mkdir(parents=True)
    for name in ("p.csv", "q.CSV.gz", "r.V2C", "about.md", ".hidden"):
        (mine / name).write_text(pulse_record(0.3))
    assert run(tmp_path, site(tmp_path, f"files: mine, {NONE}, pga: [0.2]"), "motions") == cli.DONE
    said = capsys.readouterr().err
    assert "mine not read: more, q.CSV.gz and r.V2C; records end in .at2" in said
    (mine / "more").rmdir()
    for name in ("q.CSV.gz", "r.V2C"):
        (mine / name).unlink()
    assert run(tmp_path, site(tmp_path, f"files: mine, {NONE}, pga: [0.3]"), "motions") == cli.DONE
    assert "not read" not in capsys.readouterr().err


BAND = "processing: {order: standard, highpass: 1.0, lowpass: 25}"
PATHS = "motion.files"
BAD = {
    "no file": (f"files: nowhere.csv, {NONE}", PATHS, "nowhere.csv", "not found"),
    "no records": (f"files: empty, {NONE}", PATHS, "a folder without records", ".at2"),
    "twice": (f"files: [good.csv, good.csv], {NONE}", PATHS, "more than once", "rename"),
    "no unit": (f"files: bare.csv, {NONE}", PATHS, "bare.csv", "without a unit", "motion.unit"),
    "two units": (f"files: good.csv, unit: g, {NONE}", PATHS, "motion.unit g", "m/s2"),
    "wrong unit": (f"files: bare.csv, unit: g, {BAND}", PATHS, "a PGA of", "motion.unit"),
    "counts": (f"files: bare.csv, unit: counts, {BAND}", PATHS, "counts", "motion.response"),
    "component": (f"files: good.csv, component: z, {NONE}", PATHS, "no column 'z'", "are a"),
    "clipped": (f"files: clipped.csv, {BAND}", PATHS, "in a row", "clipped"),
    "drift": (f"files: drift.csv, {NONE}", PATHS, "of its PGV", "motion.processing.highpass"),
    "high corner": (
        "files: good.csv, processing: {order: paper, highpass: null, lowpass: 900}",
        PATHS, "low-pass at 900 Hz", "Nyquist", "motion.processing.lowpass",
    ),
    "low corner": (
        "files: good.csv, processing: {order: paper, highpass: 0.01, lowpass: null}",
        PATHS, "high-pass at 0.01 Hz", "motion.processing.highpass",
    ),
    "copies": (f"files: [good.csv, copy.csv], {NONE}", PATHS, "the same motion", "named once"),
    "two scales": (f"files: [good.csv, other.csv], {NONE}", PATHS, "one motion at two scales"),
    "two scales about a mirror image": (
        f"files: [good.csv, mirror.csv, other.csv], {NONE}", PATHS, "one motion at two scales",
    ),
    "no response": (
        f"files: good.csv, response: {{file: x.xml, corners: [0.1, 0.2, 20, 30]}}, {NONE}",
        "motion.response.file", "x.xml", "not found",
    ),
    "order": (
        "files: a.csv, processing: {order: seed, highpass: 1, lowpass: 2}",
        "motion.processing.order", "'paper'",
    ),
    "no corners": (
        "files: a.csv, processing: {order: paper, lowpass: 2}",
        "motion.processing.highpass", "required",
    ),
    "corners of none": (
        "files: a.csv, processing: {order: none, highpass: 1, lowpass: null}",
        "motion.processing", "no filter corners",
    ),
    "corners exchanged": (
        "files: a.csv, processing: {order: paper, highpass: 5, lowpass: 1}",
        "motion.processing", "exchange",
    ),
    "corners of a response": (
        f"files: a.csv, response: {{file: x, corners: [1, 2, 2, 3]}}, {NONE}",
        "motion.response.corners", "ascend",
    ),
    "a pulse's key": (f"files: a.csv, pgv_pga: [0.3], {NONE}", "motion.pgv_pga", "has this key"),
    "misspelt": (f"files: a.csv, compnent: x, {NONE}", "motion.compnent", "did you mean comp"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(case: str, tmp_path: Path, refused: Refused) -> None:
    motion, key, *words = BAD[case]
    good = pulse_record(0.3)
    (tmp_path / "empty").mkdir()
    (tmp_path / "good.csv").write_text(good)
    (tmp_path / "copy.csv").write_text(good)
    (tmp_path / "bare.csv").write_text(good.replace("a [m/s2]", "a"))
    a = np.array([float(line.split(",")[1]) for line in good.splitlines()[1:]])
    step = CosinePulse.from_g(0.3, 0.3).duration / 600
    (tmp_path / "other.csv").write_text(files.csv(2.0 * a, step, "a [m/s2]"))
    (tmp_path / "mirror.csv").write_text(files.csv(-a, step, "a [m/s2]"))
    (tmp_path / "clipped.csv").write_text(files.csv(np.minimum(a, 2.0), step, "a [m/s2]"))
    (tmp_path / "drift.csv").write_text(files.csv(a + 0.2, step, "a [m/s2]"))
    if case == "wrong unit":
        (tmp_path / "bare.csv").write_text(files.csv(100.0 * a, step, "a"))
    path = site(tmp_path, f"{motion}, pga: [0.3]")
    line = refused("run", "fragility", "--site", path, "--workers", "0", words=(key, *words))
    assert f"rock.yaml: {key}: " in line


def test_a_copy_among_many_records_is_found_and_few_are_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 400 records all pairs would be 80,000."""
    generator, compared = np.random.default_rng(1), []
    noise = generator.normal(size=(400, 500))
    peaks = np.abs(noise).max(axis=1)
    ratios = np.abs(0.01 * noise.cumsum(axis=1)).max(axis=1) / peaks
    found = [
        Scaled(f"{n}.csv", ratio, 0.01, samples)
        for n, (ratio, samples) in enumerate(zip(ratios.tolist(), noise, strict=True))
    ]
    whole = Scaled.differs_in_scale_only

    def counted(one: Scaled, other: Scaled) -> bool:
        compared.append(other.file)
        return whole(one, other)

    monkeypatch.setattr(Scaled, "differs_in_scale_only", counted)
    refuse_copies("rock.yaml", "motion.files", found)
    assert 0 < len(compared) < 800
    copy = Scaled("copy.csv", found[7].left * (1.0 + 1e-5), 0.01, 3.0 * found[7].samples)
    with pytest.raises(InputError, match=r"got 7\.csv and copy\.csv, which are one motion at two"):
        refuse_copies("rock.yaml", "motion.files", [copy, *found])


def test_kinds_do_not_mix(tmp_path: Path, refused: Refused) -> None:
    """What a lower layer says of another kind of motion does not reach a record."""
    (tmp_path / "a.csv").write_text(pulse_record(0.3))
    path = site(tmp_path, f"files: a.csv, {NONE}, pga: [0.3]")
    assert load_site(path).config.motion.pga == (0.3,)  # base.yaml's pgv_pga is gone
    words = ("--set: motion.kind", "'bang'", "cosine_pulse")
    refused("plan", "--site", path, "--set", "motion.kind=bang", words=words)
    words = ("motion.files", "required")
    bare = tmp_path / "bare.yaml"
    bare.write_text(ROCK + f"motion: {{kind: record, {NONE}, pga: 0.3}}\n")
    refused("plan", "--site", bare, words=words)


def test_accuracy_is_about_pulses(folder: Path, tmp_path: Path, vsr: Vsr) -> None:
    ran = vsr("run", "accuracy", "--site", folder / "rock.yaml", "--workers", "0")
    assert ran.code == cli.REFUSED
    assert "motion.kind: got record" in ran.err


def test_a_record_that_is_named_as_the_response_is_a_record(tmp_path: Path, vsr: Vsr) -> None:
    """Tables of samples need none."""
    for name, ratio in (("one", 0.2), ("other", 0.3)):
        (tmp_path / f"{name}.csv").write_text(pulse_record(ratio))
    response = "response: {file: one.csv, corners: [0.05, 0.1, 25, 35]}"
    for named, told in (("one.csv", "1 record"), ("[one.csv, other.csv]", "2 records")):
        where = site(tmp_path, f"files: {named}, {NONE}, {response}, pga: [1]")
        assert f"motions: {told} x 1 PGA" in vsr("run", "motions", "--site", where).err
