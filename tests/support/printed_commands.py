"""Commands that the documentation prints, and those of them that it says are refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from pipeline import ROOT

PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "notebooks").glob("*.md")]
)
FENCE = re.compile(r"^ *```(\w+)\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)
SPAN = re.compile(r"(?<!`)`([^`]+)`(?!`)")
BEGINNINGS = ("make ", "vsr ", ".venv/bin/", "python ")
OPEN = re.compile(r"\.\.\.|[<>…]|^\[-|(?<!\d)\]$")
"""What stands for a value that the reader puts in."""


def commands(page: Path) -> Iterator[str]:
    """Command lines of a page, in fences and in the text."""
    text = page.read_text(encoding="utf-8")
    for kind, body in FENCE.findall(text):
        lines = re.sub(r"\\\n\s*", " ", body).splitlines()
        if kind == "bash":
            yield from (line.strip() for line in lines)
        elif kind == "console":
            yield from (line.strip()[2:] for line in lines if line.strip().startswith("$ "))
    if page.name != "CHANGELOG.md":  # which tells of commands of its day
        for span in SPAN.findall(FENCE.sub("", text)):
            if span.startswith(BEGINNINGS) and " " in span.strip():
                yield " ".join(span.split())


def refusals() -> list[tuple[str, str]]:
    """Commands on the page of errors, each with the line that it is said to end with."""
    text = (ROOT / "docs" / "faq.md").read_text(encoding="utf-8")
    fences = [body for kind, body in FENCE.findall(text) if kind == "console"]
    lines = [line for body in fences for line in body.splitlines()]
    return list(zip(lines[::2], lines[1::2], strict=True))


REFUSED = dict(refusals())
