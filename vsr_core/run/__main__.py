"""Compile what runs need, before the first of them asks for it: ``python -m vsr_core.run``."""

from __future__ import annotations

from vsr_core.engines.nonsmooth.compiling import forget_others
from vsr_core.motions.cosine_pulse import CosinePulse
from vsr_core.rock import solid
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.run.proofs import barrier
from vsr_core.scene import Contact, Scene

SIZE = (1.0, 1.0, 2.0)
"""Sides of the block that is run [m]."""


def main() -> None:
    """Run a block on level ground, by itself and as one of many."""
    rock = solid.box(SIZE, 2000.0).rock
    case = prepare(Scene(rock, Contact(0.6)), barrier(rock), reduce=True)
    forget_others()
    simulate(case, CosinePulse.from_g(1.0, 0.2), Settings(0.01, engine="nonsmooth"))


if __name__ == "__main__":
    main()
