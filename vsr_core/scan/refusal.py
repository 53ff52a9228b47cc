"""A refusal together with what was made of the scan until then, so that it can be looked at."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import trimesh

from vsr_core.arrays import Array, Indices, Mask
from vsr_core.errors import InvalidInput, InvalidPlace
from vsr_core.rock.solid import FARTHEST


@dataclass(frozen=True, eq=False)
class Seen:
    """What was made of a scan.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    offset : ndarray, shape (3,) [m], the scan's coordinates are those of ``vertices`` plus these
    parts : dict of ndarray of bool, shape (m,), what was taken for what, by name
    """

    vertices: Array
    faces: Indices
    offset: Array
    parts: dict[str, Mask]

    @classmethod
    def nothing_of(cls, mesh: trimesh.Trimesh) -> Seen:
        """Nothing yet but the scan itself, as far as it can be drawn.

        Parameters
        ----------
        mesh : trimesh.Trimesh [m]
        """
        vertices = np.array(mesh.vertices, dtype=np.float64)
        faces = np.array(mesh.faces, dtype=np.int64)
        whole = (np.abs(vertices[faces]) < FARTHEST).all(axis=(1, 2))
        used, local = np.unique(faces[whole], return_inverse=True)
        middle = vertices[used].mean(axis=0) if len(used) else np.zeros(3)
        return cls(vertices[used] - middle, local.reshape(-1, 3), middle, {})


class Refused(InvalidInput):
    """A refusal of a scan, and where it fails."""

    def __init__(self, error: InvalidInput, seen: Seen) -> None:
        places = [*error.places] if isinstance(error, InvalidPlace) else []
        self.seen, self.places = seen, np.array(places).reshape(-1, 3) + seen.offset
        super().__init__(error.given + _told(self.places), error.rule, error.remedy)


def _told(places: Array) -> str:
    if not len(places):
        return ""
    more = f" and {len(places) - 1} more places" if len(places) > 1 else ""
    return f" at {place(places[0])}{more}"


def place(point: Array) -> str:
    """Coordinates as they are told.

    Parameters
    ----------
    point : ndarray, shape (3,) [m]

    Examples
    --------
    >>> place(np.array([1.0, 2.5, -0.001]))
    '(1.00, 2.50, 0.00)'
    """
    return f"({', '.join(f'{round(x, 2) + 0.0:.2f}' for x in point.tolist())})"


@contextmanager
def refusing(seen: Seen, kind: type[Refused] = Refused) -> Iterator[None]:
    """Add to a refusal what was made of the scan until then.

    Raises
    ------
    Refused
        In place of an InvalidInput.
    """
    try:
        yield
    except Refused:
        raise
    except InvalidInput as error:
        raise kind(error, seen) from error
