"""A sample of a study repeated in Bullet, or in MuJoCo where Bullet is not installed.

Neither shares code with the default engine.

Half of the sample stands next to the boundary, where the errors of both decide; the other half is
spread over the grid, where they should not. Restitution is Newton's there, the only law of both.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
import xarray as xr

from pipeline.config.sections import Key
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Cell, Shaking
from pipeline.stages.runs.scenes import Group, flat_case, terrain_case
from pipeline.stages.runs.study import Study
from pipeline.workflow.datasets import Stored, described, netcdf
from pipeline.workflow.grammar import counted, form
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.workers import Batch
from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput
from vsr_core.run.cases import Case, Settings, TerrainCase
from vsr_core.run.displacement import respond
from vsr_core.run.input_checks import check_engine, longest_step
from vsr_core.run.overturning import simulate

HALF = 50
"""Runs next to the boundary, and as many elsewhere."""

SECOND_ERROR = 0.01
"""Relative error of a boundary by Bullet or MuJoCo at its usual step, on most scenes."""

NAMES = {"bullet": "Bullet", "mujoco": "MuJoCo"}


class BulletSample(Stored):
    """The sample, and how its runs ended in both engines."""

    FILE = "bullet_sample.nc"


class Sample(NamedTuple):
    """Runs of a study, and whether each is next to the boundary.

    Attributes
    ----------
    places : ndarray of int, shape (n, dimensions), in its grid
    near : ndarray of bool, shape (n,)
    """

    places: Indices
    near: Array


def make(
    work: Work, study: Study, responses: Responses, engine: Annotated[str, Key("second_engine")]
) -> Product:
    """Repeat the sample."""
    own = responses.data["overturned"].values
    held = np.array([_holds(study, group, engine) for group in study.groups])
    sample = chosen(np.where(held[:, None], own.reshape(len(held), -1), -1).reshape(own.shape))
    at = [tuple(int(i) for i in place) for place in sample.places]
    frictions, pga = own.shape[1], study.motions.pga
    places = [(study.groups[i * frictions + k], Cell(row, pga[c])) for i, k, row, c in at]
    found = _repeated(work, study, places, engine)
    groups, cells = zip(*places, strict=True) if places else ((), ())
    peaks = np.array([cell.pga for cell in cells])
    dataset = xr.Dataset(
        {
            "overturned": ("sample", own[tuple(sample.places.T)].astype("i1")),
            "overturned_in_other_engine": ("sample", np.array(found, dtype="i1")),
            "next_to_boundary": ("sample", sample.near.astype("i1")),
            "explained": ("sample", _explained(study, responses.data, groups, peaks, sample.near)),
        },
        {
            "yaw": ("sample", [group.yaw for group in groups]),
            "friction": ("sample", [group.friction for group in groups]),
            "row": ("sample", [str(study.motions.rows[cell.row]) for cell in cells]),
            "pga": ("sample", peaks),
        },
    )
    same = int((dataset["overturned"] == dataset["overturned_in_other_engine"]).sum())
    name = dataset.attrs["other_engine"] = NAMES[engine]
    agreed = f"{same} of {counted(len(at), 'run')} {form(same, 'ends', 'end')} in {name} as here"
    note = f"{agreed}; next to the boundary: {int(sample.near.sum())}"
    other = len(at) - same
    warning = (
        f"{other} of {counted(len(at), 'run')} {form(other, 'ends', 'end')} otherwise in {name}, "
        "which the numerical errors do not explain altogether; report.html says what to do"
    ) * beyond_errors(dataset)
    files = {BulletSample.FILE: netcdf(described(dataset, work, f"Sample in {name}"))}
    return Product(files, note, warning=warning)


def beyond_errors(sample: xr.Dataset) -> bool:
    """Whether the engines differ by what the errors of both boundaries do not explain.

    Any run that differs away from the boundary is one; next to it two standard deviations of the
    count are allowed, and one run.
    """
    near = sample["next_to_boundary"].values == 1
    differs = sample["overturned"].values != sample["overturned_in_other_engine"].values
    expected = float(sample["explained"].sum(skipna=False))
    return bool((differs & ~near).any()) or bool(differs.sum() > expected + 2 * expected**0.5 + 1)


def chosen(overturned: Array, half: int = HALF) -> Sample:
    """Choose the runs of a sample, the same for the same outcomes.

    Parameters
    ----------
    overturned : ndarray of int, shape (..., pga), -1 unresolved

    Examples
    --------
    >>> places, near = chosen(np.array([[0, 0, 1, 1, 1, 1]]), 2)
    >>> places[:, 1].tolist(), near.tolist()
    ([1, 2, 0, 5], [True, True, False, False])
    """
    known = overturned >= 0
    differs = (overturned[..., 1:] != overturned[..., :-1]) & known[..., 1:] & known[..., :-1]
    near = np.zeros(overturned.shape, dtype=bool)
    near[..., 1:] |= differs
    near[..., :-1] |= differs
    picked = [_spread(mask, half) for mask in (near, known & ~near)]
    flags = np.repeat([True, False], [len(part) for part in picked])
    return Sample(np.concatenate(picked), flags)


def _spread(mask: Mask, number: int) -> Indices:
    """Evenly spread choice of the true places, ends included; their numbers are never all held."""
    rows = mask.reshape(-1, mask.shape[-1])
    until = rows.sum(axis=1).cumsum()
    count = int(until[-1])
    wanted = np.round(np.linspace(0, count - 1, min(count, number))).astype(int)
    at = np.searchsorted(until, wanted, side="right")
    before = np.append(0, until)[at]
    columns = [np.flatnonzero(rows[row])[n] for row, n in zip(at, wanted - before, strict=True)]
    places = (*np.unravel_index(at, mask.shape[:-1]), np.array(columns, dtype=int))
    return np.stack(places, axis=-1)


def repeat(
    shared: tuple[Case | TerrainCase, Settings, Shaking], cells: tuple[Cell, ...]
) -> list[int]:
    """Outcomes of some cells in the other engine, on a worker."""
    place, settings, motions = shared
    run: Any = simulate if isinstance(place, Case) else respond
    return [run(place, motions.motion(cell), settings).outcome.overturned for cell in cells]


def _holds(study: Study, group: Group, engine: str) -> bool:
    """Whether an engine can represent a scene, as Bullet does all."""
    if engine == "bullet":
        return True
    try:
        scene = flat_case(study.scenes, group).full
        for motion in motion_grid.strongest(study.motions):
            check_engine(scene, engine, motion)
    except InvalidInput:
        return False
    return True


def _repeated(work: Work, study: Study, places: list[tuple[Group, Cell]], engine: str) -> list[int]:
    scenes, settings = study.scenes.with_contact(restitution_law="newton"), study.settings

    def shared(group: Group) -> tuple[Case | TerrainCase, Settings, Shaking]:
        flat = flat_case(scenes, group)
        case = terrain_case(scenes, group) if settings.on_terrain else flat
        step = longest_step(flat.full, engine)
        return case, Settings(step, settings.simulation.reduce, engine), study.motions

    batches = (Batch(group, (cell,)) for group, cell in places)
    long_runs = settings.on_terrain or study.motions.dimension == "record"
    cluster = work.cluster if long_runs else work.cluster.in_process()
    with Steps(work.stage, work.log) as steps:
        steps.tell(f"repeating {counted(len(places), 'run')} in {engine}")
        results = cluster.each(repeat, batches, shared)
        found = {(group, cell): result for group, cell, result in results}
    return [-1 if found[place] is None else found[place] for place in places]


def _explained(
    study: Study, responses: xr.Dataset, groups: tuple[Group, ...], pga: Array, near: Array
) -> Array:
    """Probability by which the errors of both boundaries make each run differ, shape (n,).

    A boundary lies somewhere in its interval of the grid, so that a run at one of its ends differs
    as often as the errors are a share of that interval, the narrower of the two beside the run; nan
    where the own one was not measured.
    """
    errors = responses["boundary_error"].values
    frictions = study.settings.contact.friction
    own = np.array([errors[frictions.index(group.friction)] for group in groups])
    levels = np.array(study.motions.pga)
    ends = np.concatenate([[-np.inf], levels, [np.inf]])
    at = np.abs(levels - pga[:, None]).argmin(axis=1) + 1
    spacing = np.minimum(ends[at + 1] - ends[at], ends[at] - ends[at - 1])
    share = (own + SECOND_ERROR) * pga / spacing
    return np.where(near, np.minimum(share, 1.0), 0.0)
