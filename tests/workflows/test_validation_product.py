"""`vsr run validation` on a folder of tests made here, and what it refuses."""

from __future__ import annotations

import csv
import json
import math
import shutil
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import trimesh
import xarray as xr
from sklearn.exceptions import UndefinedMetricWarning

from pipeline import ROOT, cli
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.problems import InputError
from pipeline.stages.studies.validation import predictions, recorded_tests
from pipeline.stages.studies.validation.recorded_runs import Draw, Role, Shared, run_tests
from pipeline.stages.studies.validation.recorded_tests import digests_of_motions
from pipeline.workflow.rows import RunRow
from pipeline.workflow.run_store import RUNS
from vsr_core import GRAVITY
from vsr_core.arrays import Array
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.run import rocking_block
from vsr_core.run.cases import Case
from vsr_core.validation import priors, specimen

pytestmark = pytest.mark.usefixtures("small_pictures")

INTERVAL, RATIO = 0.005, 0.3
SHARED = ROOT.parent / "shared" / "data" / "shake_table"

WIDTHS = {1: 0.25, 2: 0.3}
"""Along the drive [m], of two blocks of the same height."""

SHARES = (0.3, 0.75, 0.97, 1.25, 1.5, 2.3)
"""PGA of each test, in units of the first that overturns the narrower block."""

MEMBERS, SPREAD = 4, 0.3
"""Draws, and the standard deviation of the gain, all of it that is unknown."""


@cache
def limit(number: int) -> float:
    """The lowest PGA that overturns a specimen [m/s2], by Housner's equation."""
    block = rocking_block.Block(WIDTHS[number] / 2.0, 0.375)
    return rocking_block.first_overturning_pga(block, RATIO, 2.0 * GRAVITY, 0.02 * GRAVITY)


def fell(number: int, gain: float = 1.0) -> list[int]:
    """Whether each test overturns a specimen at a gain: a stronger pulse always does, too."""
    strength = gain * np.array(SHARES) * limit(1) / limit(number)
    assert (np.abs(strength - 1.0) > 0.02).all(), "none so near that the solver decides"
    return (strength > 1.0).astype(int).tolist()


def share(number: int) -> Array:
    """Share of the members in which each test overturns a specimen, counted gain by gain."""
    members = priors.draws(priors.Priors(amplitude=(1.0, SPREAD)), MEMBERS)
    return np.mean([fell(number, member.amplitude) for member in members], axis=0)


