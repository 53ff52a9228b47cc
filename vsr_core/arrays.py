"""Types of the arrays that both packages hand on, and a product of the same bits everywhere."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Measured or computed numbers; shape and unit stand where one is used."""

Indices: TypeAlias = NDArray[np.int64]
"""Whole numbers: places in another array, such as the corners of faces."""

Mask: TypeAlias = NDArray[np.bool_]
"""True for the elements of another array that are meant."""


def matrix_product(one: Array, other: Array) -> Array:
    """Product of matrices, of the same bits on every processor of a family.

    Libraries for linear algebra choose the order of their sums by the processor. Where two
    machines share the runs of a study, what decides a run must not depend on that.

    Parameters
    ----------
    one : ndarray, shape (n, m)
    other : ndarray, shape (m, k)

    Returns
    -------
    ndarray, shape (n, k)

    Examples
    --------
    >>> matrix_product(np.array([[1.0, 2.0]]), np.array([[3.0], [4.0]])).tolist()
    [[11.0]]
    """
    return np.einsum("ij,jk->ik", one, other)
