"""Report: one page that holds all its pictures, from the products of a site."""

from __future__ import annotations

import copy
import json
import os
import shlex
from collections.abc import Iterator
from functools import reduce
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import yaml
from markupsafe import Markup

from pipeline.config.fragility_schema import FragilityConfig
from pipeline.config.layers import SITES, Origin, known, load_site
from pipeline.config.motion_schema import PUSHING, RecordConfig, TableMotionConfig, is_along_x
from pipeline.config.problems import InputError
from pipeline.config.scene_schema import RockConfig
from pipeline.config.sections import Key, Range
from pipeline.drawing.style import png_uri, svg_uri
from pipeline.stages.boundary.boundary import BoundaryData
from pipeline.stages.datasets import vertical
from pipeline.stages.datasets.bullet_sample import BulletSample
from pipeline.stages.datasets.responses import Responses
from pipeline.stages.fragility.fragility_figures import (
    axes_of,
    cells_of,
    fragility_by_yaw,
    overturning_diagram,
)
from pipeline.stages.fragility.rock_views import rock_views
from pipeline.stages.fragility.summary import TABLE, Fits, groups, long_rows_in_words, time_steps
from pipeline.stages.mesh.products import RockData, TerrainData
from pipeline.stages.motions.record_figure import record_figure
from pipeline.stages.replay import film
from pipeline.stages.reports import report_tables, teaching_runs
from pipeline.stages.runs.step_choice import StepData
from pipeline.stages.runs.study import Study
from pipeline.workflow import pages, writers
from pipeline.workflow.grammar import counted
from pipeline.workflow.parameters import Later
from pipeline.workflow.stage import Product, Work

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


class Parts(NamedTuple):
    """What the page is made from."""

    rock: RockConfig
    study: Study
    shape: RockData
    terrain: TerrainData | None
    time_step: StepData
    responses: Responses
    boundary: BoundaryData
    fits: Fits
    search: FragilityConfig
    inset: Annotated[tuple[float, float], Key("uncertainty.inset")]

    @property
    def tested_inset(self) -> tuple[float, float] | None:
        """How far inside its hull a rock bears as tests have found, where it stands on that."""
        level = not self.study.settings.on_terrain
        return self.inset if level and self.rock.shape == "mesh" and self.inset[1] else None

    def settings(self) -> dict[str, Any]:
        """The settings of what is on the page, as plain data."""
        scene = self.study.settings
        sections = {"rock": self.rock, "pedestal": scene.pedestal, "contact": scene.contact,
                    "motion": self.study.motion}  # fmt: skip
        return {
            **{name: section.model_dump(mode="json") for name, section in sections.items()},
            "yaw": list(self.study.yaw),
            "drive": scene.drive,
            "servo": {} if scene.servo is None else scene.servo.model_dump(mode="json"),
            "simulation": scene.simulation.model_dump(mode="json"),
            "fragility": self.search.model_dump(mode="json"),
            "uncertainty": {"inset": list(self.inset)},
        }


def _seat(parts: Parts) -> str:
    """What of its seam bears a rock that was scanned with its ground, in words."""
    if parts.terrain is None or parts.study.settings.pedestal.is_own_file:
        return ""
    return str(parts.terrain.data.attrs["seat"])


def make(work: Work, parts: Parts, sample: Later[BulletSample | None]) -> Product:
    """Draw the figures and fill in the page."""
    facts = _facts(work, parts, sample)
    text = pages.filled(FILE, facts, work.up)
    lost = facts["unresolved"]["total"]
    verdict = f"{counted(lost, 'run')} UNRESOLVED" if lost else "all runs are resolved"
    note = f"{len(text) / 1e6:.2f} MB, diagrams: {len(facts['diagrams'])}; {verdict}"
    return Product({FILE: writers.text(text)}, note)


