"""Lines of numbers in columns, of which one lost characters."""

from __future__ import annotations

import numpy as np
import pytest

from vsr_core.errors import InvalidInput
from vsr_core.motions.named_columns import refuse_cut_lines


@pytest.mark.parametrize("at", [1, 17, 38, 39])
@pytest.mark.parametrize("lost", [(3, 5), (7, 9), (16, 19)])
def test_a_line_that_lost_characters_is_refused_wherever_it_stands(
    at: int, lost: tuple[int, int]
) -> None:
    values = np.random.default_rng(0).normal(scale=[5.0, 500.0], size=(40, 2))
    lines = [f"{one:10.4f}{other:10.4f}" for one, other in values]
    refuse_cut_lines(lines)
    lines[at] = lines[at][: lost[0]] + lines[at][lost[1] :]
    with pytest.raises(InvalidInput, match=r"a line .*, out of column; it is whole"):
        refuse_cut_lines(lines)
