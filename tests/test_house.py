"""The rules of the house: which room stands on which, and what a module may hold."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from pipeline import ROOT
from pipeline.workflow.registry import STAGES

CORE = [
    "source", "errors", "arrays", "outcome", "compiled", "rock", "terrain", "scan", "surrogates",
    "motions", "table", "scene", "judge", "engines", "run", "verification", "fragility", "hazard",
    "displacement", "validation", "uncertainty", "observations", "archive",
]  # fmt: skip
PIPELINE = [
    "config",
    "workflow",
    "drawing",
    "stages",
    "bundles",
    "inspection",
    "status",
    "cli",
    "commands",
]
STAGE = [
    "mesh",
    "motions",
    "runs",
    "datasets",
    "boundary",
    "fragility",
    "displacement",
    "uncertainty",
    "observations",
    "archive",
    "hazard",
    "replay",
    "reports",
    "studies",
    "figures",
]
"""Rooms and single files in the order in which the data goes: none takes from a later one."""

FLOORS = {"vsr_core": CORE, "pipeline": PIPELINE, "pipeline.stages": STAGE}
HEAVY = {
    "IPython", "dart", "dartpy", "dask", "dask_jobqueue", "distributed", "h5py", "mujoco", "numba",
    "obspy", "open3d", "pooch", "pydrake", "pyogrio", "pyproj", "rapier3d", "sapien", "sklearn",
    "trimesh",
}  # fmt: skip
"""Libraries that are optional or slow to import: only these are imported where they are used."""

FILES_AND_RESULTS = {"yaml", "xarray", "dask", "distributed", "sqlite3", "jinja2", "matplotlib"}
"""What physics does not know."""

MOST_LINES = 400


@cache
def texts() -> dict[str, str]:
    """Source of every module of the two packages."""
    folders = [ROOT / "vsr_core", ROOT / "pipeline"]
    files = sorted(path for folder in folders for path in folder.rglob("*.py"))
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files]
    return {
        name.removesuffix(".__init__"): path.read_text(encoding="utf-8")
        for name, path in zip(names, files, strict=True)
    }


@cache
def modules() -> dict[str, ast.Module]:
    """Every module of the two packages by its name."""
    return {module: ast.parse(text) for module, text in texts().items()}


def imports(tree: ast.AST) -> Iterator[str]:
    """Names of what is imported: of a module, or of something in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are by full names"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def taken(module: str) -> frozenset[str]:
    """Modules of the two packages that a module imports."""
    known = modules()
    first_party = [n for n in imports(known[module]) if n.split(".")[0] in ("vsr_core", "pipeline")]
    found = {name if name in known else name.rpartition(".")[0] for name in first_party}
    assert found <= set(known), found - set(known)
    return frozenset(found - {module})


def reached(module: str) -> set[str]:
    """A module with all that it imports, and what these import."""
    found, ahead = {module}, [module]
    while ahead:
        new = taken(ahead.pop()) - found
        found |= new
        ahead += new
    return found


def foreign(module: str) -> set[str]:
    """Libraries that a module imports at its top."""
    top = ast.Module([n for n in modules()[module].body if not isinstance(n, ast.If)], [])
    outside = [n for n in top.body if isinstance(n, ast.Import | ast.ImportFrom)]
    return {name.split(".")[0] for node in outside for name in imports(node)}


def stands(module: str, package: str) -> str | None:
    """Room or file of a package in which a module is; None for others and for the package."""
    return module[len(package) + 1 :].split(".")[0] if module.startswith(package + ".") else None


@pytest.mark.parametrize("package", FLOORS)
def test_every_room_has_its_floor(package: str) -> None:
    folder = ROOT / package.replace(".", "/")
    there = {path.stem for path in folder.glob("[!_]*") if path.is_dir() or path.suffix == ".py"}
    assert there == set(FLOORS[package])


@pytest.mark.parametrize("package", FLOORS)
def test_nothing_takes_from_above(package: str) -> None:
    order = FLOORS[package]
    upward = [
        f"{module} takes from {other}"
        for module in modules()
        for other in taken(module)
        if (low := stands(module, package)) in order and (high := stands(other, package))
        if order.index(high) > order.index(low)
    ]
    assert upward == []


