"""The stages of a product as a picture: what each needs, and which are to be made."""

from __future__ import annotations

from html import escape
from itertools import pairwise
from math import inf
from operator import itemgetter
from statistics import fmean

import networkx as nx

from pipeline.workflow.registry import needs

WIDE, HIGH, BELOW = 170, 34, 50
"""Sides of a box, and the space between rows [px]."""

BESIDE, LANE = 24, 16
"""Space beside a box, and around a line that passes a row [px]."""

SWEEPS = 30
"""Times that the rows are put in order anew, downwards and upwards in turn."""

COLOURS = {True: "#f6d6ad", False: "#d3e3d3"}
"""Of stages to make, and of those that are up to date."""

Node = tuple[str, int]
"""A stage and a row: its box in its own row, and below that a place for the lines from it."""

ARROWHEAD = (
    '<defs><marker id="head" viewBox="0 0 10 10" refX="10" refY="5" markerWidth="9" '
    'markerHeight="9" orient="auto"><path d="M0,1 L10,5 L0,9 z" fill="#666"/></marker></defs>'
)


def svg(title: str, stages: dict[str, bool]) -> str:
    """A picture in SVG: a row for each depth, data going downwards, each stage near its users.

    A need that another need has itself is left out. Lines pass a row in a place of their own, so
    that none goes behind a box.

    Parameters
    ----------
    stages : dict, whether each is to be made, by its name and after those that it needs
    """
    graph = nx.DiGraph((need, name) for name in stages for need in needs(name) if need in stages)
    graph.add_nodes_from(stages)
    reduced = nx.transitive_reduction(graph)
    height: dict[str, int] = {}
    for name in reversed(stages):
        height[name] = 1 + max((height[user] for user in reduced[name]), default=-1)
    row = {name: max(height.values()) - height[name] for name in stages}
    ways = [
        [*((need, at) for at in range(row[need], row[name])), (name, row[name])]
        for need, name in sorted(reduced.edges)
    ]
    x = _columns({(name, row[name]) for name in stages}, ways)
    y = {at: 40 + at * (HIGH + BELOW) for at in row.values()}
    boxes = [
        f'<rect x="{x[name, at] - WIDE / 2:.0f}" y="{y[at]}" width="{WIDE}" height="{HIGH}" rx="5" '
        f'fill="{COLOURS[stages[name]]}" stroke="#555"/>'
        f'<text x="{x[name, at]:.0f}" y="{y[at] + 22}" text-anchor="middle">{escape(name)}</text>'
        for name, at in row.items()
    ]
    wide = max(480.0, max(x[box] for box in row.items()) + WIDE / 2, *x.values()) + BESIDE
    high = 40 + len(y) * (HIGH + BELOW)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide:.0f}" height="{high}" '
        f'viewBox="0 0 {wide:.0f} {high}" font-family="sans-serif" font-size="14">'
    )
    said = f'<text x="10" y="24">{escape(title)}: orange is to be made, green is up to date</text>'
    paper = '<rect width="100%" height="100%" fill="white"/>'
    lines = [_line([(x[one], y[one[1]]) for one in way]) for way in ways]
    return "\n".join([head, ARROWHEAD, paper, said, *lines, *boxes, "</svg>\n"])


def _line(places: list[tuple[float, int]]) -> str:
    """From below the first place to the top of the last, straight down through those between."""
    (first, top), *_ = places
    parts = [f"M{first:.0f},{top + HIGH}"]
    for (x, y), (to, end) in pairwise(places):
        start, middle = y + HIGH, y + HIGH + BELOW / 2
        parts.append(f"L{x:.0f},{start} C{x:.0f},{middle:.0f} {to:.0f},{middle:.0f} {to:.0f},{end}")
    return f'<path d="{" ".join(parts)}" fill="none" stroke="#666" marker-end="url(#head)"/>'


def _columns(boxes: set[Node], ways: list[list[Node]]) -> dict[Node, float]:
    """Middle of each node [px], near to those of the nodes that it is linked with."""
    links = sorted({link for way in ways for link in pairwise(way)})
    room = dict.fromkeys((one for way in ways for one in way), LANE)
    room |= dict.fromkeys(boxes, WIDE + BESIDE)
    rows: dict[int, dict[Node, float]] = {}
    for one in sorted(room, key=itemgetter(1, 0)):
        rows.setdefault(one[1], {})[one] = 0.0
    x = {one: place for row in rows.values() for one, place in _beside(row, room).items()}
    for sweep in range(SWEEPS):
        upwards = sweep % 2 == 1
        for at in sorted(rows, reverse=upwards):
            for one in rows[at]:
                near = [x[link[upwards]] for link in links if link[not upwards] == one]
                rows[at][one] = fmean(near or [x[one]])
            x |= _beside(rows[at], room)
    left = min(x[one] - room[one] / 2 for one in x) - BESIDE
    return {one: place - left for one, place in x.items()}


def _beside(wanted: dict[Node, float], room: dict[Node, int]) -> dict[Node, float]:
    """Nodes of a row side by side, about the places [px] where each is wanted."""
    places: dict[Node, float] = {}
    end = -inf
    for one in sorted(wanted, key=lambda one: wanted[one]):
        places[one] = max(wanted[one], end + room[one] / 2)
        end = places[one] + room[one] / 2
    aside = fmean(places[one] - wanted[one] for one in wanted)
    return {one: place - aside for one, place in places.items()}
