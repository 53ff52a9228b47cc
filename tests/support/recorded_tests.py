"""A small folder of recorded shake-table tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from pipeline.stages.studies.validation.recorded_tests import OUTCOMES, RECORDS


def recorded_tests(folder: Path) -> Path:
    """Two tests with a record, which is packed as published ones are, and one that has none."""
    time = 0.005 * np.arange(400)
    shaking = 3.0 * np.sin(10.0 * time) * np.hanning(400)
    xr.Dataset(
        {
            "acceleration": (("test", "time"), np.array([shaking, 2.0 * shaking])),
            "n_samples": ("test", [400, 400]),
        },
        {"test": [1, 2], "time": time},
    ).to_netcdf(folder / RECORDS, encoding={"acceleration": {"zlib": True}})
    rows = ["test,has_record,pga_g,pgv_pga_s,dem_s1_soft,specimen1"]
    rows += ["1,1,0.2,0.3,0,0", "2,1,0.5,0.3,1,1", "3,0,0.5,0.3,1,1"]
    (folder / OUTCOMES).write_text("\n".join(rows) + "\n")
    (folder / "sp1.ply").write_text("")
    return folder
