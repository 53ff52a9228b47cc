"""What the time step does to draws of Double Rock, and what their boundaries cost.

    python -m benchmarks.draws [--members N]

prints the tables of docs/uncertainty.md as Markdown. Boundaries of 8 draws, found by a run of
``uncertainty``, are scanned within 12 % at its site's time step and at shorter ones, against a
sixteenth; some are searched again from elsewhere; and the CPU time of that run is told beside that
of a draw's whole grid at its step.
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
from vsr_core.fragility.bisection import first_changes
from vsr_core.judge.proofs import Barrier, barrier
from vsr_core.motions.pulses import CosinePulse
from vsr_core.outcome import Response
from vsr_core.rock.body import Rock
from vsr_core.run.cases import Settings, prepare
from vsr_core.run.overturning import simulate_all
from vsr_core.scene import Contact, Scene
from vsr_core.uncertainty import search
from vsr_core.validation import priors
from vsr_core.validation.priors import Member
from vsr_core.validation.specimen import drawn, form

SITE, FEW, LEVELS, CELLS, REPEATS = "double_rock", 8, 96, 200, 5
"""Draws that are looked at, their levels that are scanned, the cells of each that are timed, and
how often."""

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


def apart(every: list[Drawn], found: xr.Dataset) -> tuple[int, int]:
    """Searches from elsewhere that end beside the bracket that was found, and all of them."""
    rng, width = np.random.default_rng(7), float(np.log1p(found["boundary_resolution"]))
    ends = [found[f"member_boundary_{end}"].values for end in ("lower", "upper")]
    yaws, ratio, beside, number = found["yaw"].values, found["pgv_pga"].values, 0, 0
    for draw in np.repeat(np.arange(FEW), 2 * LEVELS // FEW).tolist():
        yaw, row = int(rng.integers(len(yaws))), int(rng.integers(2, len(ratio)))
        low, high = (float(end[draw, yaw, row]) for end in ends)
        if not (np.isfinite(low) and np.isfinite(high)):
            continue
        start = np.log([np.sqrt(low * high)]) + rng.uniform(-0.1, 0.1)
        sought = search.Brackets(start, np.array([0.03]), width, (0.001, 4.0))
        while len((asked := sought.next_runs())[0]):
            runs = every[draw].responses(
                float(yaws[yaw]), asked[1], ratio[[row]], float(found["time_step"])
            )
            sought.add(*asked, np.array([one.outcome.overturned for one in runs], np.int8))
        lower, upper = first_changes(sought.known, 1)
        beside, number = beside + int(lower[0] >= high or upper[0] <= low), number + 1
    return beside, number


def each(every: list[Drawn], found: xr.Dataset, step: float) -> tuple[float, float]:
    """CPU time of a cell of a draw's grid and of a run next to its boundary, in turn [s].

    The least of some times, as other work on the machine lengthens them.
    """
    rng, yaws, ratio = np.random.default_rng(4), found["yaw"].values, found["pgv_pga"].values
    times = []
    for number, one in enumerate(every):
        yaw = int(rng.integers(len(yaws)))
        edge = found["member_boundary"].values[number, yaw]
        known = np.isfinite(edge)
        near = edge[known] * np.exp(0.0125 * rng.choice([-1, 1], known.sum()))
        cells = tuple(rng.choice(found[name].values, CELLS) for name in ("pga", "pgv_pga"))
        for _ in range(REPEATS):
            for pga, rows in (cells, (near, ratio[known])):
                begun = time.thread_time()
                one.responses(float(yaws[yaw]), pga, rows, step)
                times.append((time.thread_time() - begun) / len(pga))
    cell, run = np.array(times).reshape(len(every), REPEATS, 2).min(axis=1).mean(axis=0)
    return float(cell), float(run)


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="benchmarks.draws")
    parser.add_argument(
        "--members", type=int, default=64, help="draws whose cost is told, 8 or more"
    )
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
        step, longest = (float(found[name].max()) for name in ("time_step", "tried_step"))
        print("| time step [ms] | cell of a draw's grid [ms] | run next to a boundary [ms] |\n"
              "|---:|---:|---:|")  # fmt: skip
        for tried in (longest, step):
            cell, near = (1e3 * one for one in each(every, found, tried))
            print(f"| {1e3 * tried:.2f} | {cell:.2f} | {near:.2f} |")
        whole = 1e-3 * cell * found["probability"].size
        runs = float(found["member_runs"].mean())
        print("\n| draws | runs of a bracket | CPU [s] | grid of a draw, CPU [s] | ratio |\n"
              "|---:|---:|---:|---:|---:|")  # fmt: skip
        print(
            f"| {members} | {runs:.2f} | {cost.cpu:.0f} | {whole:.1f} | {cost.cpu / whole:.1f} |\n"
        )
        say("searches from elsewhere")
        beside, number = apart(every, found)
        print(f"{beside} of {number} searches from elsewhere end in another bracket\n")
        say("scans around boundaries")
        print("| time step [ms] | boundary too high [%] | first overturning too high [%] | "
              "4 of 5 keep [%] | islands [%] | levels with islands [%] |\n"
              "|---:|---:|---:|---:|---:|---:|")  # fmt: skip
        print("\n".join(errors(scanned(every, found, longest), longest)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
