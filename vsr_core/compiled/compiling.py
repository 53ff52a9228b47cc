"""Compilation, and where machine code is kept.

Machine code is kept in a folder named by the digest of all that it was compiled from, constants and
functions of other modules included: Numba itself looks at the file of the function called only, and
would go on using code whose other parts were edited. The folder is beside the source or, where
nothing can be written there, among the user's caches.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

from vsr_core.source import tracing

Function = TypeVar("Function", bound=Callable[..., Any])

_BESIDE = Path(__file__).parents[1] / "__pycache__"


def compiled_from() -> dict[str, str]:
    """Digest of every definition of this project that compiled functions are made from.

    Returns
    -------
    dict
        From ``"package.module:name"`` to the digest of that definition.
    """
    return tracing.reached(tracing.users(__name__, ("compiled", "inlined")))


@cache
def _folder() -> Path:
    """Folder of the machine code; one for this process alone where nothing can be kept."""
    source = repr([numba.__version__, compiled_from()]).encode()
    name = f"compiled-{hashlib.blake2b(source, digest_size=8).hexdigest()}"
    caches = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    for place in (os.environ.get("NUMBA_CACHE_DIR") or _BESIDE, Path(caches, "vsr")):
        with suppress(OSError, RuntimeError):  # the latter without a home
            folder = Path(place).expanduser() / name
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    own = tempfile.mkdtemp(prefix="vsr-")
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return Path(own)


def forget_others() -> None:
    """Remove machine code of sources that are no more."""
    for folder in _BESIDE.glob("compiled-*"):
        if folder != _folder():
            shutil.rmtree(folder, ignore_errors=True)


class _Place(_CacheLocator):
    """Where a function's machine code is: known by names, so that a moved checkout keeps it."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._module = function.__module__

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> _Place:
        return cls(function)

    def get_cache_path(self) -> str:
        return str(_folder() / self._module)

    def get_source_stamp(self) -> str:
        return ""  # the folder's name is the digest of the source

    def get_disambiguator(self) -> str:
        return ""


class _Code(CompileResultCacheImpl):
    _locator_classes: ClassVar[list[Any]] = [_Place]  # type: ignore[misc]


class _KeptCode(FunctionCache):
    _impl_class = _Code


class _Cache:
    """Numba's cache of a function, which is found when the function is compiled."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def _cache(self) -> FunctionCache:
        return _KeptCode(self._function)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)


_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}


def compiled(function: Function) -> Function:
    """Compile a function when it is first called, without the interpreter's lock.

    No option that lets a compiler reorder floating-point operations is set, so that the same
    numbers come out whatever the processor. Nothing compiled allocates memory, and with ``_nrt``
    off nobody counts who still uses an array, which took a quarter of the time.
    """
    dispatcher = numba.njit(**_OPTIONS)(function)
    dispatcher._cache = _Cache(function)
    return cast(Function, dispatcher)


def inlined(function: Function) -> Function:
    """Compile a function into those that call it.

    A structure of arrays is handed on in hundreds of words, which costs more than what most
    functions do with it.
    """
    return cast(Function, numba.njit(forceinline=True, **_OPTIONS)(function))
