"""What the error of a boundary is: the distance of the first outcome outwards that is right."""

import matplotlib.pyplot as plt
import numpy as np

RED, BLUE = "#c7362f", "#2b66ad"
pga = np.linspace(0.40, 0.62, 23)
exact, error = 0.5, 0.03
right = pga > exact
found = right.copy()
found[[9, 12]] ^= True

figure, axes = plt.subplots(figsize=(8.6, 2.1), layout="constrained")
for height, outcomes in ((1.0, right), (0.0, found)):
    colours = [RED if toppled else BLUE for toppled in outcomes]
    axes.scatter(pga, np.full(pga.shape, height), c=colours, s=70, marker="s")
axes.axvspan(exact - error, exact + error, color="#e08a00", alpha=0.25)
axes.axvline(exact, color="#1c1c1c", linestyle=":")
axes.text(exact + error + 0.003, 0.5, "within the error, outcomes may differ", va="center")
axes.set_yticks([1.0, 0.0], ["reference", "at this time step"])
axes.set(ylim=(-0.6, 1.6), xlabel="PGA [g]; red toppled, blue stayed up")
figure.savefig("error.png", dpi=150)
