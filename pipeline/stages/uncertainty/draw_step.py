"""The time step of draws, and to which width their boundaries are sensibly known.

The step of a site is measured on its rock as scanned. An error of the scan gives a flat base bumps,
and on these a longer step moves the boundary more. So some levels of a few draws are run at this
step and finer ones, around a change of outcome, by the rule of ``vsr_core.uncertainty.step_error``.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.uncertainty.draw_runs import Runner, Search
from pipeline.workflow.grammar import counted
from pipeline.workflow.run_store import RunStore
from vsr_core.arrays import Array, Indices
from vsr_core.fragility.bisection import first_changes, middles
from vsr_core.uncertainty import search, step_error
from vsr_core.uncertainty.step_error import AROUND, REFERENCE, SPACING, StepErrors


@dataclass(frozen=True, eq=False)
class DrawStep:
    """A time step for all draws, and what was measured for it.

    Attributes
    ----------
    tried : ndarray, shape (steps,) [s], falling
    at : int, number of the one that is taken
    tolerance : float, of the shift; infinite for a step that was given
    """

    tried: Array
    errors: StepErrors
    at: int
    tolerance: float

    @property
    def time_step(self) -> float:
        """The step that is taken [s]."""
        return float(self.tried[self.at])

    @property
    def within(self) -> bool:
        """Whether its shift was measured and is within the tolerance."""
        return bool(abs(self.errors.shift[self.at]) <= self.tolerance)


def measured(wanted: Search, time_step: float | Literal["auto"], tolerance: float) -> DrawStep:
    """Measure steps from that of the site on, and take the coarsest within the tolerance.

    Parameters
    ----------
    wanted : Search, at the site's own step
    time_step : float [s], the only one that is tried; or auto
    """
    few = replace(wanted, draws=wanted.draws[: step_error.FEW])
    shares, own = step_error.shares(chosen=time_step == "auto"), wanted.settings.time_step
    draw, yaw, row = step_error.levels(len(few.draws), *wanted.boundary.shape)
    what = f"{counted(len(draw), 'boundary', 'boundaries')} of {counted(len(few.draws), 'draw')}"
    wanted.work.log(f"uncertainty: measuring {what} at {counted(len(shares) + 1, 'time step')}")
    with closing(RunStore(wanted.work.runs, wanted.kind.row)) as store:
        known, centre = _centres(few, store, draw, yaw, row)
        draw, yaw, row = (np.repeat(part[known], len(AROUND)) for part in (draw, yaw, row))
        # not all in step with their boundaries, so that the mean is known to less than a spacing
        aside = SPACING * (step_error.evenly(len(centre)) - 0.5)
        peaks = search.rounded(np.exp((np.log(centre) + aside)[:, None] + AROUND), SPACING)
        sides = []
        for share in (*shares, REFERENCE):
            at_step = replace(few, settings=replace(few.settings, time_step=share * own))
            runs = Runner(at_step, store, few.draws).run(draw, yaw, row, peaks.ravel())
            sides.append(runs.reshape(peaks.shape))
    errors = step_error.measured(np.array(sides))
    limit = tolerance if time_step == "auto" else np.inf
    return DrawStep(own * np.array(shares), errors, errors.coarsest(limit), limit)


def _centres(
    few: Search, store: RunStore[Any], draw: Indices, yaw: Indices, row: Indices
) -> tuple[Indices, Array]:
    """Which of some levels have a change of outcome, and at which PGA [g]."""
    scales, site = np.array([one.scales() for one in few.draws]), few.ln(few.boundary)
    gain = np.log([one.member.amplitude for one in few.draws])[:, None, None]
    expected = search.from_others(site[None], few.given[None], scales) - gain
    scale = np.full(len(draw), search.UNSURE[0])
    runner = Runner(few, store, few.draws)
    found = runner.bracketed(draw, yaw, row, expected[draw, yaw, row], scale)
    lower, upper = first_changes(found, len(draw))
    known = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    return known, middles(lower, upper)[known]


def resolution(
    asked: float | Literal["auto"], usual: float, step: DrawStep, origin: Origin
) -> float:
    """Relative width of a draw's bracket.

    Parameters
    ----------
    usual : float, where none is asked for, unless error and islands together are wider

    Raises
    ------
    InputError
        For one asked for that is finer than the numerical error of a draw's boundary.
    """
    error, islands = (float(part[step.at]) for part in (step.errors.kept, step.errors.islands))
    if asked == "auto":
        return float(np.fmax(usual, error + islands))
    if error > asked:
        raise InputError(_refused(asked, step, error, origin))
    return asked


def _refused(asked: float, step: DrawStep, error: float, origin: Origin) -> Problem:
    key = "uncertainty.resolution"
    rule = (
        f"an interval is no narrower than the numerical error of a draw's boundary, {error:.3g} "
        f"at a time step of {1e3 * step.time_step:.3g} ms"
    )
    remedy = f"leave it to auto, or give {error:.2g} or more"
    finer = step.tried[step.errors.kept <= asked]
    if len(finer):
        remedy = f"set simulation.time_step={finer.max():.3g}, or leave it to auto"
    return Problem(origin.file_of(key), key, f"{asked:g}", rule, remedy)
