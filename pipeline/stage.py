"""What a stage declares, and what it is given. One stage is one file in ``pipeline/stages``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.config import Config
from pipeline.layers import Site
from pipeline.store import Store, Writer

if TYPE_CHECKING:
    from pipeline.cluster import Cluster


@dataclass(frozen=True)
class Product:
    """What a stage made.

    Attributes
    ----------
    files : dict, from file name to a function that writes it to a given path
    summary : str, one line for the log
    unresolved : int, runs without a verdict; the command then ends with exit code 1
    retry : int, runs that a later call should try again
    """

    files: dict[str, Writer]
    summary: str
    unresolved: int = 0
    retry: int = 0


@dataclass(frozen=True)
class Job:
    """What a stage's function is given.

    Attributes
    ----------
    site : Site, with the resolved configuration
    store : Store, products of the stages it needs
    cluster : Cluster, where runs are done
    key : str, identity of what is asked for, for provenance
    log : function of one line
    """

    site: Site
    store: Store
    cluster: Cluster
    key: str
    log: Callable[[str], None]

    @property
    def config(self) -> Config:
        """The resolved configuration."""
        return self.site.config

    def path(self, name: str) -> Path:
        """Path of an upstream product."""
        return self.store.folder / name


@dataclass(frozen=True)
class Stage:
    """Declaration of a stage.

    Attributes
    ----------
    name : str
    make : function from Job to Product
    needs : stages whose products it reads
    reads : dotted keys of the configuration that decide its product
    code : roots of the code that decides it, as ``module:name``, besides ``make``
    applies : whether a configuration has any use for it; else it is passed over
    made_elsewhere : whether ``make`` only arranges for ``code`` to run and is no root itself
    inputs : digests of files outside the configuration, by name, for the key
    versions : libraries whose version decides the result
    check : what is wrong with its products beyond their checksums, or an empty string
    """

    name: str
    make: Callable[[Job], Product]
    needs: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()
    code: tuple[str, ...] = ()
    inputs: Callable[[Site], dict[str, str]] = field(default=lambda site: {})
    versions: tuple[str, ...] = ()
    check: Callable[[Store], str] = field(default=lambda store: "")
    applies: Callable[[Config], bool] = field(default=lambda config: True)
    made_elsewhere: bool = False

    def roots(self) -> tuple[str, ...]:
        """Roots of its code."""
        if self.made_elsewhere:
            return self.code
        return (f"{self.make.__module__}:{self.make.__name__}", *self.code)

    def settings(self, config: Config) -> dict[str, Any]:
        """The part of the configuration that it reads, by dotted key."""
        whole = config.model_dump(mode="json")
        return {key: _at(whole, key) for key in self.reads}


def _at(tree: dict[str, Any], key: str) -> Any:
    for part in key.split("."):
        tree = tree[part]
    return tree


@cache
def stages() -> dict[str, Stage]:
    """All stages by name: every module in ``pipeline.stages`` has one called STAGE."""
    package = importlib.import_module("pipeline.stages")
    modules = (
        importlib.import_module(f"pipeline.stages.{m.name}")
        for m in pkgutil.iter_modules(package.__path__)
    )
    return {module.STAGE.name: module.STAGE for module in modules}
