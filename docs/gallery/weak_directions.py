"""From which side a rock is weak.

The steady acceleration that topples the surrogate of Double Rock, toward each direction, from its
shape alone. The surrogate is made from published figures and is not the rock.
"""

import matplotlib.pyplot as plt
import numpy as np
import trimesh

from vsr_core.rock.solid import from_mesh
from vsr_core.rock.tipping import tipping
from vsr_core.surrogates.double_rock import double_rock

vertices, faces = double_rock()
rock = from_mesh(trimesh.Trimesh(vertices, faces), density=2110).rock
direction = np.radians(np.arange(0, 361, 3))
pga = tipping(rock.hull, direction).overturning

figure, axes = plt.subplots(figsize=(4.8, 4.8), subplot_kw={"projection": "polar"})
axes.plot(direction, pga, color="#c7362f")
axes.set_ylim(0, None)
axes.set_rlabel_position(70)
axes.set_title("steady acceleration that topples it [g]")
figure.savefig("weak_directions.png", dpi=150)
