"""A site file, the command line in this process, and what a refusal must look like."""

from __future__ import annotations

import ast
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from support.browser import Opened, chromium, watched

from pipeline import ROOT, cli
from pipeline.drawing import style
from vsr_core.engines import load
from vsr_core.scan import weighing
from vsr_core.source import tracing

STEP = "simulation: {time_step: 0.001}\n"
BOX = "rock: {shape: box, size: [0.5, 1.0, 2.0], density: 2110}\n"


LONG = (
    *("test_all_ways", "test_commands_as_printed", "test_proofs_hunt", "test_bad_input_tables"),
    *(
        "test_bad_input_files",
        "test_level_ground",
        "test_symmetries",
        "test_workers",
        "test_reference",
    ),
    *("test_cluster", "test_site"),
    *("test_rebound", "test_prep", "test_resume", "test_displacement_product"),
    *("test_uncertainty_product", "test_damaged_products", "test_same_everywhere", "test_scene3d"),
    *("test_validation_product", "test_installed", "test_convex_parts", "test_bad_input_commands"),
    *("test_rocking_block", "test_placed", "test_raw_scans", "test_without_bullet"),
    *("test_replay_page", "test_chaos", "test_study_product", "test_accuracy_product"),
)
"""Files of tests that take longest, in that order: one that began last would be waited for."""

_PLACES = {name: place for place, name in enumerate(LONG)}


def pytest_configure() -> None:
    """One thread for each product of matrices, as processes that compete only wait for threads."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_xdist_auto_num_workers() -> int:
    """One more than there are cores, as tests of workers, schedulers and browsers wait a lot."""
    return len(os.sched_getaffinity(0)) + 1 if hasattr(os, "sched_getaffinity") else 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: _PLACES.get(item.path.stem, len(LONG)))


@dataclass(frozen=True)
class Ran:
    """What a command did."""

    code: int
    out: str
    err: str


_DRAWN = style._rendered


@pytest.fixture(scope="session", autouse=True)
def _no_pictures() -> Iterator[None]:
    """All pictures are the same small one, where they are no subject.

    The first of a kind is drawn, too, so that what cannot be is noticed. Nor is a file waited for
    until it is on the disk, which only matters where power fails.
    """
    small = {kind: _DRAWN(Figure(figsize=(1, 1)), kind) for kind in style._SAVED}
    drawn: set[tuple[str, ...]] = set()

    def rendered(figure: Figure, kind: str) -> bytes:
        alike = tuple(axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes)
        if alike not in drawn:
            drawn.add(alike)
            _DRAWN(figure, "svg")
        return small[kind]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "_rendered", rendered)
        patch.setattr(os, "fsync", lambda handle: None)
        yield


@pytest.fixture(scope="module")
def small_pictures() -> Iterator[None]:
    """Pictures with few pixels, and in PDF with fonts that take less time to embed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "_rendered", _DRAWN)
        patch.setitem(style._SAVED["png"], "dpi", 40)
        patch.setitem(style._RC, "pdf.fonttype", 3)
        yield


@pytest.fixture(scope="module")
def full_pictures() -> Iterator[None]:
    """Pictures as they are delivered, for tests that look at them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "_rendered", _DRAWN)
        yield


@pytest.fixture(scope="module")
def few_samples() -> Iterator[None]:
    """Compare surfaces at their corners and few points more, where their distance is no subject."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weighing, "SAMPLES", 100)
        yield


