"""Fig. 17: means of ensembles of trajectories against PGA and PGV/PGA."""

from __future__ import annotations

from matplotlib.figure import Figure

from pipeline.stages.displacement import correlation_figures
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.fig_15 import SOURCES as SOURCES
from pipeline.stages.figures.paper import Data, Finding

TITLE = "Means of ensembles against PGA and PGV/PGA"


def draw(data: Data) -> Figure:
    """Draw the means with the line through them."""
    return correlation_figures.ensemble_means(
        data["displacement"], diagrams.terrain_source(data["rock"])
    )


def findings(data: Data) -> list[Finding]:
    """The paper's claims on these means are in its Table 1."""
    return []
