"""Report: one page that holds all its pictures, from the products of a site."""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path
from typing import Any

import yaml
from markupsafe import Markup

from pipeline.config.layers import SITES, Site, known, load_site
from pipeline.config.motion_schema import RecordConfig, TableMotionConfig
from pipeline.config.problems import InputError
from pipeline.config.schema import Config
from pipeline.config.sections import Range
from pipeline.drawing.style import png_uri, svg_uri
from pipeline.stages.datasets.bullet_sample import FILE as SAMPLE
from pipeline.stages.datasets.responses import FILE as RESPONSES
from pipeline.stages.fragility.fragility_figures import (
    axes_of,
    cells_of,
    fragility_by_yaw,
    overturning_diagram,
)
from pipeline.stages.fragility.products import FILE as FRAGILITY
from pipeline.stages.fragility.products import TABLE
from pipeline.stages.fragility.rock_views import rock_views
from pipeline.stages.fragility.summary import groups, long_rows_in_words, time_steps
from pipeline.stages.mesh.products import ROCK as ROCK
from pipeline.stages.motions.motion_grid import FILE as MOTIONS
from pipeline.stages.motions.record_figure import record_figure
from pipeline.stages.replay import film
from pipeline.stages.reports import report_tables, teaching_runs
from pipeline.stages.runs.step_choice import FILE as TIME_STEP
from pipeline.workflow import pages, writers
from pipeline.workflow.datasets import read
from pipeline.workflow.grammar import counted
from pipeline.workflow.stage import Job, Product

FILE = "report.html"

GAINS = Path(__file__).with_name("reduction_gains.yaml")
"""CPU time without a reduction over that with it, on the surrogate of Double Rock, by the
reduction's name; `python -m benchmarks.reductions` measures it."""

_MOST_LISTED = 500
"""Unresolved runs that are listed one by one."""

_MOST_DRAWN = 12
"""Records that are drawn; the others are in the table."""

_MANY = 4
"""Evenly spaced values beyond this number are shown as a range."""

_PAPER = (
    "Chen, Z., Arrowsmith, R., Das, J., Wittich, C., Madugo, C. & Kottke, A. (2024). Virtual Shake "
    "Robot: Simulating Dynamics of Precariously Balanced Rocks for Overturning and "
    "Large-displacement Processes. Seismica 3(1). doi:10.26443/seismica.v3i1.692"
)


def make(job: Job) -> Product:
    """Draw the figures and fill in the page."""
    rock, responses, fragility = (read(job.path(name)) for name in (ROCK, RESPONSES, FRAGILITY))
    facts = _facts(job, rock, responses, fragility)
    text = pages.filled(FILE, facts | {"up": job.store.up})
    lost = facts["unresolved"]["total"]
    verdict = f"{counted(lost, 'run')} UNRESOLVED" if lost else "all runs are resolved"
    note = f"{len(text) / 1e6:.2f} MB, diagrams: {len(facts['diagrams'])}; {verdict}"
    return Product({FILE: writers.text(text)}, note)


def _facts(job: Job, rock: Any, responses: Any, fragility: Any) -> dict[str, Any]:
    """Everything that the page says."""
    rows = report_tables.by_yaw(responses, fragility)
    return {
        "site": job.site.name,
        "on_terrain": job.config.on_terrain,
        "rock": report_tables.about_rock(rock),
        "density": job.config.rock.density,
        "rows": rows,
        "answers": report_tables.answer(rows, fragility["friction"].values),
        "long_rows": long_rows_in_words(fragility["pgv_pga"].values),
        "grid": {name: [float(responses[name][i]) for i in (0, -1)] for name in ("pga", "pgv_pga")},
        "counts": report_tables.counts(responses),
        "unresolved": report_tables.unresolved(responses, _MOST_LISTED),
        "boundary": report_tables.boundary(fragility),
        "models": report_tables.models(fragility),
        **_pictures(job, rock, responses, fragility),
        **_records(job),
        "pulse": job.config.motion.kind.replace("_", " "),
        "tables": _tables(job, responses),
        "axes": read(job.path(MOTIONS)).attrs.get("axes"),
        "left_out": report_tables.left_out(
            responses, yaml.safe_load(GAINS.read_text(encoding="utf-8"))
        ),
        "other_engine": _other_engine(job),
        "time_steps": time_steps(read(job.path(TIME_STEP))),
        "simulation": job.config.simulation,
        "settings": _settings(job.config),
        "command": command(job.site),
        "versions": json.loads(responses.attrs["vsr_versions_json"]),
        "keys": {
            name: data.attrs["vsr_key"]
            for name, data in ((ROCK, rock), (RESPONSES, responses), (FRAGILITY, fragility))
        },
        "timings": _timings(job.store.notes("runs")),
        "paper": _PAPER,
        "files": {"responses": RESPONSES, "fragility": FRAGILITY, "table": TABLE},
    }