def _facts(work: Work, parts: Parts, sample: Later[BulletSample | None]) -> dict[str, Any]:
    """Everything that the page says."""
    study, settings = parts.study, parts.settings()
    rock, responses, fragility = parts.shape.data, parts.responses.data, parts.fits.data
    motions = study.motion_data.data
    rows = report_tables.by_yaw(responses, fragility)
    return {
        "site": work.origin.name,
        "on_terrain": study.settings.on_terrain,
        "seat": _seat(parts),
        "rock": report_tables.about_rock(rock),
        "inset": parts.tested_inset,
        "density": parts.rock.density,
        "rows": rows,
        "answers": report_tables.answer(rows, fragility["friction"].values),
        "long_rows": long_rows_in_words(fragility["pgv_pga"].values),
        "grid": {name: [float(responses[name][i]) for i in (0, -1)] for name in ("pga", "pgv_pga")},
        "between": report_tables.between_cells(parts.boundary.data),
        "counts": report_tables.counts(responses),
        "vertical": vertical.effect(responses),
        "unresolved": report_tables.unresolved(responses, _MOST_LISTED),
        "boundary": report_tables.boundary(fragility),
        "models": report_tables.models(fragility),
        **_pictures(work, parts),
        **_records(study),
        "along_x": is_along_x(settings["motion"]),
        "pushing": study.motion.kind in PUSHING,
        "pulse": study.motion.kind.replace("_", " "),
        "tables": _tables(study),
        "axes": motions.attrs.get("axes"),
        "left_out": report_tables.left_out(responses, yaml.safe_load(pages.source(GAINS.name))),
        "other_engine": _other_engine(sample(), study.settings.engine),
        "time_steps": time_steps(parts.time_step.data),
        "simulation": study.settings.simulation,
        "settings": _in_yaml(settings),
        "command": command(work.origin, settings),
        "versions": json.loads(responses.attrs["vsr_versions_json"]),
        "keys": {
            name: data.attrs["vsr_key"]
            for name, data in (
                (RockData.FILE, rock),
                (BoundaryData.FILE, parts.boundary.data),
                (Responses.FILE, responses),
                (Fits.FILE, fragility),
            )
        },
        "timings": _timings(work.notes("runs"), work.notes("boundary")),
        "paper": _PAPER,
        "files": {"responses": Responses.FILE, "fragility": Fits.FILE, "table": TABLE},
    }


def _other_engine(sample: BulletSample | None, engine: str) -> dict[str, Any] | None:
    """How a sample ended in another engine; None where Bullet is that of the runs."""
    if sample is None:
        return None if engine == "bullet" else {"total": 0}
    return report_tables.other_engine(sample.data)


def _pictures(work: Work, parts: Parts) -> dict[str, Any]:
    """Pictures, and what scripts tell of the cells and play of the runs in them."""
    rock, responses, fragility = parts.shape.data, parts.responses.data, parts.fits.data
    # the smaller of the two, as measured: cells as PNG, lines as SVG; PNG for shaded surfaces,
    # which any viewer shows at once
    diagrams, cells = [], []
    for place, name in groups(responses):
        figure = overturning_diagram(responses, fragility, place, name)
        diagrams.append({"name": name, "image": png_uri(figure)})
        cells.append(cells_of(responses, place, figure))
    terrain = None if parts.terrain is None else parts.terrain.data
    try:
        watched = teaching_runs.packed(parts.study, responses, rock, terrain)
    except InputError as error:
        work.log(f"report: no run is played in it: {error}")
        watched = None
    scripts = [*film.scripts(), pages.source("cells.js")]
    return {
        "diagrams": diagrams,
        "rock_views": png_uri(rock_views(rock)),
        "yaw_polar": svg_uri(fragility_by_yaw(fragility, rock)),
        "watched": watched["places"] if watched else [],
        "data": {"axes": axes_of(responses), "diagrams": cells, "watched": watched},
        "scripts": [Markup(script) for script in scripts],  # noqa: S704  (our own files)
    }


