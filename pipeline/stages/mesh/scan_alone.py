"""The rock of a scan of it alone."""

from __future__ import annotations

from functools import partial

from pipeline.config.layers import Origin
from pipeline.stages.mesh import sources
from pipeline.stages.mesh.sources import Source
from pipeline.workflow.stage import named
from vsr_core.scan.closing import Closing
from vsr_core.scan.weighing import Refused, Tell
from vsr_core.scan.whole_rock import WholeRock, whole_rock


def closed(source: Source, closing: Closing, origin: Origin, tell: Tell) -> WholeRock:
    """The rock as a closed solid."""
    try:
        return whole_rock(partial(sources.load, source, origin), closing, tell)
    except Refused as error:
        refusal = named("pipeline.stages.mesh.scan_page:refusal")  # with figures, if need be
        raise refusal(origin, source, "rock.mesh", error) from None
