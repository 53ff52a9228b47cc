"""The one exception for input that the physics cannot accept."""

from __future__ import annotations


class Unfit(ValueError):
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

    def __reduce__(self) -> tuple[type[Unfit], tuple[str, str, str]]:
        return (Unfit, (self.given, self.rule, self.remedy))
