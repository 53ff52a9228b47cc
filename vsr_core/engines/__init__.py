"""Physics engines: one module each, found by its name, and their ``interface``."""

from __future__ import annotations

import importlib
import pkgutil
from typing import cast

from vsr_core.engines.interface import Engine
from vsr_core.errors import InvalidInput


def names() -> list[str]:
    """Names of the engines there are.

    Examples
    --------
    >>> names()
    ['bullet', 'mujoco', 'nonsmooth']
    """
    modules = (module.name for module in pkgutil.iter_modules(__path__))
    return sorted(name for name in modules if name != "interface")


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
            f"the engine {name!r} without the library {error.name!r}",
            "an engine other than bullet is an extra",
            f"install it: .venv/bin/pip install -e '.[{name}]', or set simulation.engine: bullet",
        ) from None
