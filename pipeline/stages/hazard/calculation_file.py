"""What both kinds of OpenQuake's own file of a calculation hold, ``calc_N.hdf5``.

``oqparam`` are the parameters: JSON, or in older versions a table of names and values as Python
writes them. ``full_lt`` is the logic tree, and ``weights`` those of its realizations.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.config.outside import by_key, of_json, refused
from pipeline.stages.hazard.hdf5_files import attribute, content
from vsr_core.arrays import Array
from vsr_core.errors import reason

_MOST = 50_000_000
"""Numbers in an array of a calculation."""

_MOST_SETTINGS, _MOST_ROWS = 10_000, 100_000
"""Parameters, and rows of a logic tree."""

_ROUNDED = 1e-5
"""How far a weight may be from the product of those of its branches, in four bytes."""


@contextmanager
def reading(path: Path, key: str, rule: str) -> Iterator[None]:
    """Refuse a calculation in one line, whatever reading it raises."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 (of a broken file, whatever HDF5 meets first)
        given = f"an invalid file ({reason(error)})"
        raise refused(path, key, given, rule, "run it so, or export its curves") from None


def numbers(data: Any) -> Array:
    """An array of a calculation, of bounded size."""
    if data.dtype.kind not in "fiu":
        raise ValueError(f"{data.dtype} for numbers")
    return np.asarray(content(data, _MOST), dtype=np.float64)


def number_of(setting: Any) -> float:
    """A number among the parameters, which older versions wrote as text."""
    if isinstance(setting, bool) or "_" in str(setting):
        raise ValueError(f"{setting!r} for a number")
    return float(setting)


def weights_of(file: Any) -> Array:
    """Weights of the realizations, the first where they have several."""
    found = numbers(file["weights"])
    return found.reshape(len(found), -1)[:, 0]


def check_sites(path: Path, *counts: int) -> None:
    """Refuse another number of sites, or of their coordinates, than one."""
    if others := [count for count in counts if count != 1]:
        rule, remedy = "all shaking is at one site", "calculate the rock's site only"
        raise refused(path, "sitecol", f"{others[0]} sites", rule, remedy)


def described(data: Any, second: str) -> dict[str, Any]:
    """What an array of curves says of its axes, by name: how many there are of each, or which."""
    told: dict[str, Any] = of_json(attribute(data, "json"))
    axes = ["site_id", second, "imt", "lvl"]
    if told.get("shape_descr", axes) != axes:
        raise ValueError(f"{data.name[1:]} by {told['shape_descr']}")
    for axis, size in zip(axes, data.shape, strict=True):
        said = told.get(axis, size)
        number = len(said) if isinstance(said, list) else said
        if isinstance(number, int) and number != size:
            raise ValueError(f"{data.name[1:]} with {size} of {axis}, which says {said}")
    return told


def settings_of(file: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters of the calculation, and the levels of each measure."""
    stored = content(file["oqparam"], _MOST_SETTINGS)
    if isinstance(stored, bytes):
        settings = of_json(stored)
        return settings, settings["hazard_imtls"]
    settings = by_key([(row[0].decode(), row[1].decode()) for row in stored])
    levels: Any = ast.parse(settings["hazard_imtls"], mode="eval").body
    pairs = zip(levels.keys, levels.values, strict=True)
    return settings, by_key([(ast.literal_eval(one), ast.literal_eval(own)) for one, own in pairs])


def paths_of(file: Any, settings: dict[str, Any], weights: Array) -> list[str]:
    """Choices that lead to each realization, where each source model has all ground-motion models.

    Otherwise, as with several tectonic regions or sampled ones, the realizations have their numbers
    only. Choices with weights are to make those of the realizations.
    """
    trees = [content(file[f"full_lt/{name}"], _MOST_ROWS) for name in ("sm_data", "gsim_lt")]
    columns = [{*tree.dtype.names} for tree in trees]
    if own := {"PGA", "PGV"} & columns[1]:
        raise ValueError(f"weights of {min(own)} of their own, which are not read")
    models, motions = (
        [row[name].decode() for row in tree]
        for tree, name in zip(trees, ("path", "branch"), strict=True)
    )
    regions = set(trees[1]["trt"].tolist()) if "trt" in columns[1] else set()
    sampled = number_of(settings.get("number_of_logic_tree_samples", 0)) > 0
    if len(models) * len(motions) != len(weights) or len(regions) > 1 or sampled:
        return [f"realization {i}" for i in range(len(weights))]
    if all("weight" in names for names in columns):
        products = np.outer(*(tree["weight"].astype(np.float64) for tree in trees)).ravel()
        if (off := np.abs(weights - products)).max() > _ROUNDED:
            given = f"{weights[off.argmax()]:g} for {products[off.argmax()]:g}"
            raise ValueError(f"weights that the logic tree does not make, as {given}")
    return [f"{model}~{motion}" for model in models for motion in motions]
