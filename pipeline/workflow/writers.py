"""Writers of products: a text, bytes, a table."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

Writer = Callable[[Path], None]
"""Writes a product to a path."""


def text(content: str) -> Writer:
    """Writer of a text."""

    def write(path: Path) -> None:
        path.write_text(content, encoding="utf-8")

    return write


def binary(content: bytes) -> Writer:
    """Writer of bytes, such as a picture."""

    def write(path: Path) -> None:
        path.write_bytes(content)

    return write


def table(columns: Sequence[str], records: Iterable[Mapping[str, Any]]) -> Writer:
    """Writer of these columns of records as CSV, numbers to six digits."""
    rows = [[_shown(record[name]) for name in columns] for record in records]

    def write(path: Path) -> None:
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([columns, *rows])

    return write


def _shown(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else value
