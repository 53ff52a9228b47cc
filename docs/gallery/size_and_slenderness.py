"""Small and slender rocks topple first.

First overturning of four blocks by Housner's equation. At equal slenderness the larger block needs
a longer pulse, by the square root of its size: drawn against PGV/PGA over that root, the curves of
the three blocks of 1:2 fall into one.
"""

import matplotlib.pyplot as plt
import numpy as np

from vsr_core import GRAVITY
from vsr_core.run.rocking_block import Block, first_overturning_pga

sizes = {(0.5, 1.0): "#0072b2", (1.0, 2.0): "#d55e00", (1.0, 3.0): "#009e73", (2.0, 4.0): "#cc79a7"}
scaled = np.linspace(0.08, 0.5, 25)  # PGV/PGA over the root of the size

figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.8), sharey=True, layout="constrained")
for (width, height), colour in sizes.items():
    block, root = Block(0.5 * width, 0.5 * height), np.sqrt(height / 2.0)
    first = [first_overturning_pga(block, r * root, 1.5 * GRAVITY, 0.4) for r in scaled]
    name = f"{width:g} x {height:g} m"
    for place, ratio in zip(axes, (scaled * root, scaled), strict=True):
        place.plot(ratio, np.array(first) / GRAVITY, color=colour, label=name, alpha=0.8)
axes[0].set(xlabel="PGV/PGA [s]", ylabel="first-overturning PGA [g]")
axes[1].set(xlabel="PGV/PGA over the root of height / 2 m [s]")
axes[0].legend()
figure.savefig("size_and_slenderness.png", dpi=150)
