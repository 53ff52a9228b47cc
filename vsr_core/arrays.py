"""Types of the arrays that both packages hand on."""

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
