"""Machine code is that of the source as it is, with all that it reaches, wherever it is kept."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

from pipeline import ROOT
from vsr_core.compiled import compiling

CORE = ROOT / "vsr_core"

CHAIN = {
    "asked.py": "from vsr_core.compiled.compiling import compiled\n"
    "from vsr_core.doubled import doubled\n\n"
    "@compiled\ndef asked(x):\n    return doubled(x) + 1.0\n",
    "doubled.py": "from vsr_core.compiled.compiling import compiled\n"
    "from vsr_core import shared\n\n"
    "@compiled\ndef doubled(x):\n    return 2.0 * x * shared.SHARE\n",
    "shared.py": "from vsr_core.limits import LEAST\n\nSHARE = 10.0 * LEAST\n",
    "limits.py": "LEAST = 0.5\nOTHER = 3\n",
}
"""A compiled function, and a constant three imports away."""

ASK = (
    "from vsr_core.asked import asked; print(asked(1.0), sum(asked.stats.cache_hits.values()) > 0)"
)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A package with the way of compiling of the real one, and the chain of modules."""
    core = tmp_path / "vsr_core"
    for room in ("source", "compiled"):
        shutil.copytree(CORE / room, core / room, ignore=shutil.ignore_patterns("__pycache__"))
    (core / "__init__.py").write_text("")
    for name in ("vectors.py", "records.py"):
        (core / "compiled" / name).unlink()
    for name, text in CHAIN.items():
        (core / name).write_text(text)
    return core


def ask(core: Path, times: int = 1) -> list[str]:
    """What new processes, begun at once, compute with the package; and if from kept code."""
    known = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    asking = [
        subprocess.Popen(
            [sys.executable, "-c", ASK],
            cwd=core.parent,
            env={**known, "XDG_CACHE_HOME": str(core.parent / "caches")},
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(times)
    ]
    return [process.communicate()[0].strip() for process in asking]


def test_a_constant_three_imports_away_changes_the_numbers(small: Path) -> None:
    assert ask(small) == ["11.0 False"]
    limits = small / "limits.py"
    limits.write_text(limits.read_text().replace("0.5", "0.7"))
    assert [line.split()[0] for line in ask(small, times=2)] == ["15.0", "15.0"]
    limits.write_text(limits.read_text().replace("OTHER = 3", "OTHER = 4"))
    assert ask(small) == ["15.0 True"]  # nothing compiled reaches that


def test_it_does_where_nothing_can_be_written_beside_the_source(small: Path) -> None:
    (small / "__pycache__").write_text("")  # no folder, and none can be made
    assert ask(small) == ["11.0 False"]
    limits = small / "limits.py"
    limits.write_text(limits.read_text().replace("0.5", "0.7"))
    assert ask(small) == ["15.0 False"]
    assert ask(small) == ["15.0 True"]


def test_importing_compiled_code_reads_no_source_and_changes_no_setting(small: Path) -> None:
    code = (
        "import numba; before = numba.config.CACHE_DIR; from vsr_core import asked;"
        "print(numba.config.CACHE_DIR == before)"
    )
    given = {"cwd": small.parent, "capture_output": True, "text": True, "check": True}
    asked = subprocess.run([sys.executable, "-c", code], **given)  # type: ignore[call-overload]
    assert asked.stdout.strip() == "True"
    assert not list(small.glob("__pycache__/compiled-*"))


def test_constants_of_the_rules_are_among_what_it_is_compiled_from() -> None:
    rules = {
        "vsr_core:GRAVITY",
        "vsr_core.outcome:DISPLACED_SHARE",
        "vsr_core.judge.on_terrain:STAYS_SHARE",
    }
    assert rules <= set(compiling.compiled_from())


def test_every_compiled_function_is_among_it() -> None:
    """As Python has them once they are imported, whatever the syntax shows."""
    compiled = {
        f"{it.__module__}:{it.__qualname__}"
        for name in ("vsr_core.run.displacement", "vsr_core.run.overturning")
        if import_module(name)
        for module, loaded in list(sys.modules.items())
        if module.startswith("vsr_core")
        for it in vars(loaded).values()
        if isinstance(it, Dispatcher)
    }
    assert len(compiled) > 100
    assert compiled - set(compiling.compiled_from()) == set()
