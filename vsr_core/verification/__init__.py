"""How large numerical errors are: known answers, time steps, other engines, extreme cases."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType


def modules(package: str) -> dict[str, ModuleType]:
    """Modules of a package by name; those with an underscore are shared parts and no family.

    Examples
    --------
    >>> "incline" in modules("vsr_core.verification.reference")
    True
    """
    inside = pkgutil.iter_modules(importlib.import_module(package).__path__)
    names = sorted(module.name for module in inside if not module.name.startswith("_"))
    return {name: importlib.import_module(f"{package}.{name}") for name in names}
