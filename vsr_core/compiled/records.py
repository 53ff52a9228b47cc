"""Records of compiled code: fields of fixed size in one piece of memory, as their class tells."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, Protocol, TypeAlias, TypeVar, cast, get_type_hints

import numpy as np
from numpy.typing import NDArray

from vsr_core.arrays import Array, Indices

Vector: TypeAlias = Annotated[Array, (3,)]
Twist: TypeAlias = Annotated[Array, (6,)]
"""Velocity of the centre of mass, then angular velocity."""

Matrix: TypeAlias = Annotated[Array, (3, 3)]

Record = TypeVar("Record")


class Records(Protocol[Record]):
    """An array of records."""

    def __getitem__(self, at: int, /) -> Record:
        """One of them, not a copy."""

    def __setitem__(self, at: int, record: Record, /) -> None:
        """Copy into one of them."""

    def __len__(self) -> int:
        """How many."""


def _layout(kind: type) -> np.dtype[np.void]:
    """Fields of a class of records, by its annotations: numbers, and arrays of a stated shape."""
    fields: list[Any] = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if isinstance(hint, type):
            fields.append((name, hint))
        else:
            of_whole = hint.__origin__ == Indices
            fields.append((name, int if of_whole else float, hint.__metadata__[0]))
    return np.dtype(fields)


layout: Callable[[type], np.dtype[np.void]] = cache(_layout)


def of(kind: type[Record], array: NDArray[np.void]) -> Records[Record]:
    """A structured array as records."""
    assert array.dtype == layout(kind)
    return cast("Records[Record]", array.view(np.recarray))


def rows(kind: type[Record], number: int) -> Records[Record]:
    """Room for so many records, all zeros."""
    return of(kind, np.zeros(number, layout(kind)))


def room(kind: type[Record]) -> Record:
    """Room for one record, all zeros."""
    return rows(kind, 1)[0]


def columns(records: Records[Any]) -> NDArray[np.void]:
    """Records as a structured array, for NumPy."""
    return np.asarray(records)
