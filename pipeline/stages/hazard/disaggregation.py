"""Which magnitudes and distances shake a place: OpenQuake's disaggregation of PGA, as CSV.

A file ``Mag_Dist-mean-0_1.csv`` has columns ``imt, iml, poe, mag, dist`` and the mean, or one for
each realization or statistic (older: ``poe`` first, and one file a level): the probability that a
level is exceeded by earthquakes of a bin of magnitude and distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.stages.hazard.hazard_model import UNITS, refused
from vsr_core.arrays import Array

PATTERN = "Mag_Dist-*.csv"

_NEEDED = ("imt", "iml", "mag", "dist")


@dataclass(frozen=True, eq=False)
class Disaggregation:
    """Shares of earthquakes at levels of PGA.

    Attributes
    ----------
    magnitudes, distances : ndarray, shape (n,) [1] and [km], middles of the bins
    levels : ndarray, shape (k,) [m/s^2], ascending
    shares : ndarray, shape (k, n), rows sum to 1
    """

    magnitudes: Array
    distances: Array
    levels: Array
    shares: Array


def files(path: Path) -> list[Path]:
    """The files of a disaggregation: itself, or those in a folder."""
    return [path] if path.is_file() else sorted(path.glob(PATTERN))


def load(path: Path) -> Disaggregation:
    """Read a disaggregation by magnitude and distance."""
    parts = [_table(one) for one in files(path)]
    table = pd.concat(parts) if parts else pd.DataFrame(columns=[*_NEEDED, "share"])
    if not table["share"].sum() > 0.0:
        raise refused(
            path,
            "imt",
            "no disaggregation of PGA",
            "OpenQuake's is named Mag_Dist-mean-0_1.csv and has rows of PGA",
            "export it, or leave disaggregation out",
        )
    grid = table.groupby(["iml", "mag", "dist"])["share"].sum().unstack(["mag", "dist"]).fillna(0.0)
    grid = grid[grid.sum(axis=1) > 0.0]
    shares = grid.to_numpy()
    return Disaggregation(
        grid.columns.get_level_values("mag").to_numpy(dtype=np.float64),
        grid.columns.get_level_values("dist").to_numpy(dtype=np.float64),
        UNITS["PGA"] * grid.index.to_numpy(dtype=np.float64),
        shares / shares.sum(axis=1, keepdims=True),
    )


def _table(path: Path) -> pd.DataFrame:
    """Rows of PGA, whose share is the mean over what the file has columns for."""
    try:
        table = pd.read_csv(path, comment="#", encoding="utf-8-sig")
        table = table[table["imt"] == "PGA"]
        others = [name for name in table.columns if name not in (*_NEEDED, "poe")]
        share = table[others].astype(np.float64).mean(axis=1)
        return (
            table[list(_NEEDED)]
            .astype({"iml": float, "mag": float, "dist": float})
            .assign(share=share)
        )
    except (OSError, ValueError, KeyError) as error:
        raise refused(
            path,
            "",
            f"a file that is no disaggregation ({error})",
            f"it has the columns {', '.join(_NEEDED)} and one of probabilities",
            "export it again",
        ) from None
