"""Variations of a scene and its settings, one at a time, to see what each does to the boundary."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vsr_core.engines import bullet
from vsr_core.engines.interface import Solver
from vsr_core.run.cases import Case, Settings, prepare
from vsr_core.scene import Scene
from vsr_core.table import servo

Change = Callable[[Case, Settings], tuple[Case, Settings]]


@dataclass(frozen=True)
class Variation:
    """One thing changed.

    Attributes
    ----------
    what, value : str, as a table shows them
    shapes : tuple of str, shapes of rock that it makes sense for
    """

    what: str
    value: str
    change: Change
    engines: tuple[str, ...] = ("bullet", "mujoco", "nonsmooth")
    shapes: tuple[str, ...] = ("box", "hull")


def variations() -> tuple[Variation, ...]:
    """All of them; the first changes nothing."""
    return (
        Variation("as chosen", "", lambda case, settings: (case, settings)),
        *(
            Variation(
                "solver iterations", str(count), _solver(count, bullet.SOLVER.residual), ("bullet",)
            )
            for count in (5, 10, 20, 50, 200)
        ),
        *(
            Variation("residual that ends them", f"{end:g}", _solver(50, end), ("bullet",))
            for end in (5e-2, 5e-3, 5e-4, 0.0)
        ),
        Variation("pedestal", "plane", _pedestal("plane")),
        Variation("pedestal", "slab", _pedestal("box")),
        Variation("pedestal", "triangle mesh", _pedestal("mesh"), ("bullet",)),
        Variation("shape of the rock", "hull", _as_hull, shapes=("box",)),
        Variation("drive", "servo, 50 t, 1 kHz", _driven, ("bullet",)),
        Variation("reduce", "off", _complete),
    )


def _solver(iterations: int, residual: float) -> Change:
    solver = Solver(iterations, residual)
    return lambda case, settings: (case, replace(settings, solver=solver))


def _pedestal(kind: str) -> Change:
    def change(case: Case, settings: Settings) -> tuple[Case, Settings]:
        scenes = {name: replace(getattr(case, name), pedestal=kind) for name in ("scene", "full")}
        return replace(case, **scenes), settings

    return change


def _as_hull(case: Case, settings: Settings) -> tuple[Case, Settings]:
    rock = replace(case.full.rock, shape="hull")
    scene = Scene(rock, case.full.contact, case.full.yaw)
    return prepare(scene, case.limits, reduce=settings.reduce), settings


def _driven(case: Case, settings: Settings) -> tuple[Case, Settings]:
    full = case.full
    scene = Scene(full.rock, full.contact, full.yaw, drive=servo.PUBLISHED)
    return prepare(scene, case.limits, reduce=settings.reduce), settings


def _complete(case: Case, settings: Settings) -> tuple[Case, Settings]:
    full = case.full
    scene = Scene(full.rock, full.contact, full.yaw)
    return prepare(scene, case.limits, reduce=False), replace(settings, reduce=False)
