"""Frames: the table from above, with yaw and the first push, and from the side."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Polygon, Rectangle

INK, ROCK, PUSH, GROUND = "#1c1c1c", "#c9b79c", "#c7362f", "#d8d8d8"
YAW = np.radians(30.0)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
    """An arrow from one point to another."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.6})


figure, (above, side) = plt.subplots(1, 2, figsize=(9.0, 4.2), layout="constrained")
turn = np.array([[np.cos(YAW), -np.sin(YAW)], [np.sin(YAW), np.cos(YAW)]])
outline = np.array([[-0.9, -0.5], [0.7, -0.6], [1.0, 0.1], [0.4, 0.6], [-0.8, 0.5]]) @ turn.T
above.add_patch(Rectangle((-2.2, -1.7), 4.4, 3.4, color=GROUND))
above.add_patch(Polygon(outline, facecolor=ROCK, edgecolor=INK))
arrow(above, (0, 0), (1.9, 0), INK)
arrow(above, (0, 0), (0, 1.5), INK)
arrow(above, (0, 0), tuple(1.5 * turn[:, 0]), "#2b66ad")
above.add_patch(Arc((0, 0), 2.2, 2.2, theta1=0, theta2=30, color="#2b66ad"))
above.text(1.15, 0.26, "yaw", color="#2b66ad")
above.text(1.32, 0.85, "the rock's own x", color="#2b66ad", ha="center")
above.text(1.95, -0.06, "x", va="center")
above.text(0.08, 1.45, "y")
arrow(above, (0.9, -1.35), (2.1, -1.35), PUSH)
above.text(0.8, -1.35, "table accelerates first", color=PUSH, ha="right", va="center")
arrow(above, (-1.0, 0), (-2.1, 0), PUSH)
above.text(-1.6, 0.12, "first push\non the rock", color=PUSH, ha="center")
above.set_title("from above: yaw turns the rock")

side.add_patch(Rectangle((-2.2, -0.5), 4.4, 0.5, color=GROUND))
side.add_patch(Polygon([[-0.5, 0], [0.5, 0], [0.8, 1.2], [0.3, 2.3], [-0.6, 1.9]],
                       facecolor=ROCK, edgecolor=INK))  # fmt: skip
side.plot(0.1, 1.2, "o", color=INK)
arrow(side, (0.1, 1.2), (0.1, 0.35), INK)
side.text(0.16, 0.55, "g")
arrow(side, (0.1, 1.2), (-0.9, 1.2), PUSH)
side.text(-0.98, 1.2, "\N{MINUS SIGN}a(t)", color=PUSH, ha="right", va="center")
arrow(side, (-2.0, 0.15), (-2.0, 1.0), INK)
side.text(-1.93, 0.95, "z")
arrow(side, (-2.0, 0.15), (-1.2, 0.15), INK)
side.text(-1.15, 0.12, "x")
side.text(0, -0.28, "pedestal: at rest in the table's frame", ha="center")
side.set_title("from the side: gravity minus a(t)")
for axes, height in ((above, (-1.8, 1.8)), (side, (-0.6, 2.6))):
    axes.set(xlim=(-2.3, 2.3), ylim=height, aspect="equal")
    axes.set_axis_off()
figure.savefig("frames.png", dpi=150)
