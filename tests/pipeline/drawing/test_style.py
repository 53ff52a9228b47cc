"""The style of all figures is ours, whatever a user's matplotlib is set to."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from pipeline.drawing import style

SETTINGS = {
    "text.usetex": True,
    "axes.grid": True,
    "lines.linewidth": 9.0,
    "axes.facecolor": "red",
    "axes.xmargin": 0.4,
    "image.cmap": "gray",
    "savefig.bbox": "tight",
}


@style.styled
def drawn() -> Figure:
    figure = Figure(figsize=(2, 2))
    line, image = figure.subplots(1, 2)
    line.plot([1, 2, 1])
    line.set_title("how strong")
    image.imshow([[1, 2], [3, 4]])
    return figure


@pytest.mark.parametrize("key", SETTINGS)
def test_settings_of_a_user_change_no_byte(key: str) -> None:
    plain = style.png(drawn())
    with mpl.rc_context({key: SETTINGS[key]}):
        assert style.png(drawn()) == plain
        assert mpl.rcParams[key] == SETTINGS[key]


def test_the_only_row_has_a_cell_of_some_height() -> None:
    """Records are numbered from 0; half-way to a next one, as between two."""
    assert style.cell_edges(np.array([0.0])).tolist() == [-0.5, 0.5]
    assert style.cell_edges(np.array([0.0, 1.0])).tolist() == [-0.5, 0.5, 1.5]
    assert style.cell_edges(np.array([0.25, 1.5])).tolist() == [0.0, 0.875, 2.125]
    assert style.cell_edges(np.array([0.3])).tolist() == pytest.approx([0.15, 0.45])
