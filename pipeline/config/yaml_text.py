"""Text of YAML as plain values: read as YAML 1.2 does, and of bounded size and depth."""

from __future__ import annotations

import json
import re
from typing import Any

import yaml

LONGEST = 256 * 1024
"""Characters of a text. The longest site here has 1,500."""

MOST_VALUES = 20_000
"""Values in a text, those behind an alias counted each time: a few hundred bytes of aliases to
aliases stand for more values than memory holds."""

DEEPEST = 20
"""Sections in sections: a configuration has five."""

MOST_DIGITS = 300
"""Digits of a whole number: with a few more it is beyond all floating-point numbers."""


class _Loader(yaml.SafeLoader):
    """Safe loader that refuses a key given twice and reads plain values as YAML 1.2 does.

    YAML 1.1 takes 030 for 24, 1e-3 for text, 1:30 for 90, `no` for a number that is 0,
    2020-01-01 for a date, and << for no key.
    """

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = self._values = 0
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose as the base class does, counting values."""
        self._depth += 1
        before = self._values
        if self._depth > DEEPEST:
            raise yaml.YAMLError(f"more than {DEEPEST} sections in each other{self._line()}")
        tag = getattr(self.peek_event(), "tag", None)
        node = super().compose_node(parent, index)
        if tag is not None and node is not None:
            self._check_tag(node)
        self._values += self._sizes.get(id(node), 1)
        if self._values > MOST_VALUES:
            raise yaml.YAMLError(f"more than {MOST_VALUES} values{self._line()}")
        self._sizes.setdefault(id(node), self._values - before)
        self._depth -= 1
        return node

    def _check_tag(self, node: yaml.Node) -> None:
        """Refuse a tag that makes of a value what it would not be without."""
        is_plain = getattr(node, "style", None) is None
        if node.tag != self.resolve(type(node), node.value, (is_plain, not is_plain)):
            tag = node.tag.removeprefix("tag:yaml.org,2002:")
            raise yaml.YAMLError(f"a value that is no {tag} has that tag{self._line()}")

    def _line(self) -> str:
        return f", line {self.line + 1}"


_Loader.yaml_implicit_resolvers = {
    first: [
        (tag, rule)
        for tag, rule in rules
        if not tag.endswith((":int", ":float", ":bool", ":timestamp", ":merge"))
    ]
    for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _kind, _rule, _first in (
    ("int", r"[-+]?[0-9]+", "-+0123456789"),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan",
        "-+.0123456789",
    ),
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
):
    _Loader.add_implicit_resolver(
        f"tag:yaml.org,2002:{_kind}", re.compile(f"(?:{_rule})$"), list(_first)
    )


def _integer(loader: _Loader, node: yaml.ScalarNode) -> int:
    digits = loader.construct_scalar(node)
    if len(digits) > MOST_DIGITS:
        line = node.start_mark.line + 1
        raise yaml.YAMLError(f"a number of {len(digits)} digits, line {line}")
    return int(digits)


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    keys: list[Any] = []
    for place, _ in node.value:
        key = loader.construct_object(place)
        if not isinstance(place, yaml.ScalarNode) or key in keys:
            what = "is no name" if not isinstance(place, yaml.ScalarNode) else "twice"
            raise yaml.YAMLError(f"key {key!r} {what}, line {place.start_mark.line + 1}")
        keys.append(key)
    return {
        loader.construct_object(key, deep=True): loader.construct_object(value, deep=True)
        for key, value in node.value
    }


_Loader.add_constructor("tag:yaml.org,2002:int", _integer)
_Loader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


def parse(text: str) -> Any:
    """Plain values of a text.

    Examples
    --------
    >>> parse("yaw: [030, 1e1]")
    {'yaw': [30, 10.0]}
    """
    if len(text) > LONGEST:
        raise ValueError(f"more than {LONGEST} characters")
    try:
        return yaml.load(text, _Loader)  # noqa: S506 (safe subclass)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from None


_ESCAPED = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff\ud800-\udfff]")
"""What YAML takes for the end of a line, or refuses; of no letter with a pair of escapes in JSON,
which YAML takes for two."""


def in_yaml(value: Any, indent: int | None = None) -> str:
    """JSON that says the same in YAML."""
    text = json.dumps(value, indent=indent, ensure_ascii=False)
    return _ESCAPED.sub(lambda one: f"\\u{ord(one[0]):04x}", text)
