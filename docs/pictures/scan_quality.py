"""How far noise and resolution of a scan move the boundary: the picture of docs/how_to/field.md.

    cd docs/pictures && python scan_quality.py

About five minutes. The rock is the surrogate of Double Rock, 1.5 m high, its points moved by noise
in all three directions; on the left of the base, too, on the right not in its heights, as where
planes through its rim close it. What it stands on is level.
"""

import matplotlib.pyplot as plt
import numpy as np
import trimesh

from vsr_core.errors import InvalidInput
from vsr_core.judge.proofs import barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.rock.solid import from_mesh
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate
from vsr_core.scene import Contact, Scene
from vsr_core.surrogates.double_rock import double_rock

NOISE = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)  # mm, standard deviation of each point
FACES = (8000, 2000, 800)
DRAWS, RATIO = 20, 0.4  # PGV/PGA [s]
BASES = {"points of the base move, too": True, "the base stays a plane": False}


def first_overturning(mesh: trimesh.Trimesh) -> float:
    """First-overturning PGA [g], to 0.3 %: steps of 3 % upward from 0.02 g, then halved."""
    rock = from_mesh(mesh, 2110.0).rock
    case = prepare(Scene(rock, Contact(0.6), 0.0), barrier(rock), reduce=True)

    def topples(pga: float) -> bool:
        run = simulate(case, CosinePulse.from_g(pga, RATIO), Settings(0.003, engine="nonsmooth"))
        return run.outcome.overturned == 1

    high = 0.02
    while not topples(high):
        high *= 1.03
    low = high / 1.03
    while high > 1.003 * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if topples(middle) else (middle, high)
    return (low * high) ** 0.5


surface = trimesh.Trimesh(*double_rock())
figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), sharey=True, layout="constrained")
usual = first_overturning(surface)
rng = np.random.default_rng(1)
for faces, marker in zip(FACES, "os^", strict=True):
    coarse = surface.simplify_quadric_decimation(face_count=faces)
    base = coarse.vertices[:, 2] < 0.01
    coarse.vertices[base, 2] = 0.0  # where thinning out moved it by some millimetres
    spacing = 1e3 * float(np.median(coarse.edges_unique_length))
    for rough, panel in zip(BASES.values(), axes, strict=True):
        found = []
        for noise in NOISE:
            change = []
            for _ in range(DRAWS if noise else 1):
                moved, error = coarse.copy(), rng.normal(0.0, 1e-3 * noise, coarse.vertices.shape)
                error[:, 2][base & (not rough)] = 0.0
                moved.vertices += error
                try:
                    change.append(100.0 * (first_overturning(moved) / usual - 1.0))
                except InvalidInput:  # it does not stand any more
                    change.append(-100.0)
            found.append(np.percentile(change, [16, 50, 84]))
        low, middle, high = np.array(found).T
        panel.errorbar(
            NOISE, middle, [middle - low, high - middle], marker=marker, capsize=2,
            label=f"{spacing:.0f} mm between points",
        )  # fmt: skip
for name, panel in zip(BASES, axes, strict=True):
    panel.set_title(name)
    panel.set_xscale("symlog", linthresh=0.5)
    panel.set_xticks(NOISE, [f"{one:g}" for one in NOISE])
    panel.set_xlabel("noise of a point, standard deviation [mm]")
    panel.axhline(0.0, color="#1c1c1c", linewidth=0.6)
axes[0].set_ylabel("change of the first-overturning PGA [%]")
axes[1].legend()
figure.savefig("scan_quality.png", dpi=120)
