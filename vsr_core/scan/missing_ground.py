"""Where a scan has no ground."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vsr_core.scan.topology import border

if TYPE_CHECKING:
    import trimesh


def holes(mesh: trimesh.Trimesh) -> Iterator[str]:
    """Where ground is missing within its outline, in words.

    Parameters
    ----------
    mesh : trimesh.Trimesh [m], of which one rim is the outline
    """
    rims = border(mesh.faces)
    if not len(rims):
        return
    names, ends = np.unique(rims, return_inverse=True)
    one, other = ends.reshape(-1, 2).T
    links = coo_array((np.ones(len(one)), (one, other)), shape=(len(names), len(names)))
    number, rim = connected_components(links, directed=False)
    places = mesh.vertices[names]
    widths = sorted(float(np.ptp(places[rim == at], axis=0).max()) for at in range(number))
    if len(widths) > 1:
        told = "a hole" if number == 2 else f"{number - 1} holes"
        yield f"the ground has {told}, up to {widths[-2]:.2g} m wide, in which nothing bears a rock"
