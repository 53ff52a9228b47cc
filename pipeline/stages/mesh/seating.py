"""A rock set on its seat: ground as runs need it, what of it bears, and where the rock rests."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import xarray as xr

from vsr_core.arrays import Array, Mask
from vsr_core.engines import load
from vsr_core.rock import reduction
from vsr_core.rock.body import Rock
from vsr_core.run.displacement import settled
from vsr_core.run.time_step import step_unit
from vsr_core.scan import seat
from vsr_core.scan.placing import set_down
from vsr_core.scene import Contact, Scene, State
from vsr_core.terrain.coarsening import coarser
from vsr_core.terrain.surface import Terrain

NEAR_RADII = 2.0
"""Distance from the rock, in its radii, up to which the ground is more detailed than beyond."""

NEAR_SHARE, SLOPE_SHARE = 0.008, 0.04
"""How far the ground of runs may be from the one that was scanned, near the rock and beyond, as a
share of the rock's radius; that which may bear the rock stays as it was scanned."""


@dataclass(frozen=True, eq=False)
class Bed:
    """Ground before a rock is set on it.

    Attributes
    ----------
    ground : Terrain, as detailed as runs need it
    seams : tuple of ndarray, shape (n, 3) [m] each, around what was not seen of it; none where it
        is in a file of its own
    """

    ground: Terrain
    seams: tuple[Array, ...]


def whole_ground(data: xr.Dataset) -> Terrain:
    """The ground of a scan, or of a file of its own, with all its triangles."""
    return Terrain(data["terrain_vertex"].values, data["terrain_face"].values.astype(np.int64))


def bed(data: xr.Dataset, rock: Rock, *, reduce: bool, whole_seam: bool) -> Bed:
    """The ground of a scan, or of a file of its own, light enough to run on.

    Parameters
    ----------
    whole_seam : bool, whether what was not seen bears the rock: it stays as it is then
    """
    whole = light = whole_ground(data)
    unseen = np.zeros(len(whole.faces), dtype=bool)
    if "terrain_unseen" in data:
        unseen = data["terrain_unseen"].values.astype(bool)
    if reduce:
        light = coarser(
            whole, partial(_tolerance, rock), _below(whole, rock) & (whole_seam | ~unseen)
        )
    return Bed(light, seat.seams(whole, unseen))


def _below(ground: Terrain, rock: Rock) -> Mask:
    """The triangles that may bear the rock: all that its plan may meet."""
    plan = ground.vertices[ground.faces][:, :, :2]
    nearest = np.clip(0.0, plan.min(axis=1), plan.max(axis=1))
    return np.asarray(np.hypot(*nearest.T) <= np.hypot(*rock.vertices.T[:2]).max())


def _tolerance(rock: Rock, points: Array) -> Array:
    near = np.hypot(points[:, 0], points[:, 1]) < NEAR_RADII * rock.radius
    return np.where(near, NEAR_SHARE, SLOPE_SHARE) * rock.radius


def laid(own: Bed, rock: Rock, seated: Rock, bearing: seat.Bearing) -> tuple[seat.Seat, float]:
    """The ground that bears a rock, and the height of its centre of mass from which it settles.

    Parameters
    ----------
    seated : Rock, the same as it stands on its seat in runs
    """
    up = np.array([0.0, 0.0, rock.height])
    corners, outer = seated.vertices + up, rock.vertices + up
    if own.seams:
        pieces = tuple(piece + up for piece in rock.pieces)
        return seat.seat(own.ground, own.seams, corners, outer, bearing, pieces), rock.height
    found, raised = set_down(own.ground, corners, outer, rock.radius)
    return found, rock.height + raised


def seated(rock: Rock, *, reduce: bool, whole_seam: bool) -> Rock:
    """The rock as it stands on its seat in runs: all of it where all of the seam bears it."""
    return reduction.on_its_seat(rock) if reduce and not whole_seam else rock


def longest_step(rock: Rock, engine: str) -> float:
    """The longest time step of an engine [s]."""
    return load(engine).LADDER.longest * step_unit(rock)


def rest(terrain: Terrain, rock: Rock, height: float, contact: Contact, engine: str) -> Scene:
    """A rock that has come to rest, let go as it was scanned.

    Parameters
    ----------
    rock : Rock, as it stands on its seat
    height : float [m], of its centre of mass as scanned
    """
    scanned = State(np.array([0.0, 0.0, height]), np.eye(3), np.zeros(3), np.zeros(3))
    scene = Scene(rock, contact, 0.0, "terrain", start=scanned, terrain=terrain)
    return replace(scene, start=settled(scene, longest_step(rock, engine), engine))
