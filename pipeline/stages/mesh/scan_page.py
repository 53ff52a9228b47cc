"""Pages of a scan: of its preparation, of its refusal, and of a rock scanned alone."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import png_uri, svg_uri
from pipeline.stages.mesh import scan_figures
from pipeline.stages.mesh.gap_map import gap_map, gaps
from pipeline.stages.mesh.products import SCAN_PAGE
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.pages import filled
from pipeline.workflow.stage import Refusal
from pipeline.workflow.writers import text
from vsr_core.arrays import Array
from vsr_core.scan.cuts import Cut
from vsr_core.scan.preparation import Prepared
from vsr_core.scan.proposal import Alternative
from vsr_core.scan.weighing import DIRECTIONS, Measure, Refused, Step, Trial, place
from vsr_core.scan.whole_rock import Unseen, WholeRock

Row = dict[str, Any]

SURE, DOUBTFUL = 0.8, 0.5
"""Confidence from which a proposal is called clear, and below which it is called doubtful."""

SAME_AREA, SAME_SEAM = 0.05, 0.1
"""A cut gives about the same rock if its surface differs by at most this share, and its seam lies
within this share of the rock's size."""


def page(site: str, source: str, prepared: Prepared, *, accepted: bool, surrogate: bool) -> str:
    """Everything about a separation and a closing in one page that loads nothing.

    Parameters
    ----------
    accepted : bool
        Whether the site's configuration accepts the cut.
    surrogate : bool
        Whether the scan is none, but made from published figures.

    Returns
    -------
    str
        HTML that holds all it needs.
    """
    solid, found = prepared.steps[-1].after, prepared.separation
    rock = prepared.rock
    apart = gaps(np.array(rock.vertices), np.array(rock.faces), prepared.terrain)
    loops = [seam.points + prepared.shift for seam in found.seams]
    size = np.ptp(prepared.rock.vertices, axis=0)
    facts = {
        "site": site,
        "source": source,
        "surrogate": surrogate,
        "accepted": accepted,
        "proposed": prepared.proposed,
        "confidence": found.confidence,
        "sure": _sure(found.confidence),
        "seams": [{"length": s.length, "edges": len(s.loop), "concave": s.concave}
                  for s in found.seams],
        "size": size.tolist(),
        "volume": solid.volume,
        "mass": solid.mass,
        "least": least(solid),
        "added": float(prepared.rock.area_faces[prepared.added].sum() / prepared.rock.area),
        "top": _place(_top(prepared)),
        "others": [_alternative(other, float(size.max())) for other in prepared.alternatives],
        "steps": [_step(step, prepared) for step in prepared.steps],
        "closings": closings(prepared.closing, solid, prepared.trials),
        "spread": spread(prepared.trials),
        "notes": _notes(prepared),
        "gaps": apart,
        "contact": prepared.contact.told,
        "pictures": {
            "gaps": png_uri(gap_map(apart, loops, source)),
            "separation": png_uri(scan_figures.separation(prepared, source)),
            "closed": png_uri(scan_figures.closed_rock(prepared, source)),
            "seat": png_uri(scan_figures.seat(prepared, source)),
            "tippings": svg_uri(
                scan_figures.tippings(prepared.closing, solid.tipping, prepared.trials, source)
            ),
        },
    }  # fmt: skip
    return filled("prep.html", facts)


def _sure(confidence: float) -> str:
    if confidence >= SURE:
        return "clear"
    return "to be checked closely" if confidence >= DOUBTFUL else "doubtful"


def least(solid: Measure) -> Row | None:
    """Least static tipping angle and its direction [degree]; None for a rock that falls over."""
    if np.isnan(solid.tipping).any():
        return None
    weakest = int(np.argmin(solid.tipping))
    return {
        "angle": float(np.degrees(solid.tipping[weakest])),
        "direction": float(np.degrees(DIRECTIONS[weakest])),
    }


def _top(prepared: Prepared) -> Array:
    """Highest point of the rock, in the coordinates of the scan."""
    points = np.array(prepared.rock.vertices)
    return points[np.argmax(points[:, 2])] + prepared.origin


def _place(point: Any, digits: int = 3) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in point)


def _alternative(other: Alternative, size: float) -> Row:
    same = abs(other.area - 1.0) <= SAME_AREA and other.away <= SAME_SEAM * size
    return {
        "kind": type(other.cut).__name__.lower(),
        "yaml": _yaml(other.cut),
        "away": other.away,
        "area": other.area,
        "same": same,
        "reason": other.reason,
    }


_EXACT = 6
"""Decimals of a cut, which is to be the one tried: of a print of a few centimetres, too."""