def write_tests(folder: Path, **changes: object) -> Path:
    """Six pulses along the thin sides of two blocks, with Housner's outcomes for both."""
    folder.mkdir(exist_ok=True)
    rows = []
    for strength in SHARES:
        motion = CosinePulse(strength * limit(1), RATIO)
        rows.append(motion.acceleration(np.arange(0.0, motion.duration + INTERVAL, INTERVAL)))
    counts = [len(row) for row in rows]
    table = np.full((len(rows), max(counts) + 7), np.nan)
    for row, values in zip(table, rows, strict=True):
        row[: len(values)] = values
    table[0, 5] = changes.get("value", table[0, 5])
    xr.Dataset(
        {"acceleration": (("test", "time"), table), "n_samples": ("test", counts)},
        {"test": np.arange(1, 7), "time": INTERVAL * np.arange(table.shape[1])},
    ).to_netcdf(folder / "records.nc")
    lines = ["test,ground_motion,pga_g,pgv_pga_s,specimen1,specimen2,dem_s1_soft,has_record"]
    for k, (one, two) in enumerate(zip(fell(1), fell(2), strict=True)):
        pga = SHARES[k] * limit(1) / GRAVITY
        lines.append(f"{k + 1},motion {k // 2},{pga:.4f},{RATIO},{one},{two},{int(k > 1)},1")
    lines.append(f"99,motion 9,0.3,{RATIO},1,1,1,0")
    text = str(changes.get("outcomes", "\n".join(lines)))
    (folder / "outcomes.csv").write_text(text + "\n", encoding="utf-8")
    for number, width in WIDTHS.items():
        trimesh.creation.box([width, 0.4, 0.75]).export(folder / f"sp{number}.ply")
    assumed = (
        f"members: {MEMBERS}\namplitude: {{mean: 1, sd: {SPREAD}}}\nazimuth: {{mean: 0, sd: 1}}\n"
        "friction: [1.5, 2.0]\ncentre_of_mass: 0\nbase_error: 0\ninset: [0, 0]\n"
        "polarity_reversal_probability: 0.5\n"
    )
    (folder / "table.yaml").write_text(str(changes.get("assumed", assumed)), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = write_tests(tmp_path_factory.mktemp("tests") / "block_tests")
    derived = tmp_path_factory.mktemp("derived")
    code = cli.main(
        ["run", "validation", "--table", str(folder), "--derived", str(derived), "--workers", "0"]
    )
    assert code == cli.DONE
    return folder, derived / "block_tests"


def test_each_specimen_is_predicted_by_counting_its_members(made: tuple[Path, Path]) -> None:
    with xr.open_dataset(made[1] / "validation.nc") as data:
        assert data["probability"].dims == data["predicted"].dims == ("specimen", "test")
        assert data["specimen"].values.tolist() == [1, 2]
        assert data["test"].values.tolist() == [1, 2, 3, 4, 5, 6]
        for number in (1, 2):
            one = data.sel(specimen=number)
            np.testing.assert_array_equal(one["probability"], share(number))
            sides = share(number) >= share(number).mean()
            assert one["predicted"].values.tolist() == sides.astype(int).tolist()
            assert one["best_guess"].values.tolist() == fell(number)
            assert one["happened"].values.tolist() == fell(number)
        assert (data["members"] == MEMBERS).all()
        assert data.attrs["Conventions"] == "CF-1.11"
        settings = json.loads(data.attrs["vsr_config_json"])
        assert set(settings) == set(ShakeTableConfig.model_fields)
        assert (settings["members"], settings["friction"]) == (MEMBERS, [1.5, 2.0])
        assert data.attrs["history"] == "made by stage validation from block_tests"


def test_each_specimen_is_in_doubt_about_tests_of_its_own(made: tuple[Path, Path]) -> None:
    """Between none and all of its members, a gain one standard deviation off decides."""
    with (made[1] / "validation_unknowns.csv").open(encoding="utf-8") as file:
        rows = {(int(r["specimen"]), r["unknown"]): r for r in csv.DictReader(file)}
    counts = []
    for number in (1, 2):
        open_ones = (share(number) > 0.0) & (share(number) < 1.0)
        low, high = (np.array(fell(number, 1.0 + at * SPREAD))[open_ones] for at in (-1.0, 1.0))
        row = rows[number, "amplitude"]
        counts.append(int(row["tests"]))
        assert counts[-1] == open_ones.sum()
        assert (int(row["overturned_low"]), int(row["overturned_high"])) == (low.sum(), high.sum())
        assert float(row["changed"]) == pytest.approx((low != high).mean(), abs=1e-5)
        assert float(rows[number, "friction"]["changed"]) == 0.0
    assert counts[0] != counts[1]


def test_scores_are_of_each_predictor_and_subset(made: tuple[Path, Path]) -> None:
    with (made[1] / "validation.csv").open(encoding="utf-8") as file:
        rows = {(r["specimen"], r["predictor"], r["subset"]): r for r in csv.DictReader(file)}
    assert {key[2] for key in rows} == {"all", "calibration half", "other half"}
    for number in (1, 2):
        ours, happened = rows[str(number), "ensemble", "all"], np.array(fell(number))
        sides = share(number) >= share(number).mean()
        assert ours["n"] == "6"
        assert float(ours["accuracy"]) == pytest.approx((sides == happened).mean(), abs=1e-5)
        brier = ((share(number) - happened) ** 2).mean()
        assert float(ours["brier"]) == pytest.approx(brier, abs=1e-5)
    # said to fall from the third test on, when it did from the fourth on
    soft = rows["1", "dem soft", "all"]
    assert float(soft["accuracy"]) == pytest.approx(5 / 6, abs=1e-5)
    assert float(rows["1", "always balanced", "all"]["balanced_accuracy"]) == 0.5
    alike = (np.array(fell(1)) == fell(2)).mean()
    other = rows["2", "outcome of specimen 1", "all"]
    assert float(other["accuracy"]) == pytest.approx(alike, abs=1e-5)
    halves = [int(rows["1", "ensemble", part]["n"]) for part in ("calibration half", "other half")]
    assert sum(halves) == 6


def test_page_shows_its_pictures_and_what_was_assumed(made: tuple[Path, Path]) -> None:
    page = (made[1] / "validation.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 4
    for word in (
        "McNemar",
        "normal, 0 ± 1 deg from the scan&#39;s +x",
        "uniform from 1.5 to 2",
        "sign of the drive",
        "Specimen 1: no logistic of PGA and PGV/PGA, as the outcomes",  # fell from one PGA on
    ):
        assert word in page
    assert "{" not in page.partition("<body>")[2]  # nothing as Python writes it
    for name in ("reliability", "roc", "fragility", "tests"):
        assert (made[1] / f"validation_{name}.png").stat().st_size > 10_000


@pytest.mark.slow
def test_a_folder_without_outcomes_is_predicted(made: tuple[Path, Path], tmp_path: Path) -> None:
    """From the runs of the same tests with outcomes."""
    rows = [f"{k},motion,{0.1 * k},{RATIO}" for k in range(1, 7)]
    text = "\n".join(["test,ground_motion,pga_g,pgv_pga_s", *rows])
    folder = write_tests(tmp_path / "unknown", outcomes=text)
    (tmp_path / "to" / "unknown").mkdir(parents=True)
    shutil.copyfile(made[1] / RUNS, tmp_path / "to" / "unknown" / RUNS)
    arguments = ["run", "validation", "--table", str(folder), "--derived", str(tmp_path / "to")]
    assert cli.main([*arguments, "--workers", "0"]) == cli.DONE
    with xr.open_dataset(tmp_path / "to" / "unknown" / "validation.nc") as data:
        for number in (1, 2):
            np.testing.assert_array_equal(data["probability"].sel(specimen=number), share(number))
        assert data["happened"].isnull().all()
    page = (tmp_path / "to" / "unknown" / "validation.html").read_text(encoding="utf-8")
    assert page.count("no observed outcomes, predictions only") == 2


@pytest.mark.slow
def test_outcomes_that_are_all_alike_are_told_without_a_curve(
    made: tuple[Path, Path], tmp_path: Path
) -> None:
    """No library warns of a mean or an area of nothing."""
    rows = [f"{k},motion {k},{0.1 * k},{RATIO},0" for k in range(1, 7)]
    text = "\n".join(["test,ground_motion,pga_g,pgv_pga_s,specimen1", *rows])
    folder = write_tests(tmp_path / "alike", outcomes=text)
    (tmp_path / "to" / "alike").mkdir(parents=True)
    shutil.copyfile(made[1] / RUNS, tmp_path / "to" / "alike" / RUNS)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("error", UndefinedMetricWarning)
        found = validated(folder, tmp_path / "to")
    assert not found["happened"].sel(specimen=1).any()


def write_commanded(folder: Path, **changes: str) -> Path:
    """The same pulses by their numbers alone, on one block that stands along x and along y."""
    folder.mkdir()
    lines = ["test,series,azimuth_deg,pga_g,pgv_pga_s,specimen1,specimen2"]
    for k, strength in enumerate(SHARES):
        pulse = f"{strength * limit(1) / GRAVITY:.6f},{RATIO}"
        lines += [f"{k + 1},along x,0,{pulse},{fell(1)[k]},", f"{k + 101},along y,90,{pulse},,"]
    text = changes.get("outcomes", "\n".join(lines))
    (folder / "outcomes.csv").write_text(text + "\n", encoding="utf-8")
    for number, size in ((1, (0.25, 0.4, 0.75)), (2, (0.4, 0.25, 0.75))):
        trimesh.creation.box(size).export(folder / f"sp{number}.ply")
    assumed = (
        f"members: {MEMBERS}\namplitude: {{mean: 1, sd: {SPREAD}}}\nazimuth: {{mean: 0, sd: 0}}\n"
        "friction: [1.5, 2.0]\ncentre_of_mass: 0\nbase_error: 0\ninset: [0, 0]\n"
    )
    (folder / "table.yaml").write_text(assumed + changes.get("more", ""), encoding="utf-8")
    return folder


def validated(folder: Path, derived: Path) -> xr.Dataset:
    arguments = ["run", "validation", "--table", str(folder), "--derived", str(derived)]
    assert cli.main([*arguments, "--workers", "0"]) == cli.DONE
    with xr.open_dataset(derived / folder.name / "validation.nc") as data:
        return data.load()


@pytest.mark.slow
def test_pulses_by_their_numbers_shake_each_series_in_its_direction(tmp_path: Path) -> None:
    """The narrow side of one block lies along x, that of the other along y."""
    data = validated(write_commanded(tmp_path / "commanded"), tmp_path / "derived")
    along = {"along x": 1, "along y": 2}
    for name, specimen_number in along.items():
        own = data.sel(test=data["series"] == name, specimen=specimen_number)
        np.testing.assert_array_equal(own["probability"], share(1))
    # one series has outcomes: the other is predicted after them, each gain by its likelihood
    other = data.sel(specimen=1, test=data["series"] == "along y")
    gains = [m.amplitude for m in priors.draws(priors.Priors(amplitude=(1.0, SPREAD)), MEMBERS)]
    agree = np.array([(np.array(fell(1, gain)) == fell(1)).sum() for gain in gains])
    likely = 0.89**agree * 0.11 ** (len(SHARES) - agree)
    expected = likely.sum() ** 2 / (likely**2).sum()
    np.testing.assert_allclose(other["effective_members"], expected)
    first = data.sel(specimen=1, test=data["series"] == "along x")
    np.testing.assert_array_equal(first["probability_conditioned"], first["probability"])
    assert data["happened"].sel(specimen=2).isnull().all()


@pytest.mark.slow
@pytest.mark.parametrize("components", [1, 3])
def test_records_may_have_components(
    made: tuple[Path, Path], tmp_path: Path, components: int
) -> None:
    """Along the drive alone, or also across and up, where nothing moves: the same outcomes."""
    folder = write_tests(tmp_path / "along")
    with xr.open_dataset(folder / "records.nc") as data:
        records = data.load()
    along = records["acceleration"].expand_dims(component=components, axis=2)
    still = xr.DataArray(np.eye(1, components)[0], dims="component")
    records.assign(acceleration=along * still).to_netcdf(folder / "records.nc")
    data = validated(folder, tmp_path / "derived")
    for number in (1, 2):
        np.testing.assert_array_equal(data["probability"].sel(specimen=number), share(number))


@pytest.mark.slow
def test_a_table_with_a_slow_motor_is_weaker(tmp_path: Path) -> None:
    """Steps that take a hundred times as long as asked for hardly move a block."""
    more = "stepper: {rate: 200, step: 4e-5, overhead: 0.01}\n"
    data = validated(write_commanded(tmp_path / "slow", more=more), tmp_path / "derived")
    assert data["probability"].max() == 0.0


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("1,a,0,0.2,0.3,1\n1,a,0,0.3,0.3,", ("test", "1 twice")),
        ("1,a,400,0.2,0.3,1", ("azimuth_deg", "400", "360")),
        ("1,a,,0.2,0.3,1", ("azimuth_deg", "in each row")),
        ("1,a,0,0.2,0.3,2", ("specimen1", "1 is overturned", "empty")),
        ("1,a,0,20,0.3,1", ("pga_g", "20")),
        ("1.5,a,0,0.2,0.3,1", ("test", "1.5", "whole")),
    ],
)
def test_a_table_of_pulses_is_checked(
    tmp_path: Path, refused: Callable[..., str], rows: str, words: tuple[str, ...]
) -> None:
    head = "test,series,azimuth_deg,pga_g,pgv_pga_s,specimen1\n"
    folder = write_commanded(tmp_path / "wrong", outcomes=head + rows)
    refused("run", "validation", "--table", folder, words=("outcomes.csv", *words))


