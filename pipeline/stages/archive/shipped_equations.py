"""The equations as they are shipped: a table of coefficients, and their covariance."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config.yaml_text import parse
from pipeline.workflow import keys
from vsr_core.archive.equations import Equations, Error
from vsr_core.arrays import Array

FILE, COVARIANCE = "equations.yaml", "equations_covariance.csv"

HERE = Path(__file__).parent

_ERROR = ("above", "shorter", "median", "most", "none")


@dataclass(frozen=True)
class Shipped:
    """What is told of the equations, and the equations.

    Attributes
    ----------
    told : dict, what the file holds besides the coefficients
    """

    folder: Path
    told: dict[str, Any]

    @cached_property
    def equations(self) -> Equations:
        """The equations."""
        told = self.told
        coefficients = np.array([told["coefficients"][name] for name in told["coefficients"]]).T
        lines = (self.folder / COVARIANCE).read_text(encoding="utf-8").splitlines()
        lower = [line.split(",") for line in lines if not line.startswith("#")]
        error = Error(*(np.array(told["error"][name]) for name in _ERROR))
        return Equations(
            np.log(told["knots"]), tuple(told["coefficients"]), coefficients, _whole(lower), error
        )


def load(folder: Path = HERE) -> Shipped:
    """The equations in a folder, the shipped ones by default."""
    return Shipped(folder, dict(parse((folder / FILE).read_text(encoding="utf-8"))))


def digest() -> str:
    """Digest of the shipped equations."""
    return keys.digest([keys.digest_file(HERE / name) for name in (FILE, COVARIANCE)])


def texts(equations: Equations, told: dict[str, Any]) -> dict[str, str]:
    """The files of equations."""
    lines = [f"{name}: {json.dumps(value)}" for name, value in told.items()]
    lines.append(f"knots: {json.dumps(np.exp(equations.knots).round(6).tolist())}")
    lines.append("error:")
    for name in _ERROR:
        values = getattr(equations.error, name).round(4).tolist()
        lines.append(f"  {name}: {json.dumps(values)}")
    lines.append("coefficients:")
    for name, row in zip(equations.names, equations.coefficients.T, strict=True):
        lines.append(f"  {json.dumps(name)}: [{', '.join(f'{value:.6g}' for value in row)}]")
    rows = enumerate(equations.covariance, start=1)
    lower = [",".join(f"{value:.4g}" for value in row[:number]) for number, row in rows]
    return {
        FILE: _HEAD + "\n".join(lines) + "\n",
        COVARIANCE: _COVARIANCE_HEAD + "\n".join(lower) + "\n",
    }


_HEAD = """\
# Equations of vsr_core/archive/equations.py; `make archive-equations` makes them anew. By term: a
# coefficient for each spline of ln u; u = 1 / (p PGV/PGA) at the knots.
"""

_COVARIANCE_HEAD = """\
# Covariance of the coefficients of equations.yaml, counted spline by spline, each over all terms:
# the lower triangle.
"""


def _whole(lower: list[list[str]]) -> Array:
    """A symmetric matrix from the rows of its lower triangle."""
    matrix = np.array([row + ["0"] * (len(lower) - len(row)) for row in lower], dtype=np.float64)
    return matrix + np.tril(matrix, -1).T