def test_physics_knows_no_experiment_and_no_file_of_results() -> None:
    core = [module for module in modules() if module.startswith("vsr_core")]
    assert [m for m in core if any(other.startswith("pipeline") for other in taken(m))] == []
    assert {m: found for m in core if (found := foreign(m) & FILES_AND_RESULTS)} == {}


def test_experiments_know_no_engine() -> None:
    outside = [module for module in modules() if module.startswith("pipeline")]
    engines = {"pybullet", "mujoco"}
    assert [m for m in outside if engines & {n.split(".")[0] for n in imports(modules()[m])}] == []


def test_no_circle_between_files() -> None:
    try:
        TopologicalSorter({module: taken(module) for module in modules()}).prepare()
    except CycleError as circle:
        raise AssertionError(" -> ".join(circle.args[1])) from None


@pytest.mark.parametrize("package", ["vsr_core", "pipeline"])
def test_a_root_holds_rooms_and_few_files(package: str) -> None:
    files = [path.name for path in (ROOT / package).iterdir() if path.is_file()]
    assert len(files) <= 5, files


@pytest.mark.slow
def test_only_heavy_libraries_are_imported_inside_functions() -> None:
    late = {
        f"{module}: {name}"
        for module, tree in modules().items()
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for name in imports(function)
        if name.split(".")[0] not in HEAVY
    }
    assert late == set()


def test_data_are_made_without_figures() -> None:
    """A stage whose products are data imports nothing that draws."""
    pages = {stage.name for stage in STAGES if any(f.endswith(".html") for f in stage.files)}
    drawing = {}
    for stage in STAGES:
        module = stage.make.split(":")[0]
        if stage.name not in pages:
            drawing[stage.name] = [
                other
                for other in reached(module)
                if other.startswith("pipeline.drawing") or "matplotlib" in foreign(other)
            ]
    assert len(drawing) > 5
    assert {stage: found for stage, found in drawing.items() if found} == {}


def test_no_module_is_long() -> None:
    lengths = {module: len(text.splitlines()) for module, text in texts().items()}
    assert {module for module, lines in lengths.items() if not 1 <= lines <= MOST_LINES} == set()


def imported(module: str, names: tuple[str, ...]) -> str:
    """Which of ``names`` a new process has loaded after importing a module."""
    code = f"import sys, {module}; print(*[n for n in {names} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=True)
    return done.stdout.decode().strip()


def test_the_help_waits_for_no_library() -> None:
    slow = ("numpy", "scipy", "xarray", "pydantic", "yaml", "matplotlib", "trimesh", "networkx")
    assert imported("pipeline.cli", slow) == ""


def test_a_worker_draws_nothing() -> None:
    slow = ("matplotlib", "sklearn", "obspy", "mujoco", "pybullet", "distributed", "open3d")
    assert imported("pipeline.stages.runs.overturning_runs", slow) == ""


@pytest.mark.slow
def test_a_command_of_seconds_loads_no_cluster(tmp_path: Path) -> None:
    slow = ("dask.array", "distributed", "sklearn", "scipy.stats", "obspy")
    grid = ("motion.pga={start: 0.2, stop: 1.0, num: 4}", "motion.pgv_pga=[0.1, 0.3]")
    given = ["run", "fragility", "--site", "cuboid_1x1x2", "--derived", str(tmp_path)]
    given += ["--set", "yaw=0", "--set", grid[0], "--set", grid[1]]
    code = (
        f"import sys; from pipeline.cli import main; assert main({given}) == 0;"
        f"print(*[n for n in {slow} if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=True)
    assert done.stdout.decode().strip() == ""


def test_one_version_is_told_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    told = {"CITATION.cff": r"^version: (.*)$", "CHANGELOG.md": r"^## (\S+)"}
    for name, pattern in told.items():
        found = re.search(pattern, (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
        assert found, name
        assert found[1] == project["version"], name
