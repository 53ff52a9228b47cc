"""Figures of a sweep: lines break where nothing topples, axes name quantities and their units."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from test_sweep_changes import AT_ONCE, NEVER, study

from pipeline.config.sweep import Dimension
from pipeline.stages.studies.sweeps.study import _over
from pipeline.stages.studies.sweeps.sweep_figures import boundaries, multiples, over_key
from pipeline.workflow.datasets import catalogue

KEY = "simulation.time_step"
STEP = Dimension("size", {KEY: (0.001, 0.002, 0.004)}, ("0.001", "0.002", "0.004"), 0, False)
HERE = (0.3, 0.4)


def sweep(*middle: tuple[float, float]) -> xr.Dataset:
    """Three places, whose second has other boundaries."""
    return study([HERE] * 4, list(middle), [HERE] * 4)


def test_a_line_over_the_key_breaks_at_a_place_where_nothing_topples() -> None:
    (axes,) = over_key(sweep(NEVER, HERE, HERE, HERE), STEP).axes
    first, second = (container.lines[0] for container in axes.containers[:2])
    assert np.isfinite(first.get_ydata()).tolist() == [True, False, True]
    assert np.isfinite(second.get_ydata()).all()
    low, high = axes.get_xlim()
    assert low < 0.001
    assert high > 0.004


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("rows", [(AT_ONCE, AT_ONCE, HERE), (AT_ONCE, NEVER)])
def test_a_row_that_topples_at_once_is_below_the_others_in_a_median(
    rows: tuple[tuple[float, float], ...],
) -> None:
    parts = [sweep(*[row] * 4) for row in rows]
    lines = boundaries(xr.concat(parts, "yaw", data_vars="all"), STEP, None).axes[0].lines
    assert np.isnan(lines[1].get_xdata()).all()
    assert np.isfinite(lines[0].get_xdata()).all()


@pytest.mark.parametrize("unbounded", [NEVER, AT_ONCE], ids=["never", "at once"])
def test_a_boundary_breaks_at_a_row_without_one(unbounded: tuple[float, float]) -> None:
    """Where nothing topples, and where the lowest PGA does: what is stored then is assumed."""
    data = sweep(HERE, unbounded, HERE, HERE)
    for lines in (boundaries(data, STEP, None).axes[0].lines, multiples(data, STEP).axes[1].lines):
        gaps = [int(np.isnan(line.get_xdata()).sum()) for line in lines]
        assert sum(gaps) == 1


def test_rows_that_a_member_was_not_run_on_break_no_line() -> None:
    """Records stand at their own PGV/PGA, between which a member has nothing."""
    data = sweep(HERE, HERE, HERE, HERE)
    left_out = (data["size"] == 1) & (data["pgv_pga"] == data["pgv_pga"][1])
    data["outcome"] = data["outcome"].where(~left_out, -1)
    data["first_overturning_pga"] = data["first_overturning_pga"].where(~left_out)
    line = boundaries(data, STEP, None).axes[0].lines[1]
    assert line.get_ydata().tolist() == [0.1, 0.4, 0.8]
    assert np.isfinite(line.get_xdata()).all()


@pytest.mark.parametrize(
    ("key", "label", "second"),
    [
        ("yaw", f"{catalogue()['yaw']['long_name']} [deg]", "90 deg"),
        ("contact.friction", catalogue()["friction"]["long_name"], "90"),
        (KEY, "time step [s]", "90 s"),
    ],
)
def test_axes_and_panels_name_quantities_with_their_units(
    key: str, label: str, second: str
) -> None:
    swept = Dimension("size", {key: (0, 90, 180)}, ("0", "90", "180"), 0, False)
    data = sweep(HERE, HERE, HERE, HERE)
    assert over_key(data, swept).axes[0].get_xlabel() == label
    assert multiples(data, swept).axes[1].get_title() == second


def test_curves_are_medians_over_what_is_not_swept() -> None:
    part = xr.Dataset(coords={"yaw": [0, 90], "friction": [0.4, 0.6], "pgv_pga": [0.1]})

    def over(name: str) -> str:
        return _over(part, Dimension(name, {name: (0, 1)}, ("0", "1"), 0, gridded=True))

    assert over("yaw") == "frictions"
    assert over("friction") == "directions"
    assert over("bounce") == "directions and frictions"
