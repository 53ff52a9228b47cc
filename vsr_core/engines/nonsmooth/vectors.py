"""Small vector algebra of compiled code: numbers in, numbers out, no arrays made."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.engines.nonsmooth.compiling import compiled


@compiled
def cross(a: float, b: float, c: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Cross product of (a, b, c) and (x, y, z)."""
    return b * z - c * y, c * x - a * z, a * y - b * x


@compiled
def turned(
    turn_x: float, turn_y: float, turn_z: float, w: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) turned by a rotation vector [rad], in the axes that it leads to.

    Sine and cosine are their series, which give the same bits on every machine; at 1 rad they are
    right to 1e-10.
    """
    square = 0.25 * (turn_x * turn_x + turn_y * turn_y + turn_z * turn_z)
    sine = 0.5 * _sinc(square)
    real = 1.0 - square * (
        0.5 - square * (1 / 24 - square * (1 / 720 - square * (1 / 40320 - square / 3628800)))
    )
    a, b, c = sine * turn_x, sine * turn_y, sine * turn_z
    new_w = real * w - a * x - b * y - c * z
    new_x = real * x + a * w + b * z - c * y
    new_y = real * y + b * w + c * x - a * z
    new_z = real * z + c * w + a * y - b * x
    size = 1.0 / math.sqrt(new_w * new_w + new_x * new_x + new_y * new_y + new_z * new_z)
    return size * new_w, size * new_x, size * new_y, size * new_z


@compiled
def _sinc(square: float) -> float:
    """sin(x)/x from x squared."""
    return 1.0 - square * (
        1 / 6 - square * (1 / 120 - square * (1 / 5040 - square * (1 / 362880 - square / 39916800)))
    )


@compiled
def matrix(w: float, x: float, y: float, z: float, rotation: Array) -> None:
    """Write the rotation matrix of a unit quaternion into ``rotation``, shape (3, 3)."""
    rotation[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    rotation[0, 1] = 2.0 * (x * y - z * w)
    rotation[0, 2] = 2.0 * (x * z + y * w)
    rotation[1, 0] = 2.0 * (x * y + z * w)
    rotation[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    rotation[1, 2] = 2.0 * (y * z - x * w)
    rotation[2, 0] = 2.0 * (x * z - y * w)
    rotation[2, 1] = 2.0 * (y * z + x * w)
    rotation[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@compiled
def inertia_turned(rotation: Array, moments: Array, tensor: Array) -> None:
    """Write R diag(moments) R^T into ``tensor``, shape (3, 3)."""
    for i in range(3):
        for j in range(i, 3):
            value = 0.0
            for k in range(3):
                value += rotation[i, k] * moments[k] * rotation[j, k]
            tensor[i, j] = value
            tensor[j, i] = value
