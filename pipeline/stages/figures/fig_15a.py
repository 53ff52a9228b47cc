"""Fig. 15a: one toppled run as poses of the rock along its trajectory."""

from __future__ import annotations

from matplotlib.figure import Figure

from pipeline.drawing import style
from pipeline.stages.datasets.displaced_runs import typical
from pipeline.stages.displacement import timelapse
from pipeline.stages.figures import diagrams
from pipeline.stages.figures.fig_15 import SOURCES as SOURCES
from pipeline.stages.figures.paper import Data, Finding

TITLE = "One run, pose by pose"


@style.styled
def draw(data: Data) -> Figure:
    """Draw the run of median length among those that come to rest."""
    source, run = diagrams.terrain_source(data["rock"]), typical(data["displacement"])
    if run is None:
        figure = Figure(figsize=(6.4, 2.0))
        figure.text(0.5, 0.5, "no run toppled and came to rest", ha="center")
        return figure
    return timelapse.timelapse(data["displacement"], data["terrain"], data["rock"], run, source)


def findings(data: Data) -> list[Finding]:
    """The paper claims nothing of this picture."""
    return []
