"""The error of a boundary against the time step.

The first overturning of a block of 1 x 1 x 2 m at a PGV/PGA of 0.25 s, found by bisection at ten
time steps, and its distance from Housner's equation. This is what `simulation.time_step: auto`
measures for each scene before it runs anything.
"""

import matplotlib.pyplot as plt
import numpy as np

from vsr_core import GRAVITY
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock.solid import block
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.scene import Contact, Scene

RATIO = 0.25
rock = block((1.0, 1.0, 2.0), density=2110)
case = prepare(Scene(rock, Contact(friction=5.0)), barrier(rock), reduce=True)
exact = first_overturning_pga(Block(0.5, 1.0), RATIO, 1.0 * GRAVITY, 0.05, 1e-6) / GRAVITY


def boundary(engine: str, time_step: float) -> float:
    """PGA [g] between standing and toppling."""
    low, high = 0.9 * exact, 1.1 * exact
    while high - low > 1e-5 * exact:
        middle = 0.5 * (low + high)
        pulse = CosinePulse.from_g(middle, RATIO)
        response = simulate(case, pulse, Settings(time_step, engine=engine))
        low, high = (low, middle) if response.outcome is Outcome.OVERTURNED else (middle, high)
    return low


steps = np.geomspace(0.001, 0.03, 10)
figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
for engine, colour, marker in (("nonsmooth", "#0072b2", "o"), ("bullet", "#d55e00", "s")):
    error = [abs(boundary(engine, step) / exact - 1.0) for step in steps]
    axes.loglog(1e3 * steps, np.multiply(100, error), marker, color=colour, label=engine)
axes.axhline(1.0, color="#8a8a8a", linestyle=":", label="tolerance")
axes.set(xlabel="time step [ms]", ylabel="error of the boundary [%]")
axes.legend()
figure.savefig("time_step.png", dpi=150)
