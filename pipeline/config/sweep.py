"""Sweeps: named dimensions of keys and their values in a study, and a site for each member."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pipeline.config.layers import Layers, Site, nested, read_layers
from pipeline.config.problems import InputError, Problem
from pipeline.config.sections import Range

GRIDS = {"yaw": "yaw", "contact.friction": "friction"}
"""Keys whose values one site takes all at once, and what these are called in its datasets."""

TAKEN = ("yaw", "friction", "pga", "pgv_pga", "record")
"""Dimensions of nearly all datasets."""

MOST_MEMBERS = 200
"""Members of a sweep, each a site with products of its own; directions and frictions are grids."""

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")

EXAMPLE = "e.g. sweep: {bounce: {contact.restitution: [0, 0.2, 0.4]}}"


@dataclass(frozen=True)
class Dimension:
    """One dimension of a sweep.

    Attributes
    ----------
    values : dict, from each key that changes along it to the key's values, all equally many
    gridded : bool, whether one member has all of it, as a grid of its own
    """

    name: str
    values: dict[str, tuple[Any, ...]]
    labels: tuple[str, ...]
    reference: int
    gridded: bool

    @property
    def key(self) -> str:
        """The first of its keys, by whose values it goes."""
        return next(iter(self.values))

    @property
    def is_numeric(self) -> bool:
        """Whether the values of that key are numbers, none of which comes again."""
        own = self.values[self.key]
        return all(map(_is_number, own)) and len(set(own)) == len(own)

    def layers(self) -> Iterator[tuple[dict[str, Any], ...]]:
        """What each place along it sets."""
        if self.gridded:
            yield (nested(self.key, list(self.values[self.key])),)
            return
        for together in zip(*self.values.values(), strict=True):
            yield tuple(map(nested, self.values, together))


@dataclass(frozen=True)
class Member:
    """One of the sites of a sweep."""

    name: str
    place: tuple[int, ...]
    site: Site


@dataclass(frozen=True)
class Sweep:
    """A study that goes through values of keys.

    Attributes
    ----------
    members : tuple of Member, the last dimension running fastest
    """

    study: str
    file: str
    dimensions: tuple[Dimension, ...]
    members: tuple[Member, ...]

    @property
    def parted(self) -> tuple[Dimension, ...]:
        """The dimensions that are no grid of a member."""
        return tuple(one for one in self.dimensions if not one.gridded)

    @property
    def reference(self) -> Member:
        """The member at the reference of all dimensions."""
        wanted = tuple(one.reference for one in self.parted)
        return next(member for member in self.members if member.place == wanted)


def load_sweep(
    site: str, study: str | None, settings: tuple[str, ...], *, gridded: bool
) -> Sweep | None:
    """Read what a study sweeps over, and check every member.

    Parameters
    ----------
    gridded : bool, whether the product takes directions and frictions as grids
    """
    if study is None:
        return None
    layers = read_layers(site, study, settings)
    if layers.sweep is None:
        return None
    file = layers.files[-1][0]
    dimensions = _dimensions(layers, file, gridded=gridded)
    members = _members(layers, dimensions, file)
    dimensions = tuple(_referred(layers, dimensions, members))
    return Sweep(Path(file).stem, file, dimensions, members)


def _dimensions(layers: Layers, file: str, *, gridded: bool) -> tuple[Dimension, ...]:
    if not isinstance(layers.sweep, dict) or not layers.sweep:
        rule = "a sweep has named dimensions, each with keys and their values"
        raise InputError(Problem(file, "sweep", repr(layers.sweep), rule, EXAMPLE))
    found, before = [], dict[str, str]()
    for name, keys in layers.sweep.items():
        place = f"sweep.{name}"
        if not _NAME.fullmatch(str(name)):
            rule = (
                "a dimension's name has lower-case letters, digits and _ and begins with a letter"
            )
            raise InputError(Problem(file, place, repr(name), rule, "rename it"))
        if not isinstance(keys, dict) or not keys:
            rule = "a dimension has keys of the configuration and their values"
            raise InputError(Problem(file, place, repr(keys), rule, EXAMPLE))
        for key in keys:
            _check_key(layers, file, f"{place}.{key}", str(key), before)
            before[str(key)] = place
        values = {str(key): _values(file, f"{place}.{key}", given) for key, given in keys.items()}
        found.append(_dimension(str(name), values, file, gridded=gridded))
    count = math.prod(len(one.labels) for one in found if not one.gridded)
    if count > MOST_MEMBERS:
        rule = f"a sweep has at most {MOST_MEMBERS}, not counting directions and frictions"
        raise InputError(Problem(file, "sweep", f"{count} members", rule, "thin out its values"))
    return tuple(found)


def _dimension(
    name: str, values: dict[str, tuple[Any, ...]], file: str, *, gridded: bool
) -> Dimension:
    counts = {key: len(given) for key, given in values.items()}
    if len(set(counts.values())) > 1:
        said = ", ".join(f"{count} of {key}" for key, count in counts.items())
        rule = "all keys of one dimension need the same number of values"
        raise InputError(Problem(file, f"sweep.{name}", said, rule, "give equally many values"))
    places = list(zip(*values.values(), strict=True))
    if twice := [place for n, place in enumerate(places) if place in places[:n]]:
        given = ", ".join(map(_label, twice[0]))
        rule, remedy = "duplicate value", "give each value once"
        raise InputError(Problem(file, f"sweep.{name}", f"{given} twice", rule, remedy))
    grid = gridded and len(values) == 1 and next(iter(values)) in GRIDS
    numeric = all(_is_number(place[0]) for place in places)
    if name in TAKEN and not (numeric and [GRIDS.get(key) for key in values] == [name]):
        raise InputError(taken(file, name))
    return Dimension(name, values, _labels(places), 0, gridded=grid and numeric)


def taken(file: str, name: str) -> Problem:
    """What is wrong with a dimension that is called like something of a product."""
    given, rule = "a name that datasets have", "a dimension has a name of its own"
    return Problem(file, f"sweep.{name}", given, rule, f"rename it, e.g. swept_{name}")


def _check_key(layers: Layers, file: str, place: str, key: str, before: dict[str, str]) -> None:
    """Refuse a key that is also set elsewhere."""
    if not all(key.split(".")):
        raise InputError(Problem(file, place, repr(key), "invalid key", "e.g. contact.friction"))
    for other, there in before.items():
        if f"{key}.".startswith(f"{other}.") or f"{other}.".startswith(f"{key}."):
            given = f"{key} beside {other} in {there}"
            rule, remedy = "a key can change along one dimension only", "remove one of them"
            raise InputError(Problem(file, place, given, rule, remedy))
    told = [(file, layers.files[-1][1]), *(("--set", layer) for layer in layers.settings)]
    for source, layer in told:
        if not isinstance(_at(layer, key, {}), dict):
            given = f"{key} also in {'the study itself' if source == file else 'a setting'}"
            rule, remedy = "a swept key takes its values from the sweep", "remove one of them"
            raise InputError(Problem(file, place, given, rule, remedy))


def _values(file: str, place: str, given: Any) -> tuple[Any, ...]:
    """A list, a range, or one value."""
    if isinstance(given, dict) and set(given) == {"start", "stop", "num"}:
        try:
            return Range(**given).values()
        except ValidationError as error:
            rule = error.errors()[0]["msg"]
            raise InputError(Problem(file, place, repr(given), rule, "correct it")) from None
    values = tuple(given) if isinstance(given, list) else (given,)
    if not values:
        raise InputError(
            Problem(file, place, "", "a swept key needs at least one value", "give some")
        )
    return values


def _members(layers: Layers, dimensions: tuple[Dimension, ...], file: str) -> tuple[Member, ...]:
    """A member for each combination of places, all checked."""
    problems: dict[str, Problem] = {}
    members: list[Member] = []
    every = [list(enumerate(one.layers())) for one in dimensions]
    for places in itertools.product(*every):
        at = tuple(n for one, (n, _) in zip(dimensions, places, strict=True) if not one.gridded)
        name = _folder(dimensions, at, {member.name for member in members})
        try:
            site = layers.site(*(layer for _, part in places for layer in part))
        except InputError as error:
            problems |= {str(one): one for one in error.problems}
            continue
        members.append(Member(name, at, site))
    if problems:
        raise InputError(*problems.values())
    return tuple(members)


def _referred(
    layers: Layers, dimensions: tuple[Dimension, ...], members: tuple[Member, ...]
) -> Iterator[Dimension]:
    """The dimensions, each with the place at which the site itself is, or else the first."""
    try:
        own = layers.site().settings.model_dump(mode="json")
    except InputError:  # it may need what the sweep sets
        yield from dimensions
        return
    settings = {member.place: member.site.settings for member in members}
    first = members[0].place
    parted = [one.name for one in dimensions if not one.gridded]
    for one in dimensions:
        if one.gridded:
            places = [[[value]] for value in one.values[one.key]]
        else:
            at = parted.index(one.name)
            trees = (
                settings[(*first[:at], n, *first[at + 1 :])].model_dump(mode="json")
                for n in range(len(one.labels))
            )
            places = [[_at(tree, key) for key in one.values] for tree in trees]
        site = [_at(own, key) for key in one.values]
        yield replace(one, reference=places.index(site) if site in places else 0)


def _folder(dimensions: tuple[Dimension, ...], at: tuple[int, ...], taken: set[str]) -> str:
    """Name of a member's folder."""
    parted = [one for one in dimensions if not one.gridded]
    said = ",".join(f"{one.name}={one.labels[n]}" for one, n in zip(parted, at, strict=True))
    name = re.sub(r"[^A-Za-z0-9.,=+-]+", "_", said)[:80] or "all"
    numbered = (name, *(f"{name}-{n}" for n in range(2, MOST_MEMBERS + 2)))
    return next(one for one in numbered if one not in taken)


