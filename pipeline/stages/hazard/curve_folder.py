"""A folder of hazard curves, of any kind that is known."""

from __future__ import annotations

from pathlib import Path

from pipeline.stages.hazard import nshmp, openquake
from pipeline.stages.hazard.hazard_model import HazardModel, refused


def load(folder: Path) -> HazardModel:
    """The hazard model in a folder.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    HazardModel

    Raises
    ------
    InputError
        If there are no curves, or they break a rule.
    """
    if not folder.is_dir():
        raise refused(folder, "", "no folder", "curves are in a folder", "check the path")
    for reader in (openquake, nshmp):
        if reader.is_there(folder):
            return reader.load(folder)
    raise refused(
        folder,
        "",
        "no curves",
        "OpenQuake's are named hazard_curve-rlz-000-PGA_1.csv, nshmp-haz's PGA/curves.csv",
        "give the folder that they were exported to",
    )
