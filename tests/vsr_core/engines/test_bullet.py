"""What Bullet is given, beyond what all engines do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vsr_core.engines import bullet
from vsr_core.rock.solid import box
from vsr_core.scene import Contact, Scene, State

SPEED = 2.0
AFLOAT = Scene(
    box((0.4, 0.7, 1.1), 2600.0).rock,
    Contact(0.6),
    pedestal="none",
    start=State(np.zeros(3), np.eye(3), np.array([SPEED, 0.0, 0.0]), np.zeros(3)),
)


@given(st.floats(1e-4, 5e-3), st.integers(2, 12))
@example(0.0014959965017094252, 3)
@settings(max_examples=60, deadline=None)
def test_each_sample_takes_all_its_steps(time_step: float, substeps: int) -> None:
    """A rock in flight goes as far as its speed says, and the next run as far as the first."""
    samples = 40
    for _ in range(3):
        world = bullet.build(AFLOAT, time_step, substeps)
        world.advance([0.0] * samples)
        way = SPEED * samples * substeps * time_step
        assert world.state().position[0] == pytest.approx(way, rel=1e-9)
