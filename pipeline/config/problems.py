"""Input errors as one line each: where, what was given, the rule, the remedy."""

from __future__ import annotations

from dataclasses import dataclass

from vsr_core.errors import InvalidInput

LONGEST = 300
"""Characters of each part of a line: enough for a path or a list of names."""


@dataclass(frozen=True)
class Problem:
    """One thing wrong with what the user gave; ``given`` is empty where the rule says it.

    Examples
    --------
    >>> print(Problem("my.yaml", "yaw", "700", "yaw is at most 360 degrees", "subtract 360"))
    my.yaml: yaw: got 700; yaw is at most 360 degrees; subtract 360
    >>> print(Problem("my.yaml", "yow", "", "unknown key", "did you mean yaw?"))
    my.yaml: yow: unknown key; did you mean yaw?
    """

    file: str
    key: str
    given: str
    rule: str
    remedy: str

    def __str__(self) -> str:
        where = ": ".join(_short(part) for part in (self.file, self.key) if part)
        given = f"got {_short(self.given)}; " if self.given else ""
        line = f"{where}: {given}{_short(self.rule)}; {_short(self.remedy)}"
        return printable(" ".join(line.split()))


def printable(text: str) -> str:
    r"""A text that a terminal can show; the narrow space of large numbers is one that it can.

    >>> print(printable("\x1b é"))
    \x1b é
    """
    return "".join(
        letter if letter.isprintable() or letter == "\u202f" else ascii(letter)[1:-1]
        for letter in text
    )


def _short(part: str) -> str:
    """What fits in a line: of what is longer, the beginning and the end."""
    return part if len(part) <= LONGEST else f"{part[: LONGEST - 40]} ... {part[-35:]}"


class InputError(Exception):
    """Usage or input that cannot be worked with; exit code 2."""

    def __init__(self, *problems: Problem) -> None:
        super().__init__("\n".join(map(str, problems)))
        self.problems = problems

    @classmethod
    def from_invalid(cls, file: str, key: str, error: InvalidInput) -> InputError:
        """The physics' refusal, with the file and key it came from."""
        return cls(Problem(file, key, error.given, error.rule, error.remedy))


def not_found(file: str, key: str, path: object) -> InputError:
    """The refusal of a path where there is no file."""
    return InputError(Problem(file, key, "", f"file not found: {path}", "check the path"))


def edited_since(file: str, given: str) -> InputError:
    """What a command ends with where its settings or files changed under it."""
    rule = "files stay as they are until their command has ended"
    remedy = "give the same command again, in a session of Python after a restart"
    return InputError(Problem(file, "", given, rule, remedy))


STAYS = (
    "finished stages and the runs in runs.sqlite are kept, and the same command goes on from there"
)
"""Of a command that ended early."""


class Unfinished(Exception):
    """Work that something outside ended early; exit code 1."""
