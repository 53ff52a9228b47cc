"""Runs along PGA as they are kept with `simulation.keep: boundary`: all codes, and a sample."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.stages.runs import lines, overturning_runs
from pipeline.stages.runs.lines import Line
from pipeline.stages.runs.overturning_runs import line_batch
from pipeline.stages.runs.runner import AT_ONCE, parts
from pipeline.workflow.rows import Layout, LineRow
from vsr_core.outcome import DecidedBy, Movement, Outcome

CELLS, NO_RETURN = 500, 0.6


def runs(seed: int, columns: int = 6) -> np.ndarray:
    """Runs of a line with changes at random, and numbers of their own each."""
    chance = np.random.default_rng(seed)
    found = chance.random((CELLS, columns))
    found[:, 0] = np.repeat(chance.integers(0, 5, CELLS // 10), 10)
    found[:, 1] = np.repeat(chance.integers(0, 4, CELLS // 5), 5)
    found[:, 5] = np.arange(CELLS)
    return found


@pytest.mark.parametrize("columns", [6, 7])
def test_codes_come_back_of_all_runs_and_numbers_of_a_sample(columns: int) -> None:
    made = [runs(seed, columns) for seed in range(40)]
    samples = [lines.sampled(Line(row, 3), CELLS) for row in range(len(made))]
    kept = [
        LineRow(bytes([n]), 0, lines.packed(one, sample, NO_RETURN))
        for n, (one, sample) in enumerate(zip(made, samples, strict=True))
    ]
    table, whole = lines.columns(kept, CELLS), np.concatenate(made)
    for place, name in enumerate(("outcome", "decided_by")):
        np.testing.assert_array_equal(table[name], whole[:, place])
    lost = whole[:, 0] >= Outcome.UNSETTLED
    known = np.concatenate(samples) | lost
    for place, name in enumerate(lines.NUMBERS, start=2):
        np.testing.assert_array_equal(table[name][known], whole[known, place])
    assert (table["steps"][~known] == -1).all()
    assert all(np.isnan(table[name][~known]).all() for name in lines.NUMBERS[:3])
    toppled, rolled = table["outcome"] == Outcome.OVERTURNED, whole[:, 2] > NO_RETURN
    assert (table["movement"][toppled & rolled] == Movement.ROLLED_OVER).all()
    fell = toppled & ~rolled & (whole[:, 6] >= 0.5 if columns == 7 else False)
    assert (table["movement"][fell] == Movement.FELL).all()
    assert (table["movement"][toppled & ~rolled & ~fell] == Movement.SLID).all()
    for one, row in zip(made, kept, strict=True):
        assert lines.outcomes(row[1:], CELLS) == one[:, 0].tolist()


def test_what_decides_how_a_rock_left_its_seat_is_in_the_key(
    edit_function: Callable[[str, str, str], None],
) -> None:
    known = {lines.rule()}
    for name in ("movements", "no_return_tilt"):
        edit_function("vsr_core/run/movement.py", name, "str(1)")
        known.add(lines.rule())
    assert len(known) == 3


def test_a_line_takes_as_much_room_as_it_has_changes() -> None:
    none = np.zeros(CELLS, dtype=bool)
    still = np.zeros((CELLS, 6))
    once = still.copy()
    once[CELLS // 2 :, 0] = 1
    sizes = [
        len(lines.packed(one, none[: len(one)], NO_RETURN)) for one in (still, still[:9], once)
    ]
    assert sizes[0] == sizes[1] < sizes[2] < 2 * sizes[0]


def test_a_sample_is_a_hundredth_drawn_anew_for_each_line() -> None:
    drawn = [lines.sampled(Line(row, seed), 10_000) for row in range(20) for seed in (1, 2)]
    number = sum(map(np.count_nonzero, drawn))
    assert abs(number - 4000) < 5 * 4000**0.5  # standard deviations of a count
    assert len({one.tobytes() for one in drawn}) == len(drawn)
    np.testing.assert_array_equal(drawn[0], lines.sampled(Line(0, 1), 10_000))


def test_of_a_line_whose_worker_died_there_is_its_outcome_alone() -> None:
    row = Layout(LineRow).unsealed(Layout(LineRow).sealed(LineRow(b"k", int(Outcome.CRASHED))))
    assert row is not None
    table = lines.columns([row], 3)
    assert table["outcome"].tolist() == lines.outcomes(row[1:], 3) == [Outcome.CRASHED] * 3
    assert table["decided_by"].tolist() == [DecidedBy.SIMULATION] * 3
    assert table["movement"].tolist() == table["steps"].tolist() == [-1] * 3
    assert all(np.isnan(table[name]).all() for name in lines.NUMBERS[:3])


def test_long_lines_are_run_by_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def ends(shared: object, cells: tuple[object, ...]) -> list[tuple[float, ...]]:
        asked.append(len(cells))
        return [tuple(row) for row in runs(1)[sum(asked) - len(cells) : sum(asked)]]

    class Motions:
        pga = tuple(range(CELLS))

    monkeypatch.setattr(overturning_runs, "simulate_batch", ends)
    monkeypatch.setattr(overturning_runs, "LARGEST_BATCH", 200)
    shared: object = (None, None, Motions(), NO_RETURN)
    ((worst, packed),) = line_batch(shared, (Line(4, 9),))  # type: ignore[arg-type]
    assert asked == [200, 200, 100]
    assert worst == runs(1)[:, 0].max()
    assert packed == lines.packed(runs(1), lines.sampled(Line(4, 9), CELLS), NO_RETURN)


def test_lines_of_more_runs_than_are_held_at_once_come_one_by_one() -> None:
    assert list(parts(range(3), cells=AT_ONCE + 1)) == [[0], [1], [2]]
