"""What is to be told of records that are taken as they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from vsr_core.motions import order
from vsr_core.motions.records import directions
from vsr_core.motions.records.record import Record, factor, is_acceleration


def doubts(components: Mapping[str, Record]) -> Iterator[str]:
    """Where channels may point otherwise, or samples have lost their order, signs or exponents."""
    yield from directions.doubts(components)
    for one in components.values():
        unit = factor(one.unit) if is_acceleration(one.unit) else 1.0
        yield from order.doubts(one.acceleration / unit, one.channels[0])
