"""Which pulses topple a block.

A block of 1 x 1 x 2 m is shaken by 900 cosine pulses, each simulated to its outcome, and the curve
is the first overturning by Housner's equation, found without any simulation of contact.
"""

import matplotlib.pyplot as plt
import numpy as np

from vsr_core import GRAVITY
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock.solid import block
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.run.rocking_block import Block, first_overturning_pga
from vsr_core.scene import Contact, Scene

rock = block((1.0, 1.0, 2.0), density=2110)
case = prepare(Scene(rock, Contact(friction=5.0)), barrier(rock), reduce=True)
pga, ratio = np.linspace(0.4, 1.2, 30), np.linspace(0.1, 0.5, 30)
pulses = [CosinePulse.from_g(a, r) for r in ratio for a in pga]
responses = simulate_all(case, pulses, Settings(time_step=0.008, engine="nonsmooth"))
toppled = np.array([r.outcome is Outcome.OVERTURNED for r in responses]).reshape(30, 30)

exact = [first_overturning_pga(Block(0.5, 1.0), r, 1.2 * GRAVITY, 0.1) / GRAVITY for r in ratio]
figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
axes.pcolormesh(pga, ratio, toppled, cmap="coolwarm", vmin=-0.3, vmax=1.3)
axes.plot(exact, ratio, color="black", label="first overturning, Housner's equation")
axes.set(xlabel="PGA [g]", ylabel="PGV/PGA [s]", title="Red toppled, blue stayed up")
axes.set_xlim(0.4, 1.2)
axes.legend(loc="lower left")
figure.savefig("overturning_cells.png", dpi=150)
