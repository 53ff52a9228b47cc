"""The exception for input that the physics cannot accept, and what errors of libraries say."""

from __future__ import annotations

from collections.abc import Iterable


class InvalidInput(ValueError):
    """Input that breaks a rule; the message says what was given, the rule and the remedy.

    Parameters
    ----------
    given, rule, remedy : str
        Three short phrases without a full stop.
    """

    def __init__(self, given: str, rule: str, remedy: str) -> None:
        super().__init__(f"{given}; {rule}; {remedy}")
        self.given = given
        self.rule = rule
        self.remedy = remedy

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[str, str, str]]:
        return (InvalidInput, (self.given, self.rule, self.remedy))


class InvalidPlace(InvalidInput):
    """Input that breaks a rule at known places.

    Parameters
    ----------
    given, rule, remedy : str
        As of ``InvalidInput``; where it is, is added by who knows the user's coordinates.
    places : k points of three floats [m]
    """

    def __init__(
        self, given: str, rule: str, remedy: str, places: Iterable[Iterable[float]]
    ) -> None:
        super().__init__(given, rule, remedy)
        self.places = places


def reason(error: Exception) -> str:
    """What an error of a library says, on one line.

    Returns
    -------
    str
        Its first line, or else its kind.

    Examples
    --------
    >>> reason(OSError("broken")), reason(KeyError())
    ('broken', 'KeyError')
    """
    return str(error).splitlines()[0] if str(error) else type(error).__name__
