"""What the text of a module says for digests of code: its definitions, and what each mentions.

Reading it off the syntax trees of all modules takes a second, so it is kept as Python keeps
bytecode: in ``__pycache__``, and not where Python is told to write none. A fact is known by the
module's whole text, so that one of another text is never taken.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

_FILE = Path(importlib.util.cache_from_source(__file__)).with_suffix(".json")

_new: set[str] = set()
"""Modules whose text was read in this process."""


class Facts(NamedTuple):
    """What a module's text says.

    Attributes
    ----------
    definitions : dict
        From the name of each top-level definition to its digest, without docstrings, and to the
        names in it that may stand for other definitions: ``"name"`` or ``"module.name"``.
    """

    definitions: dict[str, tuple[str, list[str]]]
    imports: list[tuple[str, str, str]]


def of(module: str, text: bytes) -> Facts:
    """What a module's text says."""
    own = _digest(_reader() + text)
    known, *given = _kept().get(module, ("",))
    if known != own:
        given = [*_parsed(text)]
        _kept()[module] = own, *given
        _new.add(module)
    return Facts(*given)


def keep() -> None:
    """Write what was read off texts in this process, for the next one."""
    if not _new or sys.dont_write_bytecode:
        return
    _new.clear()
    part = _FILE.with_name(f".{_FILE.name}-{os.getpid()}")
    with suppress(OSError):  # as Python goes on where it cannot write bytecode
        part.write_text(json.dumps(_kept()), encoding="utf-8")
        part.replace(_FILE)


@cache
def _kept() -> dict[str, Any]:
    """By a module's name: the digest of its text, and its facts."""
    try:
        return dict(json.loads(_FILE.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return {}


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


@cache
def _reader() -> bytes:
    """What facts depend on besides the text: this module, and Python's own syntax trees."""
    return Path(__file__).read_bytes() + sys.version.encode()


def _parsed(text: bytes) -> Facts:
    tree = _WithoutText().visit(ast.parse(text))
    imports = list(_imports(tree))
    nodes: dict[str, list[ast.stmt]] = {}
    for node in tree.body:
        for defined in _defined(node):
            nodes.setdefault(defined, []).append(node)
    local = {*nodes, *(name for name, _, _ in imports)}
    return Facts(
        {
            name: (
                _digest("\n".join(map(ast.dump, parts)).encode()),
                sorted({name for node in parts for name in _mentions(node, local)}),
            )
            for name, parts in nodes.items()
        },
        imports,
    )


def _defined(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.AsyncFunctionDef)):
        yield node.name
    elif isinstance(node, ast.Assign):
        for target in node.targets:
            yield from (n.id for n in ast.walk(target) if isinstance(n, ast.Name))
    elif isinstance(node, (ast.AnnAssign, ast.AugAssign)) and isinstance(node.target, ast.Name):
        yield node.target.id


def _imports(tree: ast.Module) -> Iterator[tuple[str, str, str]]:
    """All imports, those inside functions too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.asname or alias.name, alias.name, ""
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                yield alias.asname or alias.name, node.module, alias.name


def _mentions(top: ast.stmt, local: set[str]) -> Iterator[str]:
    """Names, and attributes of names, that this module defines or imports."""
    for node in ast.walk(top):
        if isinstance(node, ast.Name) and node.id in local:
            yield node.id
        elif isinstance(node, ast.Attribute):
            base = _dotted(node.value)
            if base in local:
                yield f"{base}.{node.attr}"


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
