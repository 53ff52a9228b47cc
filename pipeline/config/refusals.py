"""What pydantic refuses, as one line that says where it stands and what to write instead."""

from __future__ import annotations

import difflib
from types import NoneType
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from pipeline.config.problems import Problem
from pipeline.config.schema import Config
from pipeline.config.sections import Refused
from vsr_core.errors import InvalidInput

Known = TypeVar("Known")

RENAMED = {
    "area": "deposit_area",
    "found": "observed_boulder",
    "identity": "association_probability",
    "least_survival": "minimum_survival_probability",
    "length": "correlation_length",
    "mixing": "replica_fraction",
    "near": "point_on_rock",
    "place": "position",
    "reversed_share": "polarity_reversal_probability",
    "share": "pga_ratio",
    "sigma": "position_sd",
}
"""Former names of keys, and those of today."""


def problems(
    error: ValidationError,
    origin: dict[tuple[str, ...], str],
    site: str,
    root: type[BaseModel] = Config,
) -> list[Problem]:
    """What is wrong with each value; of a list only what is wrong with its items, if they are."""
    found = error.errors()
    around = {one["loc"][:length] for one in found for length in range(len(one["loc"]))}
    return [problem(one, origin, site, root) for one in found if one["loc"] not in around]


def problem(
    error: Any, origin: dict[tuple[str, ...], str], site: str, root: type[BaseModel] = Config
) -> Problem:
    """Say what is wrong with a value.

    Parameters
    ----------
    origin : dict, from the parts of a key to where its value stands
    """
    place, models = _walk(error["loc"], root)
    given: Any = error["input"]
    refused = error.get("ctx", {}).get("error")
    if error["type"] == "union_tag_invalid":
        place, models = (*place, "kind"), [*models, None]
        given = error["ctx"]["tag"]
    if isinstance(refused, Refused) and refused.key:
        keys = refused.key.split()
        last = [key for key in keys if origin.get((*place, key)) == origin.get(place)]
        key = (last or keys)[0]
        place, given = (*place, *key.split(".")), _of(given, key)
    source = nearest(origin, place) or site
    key = ".".join(place)
    if error["type"] == "extra_forbidden":
        if having := _kinds_with(place):
            rule = f"only {place[-2]}.kind {', '.join(having)} has this key"
            return Problem(source, key, "", rule, "leave it out, or set that kind")
        names = list(models[-1].model_fields) if models[-1] else ["start", "stop", "num"]
        return Problem(source, key, "", "unknown key", _instead(place[-1], names))
    if error["type"] == "missing":
        return Problem(source, key, "", "required key not given", _description(place, models))
    if isinstance(refused, InvalidInput):
        return Problem(source, key, refused.given, refused.rule, refused.remedy)
    given = repr(given)
    if isinstance(refused, Refused):
        return Problem(source, key, refused.given or given, refused.rule, refused.remedy)
    if error["type"] == "union_tag_invalid":
        kinds = f"it is one of {error['ctx']['expected_tags']}"
        return Problem(source, key, given, kinds, "correct it")
    rule = error["msg"][0].lower() + error["msg"][1:]
    return Problem(source, key, given, rule, _description(place, models))


def _of(section: Any, key: str) -> Any:
    """A key's value in what was given for its section."""
    return section.get(key) if isinstance(section, dict) else getattr(section, key, section)


def _instead(name: str, names: list[str]) -> str:
    """What to write in place of an unknown key, such as ``a:1``, which YAML takes for a name."""
    if ":" in name:
        return "put a blank after its colon"
    if RENAMED.get(name) in names:
        return f"renamed to {RENAMED[name]}"
    near = difflib.get_close_matches(name, names, 1)
    return f"did you mean {near[0]}?" if near else f"the keys here are {', '.join(names)}"


def nearest(origin: dict[tuple[str, ...], Known], place: tuple[str, ...]) -> Known | None:
    """What is known of a key, or else of the nearest section above it.

    Examples
    --------
    >>> nearest({("motion",): "site.yaml", ("motion", "pga"): "--set"}, ("motion", "files"))
    'site.yaml'
    """
    above = (place[:n] for n in range(len(place), 0, -1))
    return next((origin[part] for part in above if part in origin), None)


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


def _kinds_with(place: tuple[str, ...]) -> list[str]:
    """Kinds of the section around a key that have it."""
    _, models = _walk(place[:-1], Config)
    field = models[-1].model_fields.get(place[-2]) if models and models[-1] else None
    found = _inner(field.annotation) if field else None
    if not isinstance(found, dict):
        return []
    return [kind for kind, model in found.items() if place[-1] in model.model_fields]


def is_section(place: tuple[str, ...]) -> bool:
    """Whether a key of the configuration holds other keys and nothing else.

    >>> is_section(("uncertainty",)), is_section(("motion", "pga")), is_section(("yaw",))
    (True, False, False)
    """
    _, models = _walk(place, Config)
    field = models[-1].model_fields.get(place[-1]) if models[-1] else None
    return field is not None and all(map(_is_model, _members(field.annotation)))


def _members(annotation: Any) -> list[Any]:
    """Types of a union, or the one type that it is."""
    parts = get_args(annotation)
    return [one for part in parts for one in _members(part)] if parts else [annotation]


def _is_model(member: Any) -> bool:
    return member is NoneType or (isinstance(member, type) and issubclass(member, BaseModel))


def _description(place: tuple[str, ...], models: list[type[BaseModel] | None]) -> str:
    for name, model in zip(reversed(place), reversed(models), strict=True):
        field = model.model_fields.get(name) if model else None
        if field and field.description:
            return f"expected: {field.description}"
    return f"correct it in the {'file' if models and Config not in models else 'configuration'}"


def meaning(key: str) -> tuple[str, str]:
    """What a key of the configuration means, and its unit.

    >>> meaning("contact.restitution")
    ('coefficient of normal restitution of the pair', '1')
    >>> meaning("motion.kind")
    ('motion.kind', '1')
    """
    place, models = _walk(tuple(key.split(".")), Config)
    field = models[-1].model_fields.get(place[-1]) if models[-1] else None
    if field is None or field.description is None or ".".join(place) != key:
        return key, "1"
    text, _, unit = field.description.rpartition(" [")
    return (text, unit.rstrip("]")) if text else (field.description, "1")
