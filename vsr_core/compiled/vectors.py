"""Small vector algebra of compiled code: numbers in, numbers out, no arrays made."""

from __future__ import annotations

import math

from vsr_core.arrays import Array
from vsr_core.compiled.compiling import compiled


@compiled
def assign(target: Array, source: Array) -> None:
    """Copy one vector into another, without the memory that a slice would take for that.

    Parameters
    ----------
    target, source : ndarray, shape (n,)
    """
    for k in range(len(target)):
        target[k] = source[k]


@compiled
def assign_matrix(target: Array, source: Array) -> None:
    """Copy one matrix into another.

    Parameters
    ----------
    target, source : ndarray, shape (n, m)
    """
    for k in range(len(target)):
        assign(target[k], source[k])


@compiled
def length(vector: Array) -> float:
    """Length of the first three components.

    Parameters
    ----------
    vector : ndarray, shape (n,), n >= 3
    """
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@compiled
def cross(a: float, b: float, c: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Cross product of (a, b, c) and (x, y, z)."""
    return b * z - c * y, c * x - a * z, a * y - b * x


@compiled
def product(matrix: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Product of a matrix and (x, y, z).

    Parameters
    ----------
    matrix : ndarray, shape (3, 3)
    """
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
    )


@compiled
def turned(
    turn_x: float, turn_y: float, turn_z: float, w: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) turned by a rotation vector [rad], in the axes that it leads to.

    Sine and cosine are their series, which give the same bits on every machine; at 1 rad they are
    right to 1e-10.

    Parameters
    ----------
    turn_x, turn_y, turn_z : float [rad], rotation vector
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
    """Write the rotation matrix of a unit quaternion into ``rotation``, shape (3, 3).

    Parameters
    ----------
    rotation : ndarray, shape (3, 3)
    """
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
    """Write R diag(moments) R^T into ``tensor``, shape (3, 3).

    Parameters
    ----------
    rotation : ndarray, shape (3, 3)
    moments : ndarray, shape (3,) [m^2]
    tensor : ndarray, shape (3, 3), written
    """
    for i in range(3):
        for j in range(i, 3):
            value = 0.0
            for k in range(3):
                value += rotation[i, k] * moments[k] * rotation[j, k]
            tensor[i, j] = value
            tensor[j, i] = value


@compiled
def sharpest(arms: Array, x: float, y: float, z: float) -> float:
    """Bound for how far ``arms``, shape (n, 3), all stay behind some direction.

    Parameters
    ----------
    arms : ndarray, shape (n, 3), unit vectors
    x, y, z : float, vector with which that direction makes an acute angle

    Returns
    -------
    float
        Largest product of an arm with one such unit vector, the mean of those normal to two arms
        that no arm is in front of: negative if the arms stand in a convex cone.
    """
    a = b = c = 0.0
    for i in range(len(arms)):
        for j in range(len(arms)):
            if i == j:
                continue
            p, q, r = cross(arms[i, 0], arms[i, 1], arms[i, 2], arms[j, 0], arms[j, 1], arms[j, 2])
            size = math.sqrt(p * p + q * q + r * r)
            if size > 1e-9 and _largest(arms, p, q, r) <= 1e-9 * size:
                a, b, c = a + p / size, b + q / size, c + r / size
    size = math.sqrt(a * a + b * b + c * c)
    if size < 1e-9 or a * x + b * y + c * z <= 0.0:
        return 1.0
    return _largest(arms, a, b, c) / size


@compiled
def _largest(arms: Array, x: float, y: float, z: float) -> float:
    """Largest product of (x, y, z) with a row of ``arms``."""
    largest = -math.inf
    for i in range(len(arms)):
        largest = max(largest, x * arms[i, 0] + y * arms[i, 1] + z * arms[i, 2])
    return largest
