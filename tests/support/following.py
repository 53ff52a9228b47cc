"""Which definitions of ``vsr_core`` are entered while something runs."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

from numba.core.dispatcher import Dispatcher

from pipeline import ROOT


@contextmanager
def following() -> Iterator[set[str]]:
    """Definitions of ``vsr_core`` whose code is entered meanwhile."""
    entered: set[str] = set()

    def follow(frame, event: str, _: object) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and path.is_relative_to(ROOT / "vsr_core"):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            name = frame.f_code.co_qualname.split(".")[0]
            if not name.startswith("<"):
                entered.add(f"{module.removesuffix('.__init__')}:{name}")

    import_module("vsr_core.engines.bullet.driven")  # what only an import enters does not count
    sys.setprofile(follow)
    try:
        yield entered
    finally:
        sys.setprofile(None)


def compiled_beneath(names: Iterable[str]) -> set[str]:
    """Compiled functions that some definitions call, and these call: no profiler sees them enter.

    Found in the bytecode and among the objects that its names stand for.
    """
    found: set[str] = set()
    ahead = [function for name in names for function in _functions(name)]
    while ahead:
        for called in _compiled_in(ahead.pop()):
            name = f"{called.__module__}:{called.__qualname__}"
            if name not in found:
                found.add(name)
                ahead.append(called)
    return found


def _functions(name: str) -> list[FunctionType]:
    module, _, definition = name.partition(":")
    it = inspect.unwrap(getattr(import_module(module), definition))
    parts = vars(it).values() if isinstance(it, type) else [it]
    parts = (getattr(part, "fget", getattr(part, "func", part)) for part in parts)
    return [part for part in parts if isinstance(part, FunctionType)]


def _compiled_in(function: FunctionType) -> Iterator[FunctionType]:
    names = set(_names(function.__code__))
    things = [function.__globals__.get(name) for name in names]
    modules = [thing for thing in things if isinstance(thing, ModuleType)]
    things += [getattr(module, name, None) for module in modules for name in names]
    for thing in things:
        if isinstance(thing, Dispatcher) and thing.__module__.startswith("vsr_core"):
            yield thing.py_func


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
