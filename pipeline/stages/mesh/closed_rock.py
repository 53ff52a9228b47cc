"""Closed rock: what was made of the scan of a rock alone, on a page to look at."""

from __future__ import annotations

from pipeline.config.scene_schema import RockConfig
from pipeline.stages.mesh import scan_page, sources
from pipeline.stages.mesh.products import SCAN_PAGE
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.grammar import counted
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.writers import text
from vsr_core.scan.weighing import measured
from vsr_core.scan.whole_rock import other_closings, unseen


def make(work: Work, rock: RockConfig, source: Source) -> Product:
    """Close the rock, weigh it, and say what the unseen leaves uncertain."""
    density, closing, name = rock.density, rock.closing, work.origin.name
    with Steps(work.stage, work.log) as steps:
        whole = sources.closed(source, closing, work.origin, steps.tell)
        solid = measured(whole.rock, density)
        steps.tell("asking what the holes leave uncertain")
        unknown = tuple(unseen(whole, solid))
        steps.tell("trying other closings")
        trials = other_closings(whole, closing, solid, density)
        steps.tell("drawing the page")
        drawn = whole, solid, unknown, closing, trials
        page = scan_page.closed_rock_page(name, source, *drawn)
    holes = f"{counted(len(whole.holes), 'hole')} closed" if whole.holes else "closed as scanned"
    return Product({SCAN_PAGE: text(page)}, f"rock of {solid.volume:.4g} m3, {holes}")
