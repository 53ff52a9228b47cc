"""A rock that slides does not topple.

The share of 400 pulses that topple a block of 1 x 1 x 2 m, and the share that moves it along, as
friction grows. The block tips at 0.5 g: with less friction than 0.5 it slides before it tips.
"""

from collections import Counter

import matplotlib.pyplot as plt
import numpy as np

from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Outcome
from vsr_core.rock.solid import block
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.scene import Contact, Scene

rock = block((1.0, 1.0, 2.0), density=2110)
pulses = [
    CosinePulse.from_g(a, r) for a in np.linspace(0.3, 1.5, 20) for r in np.linspace(0.05, 0.6, 20)
]
friction = np.linspace(0.3, 1.0, 15)
shares = []
for value in friction:
    case = prepare(Scene(rock, Contact(value)), barrier(rock), reduce=True)
    responses = simulate_all(case, pulses, Settings(time_step=0.008, engine="nonsmooth"))
    counts = Counter(response.outcome for response in responses)
    shares.append([counts[end] / len(pulses) for end in (Outcome.OVERTURNED, Outcome.DISPLACED)])

figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
toppled, moved = np.array(shares).T
axes.plot(friction, 100 * toppled, "o-", color="#c7362f", label="toppled")
axes.plot(friction, 100 * moved, "s-", color="#2b66ad", label="upright, slid along")
axes.axvline(0.5, color="#8a8a8a", linestyle=":")
axes.set(xlabel="friction of rock on pedestal", ylabel="share of the pulses [%]", ylim=(0, None))
axes.legend()
figure.savefig("friction.png", dpi=150)
