"""Runs of shake-table tests: those not stored yet are done where the workers are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

from pipeline.stages.runs.overturning_runs import values
from pipeline.stages.runs.runner import Kind, Run, run_missing, stored
from pipeline.stages.studies.validation.recorded_tests import Tests, accelerations
from pipeline.workflow import keys
from pipeline.workflow.keys import VALIDATION_CODE
from pipeline.workflow.rows import RunRow
from pipeline.workflow.stage import Work
from vsr_core import engines
from vsr_core.run.cases import Case
from vsr_core.source import tracing
from vsr_core.validation.priors import Member
from vsr_core.validation.specimen import Form, drawn, shaken, standing_case


class Role(Enum):
    """What a draw is for."""

    MEMBER = "member of the ensemble"
    BEST_GUESS = "best guess"
    LOW = "an unknown at its low end"
    HIGH = "an unknown at its high end"


class Draw(NamedTuple):
    """What tells a draw of the unknowns from all others.

    Attributes
    ----------
    of : int or str, number of a member, or name of the unknown that is at an end
    """

    specimen: int
    role: Role
    of: int | str = ""


Outcomes = dict[Draw, dict[int, RunRow]]
"""Rows of the tests that a draw ran, by their numbers."""


class Shared(NamedTuple):
    """What the tests of one draw share on a worker."""

    folder: Path
    variable: str | None
    interval: float
    amplitude: float
    case: Case


def run_tests(shared: Shared, numbers: tuple[int, ...]) -> list[tuple[Any, ...]]:
    """Simulate some tests of one draw, on a worker."""
    records = accelerations(shared.folder, shared.variable)
    chosen = [records[number] for number in numbers]
    responses = shaken(shared.case, chosen, shared.interval, shared.amplitude)
    return [values(response) for response in responses]


KIND = Kind("validation", "tests", RunRow, run_tests, batch=8)


@dataclass(frozen=True, eq=False)
class Series:
    """Recorded tests and the specimens that they shook."""

    folder: Path
    tests: Tests
    forms: dict[int, Form]


def outcomes(
    work: Work,
    series: Series,
    members: Mapping[Draw, Member],
    wanted: Mapping[Draw, tuple[int, ...]],
) -> Outcomes:
    """Simulate those of the wanted tests that are not stored yet."""
    tests, draws, folder = series.tests, tuple(wanted), series.folder
    identities = _identities(series, {draw: members[draw] for draw in draws})
    records = accelerations(folder, tests.config.acceleration)
    digests = {number: keys.digest_bytes(row.tobytes()) for number, row in records.items()}

    def runs(draw: Draw) -> list[Run]:
        scene = identities[draw]
        return [
            Run(bytes.fromhex(keys.digest([scene, digests[number]])), number)
            for number in wanted[draw]
        ]

    def shared(draw: Draw) -> Shared:
        member, variable = members[draw], tests.config.acceleration
        rock = drawn(series.forms[draw.specimen], member, tests.config.density)
        case = standing_case(rock, member)
        return Shared(folder, variable, tests.interval, member.amplitude, case)

    done = run_missing(work, KIND, draws, runs, shared)
    if done.runs:
        work.log(f"validation: {done.summary}")
    rows: dict[Draw, list[RunRow]] = {draw: [] for draw in draws}
    for draw, part in stored(work.runs, KIND, draws, runs):
        rows[draw].extend(part)
    return {draw: dict(zip(wanted[draw], rows[draw], strict=True)) for draw in draws}


def _identities(series: Series, members: Mapping[Draw, Member]) -> dict[Draw, str]:
    """What the runs of each draw share: scan, member, engine and the code that they reach."""
    config = series.tests.config
    code = keys.digest(tracing.reached(VALIDATION_CODE))
    version = engines.load(config.engine).VERSION
    shapes = {specimen: _digest(form) for specimen, form in series.forms.items()}
    common = [repr(config.density), series.tests.interval, code, version]
    return {
        draw: keys.digest(
            [shapes[draw.specimen], {k: _plain(v) for k, v in vars(member).items()}, *common]
        )
        for draw, member in members.items()
    }


def _digest(form: Form) -> str:
    parts = (form.vertices, form.normals, form.faces, form.other)
    return keys.digest_bytes(*(part.tobytes() for part in parts), repr(form.spread).encode())


def _plain(value: Any) -> Any:
    return repr(value.tolist() if hasattr(value, "tolist") else value)
