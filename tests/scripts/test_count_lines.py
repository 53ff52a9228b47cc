"""Lines of rooms are counted as what they are."""

from __future__ import annotations

from pathlib import Path

from scripts.count_lines import by_room, counted

MODULE = '''"""Two lines
of a module."""

# A comment.
import math

HALF = 0.5
"""Of a thing."""


def area(radius: float) -> float:
    """Of a circle."""
    text = """of two
lines"""
    return math.pi * (
        radius
    ) ** 2  # square


class Empty:
    ...
'''


def test_each_line_is_code_or_docstring_or_neither() -> None:
    found = counted(MODULE)
    assert found["lines"] == 21
    assert found["docstrings"] == 4  # two of the module, one of the constant, one of the function
    assert found["code"] == 10  # a text that is assigned is code, and so is an ellipsis


def test_a_room_holds_its_own_files_only(tmp_path: Path) -> None:
    inner = tmp_path / "house" / "room"
    inner.mkdir(parents=True)
    for path in (inner.parent / "one.py", inner / "two.py", inner / "three.py"):
        path.write_text(MODULE)
    found = by_room(tmp_path / "house")
    assert {room: lines["files"] for room, lines in found.items()} == {"house": 1, "house/room": 2}
    assert found["house/room"]["code"] == 2 * found["house"]["code"]
