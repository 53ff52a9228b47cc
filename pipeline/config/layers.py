"""From YAML files and --set to a checked Config; every problem is traced to its origin."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ValidationError

from pipeline.config.age_files import with_samples
from pipeline.config.motion_schema import PULSES
from pipeline.config.outside import text
from pipeline.config.paths import SHIPPED, kept, located, shown
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.config.refusals import is_section, nearest, problems
from pipeline.config.schema import Config, TableConfig
from pipeline.config.yaml_text import DEEPEST, LONGEST, parse

CONFIGS = SHIPPED / "configs"
SITES, STUDIES, TABLES = CONFIGS / "sites", CONFIGS / "studies", CONFIGS / "tables"
BASE = CONFIGS / "base.yaml"

Checked = TypeVar("Checked", bound=BaseModel)


class Request(NamedTuple):
    """What a command names: a site, perhaps a study of it, and settings over both."""

    site: str
    study: str | None = None
    settings: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where the settings of a site stand: what messages name, and what paths are relative to.

    Attributes
    ----------
    file : str, where they stand, as a reader would write it
    path : Path, of that file, or of a folder of recorded tests
    places : dict, from the parts of a key to where it was set above the base, as a reader would
        write it, and the folder which a path there is relative to
    """

    name: str
    file: str
    path: Path
    places: dict[tuple[str, ...], tuple[str, Path]] = field(default_factory=dict)
    request: Request | None = None

    @property
    def folder(self) -> Path:
        """Folder that paths are relative to."""
        return self.path if self.path.is_dir() else self.path.parent

    @property
    def label(self) -> str:
        """Where the settings stand, for provenance: never a path that only one machine knows."""
        return kept(self.path)

    def folder_of(self, key: str) -> Path:
        """Folder that a path is relative to: that of the file which set its dotted key.

        Parameters
        ----------
        key : str, e.g. ``"motion.files"``
        """
        return self._set_in(key)[1]

    def located(self, key: str, name: str) -> Path:
        """The path that a dotted key gives."""
        return located(self.folder_of(key), name, self.file_of(key), key)

    def file_of(self, key: str) -> str:
        """Where a key stands, or else the nearest section above it, for messages.

        Returns
        -------
        str, a file as a reader would write it, or an option of the command line
        """
        return self._set_in(key)[0]

    def _set_in(self, key: str) -> tuple[str, Path]:
        found = nearest(self.places, tuple(key.split(".")))
        return (self.file, self.folder) if found is None else found


@dataclass(frozen=True, kw_only=True)
class Site(Origin):
    """What products are made for, and from which settings.

    Attributes
    ----------
    settings : the checked configuration of a rock, or what is assumed of a series of recorded
        shake-table tests
    read : tuple of Path, YAML files and tables of ages that the settings are from
    """

    settings: Config | ShakeTableConfig
    read: tuple[Path, ...] = ()

    @property
    def config(self) -> Config:
        """The configuration, of a site that is a rock."""
        assert isinstance(self.settings, Config)
        return self.settings

    @property
    def origin(self) -> Origin:
        """Where the settings stand, without them."""
        return Origin(**{one.name: getattr(self, one.name) for one in fields(Origin)})


def known(folder: Path = SITES) -> list[str]:
    """Names of the YAML files in a folder of configurations."""
    return sorted(path.stem for path in folder.glob("*.yaml"))


def load_site(
    site: str,
    study: str | None = None,
    settings: tuple[str, ...] = (),
    over: tuple[str, tuple[str, ...]] | None = None,
    without: str = "",
) -> Site:
    """Merge base, site, study and ``key=value`` settings, later ones over earlier ones.

    Parameters
    ----------
    over : another study and settings of its own, over all of these
    without : a section that is left out of the study and the settings below those
    """
    layers = read_layers(site, study, settings, over, without)
    if layers.sweep is not None:
        rule, remedy = "this command takes no sweep", "leave out the study, or its sweep"
        raise InputError(Problem(layers.files[-1][0], "sweep", "", rule, remedy))
    return layers.site()