def _other_engine(job: Job) -> dict[str, Any] | None:
    """How a sample ended in another engine; None where Bullet is that of the runs."""
    if job.config.second_engine is None:
        return None if job.config.engine == "bullet" else {"total": 0}
    job.awaited("bullet_sample")
    return report_tables.other_engine(read(job.path(SAMPLE)))


def _pictures(job: Job, rock: Any, responses: Any, fragility: Any) -> dict[str, Any]:
    """Pictures, and what scripts tell of the cells and play of the runs in them."""
    # the smaller of the two, as measured: cells as PNG, lines as SVG; PNG for shaded surfaces,
    # which any viewer shows at once
    diagrams, cells = [], []
    for place, name in groups(responses):
        figure = overturning_diagram(responses, fragility, place, name)
        diagrams.append({"name": name, "image": png_uri(figure)})
        cells.append(cells_of(responses, place, figure))
    watched = teaching_runs.packed(job, responses, rock)
    scripts = [*film.scripts(), pages.source("cells.js")]
    return {
        "diagrams": diagrams,
        "rock_views": png_uri(rock_views(rock)),
        "yaw_polar": svg_uri(fragility_by_yaw(fragility, rock)),
        "watched": watched["places"] if watched else [],
        "data": {"axes": axes_of(responses), "diagrams": cells, "watched": watched},
        "scripts": [Markup(script) for script in scripts],  # noqa: S704  (our own files)
    }


def _records(job: Job) -> dict[str, Any]:
    """Table and pictures of the records; empty where the motions are pulses."""
    if not isinstance(job.config.motion, RecordConfig):
        return {"records": [], "processing": None}
    motions = read(job.path(MOTIONS))
    rows = report_tables.records(motions)
    for number, row in enumerate(rows[:_MOST_DRAWN]):
        row["image"] = png_uri(record_figure(motions, number))
    return {"records": rows, "processing": job.config.motion.processing}


def _tables(job: Job, responses: Any) -> list[str]:
    """Names of the motions in several axes; none where they are others."""
    motion = job.config.motion
    if not isinstance(motion, TableMotionConfig) or motion.files is None:
        return []
    return [str(name) for name in responses["record"].values]


def _settings(config: Config) -> str:
    """Write the resolved configuration as YAML, evenly spaced values as a range again."""
    tree = _shorter(config.model_dump(mode="json"))
    return str(yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, width=90))


_PATHS = {"rock.mesh", "motion.files", "motion.response.file", "uncertainty.scan.replica"}


def command(site: Site) -> list[str]:
    """Arguments that make the report again, as a shell takes them."""
    name = site.name if site.file == f"configs/sites/{site.name}.yaml" else site.file
    shared = name in known(SITES)
    try:
        plain = load_site(name if shared else site.file).config.model_dump(mode="json")
    except InputError:  # the file is gone or edited since; the settings are on the page
        return [shlex.quote(name)]
    given = _leaves(site.config.model_dump(mode="json"))
    own = _leaves(plain)
    changed = {key: value for key, value in given.items() if value != own.get(key, own)}
    for key in _PATHS & changed.keys():  # as the site's own file would name them
        names, folder = changed[key], site.folder_of(key)
        listed = [names] if isinstance(names, str) else names or []
        moved = [os.path.relpath(folder / name, site.folder) for name in listed]
        changed[key] = moved[0] if isinstance(names, str) else moved or None
    settings = (f"{key}={_flow(value)}" for key, value in changed.items())
    return [shlex.quote(name), *map(shlex.quote, settings)]


def _leaves(tree: dict[str, Any], above: str = "") -> dict[str, Any]:
    leaves: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            leaves |= _leaves(value, f"{above}{key}.")
        else:
            leaves[f"{above}{key}"] = value
    return leaves


def _flow(value: Any) -> str:
    text = yaml.safe_dump(_shorter(value), default_flow_style=True, width=10**6)
    return str(text).removesuffix("\n").removesuffix("\n...")


def _shorter(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _shorter(inner) for key, inner in value.items()}
    numbers = isinstance(value, (list, tuple)) and all(isinstance(v, (int, float)) for v in value)
    if numbers and len(value) > _MANY:
        evenly = Range(start=value[0], stop=value[-1], num=len(value))
        if evenly.values() == tuple(value):
            return evenly.model_dump()
    return list(value) if isinstance(value, tuple) else value


def _timings(notes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Last and total cost of the runs, from the log; the same row once if there was one call."""
    if not notes:
        return []
    last = {"what": "last call", **notes[-1]}
    names = ("runs", "seconds", "cpu_seconds")
    whole = {name: sum(note[name] for note in notes) for name in names}
    total = {"what": f"all {len(notes)} calls", **whole, "workers": None}
    return [last, total] if len(notes) > 1 else [last]
