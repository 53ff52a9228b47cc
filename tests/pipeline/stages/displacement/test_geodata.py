"""What geographic information systems are told of runs, on made-up falls down a plane."""

from __future__ import annotations

import numpy as np
import shapely
import xarray as xr
from support import tumbling

from pipeline.stages.displacement import geodata
from vsr_core.outcome import Outcome, StopReason

STARTS = xr.DataArray([[0.0, 0.0, 0.6]], {"friction": [0.6]}, ("friction", "xyz"))


def test_a_run_without_a_verdict_says_so_beside_the_others() -> None:
    displacement = tumbling.displacement(runs=2, samples=20)
    displacement["outcome"][2] = Outcome.UNSETTLED
    displacement["movement"][2] = -1
    displacement["stop_reason"][2] = StopReason.UNDONE
    _, (_, runs) = geodata.layers(displacement, np.zeros(3), STARTS)
    found = geodata.attributes(runs)
    said = np.column_stack([found[name] for name in ("outcome", "movement", "ended")])
    assert said.tolist() == [
        ["balanced", "stayed", "came to rest"],
        ["overturned", "rolled over", "came to rest"],
        ["unsettled", "unresolved", "unresolved"],
    ]


def test_ends_are_of_the_centre_of_mass_and_of_runs_whose_end_is_known() -> None:
    """A run proved to stand has no samples, and ends beside one that rocked and came back."""
    displacement = xr.Dataset(
        {
            "row_size": ("run", [0, 3, 0, 0, 2]),
            "friction": ("run", [0.4, 0.4, 0.6, 0.4, 0.4]),
            "stop_reason": ("run", [StopReason.REST] * 3 + [StopReason.UNDONE] * 2),
            "x": ("sample", [0.0, 0.01, 0.0, 0.0, 7.0]),
            "y": ("sample", [0.0, 0.0, 0.0, 0.0, 7.0]),
            "z": ("sample", [0.75, 0.76, 0.75, 0.75, 7.0]),
        }
    )
    starts = STARTS.reindex(friction=[0.6, 0.4], fill_value=0.0)
    starts[1, 2] = 0.75
    (ends, runs), _ = geodata.layers(displacement, np.array([5e5, 4e6, 100.0]), starts)
    places = shapely.get_coordinates(ends, include_z=True)
    np.testing.assert_allclose(places, [[5e5, 4e6, z] for z in (100.75, 100.75, 100.6)])
    assert runs["number"].values.tolist() == [0, 1, 2]
