"""Shapes: slenderness, size, needles and knife edges."""

from __future__ import annotations

from functools import partial

from vsr_core import engines
from vsr_core.rock.body import Rock
from vsr_core.run.input_checks import longest_step
from vsr_core.scene import Contact, Scene
from vsr_core.verification.stability import Case, Measured
from vsr_core.verification.stability._trial import GRIPPING, boundary, box, frustum, step_of, unit

REFERENCE = "first overturning PGA [g]; Housner's block with the same base and inertia; relative"

RATIOS = {1.0: 1.0, 1.2: 0.6, 1.5: 0.6, 2.0: 0.6, 3.0: 0.6, 5.0: 0.6}
RATIOS |= dict.fromkeys((10.0, 20.0, 50.0, 100.0), 0.45)
"""PGV/PGA by height / width, in units of sqrt(radius / g), where boxes overturn after one impact.
Where many decide, the outcome changes with the last digit; and a cube under stronger pulses would
leave the table, which Housner's does not."""

SHORT_RATIO = 0.3
"""The same for bases so narrow that a longer pulse rocks them many times."""


def _box(width: float, depth: float, height: float, engine: str = "bullet") -> Measured:
    rock = box(width, depth, height)
    ratio = RATIOS[height / width] * unit(rock)
    return boundary(Scene(rock, Contact(GRIPPING)), ratio, step_of(rock), 0.03, engine)


def _narrow(base: tuple[float, float], step_share: float | None, engine: str) -> Measured:
    """Hull on a narrow base, at a step of its own or the longest that the program takes."""
    rock = _hull(base)
    scene = Scene(rock, Contact(GRIPPING))
    step = (
        step_share * unit(rock) if step_share else min(step_of(rock), longest_step(scene, engine))
    )
    return boundary(scene, SHORT_RATIO * unit(rock), step, 0.03, engine)


def _hull(base: tuple[float, float]) -> Rock:
    return frustum(base, (0.6, max(0.6, base[1])), 2.0)


ENGINES = tuple(engines.names())

CASES = (
    *(
        Case(f"1:{s:g} in {engine}", "shape", "height / width", s, "1", REFERENCE, 0.03,
             partial(_box, 1.0, 1.0, s, engine))
        for engine in ENGINES for s in RATIOS
    ),
    *(
        Case(f"box of {s:g} m", "shape", "width", s, "m", REFERENCE, 0.03,
             partial(_box, s, s, 2.0 * s))
        for s in (0.005, 0.01, 0.1, 10.0)
    ),
    Case("box three times as deep", "shape", "depth / width", 3.0, "1", REFERENCE, 0.03,
         partial(_box, 1.0, 3.0, 2.0)),
    *(
        Case(f"needle on {1e3 * w:g} mm in {engine}", "shape", "base", w, "m", REFERENCE, 0.03,
             partial(_narrow, (w, w), None, engine))
        for engine in ENGINES for w in (0.2, 0.1, 0.04, 0.02, 0.01)
    ),
    *(
        Case(f"knife edge of {1e3 * w:g} mm in {engine}", "shape", "base", w, "m", REFERENCE, 0.03,
             partial(_narrow, (w, 1.0), None, engine))
        for engine in ENGINES for w in (0.1, 0.02)
    ),
    *(
        Case(f"knife edge at a step of {x:g}", "shape", "step / sqrt(R/g)", x, "1", REFERENCE, 0.03,
             partial(_narrow, (0.02, 1.0), x, "bullet"))
        for x in (0.0005, 0.002, 0.006)
    ),
)  # fmt: skip
