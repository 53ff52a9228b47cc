"""Survival against age and earthquakes by magnitude, as pages show them."""

from __future__ import annotations

import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pipeline.stages.hazard.exclusion_figures import exclusion
from pipeline.stages.hazard.hazard_figures import curves, survival, untried
from pipeline.workflow import pages

AGE = np.linspace(0.0, 6700.0, 202)


@pytest.mark.parametrize(
    "rates",
    [
        pytest.param([2e-5, 2.1e-5, 4e-6, 5e-6], id="all survive"),
        pytest.param([1e-4, 1e-3], id="half survive"),
        pytest.param([0.9, 1.0], id="none survives"),
    ],
)
def test_names_and_legend_of_survival_have_their_own_places(rates: list[float]) -> None:
    hazard = xr.Dataset(
        {
            "survival_at_age": (("branch", "age"), np.exp(-np.outer(rates, AGE))),
            "rejected": ("branch", np.zeros(len(rates), dtype=np.int8)),
            "age_density": ("age", np.exp(-(((AGE - 5000.0) / 500.0) ** 2))),
        },
        {"branch": [str(number) for number in range(len(rates))], "age": AGE},
    )
    figure = survival(hazard, 0.05)
    FigureCanvasAgg(figure).draw()
    above = figure.axes[0]
    frame = above.get_window_extent()
    assert above.texts
    for name in above.texts:
        box = name.get_window_extent()
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert frame.y0 < box.y0 < box.y1 < frame.y1
    (legend,) = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]
    assert not legend.get_window_extent().overlaps(frame)


def test_lines_of_the_map_of_earthquakes_are_named_beside_it() -> None:
    """Not across a fault that lies on one of them, and only those that are in the map."""
    magnitude, distance = np.linspace(5.0, 7.6, 27), np.geomspace(1.0, 100.0, 41)
    chance = 0.6 * np.clip((magnitude[:, None] - 5.0) / 2.6 - np.log10(distance) / 2.0, 0.0, 1.0)
    found = xr.Dataset(
        {
            "scenario_toppling_probability": (("magnitude", "distance"), chance),
            "fault_distance": ("fault", [6.0]),
            "fault_magnitude": ("fault", [6.4]),
            "fault_rejected": ("fault", np.zeros(1, dtype=np.int8)),
        },
        {
            "magnitude": magnitude,
            "distance": distance,
            "standing_probability": [0.05, 0.5, 0.95],
            "fault": ["Near fault"],
        },
    )
    figure = exclusion(found)
    FigureCanvasAgg(figure).draw()
    axes, (legend,) = figure.axes[0], figure.legends
    assert [text.get_text() for text in axes.texts] == ["Near fault"]
    words = [text.get_text() for text in legend.get_texts()]
    assert words == ["stands with 50 %", "stands with 95 %"]
    assert not legend.get_window_extent().overlaps(axes.get_tightbbox())


def test_magnitudes_near_each_other_are_told_apart() -> None:
    """Those of a table of ground motion, which may have two decimals."""
    rows = [{"magnitude": one, "distances": [10.0]} for one in (5.45, 5.5, 7.0)]
    exclusion = {
        "pictures": {"exclusion": ""}, "magnitudes": rows, "standing": [0.5], "faults": [],
        "span": (1.0, 100.0), "table": True, "drawn": False, "least": 0.05,
    }  # fmt: skip
    page = pages.filled("earthquakes.html", {"exclusion": exclusion})
    assert re.findall(r'<tr><td class="n">([^<]*)</td>', page) == ["5.45", "5.5", "7"]


@pytest.mark.parametrize(
    ("tested", "words"),
    [((0.05, 4.0), []), ((0.2, 4.0), ["below 0.2"]), ((0.2, 0.8), ["below 0.2", "above 0.8"])],
)
def test_a_caption_names_what_is_hatched(tested: tuple[float, float], words: list[str]) -> None:
    pga = np.geomspace(0.1, 2.0, 5)
    rates = dict.fromkeys(("mean_rate_before", "mean_rate_after"), ("pga", 0.001 / pga))
    ends = ("", "_low", "_high")
    hazard = xr.Dataset(
        {
            "branch_rate": (("branch", "pga"), [1e-3 / pga]),
            "rejected": ("branch", np.zeros(1, dtype=np.int8)),
            **rates,
            **{f"toppling_probability{end}": ("pga", pga / 2.0) for end in ends},
        },
        {"pga": pga, "return_period": [475.0]},
    )
    assert [*untried(hazard, tested)] == words
    below = curves(hazard, tested).axes[1]
    assert sum(bool(one.get_hatch()) for one in below.patches) == len(words)
