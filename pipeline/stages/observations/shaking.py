"""How likely draws of a rock stand or topple in motions that were observed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from scipy.stats import norm, qmc

from pipeline.config import in_si
from pipeline.config.layers import Origin
from pipeline.config.observation_schema import Earthquake, Observations, ShakeTest
from pipeline.config.paths import located, shown
from pipeline.config.problems import InputError, Problem
from pipeline.config.sections import LARGEST_PGA, LONGEST_PULSE, SHORTEST_PULSE, SMALLEST_PGA, Key
from pipeline.stages.motions.record_inputs import LARGEST_FILE, check_file
from pipeline.stages.runs.scenes import Group, flat_case, terrain_case
from pipeline.stages.uncertainty.draws import Draw
from pipeline.workflow.keys import content_of, digest_file
from pipeline.workflow.stage import FilesInput
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.motions.pulses import CosinePulse
from vsr_core.motions.records import formats
from vsr_core.motions.records.directions import check_directions
from vsr_core.motions.records.doubts import doubts
from vsr_core.motions.records.record import Record, check_end, repaired
from vsr_core.motions.records.trace import RecordedMotion, Trace
from vsr_core.run.cases import Settings
from vsr_core.run.displacement import displace
from vsr_core.run.overturning import simulate_all
from vsr_core.validation.conditioning import MISFIT

SAMPLES = 8
"""Directions of an earthquake, and pairs of PGA and PGV of each."""

NONE_STANDS = -20.0
"""Logarithm of the likelihood of a survived earthquake in which a draw topples in all samples."""


@dataclass(frozen=True)
class ShakenBy(FilesInput):
    """Motions of tests in which the rock was shaken, by the number of the observation.

    Attributes
    ----------
    file : str, where they are named
    before : dict, digests of the files when they were found
    """

    tests: tuple[tuple[int, Path, ShakeTest], ...]
    file: str
    before: dict[str, str]

    def files_read(self) -> tuple[Path, ...]:
        return tuple(path for _, path, _ in self.tests)

    def digests(self) -> dict[str, str]:
        return _digests(self.tests)

    def read(self, log: Callable[[str], None]) -> dict[int, str]:
        """Refuse motions that cannot be read, and tell what was repaired or is in doubt.

        Returns
        -------
        dict, the same in one line, by the number of the observation
        """
        told = {}
        for number, path, _ in self.tests:
            record = self._record(number)
            lines = (*record.repairs, *doubts({"x": record}))
            for line in lines:
                log(f"observations: {shown(path)}: {line}")
            told[number] = "; ".join(lines)
        return told

    def motion(self, number: int) -> GroundMotion:
        """The motion of a test, its acceleration as it was recorded."""
        record = self._record(number)
        return RecordedMotion(Trace(record.acceleration, record.interval))

    def _record(self, number: int) -> Record:
        """That of a test; InputError for a file that holds none."""
        (found,) = [one for one in self.tests if one[0] == number]
        _, path, test = found
        try:
            reading = formats.Reading(test.component, test.unit, None, None)
            content = content_of(path, self.before[_name(number, path)], LARGEST_FILE)
            every = formats.read_all(content, path.suffix, reading)
            record = repaired(every.channel(test.component))
            check_directions({"x": record})
            told = check_end(Trace(record.acceleration, record.interval))
        except InvalidInput as error:
            given = f"{shown(path)}, {error.given}"
            problem = Problem(self.file, key_of(number), given, error.rule, error.remedy)
            raise InputError(problem) from None
        return replace(record, repairs=(*record.repairs, *told))


def _digests(tests: Iterable[tuple[int, Path, ShakeTest]]) -> dict[str, str]:
    """Digests of motions, by their names and the observations that they are of."""
    return {_name(number, path): digest_file(path) for number, path, _ in tests}


def _name(number: int, path: Path) -> str:
    return f"{path.name} (observation {number + 1})"


def key_of(number: int) -> str:
    """Key of an observation's motion."""
    return f"observations.{number}.motion"


