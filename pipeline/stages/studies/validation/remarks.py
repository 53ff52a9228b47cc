"""What is unusual in recorded tests and is told: files, records that differ from the table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from pipeline.config import in_si
from pipeline.config.folder_names import in_a_line, unread
from pipeline.config.sections import STRONG_PGA
from pipeline.config.slips import radians_of
from pipeline.stages.studies.validation.recorded_tests import (
    ALIKE,
    ASSUMED,
    Tests,
    files_of,
    motions_of,
    peak_ratios,
)
from pipeline.stages.studies.validation.table_motions import (
    QUIET,
    RECORDS,
    identity,
    left_out,
    others,
)
from pipeline.workflow.grammar import counted
from vsr_core.arrays import Array
from vsr_core.motions import order
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.records.components import ComponentMotion
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.rock.doubts import doubts

if TYPE_CHECKING:
    import trimesh

SLOW = 1.0
"""PGV/PGA [s] that tests do not reach: of two published series the largest is 0.5."""

VELOCITIES = 1.75
"""Factor within which peak velocities agree, in the middle: in published tests 1.08, of six 1.5. A
step that is twice or half as long is beyond."""

OFFSET = 0.05
"""Mean of an accelerometer, as a share of the peak, from which on it is told, in the middle: of 490
published tests it is 0.008, of one 0.26."""

CUT = 0.6
"""Share of its peak at which a motion begins or ends that was cut, probably: the largest of 490
published records of tests is 0.58."""


def remarks(folder: Path, tests: Tests) -> Iterator[str]:
    """In what records and table differ more than is usual, in words."""
    yield from in_a_line(unread(folder, files_of(folder)))
    records, config = (folder / RECORDS).is_file(), tests.config
    if config.stepper if records else config.acceleration:
        name, count = ("stepper", "a") if records else ("acceleration", "no")
        yield f"{name} of {ASSUMED} left out, as there is {count} {RECORDS}"
    yield from _in_other_units(tests, records)
    if not records:
        return
    yield from others(folder, tests.config.acceleration)
    if late := left_out(folder, tests.config.acceleration):
        yield f"samples of {_some(late)} after the last that n_samples counts left out"
    ratios = peak_ratios(tests, found := motions_of(folder))
    for numbers in _alike(found):
        yield f"{_some(numbers)} are the same to the last digit: a record may stand twice"
    if cut := [number for number, motion in found.items() if _ends(motion) > CUT]:
        yield f"{_some(cut)} begin or end at more than {CUT:.0%} of their peak: they may be cut"
    if odd := [number for number, motion in found.items() if _disfigured(motion)]:
        yield f"{_some(odd)} may be sorted, or have lost order, minus signs or exponents"
    if far := [number for number, ratio in ratios.items() if not 1 / ALIKE <= ratio <= ALIKE]:
        yield f"peaks of {_some(far)} are not within a factor of {ALIKE:g} of pga_g"
    ratio = median(
        _peak_velocity(found[number]) / (in_si.acceleration(pga) * seconds)
        for number, pga, seconds in zip(tests.number, tests.pga, tests.pgv_pga, strict=True)
    )
    if not 1.0 / VELOCITIES <= ratio <= VELOCITIES:
        said = f"peak velocities of {RECORDS} are {ratio:.3g} times pga_g by pgv_pga_s (median)"
        yield f"{said}: its times or the table are wrong, or its accelerations drift"
    if (share := median(map(_offset, found.values()))) > OFFSET:
        said = f"accelerations of {RECORDS} have a mean of {share:.0%} of their peak (median)"
        yield f"{said}: an instrument's offset, which acts as a tilt"


def _in_other_units(tests: Tests, records: bool) -> Iterator[str]:
    """Columns of the table whose numbers are usual in another unit, in words."""
    yield from radians_of("azimuth_deg", tests.azimuth)
    if not records and (most := max(tests.pga)) > STRONG_PGA:
        yield f"pga_g of up to {most:.3g} g, and records rarely exceed {STRONG_PGA:g} g: m/s2?"
    if not records and (most := max(tests.pgv_pga)) > SLOW:
        yield f"pgv_pga_s of up to {most:.3g} s, and that of tests is below {SLOW:g} s: (m/s)/g?"


def sizes(scans: dict[int, trimesh.Trimesh]) -> Iterator[str]:
    """How large specimens are, by which a scan in another unit is seen, and what is odd of them."""
    for number, one in scans.items():
        yield f"specimen {number} is {' x '.join(f'{side:.3g}' for side in one.extents)} m"
        yield from (f"specimen {number}: {line}" for line in doubts(one))


def _some(numbers: list[int]) -> str:
    named = ", ".join(map(str, numbers[:3])) + (" and so on" if len(numbers) > 3 else "")
    return f"{counted(len(numbers), 'test')} of {RECORDS} ({named})"


def _alike(motions: dict[int, GroundMotion]) -> Iterator[list[int]]:
    """Numbers of tests that have the same record."""
    found: dict[str, list[int]] = {}
    for number, motion in motions.items():
        found.setdefault(identity(motion), []).append(number)
    return (numbers for numbers in found.values() if len(numbers) > 1)


def _ends(motion: GroundMotion) -> float:
    """Largest acceleration of the first and the last fiftieth between rests, over the peak."""
    largest = np.abs([one.acceleration for one in _horizontal(motion)]).max(axis=0)
    shaken = np.trim_zeros(largest)
    part = max(1, len(shaken) // 50)
    return float(max(shaken[:part].max(), shaken[-part:].max()) / shaken.max())


def _disfigured(motion: GroundMotion) -> bool:
    along = [one.acceleration for one in _horizontal(motion)]
    peak = np.abs(along).max()
    return any(any(order.doubts(one, "")) for one in along if np.ptp(one) > QUIET * peak)


def _peak_velocity(motion: GroundMotion) -> float:
    """Largest horizontal velocity [m/s], without the drift that an offset makes."""
    return max(float(np.abs(_undrifted(one.velocity)).max()) for one in _horizontal(motion))


def _offset(motion: GroundMotion) -> float:
    """Largest mean of the horizontal accelerations, as a share of their peak."""
    along = np.array([one.acceleration for one in _horizontal(motion)])
    return float(np.abs(along.mean(axis=1)).max() / np.abs(along).max())


def _undrifted(velocity: Array) -> Array:
    return velocity - np.linspace(0.0, velocity[-1], len(velocity))


def _horizontal(motion: GroundMotion) -> list[Trace]:
    match motion:
        case RecordedMotion(trace):
            return [trace]
        case ComponentMotion((x, y, _)):
            return [*_horizontal(x), *_horizontal(y)]
    raise TypeError(f"{type(motion).__name__} is no record")
