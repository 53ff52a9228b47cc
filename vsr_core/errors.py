"""The one exception for input that the physics cannot accept."""

from __future__ import annotations


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
