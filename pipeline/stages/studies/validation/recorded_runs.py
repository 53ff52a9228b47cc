"""Runs of shake-table tests: those not stored yet are done where the workers are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from pipeline.config import in_si
from pipeline.stages.runs.overturning_runs import values
from pipeline.stages.runs.runner import Kind, Run, run_missing, stored
from pipeline.stages.studies.validation.recorded_tests import Tests, motions_of
from pipeline.stages.studies.validation.table_motions import identity
from pipeline.workflow import keys
from pipeline.workflow.keys import VALIDATION_CODE
from pipeline.workflow.rows import RunRow
from pipeline.workflow.stage import Work
from vsr_core import engines
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Case
from vsr_core.source import tracing
from vsr_core.validation.priors import Member
from vsr_core.validation.specimen import Form, amplified, drawn, shaken, standing_case


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


class Drive(NamedTuple):
    """A draw, and the direction that is given for the drive of a test [degree], if one is."""

    draw: Draw
    azimuth: float | None


class Shared(NamedTuple):
    """What the tests of one draw and one direction share on a worker."""

    folder: Path
    known: tuple[str, ...]
    amplitude: float
    case: Case


def run_tests(shared: Shared, numbers: tuple[int, ...]) -> list[tuple[Any, ...]]:
    """Simulate some tests of one draw, on a worker."""
    table = motions_of(shared.folder, shared.known)
    chosen = [amplified(table[number], shared.amplitude) for number in numbers]
    return [values(response) for response in shaken(shared.case, chosen)]


KIND = Kind("validation", "tests", RunRow, run_tests, batch=8)


@dataclass(frozen=True, eq=False)
class Series:
    """Tests and the specimens that they shook.

    Attributes
    ----------
    known : digests of the files that tell how the table moved
    """

    folder: Path
    known: tuple[str, ...]
    tests: Tests
    forms: dict[int, Form]


def outcomes(
    work: Work,
    series: Series,
    members: Mapping[Draw, Member],
    wanted: Mapping[Draw, tuple[int, ...]],
) -> Outcomes:
    """Simulate those of the wanted tests that are not stored yet."""
    tests, place = series.tests, (series.folder, series.known)
    table = {number: identity(motion) for number, motion in motions_of(*place).items()}
    given = dict(zip(tests.number, tests.azimuth, strict=True))
    numbers: dict[Drive, tuple[int, ...]] = {}
    for draw, asked in wanted.items():
        for azimuth in dict.fromkeys(given[number] for number in asked):
            own = tuple(number for number in asked if given[number] == azimuth)
            numbers[Drive(draw, azimuth)] = own
    driven = {drive: _driven(members[drive.draw], tests, drive.azimuth) for drive in numbers}
    identities = _identities(series, driven)

    @lru_cache(maxsize=1)
    def rock(draw: Draw) -> tuple[Rock, Barrier]:
        found = drawn(series.forms[draw.specimen], members[draw], tests.config.density)
        return found, barrier(found)

    def runs(drive: Drive) -> list[Run]:
        scene = identities[drive]
        return [
            Run(bytes.fromhex(keys.digest([scene, table[number]])), number)
            for number in numbers[drive]
        ]

    def shared(drive: Drive) -> Shared:
        member = driven[drive]
        return Shared(*place, member.amplitude, standing_case(*rock(drive.draw), member))

    drives = tuple(numbers)
    done = run_missing(work, KIND, drives, runs, shared)
    if done.runs:
        work.log(f"validation: {done.summary}")
    rows: dict[Drive, list[RunRow]] = {drive: [] for drive in drives}
    for drive, part in stored(work.runs, KIND, drives, runs):
        rows[drive].extend(part)
    found: Outcomes = {draw: {} for draw in wanted}
    for drive in drives:
        found[drive.draw].update(zip(numbers[drive], rows[drive], strict=True))
    return found


def _driven(member: Member, tests: Tests, azimuth: float | None) -> Member:
    """A draw in a direction that is given: the prior's error about that in place of its mean."""
    if azimuth is None:
        return member
    error = member.azimuth - in_si.angle(tests.config.azimuth.mean)
    return replace(member, azimuth=in_si.angle(azimuth) + error)


def _identities(series: Series, members: Mapping[Drive, Member]) -> dict[Drive, str]:
    """What the runs of each drive share: scan, member, engine and the code that they reach."""
    config = series.tests.config
    code = keys.digest(tracing.reached(VALIDATION_CODE))
    version = engines.load(config.engine).VERSION
    shapes = {specimen: _digest(form) for specimen, form in series.forms.items()}
    common = [repr(config.density), code, version]
    return {
        drive: keys.digest(
            [shapes[drive.draw.specimen], {k: _plain(v) for k, v in vars(member).items()}, *common]
        )
        for drive, member in members.items()
    }


def _digest(form: Form) -> str:
    parts = (form.vertices, form.normals, form.faces, form.other)
    return keys.digest_bytes(*(part.tobytes() for part in parts), repr(form.spread).encode())


def _plain(value: Any) -> Any:
    return repr(value.tolist() if hasattr(value, "tolist") else value)
