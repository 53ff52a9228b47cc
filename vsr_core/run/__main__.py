"""Compile what runs need, before the first of them asks for it: ``python -m vsr_core.run``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsr_core import engines
from vsr_core.compiled.compiling import forget_others
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock import solid
from vsr_core.run import displacement, overturning
from vsr_core.run.cases import Settings, TerrainCase, prepare
from vsr_core.run.displacement import displace
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene, resting
from vsr_core.terrain.surface import Terrain

SIZE = (1.0, 1.0, 2.0)
"""Sides of the block that is run [m]."""


def main() -> None:
    """Run a block on level ground, by itself and as one of many, and on two triangles."""
    forget_others()
    rock, pulse = solid.box(SIZE, 2000.0).rock, CosinePulse.from_g(1.0, 0.2)
    settings = Settings(0.01, engine="nonsmooth")
    scene = Scene(rock, Contact(0.6))
    simulate(prepare(scene, barrier(rock), reduce=True), pulse, settings)
    corners = np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]])
    level = Terrain(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    seat = replace(scene, pedestal="terrain", terrain=level, start=resting(scene))
    place = TerrainCase(seat, replace(seat), 1.0)
    displace(place, pulse, settings)  # topples, and goes on
    # As engines are judged whose steps are asked for one by one.
    case = prepare(scene, barrier(rock), reduce=True)
    overturning.complete(overturning.set_up(case, scene, pulse, settings, 0.01), case)
    stepped = displacement.set_up(place, pulse, settings, 0.01, follow=False)
    displacement.complete(stepped, place, settings)
    for stood in (scene, seat):
        world = engines.load(settings.engine).build(stood, 0.01, 1)
        world.advance([0.0])
        world.state()


if __name__ == "__main__":
    main()
