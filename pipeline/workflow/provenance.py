"""What a process computes with: its code and its libraries, as they were when it started."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from functools import cache, cached_property

from pipeline.workflow import keys
from vsr_core.source import tracing

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "pybullet", "mujoco", "trimesh")
"""Those that runs are computed with."""

_NONE = "not installed"


@dataclass(frozen=True)
class Provenance:
    """Code and libraries of a process."""

    code: dict[str, str]
    libraries: dict[str, str]

    @cached_property
    def key(self) -> str:
        """Digest of the code and of the libraries that are installed."""
        return keys.digest([self.code, self.libraries])

    def differences(self, other: Provenance) -> list[str]:
        """What another process computes with that this one does not.

        Examples
        --------
        >>> here = Provenance({"a.py": "1", "b.py": "2"}, {"numpy": "2.4"})
        >>> here.differences(Provenance({"a.py": "1", "b.py": "3"}, {"numpy": "2.3"}))
        ['numpy 2.3 in place of 2.4', 'b.py']
        """
        libraries = [
            f"{name} {other.libraries.get(name, _NONE)} in place of {version}"
            for name, version in self.libraries.items()
            if other.libraries.get(name, _NONE) != version
        ]
        files = sorted({*self.code, *other.code})
        return libraries + [name for name in files if self.code.get(name) != other.code.get(name)]


@cache
def here() -> Provenance:
    """Provenance of this process, read once: what is edited later is not what it has loaded."""
    code = {name: keys.digest_bytes(text) for name, text in sorted(tracing.texts().items())}
    libraries = {name: keys.installed_version(name) for name in LIBRARIES}
    return Provenance(code, {"python": platform.python_version(), **libraries})
