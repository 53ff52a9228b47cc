"""Writers of products: a text, bytes, a table."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

Writer = Callable[[Path], None]
"""Writes a product to a path."""


def text(content: str) -> Writer:
    """Writer of a text.

    Returns
    -------
    Writer
        It writes UTF-8, with line ends as they are.
    """
    return binary(content.encode())


def binary(content: bytes) -> Writer:
    """Writer of bytes, such as a picture."""

    def write(path: Path) -> None:
        path.write_bytes(content)

    return write


def moved(part: Path) -> Writer:
    """Writer of what is written already, on the same disk, which then is gone from there."""

    def write(path: Path) -> None:
        part.replace(path)

    return write


_AT_ONCE = 1000
"""Rows written at once: of a table with a column for each of many branches pandas writes few."""


def table(frame: pd.DataFrame) -> Writer:
    """Writer of a table as CSV, numbers to six digits.

    Parameters
    ----------
    frame : DataFrame
        An empty text is an empty field; NaN is written as ``nan``. A text that a spreadsheet would
        take for a formula is written behind an apostrophe, in headings too.
    """
    return tables([frame])


def tables(frames: Iterable[pd.DataFrame]) -> Writer:
    """The same of a table that comes in parts, all with the same columns."""

    def write(path: Path) -> None:
        with path.open("w", encoding="utf-8", newline="") as file:
            for number, frame in enumerate(frames):
                shown = frame.map(_shown).rename(columns=_shown)
                shown.to_csv(
                    file, header=not number, index=False, lineterminator="\r\n", chunksize=_AT_ONCE
                )

    return write


_FORMULA = re.compile(r"[\t\r]|[\s\ufeff\u200b]*[=+\-@\uff1d\uff0b\uff0d\uff20]")
"""Beginnings of what a spreadsheet would compute, or run: signs, also of full width, also after
what it leaves out."""

_NUMBER = re.compile(r"-?\d+(\.\d+)?")


def _shown(value: Any) -> Any:
    """The value as a table shows it.

    >>> _shown(0.1234567), _shown(1234567), _shown(" =1+1"), _shown(-1.5), _shown("-90.0")
    ('0.123457', 1234567, "' =1+1", '-1.5', '-90.0')
    """
    if isinstance(value, str) and _FORMULA.match(value) and not _NUMBER.fullmatch(value):
        return f"'{value}"
    return f"{value:.6g}" if isinstance(value, float) else value


_MARK = re.compile(r"<!--other settings-->.*?<!--/other settings-->\n", re.DOTALL)


def marked(page: str, reason: str) -> str:
    """A page that says at its head that other settings made it, and why; without a reason, not.

    >>> marked("<body><h1>Rock</h1>", "")
    '<body><h1>Rock</h1>'
    """
    page = _MARK.sub("", page)
    if not reason:
        return page
    words = f"This page was made with other settings ({html.escape(reason)}); make it again."
    head = f'<p class="note" role="note"><strong>Stale.</strong> {words}</p>'
    mark = f"<!--other settings-->{head}<!--/other settings-->\n"
    return re.sub(r"<body[^>]*>\n?", lambda body: body[0] + mark, page, count=1)