def _labels(places: list[tuple[Any, ...]]) -> tuple[str, ...]:
    """What to call each place: by its first value, numbered where several are called alike."""
    names = [_label(place[0]) for place in places]
    return tuple(
        f"{name} ({names[: n + 1].count(name)})" if names.count(name) > 1 else name
        for n, name in enumerate(names)
    )


def _label(value: Any) -> str:
    """A value in few words.

    >>> _label(0.25), _label([1, 1, 3]), _label([{"axis": "x"}, {"axis": "z", "share": 0.5}])
    ('0.25', '1 x 1 x 3', 'x, z 0.5')
    >>> _label({"kind": "record", "files": "a.csv"}), _label("m/s2"), _label(["a/b.csv", "c/"])
    ('record', 'm/s2', 'b.csv x c')
    """
    if isinstance(value, str) and re.search(r"/$|/[^/]*\.[^/]*$", value):  # a path
        return value.rstrip("/").rpartition("/")[2]
    if isinstance(value, dict):
        return str(value["kind"]) if "kind" in value else " ".join(map(_label, value.values()))
    if isinstance(value, list):
        inner = any(isinstance(item, dict | list) for item in value)
        return (", " if inner else " x ").join(map(_label, value))
    if isinstance(value, float):
        return f"{value:.12g}"
    return str(value).lower() if isinstance(value, bool) or value is None else str(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _at(tree: Any, key: str, missing: Any = None) -> Any:
    """Value of a dotted key; of a key beneath a value that is no section, that value."""
    for part in key.split("."):
        if not isinstance(tree, dict):
            return tree
        if part not in tree:
            return missing
        tree = tree[part]
    return tree
