"""To which relative width a boundary is resolved: as asked for, but not below its own error."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr

from pipeline.config.layers import Origin
from pipeline.config.problems import InputError, Problem
from pipeline.stages.runs.step_choice import StepData, step_for
from vsr_core.arrays import Array


def widths(
    asked: float | Literal["auto"], usual: float, measured: StepData, origin: Origin, key: str
) -> Array:
    """Relative width of a boundary's interval at each friction.

    Parameters
    ----------
    usual : float, where none is asked for, unless outcomes agree from farther off only

    Raises
    ------
    InputError
        For one asked for that is finer than outcomes agree at the time step.
    """
    error: Array = measured.data["boundary_agreement"].values
    if asked == "auto":
        return np.fmax(usual, error)
    if (error > asked).any():
        at = int(np.nanargmax(error))
        raise InputError(_refused(origin, asked, measured.data.isel(friction=at), key))
    return np.full(len(error), float(asked))


def _refused(origin: Origin, asked: float, measured: xr.Dataset, key: str) -> Problem:
    error, step = float(measured["boundary_agreement"]), float(measured["time_step"])
    rule = (
        f"an interval is no narrower than outcomes agree, to {error:.3g} of the boundary at "
        f"friction {float(measured['friction']):g} and a time step of {1e3 * step:.3g} ms"
    )
    finer = step_for(measured, asked)
    remedy = f"leave it to auto, or give {error:.2g} or more"
    if finer is not None:
        remedy = (
            f"set simulation.tolerance={asked:g} (a time step of {1e3 * finer:.3g} ms), or auto"
        )
    return Problem(origin.file_of(key), key, f"{asked:g}", rule, remedy)
