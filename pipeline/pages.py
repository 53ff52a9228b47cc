"""Pages from their templates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.keys import digest_bytes

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES = Path(__file__).with_name("templates")


def filled(name: str, facts: dict[str, Any]) -> str:
    """A template with all its places filled; one that is not among ``facts`` is an error.

    Everything is escaped: names and paths are the user's.
    """
    return _environment().get_template(name).render(facts)


def digest(name: str) -> str:
    """Digest of a template and what it includes, for the identity of the stage whose page it is."""
    from jinja2 import meta

    text = (_TEMPLATES / name).read_text(encoding="utf-8")
    included = sorted(filter(None, meta.find_referenced_templates(_environment().parse(text))))
    return digest_bytes(text.encode(), *((_TEMPLATES / part).read_bytes() for part in included))


def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
