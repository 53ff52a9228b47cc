"""Runs on a flat pedestal, up to their outcomes."""

from __future__ import annotations

from collections.abc import Sequence

from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import DecidedBy, Outcome, Response
from vsr_core.run import compiled_runs, loop
from vsr_core.run.cases import Case, Settings, never_starts
from vsr_core.run.guards import at_halved_steps
from vsr_core.run.overturning_rules import OverturningRules, set_up
from vsr_core.run.sampling import first_step

COMPILED = "nonsmooth"
"""The engine whose runs are compiled as a whole, and done many at a time."""


def simulate(case: Case, motion: GroundMotion, settings: Settings) -> Response:
    """Outcome of one run on a flat pedestal.

    Never raises for physics: a run that breaks its guards at every step tried is ``UNSTABLE``.
    Steps are as fine as the motion needs; ``input_checks.check`` says if they are too coarse for
    the rock.

    Parameters
    ----------
    case : Case, from ``prepare`` with the same ``reduce`` as in ``settings``
    motion : GroundMotion
    """
    return simulate_all(case, [motion], settings)[0]


def simulate_all(case: Case, motions: Sequence[GroundMotion], settings: Settings) -> list[Response]:
    """Outcomes of runs on a flat pedestal."""
    still = [_never_starts(case, motion, settings) for motion in motions]
    shaken = [motion for motion, stays in zip(motions, still, strict=True) if not stays]
    if settings.engine == COMPILED:
        found = iter(compiled_runs.simulate(case, shaken, settings) if shaken else [])
    else:
        found = (_one(case, motion, settings) for motion in shaken)
    stands = Response(Outcome.BALANCED, DecidedBy.NO_UPLIFT_BOUND, 0.0, 0.0, 0.0, 0)
    return [stands if stays else next(found) for stays in still]


def _never_starts(case: Case, motion: GroundMotion, settings: Settings) -> bool:
    return motion.columns == 1 and never_starts(
        case.static_limits, motion.peak_acceleration, settings
    )


def _one(case: Case, motion: GroundMotion, settings: Settings) -> Response:
    simulated = case.scene

    def once(time_step: float) -> Response:
        run = set_up(simulated, motion, settings, time_step)
        ending = loop.complete(run, OverturningRules(case, simulated, run, reduce=settings.reduce))
        return Response(*ending, run.peak_tilt, run.tilt, run.slip, run.steps)

    def attempt(time_step: float) -> Response:
        nonlocal simulated
        response = once(time_step)
        if response.peak_tilt > simulated.kept_tilt:
            simulated = case.full
            response = once(time_step)
        return response

    step = first_step(motion, simulated.drive, settings.time_step)
    return at_halved_steps(step, attempt, lambda found: found.outcome is Outcome.UNSTABLE)
