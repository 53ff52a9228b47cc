"""What the time step does to draws of Double Rock, and what their boundaries cost.

    python -m benchmarks.draws [--members N]

prints two tables of docs/uncertainty.md as Markdown. Boundaries of 8 draws, found by a run of
``uncertainty``, are scanned within 12 % at its site's time step and at shorter ones, against a
sixteenth; and the CPU time of that run is told beside that of a draw's whole grid at its step.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
import xarray as xr

from benchmarks.commands import measured
from benchmarks.table import say
from pipeline.config import in_si
from pipeline.config.layers import load_site
from pipeline.stages.uncertainty import draws
from vsr_core.arrays import Array, Indices
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Response
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.scene import Contact, Scene
from vsr_core.validation import priors
from vsr_core.validation.priors import Member
from vsr_core.validation.specimen import drawn, form

SITE, FEW, LEVELS, CELLS = "double_rock", 8, 96, 500
"""Draws that are looked at, their levels that are scanned, and the cells of each that are timed."""

SHARES = (1, 2, 4, 8, 16)
"""Parts of the time step, the last one the reference."""

SPACING = 0.005
AROUND = np.arange(-24, 25) * SPACING
"""PGAs of a scan [ln g]."""


@dataclass(frozen=True)
class Drawn:
    """A draw of the site's rock."""

    member: Member
    rock: Rock
    barrier: Barrier

    def responses(self, yaw: float, pga: Array, ratio: Array, step: float) -> list[Response]:
        """Runs at some PGAs [g] and PGV/PGA [s], in a direction of the site [degree]."""
        own = self.member
        turned = in_si.angle(yaw) - own.direction
        scene = Scene(self.rock, Contact(own.friction, own.restitution), turned)
        motions = [
            CosinePulse.from_g(own.amplitude * peak, each)
            for peak, each in zip(pga.tolist(), ratio.tolist(), strict=True)
        ]
        case = prepare(scene, self.barrier, reduce=True)
        return simulate_all(case, motions, Settings(step, engine="nonsmooth"))


def all_drawn(folder: Path) -> list[Drawn]:
    """The first draws of the site, as ``uncertainty`` draws them."""
    config, data = load_site(SITE, None, ()).config, xr.load_dataset(folder / "rock.nc")
    vertices = data["surface_vertex"].values.astype(float)
    mesh = trimesh.Trimesh(vertices, data["surface_face"].values, process=False)
    scan = config.uncertainty.scan
    shape = form(mesh, None, scan.error, scan.correlation_length)
    members = priors.draws(draws.priors(config.uncertainty), FEW)
    rocks = [drawn(shape, member, config.rock.density) for member in members]
    return [Drawn(*one, barrier(one[1])) for one in zip(members, rocks, strict=True)]


def scanned(every: list[Drawn], found: xr.Dataset, longest: float) -> Indices:
    """Whether runs around some boundaries topple, shape (steps, levels, runs)."""
    rng, parts = np.random.default_rng(9), []
    yaws, ratio = found["yaw"].values, found["pgv_pga"].values
    for number in np.repeat(np.arange(FEW), LEVELS // FEW).tolist():
        yaw, row = int(rng.integers(len(yaws))), int(rng.integers(2, len(ratio)))
        edge = float(found["member_boundary"][number, yaw, row])
        if not np.isfinite(edge):
            continue
        pga, ratios = edge * np.exp(AROUND), np.full(len(AROUND), ratio[row])
        parts.append(
            [
                [one.outcome.overturned == 1 for one in
                 every[number].responses(float(yaws[yaw]), pga, ratios, longest / share)]
                for share in SHARES
            ]
        )  # fmt: skip
    return np.array(parts, dtype=np.int64).swapaxes(0, 1)


def errors(topples: Indices, longest: float) -> list[str]:
    """Rows of the table of errors."""
    runs = topples.shape[2]
    first = np.where(topples.any(axis=2), topples.argmax(axis=2), runs)
    last = np.where(topples.all(axis=2), -1, runs - 1 - (1 - topples)[:, :, ::-1].argmax(axis=2))
    stands = (1 - topples).sum(axis=2)
    rows = []
    for at, share in enumerate(SHARES):
        apart, lowest = (100 * SPACING * (one[at] - one[-1]) for one in (stands, first))
        kept = np.quantile(np.abs(apart), 0.8, method="inverted_cdf")
        wide = 100 * SPACING * np.maximum(last[at] - first[at], 0)
        values = (f"{value:.2f}" for value in (apart.mean(), lowest.mean(), kept, wide.mean()))
        more = f"{100 * (wide > 0).mean():.0f}"
        rows.append(f"| {1e3 * longest / share:.2f} | {' | '.join(values)} | {more} |")
    return rows


def grid(every: list[Drawn], found: xr.Dataset) -> float:
    """CPU time of a draw's whole grid at the draws' time step, from cells at random [s]."""
    rng, used, number = np.random.default_rng(4), 0.0, 0
    step, yaws = float(found["time_step"]), found["yaw"].values
    for one in every:
        for yaw in yaws.tolist():
            count = CELLS // len(yaws)
            pga, ratio = (rng.choice(found[name].values, count) for name in ("pga", "pgv_pga"))
            begun = time.process_time()
            one.responses(yaw, pga, ratio, step)
            used, number = used + time.process_time() - begun, number + count
    return used / number * found["probability"].size


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="benchmarks.draws")
    parser.add_argument("--members", type=int, default=64, help="draws whose cost is told")
    members = parser.parse_args().members
    with tempfile.TemporaryDirectory() as derived:
        words = ["--site", SITE, "--derived", derived, "--workers", "0"]
        say("the site as scanned")
        measured(["run", "fragility", *words])
        say(f"{members} draws")
        cost = measured(["run", "uncertainty", *words, "--set", f"uncertainty.members={members}"])
        folder = Path(derived) / SITE
        found = xr.load_dataset(folder / "uncertainty.nc", mask_and_scale=False)
        every = all_drawn(folder)
        say("the grid of a draw")
        alone = grid(every, found)
        runs, brackets = int(found["member_runs"].sum()), found["member_runs"].size
        print("| draws | time step [ms] | runs of a bracket | CPU [s] | grid of a draw, CPU [s] | "
              "ratio |\n|---:|---:|---:|---:|---:|---:|")  # fmt: skip
        print(f"| {members} | {1e3 * float(found['time_step']):.2f} | {runs / brackets:.2f} | "
              f"{cost.cpu:.0f} | {alone:.1f} | {cost.cpu / alone:.1f} |\n")  # fmt: skip
        say("scans around boundaries")
        longest = float(found["tried_step"][0])
        print("| time step [ms] | boundary too high [%] | first overturning too high [%] | "
              "4 of 5 keep [%] | islands [%] | levels with islands [%] |\n"
              "|---:|---:|---:|---:|---:|---:|")  # fmt: skip
        print("\n".join(errors(scanned(every, found, longest), longest)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
