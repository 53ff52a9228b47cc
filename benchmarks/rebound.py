"""Rebound, rolling and sliding on terrain against known answers, and what the coefficients do.

    python -m benchmarks.rebound [--write]

Fifteen minutes. ``--write`` writes the page, docs/rebound.md, and its figure.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from benchmarks import rebound_figure, tumbling
from pipeline import ROOT
from pipeline.drawing.style import png
from vsr_core.engines.bullet.world import RESTITUTION_THRESHOLD, SCALED_RADIUS
from vsr_core.scene import Contact
from vsr_core.verification.reference import dissipation, impact, incline, rimless_wheel, runout
from vsr_core.verification.reference._run import slope

PAGE, FIGURE = ROOT / "docs" / "rebound.md", ROOT / "docs" / "rebound.png"

RESTITUTIONS, FRICTIONS = tumbling.RESTITUTIONS, tumbling.FRICTIONS

STEPS = (4e-3, 2e-3, 1e-3, 0.5e-3)
"""Time steps [s]; the third is that of the table of all coefficients."""

USUAL = Contact(0.6, 0.38)
"""Coefficients at which steps and grounds are compared."""

HULLS = 24
"""Hulls that tumble for the table of energy."""

ENGINES = {"nonsmooth": "nonsmooth", "bullet": "Bullet"}
"""The default engine and the one to compare with, and what the page calls them."""

STEEP, GENTLE = math.radians(55.0), math.radians(10.0)
"""Slopes for a sphere that slips at the least of the frictions, and for a block that stops."""

GROUNDS = {"triangles, 0.5 m": (0.5, False), "convex parts, 1 m": (1.0, True)}

SIZES = (12.0, 3.0, 1.0, 0.5, 0.2)
"""Of triangles and of convex parts [m]; the first is all of the ground."""


Pair = tuple[float, float]
"""What is computed, and the answer; nan where there is none."""


@dataclass(frozen=True)
class Row:
    """A quantity with an answer.

    ``measure`` takes a contact, the size of cells, whether they are convex parts, an engine and a
    time step.
    The error is relative to ``unit``, or to the answer if that is 0.
    """

    what: str
    measure: Callable[[Contact, float, bool, str, float], Pair]
    unit: float = 0.0

    def error(self, pair: Pair) -> float:
        """Error as a share; nan where there is no answer."""
        return abs(pair[0] - pair[1]) / (self.unit or abs(pair[1]))


# ------------------------------------------------------------------- what is measured


def _sphere(contact: Contact, cell: float, cut: bool, engine: str, step: float) -> Pair:
    ground = incline.ground(STEEP, cell, cut)
    found, _ = incline.descend(ground, STEEP, contact, engine, step)
    return found, incline.acceleration(STEEP, contact.friction)[0]


def _impact(what: str, throw: str, part: str, unit: float) -> Row:
    def measure(contact: Contact, cell: float, cut: bool, engine: str, step: float) -> Pair:
        ground = slope(impact.ANGLE, (-3.0, 3.0), 3.0, cell, cut)
        before, after, theory, inertia = impact.thrown(
            impact.THROWS[throw], contact, ground, engine, step
        )

        def read(motion: impact.Motion) -> float:
            kept = motion.energy(inertia) / before.energy(inertia)
            along, _, normal = motion.velocity
            parts = {
                "along": along,
                "normal": normal,
                "spin": motion.angular_velocity[1],
                "energy": kept,
            }
            return float(parts[part])

        return read(after), read(theory)

    return Row(what, measure, unit)


def _wheel(contact: Contact, cell: float, cut: bool, engine: str, step: float) -> Pair:
    if contact.restitution > 0.0:
        return math.nan, math.nan
    wheel = rimless_wheel.WHEELS[0]
    path = rimless_wheel.rolled(wheel, cell, cut, engine, step)
    duration = rimless_wheel.STEPS * wheel.period
    return float(path.position[-1, 0]) / duration, wheel.facet / wheel.period


def _line(contact: Contact, cell: float, cut: bool, engine: str, step: float) -> Pair:
    ground = slope(GENTLE, (-1.0, 11.0), 3.0, cell, cut)
    found = runout.energy_line(runout.block(), GENTLE, contact, ground, engine, step)
    return found, contact.friction


def _bend(contact: Contact, cell: float, cut: bool, engine: str, step: float) -> Pair:
    bend = runout.Bend()
    answer = bend.run_out(contact.friction)
    if answer == 0.0:
        return math.nan, math.nan
    facets = round(bend.radius * bend.angle / cell)
    return runout.bending(bend, contact, facets, cut, engine, step), answer


ROWS = (
    Row("sphere on a slope of 55 deg: acceleration [m/s2]", _sphere),
    _impact("sphere hits a slope: velocity along it after [m/s]", "sphere", "along", 3.6),
    _impact("block falls flat: normal velocity after [m/s]", "face", "normal", 3.6),
    _impact("block falls flat: velocity along the slope after [m/s]", "face", "along", 3.6),
    _impact("block falls on an edge: angular velocity after [rad/s]", "edge", "spin", 5.1),
    _impact("block falls on a corner: share of energy retained", "corner", "energy", 1.0),
    Row("wheel of eight facets on 15 deg: terminal speed [m/s]", _wheel),
    Row("block slides to rest on 10 deg: fall of its energy line", _line),
    Row("block slides down 35 deg and through a bend: run-out [m]", _bend),
)
"""Errors after impacts are relative to the velocity before, or to that over the radius."""


# ------------------------------------------------------------------- tables

Line = list[str]


def coefficients() -> Iterable[Line]:
    """All rows at all coefficients at the third step."""
    for row in ROWS:
        for ground, (cell, cut) in GROUNDS.items():
            for restitution in RESTITUTIONS:
                contacts = [Contact(friction, restitution) for friction in FRICTIONS]
                cells: Line = []
                for engine in ENGINES:
                    pairs = [row.measure(c, cell, cut, engine, STEPS[2]) for c in contacts]
                    found, answers = zip(*pairs, strict=True)
                    errors = map(percent, map(row.error, pairs))
                    cells += [_three(map(_number, found)), _three(errors)]
                if not all(math.isnan(answer) for answer in answers):
                    answer = _three(map(_number, answers))
                    yield [row.what, ground, f"{restitution:g}", answer, *cells]


def _three(cells: Iterable[str]) -> str:
    return " / ".join(cells)


def steps() -> Iterable[Line]:
    """Error of all rows at all steps, at the usual coefficients or others with an answer."""
    for row in ROWS:
        for ground, (cell, cut) in GROUNDS.items():
            for engine, name in ENGINES.items():
                for contact in (USUAL, Contact(USUAL.friction), Contact(FRICTIONS[0])):
                    pairs = [row.measure(contact, cell, cut, engine, step) for step in STEPS]
                    if not math.isnan(pairs[0][1]):
                        break
                given = f"{contact.restitution:g}, {contact.friction:g}"
                errors = (percent(row.error(pair)) for pair in pairs)
                yield [row.what, ground, given, name, *errors]


def borders() -> Iterable[Line]:
    """Error of a rolling sphere and of a sliding block against the size of triangles and parts."""
    angle = math.radians(20.0)
    for engine, name in ENGINES.items():
        for ground, cut in (("triangles", False), ("parts", True)):
            for size in SIZES:
                rolled = incline.rolling(angle, 0.6, size, cut, engine, STEPS[2])
                slid = [
                    runout.sliding(GENTLE, Contact(0.6, e), size, cut, engine, STEPS[2])
                    for e in RESTITUTIONS
                ]
                yield [f"{name}, {ground}", f"{size:g}", percent(rolled), *map(percent, slid)]


def energies() -> Iterable[Line]:
    """Largest rise of the energy of hulls that tumble, and how many rise by a hundredth."""
    for restitution in (*RESTITUTIONS, 1.0):
        for engine, name in ENGINES.items():
            for ground, cut in (("triangles", False), ("parts", True)):
                cells = []
                for friction in FRICTIONS:
                    contact = Contact(friction, restitution)
                    rises = [
                        dissipation.rise(k, contact, cut, engine, STEPS[2]) for k in range(HULLS)
                    ]
                    many = sum(rise > 0.01 for rise in rises)
                    cells.append(f"{max(rises):.4f} ({many})")
                yield [f"{restitution:g}", name, ground, *cells]


def tumbled(found: rebound_figure.Ensemble) -> Iterable[Line]:
    """Run-outs of the ensemble."""
    for (engine, contact, cut), runs in found.items():
        mean, spread = float(runs.way.mean()), float(runs.way.std(ddof=1))
        yield [
            f"{contact.restitution:g}",
            f"{contact.friction:g}",
            f"{ENGINES[engine]}, {'parts' if cut else 'triangles'}",
            f"{mean:.1f} ± {spread / math.sqrt(len(runs.way)):.1f}",
            f"{spread:.1f}",
            f"{np.median(runs.beyond):.1f}",
            f"{runs.speed.mean():.1f}",
            str(runs.away),
        ]


def ensembles() -> rebound_figure.Ensemble:
    """The rock that tumbles: all coefficients in both engines, and some on Bullet's triangles."""
    contacts = [Contact(mu, e) for e in RESTITUTIONS for mu in FRICTIONS]
    wanted = [("nonsmooth", contact, False) for contact in contacts]
    wanted += [("bullet", contact, True) for contact in contacts]
    wanted += [("bullet", Contact(USUAL.friction, e), False) for e in RESTITUTIONS]
    found = {}
    for engine, contact, cut in wanted:
        found[engine, contact, cut] = tumbling.runs(engine, contact, cut)
        print(f"tumbling: {engine}, {contact}, {cut}", file=sys.stderr, flush=True)
    return found


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{0.0 if abs(value) < 5e-4 else value:.3g}"


