"""Machine code is that of the source as it is, with all that it reaches, wherever it is kept."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

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
    return written(tmp_path / "vsr_core")


def written(core: Path) -> Path:
    for room in ("source", "compiled"):
        shutil.copytree(CORE / room, core / room, ignore=shutil.ignore_patterns("__pycache__"))
    (core / "__init__.py").write_text("")
    for name in ("vectors.py", "records.py"):
        (core / "compiled" / name).unlink()
    for name, text in CHAIN.items():
        (core / name).write_text(text)
    return core


def ask(core: Path, times: int = 1, before: str = "", **environment: str) -> list[str]:
    """What new processes, begun at once, compute with the package; and if from kept code.

    Warnings of machine code follow on lines of their own.
    """
    known = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    caches = {"XDG_CACHE_HOME": str(core.parent / "caches")}
    asking = [
        subprocess.Popen(
            [sys.executable, "-c", f"{before}\n{ASK}"],
            cwd=core.parent,
            env={**known, **caches, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(times)
    ]
    answers = []
    for process in asking:
        answer, said = process.communicate()
        warned = [one.partition("Warning: ")[2] for one in said.splitlines() if "Warning: " in one]
        answers.append("\n".join([answer.strip(), *warned]))
    return answers


def kept(core: Path) -> list[Path]:
    """Files of machine code beside the source."""
    return sorted(path for path in core.glob("__pycache__/compiled-*/*/*") if path.is_file())


def edit(source: Path, old: str, new: str) -> None:
    """Change a file some seconds later: by its second and size Python knows what it has read."""
    before = source.stat().st_mtime
    source.write_text(source.read_text().replace(old, new))
    os.utime(source, (before + 2.0, before + 2.0))


def test_a_constant_three_imports_away_changes_the_numbers(small: Path) -> None:
    assert ask(small) == ["11.0 False"]
    limits = small / "limits.py"
    edit(limits, "0.5", "0.7")
    assert [line.split()[0] for line in ask(small, times=2)] == ["15.0", "15.0"]
    edit(limits, "OTHER = 3", "OTHER = 4")
    assert ask(small) == ["15.0 True"]  # nothing compiled reaches that


@pytest.mark.parametrize(
    "imported", [pytest.param("", marks=pytest.mark.slow), "from vsr_core import asked"]
)
def test_code_that_is_edited_once_it_is_read_is_not_kept(small: Path, imported: str) -> None:
    """Whether it is imported before that or afterwards: neither is what the folder is named by."""
    limits = small / "limits.py"
    lines = (
        "from pathlib import Path; from vsr_core.source import tracing; tracing.texts()",
        imported,
        "limits = Path('vsr_core/limits.py')",
        "limits.write_text(limits.read_text().replace('0.5', '0.75'))",
    )
    (said,) = ask(small, before="\n".join(lines))
    assert said.startswith("11.0 False" if imported else "16.0 False")
    assert "edited meanwhile, and it is not kept" in said
    assert not kept(small)
    assert ask(small) == ["16.0 False"]
    edit(limits, "0.75", "0.5")
    assert ask(small) == ["11.0 False"]


def test_code_that_is_not_optimized_is_another(small: Path) -> None:
    """Parts of it have places in memory that are those of one process, and are not kept."""
    assert ask(small, NUMBA_OPT="0") == ["11.0 False"]
    assert ask(small) == ["11.0 False"]


@pytest.mark.slow
def test_an_edit_counts_where_numba_is_told_to_keep_its_code(small: Path, tmp_path: Path) -> None:
    place = {"NUMBA_CACHE_DIR": str(tmp_path / "told")}
    assert ask(small, **place) == ["11.0 False"]
    limits = small / "limits.py"
    edit(limits, "0.5", "0.7")
    assert ask(small, **place) == ["15.0 False"]
    assert not kept(small)


class Runs:
    """What a pickle does when it is read."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return (os.mkdir, (str(self.path),))


