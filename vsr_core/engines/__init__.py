"""Physics engines: one module each, found by its name, and their ``interface``."""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from typing import cast

from vsr_core.engines.interface import Engine
from vsr_core.errors import InvalidInput

_LIBRARIES = {"bullet": "pybullet", "mujoco": "mujoco"}


def missing(library: str) -> tuple[str, str]:
    """Rule and remedy where the library of an engine is not installed."""
    if library != "pybullet":
        return f"{library} is not installed", f"install it: pip install {library}"
    return (
        "PyBullet is not installed: it has wheels for Linux on x86-64 with CPython up to 3.11 only",
        "build it with a C++ compiler: pip install 'vsr[bullet]', or '.[bullet]' in the checkout",
    )


def names() -> list[str]:
    """Names of the engines there are.

    Examples
    --------
    >>> names()
    ['bullet', 'mujoco', 'nonsmooth']
    """
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    return sorted(name for name in modules if name != "interface")


def available(name: str) -> bool:
    """Whether the library of an engine is installed; imports nothing."""
    library = _LIBRARIES.get(name)
    return library is None or importlib.util.find_spec(library) is not None


def require(name: str) -> None:
    """Refuse an engine whose library is not installed; imports nothing."""
    if not available(name):
        raise InvalidInput(f"a scene for the engine {name!r}", *missing(_LIBRARIES[name]))


def load(name: str) -> Engine:
    """Engine by name; imports its library.

    Raises
    ------
    InvalidInput
        If the library is not installed.
    """
    try:
        return cast(Engine, importlib.import_module(f"{__name__}.{name}"))
    except ModuleNotFoundError as error:
        raise InvalidInput(
            f"the engine {name!r} without the library {error.name!r}", *missing(error.name or name)
        ) from None
