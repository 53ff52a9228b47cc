"""What the parameters of a stage's function stand for, read off its annotations.

Nothing is imported for it: annotations are resolved as digests of code are. A parameter is

- a section of the configuration, by its class, or one key: ``Annotated[float, Key("...")]``;
- the product of a stage, by its class; ``| None`` where the stage may not apply, and
  ``Later[...]`` where the function begins before it is made;
- files or another input, by the class of what finds them;
- the ``Work`` of the stage, or the ``Origin`` of its settings, which are no part of its key;
- a class whose fields are such parameters.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from functools import cache, cached_property
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel

from pipeline.config.sections import IN_KEYS
from pipeline.workflow.grammar import counted
from vsr_core.source import tracing

T = TypeVar("T")

Later = Callable[[], T]
"""A product that is waited for when it is called for."""


class Setting(NamedTuple):
    """A section of the configuration, or a key of it."""

    key: str


class Made(NamedTuple):
    """The product of a stage, by the path of its class."""

    product: str
    late: bool = False


class Given(NamedTuple):
    """What is no part of a key: by the path of its class."""

    what: str


class Parts(NamedTuple):
    """A class, or the function of a stage, with what its parameters stand for."""

    path: str
    asked: Mapping[str, Asked]

    def each(self) -> Iterator[Setting | Made | Given]:
        """All that is asked for, that of classes too."""
        for one in self.asked.values():
            if isinstance(one, Parts):
                yield from one.each()
            else:
                yield one


Asked = Setting | Made | Given | Parts

WORK, ORIGIN = "pipeline.workflow.stage:Work", "pipeline.config.layers:Origin"

_CONFIG = "pipeline.config.schema:Config"


def of(path: str, products: frozenset[str]) -> Parts:
    """What a function or class asks for.

    Parameters
    ----------
    path : str, ``"package.module:name"``
    products : set of str, paths of the classes of what stages make and inputs find
    """
    module = path.partition(":")[0]
    texts = tracing.parts_of(path)
    asked = {name: _asked(module, text, products) for name, text in texts.items()}
    return Parts(path, asked)


def _asked(module: str, text: str, products: frozenset[str]) -> Asked:
    node = ast.parse(text, mode="eval").body
    if isinstance(node, ast.BinOp):  # ... | None
        node = node.left
    late = False
    if isinstance(node, ast.Subscript):
        known = ast.unparse(node.value)
        if known == "Annotated":
            return Setting(_key(node))
        if known == "Later":
            node, late = node.slice, True
            node = node.left if isinstance(node, ast.BinOp) else node
    path = tracing.meant(module, ast.unparse(node))
    if path in products:
        return Made(path, late)
    if path in _sections():
        return Setting(_sections()[path])
    if path in (WORK, ORIGIN):
        return Given(path)
    if not path or not tracing.parts_of(path):
        raise TypeError(f"{module}: a stage cannot be given {text}")
    return of(path, products)


def _key(node: ast.Subscript) -> str:
    """The dotted key in ``Annotated[..., Key("...")]``."""
    assert isinstance(node.slice, ast.Tuple)
    call = node.slice.elts[1]
    assert isinstance(call, ast.Call)
    assert isinstance(call.args[0], ast.Constant)
    return str(call.args[0].value)


@cache
def _sections() -> dict[str, str]:
    """Sections of the configuration by the paths of their classes."""
    module = _CONFIG.partition(":")[0]
    found = {}
    for name, text in tracing.parts_of(_CONFIG).items():
        path = tracing.meant(module, text.removesuffix(" | None"))
        if path.startswith("pipeline.config."):
            found[path] = name
    return found


class Values:
    """The settings of a site by dotted key: what functions are given, and what keys hold of it."""

    def __init__(self, settings: BaseModel) -> None:
        self._settings = settings

    @cached_property
    def tree(self) -> dict[str, Any]:
        """All of them."""
        return self._settings.model_dump(mode="json", context=IN_KEYS)

    def holds(self, key: str) -> bool:
        """Whether it is one of their keys."""
        return hasattr(self._settings, key.partition(".")[0])

    def plain(self, key: str) -> Any:
        """A section, a value, or a property of the configuration, as plain data."""
        if key.partition(".")[0] in self.tree:
            found: Any = self.tree
            for part in key.split("."):
                found = found[part]
            return found
        value = getattr(self._settings, key)
        if isinstance(value, BaseModel):
            return value.model_dump(mode="json", context=IN_KEYS)
        return value

    def given(self, key: str) -> Any:
        """The same as a function takes it; None for a section that counts for nothing."""
        if self.plain(key) == {}:
            return None
        found: Any = self._settings
        for part in key.split("."):
            found = getattr(found, part)
        return found


def changes(old: dict[str, Any], new: dict[str, Any]) -> Iterator[str]:
    """Which settings, by dotted key, are others, in words.

    >>> list(changes({"cut": {"depth": 1.0}}, {"cut": None}))
    ['cut.depth changed: 1.0 is now None']
    """
    was, now = dict(_leaves(old)), dict(_leaves(new))
    for key in sorted({*was, *now}):  # of a section that is left out now, only the old are known
        if was.get(key) != now.get(key):
            yield f"{key} changed: {_change(was.get(key), now.get(key))}"


def _leaves(tree: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Values of a configuration by dotted key."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _change(old: Any, new: Any) -> str:
    if isinstance(old, list) and isinstance(new, list) and max(len(old), len(new)) > 3:
        before, after = (set(map(str, values)) for values in (old, new))
        return f"{counted(len(after - before), 'value')} added, {len(before - after)} removed"
    return f"{old!r} is now {new!r}"