def percent(share: float) -> str:
    """A share in percent, with the digits that matter."""
    if math.isnan(share):
        return "-"
    if share < 1e-4:
        return "< 0.01 %"
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


def table(head: Line, lines: Iterable[Line]) -> str:
    """Markdown; a cell that repeats the one above is left empty in the first column."""
    rows, above = [], ""
    for line in lines:
        rows.append(["" if line[0] == above else line[0], *line[1:]])
        above = line[0]
    every = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in every)


def page(found: rebound_figure.Ensemble) -> str:
    """The page in Markdown."""
    three = " / ".join(f"{friction:g}" for friction in FRICTIONS)
    head = ["case", "ground", "e", f"answer, friction {three}"]
    head += [what for name in ENGINES.values() for what in (f"{name} computes", "error")]
    milliseconds = [f"{1e3 * step:g} ms" for step in STEPS]
    slid = [f"sliding block, e = {e:g}" for e in RESTITUTIONS]
    energy_head = ["e", "engine", "ground", *(f"friction {friction:g}" for friction in FRICTIONS)]
    ends_head = ["e", "friction", "engine, ground", "horizontal distance [m]", "spread [m]",
                 "median beyond the slope [m]", "mean largest speed [m/s]", "lost"]  # fmt: skip
    bend = runout.Bend()
    drop, level = bend.top[1], -bend.top[0]
    return TEXT.format(
        step=f"{1e3 * STEPS[2]:g} ms",
        coefficients=table(head, coefficients()),
        steps=table(["case", "ground", "e, friction", "engine", *milliseconds], steps()),
        borders=table(["engine, ground", "size [m]", "rolling sphere", *slid], borders()),
        energies=table(energy_head, energies()),
        tumbled=table(ends_head, tumbled(found)),
        hulls=HULLS,
        pushes=tumbling.PUSHES,
        bent=f"{bend.run_out(FRICTIONS[0]):.2f} m",
        straight=f"{drop / FRICTIONS[0] - level:.2f} m",
        threshold=f"{1e3 * RESTITUTION_THRESHOLD / math.sqrt(SCALED_RADIUS):.0f} mm/s",
    )


