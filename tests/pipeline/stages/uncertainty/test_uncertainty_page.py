"""The page of an uncertainty analysis, of numbers that are given."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pipeline.stages.uncertainty.uncertainty_page import bands

PGA = [0.2, 0.4, 0.6, 0.8]
RATIO = [0.1, 0.2, 0.3, 0.4]


def test_a_median_beyond_all_that_was_run_is_no_value_of_the_line() -> None:
    """Nor does a band with an open end lean over the levels beside it."""
    dims = ("yaw", "pgv_pga")
    ends = {"low": [0.7, 0.5, 0.0, 0.0], "median": [np.inf, 0.6, 0.3, 0.0]}
    ends["high"] = [np.inf, 0.7, 0.5, 0.0]
    found = xr.Dataset(
        {f"boundary_{name}": (dims, [values]) for name, values in ends.items()},
        {"yaw": [90.0], "pgv_pga": RATIO, "pga": PGA},
    )
    outcomes = xr.Dataset({"overturned": ((*dims, "pga"), np.ones((1, 4, 4)))})
    axes = bands(found, outcomes).axes[0]
    (line,) = (one for one in axes.lines if one.get_label() == "median of the draws")
    np.testing.assert_array_equal(line.get_xdata(), [np.nan, 0.6, 0.3, np.nan])
    (band,) = (one for one in axes.collections if one.get_label() == "5 to 95 % of the draws")
    edges = np.diff(band.get_paths()[0].vertices, axis=0)
    assert (edges == 0.0).any(axis=1).all()  # along one of the axes
