"""Draws of a rock on its seat: what bears it there, how far its seam is off, and how it rests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.config import in_si
from pipeline.config.priors_schema import SeatWeights, UncertaintyConfig
from pipeline.config.schema import SceneSettings
from pipeline.stages.mesh import seating
from pipeline.stages.mesh.products import Ground, ScanData, TerrainData
from pipeline.stages.mesh.seating import Bed
from vsr_core.arrays import Array
from vsr_core.errors import InvalidInput
from vsr_core.rock.body import Rock
from vsr_core.scan import seat
from vsr_core.scan.seat import Bearing
from vsr_core.terrain.surface import Terrain
from vsr_core.validation.priors import Member, further
from vsr_core.validation.specimen import random_field

FEW = (3, 4, 5, 6)
"""Numbers of points of which one is drawn where few bear."""

TRIES = 5
"""Seams drawn until the rock rests on one, as it does on its own."""


@dataclass(frozen=True, eq=False)
class DrawnSeat:
    """What bears a rock in a draw, and the ground on which it rests so.

    Attributes
    ----------
    bearing : "rim", a number of points, or "whole"
    outline : ndarray, shape (k, 3) [m]
        Points that bear, or of the outline of a seam that does as a whole, from the centre of mass.
    """

    bearing: Bearing
    ground: Ground
    outline: Array


def chosen(weights: SeatWeights, count: int) -> list[Bearing]:
    """What bears the rock in each of some draws, every number of points as likely."""
    every: list[Bearing] = ["rim", *FEW, "whole"]
    shares = weights.shares
    ends = np.cumsum([shares["rim"], *[shares["points"] / len(FEW)] * len(FEW)])
    return [every[at] for at in np.searchsorted(ends, further(count), side="right").tolist()]


def weighed(rock: Rock, centre: Array) -> Rock:
    """A rock with its centre of mass elsewhere, shape (3,) [m]."""
    if not np.any(centre):
        return rock
    pieces = tuple(piece - centre for piece in rock.pieces)
    return replace(rock, vertices=rock.vertices - centre, pieces=pieces)


def of_site(scan: ScanData, terrain: TerrainData, rock: Rock) -> Array:
    """The outline of the seat of a site as it is."""
    unseen = scan.data["terrain_unseen"].values.astype(bool)
    seams = seat.seams(seating.whole_ground(scan.data), unseen)
    return outline(terrain.data["bearing_point"].values, seams, rock)


def outline(points: Array, seams: Sequence[Array], rock: Rock) -> Array:
    """Points between which the weight of a rock on its seat is, from its centre of mass.

    Parameters
    ----------
    points : ndarray, shape (k, 3) [m], that bear; none where all of the seam does
    """
    every = points if len(points) else np.concatenate(list(seams))
    return np.asarray(every - [0.0, 0.0, rock.height])


def drawn(
    bed: Bed,
    rock: Rock,
    member: Member,
    wanted: Bearing,
    settings: SceneSettings,
    config: UncertaintyConfig,
) -> DrawnSeat:
    """The seat of a draw.

    The rock stands in the field. Where it would not on a seat, other errors of the seam are drawn,
    and at last its rim bears. A seam that bears as a whole has no error, as it conforms.

    Parameters
    ----------
    bed : Bed, in the frame of the site's own rock
    rock : Rock, with its centre of mass as drawn
    settings : SceneSettings, with the contact as drawn

    Raises
    ------
    InvalidInput
        If it rests on none.
    """
    for bearing, seams in _tried(bed, member, wanted, config):
        try:
            return _rests(Bed(bed.ground, seams), rock, member.centre, bearing, settings)
        except InvalidInput:
            continue
    raise InvalidInput(
        "a draw of the rock that rests on no seat drawn for it",
        "it stands as scanned, to within the errors",
        "reduce uncertainty.centre_of_mass, or uncertainty.scan.error",
    )


def _tried(
    bed: Bed, member: Member, wanted: Bearing, config: UncertaintyConfig
) -> Iterator[tuple[Bearing, tuple[Array, ...]]]:
    """Seats in the order in which they are tried, with their seams."""
    rng = np.random.default_rng(member.seed)
    error, length = member.error * config.scan.error, config.scan.correlation_length
    every = np.concatenate(bed.seams)
    ends = np.cumsum([len(seam) for seam in bed.seams])[:-1]
    for bearing in dict.fromkeys((wanted, "rim")):
        if bearing == "whole" or not error:
            yield bearing, bed.seams
            continue
        for _ in range(TRIES):
            shift = np.column_stack([random_field(every, length, rng) for _ in range(3)])
            yield bearing, tuple(np.split(every + error * shift, ends))


def _rests(
    bed: Bed, rock: Rock, centre: Array, bearing: Bearing, settings: SceneSettings
) -> DrawnSeat:
    """A rock at rest on a seat; the ground is moved, so that the rock stays above its origin."""
    shift = -centre * [1.0, 1.0, 0.0]
    ground = Terrain(bed.ground.vertices + shift, bed.ground.faces)
    own = Bed(ground, tuple(seam + shift for seam in bed.seams))
    whole, reduce = bearing == "whole", settings.simulation.reduce
    seated = seating.seated(rock, reduce=reduce, whole_seam=whole)
    laid, height = seating.laid(own, rock, seated, bearing)
    contact = in_si.contact(settings.contact, settings.contact.friction[0])
    start = seating.rest(laid.terrain, seated, height, contact, settings.engine).start
    assert start is not None
    turn = Rotation.from_matrix(start.rotation[None]).as_quat()
    found = Ground.of(laid.terrain, start.position[None], turn, whole_seam=whole)
    return DrawnSeat(bearing, found, outline(laid.points, own.seams, rock))
