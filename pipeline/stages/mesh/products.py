"""Products of this room, and the rock and its ground as later stages take them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from pipeline.workflow.datasets import Stored
from pipeline.workflow.store import Store
from vsr_core.arrays import Array
from vsr_core.judge.proofs import Barrier
from vsr_core.rock.body import Rock
from vsr_core.run.movement import no_return_tilt
from vsr_core.scene import State
from vsr_core.terrain.surface import Terrain

SCAN_PAGE = "prep.html"

BARRIER_SCALARS = ("toppled_tilt", "edge_tilt", "edge_height", "upright_floor", "floor")
"""Attributes of the rock's dataset that tell its energy barrier."""


class ScanData(Stored):
    """Rock and ground of a scan, told apart."""

    FILE = "scan.nc"


def of_contact(pieces: tuple[Array, ...], error: float, told: str) -> xr.Dataset:
    """What of a rock touches its terrain, as it is stored.

    Parameters
    ----------
    pieces : tuple of ndarray, each of shape (k, 3) [m]; none where its hull touches
    error : float [m], of the pieces
    told : str, which of both, and why
    """
    if not pieces:
        return xr.Dataset(attrs={"contact_shape": told})
    number = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
    return xr.Dataset(
        {
            "piece_vertex": (("piece_corner", "xyz"), np.concatenate(pieces)),
            "piece": ("piece_corner", number.astype(np.int32)),
        },
        attrs={"contact_shape": told, "contact_error_m": error},
    )


def pieces_in(data: xr.Dataset) -> tuple[Array, ...]:
    """Corners of the pieces of a rock, each of shape (k, 3) [m]; none where its hull touches."""
    if "piece" not in data:
        return ()
    corners, number = data["piece_vertex"].values, data["piece"].values
    return tuple(corners[number == one] for one in np.unique(number))


class PlacedData(Stored):
    """A rock in the pose in which it stands on a terrain of its own file."""

    FILE = "placed.nc"


class RockData(Stored):
    """The rock at rest, with its surface and how it tips."""

    FILE = "rock.nc"

    @property
    def no_return(self) -> float:
        """Tilt from which the rock does not come back [rad]."""
        angles = np.radians(self.data["tipping_angle"].values)
        return no_return_tilt(angles, float(self.data.attrs["barrier_toppled_tilt"]))


class TerrainData(Stored):
    """The ground, and the rock's rest on it."""

    FILE = "terrain.nc"


@dataclass(frozen=True, eq=False)
class Standing:
    """The rock as runs take it, its energy barrier, and what of it touches a terrain, in words."""

    rock: Rock
    barrier: Barrier
    contact: str = "the rock's hull"

    @classmethod
    def load(cls, store: Store) -> Standing:
        """The rock of a folder."""
        data = RockData.load(store).data
        rock = Rock(
            data.attrs["rock_shape"],
            data["vertex"].values,
            float(data.attrs["mass_kg"]),
            data["principal_moment"].values,
            data["principal_axis"].values,
            pieces_in(data),
        )
        scalars = (float(data.attrs[f"barrier_{name}"]) for name in BARRIER_SCALARS)
        barrier = Barrier(data["barrier_tilt"].values, data["barrier_height"].values, *scalars)
        return cls(rock, barrier, str(data.attrs.get("contact_shape", cls.contact)))


@dataclass(frozen=True, eq=False)
class Ground:
    """A terrain as runs take it, and the rock's state of rest on it at each friction.

    Attributes
    ----------
    whole_seam : bool, whether all of the seam bears the rock, all of which has to touch then
    """

    terrain: Terrain
    starts: tuple[State, ...]
    whole_seam: bool = False

    @classmethod
    def load(cls, store: Store) -> Ground:
        """The ground of a folder."""
        data = TerrainData.load(store).data
        faces = data["contact_face"].values.astype(np.int64)
        terrain = Terrain(data["contact_vertex"].values, faces)
        places, turns = data["start_position"].values, data["start_quaternion"].values
        return cls.of(terrain, places, turns, whole_seam=bool(data.attrs["whole_seam"]))

    @classmethod
    def of(cls, terrain: Terrain, places: Array, turns: Array, *, whole_seam: bool) -> Ground:
        """A terrain, and states of rest on it as they are stored.

        Parameters
        ----------
        places : ndarray, shape (k, 3) [m], of the centre of mass
        turns : ndarray, shape (k, 4), quaternions x, y, z, w
        """
        still = np.zeros(3)
        rotations = Rotation.from_quat(turns).as_matrix()
        starts = zip(places, rotations, strict=True)
        rests = tuple(State(place, turn, still, still) for place, turn in starts)
        return cls(terrain, rests, whole_seam)
