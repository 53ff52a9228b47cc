"""Work in batches: what is handed to a worker at once, and what comes back."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

BATCHES_IN_FLIGHT = 4
"""Batches handed out per worker: enough to keep it busy, few enough to lose."""

Work = Callable[[Any, tuple[Any, ...]], Any]
"""From what the items of a batch share, and the items, to their results."""


class Batch(NamedTuple):
    """Items that share one object, done together by one worker."""

    shared: Hashable
    items: tuple[Any, ...]


class Done(NamedTuple):
    """Results of a batch; None if its only item killed its process."""

    batch: Batch
    results: Any