def test_a_test_that_no_draw_took_near_toppling_is_decided(made: tuple[Path, Path]) -> None:
    tests = recorded_tests.tests_in(made[0])
    of = specimen.form(trimesh.creation.box([0.25, 0.4, 0.75]), None)
    edge = math.atan(0.25 / 0.75)  # the tilt from which the block falls on

    def row(tilt: float, outcome: Outcome = Outcome.BALANCED) -> RunRow:
        return RunRow(b"", int(outcome), 0, tilt, 0.0, 0.0, 1)

    near, far, lost = row(0.6 * edge), row(0.4 * edge), row(0.4 * edge, Outcome.UNSTABLE)
    died = RunRow(b"", int(Outcome.CRASHED))
    found = {
        Draw(1, Role.MEMBER, 0): {1: far, 2: far, 3: far, 4: near, 5: far, 6: far},
        Draw(1, Role.MEMBER, 1): {1: far, 2: near, 3: lost, 4: near, 5: died, 6: far},
        Draw(1, Role.BEST_GUESS): dict.fromkeys(tests.number, near),
        Draw(2, Role.MEMBER, 0): dict.fromkeys(tests.number, near),
    }
    assert predictions.undecided(tests, 1, of, found) == (2, 3, 4, 5)


def test_a_second_call_runs_nothing(
    made: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, derived = made
    before = (derived / "validation.nc").stat().st_mtime_ns
    arguments = ["run", "validation", "--table", str(folder), "--derived", str(derived.parent)]
    assert cli.main([*arguments, "--workers", "0"]) == cli.DONE
    assert "tests done" not in capsys.readouterr().err
    assert (derived / "validation.nc").stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"value": np.nan}, ("records.nc", "acceleration", "test 1", "numbers")),
        ({"outcomes": "test,pga_g\n1,0.2"}, ("outcomes.csv", "pgv_pga_s")),
        (
            {"outcomes": "test,ground_motion,pga_g,pgv_pga_s,specimen1\n1,a,0.2,0.3,2"},
            ("outcomes.csv", "specimen1", "'2' of test 1"),
        ),
        (
            {"outcomes": "test,ground_motion,pga_g,pgv_pga_s\n77,a,0.2,0.3"},
            ("outcomes.csv", "no test with a record"),
        ),
        ({"assumed": "frictoin: [0.5, 0.9]"}, ("table.yaml", "frictoin", "friction")),
        ({"assumed": "acceleration: velocity"}, ("records.nc", "velocity", "name another")),
    ],
)
def test_what_is_wrong_is_told_in_one_line(
    tmp_path: Path, refused: Callable[..., str], changes: dict[str, object], words: tuple[str, ...]
) -> None:
    folder = write_tests(tmp_path / "wrong", **changes)
    refused("run", "validation", "--table", folder, "--workers", 0, words=words)


