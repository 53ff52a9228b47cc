"""The texts of pages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.config.problems import InputError
from pipeline.workflow import pages


@pytest.fixture
def template(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A template beside a style sheet, in place of the real ones."""
    folder = tmp_path / "pipeline"
    folder.mkdir()
    (folder / "page.css").write_text("a {}\n")
    (folder / "page.html").write_text("{{ words }}\n")
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    forget()
    yield folder / "page.html"
    forget()


def forget() -> None:
    for kept in (pages.texts, pages._environment, pages._parts):
        kept.cache_clear()


def save(template: Path, text: bytes | None) -> None:
    """Save a template, or move it away."""
    if text is None:
        template.unlink()
    else:
        template.write_bytes(text)


@pytest.mark.parametrize("later", [b"{{ words", b"other words", b"caf\xc3", None])
def test_a_page_is_made_of_what_its_key_is_of(template: Path, later: bytes | None) -> None:
    """Though its template is edited, saved half-written or moved while the command is at work."""
    pages.source("page.css")
    save(template, later)
    before = pages.digest("page.html")
    assert pages.edited() == ["page.html"]
    assert pages.filled("page.html", {"words": "said"}) == "said"
    forget()
    template.write_text("{{ words }}\n")
    assert pages.digest("page.html") == before


@pytest.mark.parametrize(
    "before",
    [
        b"{{ words }}",
        b"<!DOCTYPE html>\n",
        b"{% if words %}\n",
        b"{% include 'other.html' %}\n",
        b"",
        b"caf\xc3\n",
        None,
    ],
)
def test_a_template_that_is_no_page_when_a_command_begins_is_refused(
    template: Path, before: bytes | None
) -> None:
    """Saved in part just then, or moved, or naming one that is."""
    save(template, before)
    with pytest.raises(InputError, match="give the same command again"):
        pages.digest("page.html")
