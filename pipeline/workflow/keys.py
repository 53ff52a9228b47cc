"""Digests: of values, of files, and of the first-party code that a result depends on.

The code digest follows names, not files: from a stage's root functions to every top-level
definition they mention, through imports, in ``vsr_core`` and ``pipeline``. Each is digested by
its syntax tree without docstrings, so a comment or a function that is not used changes nothing.
A call through a variable cannot be followed; what is reached that way is named as a root.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pipeline import ROOT

PACKAGES = ("vsr_core", "pipeline")
_SIZE = 16


def digest(value: Any) -> str:
    """Digest of plain data by its canonical JSON; refuses NaN and what JSON cannot hold.

    Parameters
    ----------
    value : numbers, texts, and lists and dicts of them

    Returns
    -------
    str

    Examples
    --------
    The order of keys does not count:

    >>> digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    True
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.blake2b(text.encode(), digest_size=_SIZE).hexdigest()


def digest_bytes(*parts: bytes) -> str:
    """Digest of byte strings, each with its length.

    Returns
    -------
    str

    Examples
    --------
    Where one ends counts:

    >>> digest_bytes(b"ab", b"c") == digest_bytes(b"a", b"bc")
    False
    """
    state = hashlib.blake2b(digest_size=_SIZE)
    for part in parts:
        state.update(len(part).to_bytes(8, "little"))
        state.update(part)
    return state.hexdigest()


def digest_file(path: Path) -> str:
    """SHA-256 of a file's content.

    Parameters
    ----------
    path : Path

    Returns
    -------
    str
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def installed_version(name: str) -> str:
    """Version of a library, or that it is not installed: an engine may be an extra.

    Parameters
    ----------
    name : str, as it is installed

    Returns
    -------
    str
    """
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def code(roots: Iterable[str]) -> dict[str, str]:
    """Digest of every definition that ``roots`` reach.

    Parameters
    ----------
    roots : iterable of str
        ``"package.module:name"``; a whole class counts as one definition.

    Returns
    -------
    dict
        From ``"package.module:name"`` to the digest of that definition.
    """
    found: dict[str, str] = {}
    waiting = list(roots)
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found[name], mentioned = _definition(name)
        waiting.extend(mentioned)
    return dict(sorted(found.items()))


@cache
def _definition(name: str) -> tuple[str, tuple[str, ...]]:
    """Digest of one definition, and the first-party definitions it mentions."""
    module, _, definition = name.partition(":")
    parsed = _parse(module)
    nodes = parsed.definitions[definition]
    own = digest_bytes(*(ast.dump(node).encode() for node in nodes))
    return own, tuple(_mentions(parsed, nodes))


@dataclass(frozen=True)
class _Module:
    name: str
    definitions: dict[str, list[ast.stmt]]
    imports: dict[str, str]  # local name -> "module" or "module:name"


@cache
def _parse(name: str) -> _Module:
    path = _path(name)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    tree = _WithoutText().visit(tree)
    definitions: dict[str, list[ast.stmt]] = {}
    for node in tree.body:
        for defined in _defined(node):
            definitions.setdefault(defined, []).append(node)
    return _Module(name, definitions, dict(_imports(tree)))


def _path(module: str) -> Path:
    base = ROOT.joinpath(*module.split("."))
    return base / "__init__.py" if base.is_dir() else base.with_suffix(".py")


def _is_module(name: str) -> bool:
    return name.split(".")[0] in PACKAGES and _path(name).is_file()


def _defined(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.AsyncFunctionDef)):
        yield node.name
    elif isinstance(node, ast.Assign):
        for target in node.targets:
            yield from (n.id for n in ast.walk(target) if isinstance(n, ast.Name))
    elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        yield node.target.id


def _imports(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """First-party imports, those inside functions too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if _is_module(alias.name):
                    yield (alias.asname or alias.name, alias.name)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                local, inner = alias.asname or alias.name, f"{node.module}.{alias.name}"
                if _is_module(inner):
                    yield local, inner
                elif _is_module(node.module):
                    yield local, f"{node.module}:{alias.name}"


def _mentions(module: _Module, nodes: list[ast.stmt]) -> Iterator[str]:
    for top in nodes:
        for node in ast.walk(top):
            if isinstance(node, ast.Name):
                if node.id in module.definitions:
                    yield f"{module.name}:{node.id}"
                elif ":" in module.imports.get(node.id, ""):
                    yield from _resolved(module.imports[node.id])
            elif isinstance(node, ast.Attribute):
                target = module.imports.get(_dotted(node.value), "")
                if target and ":" not in target:
                    yield from _resolved(f"{target}:{node.attr}")


def _resolved(name: str) -> Iterator[str]:
    """A definition by the module that holds it, past re-exports."""
    module, _, definition = name.partition(":")
    parsed = _parse(module)
    if definition in parsed.definitions:
        yield name
    elif ":" in parsed.imports.get(definition, ""):
        yield from _resolved(parsed.imports[definition])


def _dotted(node: ast.expr) -> str:
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return f"{_dotted(node.value)}.{node.attr}"
    return ""


class _WithoutText(ast.NodeTransformer):
    """Takes strings away that stand alone: they are docstrings."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        return None if _is_text(node) else node


def _is_text(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
