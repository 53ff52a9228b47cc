"""How large the house is: files, lines, code and docstrings of each room.

    python -m scripts.count_lines            the two packages
    python -m scripts.count_lines tests      other folders

Docstrings are those of modules, classes and functions and those below constants. What is left of
them, of comments and of blank lines is code.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

from pipeline import ROOT

ROOMS = ("pipeline", "vsr_core")

_NO_CODE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENDMARKER,
}  # fmt: skip


def counted(text: str) -> Counter[str]:
    r"""Lines of a module by what they are.

    Examples
    --------
    >>> found = counted('ONE = 1\n"First."\n\n# Why.\ntwo = (\n    2,\n)  # so\n')
    >>> found["lines"], found["code"], found["docstrings"]
    (7, 4, 1)
    """
    told = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    filled = {
        line
        for token in tokens
        if token.type not in _NO_CODE
        for line in range(token.start[0], token.end[0] + 1)
    }
    lines = len(text.splitlines())
    return Counter(files=1, lines=lines, code=len(filled - told), docstrings=len(told))


def by_room(root: Path) -> dict[str, Counter[str]]:
    """Lines of each folder of a package, without those of the folders in it, and of all."""
    found: dict[str, Counter[str]] = {}
    for path in sorted(root.rglob("*.py")):
        lines = counted(path.read_text(encoding="utf-8"))
        room = path.parent.relative_to(root.parent).as_posix()
        found[room] = found.get(room, Counter()) + lines
    return found


def main(folders: list[str]) -> None:
    """Print a row for each room, most code first, and one for all."""
    rooms: dict[str, Counter[str]] = {}
    for folder in folders or ROOMS:
        rooms |= by_room(ROOT / folder)
    columns = ("files", "lines", "code", "docstrings")
    print(f"{'room':<40}", *(f"{column:>10}" for column in columns))
    whole = sum(rooms.values(), Counter())
    for room, lines in [*sorted(rooms.items(), key=lambda one: -one[1]["code"]), ("all", whole)]:
        print(f"{room:<40}", *(f"{lines[column]:>10}" for column in columns))


if __name__ == "__main__":
    main(sys.argv[1:])
