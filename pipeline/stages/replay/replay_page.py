"""The page that plays one run of a study, or two at the same times."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from pipeline.stages.mesh.products import RockData, TerrainData
from pipeline.stages.motions import motion_grid
from pipeline.stages.motions.motion_grid import Shaking
from pipeline.stages.replay.choice import NEIGHBOUR, Choice, chosen, neighbour, other
from pipeline.stages.replay.film import Played, film, named, played, scene, scripts
from pipeline.stages.runs.overturning_runs import grid_runs, kind, shared
from pipeline.stages.runs.runner import Kind, Run, run_missing, stored
from pipeline.stages.runs.scenes import Group, refuse_motions
from pipeline.stages.runs.study import Study
from pipeline.workflow import graph, keys, writers
from pipeline.workflow.graph import Identity
from pipeline.workflow.pages import filled
from pipeline.workflow.pages import source as text_of
from pipeline.workflow.registry import needs
from pipeline.workflow.stage import Job, Product, Work
from vsr_core.outcome import Outcome

PAGE, OWN_SCRIPTS = "replay.html", ("panels.js", "replay.js")

FOLDER = "replays"
"""Of the pages, in the folder of the site's products."""

LONGEST_NAME = 120
"""Letters of a file name; of a longer one a digest tells what is cut off."""

MOST_ROCK_FACES = 20_000


class Parts(NamedTuple):
    """What a page is made from."""

    study: Study
    rock: RockData
    terrain: TerrainData | None


def make(job: Job, given: Mapping[str, str | None], second: str | None) -> str:
    """A page that plays a run of a study; runs that it needs are done where they are not stored.

    Parameters
    ----------
    given : mapping, coordinates of the run as ``choice.chosen`` takes them
    second : str or None, the run beside it: ``neighbour``, or what is different
    """
    config, shaking = job.config, motion_grid.of_site(job.site)
    choices = [chosen(config, shaking, given)]
    beside_it = second is not None and second.strip() != NEIGHBOUR
    if beside_it:
        choices.append(other(config, shaking, choices[0], str(second)))
    own = graph.identities("runs", job.site)["runs"]
    for stage in needs("runs"):
        graph.make(stage, job)
    job.store.open()
    parts, work = graph.built(Parts, job), graph.work_of("replay", own.key, job)
    study = parts.study
    refuse_motions(study.scenes, study.yaw, study.motions, work.origin)
    if second is not None and not beside_it:
        group, pga = choices[0].group, study.motions.pga
        own_kind, wanted = grid_runs(study)
        rows = _done(work, own_kind, group, wanted(group), shared(study, parts.rock))
        codes = [code for row in rows for code in own_kind.outcomes(row[1:])]
        overturned = np.array([Outcome(code).overturned for code in codes])
        choices.append(neighbour(overturned.reshape(-1, len(pga)), pga, choices[0]))
    runs = [played(study, choice, _stored(work, study, choice)) for choice in choices]
    text = page(job.site.name, f"../{job.store.up}", parts, runs)
    slug = _slug(runs, study.motions)
    name = f"{FOLDER}/{slug}.html"
    facts = own.facts | {"inputs": {"choices": repr(choices)}}
    graph.keep(
        f"replay-{slug}", Identity(facts), Product({name: writers.text(text)}, name), job.store
    )
    return name


def _stored(work: Work, study: Study, choice: Choice) -> dict[str, Any] | None:
    """Results of a run of the study; None in another engine than the study's."""
    if choice.engine != study.settings.engine:
        return None
    runs = study.runs_of(choice.group, [choice.cell])
    own = kind(on_terrain=study.settings.on_terrain)
    (row,) = _done(work, own, choice.group, runs, study.shared)
    found: dict[str, Any] = row._asdict()
    return found


def _done(
    work: Work, own: Kind[Any], group: Group, runs: Iterable[Run], common: Callable[[Group], Any]
) -> list[Any]:
    """Rows of some runs of a group."""
    run_missing(work, own, [group], lambda _: runs, common)
    return [row for _, part in stored(work.runs, own, [group], lambda _: runs) for row in part]


def page(site: str, up: str, parts: Parts, runs: list[Played]) -> str:
    """The page of some runs.

    Returns
    -------
    str, HTML that holds all it needs
    """
    rock, settings, shaking = parts.rock.data, parts.study.settings, parts.study.motions
    terrain = None if parts.terrain is None else parts.terrain.data
    data = {
        "scene": scene(rock, terrain, runs, MOST_ROCK_FACES),
        "films": [film(run, shaking) for run in runs],
    }
    own_scripts = [text_of(name) for name in OWN_SCRIPTS]
    return filled(
        PAGE,
        {
            "site": site,
            "source": rock.attrs["shape_source"],
            "mass": float(rock.attrs["mass_kg"]),
            "on_terrain": settings.on_terrain,
            "driven": settings.drive == "servo",
            "runs": [_facts(run, shaking) for run in runs],
            "data": data,
            "scripts": [
                Markup(script)  # noqa: S704  (our own files)
                for script in (*scripts(), *own_scripts)
            ],
        },
        up,
    )


def _facts(run: Played, shaking: Shaking) -> dict[str, Any]:
    """Results of a run for the page."""
    choice, response = run.choice, run.replay.response
    record = shaking.dimension == "record"
    return {
        "name": named(choice, shaking),
        "yaw": choice.group.yaw,
        "friction": choice.group.friction,
        "pga": choice.cell.pga,
        "pgv_pga": shaking.pgv_pga[choice.cell.row],
        "record": str(shaking.rows[choice.cell.row]) if record else None,
        "engine": choice.engine,
        "own": run.own,
        "outcome": response.outcome.name.lower(),
        "how": response.decided_by.how,
        "simulated": response.steps > 0,
        "decided": run.replay.decided,
        "end": float(run.replay.time[-1]),
        "time_step": run.replay.time_step,
        "steps": response.steps,
        "peak_tilt": response.peak_tilt,
        "slip": response.slip,
    }


def _slug(runs: list[Played], shaking: Shaking) -> str:
    """File name of a page, without its suffix; another one for each choice."""
    first, *rest = (run.choice for run in runs)
    dimension = shaking.dimension.replace("_", " ")
    name = f"yaw {first.group.yaw:.12g} friction {first.group.friction:.12g} "
    name += f"{dimension} {_row(first.cell.row, shaking)} pga {first.cell.pga:.12g}"
    for choice in rest:
        name += " and" + f" {choice.engine}" * (choice.engine != first.engine)
        if choice.group != first.group:
            name += f" yaw {choice.group.yaw:.12g} friction {choice.group.friction:.12g}"
        if choice.cell.row != first.cell.row:
            name += f" {dimension} {_row(choice.cell.row, shaking)}"
        if choice.cell.pga != first.cell.pga:
            name += f" pga {choice.cell.pga:.12g}"
    slug = re.sub(r"[^A-Za-z0-9._]+", "-", name).strip("-.")
    if len(slug) <= LONGEST_NAME and slug.replace("-", " ") == name:
        return slug
    return f"{slug[:LONGEST_NAME]}-{keys.digest(name)[:8]}"


def _row(row: int, shaking: Shaking) -> str:
    value = shaking.rows[row]
    return value if isinstance(value, str) else f"{value:.12g}"
