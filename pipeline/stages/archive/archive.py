"""An archive of rocks: the boundary of each by the equations, what is assumed, and its band."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.config.paths import kept, located, shown
from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import pictures, png_uri
from pipeline.stages.archive import archive_figures, rock_list, shipped_equations
from pipeline.stages.archive.rock_list import Archive
from pipeline.stages.archive.shipped_equations import Shipped
from pipeline.workflow import keys, pages, writers
from pipeline.workflow.datasets import attributed, netcdf
from pipeline.workflow.log import complain
from pipeline.workflow.store import Store
from vsr_core.archive.equations import HIGHEST, SHORTEST
from vsr_core.archive.photographs import ASSUMED, ODDS, Answers, answers
from vsr_core.arrays import Array

FOLDER = "archives"
"""Of the derived data, where archives go."""

PGV_PGA = (0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4, 0.56, 0.8)
"""PGV/PGA of the answers [s]."""

SHOWN = (0.1, 0.2, 0.4)
"""Those of them that the page has in its table [s]."""

MOST_SHOWN = 100
"""Rocks in the table of the page."""

TABLE, DATA, PAGE, PICTURE = "archive.csv", "archive.nc", "archive.html", "archive_boundaries"


def make(options: argparse.Namespace) -> tuple[Store, int]:
    """Write the products of an archive; the number of rows without an answer."""
    path = located(Path.cwd(), options.rocks, "vsr archive", "")
    archive = rock_list.read(path)
    known = keys.digest_file(path)  # before the answers take their time
    store = Store(_folder(options.derived, path))
    store.check_apart([Path(options.rocks)])
    for problem in archive.problems:
        complain(f"vsr: {problem}")
    for doubt in archive.doubts:
        complain(f"vsr: warning: {shown(path)}: {doubt}")
    shipped = shipped_equations.load()
    found = answers(archive.seen, shipped.equations, np.array(PGV_PGA))
    dataset = _dataset(archive, found, path, known)
    drawn = archive_figures.boundaries(dataset, [rock.name for rock in archive.rocks])
    files = {
        DATA: netcdf(dataset),
        TABLE: writers.table(_table(archive, dataset)),
        **pictures(PICTURE, drawn),
    }
    facts = _facts(archive, found, shipped, path)
    facts |= {"figure": png_uri(drawn), "spread": png_uri(archive_figures.spread(dataset))}
    files[PAGE] = writers.text(pages.filled(PAGE, facts, "../../"))
    unanswered = len(archive.problems)
    with store:
        store.open()
        manifest = {"key": dataset.attrs["vsr_key"], "facts": {"file": str(path)}, "retry": 0}
        store.publish("archive", manifest | {"unresolved": unanswered}, files)
    return store, unanswered


def _folder(derived: Path, path: Path) -> Path:
    """Folder of an archive; another file of the same name has one of its own."""
    if not path.stem.strip("."):
        rule, remedy = "results go to a folder of its name", "rename it, e.g. to rocks.csv"
        raise InputError(Problem(shown(path), "", "a name of points", rule, remedy))
    folder = derived / FOLDER / path.stem
    manifest = Store(folder).manifest("archive")
    if manifest is not None and manifest["facts"].get("file") != str(path):
        return folder.with_name(f"{path.stem}-{keys.digest(str(path))[:8]}")
    return folder


def directions(archive: Archive) -> Array:
    """Directions of the first push [degree], shape (n, 2): to side 1, and to side 2."""
    towards = np.array([rock.azimuth_deg or 0.0 for rock in archive.rocks])
    return np.column_stack([towards, towards + 180.0]) % 360.0


def _dataset(archive: Archive, found: Answers, path: Path, known: str) -> xr.Dataset:
    """All that is known of the rocks that have an answer."""
    levels = ("rock", "side", "pgv_pga")
    unseen = np.stack(list(found.unseen.values()), axis=-1)
    best = archive.seen.profiles()
    variables: dict[str, Any] = {
        "rock_name": ("rock", np.array([rock.name for rock in archive.rocks], dtype=object)),
        "push_direction": (levels[:2], directions(archive)),
        "first_overturning_pga": (levels, found.boundary),
        "first_overturning_low": (levels, found.low),
        "first_overturning_high": (levels, found.high),
        "equation_error": (levels, found.equation),
        "unseen_log_sd": ((*levels, "assumption"), unseen),
        "fragility_log_sd": (levels, found.log_sd),
        "share_without_boundary": (levels, found.none),
        "static_pga": ("rock", found.static),
        "slides": ("rock", found.slides.astype(np.int8)),
        "tan_alpha": (levels[:2], best.tan_alpha[:, ::-1]),
        "frequency_parameter": (levels[:2], best.p[:, ::-1]),
        "assumed": (
            ("rock", "assumption"),
            np.column_stack(list(archive.seen.unknown().values())).astype(np.int8),
        ),
        "age_mean": ("rock", np.array([rock.age_mean_a for rock in archive.rocks], float)),
        "age_sd": ("rock", np.array([rock.age_sd_a for rock in archive.rocks], float)),
    }
    coords = {
        "side": np.array([1, 2], dtype=np.int8),
        "pgv_pga": np.array(PGV_PGA),
        "assumption": np.array(list(ASSUMED), dtype=object),
    }
    provenance = {
        "history": f"made by vsr archive from {kept(path)}",
        "vsr_key": keys.digest([known, shipped_equations.digest()]),
    }
    dataset = xr.Dataset(variables, coords)
    dataset = attributed(dataset, f"Archive of rocks: {path.stem}", "nonsmooth", provenance)
    dataset["first_overturning_pga"].attrs["long_name"] = (
        "first-overturning PGA by the equations; missing where none is known to overturn the rock"
    )
    return dataset


def _table(archive: Archive, dataset: xr.Dataset) -> pd.DataFrame:
    """A row for each rock, direction and PGV/PGA."""
    shape = dataset["first_overturning_pga"].shape
    names = np.array([rock.name for rock in archive.rocks], dtype=object)

    def column(name: str) -> Array:
        return np.asarray(dataset[name].values.ravel())

    return pd.DataFrame(
        {
            "name": np.broadcast_to(names[:, None, None], shape).ravel(),
            "direction_deg": np.broadcast_to(directions(archive)[..., None], shape).ravel(),
            "pgv_pga_s": np.broadcast_to(np.array(PGV_PGA), shape).ravel(),
            "boundary_pga_g": column("first_overturning_pga"),
            "low_g": column("first_overturning_low"),
            "high_g": column("first_overturning_high"),
        }
    )


def _facts(archive: Archive, found: Answers, shipped: Shipped, path: Path) -> dict[str, Any]:
    """What the page says."""
    unknown = archive.seen.unknown()
    at = [PGV_PGA.index(level) for level in SHOWN]
    rocks = [
        {
            "rock": rock,
            "static": found.static[n],
            "slides": bool(found.slides[n]),
            "assumed": [name for name, where in unknown.items() if where[n]],
            "ways": [
                {
                    "direction": direction,
                    "cells": [
                        (found.boundary[n, side, k], found.low[n, side, k], found.high[n, side, k])
                        for k in at
                    ],
                }
                for side, direction in enumerate(directions(archive)[n])
            ],
        }
        for n, rock in enumerate(archive.rocks[:MOST_SHOWN])
    ]
    error = shipped.equations.error
    return {
        "name": path.stem,
        "file": kept(path),
        "count": len(archive.rocks),
        "problems": [str(one) for one in archive.problems],
        "rocks": rocks,
        "levels": SHOWN,
        "assumed": ASSUMED,
        "how_many": {name: int(where.sum()) for name, where in unknown.items()},
        "no_azimuth": sum(rock.azimuth_deg is None for rock in archive.rocks),
        "sliding": int(found.slides.sum()),
        "error": list(zip(error.above, error.median, error.most, error.none, strict=True)),
        "shorter": error.shorter,
        "told": shipped.told,
        "highest": HIGHEST,
        "shortest": SHORTEST,
        "odds": ODDS,
        "medians": _medians(found),
    }


def _medians(found: Answers) -> list[tuple[float, ...]]:
    """PGV/PGA, and the median error of the equations, of what is unseen, and of both."""
    if not len(found.static):
        return []
    parts = (found.equation, ODDS * found.unseen_sd, ODDS * found.log_sd)
    values = [np.median(part[..., PGV_PGA.index(level)]) for level in SHOWN for part in parts]
    return [(level, *values[3 * n : 3 * n + 3]) for n, level in enumerate(SHOWN)]
