"""Where a rock's shape comes from: the user's scan, a fetched original, or a surrogate."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.config.layers import Origin
from pipeline.config.paths import located, shown
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.config.scene_schema import PedestalConfig, RockConfig
from pipeline.stages.mesh import mesh_files
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import Input, named
from vsr_core.errors import InvalidInput
from vsr_core.scan.closing import Closing
from vsr_core.scan.weighing import Refused, Tell
from vsr_core.scan.whole_rock import WholeRock, whole_rock
from vsr_core.surrogates import GENERATORS, SITES
from vsr_core.surrogates.raw_scan import scan

if TYPE_CHECKING:
    import trimesh

SUFFIXES = (".ply", ".stl", ".obj", ".dae", ".glb")

ORIGIN = "origin.json"
"""Beside a fetched mesh: where it came from, and its checksum."""


@dataclass(frozen=True)
class Source(Input):
    """The shape that a site uses.

    Attributes
    ----------
    fallback : str, name of the surrogate's generator, or empty
    scale : float, length of the file's unit [m]
    has_ground : bool, whether rock and terrain are in it
    """

    path: Path | None
    fallback: str
    label: str
    scale: float
    has_ground: bool

    @property
    def surrogate(self) -> bool:
        """Whether it is not scanned, but made from published figures."""
        return self.path is None

    @property
    def attributes(self) -> dict[str, str | int]:
        """What a product says of it."""
        return {"shape_source": self.label, "surrogate": int(self.surrogate)}

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return shown(self.path) if self.path else "surrogate"

    def digests(self) -> dict[str, str]:
        """Digest of the scan, by its name."""
        if self.path is None:
            return {"surrogate": self.fallback}
        return {self.path.name: digest_file(self.path)}


def find(rock: RockConfig, pedestal: PedestalConfig, origin: Origin) -> Source | None:
    """The shape of a mesh site: a scan, else the surrogate that its configuration names."""
    if rock.shape == "box":
        return None
    assert rock.mesh is not None
    folder, file = origin.folder_of("rock.mesh"), origin.file_of("rock.mesh")
    path, has_ground = located(folder, rock.mesh, file, "rock.mesh"), pedestal.shape == "mesh"
    if path.is_dir() or (not path.exists() and rock.fallback):
        scans = sorted(p for p in path.glob("*") if p.suffix.lower() in SUFFIXES)
        if len(scans) > 1:
            names = ", ".join(scan.name for scan in scans)
            raise _problem(
                origin, f"{len(scans)} scans ({names})", "a rock has one", "name one in rock.mesh"
            )
        if not scans:
            name = _surrogate(rock, path, origin, has_ground=has_ground)
            label = "surrogate made from published figures (no scan found)"
            return Source(None, name, label, rock.scale, has_ground)
        path = scans[0]
    if path.suffix.lower() not in SUFFIXES:
        raise _problem(origin, shown(path), f"a mesh ends in {' '.join(SUFFIXES)}", "convert it")
    if not path.is_file():
        raise not_found(file, "rock.mesh", shown(path))
    try:
        mesh_files.check_size(path)  # before its digest is taken
    except InvalidInput as error:
        given = f"{shown(path)}, {error.given}"
        raise _problem(origin, given, error.rule, error.remedy) from None
    return Source(path, "", _label(path), rock.scale, has_ground)


def load(source: Source, origin: Origin) -> trimesh.Trimesh:
    """The mesh, scaled to metres.

    Returns
    -------
    trimesh.Trimesh [m], in the coordinates of the file
    """
    import trimesh

    if source.path is None:
        if not source.has_ground:
            mesh = trimesh.Trimesh(*GENERATORS[source.fallback](), process=False)
            return mesh.apply_scale(source.scale)
        raw = scan(SITES[source.fallback]())
        return trimesh.Trimesh(raw.vertices, raw.faces, vertex_colors=raw.colours, process=False)
    try:
        mesh = mesh_files.read(source.path)
    except InvalidInput as error:
        given = f"{source.name}, {error.given}"
        raise _problem(origin, given, error.rule, error.remedy) from None
    mesh.apply_scale(source.scale)
    return mesh


def closed(source: Source, closing: Closing, origin: Origin, tell: Tell) -> WholeRock:
    """The rock of a scan of it alone, as a closed solid."""
    try:
        return whole_rock(load(source, origin), closing, tell)
    except Refused as error:
        refusal = named("pipeline.stages.mesh.scan_page:refusal")  # with figures, if need be
        raise refusal(origin, source, "rock.mesh", error) from None


def _surrogate(rock: RockConfig, folder: Path, origin: Origin, *, has_ground: bool) -> str:
    """Name of the surrogate of a rock without a scan."""
    known = SITES if has_ground else GENERATORS
    if not rock.fallback:
        raise _problem(
            origin, f"{shown(folder)}, which holds no scan", "it holds one", "put a scan there"
        )
    if rock.fallback not in known:
        rule, key = f"it is one of {', '.join(known)}", "rock.fallback"
        raise InputError(Problem(origin.file_of(key), key, repr(rock.fallback), rule, "correct it"))
    return rock.fallback


def _label(path: Path) -> str:
    origin = path.with_name(ORIGIN)
    try:
        facts = json.loads(origin.read_text(encoding="utf-8"))
        if facts["sha256"] == digest_file(path):
            return f"public original, {facts['from']}"
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass  # none, or not what `fetch` wrote
    return f"scan {shown(path)}"


def _problem(origin: Origin, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(origin.file_of("rock.mesh"), "rock.mesh", given, rule, remedy))
