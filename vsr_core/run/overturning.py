"""Runs on a flat pedestal, up to their outcomes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vsr_core.arrays import Array
from vsr_core.engines import nonsmooth
from vsr_core.engines.nonsmooth import pedestal_runs
from vsr_core.engines.nonsmooth.pedestal_runs import Shaking
from vsr_core.judge import on_pedestal
from vsr_core.judge.record import GOES_ON, Criteria, rests
from vsr_core.motions.ground_motion import GroundMotion
from vsr_core.outcome import DecidedBy, Outcome, Response
from vsr_core.run import loop
from vsr_core.run.cases import Case, Settings, never_starts
from vsr_core.run.loop import LEAD, Run, at_halved_steps, first_push
from vsr_core.run.sampling import MOST_SUBSTEPS, first_step, samples, sampling
from vsr_core.run.static_limits import as_it_stands
from vsr_core.scene import Scene

COMPILED = "nonsmooth"
"""The engine whose runs are compiled as a whole, and done many at a time."""

STATIC_SHARE = 0.95
"""Share of the static limits that is used once the rock has moved."""

_RULES = tuple(DecidedBy)


def simulate(case: Case, motion: GroundMotion, settings: Settings) -> Response:
    """Outcome of one run on a flat pedestal.

    Never raises for physics: a run that breaks its guards at every step tried is ``UNSTABLE``.
    Steps are as fine as the motion needs; ``input_checks.check`` says if they are too coarse for
    the rock.

    Parameters
    ----------
    case : Case, from ``prepare`` with the same ``reduce`` as in ``settings``
    """
    return simulate_all(case, [motion], settings)[0]


def simulate_all(case: Case, motions: Sequence[GroundMotion], settings: Settings) -> list[Response]:
    """Outcomes of runs on a flat pedestal."""
    still = [_never_starts(case, motion, settings) for motion in motions]
    shaken = [motion for motion, stays in zip(motions, still, strict=True) if not stays]
    if settings.engine == COMPILED:
        found = iter(_all_compiled(case, shaken, settings))
    else:
        found = (_stepped(case, motion, settings) for motion in shaken)
    stands = Response(Outcome.BALANCED, DecidedBy.NO_UPLIFT_BOUND, 0.0, 0.0, 0.0, 0)
    return [stands if stays else next(found) for stays in still]


def _never_starts(case: Case, motion: GroundMotion, settings: Settings) -> bool:
    limits, peak = case.static_limits, motion.peak_acceleration
    return motion.columns == 1 and never_starts(limits, peak, settings)


def _criteria(
    case: Case, scene: Scene, settings: Settings, *, turns: bool, along_x: bool
) -> Criteria:
    """What a run is judged by.

    The proofs assume the prescribed motion, which a servo's table does not quite follow, and
    gravity along z, which a table that turns has not; and they know of no energy in springs.
    """
    proves = settings.reduce and scene.contact.stiffness is None and scene.drive is None
    return on_pedestal.criteria(
        scene.rock,
        scene.contact,
        case.limits,
        proves=proves and not turns,
        slides=case.slides and along_x,
        whole=settings.whole,
    )


def _limits(case: Case, motion: GroundMotion) -> tuple[float, float]:
    """Lowest and highest acceleration along x that move nothing [m/s^2]; zeros if not known."""
    return case.static_limits if motion.columns == 1 else (0.0, 0.0)


def _all_compiled(
    case: Case, motions: Sequence[GroundMotion], settings: Settings
) -> list[Response]:
    """Runs in compiled code, those that break their guards again at half the step."""
    found: dict[int, Response] = {}
    steps = {n: first_step(motion, None, settings.time_step) for n, motion in enumerate(motions)}
    for _ in range(loop.HALVINGS + 1):
        if not steps:
            break
        runs = _compiled(case, [motions[n] for n in steps], list(steps.values()), settings)
        found.update(zip(steps, runs, strict=True))
        steps = {n: 0.5 * h for n, h in steps.items() if found[n].outcome is Outcome.UNSTABLE}
    return [found[n] for n in range(len(motions))]


def _compiled(
    case: Case, motions: Sequence[GroundMotion], steps: Sequence[float], settings: Settings
) -> list[Response]:
    """Runs at given time steps [s], each the longest allowed."""
    scene, radius = case.full, case.full.rock.radius
    wait = on_pedestal.longest_wait(radius)
    taken = [sampling(motion, None, most, 1) for motion, most in zip(motions, steps, strict=True)]
    columns = 9 if any(motion.columns == 9 for motion in motions) else 3
    values = [
        in_columns(samples(m, None, s.interval, s.pulse_samples), columns)
        for m, s in zip(motions, taken, strict=True)
    ]
    shaking = Shaking(
        np.concatenate(values),
        np.cumsum([0, *(len(v) for v in values)]),
        np.array([s.interval for s in taken]),
        np.array([on_pedestal.monitored(s.interval, radius) for s in taken]),
        np.array([s.pulse_samples + math.ceil(wait / s.interval) for s in taken]),
        np.array([_limits(case, motion) for motion in motions]),
    )
    along_x = all(motion.columns == 1 for motion in motions)
    criteria = _criteria(case, scene, settings, turns=columns == 9, along_x=along_x)
    solver = settings.solver or nonsmooth.SOLVER
    decided, measured = pedestal_runs.run_all(scene, criteria, shaking, solver)
    return [
        Response(Outcome(o), _RULES[d], peak, tilt, slip, n)
        for (o, d, n), (peak, tilt, slip) in zip(decided.tolist(), measured.tolist(), strict=True)
    ]


def in_columns(values: Array, columns: int) -> Array:
    """Samples along x, y and z, and of a table that turns six more, of those of any motion.

    Parameters
    ----------
    values : ndarray, shape (n,) or (n, k)

    Returns
    -------
    ndarray, shape (n, columns)
    """
    whole = np.zeros((len(values), columns))
    given = values.reshape(len(values), -1)[:, :columns]
    whole[:, : given.shape[1]] = given
    return whole


def _stepped(case: Case, motion: GroundMotion, settings: Settings) -> Response:
    """A run in an engine whose steps are asked for one by one."""
    simulated = case.scene

    def once(time_step: float) -> Response:
        return complete(set_up(case, simulated, motion, settings, time_step), case)

    def attempt(time_step: float) -> Response:
        nonlocal simulated
        response = once(time_step)
        if response.peak_tilt > simulated.kept_tilt:
            simulated = case.full
            response = once(time_step)
        return response

    step = first_step(motion, simulated.drive, settings.time_step)
    return at_halved_steps(step, attempt, lambda found: found.outcome is Outcome.UNSTABLE)


def set_up(
    case: Case, scene: Scene, motion: GroundMotion, settings: Settings, time_step: float
) -> Run:
    """A run before its first step.

    Parameters
    ----------
    scene : Scene of the case, the one simulated or the full one
    time_step : float [s], of this attempt
    """
    # Where the table turns, what the rock feels depends on its state in every step; and our own
    # engine takes a sample in each, as where it is compiled as a whole.
    turns, radius = motion.columns == 9, scene.rock.radius
    most = 1 if turns or settings.engine == COMPILED else MOST_SUBSTEPS
    sampled = sampling(motion, scene.drive, time_step, most)
    return loop.set_up(
        scene,
        motion,
        settings,
        sampled,
        _criteria(case, scene, settings, turns=turns, along_x=motion.columns == 1),
        monitored=on_pedestal.monitored(sampled.interval, radius),
        wait=on_pedestal.longest_wait(radius),
    )


def first_sample(run: Run, case: Case) -> int:
    """Sample that can move the rock first; -1 for one that is on the move from its start."""
    ahead = run.values[: run.sampled.pulse_samples]
    return -1 if run.scene.start is not None else first_push(ahead, _limits(case, run.motion))


def complete(run: Run, case: Case) -> Response:
    """Step a run to its end, from the first push on: until then nothing moves the rock."""
    record, criteria = run.record, run.criteria
    first = first_sample(run, case)
    outcome, by = _judge(run, first)
    if criteria.proves:
        run.skip(max(0, first))
    while outcome == GOES_ON and run.sample < run.last_sample:
        run.step()
        outcome, by = _judge(run, first)
        if record.peak_tilt > run.scene.kept_tilt:
            break
        if outcome == GOES_ON and criteria.proves and run.values.ndim == 1 and run.shaken:
            _pass_over_rest(run)
    if outcome == GOES_ON:
        outcome, by = on_pedestal.out_of_time(record, criteria), DecidedBy.SIMULATION
    measured = float(record.peak_tilt), float(record.tilt), float(record.peak_slip)
    return Response(Outcome(outcome), _RULES[by], *measured, run.steps)


def _judge(run: Run, first: int) -> tuple[int, int]:
    impulse, pulse = run.impulse, run.sampled.pulse_samples
    remaining = max(0.0, float(run.impulses[pulse]) - impulse)
    moved = first < min(run.sample, pulse)
    return on_pedestal.judge(
        run.record, run.criteria, run.time, impulse, remaining, moved, run.shaken
    )


def _pass_over_rest(run: Run) -> None:
    """Go on at the next push if the rock rests: until then nothing moves it."""
    record, criteria = run.record, run.criteria
    if record.rest_since < 0.0 or record.tilt > criteria.limits.toppled_tilt:
        return
    if not rests(record, criteria, run.time):
        return
    lowest, highest = as_it_stands(run.scene.rock, run.scene.contact, record.rotation)
    ahead = run.values[run.sample : run.sampled.pulse_samples]
    push = first_push(ahead, (STATIC_SHARE * lowest, STATIC_SHARE * highest))
    run.skip(max(0, push - LEAD))