def _yaml(cut: Cut) -> str:
    """Lines that give a cut in a site's configuration."""
    lines = ["pedestal:", "  shape: mesh", "  cut:", f"    kind: {type(cut).__name__.lower()}"]
    for key, value in asdict(cut).items():
        if key == "corners":
            lines += ["    corners:", *(f"      - [{_place(corner, _EXACT)}]" for corner in value)]
        elif key in ("rgb", "tolerance"):
            lines.append(f"    {key}: {list(value) if key == 'rgb' else format(value, 'g')}")
        else:
            lines.append(f"    {key}: [{_place(value, _EXACT)}]")
    return "\n".join(lines)


def _step(step: Step, prepared: Prepared) -> Row:
    one, two = step.before, step.after
    offset = prepared.origin + prepared.shift
    moments = [np.linalg.eigvalsh(m.inertia) if m.watertight else np.full(3, np.nan)
               for m in (one, two)]  # fmt: skip
    return {
        "name": step.name,
        "faces": [one.faces, two.faces],
        "watertight": [one.watertight, two.watertight],
        "volume": [one.volume, two.volume],
        "mass": [one.mass, two.mass],
        "centre": [_place(m.centre_of_mass + offset) if m.watertight else "" for m in (one, two)],
        "moments": [values.tolist() for values in moments],
        "hausdorff": 1e3 * step.hausdorff,
        "tipping": float(np.degrees(step.tipping_change)),
    }


def closings(chosen: str, solid: Measure, trials: tuple[Trial, ...]) -> list[Row]:
    """Rows of the closing chosen and of the others."""
    others = [_closing(t.closing, t.measure, t.moved, t.tipping_change, t.reason) for t in trials]
    return [_closing(chosen, solid, 0.0, 0.0) | {"chosen": True}, *others]


def _closing(
    name: str, solid: Measure | None, moved: float, tipping: float, reason: str = ""
) -> Row:
    return {
        "name": name,
        "chosen": False,
        "volume": solid.volume if solid else np.nan,
        "moved": 1e3 * moved,
        "tipping": float(np.degrees(tipping)),
        "least": least(solid) if solid else None,
        "reason": reason,
    }


def spread(trials: tuple[Trial, ...]) -> float:
    """Largest change of a static tipping angle among the closings that stand.

    Returns
    -------
    float [degree], nan where no other closing stands
    """
    changes = [trial.tipping_change for trial in trials]
    known = [change for change in changes if np.isfinite(change)]
    return float(np.degrees(max(known))) if known else np.nan


def _notes(prepared: Prepared) -> list[Row]:
    """Notes of each step; those of none of them are about the ground."""
    rows = [{"step": step.name, "notes": list(step.notes)} for step in prepared.steps]
    known = {note for row in rows for note in row["notes"]}
    rows.append({"step": "ground", "notes": [n for n in prepared.notes if n not in known]})
    return [row for row in rows if row["notes"]]


_MOST_PLACES = 12  # that are ringed and listed


def refusal(origin: Origin, source: Source, key: str, error: Refused) -> InputError:
    """A refusal with its page, where there is anything to see.

    Parameters
    ----------
    key : str, of the configuration, that is named: ``pedestal.cut`` or ``rock.mesh``

    Returns
    -------
    InputError, a Refusal where there are faces to show
    """
    file = origin.file_of(key)
    if key == "rock.mesh":
        file, key = f"{file}: {key}", source.name
    problem = Problem(file, key, error.given, error.rule, error.remedy)
    if not len(error.seen.faces) or not np.ptp(error.seen.vertices, axis=0).any():
        return InputError(problem)
    return Refusal(problem, {SCAN_PAGE: text(_refused_page(origin.name, source, error))})


def _refused_page(site: str, source: Source, error: Refused) -> str:
    seen, places = error.seen, error.places[:_MOST_PLACES]
    facts = {
        "site": site,
        "source": source.label,
        "surrogate": source.surrogate,
        "given": error.given,
        "rule": error.rule,
        "remedy": error.remedy,
        "parts": [{"name": name, "share": float(mask.mean())} for name, mask in seen.parts.items()],
        "candidates": [name for name in seen.parts if name.startswith("(")],
        "places": [place(point) for point in places],
        "more": len(error.places) - len(places),
        "picture": png_uri(scan_figures.scan_from_sides(seen, places - seen.offset, source.label)),
    }
    return filled("refused.html", facts)


_MOST_HOLES = 12  # that are ringed and listed one by one, the widest first


def closed_rock_page(
    site: str,
    source: Source,
    whole: WholeRock,
    solid: Measure,
    unknown: tuple[Unseen, ...],
    closing: str,
    trials: tuple[Trial, ...],
    ground: Row | None = None,
) -> str:
    """Everything about the closing of a rock in one page that loads nothing.

    Parameters
    ----------
    ground : dict, of the terrain that it stands on: ``lies``, how; ``source``; ``notes``; and a
        ``picture``

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
        "ground": ground,
    }
    return filled("closed_rock.html", facts)


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
