"""Datasets as products: units and names from the catalogue, provenance, and writing."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import xarray as xr
import yaml

from pipeline.workflow.keys import library_version
from pipeline.workflow.stage import Job
from pipeline.workflow.writers import Writer
from vsr_core import outcome

CATALOGUE = Path(__file__).with_name("catalogue.yaml")

_VERSIONS = ("vsr", "numpy", "scipy", "xarray")

_ENGINES = {"bullet": "PyBullet", "mujoco": "MuJoCo"}
"""Libraries of the engines."""


@cache
def catalogue() -> dict[str, dict[str, str]]:
    """Variables by name: ``units``, ``long_name`` and perhaps ``flags``."""
    return dict(yaml.safe_load(CATALOGUE.read_text(encoding="utf-8")))


def label(name: str) -> str:
    """Axis label of a variable, e.g. ``peak ground acceleration [g]``."""
    entry = catalogue()[name]
    unit = {"1": "", "degree": " [deg]"}.get(entry["units"], f" [{entry['units']}]")
    return entry["long_name"] + unit


def described(dataset: xr.Dataset, job: Job, title: str) -> xr.Dataset:
    """The dataset with CF attributes for every variable and its provenance.

    Raises
    ------
    KeyError
        For a variable that the catalogue does not know.
    """
    for name in dataset.variables:
        entry = catalogue()[str(name)]
        attributes: dict[str, Any] = {"long_name": entry["long_name"], "units": entry["units"]}
        if "flags" in entry:
            flags = list(getattr(outcome, entry["flags"]))
            attributes["flag_values"] = [flag.value for flag in flags]
            attributes["flag_meanings"] = " ".join(flag.name.lower() for flag in flags)
        dataset[name].attrs.update(attributes)
    engine = _ENGINES[job.config.simulation.engine]
    versions = {name: library_version(name) for name in (*_VERSIONS, engine.lower())}
    dataset.attrs |= {
        "Conventions": "CF-1.11",
        "title": f"{title}: {job.site.name}",
        "source": f"virtual shake robot {versions['vsr']}, {engine} {versions[engine.lower()]}",
        "history": f"made by stage from {job.site.file}",
        "references": "Chen et al. (2024), Virtual Shake Robot, Seismica 3(1)",
        "vsr_key": job.key,
        "vsr_config_json": json.dumps(job.config.model_dump(mode="json"), sort_keys=True),
        "vsr_versions_json": json.dumps(versions, sort_keys=True),
    }
    return dataset


def rows_of(dataset: xr.Dataset) -> str:
    """Name of the dimension of the ground motions: ``pgv_pga`` of pulses, ``record``."""
    return "record" if "record" in dataset.dims else "pgv_pga"


def netcdf(dataset: xr.Dataset) -> Writer:
    """Writer of a dataset as compressed NetCDF; fill values as already set in its encoding."""

    def write(path: Path) -> None:
        encoding: dict[str, dict[str, Any]] = {}
        for name, variable in dataset.variables.items():
            given = dict(variable.encoding)
            given.setdefault("_FillValue", None)
            if variable.dtype.kind in "fiu" and variable.ndim:
                given |= {"zlib": True, "complevel": 4}
            encoding[str(name)] = given
        try:
            dataset.to_netcdf(path, engine="netcdf4", format="NETCDF4", encoding=encoding)
        except RuntimeError as error:  # how netCDF4 says that the disk is full
            raise OSError(str(error)) from error

    return write


def read(path: Path) -> xr.Dataset:
    """A product, loaded and closed, with its flags and fill values as stored numbers."""
    return xr.load_dataset(path, engine="netcdf4", mask_and_scale=False)
