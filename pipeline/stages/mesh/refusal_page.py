"""The page of a scan that was refused: what was taken for what, where it fails, what to set."""

from __future__ import annotations

from pipeline.config.layers import Site
from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import png_uri
from pipeline.stages.mesh import scan_figures
from pipeline.stages.mesh.products import SCAN_PAGE
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.pages import filled
from pipeline.workflow.stage import Refusal
from pipeline.workflow.writers import text
from vsr_core.scan.refusal import Refused, place

TEMPLATE = "refused.html"

_MOST_PLACES = 12  # that are ringed and listed


def shown(site: Site, source: Source, key: str, error: Refused) -> InputError:
    """A refusal with its page, where there is anything to see.

    Parameters
    ----------
    key : str, of the configuration, that is named: ``pedestal.cut`` or ``rock.mesh``

    Returns
    -------
    InputError, a Refusal where there are faces to show
    """
    file = site.file_of(key)
    if key == "rock.mesh":
        file, key = f"{file}: {key}", source.name
    problem = Problem(file, key, error.given, error.rule, error.remedy)
    if not len(error.seen.faces):
        return InputError(problem)
    return Refusal(problem, {SCAN_PAGE: text(_page(site.name, source, error))})


def _page(site: str, source: Source, error: Refused) -> str:
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
    return filled(TEMPLATE, facts)
