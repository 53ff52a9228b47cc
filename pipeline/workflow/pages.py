"""Pages from their templates, which stand beside the stages whose pages they are."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, TemplateSyntaxError, meta

from pipeline import ROOT
from pipeline.config.problems import edited_since
from pipeline.workflow import grammar
from pipeline.workflow.keys import digest_bytes

_DASH = "\N{EN DASH}"
"""Stands for a number that is not known."""


def filled(name: str, facts: dict[str, Any], up: str = "../") -> str:
    """A template with all its places filled; one that is not among ``facts`` is an error.

    Everything is escaped: names and paths are the user's.

    Parameters
    ----------
    up : str, the way from the page to the folder of all results, as a link has it
    """
    return _environment().get_template(name).render(facts, up=up)


def source(name: str) -> str:
    """Text of a template, style sheet, script or table of this package, by its file name."""
    text = texts().get(name, b"")
    if text.endswith(b"\n") and (b"<!DOCTYPE" not in text or b"</html>" in text):
        try:
            return text.decode()
        except UnicodeDecodeError as error:
            raise edited_since(name, f"one that is saved in part ({error})") from None
    given = "one that is saved in part" if text else "nothing when a command began that needs it"
    raise edited_since(name, given)


def digest(name: str) -> str:
    """Digest of a template and all it is made of, for the key of the stage whose page it is."""
    text = source(name)
    return digest_bytes(text.encode(), *(digest(part).encode() for part in _parts(text)))


@cache
def _parts(text: str) -> list[str]:
    """Names of the templates that a template names; to parse one takes 5 ms."""
    try:
        return sorted(filter(None, meta.find_referenced_templates(_environment().parse(text))))
    except TemplateSyntaxError as error:
        raise edited_since("a template", f"one that is saved in part ({error})") from None


@cache
def texts() -> dict[str, bytes]:
    """All of them, read together: what is edited while a command is at work is for the next one."""
    found = (path for path in (ROOT / "pipeline").rglob("*") if path.suffix in _SUFFIXES)
    return {path.name: path.read_bytes() for path in found if path.is_file()}


def edited() -> list[str]:
    """Those that are gone by now, or say something else."""
    by_now = texts.__wrapped__()
    return [name for name, text in texts().items() if by_now.get(name) != text]


_SUFFIXES = (".html", ".css", ".js", ".yaml")


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FunctionLoader(source),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"number": _number, "fixed": _fixed}
    words = (grammar.many, grammar.counted, grammar.form, grammar.listed)
    environment.globals |= {word.__name__: word for word in words}
    return environment


def _number(value: float, digits: int = 3, limit: float = math.nan) -> str:
    """A number to so many significant digits; a dash where it is not known.

    It has more where fewer would set it beyond a limit that it is within, or within one that it
    is beyond.

    >>> _number(0.012345), _number(math.nan), _number(1.0004, 2, limit=1.0)
    ('0.0123', '–', '1.0004')
    """
    while (float(f"{value:.{digits}g}") > limit) != (value > limit):
        digits += 1
    return _DASH if math.isnan(value) else f"{value:.{digits}g}"


def _fixed(value: float, digits: int = 3) -> str:
    """A number with so many decimals; a dash where it is not known.

    >>> _fixed(0.5), _fixed(math.nan)
    ('0.500', '–')
    """
    return _DASH if math.isnan(value) else f"{value:.{digits}f}"
