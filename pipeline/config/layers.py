"""From YAML files and --set to a checked Config; every problem is traced to its origin."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from pipeline import ROOT
from pipeline.config.motion_schema import PULSES
from pipeline.config.paths import located, shown
from pipeline.config.problems import InputError, Problem
from pipeline.config.recorded_tests_schema import ShakeTableConfig
from pipeline.config.schema import Config
from pipeline.config.yaml_text import DEEPEST, LONGEST, parse

SITES = ROOT / "configs" / "sites"
STUDIES = ROOT / "configs" / "studies"
TABLES = ROOT / "configs" / "tables"
BASE = ROOT / "configs" / "base.yaml"

Checked = TypeVar("Checked", bound=BaseModel)


@dataclass(frozen=True)
class Site:
    """What products are made for, and from which settings.

    Attributes
    ----------
    name : str
    settings : the checked configuration of a rock, or what is assumed of a series of recorded
        shake-table tests
    file : str, where they stand, as a reader would write it
    folder : Path, which the settings' paths are relative to
    folders : dict, from a dotted key to the folder of the file that set it
    """

    name: str
    settings: Config | ShakeTableConfig
    file: str
    folder: Path
    folders: dict[str, Path] = field(default_factory=dict)

    @property
    def config(self) -> Config:
        """The configuration, of a site that is a rock."""
        assert isinstance(self.settings, Config)
        return self.settings

    @property
    def origin(self) -> str:
        """Where the settings stand, for provenance: never a path that only one machine knows."""
        return Path(self.file).name if Path(self.file).is_absolute() else self.file

    def folder_of(self, key: str) -> Path:
        """Folder that a path is relative to: that of the file which set its dotted key.

        Parameters
        ----------
        key : str, e.g. ``"motion.files"``

        Returns
        -------
        Path
        """
        return self.folders.get(key, self.folder)


def known(folder: Path = SITES) -> list[str]:
    """Names of the YAML files in a folder of configurations.

    Parameters
    ----------
    folder : Path, of YAML files

    Returns
    -------
    list of str, sorted
    """
    return sorted(path.stem for path in folder.glob("*.yaml"))


def load_site(site: str, study: str | None = None, settings: tuple[str, ...] = ()) -> Site:
    """Merge base, site, study and ``key=value`` settings, later ones over earlier ones.

    Parameters
    ----------
    site : str, its name or the path of its YAML
    study : str, a name or path too
    settings : tuple of str, ``key=value``

    Returns
    -------
    Site

    Raises
    ------
    InputError
        With one problem per line, for everything that is wrong at once.
    """
    path = _find(site, SITES, "site")
    files = [BASE, path]
    if study:
        files.append(_find(study, STUDIES, "study"))
    layers = [(shown(file), _read(file)) for file in files]
    layers += [("--set", _setting(item)) for item in settings]
    merged: dict[str, Any] = {}
    origin: dict[tuple[str, ...], str] = {}
    for source, layer in layers:
        _merge(merged, layer, origin, source, ())
    try:
        config = Config.model_validate(merged)
    except ValidationError as error:
        problems = [_problem(item, origin, shown(path)) for item in error.errors()]
        by_key = {(problem.file, problem.key): problem for problem in problems}
        raise InputError(*by_key.values()) from None
    parents = {shown(file): file.parent for file in files}
    folders = {".".join(key): parents[at] for key, at in origin.items() if at in parents}
    return Site(path.stem, config, shown(path), path.parent, folders)


def load_file(name: str, folder: Path, what: str, model: type[Checked]) -> tuple[Checked, str]:
    """A configuration of one file, by its name in a folder or by its path.

    Parameters
    ----------
    name : str, name or path
    folder : Path, where names are looked up
    what : str, what it is a file of, for messages
    model : type of the configuration

    Returns
    -------
    configuration, and its file as a reader would write it

    Raises
    ------
    InputError
        With one problem per line, for everything that is wrong at once.
    """
    path = _find(name, folder, what)
    file = shown(path)
    try:
        return model.model_validate(_read(path)), file
    except ValidationError as error:
        problems = (_problem(item, {}, file, model) for item in error.errors())
        raise InputError(*problems) from None


def _find(name: str, folder: Path, what: str) -> Path:
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        path = located(Path.cwd(), name, what.upper(), "")
        if path.is_file() and path.stem.strip("."):
            return path
        raise InputError(
            Problem(name, "", "a file that is not there", "it exists", "check the path")
        )
    if name in known(folder):
        return folder / f"{name}.yaml"
    near = difflib.get_close_matches(name, known(folder), 1)
    hint = f"did you mean {near[0]}?" if near else "give one of them, or a path ending in .yaml"
    rule = f"the known ones are {', '.join(known(folder)) or 'none'}"
    raise InputError(Problem(what.upper(), "", repr(name), rule, hint))


def _read(path: Path) -> dict[str, Any]:
    try:
        with path.open(encoding="utf-8") as file:
            content = parse(file.read(LONGEST + 1))
    except OSError as error:
        given = f"a file that cannot be read ({error.strerror})"
        raise InputError(
            Problem(shown(path), "", given, "you may read it", "change its permissions")
        ) from None
    except ValueError as error:
        raise InputError(
            Problem(shown(path), "", "text that is no YAML", str(error), "correct the file")
        ) from None
    if content is None:
        return {}
    if not isinstance(content, dict):
        given = type(content).__name__
        raise InputError(
            Problem(
                shown(path), "", f"a {given}", "a configuration is a mapping", "write key: value"
            )
        )
    return content


def _setting(item: str) -> dict[str, Any]:
    key, equals, value = item.partition("=")
    parts = key.split(".")
    if not equals or not all(parts) or len(parts) > DEEPEST:
        raise InputError(
            Problem("--set", "", repr(item), "it is key=value", "e.g. motion.pga.num=20")
        )
    try:
        layer: Any = parse(value)
    except ValueError as error:
        raise InputError(
            Problem("--set", key, repr(value), f"the value is YAML ({error})", "correct it")
        ) from None
    for part in reversed(parts):
        layer = {part: layer}
    return dict(layer)


def _merge(
    into: dict[str, Any],
    layer: dict[str, Any],
    origin: dict[tuple[str, ...], str],
    source: str,
    path: tuple[str, ...],
) -> None:
    for name, value in layer.items():
        key = str(name)
        here = (*path, key)
        origin[here] = source
        if isinstance(value, dict) and isinstance(into.get(key), dict):
            if "kind" in value and not _alike(value["kind"], into[key].get("kind")):
                into[key] = {}  # what was said of another kind does not hold
            _merge(into[key], value, origin, source, here)
        elif isinstance(value, dict):
            into[key] = {}
            _merge(into[key], value, origin, source, here)
        else:
            into[key] = value


def _alike(kind: Any, other: Any) -> bool:
    """Whether two kinds of a section have the same keys."""
    return bool(kind == other or (kind in PULSES and other in PULSES))


def _problem(
    error: Any,
    origin: dict[tuple[str, ...], str],
    site: str,
    root: type[BaseModel] = Config,
) -> Problem:
    place, models = _walk(error["loc"], root)
    given: Any = error["input"]
    if error["type"] == "union_tag_invalid":
        place, models = (*place, "kind"), [*models, None]
        given = error["ctx"]["tag"]
    source = next(
        (origin[place[:n]] for n in range(len(place), 0, -1) if place[:n] in origin), site
    )
    key = ".".join(place)
    if error["type"] == "extra_forbidden":
        names = list(models[-1].model_fields) if models[-1] else ["start", "stop", "num"]
        near = difflib.get_close_matches(place[-1], names, 1)
        hint = f"did you mean {near[0]}?" if near else f"the keys here are {', '.join(names)}"
        return Problem(source, key, "an unknown key", "every key is known", hint)
    if error["type"] == "missing":
        return Problem(source, key, "nothing", "the key is required", _description(place, models))
    given = repr(given)
    if error["type"] == "value_error":
        rule, _, remedy = str(error["ctx"]["error"]).partition("; ")
        return Problem(source, key, given, rule, remedy)
    if error["type"] == "union_tag_invalid":
        return Problem(source, key, given, f"it is {error['ctx']['expected_tags']}", "correct it")
    rule = error["msg"][0].lower() + error["msg"][1:]
    return Problem(source, key, given, rule, _description(place, models))


Sections = dict[str, type[BaseModel]]
"""Sections that a key may hold, by their kind."""


def _walk(
    location: tuple[Any, ...], root: type[BaseModel]
) -> tuple[tuple[str, ...], list[type[BaseModel] | None]]:
    """Keys of a problem's place, without the names of a union's members, and what holds each."""
    place: list[str] = []
    models: list[type[BaseModel] | None] = []
    inner: type[BaseModel] | Sections | None = root
    for part in map(str, location):
        if part.startswith(("literal", "constr", "tagged-union")):
            continue
        if isinstance(inner, dict):
            inner = inner.get(part)
            continue
        place.append(part)
        models.append(inner)
        if part.isdigit():  # an item of a list
            continue
        field = inner.model_fields.get(part) if inner else None
        inner = _inner(field.annotation) if field else None
    return tuple(place), models


def _inner(annotation: Any) -> type[BaseModel] | Sections | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    members = [inner for member in get_args(annotation) if (inner := _inner(member))]
    if len(members) < 2:
        return members[0] if members else None
    kinds: Sections = {}
    for member in members:
        if not isinstance(member, dict):
            (kind,) = get_args(member.model_fields["kind"].annotation)
            member = {kind: member}
        kinds |= member
    return kinds


def _description(place: tuple[str, ...], models: list[type[BaseModel] | None]) -> str:
    for name, model in zip(reversed(place), reversed(models), strict=True):
        field = model.model_fields.get(name) if model else None
        if field and field.description:
            return f"expected: {field.description}"
    return "correct it in the configuration"
