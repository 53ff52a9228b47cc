"""Shapes: slenderness, size, needles and knife edges."""

from __future__ import annotations

from functools import partial

from vsr_core.run.input_checks import longest_step
from vsr_core.scene import Contact, Scene
from vsr_core.verification.rocks import GRIPPING, box, frustum, unit
from vsr_core.verification.stability import Measured, sweep
from vsr_core.verification.stability._trial import BOTH, boundary, step_of

REFERENCE = "first overturning PGA [g]; Housner's block with the same base and inertia; relative"

RATIOS = {1.0: 1.0, 1.2: 0.6, 1.5: 0.6, 2.0: 0.6, 3.0: 0.6, 5.0: 0.6}
RATIOS |= dict.fromkeys((10.0, 20.0, 50.0, 100.0), 0.45)
"""PGV/PGA by height / width, in units of sqrt(radius / g), where boxes overturn after one impact.
Where many decide, the outcome changes with the last digit; and a cube under stronger pulses would
leave the table, which Housner's does not."""

SHORT_RATIO = 0.3
"""The same for bases so narrow that a longer pulse rocks them many times."""


def _box(width: float, depth: float, height: float, engine: str) -> Measured:
    rock = box(width, depth, height)
    ratio = RATIOS[height / width] * unit(rock)
    return boundary(Scene(rock, Contact(GRIPPING)), ratio, step_of(rock), 0.03, engine)


def _sized(width: float, engine: str) -> Measured:
    return _box(width, width, 2.0 * width, engine)


def _deep(depth: float, engine: str) -> Measured:
    return _box(1.0, depth, 2.0, engine)


def _narrow(base: tuple[float, float], engine: str, step_share: float | None = None) -> Measured:
    """Hull on a narrow base, at a step of its own or the longest that the program takes."""
    rock = frustum(base, (0.6, max(0.6, base[1])), 2.0)
    scene = Scene(rock, Contact(GRIPPING))
    step = (
        step_share * unit(rock) if step_share else min(step_of(rock), longest_step(scene, engine))
    )
    return boundary(scene, SHORT_RATIO * unit(rock), step, 0.03, engine)


def _needle(width: float, engine: str) -> Measured:
    return _narrow((width, width), engine)


def _knife_edge(width: float, engine: str) -> Measured:
    return _narrow((width, 1.0), engine)


def _stepped(share: float, engine: str) -> Measured:
    return _narrow((0.02, 1.0), engine, share)


def _varied(parameter: str, unit: str) -> tuple[str, str, str, float]:
    return parameter, unit, REFERENCE, 0.03


CASES = (
    *sweep("1:{x:g} in {engine}", _varied("height / width", "1"), RATIOS, partial(_box, 1.0, 1.0),
           BOTH),
    *sweep("box of {x:g} m", _varied("width", "m"), (0.005, 0.01, 0.1, 10.0), _sized),
    *sweep("box three times as deep", _varied("depth / width", "1"), (3.0,), _deep),
    *sweep("needle on {m:g} mm in {engine}", _varied("base", "m"), (0.2, 0.1, 0.04, 0.02, 0.01),
           _needle, BOTH),
    *sweep("knife edge of {m:g} mm in {engine}", _varied("base", "m"), (0.1, 0.02), _knife_edge,
           BOTH),
    *sweep("knife edge at a step of {x:g}", _varied("step / sqrt(R/g)", "1"),
           (0.0005, 0.002, 0.006), _stepped),
)  # fmt: skip
