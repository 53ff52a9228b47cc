"""Compilation of the engine, and where its machine code is kept.

Machine code is kept beside the source, in a folder named by the digest of all that it was compiled
from: Numba itself looks at the file of the function called only, and would go on using code whose
other parts were edited.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config

Function = TypeVar("Function", bound=Callable[..., Any])

_CORE = Path(__file__).parents[2]


def _digest() -> str:
    whole = hashlib.blake2b(numba.__version__.encode(), digest_size=8)
    for path in sorted(_CORE.rglob("*.py")):
        if b"compiled" in (text := path.read_bytes()):
            whole.update(text)
    return whole.hexdigest()


_FOLDER = _CORE / "__pycache__" / f"compiled-{_digest()}"

if "NUMBA_CACHE_DIR" not in os.environ:
    config.CACHE_DIR = str(_FOLDER)  # type: ignore[attr-defined]


def forget_others() -> None:
    """Remove machine code of sources that are no more."""
    for folder in _FOLDER.parent.glob("compiled-*"):
        if folder != _FOLDER:
            shutil.rmtree(folder, ignore_errors=True)


_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}


def compiled(function: Function) -> Function:
    """Compile a function when it is first called, without the interpreter's lock.

    No option that lets a compiler reorder floating-point operations is set, so that the same
    numbers come out whatever the processor. Nothing compiled allocates memory, and with ``_nrt``
    off nobody counts who still uses an array, which took a quarter of the time.

    Parameters
    ----------
    function : callable

    Returns
    -------
    callable
    """
    return cast(Function, numba.njit(cache=True, **_OPTIONS)(function))


def inlined(function: Function) -> Function:
    """Compile a function into those that call it.

    A structure of arrays is handed on in hundreds of words, which costs more than what most
    functions do with it.

    Parameters
    ----------
    function : callable

    Returns
    -------
    callable
    """
    return cast(Function, numba.njit(forceinline=True, **_OPTIONS)(function))
