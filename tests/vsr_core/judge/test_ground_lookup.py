"""How deep a point is in the ground, as compiled runs know it: its section tells the answer."""

from __future__ import annotations

import numpy as np
import pytest
from support import grounds

from vsr_core.judge import ground_lookup
from vsr_core.judge.ground_lookup import OUTSIDE

LEDGE = np.array(
    [[-3.0, 0.2], [0.8, 0.2], [0.8 - 1e-3, -0.4], [0.0, -0.5], [0.0, -1.1], [3.0, -1.1]]
)
"""Section of a ground with a ledge 0.8 m wide over a niche, whose roof falls towards its back."""


@pytest.mark.parametrize(
    ("x", "z", "depth"),
    [
        (0.4, 0.3, 0.0),  # over the ledge
        (0.4, 0.1, 0.1),  # in it
        (0.4, -0.35, 0.55),
        (0.4, -0.46, 0.0),  # under its roof, which faces down
        (0.4, -0.8, 0.0),  # in the niche
        (0.4, -1.3, 0.2),  # under the floor of the niche
        (-1.0, -0.8, 1.0),  # in the wall behind it
        (2.0, -0.8, 0.0),
        (2.0, -1.15, 0.05),
        (3.5, -1.3, OUTSIDE),
    ],
)
def test_only_ground_that_faces_up_buries(x: float, z: float, depth: float) -> None:
    ground = ground_lookup.lookup(grounds.extruded(LEDGE, 2.0))
    assert ground_lookup.depth(ground, x, 0.13, z) == pytest.approx(depth, abs=1e-12)
