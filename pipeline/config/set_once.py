"""Settings of one command, of which none may replace another: it would be dropped unseen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import product
from typing import Any

from pipeline.config.layers import layers_of
from pipeline.config.motion_schema import PULSES
from pipeline.config.problems import InputError, Problem

Parts = tuple[str, ...]
"""Of a dotted key."""


def check_set_once(settings: Iterable[str]) -> None:
    """Refuse a setting that a later one replaces.

    Raises
    ------
    InputError
        For two of the same key, a part of one that is set as a whole later, and a section of which
        another kind is set later.
    """
    known: list[Parts] = []
    for layer in layers_of(settings):
        values = [key for key, _ in values_of(layer)]
        for key, before in product([*values, *_of_another_kind(layer)], known):
            if all(one == other for one, other in zip(key, before, strict=False)):
                given, rule = f"{'.'.join(before)} before it", "no setting replaces another"
                remedy = "leave one out, or set the whole before its parts"
                raise InputError(Problem("--set", ".".join(key), given, rule, remedy))
        known += values


def values_of(layer: dict[str, Any], above: Parts = ()) -> Iterator[tuple[Parts, Any]]:
    """What a layer sets, sections by their keys."""
    for name, value in layer.items():
        key = (*above, str(name))
        yield from values_of(value, key) if isinstance(value, dict) else [(key, value)]


def _of_another_kind(layer: dict[str, Any], above: Parts = ()) -> Iterator[Parts]:
    """Sections of which nothing stays that was said of another kind."""
    for name, value in layer.items():
        if isinstance(value, dict):
            if value.get("kind", PULSES[0]) not in PULSES:
                yield (*above, str(name))
            yield from _of_another_kind(value, (*above, str(name)))