TEXT = """# Rebound, rolling and sliding on terrain

Made by `python -m benchmarks.rebound --write`; do not edit.

How well contact works on ground made of triangles and of convex parts, in cases with a known
answer: the families `incline`, `impact`, `rimless_wheel`, `runout` and `dissipation` of
`vsr_core/verification/reference/`, in the default engine `nonsmooth` (docs/engine.md) and in
Bullet. The former takes triangles in both cases. e is the coefficient of restitution. The time step
is {step} unless stated otherwise.

![Impacts, rolling, sliding and tumbling](rebound.png)

## Known answers

{coefficients}

Errors of velocities after an impact are relative to the velocity before it, those of angular
velocities to that velocity divided by the block's radius. The answers for impacts combine Newton's
restitution at the point of contact with a friction impulse that either stops the slip there or has
the size of Coulomb's limit and opposes the remaining slip; a face that lands flat does not rotate.
The wheel (McGeer 1990) does not slip at any of these frictions, and has an answer only without
rebound. The energy line of a block on an even slope falls by the coefficient of friction in each
metre of horizontal distance, whatever the mass. In a bend it falls faster, because the curved
ground presses against the block: a point mass then comes to rest after {bent}, and after {straight}
with Coulomb's energy line alone. The facets of the bend take a few percent more.

## Time steps

{steps}

## Borders within the ground

A rock should not notice that an even slope consists of parts. In this table a sphere of half a
metre rolls 6 m down a slope of 20 deg, and a block of 0.4 x 0.4 x 0.1 m slides to rest on 10 deg
at a friction of 0.6; the block's error is that of the fall of its energy line.

{borders}

## Energy

{hulls} convex hulls of random points fall on rough slopes and tumble. The table gives the largest
rise of the energy above its earlier value, divided by g times the radius, and in brackets the
number of hulls for which it exceeds 0.01.

{energies}

## A tumbling rock

{pushes} runs of the Double Rock surrogate, with the same starts in every row: random orientations
and 0.5 to 2.5 m/s downhill, on a rough slope of 35 deg that ends 14 m ahead in rough level ground.
The horizontal distance from start to end is given as its mean with the standard error, and as the
standard deviation of single runs. Lost runs left the ground or were still moving after 40 s.

{tumbled}

A single run says little: for given coefficients, the start alone causes the spread in the table,
and a difference between two rows is significant only if it is several standard errors.

## Where the default engine is wrong

- **Restitution is Newton's**, in both engines: the point of contact leaves with e times its normal
  velocity. Where friction acts off the centre of mass, this does not fix the energy that is lost,
  and a rock could gain energy in an impact (Kane & Levinson 1985). `nonsmooth` lowers e for such an
  impact until it gains none. Stronge's energetic restitution (dashed in panel a) takes more; with
  `contact.restitution_law: energetic` an impact gives back at most e^2 of the energy that it takes.
- **Slow impacts**, below twice what gravity adds in a step, do not rebound.
- **A corner that slides on** while it turns is the case with the largest error in long steps: its
  lever turns within the two steps of an impact.
- **In the bend** the block is no point: its ends bridge the arc of 8 m, its centre of mass runs
  5 cm above it, and at its facets it tips. With finer facets the difference becomes 1 %.
- **A hull that rolls and rebounds** has no steady velocity; no case here tests it.
- Rock and ground are rigid: nothing breaks, and no soil is displaced.

## Where Bullet is wrong

- **Energy** rises in impacts at restitutions from about 0.8 (panel a).
- **Below {threshold}** of normal velocity (for a rock of 1 m radius) nothing rebounds.
- **Points of contact.** Bullet keeps up to four between two bodies and adds one in each step. When
  an edge lands flat, one end therefore touches first: the rock is turned aside, and the impact
  takes less energy than it should. A rolling prism becomes faster than the exact one (panel b) and
  drifts off its line.
- **Borders.** Each convex part is a separate shape. A hull that lies across a border can be pushed
  back by the side of the part ahead of it. On triangles Bullet's filter of internal edges corrects
  such normals (panel c); plain Bullet has it switched off, and a block trips or stops there on even
  ground: [What this means for results of Bullet](limits.md#results-of-bullet-on-meshes). Where a
  slope bends, hulls still catch. A sphere has no filter: with it the points where it touches are
  beside its centre, and a rebound at 1 ms is 3 % off.
- **Friction without restitution** is a pyramid: an impulse can be up to 1.4 times as large as with
  Coulomb's cone, and where several points share a load, some keep the friction of an earlier
  iteration. With restitution Bullet uses another solver, and a cone.
"""


def main() -> int:
    """Print the page, or write it with its figure if asked."""
    parser = argparse.ArgumentParser(prog="benchmarks.rebound")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name} and {FIGURE.name}")
    options = parser.parse_args()
    found = ensembles()
    text = page(found)
    if options.write:
        PAGE.write_text(text, encoding="utf-8")
        FIGURE.write_bytes(png(rebound_figure.figure(found, GENTLE)))
    else:
        print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
