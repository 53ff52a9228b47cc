"""Versions of this program, of the code that its outcomes come from, and of libraries."""

from __future__ import annotations

import platform
from collections.abc import Iterator

from pipeline.workflow import keys
from vsr_core import engines
from vsr_core.compiled import compiling
from vsr_core.source import tracing

LIBRARIES = ("numpy", "scipy", "numba", "pybullet", "mujoco", "dask", "xarray")


def lines() -> Iterator[str]:
    """The version, a line for each thing that a report of a fault should name."""
    yield f"vsr {keys.installed_version('vsr')}, Python {platform.python_version()}"
    for name in engines.names():
        code = keys.digest(tracing.reached((*keys.RUN_CODE, f"vsr_core.engines.{name}:build")))
        yield f"engine {name}: code of a run {code[:16]}"
    yield f"machine code: {compiling.name()}"
    yield ", ".join(f"{name} {keys.installed_version(name)}" for name in LIBRARIES)