def test_a_folder_is_needed(refused: Callable[..., str], tmp_path: Path) -> None:
    refused("run", "validation", words=("TABLE=",))
    refused("run", "validation", "--table", tmp_path / "none", words=("none", "not found"))
    refused("run", "validation", "--table", tmp_path, words=("outcomes.csv",))


@pytest.mark.skipif(not SHARED.is_dir(), reason="the public shake-table tests are not here")
def test_public_tests_are_read_whole() -> None:
    tests = recorded_tests.tests_in(SHARED)
    assert len(tests.number) == 490
    assert tests.specimens == (1, 2)
    assert len([name for _, name in tests.published if name.startswith("dem")]) == 5
    found = recorded_tests.motions_of(SHARED)
    peaks = [found[n].peak_acceleration / GRAVITY for n in tests.number]
    assert np.corrcoef(peaks, tests.pga)[0, 1] > 0.7


def test_tests_of_other_files_are_not_run(tmp_path: Path) -> None:
    """A worker reads the folder of tests by itself, maybe when it has been edited."""
    folder = write_tests(tmp_path / "tests")
    shared = Shared(folder, digests_of_motions(folder), 1.0, cast(Case, None))
    edited = (folder / "outcomes.csv").read_text().replace(f",{RATIO},", ",0.31,", 1)
    (folder / "outcomes.csv").write_text(edited)
    with pytest.raises(InputError, match="edited while a command that reads it was at work"):
        run_tests(shared, (1,))
