"""The equations of archives made anew: shapes drawn, boundaries resolved, coefficients fitted."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from itertools import chain
from typing import Any

import numpy as np
import xarray as xr

from pipeline.drawing.style import pictures, png_uri
from pipeline.stages.archive import equations_figures, shipped_equations
from pipeline.workflow import keys, pages, writers
from pipeline.workflow.datasets import attributed, netcdf
from pipeline.workflow.store import Store, writing
from vsr_core.archive import boundaries
from vsr_core.archive.boundaries import Resolved
from vsr_core.archive.equations import Equations
from vsr_core.archive.fitting import Boundaries, fit, left_out, missed
from vsr_core.archive.profiles import Profiles

FOLDER = "archive_equations"
"""Of the derived data, where the equations go."""

DATA, PAGE = "archive_boundaries.nc", "archive_equations.html"

TERMS = (
    "1",
    "first_stronger",
    "first_weaker",
    "lost",
    "roundness",
    "first_stronger*first_stronger",
    "first_stronger*roundness",
    "first_stronger*slenderness",
    "first_weaker*slenderness",
    "lost*lost",
    "lost*grip",
    "grip*grip",
    "grip*slenderness",
    "slenderness*slenderness",
    "first_weaker*first_weaker*first_weaker",
    "first_weaker*first_weaker*slenderness",
    "lost*lost*first_weaker",
)
"""Terms of the equations: of all products of two or three features those without which the errors
on shapes left out grow."""

TOLD_EVERY = 100
"""Shapes between two lines of the log."""


def make(options: argparse.Namespace, log: Callable[[str], None]) -> list[str]:
    """Write boundaries, equations and their page; with ``ship`` the equations that are shipped."""
    found = list(chain.from_iterable(_resolved(options.shapes, options.workers, log)))
    given = _together(found)
    equations = fit(given, TERMS)
    without = left_out(given, TERMS)
    size = np.abs(missed(without, given.relative))
    quantiles = np.nanquantile(size, (0.5, 0.9, 0.95))
    told = {
        "shapes": options.shapes,
        "runs": sum(one.runs for one in found),
        "boundaries": int(np.isfinite(given.relative).sum()),
        "about": _about(quantiles),
    }
    texts = shipped_equations.texts(equations, told)
    files = {name: writers.text(text) for name, text in texts.items()}
    dataset = _dataset(found, given)
    files[DATA] = netcdf(dataset)
    errors = equations_figures.errors(given, without)
    forms = equations_figures.forms(equations)
    for name, figure in (("archive_errors", errors), ("archive_forms", forms)):
        files |= pictures(name, figure)
    facts = _facts(equations, told) | {"errors": png_uri(errors), "forms": png_uri(forms)}
    files[PAGE] = writers.text(pages.filled(PAGE, facts))
    with Store(options.derived / FOLDER) as store:
        store.open()
        manifest = {"key": dataset.attrs["vsr_key"], "facts": {}, "unresolved": 0, "retry": 0}
        store.publish(FOLDER, manifest, files)
    lines = [f"-> {store.folder / name}" for name in (PAGE, DATA, shipped_equations.FILE)]
    if options.ship:
        with writing(shipped_equations.HERE):
            for name, text in texts.items():
                (shipped_equations.HERE / name).write_text(text, encoding="utf-8")
        lines.append(f"-> {shipped_equations.HERE / shipped_equations.FILE}")
    return lines


def _resolved(shapes: int, workers: int, log: Callable[[str], None]) -> Iterator[list[Resolved]]:
    """Boundaries of all shapes, in the order of their numbers."""
    with _mapping(workers) as mapped:
        for number, found in enumerate(mapped(boundaries.of_number, range(shapes)), 1):
            if number % TOLD_EVERY == 0:
                log(f"{number} of {shapes} shapes")
            yield found


@contextmanager
def _mapping(workers: int) -> Iterator[Callable[..., Iterator[list[Resolved]]]]:
    """What maps a function over shapes, in processes of their own where there are to be some."""
    if workers == 0:
        yield map
        return
    with ProcessPoolExecutor(workers) as pool:
        yield pool.map


def _together(found: list[Resolved]) -> Boundaries:
    """Boundaries of all shapes and both directions."""

    def column(name: str) -> np.ndarray:
        return np.array([getattr(one.profile, name) for one in found])

    names = ("tan_alpha", "radius", "inertia", "roundness", "friction")
    return Boundaries(
        np.repeat(np.arange(len(found) // 2), 2),
        Profiles(*map(column, names)),
        np.array([one.pgv_pga for one in found]),
        np.sqrt([one.stands * one.topples for one in found]),
    )


def _about(quantiles: np.ndarray) -> str:
    half, nine, most = (f"{100.0 * value:.1f} %" for value in quantiles)
    return f"half are below {half}, nine in ten below {nine}, 95 in 100 below {most}"


def _dataset(found: list[Resolved], given: Boundaries) -> xr.Dataset:
    rocks, levels = given.rocks, ("drawn", "row")
    sides = ("drawn", "lean")
    variables: dict[str, Any] = {
        "shape_number": ("drawn", given.shape),
        "shape_family": ("drawn", np.array([one.family for one in found], dtype=object)),
        "tan_alpha": (sides, rocks.tan_alpha),
        "frequency_parameter": (sides, rocks.p),
        "energy_kept": ("drawn", rocks.kept),
        "roundness": ("drawn", rocks.roundness),
        "friction": ("drawn", rocks.friction),
        "drawn_pgv_pga": (levels, given.pgv_pga),
        "last_standing_pga": (levels, np.array([one.stands for one in found])),
        "first_toppled_pga": (levels, np.array([one.topples for one in found])),
    }
    dataset = xr.Dataset(variables)
    provenance = {
        "history": "made by vsr archive-equations",
        "vsr_key": keys.digest(
            {
                name: str(one[1].tobytes())
                for name, one in variables.items()
                if one[1].dtype != object
            }
        ),
    }
    return attributed(dataset, "Boundaries of shapes drawn at random", "nonsmooth", provenance)


def _facts(equations: Equations, told: dict[str, Any]) -> dict[str, Any]:
    """What the page says."""
    sd = np.sqrt(np.diag(equations.covariance)).reshape(equations.coefficients.shape)
    error = equations.error
    return {
        "told": told,
        "knots": np.exp(equations.knots),
        "rows": [
            (name, list(zip(equations.coefficients[:, n], sd[:, n], strict=True)))
            for n, name in enumerate(equations.names)
        ],
        "error": list(zip(error.above, error.median, error.most, error.none, strict=True)),
        "shorter": error.shorter,
    }