@pytest.fixture
def write_site(tmp_path: Path) -> Callable[..., str]:
    """Write a site's YAML: of a box, at a step of 1 ms, unless the text says more."""

    def write(text: str = "", name: str = "rock") -> str:
        path = tmp_path / f"{name}.yaml"
        text = text if text.lstrip().startswith("rock:") else BOX + text
        text = text if "simulation:" in text else f"{text}\n{STEP}"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser; the test is skipped where there is none."""
    with chromium() as running:
        yield running


@pytest.fixture
def opened(browser: Any) -> Iterator[Opened]:
    """Open files in a browser; at the end they have said no error and asked for nothing else."""
    with watched(browser) as open_page:
        yield open_page


@pytest.fixture
def derived(tmp_path: Path) -> Path:
    """A folder for products that does not exist yet."""
    return tmp_path / "derived"


@pytest.fixture(scope="module")
def quick_time_step() -> Iterator[None]:
    """Measure the time step on one row a direction at two steps: enough where it is no subject."""
    module = "vsr_core.run.time_step"
    with pytest.MonkeyPatch.context() as patch:
        for engine, shares in (("bullet", (0.006, 0.003)), ("nonsmooth", (0.02, 0.01))):
            path = f"vsr_core.engines.{engine}.LADDER"
            patch.setattr(path, replace(load(engine).LADDER, shares=shares))
        patch.setattr(f"{module}.ENOUGH", 1)
        patch.setattr(f"{module}.BOX_PERIODS", (0.6,))
        patch.setattr(f"{module}.HULL_PERIODS", (0.45,))
        yield


@pytest.fixture
def vsr(
    capsys: pytest.CaptureFixture[str], derived: Path, quick_time_step: None
) -> Callable[..., Ran]:
    """Run a command in this process, with products in ``derived``."""

    def run(*arguments: object, into: Path | None = None) -> Ran:
        capsys.readouterr()
        try:
            code = cli.main([*map(str, arguments), "--derived", str(into or derived)])
        except SystemExit as end:
            code = int(end.code or 0)
        said = capsys.readouterr()
        return Ran(code, said.out, said.err)

    return run


@pytest.fixture
def refused(vsr: Callable[..., Ran], derived: Path) -> Callable[..., str]:
    """Run a command that must be refused in one line holding all ``words``.

    It leaves no file, but for a page that shows why and that the line names.
    """

    def run(*arguments: object, words: tuple[str, ...], page: str = "") -> str:
        ran = vsr(*arguments)
        assert ran.code == cli.REFUSED, ran.err
        lines = [line for line in ran.err.splitlines() if not line.endswith(" s so far")]
        assert len(lines) == 1, ran.err
        assert lines[0].startswith("vsr: ")
        assert "Traceback" not in lines[0]
        assert [word for word in words if word not in lines[0]] == [], lines[0]
        # where: got what was given, unless the rule says it; the rule; the remedy
        assert lines[0].count("; ") >= 1 + (": got " in lines[0])
        left = [path for path in derived.rglob("*") if path.is_file()]
        left = [path for path in left if path.parent.name != ".stages"]
        assert [path.name for path in left] == [page] * bool(page)
        assert all(f"; {path} shows it" in lines[0] for path in left)
        return lines[0]

    return run


@pytest.fixture
def code_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of the packages whose code is traced in place of the real one."""
    folder = tmp_path / "code"
    skip = shutil.ignore_patterns("__pycache__")
    for package in tracing.PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=skip)
    monkeypatch.setattr(tracing, "ROOT", folder)
    forget_code()
    yield folder
    monkeypatch.undo()
    forget_code()


def forget_code() -> None:
    """Digests of code are kept for the life of a process; drop them after an edit."""
    tracing._definition.cache_clear()
    tracing._parse.cache_clear()
    tracing._texts.cache_clear()


@pytest.fixture
def edit_function(code_copy: Path) -> Callable[[str, str, str], None]:
    """Insert a line as the first statement of a top-level function, after its docstring."""

    def edit(module: str, function: str, line: str) -> None:
        path = code_copy / module
        lines = path.read_text().splitlines(keepends=True)
        for node in ast.parse("".join(lines)).body:
            if isinstance(node, ast.FunctionDef) and node.name == function:
                first = node.body[1] if ast.get_docstring(node) else node.body[0]
                path.write_text(
                    "".join(
                        [*lines[: first.lineno - 1], f"    {line}\n", *lines[first.lineno - 1 :]]
                    )
                )
                forget_code()
                return
        raise AssertionError(function)

    return edit
