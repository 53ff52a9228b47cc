"""Hills and pits of a formula, for rocks whose terrain is not known.

z = sin(x / 2) cos(y / 2) has a hilltop at (pi, 0), a pit at (-pi, 0), and at (0, 0) between them
its steepest slope, of 27 deg.

References
----------
The rough terrain of github.com/ZhiangChen/VSR_Pro is this formula on the same triangles.
"""

from __future__ import annotations

import numpy as np

from vsr_core.arrays import Array, Indices

HALF_WIDTH, STEP = 10.0, 0.5  # m


def ground() -> tuple[Array, Indices]:
    """Vertices, shape (n, 3) [m], and faces, counter-clockwise from above, of a square sheet.

    Examples
    --------
    >>> vertices, faces = ground()
    >>> len(faces), float(vertices[:, 2].max().round(3))
    (3200, 0.999)
    """
    count = round(2.0 * HALF_WIDTH / STEP) + 1
    along = np.linspace(-HALF_WIDTH, HALF_WIDTH, count)
    x, y = (each.ravel() for each in np.meshgrid(along, along, indexing="ij"))
    corner = np.arange(count * count).reshape(count, count)
    low, high = corner[:-1, :-1].ravel(), corner[1:, 1:].ravel()
    right, left = corner[1:, :-1].ravel(), corner[:-1, 1:].ravel()
    halves = np.stack([low, right, left, right, high, left], axis=1).reshape(-1, 3)
    return np.column_stack([x, y, np.sin(x / 2.0) * np.cos(y / 2.0)]), halves.astype(np.int64)
