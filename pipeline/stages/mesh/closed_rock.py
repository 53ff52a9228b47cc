"""Closed rock: what was made of the scan of a rock alone, on a page to look at."""

from __future__ import annotations

from pipeline.config.scene_schema import RockConfig
from pipeline.stages.mesh import scan_alone, scan_page
from pipeline.stages.mesh.products import SCAN_PAGE
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.grammar import counted
from pipeline.workflow.progress import Steps
from pipeline.workflow.stage import Product, Work
from pipeline.workflow.writers import Writer, text
from vsr_core.scan.closing import Closing
from vsr_core.scan.weighing import Measure, Tell, measured
from vsr_core.scan.whole_rock import WholeRock, other_closings, unseen


def make(work: Work, rock: RockConfig, source: Source) -> Product:
    """Close the rock, weigh it, and say what the unseen leaves uncertain."""
    with Steps(work.stage, work.log) as steps:
        whole = scan_alone.closed(source, rock.closing, work.origin, steps.tell)
        solid = measured(whole.rock, rock.density)
        page = drawn(work.origin.name, source, rock.closing, whole, solid, steps.tell)
    holes = f"{counted(len(whole.holes), 'hole')} closed" if whole.holes else "closed as scanned"
    return Product({SCAN_PAGE: page}, f"rock of {solid.volume:.4g} m3, {holes}")


def drawn(
    site: str,
    source: Source,
    closing: Closing,
    whole: WholeRock,
    solid: Measure,
    tell: Tell,
    ground: scan_page.Row | None = None,
) -> Writer:
    """The page of a closed rock.

    Parameters
    ----------
    ground : dict, what the page says of a terrain that it stands on
    """
    tell("asking what the holes leave uncertain")
    unknown = tuple(unseen(whole, solid))
    tell("trying other closings")
    trials = other_closings(whole, closing, solid, solid.mass / solid.volume)
    tell("drawing the page")
    of_rock = whole, solid, unknown, closing, trials
    return text(scan_page.closed_rock_page(site, source, *of_rock, ground))
