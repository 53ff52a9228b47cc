"""What definitions reach, in a small project: all that they use, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from vsr_core.source import tracing

TREE = {
    "vsr_core/__init__.py": 'G = 9.8\n"""text"""\n',
    "vsr_core/helper.py": (
        "LIMIT = 3\n"
        "TABLE: dict = {1: 2}\n"
        "def used(x):\n    return deeper(x) + LIMIT\n"
        "def deeper(x):\n    return x\n"
        "def unused(x):\n    return x\n"
    ),
    "vsr_core/attribute.py": "def reached(x):\n    return x\ndef not_reached(x):\n    return x\n",
    "vsr_core/front.py": "from vsr_core.behind import hidden as shown\n",
    "vsr_core/behind.py": "def hidden(x):\n    return x\n",
    "vsr_core/late.py": "def inside(x):\n    return x\n",
    "vsr_core/kinds.py": (
        "class Base:\n    def low(self):\n        return 1\n"
        "class Kind(Base):\n    def act(self):\n        return 1\n"
    ),
    "vsr_core/wraps.py": "def mark(f):\n    return f\n",
    "pipeline/__init__.py": "",
    "pipeline/main.py": (
        "import numpy as np\n"
        "import vsr_core.attribute\n"
        "from vsr_core import G, attribute\n"
        "from vsr_core.helper import used as renamed\n"
        "from vsr_core.front import shown\n"
        "from vsr_core.kinds import Kind\n"
        "from vsr_core.wraps import mark\n"
        "@mark\n"
        "def root(x):\n"
        '    """What it does."""\n'
        "    from vsr_core import late\n"
        "    # why\n"
        "    return renamed(x) + attribute.reached(x) + shown(x) + late.inside(x) * G * np.pi\n"
        "def second(x, kind: Kind):\n    return kind.act()\n"
    ),
}


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A small project that is traced in place of the real one."""
    for name, text in TREE.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    monkeypatch.setattr(tracing, "ROOT", tmp_path)
    forget()
    yield tmp_path
    monkeypatch.undo()
    forget()


def forget() -> None:
    tracing._definition.cache_clear()
    tracing._parse.cache_clear()
    tracing._texts.cache_clear()


def closure(*roots: str) -> dict[str, str]:
    forget()
    return tracing.reached(roots or ("pipeline.main:root",))


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


def test_closure_is_what_is_reached(tree: Path) -> None:
    assert set(closure()) == {
        "pipeline.main:root",
        "vsr_core:G",
        "vsr_core.helper:used",
        "vsr_core.helper:deeper",
        "vsr_core.helper:LIMIT",
        "vsr_core.attribute:reached",
        "vsr_core.behind:hidden",
        "vsr_core.late:inside",
        "vsr_core.wraps:mark",
    }
    both = set(closure("pipeline.main:second"))
    assert both == {"pipeline.main:second", "vsr_core.kinds:Kind", "vsr_core.kinds:Base"}


@pytest.mark.parametrize(
    ("file", "old", "new", "changed"),
    [
        ("vsr_core/helper.py", "LIMIT = 3", "LIMIT = 4", "vsr_core.helper:LIMIT"),
        ("vsr_core/helper.py", "LIMIT = 3\n", "LIMIT = 3\nLIMIT += 1\n", "vsr_core.helper:LIMIT"),
        ("vsr_core/helper.py", "def deeper(x):\n", "def deeper(x, y=1):\n",
         "vsr_core.helper:deeper"),
        ("vsr_core/attribute.py", "def reached(x):\n    return x", "def reached(x):\n    return -x",
         "vsr_core.attribute:reached"),
        ("vsr_core/behind.py", "return x", "return 2 * x", "vsr_core.behind:hidden"),
        ("vsr_core/late.py", "return x", "return 2 * x", "vsr_core.late:inside"),
        ("vsr_core/wraps.py", "return f", "return f or 1", "vsr_core.wraps:mark"),
        ("vsr_core/__init__.py", "G = 9.8", "G = 9.81", "vsr_core:G"),
        ("pipeline/main.py", "@mark\n", "", "pipeline.main:root"),
    ],
)  # fmt: skip
def test_edit_of_what_is_used_is_noticed(
    tree: Path, file: str, old: str, new: str, changed: str
) -> None:
    before = closure()
    edit(tree / file, old, new)
    after = closure()
    assert after.get(changed) != before[changed]
    assert {name for name in after if after[name] != before.get(name)} == {changed}


def test_what_is_no_module_is_not_read(tree: Path) -> None:
    before = closure()
    (tree / "vsr_core/.#helper.py").symlink_to("somebody@somewhere.1:2")
    (tree / "vsr_core/folder.py").mkdir()
    tracing._files.cache_clear()
    assert closure() == before


def test_what_counts_is_the_text_when_all_are_first_asked_for(tree: Path) -> None:
    """Not that at the time when a definition is first reached: it may be imported by then."""
    before = closure()
    forget()
    tracing.texts()
    edit(tree / "vsr_core/helper.py", "LIMIT = 3", "LIMIT = 4")
    assert tracing.reached(["pipeline.main:root"]) == before
    now = tracing.by_now(before)
    assert {name for name in before if now[name] != before[name]} == {"vsr_core.helper:LIMIT"}
    (tree / "vsr_core/late.py").unlink()
    assert before.keys() - tracing.by_now(before) == {"vsr_core.late:inside"}


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("pipeline/main.py", "    # why\n", ""),
        ("pipeline/main.py", '"""What it does."""', '"""Something else,\n\n    at length."""'),
        ("pipeline/main.py", '    """What it does."""\n', ""),
        ("pipeline/main.py", "def root(x):\n", "\n\n\ndef root( x ):\n\n"),
        ("pipeline/main.py", "def second(x, kind: Kind):\n", "def second(x, kind: Kind, z=1):\n"),
        ("vsr_core/helper.py", "def unused(x):\n    return x\n", ""),
        ("vsr_core/helper.py", "TABLE: dict = {1: 2}", "TABLE: dict = {1: 3}"),
        ("vsr_core/helper.py", "LIMIT = 3\n", "LIMIT = 3  # of a kind\n"),
        ("vsr_core/attribute.py", "def not_reached(x):", "def not_reached(x, y):"),
        ("vsr_core/__init__.py", '"""text"""', '"""another text"""'),
    ],
)
def test_edit_of_what_is_not_used_is_not(tree: Path, file: str, old: str, new: str) -> None:
    before = closure()
    edit(tree / file, old, new)
    assert closure() == before