def find(
    observations: Annotated[Observations, Key("observations")], origin: Origin
) -> ShakenBy | None:
    """The files of motions that observations name."""
    folder, file = origin.folder_of("observations"), origin.file_of("observations")
    tests = tuple(
        (number, located(folder, one.motion, file, key_of(number)), one)
        for number, one in enumerate(observations)
        if isinstance(one, ShakeTest)
    )
    for number, path, _ in tests:
        try:
            check_file(path)
        except InvalidInput as error:
            given = f"{shown(path)}, {error.given}"
            problem = Problem(file, key_of(number), given, error.rule, error.remedy)
            raise InputError(problem) from None
    return ShakenBy(tests, file, _digests(tests)) if tests else None


def of_shake(
    draws: Sequence[Draw], test: ShakeTest, motion: GroundMotion, settings: Settings
) -> tuple[Array, Array]:
    """Logarithm of the likelihood of a test, and whether draws stand, shape (draws,).

    One that ends as it did for a draw has 1 - ``MISFIT``, and ``MISFIT`` where it ends otherwise;
    an unresolved run has one half.
    """
    stood = np.array([_standing(draw, -test.direction, [motion], settings)[0] for draw in draws])
    agrees = np.abs(stood - float(test.outcome == "toppled"))
    return np.log(MISFIT + (1.0 - 2.0 * MISFIT) * agrees), stood


def of_earthquake(
    draws: Sequence[Draw], earthquake: Earthquake, settings: Settings
) -> tuple[Array, Array]:
    """Logarithm of the likelihood that draws stand, and their share of standing, shape (draws,).

    Pulses of PGA and PGV from their joint lognormal distribution, from all directions alike.
    """
    ways, motions = _pulses(earthquake)
    share = np.array(
        [
            np.mean([_standing(draw, yaw, motions, settings) for yaw in ways.tolist()])
            for draw in draws
        ]
    )
    known = np.log(np.where(share > 0.0, share, 1.0))
    return np.where(share > 0.0, known, NONE_STANDS), share


def _pulses(earthquake: Earthquake) -> tuple[Array, list[GroundMotion]]:
    """Directions [degree], and motions from each."""
    ways = np.arange(SAMPLES) * 360.0 / SAMPLES
    first, second = norm.ppf(qmc.Sobol(2, rng=3).random(SAMPLES).T)
    rho = earthquake.correlation
    ln_pga = math.log(earthquake.pga) + earthquake.pga_log_sd * first
    mixed = rho * first + math.sqrt(1.0 - rho**2) * second
    ln_pgv = math.log(0.01 * earthquake.pgv) + earthquake.pgv_log_sd * mixed
    pga = np.clip(np.exp(ln_pga), SMALLEST_PGA, LARGEST_PGA)
    ratios = np.clip(np.exp(ln_pgv) / in_si.acceleration(pga), SHORTEST_PULSE, LONGEST_PULSE)
    return ways, [
        CosinePulse.from_g(one, ratio)
        for one, ratio in zip(pga.tolist(), ratios.tolist(), strict=True)
    ]


def _standing(
    draw: Draw, yaw: float, motions: Sequence[GroundMotion], settings: Settings
) -> list[float]:
    """Whether a draw stands in some motions along one way; half where a run is unresolved.

    Nothing is left out of runs on a flat pedestal: what proves it costs more for a rock than they.

    Parameters
    ----------
    yaw : float [degree], which turns the way to +x
    """
    group = Group(yaw, draw.member.friction)
    if draw.seat:
        case = terrain_case(draw.identified, group)
        found = [displace(case, one, settings, follow=False).response for one in motions]
    else:
        simulation = draw.settings.simulation.model_copy(update={"reduce": False})
        scenes = replace(draw.identified, settings=draw.settings._replace(simulation=simulation))
        whole = replace(settings, reduce=False)
        found = simulate_all(flat_case(scenes, group), motions, whole)
    sides = [response.outcome.overturned for response in found]
    return [0.5 if side < 0 else 1.0 - side for side in sides]
