"""Compilation, and where machine code is kept.

Machine code is kept in a folder named by the digest of all that it was compiled from, constants and
functions of other modules included: Numba itself looks at the file of the function called only, and
would go on using code whose other parts were edited. The folder is beside the source or, where
nothing can be written there, among the user's caches. Each file of it is sealed: what was damaged,
or could have been written by another user than oneself or root, is compiled anew and not loaded.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import pickle
import shutil
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import numba
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

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
def name() -> str:
    """Name of a folder of machine code: of what it is made from, and by what."""
    made_by = (sys.version, numba.__version__, llvmlite.__version__)
    source = repr([made_by, compiled_from()]).encode()
    return f"compiled-{hashlib.blake2b(source, digest_size=8).hexdigest()}"


@cache
def _folders() -> tuple[Path, ...]:
    """Where machine code is looked for; it is written to the last of them.

    That is a folder for this process alone where nothing can be kept.
    """
    found = []
    caches = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    for place in (os.environ.get("NUMBA_CACHE_DIR") or _BESIDE, Path(caches, "vsr")):
        with suppress(OSError, RuntimeError):  # the latter without a home
            folder = Path(place).expanduser() / name()
            with suppress(OSError):
                folder.mkdir(mode=0o755, parents=True, exist_ok=True)
            if not _is_own(folder.stat()):
                _tell(f"{folder} could be written by others and is not used")
                continue
            found.append(folder)
            if os.access(folder, os.W_OK):
                return tuple(found)
    own = tempfile.mkdtemp(prefix="vsr-")
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return (*found, Path(own))


def _is_own(state: os.stat_result) -> bool:
    """Whether nobody but oneself and root can have written a file or folder."""
    return state.st_uid in (0, os.geteuid()) and not state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


class MachineCodeWarning(UserWarning):
    """Machine code that is there is not used."""


@cache
def _tell(what: str) -> None:
    warnings.warn(f"machine code: {what}; it is compiled anew", MachineCodeWarning, stacklevel=2)


def forget_others() -> None:
    """Remove machine code of sources that are no more."""
    for folder in _BESIDE.glob("compiled-*"):
        if folder not in _folders():
            shutil.rmtree(folder, ignore_errors=True)


def what_is_kept() -> tuple[Path | None, int, int]:
    """Where machine code is written, how many files of it are whole, and how many are not used.

    The place is None where nothing is kept beyond this process.
    """
    folder = _folders()[-1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MachineCodeWarning)
        found = [_unsealed(path) is not None for path in sorted(folder.glob("*/[!.]*"))]
    lasts = folder.name == name()
    return folder if lasts else None, sum(found), len(found) - sum(found)


class _Code(CompileResultCacheImpl):
    """How Numba takes its result to pieces; it would look for a place of its own."""

    def __init__(self) -> None:
        pass

    def check_cachable(self, cres: Any) -> bool:
        """Whether it is the same in each process; with NUMBA_OPT=0 it has places in memory."""
        parts = cres._asdict()
        has_places = parts["library"].has_dynamic_globals
        return not has_places and all(one.can_cache for one in parts["lifted"])


class _KeptCode(FunctionCache):
    """Machine code of a function: a sealed file for each kind of arguments."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_func, self._impl = function, _Code()
        self._named = f"{function.__module__}:{function.__qualname__}"
        self._enabled = True

    @property
    def cache_path(self) -> str:
        return str(_folders()[-1])

    def flush(self) -> None:
        """Nothing is to be forgotten: what others have made of the same source is the same."""

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        key = self._key(sig, target_context.codegen())
        for folder in _folders():
            if (kept := _unsealed(self._file(folder, key))) is not None:
                known, data = pickle.loads(kept)  # noqa: S301 (sealed, and nobody else's)
                if known == key:
                    return self._impl.rebuild(target_context, data)
                _tell(f"a file in {folder} is of another function")
        return None

    def _save_overload(self, sig: Any, data: Any) -> None:
        if not self._impl.check_cachable(data):
            return
        key = self._key(sig, data.codegen)
        path = self._file(_folders()[-1], key)
        if tracing.by_now(compiled_from()) != compiled_from():
            _tell("its source was edited meanwhile, and it is not kept")
            return
        try:
            _seal(path, dumps((key, self._impl.reduce(data))))
        except OSError as error:
            _tell(f"{path.parents[1]} cannot be written to ({error.strerror})")

    def _key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return (self._named, repr(vars(config)["OPT"]), *self._index_key(sig, codegen))

    def _file(self, folder: Path, key: tuple[Any, ...]) -> Path:
        module, _, function = self._named.partition(":")
        return folder / module / f"{function}-{_digest(repr(key).encode()).hex()[:16]}"


def _digest(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=_SEAL, key=name().encode()).digest()


_SEAL = 16
"""Bytes of a seal."""

_LARGEST = 64 * 1024**2
"""Bytes of a file that are read: forty times those of the largest."""


def _seal(path: Path, content: bytes) -> None:
    path.parent.mkdir(mode=0o755, exist_ok=True)
    part = path.with_name(f".{path.name}-{os.getpid()}")
    try:
        with open(part, "wb", opener=lambda name, flags: os.open(name, flags, 0o644)) as file:
            file.write(_digest(content) + content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _unsealed(path: Path) -> bytes | None:
    """What was sealed in a file; None where there is none that is whole and one's own."""
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as f:
            state = os.fstat(f.fileno())
            own = stat.S_ISREG(state.st_mode) and _is_own(state) and _is_own(path.parent.stat())
            content = f.read(_LARGEST) if own else b""
    except FileNotFoundError:
        return None
    except OSError as error:
        _tell(f"{path.parents[1]} cannot be read ({error.strerror})")
        return None
    if not own:
        _tell(f"a file in {path.parents[1]} could be written by others and is not used")
    elif _digest(content[_SEAL:]) == content[:_SEAL]:
        return content[_SEAL:]
    else:
        _tell(f"a file in {path.parents[1]} is damaged")
    return None


_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}


def compiled(function: Function) -> Function:
    """Compile a function when it is first called, without the interpreter's lock.

    No option that lets a compiler reorder floating-point operations is set, so that the same
    numbers come out whatever the processor. Nothing compiled allocates memory, and with ``_nrt``
    off nobody counts who still uses an array, which took a quarter of the time.
    """
    dispatcher = numba.njit(**_OPTIONS)(function)
    dispatcher._cache = _KeptCode(function)
    return cast(Function, dispatcher)


def inlined(function: Function) -> Function:
    """Compile a function into those that call it.

    A structure of arrays is handed on in hundreds of words, which costs more than what most
    functions do with it.
    """
    return cast(Function, numba.njit(forceinline=True, **_OPTIONS)(function))
