"""What a stage declares, and what its function is given."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from pipeline.config.layers import Site
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import Config
from pipeline.workflow import pages
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.store import Store
from pipeline.workflow.writers import Writer


@dataclass(frozen=True)
class Product:
    """What a stage made.

    Attributes
    ----------
    unresolved : int, unresolved runs; the command then ends with exit code 1
    retry : int, runs that a later call should try again
    """

    files: dict[str, Writer]
    summary: str
    unresolved: int = 0
    retry: int = 0


class Refusal(InputError):
    """Input refused, with files that show why."""

    def __init__(self, problem: Problem, files: dict[str, Writer]) -> None:
        super().__init__(problem)
        self.files = files

    def shown_in(self, folder: Path) -> InputError:
        """The same in a line that names the first of the files."""
        (problem,), (name, *_) = self.problems, self.files
        return InputError(replace(problem, remedy=f"{problem.remedy}; {folder / name} shows it"))


@dataclass(frozen=True)
class Job:
    """What a stage's function is given.

    Attributes
    ----------
    shows : bool, whether a refusal leaves files that show why
    """

    site: Site
    store: Store
    cluster: Cluster
    key: str
    log: Callable[[str], None]
    stage: str = ""
    awaited: Callable[[str], None] = lambda name: None
    shows: bool = True

    @property
    def config(self) -> Config:
        """The resolved configuration."""
        return self.site.config

    def path(self, name: str) -> Path:
        """Path of an upstream product."""
        return self.store.folder / name


@dataclass(frozen=True)
class Stage:
    """Declaration of a stage; functions are named by their paths, ``"package.module:function"``.

    Attributes
    ----------
    aside : whether it is made in a process of its own, beside the stages that do not need it
    """

    name: str
    make: str
    applies: str = ""
    needs: tuple[str, ...] = ()
    late: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()
    code: tuple[str, ...] = ()
    aside: bool = False
    workers: str = ""
    made_elsewhere: bool = False
    inputs: str = ""
    files: tuple[str, ...] = ()
    versions: tuple[str, ...] = ()
    ready: str = ""
    check: str = ""

    def roots(self) -> tuple[str, ...]:
        """Roots of its code.

        Returns
        -------
        tuple of str, as ``tracing.reached`` takes them
        """
        return self.code if self.made_elsewhere else (self.make, *self.code)

    def is_for(self, settings: BaseModel) -> bool:
        """Whether a site with these settings has any use for it."""
        return not self.applies or bool(getattr(settings, self.applies))

    def is_made_aside(self, settings: BaseModel) -> bool:
        """Whether it is made in a process of its own."""
        return self.aside and not (self.workers and getattr(settings, self.workers))

    def settings(self, settings: BaseModel) -> dict[str, Any]:
        """The part of the settings that it reads, by dotted key."""
        whole = settings.model_dump(mode="json")
        return {key: _at(whole, key) for key in self.reads}

    def product(self, job: Job) -> Product:
        """Make it."""
        made: Product = named(self.make)(job)
        return made

    def get_ready(self, site: Site) -> None:
        """Load its code, while what it needs is still made."""
        named(self.make)
        if self.ready:
            named(self.ready)(site)

    def input_digests(self, site: Site) -> dict[str, str]:
        """Digests of what decides its product besides configuration and code, by name."""
        given = named(self.inputs)(site) if self.inputs else {}
        return given | {name: pages.digest(name) for name in self.files}

    def fault(self, store: Store) -> str:
        """What is wrong with its products beyond their checksums, or an empty string."""
        return str(named(self.check)(store)) if self.check else ""


def named(path: str) -> Callable[..., Any]:
    """The function at ``"package.module:function"``."""
    module, _, name = path.partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function


def _at(tree: dict[str, Any], key: str) -> Any:
    for part in key.split("."):
        tree = tree[part]
    return tree
