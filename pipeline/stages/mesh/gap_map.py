"""Map of the gap between a rock and the ground beneath it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.drawing.rendering import depths_of, drawn, seen
from pipeline.drawing.view import fitted
from pipeline.stages.mesh.scan_views import ABOVE, SEAM, scale
from vsr_core.arrays import Array, Indices
from vsr_core.terrain.surface import Terrain

_SIDE = 400  # pixels
_FARTHEST = 0.02  # of the rock's width, of gap and overlap that colours tell apart
_MIRRORED = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Gaps:
    """Vertical distances from the ground up to a rock's underside.

    Attributes
    ----------
    gap : ndarray, shape (rows, columns) [m], negative where they overlap; nan beside the rock
    corner : ndarray, shape (2,) [m], of the map, lower left
    pixel : float [m]
    """

    gap: Array
    corner: Array
    pixel: float

    @property
    def touching(self) -> float:
        """Area in plan in which the two are within a millimetre [m^2]."""
        return float((np.abs(self.gap) < 1e-3).sum()) * self.pixel**2

    @property
    def overlap(self) -> float:
        """Largest overlap [m]."""
        return abs(float(np.nanmin(self.gap, initial=0.0)))

    @property
    def overlapping(self) -> float:
        """Area in plan in which they overlap by more than a millimetre [m^2]."""
        return float((self.gap < -1e-3).sum()) * self.pixel**2


def gaps(vertices: Array, faces: Indices, terrain: Terrain) -> Gaps:
    """Measure the gap everywhere below a rock, by its lowest surface and the ground's highest.

    Ground above the rock's middle is left out.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) [m]
    faces : ndarray of int, shape (m, 3)
    """
    view = fitted(ABOVE, vertices, (_SIDE, _SIDE), 0.02)
    view = replace(view, middle=view.middle * [1.0, 1.0, 0.0])
    middle = 0.5 * (vertices[:, 2].min() + vertices[:, 2].max())
    low = terrain.faces[(terrain.vertices[terrain.faces, 2] < middle).all(axis=1)]
    ground = drawn(view, terrain.vertices, low)
    rock = drawn(view, vertices * _MIRRORED, faces[:, ::-1])
    both = np.intersect1d(seen(ground), seen(rock))
    gap = np.full(ground.shape, np.nan)
    gap[both] = -depths_of(rock[both]) - depths_of(ground[both])
    corner = view.middle[:2] - 0.5 * _SIDE * view.pixel
    return Gaps(gap.reshape(view.shape), corner, view.pixel)


@style.styled
def gap_map(found: Gaps, seams: list[Array], source: str) -> Figure:
    """Draw gap and overlap in plan.

    Parameters
    ----------
    seams : list of ndarray, shape (n, 3) [m], closed lines
    """
    figure = Figure(figsize=(5.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    wide = _SIDE * found.pixel
    most = 1e3 * _FARTHEST * wide
    (left, bottom), extent = found.corner, wide
    image = axes.imshow(
        1e3 * found.gap,
        extent=(left, left + extent, bottom, bottom + extent),
        cmap="RdBu",
        vmin=-most,
        vmax=most,
        interpolation="nearest",
        gid="gap",
    )
    for seam in seams:
        axes.plot(*np.vstack([seam, seam[:1]])[:, :2].T, color=SEAM, lw=1.2, gid="seam")
    axes.set_axis_off()
    scale(axes, 1.0)
    label = "overlap < 0 < gap, rock above ground [mm]"
    figure.colorbar(image, ax=axes, extend="both", label=label)
    figure.suptitle(source, size=8.0, color=style.FAINT)
    return figure
