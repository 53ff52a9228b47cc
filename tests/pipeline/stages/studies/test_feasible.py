"""What a shake table can do: limits, commands, and the products of `vsr feasible`."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.config.layers import TABLES, known, load_table
from pipeline.config.slips import warnings_of_table
from pipeline.stages.studies import feasible
from pipeline.stages.studies.feasible import feasible_grid
from pipeline.workflow.store import Store
from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse
from vsr_core.table.capacity import LIMITS, Table, binding, commands, largest_pga, loads

pytestmark = pytest.mark.usefixtures("small_pictures")

TABLE = Table(12.0, 0.5, 0.2, 2.0, 200.0, 0.05, 1600)
SMALL = "rock: {shape: box, size: [0.05, 0.05, 0.2], density: 1500}\n"
GRID = (
    SMALL + "motion: {pga: [0.1, 0.3, 1.0, 1.3], pgv_pga: [0.05, 0.15, 0.4]}\n"
    "simulation: {time_step: 0.0006}\n"
)

PULSES = st.builds(CosinePulse, st.floats(0.01, 30.0), st.floats(0.005, 2.0))


@given(PULSES, st.floats(0.01, 4.0))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_what_binds_is_what_the_course_of_the_pulse_goes_beyond(
    pulse: CosinePulse, mass: float
) -> None:
    t = np.linspace(0.0, pulse.duration, 4001)  # holds the quarters of the pulse
    measured = {
        "acceleration": np.abs(pulse.acceleration(t)).max(),
        "velocity": np.abs(pulse.velocity(t)).max(),
        "stroke": np.ptp(pulse.displacement(t)),
        "payload": mass,
    }
    shares = {name: value / getattr(TABLE, name) for name, value in measured.items()}
    bound = binding(TABLE, pulse, mass)
    assert (bound == "") == (max(shares.values()) <= 1.0)
    if bound:
        assert shares[bound] == pytest.approx(max(shares.values()))
    assert loads(pulse, mass) == pytest.approx(measured)


@given(st.floats(0.005, 2.0))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_the_largest_pga_is_just_within_its_limit(ratio: float) -> None:
    for name, pga in largest_pga(TABLE, ratio).items():
        load = loads(CosinePulse(pga, ratio), 1.0)[name]
        assert load == pytest.approx(getattr(TABLE, name))


def test_a_limit_that_nobody_stated_never_binds() -> None:
    free = Table(math.inf, math.inf, math.inf, math.inf, 200.0, 0.05, None)
    assert binding(free, CosinePulse(1e3, 10.0), 1e6) == ""


@given(st.floats(0.05, 10.0), st.floats(0.01, 1.0), st.sampled_from([100.0, 200.0]))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_commands_bring_the_table_where_the_motion_is(
    pga: float, ratio: float, rate: float
) -> None:
    table = Table(math.inf, math.inf, math.inf, math.inf, rate, 0.05398, 3200)
    pulse = CosinePulse(pga, ratio)
    sent = commands(table, pulse)
    np.testing.assert_allclose(np.diff(sent.time), 1.0 / rate)
    assert len(sent.time) == math.ceil(pulse.duration * rate - 1e-9) + 1
    assert sent.velocity[-1] == 0.0
    assert sent.time[-1] >= pulse.duration - 1e-9
    place = np.cumsum(sent.velocity) / rate
    ends = sent.time + 1.0 / rate
    np.testing.assert_allclose(place, pulse.displacement(ends), atol=1e-9 * max(1.0, pga))
    assert place[-1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(sent.velocity).max() <= pga * ratio * (1.0 + 1e-9)
    assert sent.steps is not None
    turn = math.pi * 0.05398
    np.testing.assert_allclose(sent.steps * turn / 3200, place, atol=0.51 * turn / 3200)
    assert sent.steps[-1] == 0


def test_without_steps_a_turn_there_are_no_motor_steps() -> None:
    table = Table(12.0, 0.5, 0.2, 2.0, 200.0, 0.05, None)
    assert commands(table, CosinePulse(3.0, 0.1)).steps is None


# The tables that come with it


def test_the_mini_shake_robot_is_as_published_and_says_what_is_not() -> None:
    config, _ = load_table("mini_shake_robot")
    table = config.table()
    assert table.acceleration == pytest.approx(1.2 * GRAVITY)
    assert (table.velocity, table.payload, table.pulley) == (0.5, 2.0, 0.05398)
    assert table.stroke == math.inf
    assert config.unstated == ("stroke", "steps_per_turn")


def test_every_table_can_be_loaded() -> None:
    assert "mini_shake_robot" in known(TABLES)
    for name in known(TABLES):
        assert list(warnings_of_table(*load_table(name))) == []


# The command

MINE = """acceleration: 1.1
velocity: 0.5
stroke: 0.35
payload: 2
pulley_diameter: 0.05
steps_per_turn: 1600
command_rate: 200
"""


@pytest.fixture
def write_table(tmp_path: Path) -> Callable[..., str]:
    def write(text: str = MINE) -> str:
        path = tmp_path / "mine.yaml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


@pytest.mark.slow
def test_products_of_a_small_grid(
    write_site: Callable[..., str],
    write_table: Callable[..., str],
    vsr: Callable[..., object],
    derived: Path,
    tmp_path: Path,
) -> None:
    out = tmp_path / "commands"
    site, table = write_site(GRID), write_table()
    assert vsr("run", "boundary", "--site", site, "--workers", "0").code == 0  # type: ignore[attr-defined]
    ran = vsr("feasible", "--site", site, "--table", table, "--export", out)
    assert ran.code == 0, ran.err  # type: ignore[attr-defined]
    folder = derived / "rock"
    data = xr.load_dataset(folder / "feasible.nc")
    # velocity: PGA up to 0.5 / (9.81 r) = 1.02, 0.34 and 0.13 g; stroke: 7.1, 0.79 and 0.11 g
    expected = [[1, 1, 1, 0], [1, 1, 0, 0], [1, 0, 0, 0]]
    np.testing.assert_array_equal(data["feasible"].values, expected)
    names = data["binding"].attrs["flag_meanings"].split()
    assert names == ["none", *LIMITS]
    # 1.3 g at 0.05 s: 0.64 m/s of 0.5, and 1.3 g of 1.1; 0.4 s: 2 a (0.4 s)^2 of 0.35 m
    assert names[data["binding"].values[0, 3]] == "velocity"
    assert names[data["binding"].values[2, 3]] == "stroke"
    rows = list(csv.DictReader((folder / "feasible.csv").open()))
    assert len(rows) == 12
    assert [int(row["feasible"]) for row in rows] == np.ravel(expected).tolist()
    assert "6 of 12 motions" in ran.out  # type: ignore[attr-defined]
    assert (folder / "feasible.png").stat().st_size > 10_000
    files = sorted(path.name for path in out.iterdir())
    assert len(files) == 6
    sent = list(csv.DictReader((out / "pgv_pga_0.15_pga_0.3.csv").open()))
    pulse = CosinePulse.from_g(0.3, 0.15)
    assert len(sent) == math.ceil(200 * pulse.duration) + 1
    assert float(sent[-1]["velocity_m_per_s"]) == 0.0
    assert list(sent[0]) == ["time_s", "velocity_m_per_s", "motor_step"]
    middle = sent[(len(sent) - 1) // 2 - 1]
    place = int(middle["motor_step"]) * math.pi * 0.05 / 1600
    assert place == pytest.approx(2.0 * pulse.pga * 0.15**2, rel=0.01)


def test_a_limit_that_looks_like_millimetres_is_told(
    write_site: Callable[..., str], write_table: Callable[..., str], vsr: Callable[..., object]
) -> None:
    table = write_table(MINE.replace("stroke: 0.35", "stroke: 350"))
    ran = vsr("feasible", "--site", write_site(GRID), "--table", table)
    assert ran.code == 0, ran.err  # type: ignore[attr-defined]
    said = [line for line in ran.err.splitlines() if "warning" in line]  # type: ignore[attr-defined]
    assert len(said) == 1
    assert "mine.yaml: stroke: got 350; strokes are in metres" in said[0]


def test_commands_of_two_tables_never_lie_in_one_folder(
    write_site: Callable[..., str], write_table: Callable[..., str], refused: Callable[..., str],
    tmp_path: Path,
) -> None:  # fmt: skip
    out = tmp_path / "commands"
    out.mkdir()
    (out / "pgv_pga_0.05_pga_1.csv").write_text("time_s,velocity_m_per_s\n")
    command = ("feasible", "--site", write_site(GRID), "--export", out)
    refused(*command, "--table", write_table(), words=("--export", "empty folder"))
    coarse = write_table(MINE.replace("command_rate: 200", "command_rate: 20"))
    (out / "pgv_pga_0.05_pga_1.csv").unlink()
    refused(*command, "--table", coarse, words=("command_rate", "20 Hz", "16 commands"))


def test_an_export_that_is_stopped_can_be_begun_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    grid = xr.Dataset(
        {"feasible": (("pgv_pga", "pga"), [[1, 1]])}, {"pgv_pga": [0.1], "pga": [0.1, 0.2]}
    )

    def stopped(table: Table, pulse: CosinePulse) -> object:
        if pulse.pga > 1.5:
            raise KeyboardInterrupt
        return commands(table, pulse)

    with monkeypatch.context() as patch:
        patch.setattr(feasible, "commands", stopped)
        with pytest.raises(KeyboardInterrupt):
            feasible._export(grid, TABLE, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []
    assert feasible._export(grid, TABLE, tmp_path / "out") == 2


@pytest.mark.slow
def test_a_damaged_boundary_and_that_of_another_rock_are_not_drawn(
    write_site: Callable[..., str],
    vsr: Callable[..., object],
    derived: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    site, drawn = write_site(GRID), []
    draw = feasible.feasible_grid
    monkeypatch.setattr(
        feasible, "feasible_grid", lambda data, rock: drawn.append(rock) or draw(data, rock)
    )
    assert vsr("run", "boundary", "--site", site, "--workers", "0").code == 0  # type: ignore[attr-defined]
    for setting in ("yaw=[45]", "rock.size=[0.5, 1.0, 3.0]"):
        assert vsr("feasible", "--site", site, "--set", setting).code == 0  # type: ignore[attr-defined]
    assert vsr("feasible", "--site", site).code == 0  # type: ignore[attr-defined]
    assert [rock is None for rock in drawn] == [True, True, False]
    store = Store(derived / "rock")
    made = store.manifest("feasible")
    assert made is not None
    assert made["facts"]["needs"].keys() == {"rock", "boundary"}  # by which it goes stale
    (store.folder / "boundary.nc").write_bytes(b"")
    assert vsr("feasible", "--site", site).code == 0  # type: ignore[attr-defined]
    assert drawn[-1] is None


def test_a_rock_that_is_too_heavy_binds_everywhere(
    write_site: Callable[..., str], vsr: Callable[..., object]
) -> None:
    site = write_site("motion: {pga: [0.1, 0.2], pgv_pga: 0.1}\n")  # 2110 kg
    ran = vsr("feasible", "--site", site)
    assert "mini_shake_robot: 0 of 2 motions" in ran.out  # type: ignore[attr-defined]
    assert "a model of it at 0.0982 of its size" in ran.out  # type: ignore[attr-defined]
    assert "not checked: stroke, steps_per_turn" in ran.out  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (MINE + "strok: 1\n", ("mine.yaml: strok", "unknown key", "did you mean stroke?")),
        (MINE.replace("payload: 2\n", ""), ("mine.yaml: payload", "required", "[kg]")),
        (MINE.replace("0.5", "-0.5"), ("mine.yaml: velocity", "got -0.5", "[m/s]")),
        (MINE.replace("200", "no"), ("mine.yaml: command_rate", "'no'", "[Hz]")),
    ],
)
def test_wrong_tables(
    write_site: Callable[..., str],
    write_table: Callable[..., str],
    refused: Callable[..., str],
    text: str,
    words: tuple[str, ...],
) -> None:
    refused("feasible", "--site", write_site(GRID), "--table", write_table(text), words=words)


def test_a_table_that_nobody_knows(
    write_site: Callable[..., str], refused: Callable[..., str]
) -> None:
    words = ("--table", "'mini_shake'", "did you mean mini_shake_robot?")
    refused("feasible", "--site", write_site(GRID), "--table", "mini_shake", words=words)


def test_records_are_no_grid_of_pulses(
    write_site: Callable[..., str], refused: Callable[..., str]
) -> None:
    line = ("feasible", "--site", write_site(SMALL), "--study", "records")
    words = ("motion.kind", "'record'", "cosine pulses")
    refused(*line, "--table", "mini_shake_robot", words=words)


def test_cells_beyond_the_limits_are_drawn_as_such() -> None:
    """By another colour and a hatch, and each of the lines that bind in the grid."""
    data = xr.Dataset(
        {
            "feasible": (("pgv_pga", "pga"), np.array([[1, 0], [0, 0]], np.int8)),
            "acceleration_pga": ("pgv_pga", [0.8, 0.8]),
            "velocity_pga": ("pgv_pga", [0.6, 0.3]),
            "stroke_pga": ("pgv_pga", [math.inf, math.inf]),
        },
        {"pga": [0.5, 1.0], "pgv_pga": [0.1, 0.2]},
        {"mass_kg": 1.0, "table": "mine"},
    )
    axes = feasible_grid(data, None).axes[0]
    outside = next(c for c in axes.collections if c.get_gid() == "outside")
    inside = next(c for c in axes.collections if c.get_gid() == "can")
    assert outside.get_hatch()
    assert not inside.get_hatch()
    rows = {
        kind: [path.get_extents().bounds for path in part.get_paths()]
        for kind, part in (("can", inside), ("outside", outside))
    }
    middle, end = 0.75, 1.25  # between the cells, and beyond them
    assert [left + width for left, _, width, _ in rows["can"]] == [middle]
    assert [(left, left + width) for left, _, width, _ in rows["outside"]] == [
        (middle, end),
        (0.25, end),
    ]
    lines = {line.get_label() for line in axes.lines}
    assert {"acceleration limit", "velocity limit"} <= lines
    assert "stroke limit" not in lines
