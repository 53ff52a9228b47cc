"""Where shapes come from: the user's scans, a fetched original, or surrogates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter

from pipeline.config.layers import Origin
from pipeline.config.outside import check_regular, content
from pipeline.config.paths import kept, located, shown
from pipeline.config.problems import InputError, Problem, not_found
from pipeline.config.scene_schema import PedestalConfig, RockConfig
from pipeline.stages.mesh import mesh_files
from pipeline.stages.mesh.originals import ORIGINALS
from pipeline.workflow.keys import check_same, digest_file
from pipeline.workflow.stage import FilesInput
from vsr_core.errors import InvalidInput
from vsr_core.surrogates import GENERATORS, GROUNDS, SITES
from vsr_core.surrogates.raw_scan import scan

if TYPE_CHECKING:
    import trimesh

SUFFIXES = (".ply", ".stl", ".obj", ".dae", ".glb")

_NOT_READ = (
    *(".gltf", ".off", ".3mf", ".fbx", ".3ds", ".blend", ".ctm", ".wrl", ".x3d", ".vtk", ".vtp"),
    *(".usd", ".usda", ".usdc", ".usdz", ".step", ".stp", ".iges", ".igs", ".dxf"),
    *(".las", ".laz", ".e57", ".pcd", ".pts", ".ptx", ".xyz", ".asc", ".bin", ".rcp", ".psx"),
    *(".zip", ".gz", ".tgz", ".xz", ".bz2", ".tar", ".7z", ".rar"),
)
"""Endings of scans in other formats, or packed: none stands in for them."""

ORIGIN = "origin.json"
"""Beside a fetched mesh: where it came from, and its checksum."""

_NOTE, _LARGEST_NOTE = TypeAdapter(dict[str, Any]), 100_000
"""What it holds, of so many bytes at most."""


@dataclass(frozen=True)
class Source(FilesInput):
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
    before: dict[str, str] = field(default_factory=dict)

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

    def files_read(self) -> tuple[Path, ...]:
        return () if self.path is None else (self.path,)

    def digests(self) -> dict[str, str]:
        """Digest of the scan, by its name."""
        if self.path is None:
            return {"surrogate": self.fallback}
        return {self.path.name: digest_file(self.path)}


@dataclass(frozen=True)
class GroundFile(FilesInput):
    """A terrain that is not in the rock's scan."""

    path: Path | None
    fallback: str
    before: dict[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """What a product says of it."""
        return _label(self.path) if self.path else f"made ground ({self.fallback})"

    @property
    def name(self) -> str:
        """What to call it in a message."""
        return shown(self.path) if self.path else self.fallback

    def files_read(self) -> tuple[Path, ...]:
        return () if self.path is None else (self.path,)

    def digests(self) -> dict[str, str]:
        """Digest of the file."""
        if self.path is None:
            return {"made ground": self.fallback}
        return {f"terrain {self.path.name}": digest_file(self.path)}


def find(rock: RockConfig, pedestal: PedestalConfig, origin: Origin) -> Source | None:
    """The shape of a mesh site: a scan, else the surrogate that its configuration names."""
    if rock.shape == "box":
        return None
    assert rock.mesh is not None
    has_ground = pedestal.shape == "mesh" and not pedestal.is_own_file
    path = _file("rock", rock.mesh, rock.fallback, origin)
    if path is None:
        name = _known("rock", rock.fallback, SITES if has_ground else GENERATORS, origin)
        label = "surrogate made from published figures (no scan found)"
        found = Source(None, name, label, rock.scale, has_ground)
    else:
        found = Source(path, "", _label(path), rock.scale, has_ground)
    return replace(found, before=found.digests())


def find_ground(pedestal: PedestalConfig, origin: Origin) -> GroundFile | None:
    """The terrain of a site that has it in a file of its own, or made by a formula."""
    if not pedestal.is_own_file:
        return None
    path = None
    if pedestal.mesh is not None:
        path = _file("pedestal", pedestal.mesh, pedestal.fallback, origin)
    name = "" if path else _known("pedestal", pedestal.fallback, GROUNDS, origin)
    found = GroundFile(path, name)
    return replace(found, before=found.digests())


def _file(section: str, name: str, fallback: str | None, origin: Origin) -> Path | None:
    """The mesh that a section names by its path or its folder; None where there is none.

    A fallback is that of the mesh beside which it stands: one that is set over it is not replaced.
    """
    key = f"{section}.mesh"
    file = origin.file_of(key)
    beside = origin.file_of(f"{section}.fallback") in (file, "--set")
    if not beside and file != origin.file:
        fallback = None
    path = located(origin.folder_of(key), name, file, key)
    is_folder = path.is_dir() or not (path.exists() or path.suffix)
    if is_folder or (not path.exists() and fallback):
        inside = sorted(path.glob("[!.]*"))
        scans = [p for p in inside if p.suffix.lower() in SUFFIXES]
        scans = scans or [p for p in inside if p.suffix.lower() in _NOT_READ][:1]
        if len(scans) > 1:
            names = ", ".join(scan.name for scan in scans)
            rule = "a site has one scan" if section == "pedestal" else "a rock has one"
            given = f"{len(scans)} scans ({names})"
            raise _problem(origin, given, rule, f"name one in {key}", key)
        if not scans and fallback:
            return None
        if not scans:
            remedy = "put a scan there"
            if path.name in ORIGINALS:
                remedy += f", or the public one: make fetch NAME={path.name}"
            given = f"{shown(path)}, which holds no scan"
            raise _problem(origin, given, "it holds one", remedy, key)
        path = scans[0]
    if path.suffix.lower() not in SUFFIXES:
        rule = f"a mesh ends in {' '.join(SUFFIXES)}"
        raise _problem(origin, shown(path), rule, "convert it", key)
    if not path.exists():
        raise not_found(file, key, shown(path))
    try:
        check_regular(path, mesh_files.LARGEST_FILE)  # before its digest is taken
    except InvalidInput as error:
        given = f"{shown(path)}, {error.given}"
        raise _problem(origin, given, error.rule, error.remedy, key) from None
    return path


def _known(section: str, name: str | None, known: Iterable[str], origin: Origin) -> str:
    """Name of a surrogate that there is."""
    if name is None or name not in known:
        key, rule = f"{section}.fallback", f"it is one of {', '.join(known)}"
        raise InputError(Problem(origin.file_of(key), key, repr(name), rule, "correct it"))
    return name


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
    return _read(source.path, source.before, origin, "rock.mesh", source.scale)


def load_ground(ground: GroundFile, origin: Origin) -> trimesh.Trimesh:
    """The terrain [m], in the coordinates of its file."""
    import trimesh

    if ground.path is None:
        return trimesh.Trimesh(*GROUNDS[ground.fallback](), process=False)
    return _read(ground.path, ground.before, origin, "pedestal.mesh")


def _read(
    path: Path, before: dict[str, str], origin: Origin, key: str, scale: float = 1.0
) -> trimesh.Trimesh:
    try:
        found = mesh_files.read(path, scale)
    except InvalidInput as error:
        given = f"{shown(path)}, {error.given}"
        raise _problem(origin, given, error.rule, error.remedy, key) from None
    check_same(path, [path], [*before.values()])
    return found


def _label(path: Path) -> str:
    facts = origin_of(path)
    if "from" in facts and facts.get("sha256") == digest_file(path):
        return f"public original, {facts['from']}"
    return f"scan {kept(path)}"


def origin_of(path: Path) -> dict[str, str]:
    """Where a file is from, as a note beside it says; nothing where there is none that is sound."""
    try:
        found = _NOTE.validate_json(content(path.with_name(ORIGIN), _LARGEST_NOTE))
    except (InputError, ValueError):
        return {}
    return {name: one for name, one in found.items() if isinstance(one, str)}


def _problem(origin: Origin, given: str, rule: str, remedy: str, key: str) -> InputError:
    return InputError(Problem(origin.file_of(key), key, given, rule, remedy))