def _records(study: Study) -> dict[str, Any]:
    """Table and pictures of the records; empty where the motions are pulses."""
    if not isinstance(study.motion, RecordConfig):
        return {"records": [], "processing": None}
    motions = study.motion_data.data
    rows = report_tables.records(motions)
    for number, row in enumerate(rows[:_MOST_DRAWN]):
        row["image"] = png_uri(record_figure(motions, number))
    return {"records": rows, "processing": study.motion.processing}


def _tables(study: Study) -> list[report_tables.Row]:
    """The motions in several axes from files; none where they are others."""
    motion = study.motion
    if not isinstance(motion, TableMotionConfig) or motion.files is None:
        return []
    return report_tables.records(study.motion_data.data)


def _in_yaml(settings: dict[str, Any]) -> str:
    """Write resolved settings as YAML, evenly spaced values as a range again."""
    tree = _shorter(settings)
    return str(yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, width=90))


_PATHS = {"rock.mesh", "pedestal.mesh", "motion.files", "motion.records", "motion.response.file"}


def command(site: Origin, settings: dict[str, Any]) -> list[str]:
    """Arguments that make the report again, as a shell takes them.

    Parameters
    ----------
    settings : dict, of what is on the page, as plain data
    """
    name = site.name if site.file == f"configs/sites/{site.name}.yaml" else site.file
    shared = name in known(SITES)
    try:
        plain = load_site(name if shared else site.file).config.model_dump(mode="json")
    except InputError:  # the file is gone or edited since; the settings are on the page
        return [shlex.quote(name)]
    given = copy.deepcopy(settings)
    for key in _PATHS:  # as the site's own file would name them
        *above, last = key.split(".")
        section: Any = reduce(lambda tree, part: tree.get(part) or {}, above, given)
        if section.get(last) and site.folder_of(key) != site.folder:
            section[last] = _moved(section[last], site.folder_of(key), site.folder)
    told = (f"{key}={_flow(value)}" for key, value in _changed(given, plain))
    return [shlex.quote(name), *map(shlex.quote, told)]


def _moved(given: Any, folder: Path, home: Path) -> Any:
    """Paths relative to ``folder`` as those relative to ``home``, also within records."""
    if isinstance(given, str):
        return os.path.relpath(folder / given, home)
    if isinstance(given, dict):  # a record: of one file its components are channels
        names = ("file",) if given.get("file") else ("x", "y", "z", "components")
        return {k: _moved(v, folder, home) if k in names else v for k, v in given.items()}
    return [_moved(one, folder, home) for one in given] if given else None


def _changed(
    given: dict[str, Any], plain: dict[str, Any], above: str = ""
) -> Iterator[tuple[str, Any]]:
    """Keys whose values are others, a section as a whole where it is of another kind."""
    for key, value in given.items():
        own = plain.get(key)
        kinds = [one.get("kind") for one in (value, own) if isinstance(one, dict)]
        if len(kinds) == 2 and kinds[0] == kinds[1]:
            yield from _changed(value, plain[key], f"{above}{key}.")
        elif value != own and (value != {} or own is not None):
            yield f"{above}{key}", value


def _flow(value: Any) -> str:
    # quoted, so that no other setting is seen to begin in it
    style = '"' if isinstance(value, str) and "=" in value else None
    text = yaml.safe_dump(
        _shorter(value), default_flow_style=True, width=10**6, default_style=style
    )
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


def _timings(cells: list[dict[str, Any]], between: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Last and total cost of the cells, from the log, once if there was one call; and between."""
    rows = []
    for notes, where in ((cells, ""), (between, ", between the cells")):
        if notes:
            rows.append({"what": f"last call{where}", **notes[-1]})
        if len(notes) > 1:
            names = ("runs", "seconds", "cpu_seconds")
            whole = {name: sum(note[name] for note in notes) for name in names}
            rows.append({"what": f"all {len(notes)} calls{where}", **whole, "workers": None})
    return rows
