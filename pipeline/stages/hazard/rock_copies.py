"""Whether rocks that a hazard counts are one and the same."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import TYPE_CHECKING

from pipeline.config.layers import Origin
from pipeline.config.outside import text
from pipeline.config.problems import InputError, Problem
from pipeline.config.yaml_text import parse

if TYPE_CHECKING:
    from pipeline.stages.hazard.other_rocks import Archived, Other


def of_sites(origin: Origin, *rocks: Other) -> Iterator[str]:
    """Rocks that are alike in all that their fragilities are made of, or in shape, in words.

    Refuses one whose file states what another one's does, and names the same files.
    """
    for other, one in combinations(rocks, 2):
        alike, sites = one.key == other.key, (one.site, other.site)
        stated, stated_by_other = (parse(text(site.path)) for site in sites)
        if stated == stated_by_other and (alike or one.site.folder == other.site.folder):
            file, given = origin.file_of("hazard.rocks"), f"{one.name}, a copy of {other.name}"
            rule, remedy = "each rock is counted once", "leave it out"
            raise InputError(Problem(file, "hazard.rocks", given, rule, remedy))
        if alike:
            yield f"hazard.rocks: {one.name} is as {other.name} in shape, settings and runs"
        elif one.shape == other.shape:
            said = f"{one.name} is the rock of {other.name} with other settings"
            yield f"hazard.rocks: {said}, by its shape: each rock is counted once"


def of_archive(rocks: Sequence[Archived]) -> Iterator[str]:
    """Rocks of an archive that topple as another one does, from side to side, in words."""
    for other, one in combinations(rocks, 2):
        if one.medians == other.medians:
            yield f"hazard.rocks: {one.name} topples as {other.name} does, in either direction"
