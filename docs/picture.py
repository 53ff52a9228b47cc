"""The picture of the README, from the products of a site.

python docs/picture.py data/derived/double_rock docs/double_rock.png
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import matplotlib.image as image
from matplotlib.figure import Figure

from pipeline.drawing.style import png
from pipeline.stages.fragility.fragility_figures import overturning_diagram
from pipeline.stages.fragility.rock_views import rock_views
from pipeline.workflow.datasets import read


def picture(folder: Path) -> Figure:
    """The rock from three sides over the diagrams of its weakest and its strongest yaw."""
    fragility, responses = read(folder / "fragility.nc"), read(folder / "responses.nc")
    share = fragility["toppled_share"].isel(friction=0)
    chosen = [int(share.values.argmax()), int(share.values.argmin())]
    drawn = [png(rock_views(read(folder / "rock.nc")))]
    for number in chosen:
        name = f"shaken at yaw {float(share['yaw'][number]):.0f} deg"
        drawn.append(png(overturning_diagram(responses, fragility, (number, 0), name)))
    pixels = [image.imread(io.BytesIO(data)) for data in drawn]
    figure = Figure(figsize=(9.0, 7.6))
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 1.25), hspace=0.02, wspace=0.02)
    for place, data in zip((grid[0, :], grid[1, 0], grid[1, 1]), pixels, strict=True):
        axes = figure.add_subplot(place)
        axes.imshow(data, interpolation="lanczos")
        axes.set_axis_off()
    figure.subplots_adjust(0.0, 0.0, 1.0, 1.0)
    return figure


if __name__ == "__main__":
    picture(Path(sys.argv[1])).savefig(sys.argv[2], dpi=110)
