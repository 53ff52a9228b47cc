"""Motions: the grid of cosine pulses, as the table would be driven."""

from __future__ import annotations

from pipeline.datasets import described, netcdf
from pipeline.stage import Job, Product, Stage


def make(job: Job) -> Product:
    """Frequency, amplitude, PGV and duration of every pulse (paper's Eqs 8-10)."""
    import numpy as np
    import xarray as xr

    from vsr_core import GRAVITY

    pga = np.array(job.config.motion.pga)
    pgv_pga = np.array(job.config.motion.pgv_pga)
    frequency = 1.0 / (2.0 * np.pi * pgv_pga)
    dataset = xr.Dataset(
        {
            "frequency": ("pgv_pga", frequency),
            "duration": ("pgv_pga", 1.0 / frequency),
            "amplitude": (("pgv_pga", "pga"), np.outer(pgv_pga**2, GRAVITY * pga)),
            "pgv": (("pgv_pga", "pga"), np.outer(pgv_pga, GRAVITY * pga)),
        },
        {"pga": pga, "pgv_pga": pgv_pga},
    )
    shaking = pga.size * float((1.0 / frequency).sum())
    summary = f"{pgv_pga.size} x {pga.size} cosine pulses, {shaking:.0f} s of shaking"
    return Product({"motions.nc": netcdf(described(dataset, job, "Ground motions"))}, summary)


STAGE = Stage(name="motions", make=make, reads=("motion",))
