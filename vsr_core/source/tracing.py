"""The definitions of this project that others reach, and their digests.

Names are followed, not files: from root functions to every top-level definition they mention,
through imports. Each is digested by its syntax tree without docstrings, so a comment or a function
that is not used changes nothing. A call through a variable cannot be followed; what is reached
that way is named as a root.

Texts are read together, before what they define is imported, and count from then on: what a process
computes with is what they said. Reading all syntax trees takes a second, so what they say is kept
as Python keeps bytecode: in ``__pycache__``, known by the module's whole text, and not where Python
is told to write none.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
"""The folder of the packages."""

PACKAGES = ("vsr_core", "pipeline")
"""Those whose source is followed: the project's own."""


def reached(roots: Iterable[str]) -> dict[str, str]:
    """Digest of every definition that some definitions reach, themselves included.

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
    keep_facts()
    return dict(sorted(found.items()))


def by_now(names: Iterable[str]) -> dict[str, str]:
    """Digests of those of some definitions that are still there, by what their files say by now."""
    parted = [name.partition(":") for name in names]
    there = {module: _there(module) for module in {module for module, _, _ in parted}}
    return {
        f"{module}:{name}": there[module][name][0]
        for module, _, name in parted
        if name in there[module]
    }


def _there(module: str) -> dict[str, tuple[str, list[str]]]:
    """Definitions in the file of a module by now; none where it is gone or no Python."""
    text = _by_now(module)
    with suppress(SyntaxError):
        same = text == texts()[module]
        return (_parse(module) if same else facts_of(module, text)).definitions
    return {}


def edited() -> list[str]:
    """Modules whose files are gone by now, or say something else."""
    return [module for module, text in texts().items() if _by_now(module) != text]


def _by_now(module: str) -> bytes:
    with suppress(OSError):
        return _files(ROOT)[module].read_bytes()
    return b""


def users(module: str, names: Iterable[str]) -> Iterator[str]:
    """The definitions that mention one of some names, imported from the module that defines it."""
    wanted, line = {f"{module}:{name}" for name in names}, f"from {module} import ".encode()
    for other, text in texts().items():
        if line not in text:
            continue
        parsed = _parse(other)
        local = {name for name, meant in parsed.imports.items() if meant in wanted}
        for definition, (_, mentioned) in parsed.definitions.items():
            if not local.isdisjoint(mentioned):
                yield f"{other}:{definition}"


def parts_of(name: str) -> dict[str, str]:
    """Parameters of a function, or fields of a class, with the text of their annotations."""
    module, _, definition = name.partition(":")
    return dict(_parse(module).parts.get(definition, ()))


def meant(module: str, name: str) -> str:
    """The definition that a name in a module stands for; empty where it is not the project's."""
    return next(_meant(module, _parse(module), name), "")


@cache
def _definition(name: str) -> tuple[str, tuple[str, ...]]:
    """Digest of one definition, and the first-party definitions it mentions."""
    module, _, definition = name.partition(":")
    parsed = _parse(module)
    own, mentioned = parsed.definitions[definition]
    return own, tuple(found for text in mentioned for found in _meant(module, parsed, text))


@dataclass(frozen=True)
class _Module:
    definitions: dict[str, tuple[str, list[str]]]
    imports: dict[str, str]  # local name -> "module" or "module:name"
    parts: dict[str, list[tuple[str, str]]]


@cache
def _parse(name: str) -> _Module:
    files = _files(ROOT)
    read = facts_of(name, texts()[name])
    imports = {}
    for local, module, inner in read.imports:
        if f"{module}.{inner}" in files:
            imports[local] = f"{module}.{inner}"
        elif module in files:
            imports[local] = f"{module}:{inner}" if inner else module
    return _Module(read.definitions, imports, read.parts)


def texts() -> dict[str, bytes]:
    """Texts of all first-party modules, by their names, as they were when first asked for."""
    return _texts(ROOT)


