"""Three pulses of equal PGA and PGV/PGA.

Cosine, sine and Ricker pulses with a peak acceleration of 0.5 g and a peak velocity of 1.5 m/s.
They agree in both measures and in little else: only the cosine pulse begins with a jump.
"""

import matplotlib.pyplot as plt
import numpy as np

from vsr_core import GRAVITY
from vsr_core.motions.pulses import CosinePulse, RickerPulse, SinePulse

pga, ratio = 0.5 * GRAVITY, 0.3
figure, axes = plt.subplots(2, 1, figsize=(6.4, 4.8), sharex=True, layout="constrained")
for kind, colour in ((CosinePulse, "#0072b2"), (SinePulse, "#d55e00"), (RickerPulse, "#009e73")):
    pulse = kind(pga, ratio)
    time = np.linspace(0.0, pulse.duration, 2000)
    acceleration, velocity = pulse.acceleration(time), pulse.velocity(time)
    around = np.concatenate([[-0.2], time, [pulse.duration, pulse.duration + 0.2]])
    name = kind.__name__.removesuffix("Pulse").lower()
    axes[0].plot(around, np.r_[0, acceleration, 0, 0] / GRAVITY, color=colour, label=name)
    axes[1].plot(around, np.r_[0, velocity, velocity[-1], velocity[-1]], color=colour)
axes[0].set_ylabel("acceleration [g]")
axes[1].set(xlabel="time [s]", ylabel="velocity [m/s]")
axes[0].legend()
figure.savefig("pulse_shapes.png", dpi=150)
