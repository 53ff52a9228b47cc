"""Making the figures: bring their datasets up to date, draw what is not fresh, fill in the page."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import xarray as xr

from pipeline.config.layers import Site, load_site
from pipeline.config.problems import InputError, Problem
from pipeline.config.yaml_text import in_yaml
from pipeline.drawing.style import data_uri, pictures
from pipeline.stages.figures import paper
from pipeline.stages.figures.paper import RECORDED, Finding, Source
from pipeline.stages.fragility.summary import SEARCHED
from pipeline.workflow import graph, keys, pages, site_folder, writers
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.datasets import read
from pipeline.workflow.parameters import Values
from pipeline.workflow.registry import upstream
from pipeline.workflow.stage import Job, Product, Stage
from pipeline.workflow.store import Store

FOLDER = "figures"
"""Of the derived data, where the figures go."""

KINDS = ("png", "pdf", "svg")

_LIBRARIES = ("matplotlib", "numpy", "scipy")


@dataclass(frozen=True)
class Asked:
    """What is asked for.

    Attributes
    ----------
    settings : tuple of str, ``key=value``, over those of every site
    record : str, a recorded motion in place of the samples, or empty
    """

    derived: Path
    settings: tuple[str, ...]
    record: str
    cluster: Cluster
    log: Callable[[str], None]


def make(options: argparse.Namespace, cluster: Cluster, log: Callable[[str], None]) -> int:
    """Make one figure or all, and the page of claims."""
    wanted = options.fig
    asked = Asked(options.derived, tuple(options.settings), options.record, cluster, log)
    chosen = paper.find(wanted) if wanted else paper.names()
    if not chosen:
        known = ", ".join(name.removeprefix("fig_") for name in paper.names())
        raise InputError(Problem("--fig", "", repr(wanted), f"it is one of {known}", "correct it"))
    figures = {name: paper.load(name) for name in chosen}
    sources = [source for figure in figures.values() for source in figure.SOURCES.values()]
    sites = {source: _site(source, asked) for source in dict.fromkeys(sources)}
    stores = {source: _store(source, site, asked.derived) for source, site in sites.items()}
    store = Store(asked.derived / FOLDER)
    store.check_apart([Path(asked.record)] if asked.record else [])
    unresolved = 0
    with asked.cluster:
        for folder in dict.fromkeys(source.folder for source in sites):
            there = [source for source in sites if source.folder == folder]
            stages = {source.stage for source in there}
            unresolved += _bring(stages, sites[there[0]], stores[there[0]], asked)
    with store:
        for name, figure in figures.items():
            folders = {told: stores[source].folder for told, source in figure.SOURCES.items()}
            own = {told: sites[source] for told, source in figure.SOURCES.items()}
            _draw(name, figure, own, folders, store, asked)
        publish(store, asked)
    return unresolved


def _site(source: Source, asked: Asked) -> Site:
    settings = asked.settings
    if source.study == RECORDED and asked.record:
        files = in_yaml([str(Path(asked.record).resolve())])
        settings = (*settings, f"motion.files={files}")
    return load_site(source.site, source.study or None, settings)


def _store(source: Source, site: Site, derived: Path) -> Store:
    """Where its products go; a folder in which results of another file lie stays as it is."""
    return site_folder.store_of(replace(site, name=source.folder), derived, None)


def _bring(stages: set[str], site: Site, store: Store, asked: Asked) -> int:
    """Make the datasets of one folder; returns the number of unresolved runs."""
    job = Job(site, store, asked.cluster, lambda line: asked.log(f"{store.folder.name}: {line}"))
    with store:
        return max(graph.make(stage, job) for stage in _last(stages))


def dataset(source: Source, folder: Path) -> xr.Dataset:
    """What a figure is given of a source, whose products are in a folder."""
    first, *others = (read(folder / file) for file in source.files)
    for other in others:  # what lies along the dimensions of the first
        first = first.assign(other.drop_dims(set(other.dims) - set(first.dims)).data_vars)
        first.attrs |= {name: value for name, value in other.attrs.items() if name in SEARCHED}
    return first


def _last(stages: set[str]) -> list[str]:
    """Those of some stages that no other of them needs."""
    needed = {above.name for stage in stages for above in upstream(stage)[:-1]}
    return sorted(stages - needed)


def _draw(
    name: str,
    figure: paper.PaperFigure,
    sites: dict[str, Site],
    folders: dict[str, Path],
    store: Store,
    asked: Asked,
) -> None:
    """Draw a figure and compare it with the paper, unless that was done from the same.

    Parameters
    ----------
    sites, folders : dict, of what each dataset is, and where, as the figure names it
    """
    stage, identity = _identity(name, figure, sites)
    if not any(graph.why(stage, identity, store)):
        return
    store.open()
    data = {told: dataset(source, folders[told]) for told, source in figure.SOURCES.items()}
    for told, own in identity.facts["config"].items():
        data[told].attrs |= own
    recorded = asked.record and any(one.study == RECORDED for one in figure.SOURCES.values())
    other = [*asked.settings, *([f"record={Path(asked.record).name}"] if recorded else [])]
    try:
        found = {"title": figure.TITLE, "findings": [asdict(one) for one in figure.findings(data)]}
        found["settings"] = other
        files = pictures(name, figure.draw(data), KINDS)
    except (LookupError, ValueError) as missing:
        if not other:
            raise
        given, rule = " ".join(other), f"{figure.TITLE!r} needs what they leave out"
        remedy = f"leave them out, or give another figure (it looks for {missing})"
        raise InputError(Problem("--set", "", given, rule, remedy)) from missing
    files[f"{name}.json"] = writers.text(json.dumps(found, indent=1, ensure_ascii=False))
    graph.keep(name, identity, Product(files, figure.TITLE), store)
    asked.log(f"{FOLDER}: {name}")


def _identity(
    name: str, figure: paper.PaperFigure, sites: dict[str, Site]
) -> tuple[Stage, graph.Identity]:
    """A figure as a stage, and what it would be made from now.

    That is the key of each dataset, and what the figure reads of its site's settings as they are
    now, which may be others than when the dataset was made.
    """
    needs = {
        told: graph.identities(source.stage, sites[told])[source.stage].key
        for told, source in figure.SOURCES.items()
    }
    settings = {
        told: {key: Values(sites[told].settings).plain(key) for key in own}
        for told, own in paper.settings(figure).items()
    }
    inputs = {path.name: keys.digest_file(path) for path in paper.inputs(figure)}
    module = f"{paper.__package__}.{name}"
    stage = Stage(name, f"{module}:draw", code=(f"{module}:findings",), versions=_LIBRARIES)
    return stage, graph.made_from(stage, settings, inputs, needs)


PAGE = "claims.html"

LONGEST_TEST = 60.0
"""Time of one experiment that the paper gives [s], "a few seconds up to a minute"."""


def publish(store: Store, asked: Asked) -> None:
    """Fill in the page from the figures that are there, unless it is so already."""
    sections = [_section(store, name, asked) for name in paper.names()]
    speed = speed_findings(asked.derived)
    rows = [finding for section in sections for finding in section["findings"]] + speed
    facts = {
        "sections": sections,
        "speed": speed,
        "counts": Counter(finding.verdict for finding in rows),
        "verdicts": (paper.FOUND, paper.NOT_FOUND, paper.NOT_TESTABLE),
        "total": len(rows),
    }
    text = pages.filled(PAGE, facts)
    key = keys.digest_bytes(text.encode())
    if (store.manifest("claims") or {}).get("key") == key and not store.damage("claims"):
        return
    store.open()
    manifest = {"key": key, "facts": {}, "unresolved": 0, "retry": 0}
    store.publish("claims", manifest, {PAGE: writers.text(text)})


def _section(store: Store, name: str, asked: Asked) -> dict[str, Any]:
    """Title, picture and findings of a figure; without the latter two if it is not of today."""
    label, option = _label(name), name.removeprefix("fig_").lstrip("0")
    section: dict[str, Any] = {"name": name, "label": label, "option": option, "findings": []}
    section |= {"title": paper.load(name).TITLE, "image": ""}
    if store.manifest(name) is None or store.damage(name):
        return section
    stored = json.loads((store.folder / f"{name}.json").read_text(encoding="utf-8"))
    if not _is_of_today(store, name, stored["settings"], asked):
        return section
    section["settings"] = stored["settings"]
    section["findings"] = [Finding(**finding) for finding in stored["findings"]]
    section["image"] = data_uri((store.folder / f"{name}.png").read_bytes(), "png")
    return section


def _is_of_today(store: Store, name: str, settings: list[str], asked: Asked) -> bool:
    """Whether a figure would be made of the same now, with the settings that it was made with.

    One of a record is where the same is asked for: where that lies is not kept.
    """
    figure, given = paper.load(name), [s for s in settings if not s.startswith("record=")]
    record = asked.record if len(given) < len(settings) else ""
    own = replace(asked, settings=tuple(given), record=record)
    try:
        sites = {told: _site(source, own) for told, source in figure.SOURCES.items()}
        made = _identity(name, figure, sites)
    except InputError:  # its site cannot be read any more
        return False
    return not any(graph.why(*made, store))


def _label(name: str) -> str:
    """Name of a figure in words.

    >>> _label("fig_08"), _label("table_1"), _label("fig_friction")
    ('Fig. 8', 'Table 1', 'Friction')
    """
    kind, _, number = name.partition("_")
    if not number[:1].isdigit():
        return number.capitalize()
    return f"{'Fig.' if kind == 'fig' else 'Table'} {number.lstrip('0')}"


def speed_findings(derived: Path) -> list[Finding]:
    """Findings on the paper's claims on speed, from the logs of the runs."""
    measured, slowest = [], 0.0
    for source, what in (
        (Source("double_rock", "runs"), "Double Rock on a flat pedestal"),
        (
            Source("double_rock_terrain", "displacement_runs"),
            "with its whole trajectory over the terrain",
        ),
    ):
        store = _store(source, load_site(source.site), derived)
        notes = [note for note in store.notes(source.stage) if note["runs"]]
        if notes:
            number = sum(note["runs"] for note in notes)
            each = sum(note["cpu_seconds"] for note in notes) / number
            slowest = max(slowest, each)
            measured.append(f"{1e3 * each:.2g} ms of CPU a run, {what} ({number:,} runs)")
    known = "; ".join(measured) or "no run was logged yet"
    return [
        Finding(
            "section 6.1",
            "One overturning experiment takes a few seconds up to a minute.",
            f"the CPU time of a run is at most {LONGEST_TEST:g} s",
            known,
            slowest <= LONGEST_TEST if measured else None,
        ),
        Finding(
            "sections 2.2 and 6.1",
            "A physics engine is 10 to 250 times as fast as a discrete-element code.",
            "ratio of the run times on one scene",
            "no discrete-element code is part of this project",
            None,
        ),
    ]
