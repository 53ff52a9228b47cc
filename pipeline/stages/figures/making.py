"""Making the figures: bring their datasets up to date, draw what is not fresh, fill in the page."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from pipeline.config.layers import Site, load_site
from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import pictures
from pipeline.stages.figures import claims_page, paper
from pipeline.stages.figures.paper import RECORDED, Source
from pipeline.workflow import graph, keys, writers
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.datasets import read
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
    unresolved = 0
    with asked.cluster:
        for folder in dict.fromkeys(source.folder for source in sites):
            there = [source for source in sites if source.folder == folder]
            unresolved += _bring(there, sites[there[0]], asked)
    store = Store(asked.derived / FOLDER)
    with store:
        for name, figure in figures.items():
            needs = {
                told: graph.identities(source.stage, sites[source])[source.stage].key
                for told, source in figure.SOURCES.items()
            }
            _draw(name, figure, needs, store, asked)
        claims_page.publish(store, asked.derived)
    return unresolved


def _site(source: Source, asked: Asked) -> Site:
    settings = asked.settings
    if source.study == RECORDED and asked.record:
        files = json.dumps([str(Path(asked.record).resolve())])
        settings = (*settings, f"motion.files={files}")
    return load_site(source.site, source.study or None, settings)


def _bring(sources: list[Source], site: Site, asked: Asked) -> int:
    """Make the datasets of one folder; returns the number of unresolved runs."""
    folder = sources[0].folder
    store = Store(asked.derived / folder)
    job = Job(site, store, asked.cluster, lambda line: asked.log(f"{folder}: {line}"))
    with store:
        return max(graph.make(stage, job) for stage in _last({s.stage for s in sources}))


def _last(stages: set[str]) -> list[str]:
    """Those of some stages that no other of them needs."""
    needed = {above.name for stage in stages for above in upstream(stage)[:-1]}
    return sorted(stages - needed)


def _draw(
    name: str, figure: paper.PaperFigure, needs: dict[str, str], store: Store, asked: Asked
) -> None:
    """Draw a figure and compare it with the paper, unless that was done from the same."""
    module = f"{paper.__package__}.{name}"
    stage = Stage(name, f"{module}:draw", code=(f"{module}:findings",), versions=_LIBRARIES)
    inputs = {path.name: keys.digest_file(path) for path in paper.inputs(figure)}
    identity = graph.made_from(stage, {}, inputs, needs)
    if not any(graph.why(stage, identity, store)):
        return
    store.open()
    data = {
        told: read(asked.derived / source.folder / source.file)
        for told, source in figure.SOURCES.items()
    }
    try:
        found = {"title": figure.TITLE, "findings": [asdict(one) for one in figure.findings(data)]}
        files = pictures(name, figure.draw(data), KINDS)
    except KeyError as missing:
        if not asked.settings:
            raise
        given, rule = " ".join(asked.settings), f"{figure.TITLE!r} needs what they leave out"
        remedy = f"leave them out, or give another figure (it looks for {missing})"
        raise InputError(Problem("--set", "", given, rule, remedy)) from missing
    files[f"{name}.json"] = writers.text(json.dumps(found, indent=1, ensure_ascii=False))
    graph.keep(name, identity, Product(files, figure.TITLE), store)
    asked.log(f"{FOLDER}: {name}")
