"""Counts and lists in sentences, for pages and for what a command says."""

from __future__ import annotations

from collections.abc import Sequence


def many(count: int) -> str:
    """A count with narrow spaces between thousands."""
    return f"{count:,}".replace(",", "\u202f")


def form(count: int, one: str, several: str) -> str:
    """The form of a word that goes with a count."""
    return one if count == 1 else several


def counted(count: int, noun: str, nouns: str = "") -> str:
    """A count with its noun."""
    return f"{many(count)} {form(count, noun, nouns or f'{noun}s')}"


def listed(names: Sequence[str]) -> str:
    """Names in a sentence."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
