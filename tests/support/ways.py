"""Tiny sites of every ground, motion and engine, and covers of the ways through the program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, product
from pathlib import Path

import numpy as np
import trimesh

from support.record_files import at2, shaking
from support.small_scan import FAR, survey, tapered, write_ply

Way = dict[str, str]

PULSES = "pga: [0.3, 0.5], pgv_pga: [0.2]"
AXES = "{axis: x}, {axis: y}, {axis: z, pga_ratio: 0.5}, {axis: roll, pga_ratio: 0.01}"
TURNS = "{axis: pitch}, {axis: yaw, pga_ratio: 0.01}"
GROUNDS = {
    "block": "rock: {shape: box, size: [0.3, 0.8, 1.0], density: 2000}",
    "mesh": "rock: {shape: mesh, mesh: rock.ply, density: 2000}",
    "terrain": "rock: {shape: mesh, mesh: scan.ply, density: 2000}\n"
    "pedestal: {shape: mesh, cut: {kind: plane, point: POINT, normal: NORMAL}}",
}
MOTIONS = {
    "cosine": f"motion: {{kind: cosine_pulse, {PULSES}}}",
    "sine": f"motion: {{kind: sine_pulse, {PULSES}}}",
    "ricker": f"motion: {{kind: ricker_pulse, {PULSES}}}",
    "record": "motion: {kind: record, files: shaking.at2, pga: [0.3, 0.5], "
    "processing: {order: standard, highpass: 1.0, lowpass: 25}}",
    "six_axes": f"motion: {{kind: table, pulses: [{AXES}, {TURNS}], {PULSES}}}",
    "servo": f"motion: {{kind: cosine_pulse, {PULSES}}}\ndrive: servo",
}
FLAT = ("accuracy",)
OF_COSINES = ("accuracy", "feasible")
ENGINES = ("auto", "nonsmooth", "bullet", "mujoco")


def write_scans(folder: Path) -> None:
    """Write the scans and the record that the sites name."""
    write_ply(folder / "scan.ply", survey(0.2, 0.0), FAR)
    trimesh.creation.cylinder(0.3, 1.4, sections=7).export(folder / "rock.ply")
    (folder / "shaking.at2").write_text(at2(shaking(1, 100.0, 6.0, 5.0, 0.5), 0.01))


def site(way: Mapping[str, str], time_step: str) -> str:
    """YAML of a way's site."""
    up = tapered().up
    ground = GROUNDS[way["ground"]].replace("POINT", str((FAR + 0.02 * up).tolist()))
    return "\n".join(
        [
            ground.replace("NORMAL", str(up.tolist())),
            MOTIONS[way["motion"]],
            f"simulation: {{engine: {way['engine']}, time_step: {time_step}}}",
            "yaw: 30\nuncertainty: {members: 2}\n"
            "fragility: {resolution: 0.2, lowest: 0.2, highest: 0.6}\n",
        ]
    )


def refusal(way: Mapping[str, str]) -> str:
    """The key that a refusal of a way names, or an empty string where it leads to a product."""
    product, ground, motion, engine = (way[f] for f in ("product", "ground", "motion", "engine"))
    refusals = [
        ("motion", ground == "terrain" and motion == "six_axes"),
        ("drive", ground == "terrain" and motion == "servo"),
        ("simulation", ground == "terrain" and engine == "mujoco"),
        ("simulation", motion == "servo" and engine in ("nonsmooth", "mujoco")),
        ("pedestal.shape", ground == "terrain" and product in FLAT),
        ("pedestal.shape", ground != "terrain" and product == "displacement"),
        ("motion.kind", motion not in ("cosine", "servo") and product in OF_COSINES),
        ("drive", product == "accuracy" and motion == "servo"),
        ("uncertainty.restitution", product in ("uncertainty", "hazard") and engine == "mujoco"),
        ("simulation.engine", motion == "six_axes" and engine == "mujoco"),
        ("motion.pulses", motion == "six_axes" and product == "hazard"),
    ]
    return next((key for key, holds in refusals if holds), "")


def cover(factors: Mapping[str, Sequence[str]], together: int) -> list[Way]:
    """Ways to a product that hold each combination of so many factors' values that any way holds.

    They are chosen greedily, from an order that leads to few. One way for each key that
    is named in a refusal follows.
    """
    ways = [dict(zip(factors, values, strict=True)) for values in product(*factors.values())]
    np.random.default_rng(49).shuffle(ways)  # type: ignore[arg-type]
    open_ways = [way for way in ways if not refusal(way)]
    held = [{*combinations(way.items(), together)} for way in open_ways]
    wanted = set().union(*held)
    chosen = []
    while wanted:
        best = max(range(len(held)), key=lambda i: len(held[i] & wanted))
        chosen.append(open_ways[best])
        wanted -= held[best]
    refused = {refusal(way): way for way in ways if refusal(way)}
    return chosen + list(refused.values())
