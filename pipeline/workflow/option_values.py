"""What the values of options are, and which are refused before a command begins."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from pipeline.config.paths import located
from pipeline.config.problems import InputError, Problem

MOST_WORKERS = 10_000
"""More worker processes than any machine starts."""

FEWEST_SHAPES = 100
"""Shapes from which equations can be fitted at all."""

_TOLD = ("site", "study", "table")
"""Options whose own refusals of an empty name say which names there are."""


class Stored(argparse.Action):
    """Keeps a value, of options that are given once.

    An empty one, as of a shell's variable that is not set, is not taken for none.

    Raises
    ------
    InputError
    """

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        if option_string and values == "" and self.dest not in _TOLD:
            remedy = f"leave it out, or give {option_string} {self.metavar}: {self.help}"
            raise InputError(Problem(option_string, "", "''", "an empty text is no value", remedy))
        given = vars(namespace).setdefault("given", set())
        if option_string and self.dest in given and values != getattr(namespace, self.dest):
            rule, remedy = "an option has one value", "leave out the others"
            raise InputError(Problem(option_string, "", "it twice", rule, remedy))
        given.add(self.dest)
        setattr(namespace, self.dest, values)


def workers(text: str) -> int:
    """A number of worker processes."""
    if not (text.isascii() and text.isdecimal() and len(text) < 10) or int(text) > MOST_WORKERS:
        rule = f"the number of workers is 0 to {MOST_WORKERS}"
        raise InputError(Problem("--workers", "", repr(text), rule, "e.g. 2"))
    return int(text)


def shapes(text: str) -> int:
    """A number of shapes that equations are fitted to."""
    if not (text.isascii() and text.isdecimal() and len(text) < 7) or int(text) < FEWEST_SHAPES:
        rule = f"the number of shapes is {FEWEST_SHAPES} to 999999"
        raise InputError(Problem("--shapes", "", repr(text), rule, "e.g. 1750"))
    return int(text)


def days(text: str) -> float:
    """An age in days."""
    number = text.removesuffix("d")
    if not (number.isascii() and number.isdecimal() and len(number) < 6):
        raise InputError(Problem("--older", "", repr(text), "an age is in whole days", "e.g. 30d"))
    return float(number)


def folder(text: str) -> Path:
    """A folder of results, which need not exist."""
    text = os.path.expanduser(text)  # noqa: PTH111 (a shell leaves ~ after =; no user's name: as is)
    if located(Path.cwd(), text, "--derived", "").is_file():
        rule = "results need a folder, and this is a file"
        raise InputError(Problem("--derived", "", text, rule, "give another path"))
    return Path.cwd() / text if text.startswith("~") else Path(text)  # libraries expand it, too
