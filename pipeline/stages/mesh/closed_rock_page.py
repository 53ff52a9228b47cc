"""The page of a rock alone: what was repaired and closed, and what that may change."""

from __future__ import annotations

import numpy as np

from pipeline.drawing.style import png_uri, svg_uri
from pipeline.stages.mesh import scan_figures
from pipeline.stages.mesh.scan_page import Row, closings, least, spread
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.pages import filled
from vsr_core.scan.refusal import place
from vsr_core.scan.weighing import Measure, Trial
from vsr_core.scan.whole_rock import Unseen, WholeRock

TEMPLATE = "closed_rock.html"

_MOST_HOLES = 12  # that are ringed and listed one by one, the widest first


def page(
    site: str,
    source: Source,
    whole: WholeRock,
    solid: Measure,
    unknown: tuple[Unseen, ...],
    closing: str,
    trials: tuple[Trial, ...],
) -> str:
    """Everything about the closing of a rock in one page that loads nothing.

    Returns
    -------
    str
        HTML that holds all it needs.
    """
    widest = sorted(unknown, key=lambda one: -one.hole.width)
    marks = np.array([one.hole.place for one in widest[:_MOST_HOLES]]).reshape(-1, 3)
    added, rock = whole.added, whole.rock
    vertices, faces = np.array(rock.vertices), np.array(rock.faces)
    pictures = {
        "rock": png_uri(scan_figures.rock_from_sides(vertices, faces, added, marks, source.label))
    }
    if trials:
        pictures["tippings"] = svg_uri(
            scan_figures.tippings(closing, solid.tipping, trials, source.label)
        )
    facts = {
        "site": site,
        "source": source.label,
        "surrogate": source.surrogate,
        "volume": solid.volume,
        "mass": solid.mass,
        "size": np.ptp(vertices, axis=0).tolist(),
        "least": least(solid),
        "added": float(rock.area_faces[added].sum() / rock.area),
        "repaired": whole.repaired,
        "holes": [_hole(one, whole, solid, closing) for one in widest[:_MOST_HOLES]],
        "smaller": len(widest[_MOST_HOLES:]),
        "uncertain": 100.0 * sum(abs(one.volume) for one in unknown) / solid.volume,
        "trials": bool(trials),
        "closings": closings(closing, solid, trials),
        "spread": spread(trials),
        "pictures": pictures,
    }
    return filled(TEMPLATE, facts)


def _hole(one: Unseen, whole: WholeRock, solid: Measure, closing: str) -> Row:
    hole = one.hole
    return {
        "place": place(hole.place + whole.offset),
        "width": hole.width,
        "edges": len(hole.rim),
        "how": f"beneath the rock: {closing}" if hole.beneath else "filled",
        "volume": abs(one.volume),
        "share": 100.0 * abs(one.volume) / solid.volume,
        "tipping": float(np.degrees(one.tipping)),
    }
