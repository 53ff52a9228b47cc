"""The definitions of this project that others reach, and their digests.

Names are followed, not files: from root functions to every top-level definition they mention,
through imports. Each is digested by its syntax tree without docstrings, so a comment or a function
that is not used changes nothing. A call through a variable cannot be followed; what is reached
that way is named as a root.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from vsr_core.source import facts

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
    facts.keep()
    return dict(sorted(found.items()))


def users(module: str, names: Iterable[str]) -> Iterator[str]:
    """The definitions that mention one of some names, imported from the module that defines it."""
    wanted, line = {f"{module}:{name}" for name in names}, f"from {module} import ".encode()
    for other, path in _files(ROOT).items():
        if line not in path.read_bytes():
            continue
        parsed = _parse(other)
        local = {name for name, meant in parsed.imports.items() if meant in wanted}
        for definition, (_, mentioned) in parsed.definitions.items():
            if not local.isdisjoint(mentioned):
                yield f"{other}:{definition}"


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
    read = facts.of(name, files[name].read_bytes())
    imports = {}
    for local, module, inner in read.imports:
        if f"{module}.{inner}" in files:
            imports[local] = f"{module}.{inner}"
        elif module in files:
            imports[local] = f"{module}:{inner}" if inner else module
    return _Module(read.definitions, imports)


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
