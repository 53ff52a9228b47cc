"""Each run of a grid is in the cell of its own direction, friction, PGV/PGA and PGA."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from conftest import Ran

from pipeline.workflow.datasets import read

GRID = {
    "yaw": (0.0, 60.0, 90.0),
    "friction": (0.2, 0.7),
    "pgv_pga": (0.1, 0.25, 0.4, 0.6),
    "pga": (0.3, 0.6),
}
"""Few, but such that the outcome is another along each axis."""

ALONE = [(0, 1, 3, 0), (2, 0, 1, 1), (1, 0, 2, 0)]
"""Some cells, by their places along the axes."""

FOUND = ("outcome", "peak_tilt", "final_tilt", "slip", "steps")


def keys(grid: dict[str, tuple[float, ...]]) -> str:
    """Settings of a grid, in one text."""
    names = ("yaw", "contact.friction", "motion.pgv_pga", "motion.pga")
    return " ".join(f"{name}={list(grid[own])}" for name, own in zip(names, grid, strict=True))


def test_a_cell_alone_is_the_cell_of_the_grid(
    vsr: Callable[..., Ran], write_site: Callable[..., str], tmp_path: Path
) -> None:
    site = write_site("simulation: {engine: nonsmooth, time_step: 0.008, reduce: false}")

    def responses(grid: dict[str, tuple[float, ...]], folder: str) -> dict[str, np.ndarray]:
        line = ("run", "responses", "--site", site, "--workers", 0, "--set", keys(grid))
        ran = vsr(*line, into=tmp_path / folder)
        assert ran.code == 0, ran.err
        data = read(tmp_path / folder / "rock" / "responses.nc")
        assert [list(data[name].values) for name in grid] == list(map(list, grid.values()))
        return {name: data[name].values for name in FOUND}

    whole = responses(GRID, "whole")
    seen = {tuple(whole[name][place] for name in FOUND) for place in ALONE}
    assert len(seen) == len(ALONE)  # cells that differ
    for place in ALONE:
        cell = {name: (GRID[name][at],) for name, at in zip(GRID, place, strict=True)}
        alone = responses(cell, f"cell {place}")
        assert [alone[name].item() for name in FOUND] == [whole[name][place] for name in FOUND]
