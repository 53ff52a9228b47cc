"""The cosine pulse, with its PGA, its PGV and the length of time between them."""

import matplotlib.pyplot as plt
import numpy as np

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse

PGA, RATIO = 0.5, 0.3
pulse = CosinePulse.from_g(PGA, RATIO)
time = np.linspace(0.0, pulse.duration, 1000)
around = np.concatenate([[-0.3, 0.0], time, [pulse.duration, pulse.duration + 0.3]])

figure, (upper, lower) = plt.subplots(2, 1, figsize=(6.6, 4.6), sharex=True, layout="constrained")
upper.plot(around, np.r_[0, 0, pulse.acceleration(time) / GRAVITY, 0, 0], color="#0072b2")
upper.axhline(PGA, color="#8a8a8a", linestyle=":")
upper.text(pulse.duration + 0.02, PGA, f"PGA {PGA:g} g", va="bottom")
upper.set(ylabel="acceleration [g]", ylim=(-0.6, 0.68))
lower.plot(around, np.r_[0, 0, pulse.velocity(time), 0, 0], color="#d55e00")
pgv = PGA * GRAVITY * RATIO
lower.axhline(pgv, color="#8a8a8a", linestyle=":")
lower.text(pulse.duration + 0.02, pgv, f"PGV {pgv:.2f} m/s", va="bottom")
lower.set(ylabel="velocity [m/s]", xlabel="time [s]", ylim=(-1.75, 2.0), xlim=(-0.3, 2.5))
upper.set_title(f"PGV/PGA = {RATIO:g} s: the longer it is, the longer each push lasts", fontsize=10)
figure.savefig("motion.png", dpi=150)