@cache
def _texts(root: Path) -> dict[str, bytes]:
    return {name: path.read_bytes() for name, path in _files(root).items()}


@cache
def _files(root: Path) -> dict[str, Path]:
    """Files of all first-party modules, by the modules' names."""
    found = (path for package in PACKAGES for path in (root / package).rglob("*.py"))
    # an editor may hold a place by a link to nowhere, whose name begins with a dot
    modules = (path for path in found if path.name[0] != "." and path.is_file())
    names = {path: path.relative_to(root).with_suffix("").parts for path in modules}
    return {".".join(n[:-1] if n[-1] == "__init__" else n): path for path, n in names.items()}


def _meant(name: str, module: _Module, mentioned: str) -> Iterator[str]:
    """The definitions that a name in a module stands for."""
    base, _, attribute = mentioned.rpartition(".")
    target = module.imports.get(base or attribute, "")
    if base:
        if target and ":" not in target:
            yield from _resolved(f"{target}:{attribute}")
    elif attribute in module.definitions:
        yield f"{name}:{attribute}"
    elif ":" in target:
        yield from _resolved(target)


def _resolved(name: str) -> Iterator[str]:
    """A definition by the module that holds it, past re-exports."""
    module, _, definition = name.partition(":")
    parsed = _parse(module)
    if definition in parsed.definitions:
        yield name
    elif ":" in parsed.imports.get(definition, ""):
        yield from _resolved(parsed.imports[definition])


_FILE = Path(importlib.util.cache_from_source(__file__)).with_suffix(".facts")

_new: set[str] = set()
"""Modules whose text was read in this process."""


class Facts(NamedTuple):
    """What a module's text says.

    Attributes
    ----------
    definitions : dict
        From the name of each top-level definition to its digest, without docstrings, and to the
        names in it that may stand for other definitions: ``"name"`` or ``"module.name"``.
    parts : dict
        From the name of each function or class to its parameters or fields, each with its
        annotation.
    """

    definitions: dict[str, tuple[str, list[str]]]
    imports: list[tuple[str, str, str]]
    parts: dict[str, list[tuple[str, str]]]


def facts_of(module: str, text: bytes) -> Facts:
    """What a module's text says."""
    own = _digest(_reader() + text)
    known, *given = _kept().get(module, ("",))
    if known != own:
        given = [*_parsed(text)]
        _kept()[module] = own, *given
        _new.add(module)
    return Facts(*given)


def keep_facts() -> None:
    """Write what was read off texts in this process, for the next one."""
    if not _new or sys.dont_write_bytecode:
        return
    _new.clear()
    part = _FILE.with_name(f".{_FILE.name}-{os.getpid()}")
    with suppress(OSError):  # as Python goes on where it cannot write bytecode
        text = json.dumps(_kept()).encode()
        part.write_bytes(f"{_digest(text)}\n".encode() + text)
        part.replace(_FILE)


@cache
def _kept() -> dict[str, Any]:
    """By a module's name: the digest of its text, and its facts; none of a file that is damaged."""
    with suppress(OSError):
        seal, _, text = _FILE.read_bytes().partition(b"\n")
        if seal == _digest(text).encode():
            return dict(json.loads(text))
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
        {name: found for node in tree.body for name, found in _signature(node)},
    )


def _signature(node: ast.stmt) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """A function or class with its parameters or fields, if it has any."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef) and (found := list(_annotated(node))):
        yield node.name, found


def _annotated(node: ast.stmt) -> Iterator[tuple[str, str]]:
    """Parameters of a function, or fields of a class, with their annotations."""
    if isinstance(node, ast.FunctionDef):
        every = (*node.args.args, *node.args.kwonlyargs)
        yield from ((one.arg, ast.unparse(one.annotation)) for one in every if one.annotation)
    elif isinstance(node, ast.ClassDef):
        for one in node.body:
            if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name):
                yield one.target.id, ast.unparse(one.annotation)


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