@dataclass(frozen=True)
class Layers:
    """What a configuration is merged from, before it is checked.

    Attributes
    ----------
    files : of base, site and study, each the file as a reader would write it, and its content; of
        a study over settings these and that study, too
    paths : dict, from each file as a reader would write it to its path
    """

    path: Path
    request: Request
    files: tuple[tuple[str, dict[str, Any]], ...]
    paths: dict[str, Path]
    settings: tuple[dict[str, Any], ...]
    sweep: Any

    def site(self, *more: dict[str, Any]) -> Site:
        """Merge and check them.

        Parameters
        ----------
        more : mappings, each a layer between the study, as which they count, and the settings
        """
        merged, origin = self.merged(*more)
        file = shown(self.path)
        try:
            config = Config.model_validate(merged)
        except ValidationError as error:
            by_key = {(one.file, one.key): one for one in problems(error, origin, file)}
            raise InputError(*by_key.values()) from None
        folder = self.path.parent
        places = {
            key: (at, self.paths[at].parent if at in self.paths else folder)
            for key, at in origin.items()
            if at != shown(BASE)  # what is to be other than in the base is set by the site
        }
        site = Site(
            name=self.path.stem,
            file=file,
            path=self.path,
            places=places,
            request=self.request,
            settings=config,
        )
        read = [*self.paths.values()]

        def to_read(key: str, name: str) -> Path:
            read.append(site.located(key, name))
            return read[-1]

        hazard = with_samples(config.hazard, to_read, site.file_of)
        settings = config.model_copy(update={"hazard": hazard})
        return replace(site, settings=settings, read=tuple(read))

    def merged(self, *more: dict[str, Any]) -> tuple[dict[str, Any], dict[tuple[str, ...], str]]:
        """Merge them, unchecked.

        Returns
        -------
        origin : dict, from the parts of a key to where its value stands
        """
        merged: dict[str, Any] = {}
        origin: dict[tuple[str, ...], str] = {}
        study = self.files[-1][0]
        for source, layer in (*self.files, *((study, layer) for layer in more)):
            _merge(merged, layer, origin, source, ())
        for layer in self.settings:
            _merge(merged, layer, origin, "--set", ())
        return merged, origin


def read_layers(
    site: str,
    study: str | None,
    settings: tuple[str, ...],
    over: tuple[str, tuple[str, ...]] | None = None,
    without: str = "",
) -> Layers:
    """Read base, site and study, and ``key=value`` settings; and others over all of these."""
    path = _find(site, SITES, "site")
    paths = [BASE, path, *(() if study is None else [_find(study, STUDIES, "study")])]
    files = [(shown(file), _read(file)) for file in paths]
    given = layers_of(settings)
    if over is not None:
        for layer in (*(content for _, content in files[2:]), *given):
            layer.pop(without, None)
        paths.append(_find(over[0], STUDIES, "study"))
        files += [*(("--set", layer) for layer in given), (shown(paths[-1]), _read(paths[-1]))]
        given = layers_of(over[1])
    sweep = files[-1][1].pop("sweep", None) if len(paths) > 2 else None
    named = {shown(file): file for file in paths}
    return Layers(path, Request(site, study, settings), tuple(files), named, given, sweep)


def load_file(name: str, folder: Path, what: str, model: type[Checked]) -> tuple[Checked, str]:
    """A configuration of one file, by its name in a folder or by its path."""
    path = _find(name, folder, what)
    file = shown(path)
    try:
        return model.model_validate(_read(path)), file
    except ValidationError as error:
        raise InputError(*problems(error, {}, file, model)) from None


def load_table(name: str) -> tuple[TableConfig, str]:
    """Limits of a shake table, by its name in ``configs/tables`` or by the path of its YAML."""
    return load_file(name, TABLES, "table", TableConfig)


def _find(name: str, folder: Path, what: str) -> Path:
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        path = located(Path.cwd(), name, f"--{what}", "")
        if path.is_file() and path.stem.strip("."):
            return path
        if path.exists():
            given, rule = f"{name}, which is no regular file", "a configuration is in one"
            raise InputError(Problem(f"--{what}", "", given, rule, "correct the path"))
        raise not_found(f"--{what}", "", name)
    if name in known(folder):
        return folder / f"{name}.yaml"
    names, option = known(folder), f"--{what}"
    if not name:
        variable = "LIMITS" if what == "table" else what.upper()  # TABLE is a folder of tests
        remedy = f"give one, e.g. {option} {names[0]}, or with make {variable}={names[0]}"
        raise InputError(Problem(option, "", "", f"no {what} given", remedy))
    near = difflib.get_close_matches(name, names, 1)
    remedy = f"did you mean {near[0]}?" if near else "give one of them, or the path of a YAML file"
    rule = f"unknown {what}; known are {', '.join(names)}"
    raise InputError(Problem(option, "", repr(name), rule, remedy))


