"""What the options of the configuration are: JSON schemas for editors, and docs/options.md.

    python -m scripts.options            show what is out of date; exit code 1 if anything is
    python -m scripts.options --write    write it

All comes from the typed models and the values in configs/base.yaml.
"""

from __future__ import annotations

import difflib
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml
from pydantic import BaseModel, TypeAdapter

from pipeline import ROOT
from pipeline.config.layers import BASE
from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.config.schema import Config, TableConfig
from pipeline.inspection.answers import Answer

Node = dict[str, Any]

INTRODUCTION = """# Options

Made by `make options` from the models in `pipeline/config/`; do not edit.

A site's YAML holds only what differs from `configs/base.yaml`; a study (`STUDY=`) and settings
(`SET='motion.pga.num=100'`) override it, in this order. A study may also
sweep over values of any key ([studies](studies.md)). An editor with a YAML language server
completes and checks these keys by the first line of every file in `configs/`.

A *range* is `{start: 0.1, stop: 1.0, num: 10}`: evenly spaced values, both ends included. Defaults
are those of `configs/base.yaml` where it states one.

## Sites and studies
"""

HARDWARE = """## Shake tables of hardware

Keys of the files in `configs/tables/`, for `make feasible`.
"""

RECORDED = """## Recorded shake-table tests

Keys of `table.yaml` in the folder given to `make validate TABLE=`.
"""

_UNIT = re.compile(r" \[([^\[\]]+)\]$")
"""Unit at the end of a description."""

COLUMNS = ("key", "type", "unit", "limits", "default", "meaning")

PLURAL = {
    "number": "numbers",
    "whole number": "whole numbers",
    "text": "texts",
    "section": "sections",
}
PLURAL |= {"2 numbers": "pairs of numbers"}


def main() -> int:
    """Compare the files with the models, or write them."""
    stale = 0
    for name, text in files().items():
        path = ROOT / name
        old = path.read_text(encoding="utf-8") if path.exists() else ""
        if old == text:
            continue
        if "--write" in sys.argv[1:]:
            path.write_text(text, encoding="utf-8")
            continue
        stale = 1
        lines = old.splitlines(keepends=True), text.splitlines(keepends=True)
        sys.stdout.writelines(difflib.unified_diff(*lines, name, "the models"))
    if stale:
        sys.stdout.write("out of date; `make options` writes it anew\n")
    return stale


def files() -> dict[str, str]:
    """Contents of every generated file, by its path below the root."""
    base = yaml.safe_load(BASE.read_text(encoding="utf-8"))
    site, hardware = schema(Config, base), schema(TableConfig)
    recorded = schema(ShakeTableConfig)
    parts = [INTRODUCTION, *sections(site), HARDWARE, *sections(hardware)]
    parts += [RECORDED, *sections(recorded)]
    return {
        "docs/options.md": "\n".join(parts),
        "pipeline/inspection/answers.schema.json": as_json(TypeAdapter(Answer).json_schema()),
        "configs/schema.json": layered(with_sweep(site)),
        "configs/tables/schema.json": as_json(hardware),
        "configs/tests/double_rock_prints/schema.json": as_json(recorded),
    }


# Schemas ------------------------------------------------------------------------------------------


def schema(model: type[BaseModel], base: Node | None = None) -> Node:
    """JSON schema of a model, with the defaults of a base configuration."""
    made = model.model_json_schema()
    for node in nodes(made):
        node.pop("title", None)
        node.pop("discriminator", None)
        if "oneOf" in node:  # kinds: a layer need not repeat which
            node["anyOf"] = node.pop("oneOf")
    set_defaults(made, made, base or {})
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **made}


def nodes(node: Any) -> Iterator[Node]:
    """All schemas in a schema."""
    if isinstance(node, dict):
        for name, inner in node.items():
            held = inner.values() if name in ("properties", "$defs") else [inner]
            for item in held:
                yield from nodes(item)
        yield node
    elif isinstance(node, list):
        for item in node:
            yield from nodes(item)


def set_defaults(root: Node, node: Node, values: Node) -> None:
    """State a base configuration's values as defaults."""
    for name, value in values.items():
        held = node["properties"][name]
        inner = [one for one in members(root, held) if "properties" in one and not is_range(one)]
        if isinstance(value, dict) and inner:
            kind = value.get("kind")
            of_kind = [one for one in inner if kind in (None, kind_of(one))]
            set_defaults(root, of_kind[0], value)
        else:
            held["default"] = value
            node["required"] = [key for key in node.get("required", ()) if key != name]


def layered(root: Node) -> str:
    """The schema of one layer, in which every key may be left to the others."""
    copy = json.loads(json.dumps(root))
    waiting = [copy]
    while waiting:
        node = waiting.pop()
        node.pop("required", None)
        for held in node["properties"].values():
            waiting += [one for one in members(copy, held) if "properties" in one]
    return as_json(copy)


