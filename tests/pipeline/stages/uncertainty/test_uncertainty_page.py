"""The page of an uncertainty analysis, of numbers that are given."""

from __future__ import annotations

import numpy as np
import xarray as xr

from pipeline.stages.uncertainty.uncertainty_page import bands, surface

PGA = [0.2, 0.4, 0.6, 0.8]
NAMES = ("low", "median", "high")
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
    drawn = {one.get_label(): one.get_paths() for one in axes.collections}
    at = [path.vertices[:, 0].max() for path in drawn["median of the draws"] if len(path.vertices)]
    np.testing.assert_array_equal([pga for pga in at if np.isfinite(pga)], [0.6, 0.3])
    vertices = drawn["5 to 95 % of the draws"][0].vertices
    assert (np.diff(vertices, axis=0) == 0.0).any(axis=1).all()  # along one of the axes
    np.testing.assert_allclose([vertices[:, 1].min(), vertices[:, 1].max()], axes.get_ylim())


def test_one_level_has_its_band_and_its_median() -> None:
    dims = ("yaw", "pgv_pga")
    ends = {
        f"boundary_{name}": (dims, [[at]]) for name, at in zip(NAMES, (0.3, 0.4, 0.5), strict=True)
    }
    found = xr.Dataset(ends, {"yaw": [90.0], "pgv_pga": [0.2], "pga": PGA})
    outcomes = xr.Dataset({"overturned": ((*dims, "pga"), np.ones((1, 1, 4)))})
    axes = bands(found, outcomes).axes[0]
    for one in axes.collections[1:]:
        (path,) = one.get_paths()
        np.testing.assert_allclose(np.ptp(path.vertices[:, 1]), np.ptp(axes.get_ylim()))


def test_records_are_named_and_nothing_is_drawn_between_them() -> None:
    found = xr.Dataset(
        {"surface": (("record", "pga"), np.linspace(0.0, 1.0, 12).reshape(3, 4))},
        {"record": ["a", "b", "c"], "record_pgv_pga": ("record", RATIO[:3]), "pga": PGA},
    )
    axes = surface(found).axes[0]
    named = [tick.get_text() for tick in axes.get_yticklabels()]
    assert named == ["a\n0.1 s", "b\n0.2 s", "c\n0.3 s"]
    assert len(axes.collections) == 1  # the cells
    pulses = found.rename(record="pgv_pga").assign_coords(pgv_pga=RATIO[:3])
    assert len(surface(pulses).axes[0].collections) > 1
