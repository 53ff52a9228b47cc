"""A folder of hazard curves, of any kind that is known, or the file of a calculation."""

from __future__ import annotations

from pathlib import Path

from pipeline.stages.hazard import nshmp, openquake, openquake_hdf5
from pipeline.stages.hazard.hazard_model import HazardModel, refused

ABOUT = "about.txt"
"""Text in a folder of curves that says where they come from; the page shows it."""


def load(path: Path) -> HazardModel:
    """The hazard model in a folder, or in a file of OpenQuake's."""
    if path.is_file() and path.suffix in openquake_hdf5.SUFFIXES:
        return openquake_hdf5.load(path)
    if not path.is_dir():
        raise refused(
            path,
            "",
            "no folder",
            "curves are in a folder, or in OpenQuake's calc_N.hdf5",
            "check the path",
        )
    for reader in (openquake, nshmp):
        if reader.is_there(path):
            return reader.load(path)
    raise refused(
        path,
        "",
        "no curves",
        "OpenQuake's are named hazard_curve-rlz-000-PGA_1.csv, nshmp-haz's PGA/curves.csv",
        "give the folder that they were exported to",
    )


def files(path: Path) -> list[Path]:
    """The files that decide what is read."""
    if path.is_file():
        return [path]
    return sorted([*path.glob("*.csv"), *path.glob("*/curves.csv"), *path.glob(ABOUT)])


def about(path: Path) -> str:
    """What is written about the curves, on one line; empty if nothing is."""
    note = path / ABOUT
    return " ".join(note.read_text(encoding="utf-8").split()) if note.is_file() else ""