DAMAGES: dict[str, tuple[Callable[[Path, bytes], Any], str]] = {
    "cut": (lambda path, code: path.write_bytes(code[: len(code) // 2]), "damaged"),
    "empty": (lambda path, code: path.write_bytes(b""), "damaged"),
    "of a terabyte": (lambda path, code: os.truncate(path, 1 << 40), "damaged"),
    "a folder": (lambda path, code: (path.unlink(), path.mkdir()), "cannot be read"),
    "a pipe": (lambda path, code: (path.unlink(), os.mkfifo(path)), "not used"),
    "in a folder of others": (
        lambda path, code: path.parent.chmod(0o777),
        "could be written by others",
    ),
    "of others": (lambda path, code: path.chmod(0o666), "could be written by others"),
}


@pytest.fixture
def sealed(tmp_path: Path) -> Path:
    """A file of code."""
    path = tmp_path / "compiled-0" / "module" / "code"
    path.parents[1].mkdir()
    compiling._seal(path, CODE)
    assert compiling._unsealed(path) == CODE
    compiling._tell.cache_clear()
    return path


CODE = bytes(range(250))


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_code_is_told_of_and_not_used(sealed: Path, damage: str) -> None:
    change, words = DAMAGES[damage]
    change(sealed, sealed.read_bytes())
    with pytest.warns(compiling.MachineCodeWarning, match=words) as told:
        assert compiling._unsealed(sealed) is None
    assert len(told) == 1


@pytest.mark.slow
def test_no_bit_of_code_is_believed_otherwise(sealed: Path) -> None:
    whole = sealed.read_bytes()
    flips = [(bit // 8, 1 << bit % 8) for bit in range(8 * len(whole))]
    with pytest.warns(compiling.MachineCodeWarning, match="damaged") as told:
        taken = [flip for flip in flips if _flipped(sealed, whole, *flip) is not None]
    assert taken == []
    assert len(told) == 1, "in one line"


def _flipped(path: Path, whole: bytes, at: int, bit: int) -> bytes | None:
    path.write_bytes(whole[:at] + bytes([whole[at] ^ bit]) + whole[at + 1 :])
    return compiling._unsealed(path)


def test_damaged_and_foreign_code_is_compiled_anew(small: Path) -> None:
    assert ask(small) == ["11.0 False"]
    one, other = kept(small)
    _flipped(one, whole := one.read_bytes(), len(whole) // 2, 8)
    other.write_bytes(pickle.dumps(Runs(small / "made")))
    (folder,) = small.glob("__pycache__/compiled-*")
    told = f"machine code: a file in {folder} is damaged; it is compiled anew"
    assert ask(small) == [f"11.0 False\n{told}"]
    assert not (small / "made").exists()
    one.write_bytes(other.read_bytes())  # sound, but of another function
    told = f"machine code: a file in {folder} is of another function; it is compiled anew"
    assert ask(small) == [f"11.0 False\n{told}"]


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Path, Path]]:
    """Folders of code beside the source and among the user's caches."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.setattr(compiling, "_BESIDE", tmp_path / "beside")
    compiling._folders.cache_clear()
    yield tmp_path / "beside" / compiling.name(), tmp_path / "caches" / "vsr" / compiling.name()
    monkeypatch.undo()
    compiling._folders.cache_clear()


def test_a_folder_that_others_can_write_to_is_not_used(places: tuple[Path, Path]) -> None:
    beside, users = places
    beside.mkdir(parents=True)
    beside.chmod(0o777)
    with pytest.warns(compiling.MachineCodeWarning, match="could be written by others"):
        assert compiling._folders() == (users,)


def test_code_of_root_is_read_by_who_cannot_write_beside_it(
    places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in an image that root has made."""
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != places[0])
    places[0].mkdir(parents=True)
    assert compiling._folders() == places
    for user, mode, own in ((0, 0o644, True), (0, 0o664, False), (1234, 0o600, False)):
        state = os.stat_result((mode, 0, 0, 1, user, 0, 0, 0, 0, 0))
        assert compiling._is_own(state) == own


NOBODY, STRANGER = 65534, 1234
AS_NOBODY = (
    "import os, numba; numba.njit(lambda x: x + 1.0)(1.0);"
    f"os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY})"
)
"""All that Numba imports is imported before: what it is installed in may be root's alone."""


@pytest.fixture
def image() -> Iterator[Path]:
    """A package that everybody may read, with machine code that root has made of it."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        pytest.skip("only root can be another user")
    with tempfile.TemporaryDirectory(prefix="vsr-image-") as folder:
        Path(folder).chmod(0o755)
        core = written(Path(folder) / "vsr_core")
        assert ask(core) == ["11.0 False"]
        (core.parent / "caches").mkdir()
        os.chown(core.parent / "caches", NOBODY, NOBODY)
        yield core


@pytest.mark.slow
def test_a_user_takes_code_that_root_has_made_in_an_image(image: Path) -> None:
    assert ask(image, before=AS_NOBODY) == ["11.0 True"]
    assert not [path for path in image.parent.glob("caches/**/*") if path.is_file()]


@pytest.mark.parametrize("what", [pytest.param("folder", marks=pytest.mark.slow), "files"])
def test_code_of_another_user_is_not_used(image: Path, what: str) -> None:
    """One line says so, and it is compiled into a folder of one's own, to be used from then on."""
    (folder,) = image.glob("__pycache__/compiled-*")
    for path in [folder] if what == "folder" else kept(image):
        os.chown(path, STRANGER, STRANGER)
    whose = folder if what == "folder" else f"a file in {folder}"
    told = f"machine code: {whose} could be written by others and is not used"
    told += "; it is compiled anew"
    assert ask(image, before=AS_NOBODY) == [f"11.0 False\n{told}"]
    own = [path for path in image.parent.glob("caches/vsr/compiled-*/*/*") if path.is_file()]
    assert len(own) == 2
    assert {path.stat().st_uid for path in own} == {NOBODY}
    assert ask(image, before=AS_NOBODY) == [f"11.0 True\n{told}"]


@pytest.mark.slow
def test_a_full_disk_costs_the_time_to_compile(small: Path) -> None:
    full = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))"
    number, *said = ask(small, before=full)[0].splitlines()
    assert number == "11.0 False"
    assert len(said) == 1
    assert "cannot be written to" in said[0]
    assert not kept(small)


@pytest.mark.slow
def test_it_does_where_nothing_can_be_written_beside_the_source(small: Path) -> None:
    (small / "__pycache__").write_text("")  # no folder, and none can be made
    assert ask(small) == ["11.0 False"]
    limits = small / "limits.py"
    edit(limits, "0.5", "0.7")
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
