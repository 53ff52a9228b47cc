"""What each cell of a response diagram tells, packed for the report's scripts."""

from __future__ import annotations

import re
from typing import Any

import xarray as xr

from pipeline.stages.fragility.response_diagram import cell_borders
from pipeline.workflow.datasets import rows_of
from vsr_core.arrays import Array
from vsr_core.outcome import DecidedBy, Outcome

RULES = len(DecidedBy)
"""A cell is a letter: `A` and further by the outcome, in steps of this, and by what decided it."""


def axes_of(responses: xr.Dataset) -> dict[str, Any]:
    """What the cells of all diagrams share."""
    ratios = responses["pgv_pga"].values
    records = responses["record"].values if rows_of(responses) == "record" else None
    return {
        "pga": [f"{value:.6g}" for value in responses["pga"].values],
        "pgv_pga": [f"{value:.6g}" for value in ratios],
        "record": None if records is None else [str(name) for name in records],
        "outcomes": [outcome.name.lower() for outcome in Outcome],
        "rules": [rule.how for rule in DecidedBy],
    }


def cells_of(responses: xr.Dataset, place: tuple[int, int], figure: Any) -> dict[str, Any]:
    """The cells of a diagram, and where they lie in its picture."""
    runs = responses.isel(yaw=place[0], friction=place[1])
    across, down = cell_borders(figure)
    return {
        "across": across.round(5).tolist(),
        "down": down.round(5).tolist(),
        "cells": in_letters(runs["outcome"].values, runs["decided_by"].values),
    }


def in_letters(outcome: Array, decided_by: Array) -> str:
    """Outcomes and rules row by row, a letter each; a letter and a number are so many of it.

    Parameters
    ----------
    outcome, decided_by : ndarray of int, shape (rows, columns)

    Examples
    --------
    >>> import numpy as np
    >>> in_letters(np.array([[0, 0, 0, 0, 1]]), np.array([[1, 1, 1, 1, 3]]))
    'B4H'
    """
    codes = (RULES * outcome.astype(int) + decided_by.astype(int)).ravel()
    letters = "".join(chr(ord("A") + code) for code in codes.tolist())
    return re.sub(r"(.)\1{2,}", lambda run: f"{run[1]}{len(run[0])}", letters)
