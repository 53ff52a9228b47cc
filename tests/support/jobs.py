"""What commands ask for and stages work with, in tests of what stands below them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pipeline.config.layers import Site, load_site
from pipeline.workflow import graph
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.stage import Job, Work
from pipeline.workflow.store import Store

T = TypeVar("T")


def quiet(line: str) -> None:
    """Tell nothing."""


def job(
    site: Site | str,
    folder: Path | Store,
    cluster: Cluster | None = None,
    log: Callable[[str], None] = quiet,
) -> Job:
    """A job whose products are in a folder."""
    store = folder if isinstance(folder, Store) else Store(folder)
    return Job(
        site if isinstance(site, Site) else load_site(site), store, cluster or Cluster(0), log
    )


def work(site: Site | str, folder: Path | Store, stage: str = "runs") -> Work:
    """What a stage works with there."""
    return graph.work_of(stage, "key", job(site, folder))


def built(what: type[T], site: Site | str, folder: Path | Store) -> T:
    """A class whose fields are settings and products, of those in a folder."""
    return graph.built(what, job(site, folder))
