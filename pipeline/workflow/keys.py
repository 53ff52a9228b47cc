"""Digests: of values, of files, and of the first-party code that a result depends on.

The code digest follows names, not files: from a stage's root functions to every top-level
definition they mention, through imports, in ``vsr_core`` and ``pipeline``. Each is digested by
its syntax tree without docstrings, so a comment or a function that is not used changes nothing.
A call through a variable cannot be followed; what is reached that way is named as a root.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pipeline import ROOT
from pipeline.workflow import source_facts

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
    source_facts.keep()
    return dict(sorted(found.items()))


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


@cache
def _parse(name: str) -> _Module:
    files = _files(ROOT)
    facts = source_facts.facts(name, files[name].read_bytes())
    imports = {}
    for local, module, inner in facts.imports:
        if f"{module}.{inner}" in files:
            imports[local] = f"{module}.{inner}"
        elif module in files:
            imports[local] = f"{module}:{inner}" if inner else module
    return _Module(facts.definitions, imports)


@cache
def _files(root: Path) -> dict[str, Path]:
    """Files of all first-party modules, by the modules' names."""
    found = (path for package in PACKAGES for path in (root / package).rglob("*.py"))
    names = {path: path.relative_to(root).with_suffix("").parts for path in found}
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
