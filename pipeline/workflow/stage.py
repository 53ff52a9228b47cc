"""What a stage declares, and what its function is given."""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pipeline.config.layers import Origin, Site
from pipeline.config.problems import InputError, Problem
from pipeline.config.schema import Config
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
    warning : str, why it is not to be trusted without a look; shown by each command that makes it
        or finds it made, quiet ones too
    """

    files: dict[str, Writer]
    summary: str
    unresolved: int = 0
    retry: int = 0
    warning: str = ""


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
    """What a command asks for: a site, where its products are, and where its runs are done.

    Attributes
    ----------
    shows : bool, whether a refusal leaves files that show why
    """

    site: Site
    store: Store
    cluster: Cluster
    log: Callable[[str], None]
    shows: bool = True

    @property
    def config(self) -> Config:
        """The resolved configuration."""
        return self.site.config

    def path(self, name: str) -> Path:
        """Path of a product."""
        return self.store.folder / name


@dataclass(frozen=True)
class Work:
    """What a stage's function works with; none of it decides the product.

    Attributes
    ----------
    runs : Path, of the folder with the database of runs
    up : str, the way from the products to the folder of all results, as a link has it
    provenance : dict, attributes of every dataset: the key, and from which settings
    engine : str, name of the engine that is told as the source of a dataset
    note, notes : keep facts that no product may hold, such as times, and read those of a stage
    """

    stage: str
    origin: Origin
    cluster: Cluster
    log: Callable[[str], None]
    runs: Path
    up: str
    engine: str
    provenance: dict[str, str] = field(repr=False)
    note: Callable[..., None]
    notes: Callable[[str], list[dict[str, Any]]]


class Input(ABC):
    """What is read besides the configuration, such as files of a user.

    Attributes
    ----------
    code : tuple of str, roots of code that is found by it
    """

    code: tuple[str, ...] = ()

    @abstractmethod
    def digests(self) -> dict[str, str]:
        """What tells it from others now, by name."""

    def digests_as_read(self) -> dict[str, str]:
        """Those before its files were read; if finding it read none, those now."""
        return self.digests()

    def files_read(self) -> tuple[Path, ...]:
        """Files that are read, or folders of them."""
        return ()

    def get_ready(self) -> None:  # noqa: B027 (most need nothing)
        """Load what it needs, while other stages are made."""


class FilesInput(Input):
    """One whose digests were taken when it was found, before its files were read.

    Attributes
    ----------
    before : dict, those digests
    """

    before: dict[str, str]

    def digests_as_read(self) -> dict[str, str]:
        return self.before


@dataclass(frozen=True)
class Finder:
    """Declaration of an input: the function that finds it, and the class of what is found.

    The function takes settings, and the ``Origin`` of them; None is no input.
    """

    find: str
    gives: str


@dataclass(frozen=True)
class Stage:
    """Declaration of a stage; functions and classes are named by their paths.

    Attributes
    ----------
    make : str, its function, whose parameters are what its product is made from
    gives : tuple of str, classes of its product, as other functions ask for it
    applies : whether a site with some settings has any use for it
    refuses : str, function of a site that refuses what cannot be made, before anything is
    bounds : str, the same for what is too much to be made, of which a plan still tells the cost
    aside : whether it is made in a process of its own, beside the stages that do not need it
    code : tuple of str, roots of code that its function finds by names of modules
    in_database : bool, whether its product is rows of the database of runs
    """

    name: str
    make: str
    gives: tuple[str, ...] = ()
    applies: Callable[[Any], bool] = lambda settings: True
    refuses: str = ""
    bounds: str = ""
    aside: Callable[[Any], bool] = lambda settings: False
    code: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    versions: tuple[str, ...] = ()
    in_database: bool = False


def named(path: str) -> Callable[..., Any]:
    """The function or class at ``"package.module:name"``."""
    module, _, name = path.partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function
