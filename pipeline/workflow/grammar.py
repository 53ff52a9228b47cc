"""Counts and lists in sentences, for pages and for what a command says."""

from __future__ import annotations

from collections.abc import Sequence


def many(count: int) -> str:
    """A count with narrow spaces between thousands.

    >>> many(12345).split()
    ['12', '345']
    """
    return f"{count:,}".replace(",", "\u202f")


def form(count: int, one: str, several: str) -> str:
    """The form of a word that goes with a count.

    >>> form(1, "was", "were"), form(0, "was", "were")
    ('was', 'were')
    """
    return one if count == 1 else several


def counted(count: int, noun: str, nouns: str = "") -> str:
    """A count with its noun.

    >>> counted(1, "branch", "branches"), counted(9, "run")
    ('1 branch', '9 runs')
    """
    return f"{many(count)} {form(count, noun, nouns or f'{noun}s')}"


def listed(names: Sequence[str]) -> str:
    """Names in a sentence.

    >>> listed([]), listed(["3"]), listed(["3", "7"]), listed(["3", "7", "9"])
    ('', '3', '3 and 7', '3, 7 and 9')
    """
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
