"""The stages of a product as a picture: what each needs, and which are to be made."""

from __future__ import annotations

from html import escape

from pipeline.workflow.registry import needs

WIDE, HIGH, GAP = 190, 34, 44
"""Sides of a box, and the space between rows [px]."""

COLOURS = {True: "#f6d6ad", False: "#d3e3d3"}
"""Of stages to make, and of those that are up to date."""


def svg(title: str, stages: dict[str, bool]) -> str:
    """A picture in SVG: a row for each depth, data going downwards.

    Parameters
    ----------
    stages : dict, whether each is to be made, by its name and after those that it needs
    """
    above = {name: [need for need in needs(name) if need in stages] for name in stages}
    depth: dict[str, int] = {}
    for name in stages:
        depth[name] = 1 + max((depth[need] for need in above[name]), default=-1)
    rows = [
        [name for name in stages if depth[name] == row] for row in range(len(set(depth.values())))
    ]
    wide = (WIDE + 20) * max(map(len, rows))
    place = {
        name: (wide * (2 * column + 1) / (2 * len(row)), 40.0 + number * (HIGH + GAP))
        for number, row in enumerate(rows)
        for column, name in enumerate(row)
    }
    lines = [
        f'<line x1="{place[need][0]:.0f}" y1="{place[need][1] + HIGH:.0f}" '
        f'x2="{place[name][0]:.0f}" y2="{place[name][1]:.0f}" stroke="#888"/>'
        for name in stages
        for need in above[name]
    ]
    boxes = [
        f'<rect x="{x - WIDE / 2:.0f}" y="{y:.0f}" width="{WIDE}" height="{HIGH}" rx="5" '
        f'fill="{COLOURS[stages[name]]}" stroke="#555"/>'
        f'<text x="{x:.0f}" y="{y + 22:.0f}" text-anchor="middle">{escape(name)}</text>'
        for name, (x, y) in place.items()
    ]
    high = 40 + len(rows) * (HIGH + GAP)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide}" height="{high}" '
        f'viewBox="0 0 {wide} {high}" font-family="sans-serif" font-size="14">'
    )
    said = f'<text x="10" y="24">{escape(title)}: orange is to be made, green is up to date</text>'
    paper = '<rect width="100%" height="100%" fill="white"/>'
    return "\n".join([head, paper, said, *lines, *boxes, "</svg>\n"])
