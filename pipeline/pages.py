"""Pages from their templates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.keys import digest_file

_TEMPLATES = Path(__file__).with_name("templates")


def filled(name: str, facts: dict[str, Any]) -> str:
    """A template with all its places filled; one that is not among ``facts`` is an error.

    Everything is escaped: names and paths are the user's.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string((_TEMPLATES / name).read_text(encoding="utf-8"))
    return template.render(facts)


def digest(name: str) -> str:
    """Digest of a template, for the identity of the stage whose page it is."""
    return digest_file(_TEMPLATES / name)
