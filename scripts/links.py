"""Links and pictures that lead nowhere, in the pages of a checkout and in a site that was built."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

_FENCE = re.compile(r"^ *```.*?^ *```$", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_TEMPLATES = "_static"
"""Folder of a site with the theme's own files, whose places are not filled in."""
_CARRYING = {"a": "href", "link": "href", "img": "src", "script": "src", "source": "src"}


def dead_in_checkout(root: Path) -> list[str]:
    """Links and pictures of a checkout's pages and notebooks that are not files of it.

    Parameters
    ----------
    root : Path

    Returns
    -------
    list of str, each a page and what it leads to
    """
    pages = [
        *root.glob("*.md"),
        *(root / "docs").rglob("*.md"),
        *(root / "notebooks").glob("*.md"),
        *(root / "notebooks").glob("*.ipynb"),
    ]
    found = (
        (page, link)
        for page in sorted(pages)
        for link in _LINK.findall(_FENCE.sub("", page.read_text(encoding="utf-8")))
    )
    return [
        f"{page.relative_to(root)}: {link}"
        for page, link in found
        if (path := _local(link)) and not (page.parent / path).exists()
    ]


def dead_in_site(site: Path) -> list[str]:
    """Links, pictures and scripts of a built site whose file, or place in a page, is not there.

    Parameters
    ----------
    site : Path

    Returns
    -------
    list of str, each a page and what it leads to
    """
    return [
        f"{page.relative_to(site)}: {link}"
        for page in sorted(site.rglob("*.html"))
        if _TEMPLATES not in page.parts
        for link in dict.fromkeys(_read(page)[0])
        if not _leads(page, link)
    ]


def _leads(page: Path, link: str) -> bool:
    path, place = _local(link), unquote(urlsplit(link).fragment)
    if path is None:
        return True
    target = (page.parent / path).resolve() if path else page
    if not target.is_file():
        return False
    return not place or target.suffix != ".html" or place in _read(target)[1]


def _local(link: str) -> str | None:
    """Path of a link without its place in the page; none where it leads elsewhere."""
    parts = urlsplit(link)
    return None if parts.scheme or parts.netloc else unquote(parts.path)


@cache
def _read(page: Path) -> tuple[tuple[str, ...], frozenset[str]]:
    """What a page leads to, and the places in it that can be led to."""
    reader = _Reader()
    reader.feed(page.read_text(encoding="utf-8"))
    return tuple(reader.links), frozenset(reader.places)


class _Reader(HTMLParser):
    """Collects links and places of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take what a tag leads to, and its name.

        Parameters
        ----------
        tag : str
        attrs : list of (name, value)
        """
        given = dict(attrs)
        self.places |= set(self._values(given, "id", "name"))
        self.links += self._values(given, _CARRYING.get(tag, ""))

    @staticmethod
    def _values(given: dict[str, str | None], *names: str) -> Iterator[str]:
        return (value for name in names if (value := given.get(name)))