def with_sweep(root: Node) -> Node:
    """The schema with what only studies have."""
    values = {"description": "a list of values, a range, or one value"}
    dimension = {"type": "object", "minProperties": 1, "additionalProperties": values}
    sweep = {
        "description": "named dimensions of keys and their values; see docs/studies.md",
        "type": "object",
        "minProperties": 1,
        "additionalProperties": dimension,
    }
    return root | {"properties": root["properties"] | {"sweep": sweep}}


def as_json(root: Node) -> str:
    """Text of a schema's file."""
    return json.dumps(root, indent=2, ensure_ascii=False) + "\n"


def members(root: Node, node: Node) -> list[Node]:
    """What a value may be, one schema each, with references followed."""
    if "$ref" in node:
        return members(root, root["$defs"][node["$ref"].rsplit("/", 1)[-1]])
    if "anyOf" in node:
        return [one for item in node["anyOf"] for one in members(root, item)]
    return [node]


def is_range(node: Node) -> bool:
    """Whether it is {start, stop, num}."""
    return set(node.get("properties", ())) == {"start", "stop", "num"}


def kind_of(node: Node) -> str | None:
    """Value of a section's ``kind``, if it has one."""
    kind: str | None = node["properties"].get("kind", {}).get("const")
    return kind


# The page -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """A key in a table."""

    key: str
    kind: str
    unit: str
    limits: str
    default: str
    meaning: str

    def __str__(self) -> str:
        cells = (f"`{self.key}`", self.kind, self.unit, self.limits, self.default, self.meaning)
        return "| " + " | ".join(cells) + " |"


def sections(root: Node, node: Node | None = None, path: str = "") -> Iterator[str]:
    """A table of the keys of a section, then of the sections within it."""
    node = node or root
    rows, inner = [], []
    for name, held in node["properties"].items():
        key = f"{path}.{name}" if path else name
        is_a = members(root, held)
        lists = [one for one in is_a if "items" in one]
        within = [one for one in is_a if "properties" in one and not is_range(one)]
        inner += [(key, one) for one in within]
        inner += [
            (f"{key}[]", one)
            for item in lists
            for one in members(root, item["items"])
            if "properties" in one
        ]
        is_kind = name == "kind" and kind_of(node)  # it stands in the heading
        if not is_kind and (len(is_a) > len(within) or _UNIT.search(held["description"])):
            rows.append(_row(name, held, is_a, name in node.get("required", ())))
    if path:
        kind = kind_of(node)
        yield f"### `{path}`" + (f", kind `{kind}`" if kind else "") + "\n"
        yield node["description"] + "\n"
    head = ["| " + " | ".join(COLUMNS) + " |", "| " + " | ".join("---" for _ in COLUMNS) + " |"]
    yield "\n".join([*head, *map(str, rows)]) + "\n"
    for key, one in inner:
        yield from sections(root, one, key)


def _row(name: str, held: Node, is_a: list[Node], required: bool) -> Row:
    meaning = held["description"]
    unit = _UNIT.search(meaning)
    if unit:
        meaning = meaning[: unit.start()]
    kinds = list(dict.fromkeys(_kind(one) for one in is_a))
    limits = list(dict.fromkeys(filter(None, map(_limits, is_a))))
    default = "required" if required else f"`{_flow(held['default'])}`"
    return Row(
        name, " or ".join(kinds), unit[1] if unit else "", ", ".join(limits), default, meaning
    )


def _kind(node: Node) -> str:
    if "enum" in node:
        return ", ".join(f"`{value}`" for value in node["enum"])
    if "const" in node:
        return f"`{node['const']}`"
    if "properties" in node:
        return "range" if is_range(node) else "section"
    if "prefixItems" in node:
        return f"{len(node['prefixItems'])} numbers"
    if "items" in node:
        item = _kind(node["items"]) if "type" in node["items"] else "section"
        return f"list of {PLURAL.get(item, item)}"
    kind: str = node["type"]
    return {"integer": "whole number", "string": "text", "boolean": "true, false"}.get(kind, kind)


def _limits(node: Node) -> str:
    node = node.get("prefixItems", [node])[0]
    node = node.get("items", node)
    if "minimum" in node and "maximum" in node:
        return f"{_number(node['minimum'])} to {_number(node['maximum'])}"
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    return ", ".join(
        f"{sign} {_number(node[name])}" for name, sign in signs.items() if name in node
    )


def _number(value: float) -> str:
    return f"{int(value):,}" if value == int(value) and abs(value) < 1e6 else f"{value:g}"


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(one)}" for key, one in value.items()) + "}"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value).strip('"')


if __name__ == "__main__":
    sys.exit(main())
