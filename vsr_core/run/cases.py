"""What is to be run: settings, and a scene with all that its runs share, computed once."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vsr_core.engines.interface import Solver
from vsr_core.judge import proofs
from vsr_core.run.reductions import Reduction
from vsr_core.run.reductions import reduce as reduce_scene
from vsr_core.scene import Scene
from vsr_core.table import servo


@dataclass(frozen=True)
class Settings:
    """How a run is computed.

    Attributes
    ----------
    time_step : float [s], the largest allowed; a whole number of steps fills the motion, or the
        control period of a drive
    reduce : bool, whether to leave out what cannot change the outcome
    whole : bool, whether a rock that stays upright is followed to rest though that is proved, so
        that its largest tilt and slip are known
    engine : str, name of a module in ``vsr_core.engines``
    solver : Solver, effort of the engine's solver where it is not the engine's own
    """

    time_step: float
    reduce: bool = True
    engine: str = "bullet"
    solver: Solver | None = None
    whole: bool = False


@dataclass(frozen=True)
class Case:
    """A rock on a flat pedestal.

    Attributes
    ----------
    full : Scene, with all vertices of the rock
    scene : Scene, as simulated; ``full`` itself if its rock was not reduced
    static_limits : tuple of float, lowest and highest table acceleration [m/s^2] that move
        nothing; zeros for springs, for a start on the move, and for a drive, whose table
        overshoots a little
    slides : bool, whether nothing along x can tip the rock, which then can only slide
    """

    full: Scene
    scene: Scene
    reductions: tuple[Reduction, ...]
    limits: proofs.Barrier
    static_limits: tuple[float, float]
    slides: bool


@dataclass(frozen=True)
class TerrainCase:
    """A rock on its seat in a terrain.

    Attributes
    ----------
    seat : Scene, on a terrain and with a start, as detailed as it is known
    flight : Scene, of the same rock on the same terrain, for the time after toppling
    toppled_tilt : float [rad], beyond which the rock has toppled
    static_limits : tuple of float, lowest and highest table acceleration [m/s^2] that move
        nothing; zeros where they are not known
    """

    seat: Scene
    flight: Scene
    toppled_tilt: float
    static_limits: tuple[float, float] = (0.0, 0.0)


def prepare(described: Scene, limits: proofs.Barrier, *, reduce: bool) -> Case:
    """Reduce a scene, or take it as it is.

    Raises
    ------
    InvalidInput
        For a drive whose sampled loop is unstable.
    """
    static_limits = (0.0, 0.0)
    rigid_from_rest = described.contact.stiffness is None and described.start is None
    slides = rigid_from_rest and proofs.only_slides(described.rock, described.contact)
    if described.drive is not None:
        servo.check(described.drive)
    elif rigid_from_rest:
        static_limits = proofs.static_limits(described.rock, described.contact, described.yaw)
    reduced, reductions = reduce_scene(described) if reduce else (described, ())
    full = replace(reduced, rock=described.rock, kept_tilt=described.kept_tilt)
    return Case(full, reduced, reductions, limits, static_limits, slides)


def never_starts(
    static_limits: tuple[float, float], peak_acceleration: float, settings: Settings
) -> bool:
    """Whether a run needs no step: nothing moves the rock, whichever way it is pushed.

    Parameters
    ----------
    static_limits : tuple of float [m/s^2], lowest and highest table acceleration that move nothing
    peak_acceleration : float [m/s^2], of a motion along one axis

    Examples
    --------
    >>> [never_starts((-3.0, 2.0), peak, Settings(1e-3)) for peak in (1.9, 2.1)]
    [True, False]
    """
    lowest, highest = static_limits
    return settings.reduce and peak_acceleration < min(-lowest, highest)
