"""Where a rock's shape comes from: the user's scan, a fetched original, or a surrogate."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.config.layers import Site
from pipeline.config.paths import located, shown
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.stages.mesh import mesh_files
from pipeline.workflow.keys import digest_file
from pipeline.workflow.stage import named
from vsr_core.errors import InvalidInput
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
class Source:
    """The shape that a site uses.

    Attributes
    ----------
    fallback : str, name of the surrogate's generator, or empty
    """

    path: Path | None
    fallback: str
    label: str

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


def find(site: Site) -> Source:
    """The shape of a mesh site: a scan, else the surrogate that its configuration names."""
    rock = site.config.rock
    assert rock.mesh is not None
    path = located(site.folder_of("rock.mesh"), rock.mesh, site.file_of("rock.mesh"), "rock.mesh")
    if path.is_dir() or (not path.exists() and rock.fallback):
        scans = sorted(p for p in path.glob("*") if p.suffix.lower() in SUFFIXES)
        if len(scans) > 1:
            names = ", ".join(scan.name for scan in scans)
            raise _problem(
                site, f"{len(scans)} scans ({names})", "a rock has one", "name one in rock.mesh"
            )
        if not scans:
            return _surrogate(site, path)
        path = scans[0]
    if path.suffix.lower() not in SUFFIXES:
        raise _problem(site, shown(path), f"a mesh ends in {' '.join(SUFFIXES)}", "convert it")
    if not path.is_file():
        raise not_found(site.file_of("rock.mesh"), "rock.mesh", shown(path))
    try:
        mesh_files.check_size(path)  # before its digest is taken
    except InvalidInput as error:
        given = f"{shown(path)}, {error.given}"
        raise _problem(site, given, error.rule, error.remedy) from None
    return Source(path, "", _label(path))


def digests(site: Site) -> dict[str, str]:
    """Digest of the scan, by its name, for the key of the rock stage."""
    if site.config.rock.shape == "box":
        return {}
    source = find(site)
    if source.path is None:
        return {"surrogate": source.fallback}
    return {source.path.name: digest_file(source.path)}


def load(source: Source, site: Site) -> trimesh.Trimesh:
    """The mesh, scaled to metres.

    Returns
    -------
    trimesh.Trimesh [m], in the coordinates of the file
    """
    import trimesh

    if source.path is None:
        if not site.config.on_terrain:
            mesh = trimesh.Trimesh(*GENERATORS[source.fallback](), process=False)
            return mesh.apply_scale(site.config.rock.scale)
        raw = scan(SITES[source.fallback]())
        return trimesh.Trimesh(raw.vertices, raw.faces, vertex_colors=raw.colours, process=False)
    try:
        mesh = mesh_files.read(source.path)
    except InvalidInput as error:
        given = f"{source.name}, {error.given}"
        raise _problem(site, given, error.rule, error.remedy) from None
    mesh.apply_scale(site.config.rock.scale)
    return mesh


def closed(source: Source, site: Site, tell: Tell) -> WholeRock:
    """The rock of a scan of it alone, as a closed solid."""
    try:
        return whole_rock(load(source, site), site.config.rock.closing, tell)
    except Refused as error:
        refusal = named("pipeline.stages.mesh.scan_page:refusal")  # with figures, if need be
        raise refusal(site, source, "rock.mesh", error) from None


def _surrogate(site: Site, folder: Path) -> Source:
    known = SITES if site.config.on_terrain else GENERATORS
    name = site.config.rock.fallback
    if not name:
        raise _problem(
            site, f"{shown(folder)}, which holds no scan", "it holds one", "put a scan there"
        )
    if name not in known:
        names = ", ".join(known)
        raise InputError(
            Problem(
                site.file_of("rock.fallback"),
                "rock.fallback",
                repr(name),
                f"it is one of {names}",
                "correct it",
            )
        )
    return Source(None, name, "surrogate made from published figures (no scan found)")


def _label(path: Path) -> str:
    origin = path.with_name(ORIGIN)
    try:
        facts = json.loads(origin.read_text(encoding="utf-8"))
        if facts["sha256"] == digest_file(path):
            return f"public original, {facts['from']}"
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass  # none, or not what `fetch` wrote
    return f"scan {shown(path)}"


def _problem(site: Site, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(site.file_of("rock.mesh"), "rock.mesh", given, rule, remedy))