def _read(path: Path) -> dict[str, Any]:
    given = text(path, LONGEST)
    if not given.strip():
        rule, remedy = "a configuration says something", "write it, or remove the file"
        raise InputError(Problem(shown(path), "", "an empty file", rule, remedy))
    try:
        content = parse(given)
    except ValueError as error:
        rule = f"invalid YAML: {error}"
        raise InputError(Problem(shown(path), "", "", rule, "correct the file")) from None
    if content is None:  # comments alone
        return {}
    if not isinstance(content, dict):
        rule = "a configuration is a mapping of keys to values"
        given = f"a {type(content).__name__}"
        raise InputError(Problem(shown(path), "", given, rule, "write key: value"))
    return content


_NEXT = re.compile(r"(\s+)(?=[^\s=\[\]{}\"',]+=)")
"""Blanks before what may be the next setting."""


def one_by_one(settings: Iterable[str]) -> list[str]:
    """Settings, of which a text may hold several."""
    return [one for given in settings for one in _parted(given)]


def layers_of(settings: Iterable[str]) -> tuple[dict[str, Any], ...]:
    """A layer of each ``key=value``.

    Raises
    ------
    InputError
        If one is of another form, or its value no YAML.
    """
    return tuple(map(_setting, one_by_one(settings)))


def _parted(given: str) -> list[str]:
    """Settings in a text, each beginning where the value before it is whole.

    >>> _parted("yaw=[0, 90] motion.pga={start: 0.1, stop: 1, num: 5} found.place=[a b=1, c]")
    ['yaw=[0, 90]', 'motion.pga={start: 0.1, stop: 1, num: 5}', 'found.place=[a b=1, c]']
    """
    first, *others = _NEXT.split(given.strip())
    found = [first]
    for blanks, part in zip(others[::2], others[1::2], strict=True):
        if _is_whole(found[-1]):
            found.append(part)
        else:
            found[-1] += blanks + part
    return found


def _is_whole(setting: str) -> bool:
    try:
        parse(setting.partition("=")[2])
    except ValueError:
        return False
    return True


def _setting(item: str) -> dict[str, Any]:
    key, equals, value = item.partition("=")
    parts = key.split(".")
    if not equals or not all(parts) or len(parts) > DEEPEST:
        rule, remedy = "a setting has the form key=value", "e.g. motion.pga.num=20"
        raise InputError(Problem("--set", "", repr(item), rule, remedy))
    try:
        layer = parse(value)
    except ValueError as error:
        rule = f"invalid YAML: {error}"
        raise InputError(Problem("--set", key, repr(value), rule, "correct the value")) from None
    return nested(key, layer)


def nested(key: str, value: Any) -> dict[str, Any]:
    """A layer of settings with one key.

    >>> nested("contact.friction", 0.4)
    {'contact': {'friction': 0.4}}
    """
    for part in reversed(key.split(".")):
        value = {part: value}
    return dict(value)


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
        before = origin.get(here, source)
        origin[here] = source
        if isinstance(value, dict) and isinstance(into.get(key), dict):
            if "kind" in value and not _alike(value["kind"], into[key].get("kind")):
                into[key] = {}  # what was said of another kind does not hold
            _merge(into[key], value, origin, source, here)
        elif isinstance(value, dict):
            if into.get(key) is not None and is_section(here):
                given, rule = repr(into[key]), "it is a section of keys"
                raise InputError(Problem(before, ".".join(here), given, rule, "leave it out"))
            into[key] = {}
            _merge(into[key], value, origin, source, here)
        else:
            into[key] = value


def _alike(kind: Any, other: Any) -> bool:
    """Whether two kinds of a section have the same keys."""
    return bool(kind == other or (kind in PULSES and other in PULSES))
