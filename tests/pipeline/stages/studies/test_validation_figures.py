"""Figures of the validation: legends and text cover nothing that is drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.config.priors_schema import ShakeTableConfig
from pipeline.stages.studies.validation import recorded_tests
from pipeline.stages.studies.validation import validation_page as figures
from pipeline.stages.studies.validation.predictions import Predictions
from vsr_core.validation.regression import Calibration

COUNT = 60


def scored_tests() -> tuple[recorded_tests.Tests, Predictions]:
    """Two specimens, one with outcomes; probabilities from none to all, and many of each."""
    rng = np.random.default_rng(1)
    pga = rng.uniform(0.1, 1.0, COUNT)
    chance = np.clip(1.3 * pga - 0.2, 0.0, 1.0)
    observed = tuple(map(int, rng.random(COUNT) < chance))
    tests = recorded_tests.Tests(
        number=tuple(range(COUNT)),
        motion=tuple(f"motion {n // 3}" for n in range(COUNT)),
        pga=tuple(pga.tolist()),
        pgv_pga=tuple(rng.uniform(0.05, 0.5, COUNT).tolist()),
        azimuth=(None,) * COUNT,
        series=("",) * COUNT,
        observed={1: observed},
        published={(1, "dem soft"): observed[::-1], (1, "dem hard"): observed},
        specimens=(1, 2),
        config=ShakeTableConfig(),
    )
    toppled = np.tile(np.round(20.0 * chance), (2, 1))
    half = np.arange(COUNT) // 3 % 2 == 0
    shape = (2, COUNT)
    share, members = toppled / 20.0, np.full(shape, 20.0)
    every = (np.arange(20)[:, None] < np.round(20.0 * chance)).astype(np.int64)
    fitted = Calibration(0.0, 1.0, COUNT)
    parts = share, share, members, fitted, half, np.stack([every, every])
    return tests, Predictions(toppled, members, 0, toppled > 10, *parts)


@pytest.mark.parametrize(
    "draw", [figures.reliability, figures.roc, figures.fragility, figures.map_of_tests]
)
def test_legends_and_labels_cover_no_data(
    draw: Callable[[recorded_tests.Tests, Predictions], Figure],
) -> None:
    figure = draw(*scored_tests())
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    legends = [axes.get_legend() for axes in figure.axes if axes.get_legend()] + figure.legends
    assert legends
    for legend in legends:
        box = legend.get_window_extent(canvas.get_renderer())
        assert not [axes for axes in figure.axes if box.overlaps(axes.bbox)]
        assert figure.bbox.containsx(box.x0)
        assert figure.bbox.containsx(box.x1)
        assert figure.bbox.containsy(box.y0)
    assert not [text for axes in figure.axes for text in axes.texts]  # none that could collide


def test_the_sizes_of_all_classes_are_drawn() -> None:
    tests, made = scored_tests()
    below = figures.reliability(tests, made).axes[1]
    known = [sum(bar.get_height() for bar in bars) for bars in below.containers]
    assert known == [COUNT, int((~made.half).sum())]
