"""What pages say of the numerical errors."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace

import pytest

from pipeline.workflow.pages import _environment


def said(error: float, tolerance: float) -> str:
    level = {"kept": [(3, 3), (3, 3)], "ground": "a flat pedestal", "others": [], "friction": 0.6}
    step = {"time_step": 1e-3, "boundary_agreement": error, "displaced_error": math.nan}
    own = SimpleNamespace(**level, **step, boundary_error=error, boundary_error_worst=error)
    simulation = SimpleNamespace(tolerance=tolerance, time_step="auto")
    macro = _environment().get_template("errors.html").module.errors  # type: ignore[attr-defined]
    return str(macro([own], simulation, False, False))


@pytest.mark.parametrize("tolerance", [0.01, 0.0125, 0.00996])
@pytest.mark.parametrize("times", [0.9999, 1.0, 1.0001, 1.046])
def test_an_error_reads_as_it_compares_with_the_tolerance(times: float, tolerance: float) -> None:
    text = said(times * tolerance, tolerance)
    at_most, largest, limit = (
        float(number)
        for number in re.findall(r"(?:most <strong>|largest: |tolerance: )([\d.]+)", text)
    )
    assert ("more than the tolerance" in text) == (at_most > limit) == (times > 1.0)
    assert at_most == largest
    assert limit == pytest.approx(100.0 * tolerance)
