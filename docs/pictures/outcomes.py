"""How a run can end, drawn as a block."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Polygon, Rectangle

ROCK, INK, GROUND = "#c9b79c", "#1c1c1c", "#d8d8d8"
BODY = np.array([[-0.5, 0.0], [0.5, 0.0], [0.5, 2.0], [-0.5, 2.0]])

figure, axes = plt.subplots(1, 4, figsize=(9.4, 2.9), layout="constrained")
told = (
    ("balanced", "upright, where it was", 0.0, 0.0, "#2b66ad"),
    ("displaced", "upright, slid by more than\na tenth of its radius", 0.0, 0.7, "#2b66ad"),
    ("overturned", "lies, or can no longer\nbe stopped from falling", 90.0, 0.5, "#c7362f"),
    ("unsettled", "time ran out, and neither\ncould be proved: unresolved", 18.0, 0.0, "#595959"),
)
for place, (name, meaning, tilt, slide, colour) in zip(axes, told, strict=True):
    place.add_patch(Rectangle((-1.6, -0.35), 4.8, 0.35, color=GROUND))
    if tilt or slide:
        place.add_patch(Polygon(BODY, fill=False, edgecolor="#8a8a8a", linestyle=":"))
    angle = -np.radians(tilt)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corner = np.array([0.5, 0.0])
    shifted = (BODY - corner) @ turn.T + corner + [slide if tilt == 0 else 0.0, 0.0]
    place.add_patch(Polygon(shifted, facecolor=ROCK, edgecolor=INK, alpha=0.9))
    place.set(xlim=(-1.6, 3.2), ylim=(-0.4, 2.4), aspect="equal")
    place.set_axis_off()
    place.set_title(f"{name}", color=colour, fontsize=11, fontweight="bold")
    place.text(0.8, -0.6, meaning, ha="center", va="top", fontsize=9)
figure.savefig("outcomes.png", dpi=150)
