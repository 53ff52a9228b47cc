"""Datasets as products: units and names from the catalogue, provenance, and writing."""

from __future__ import annotations

import json
import platform
import sys
from contextlib import closing
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any, ClassVar, Self, cast

import numpy as np
import threadpoolctl
import xarray as xr
from xarray.backends import NetCDF4DataStore

from pipeline.config.yaml_text import parse
from pipeline.workflow.keys import installed_version
from pipeline.workflow.stage import Work
from pipeline.workflow.store import Store
from pipeline.workflow.writers import Writer
from vsr_core import outcome

if "dask" not in sys.modules:
    # At its first array xarray loads dask's arrays, to know them; there are none here.
    sys.modules["dask"] = cast(ModuleType, None)
    xr.Variable((), 0)
    del sys.modules["dask"]

_CATALOGUE = Path(__file__).with_name("catalogue.yaml")

_LOCK = Lock()
"""Of the NetCDF library, which does one thing at a time."""

_VERSIONS = ("vsr", "numpy", "scipy", "xarray")

_ENGINES = {"bullet": "PyBullet", "mujoco": "MuJoCo", "nonsmooth": "numba"}
"""Libraries of the engines."""


@cache
def catalogue() -> dict[str, dict[str, str]]:
    """Every variable of every dataset."""
    return dict(parse(_CATALOGUE.read_text(encoding="utf-8")))  # refuses a name given twice


def label(name: str) -> str:
    """Axis label of a variable.

    >>> label("pga")
    'peak ground acceleration [g]'
    """
    entry = catalogue()[name]
    return labelled(entry["long_name"], entry["units"])


def labelled(text: str, units: str) -> str:
    """Label of what has a name and a unit.

    >>> labelled("speed", "m s-1"), labelled("friction", "1")
    ('speed [m s-1]', 'friction')
    """
    unit = spelled(units)
    return f"{text} [{unit}]" if unit else text


def spelled(units: str) -> str:
    """A unit as figures and sentences spell it; nothing for a pure number.

    >>> spelled("degree"), spelled("1")
    ('deg', '')
    """
    return {"1": "", "degree": "deg"}.get(units, units)


def described(dataset: xr.Dataset, work: Work, title: str) -> xr.Dataset:
    """Give a dataset CF attributes for every variable, and its provenance."""
    return attributed(dataset, f"{title}: {work.origin.name}", work.engine, work.provenance)


def attributed(
    dataset: xr.Dataset, title: str, by_engine: str, provenance: dict[str, str]
) -> xr.Dataset:
    """The same of a dataset that is of no site."""
    for name in dataset.variables:
        entry = catalogue()[str(name)]
        attributes: dict[str, Any] = {"long_name": entry["long_name"], "units": entry["units"]}
        if "flags" in entry:
            flags = list(getattr(outcome, entry["flags"]))
            attributes["flag_values"] = [flag.value for flag in flags]
            attributes["flag_meanings"] = " ".join(flag.name.lower() for flag in flags)
        dataset[name].attrs.update(attributes)
    engine = _ENGINES[by_engine]
    versions = {name: installed_version(name) for name in (*_VERSIONS, engine.lower())}
    dataset.attrs |= {
        "Conventions": "CF-1.11",
        "title": title,
        "source": f"virtual shake robot {versions['vsr']}, {engine} {versions[engine.lower()]}",
        "references": "Chen et al. (2024), Virtual Shake Robot, Seismica 3(1)",
        **provenance,
        "vsr_versions_json": json.dumps(versions, sort_keys=True),
        "vsr_processor_json": json.dumps(_processor(), sort_keys=True),
    }
    return dataset


@cache
def _processor() -> dict[str, str]:
    """What last digits may depend on; nothing that tells one machine from another of its make."""
    blas = [lib for lib in threadpoolctl.threadpool_info() if lib["user_api"] == "blas"]
    own: dict[str, Any] = min(
        blas, key=lambda lib: str(lib["filepath"]), default={}
    )  # NumPy's, not SciPy's
    return {
        "machine": platform.machine(),
        "blas": " ".join(str(own.get(key)) for key in ("internal_api", "version", "architecture")),
        "simd": " ".join(np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])),
        "libc": " ".join(platform.libc_ver()),
    }


@dataclass(frozen=True)
class Stored:
    """The product of a stage, of a dataset that is read when it is first looked at."""

    FILE: ClassVar[str]

    folder: Path

    @classmethod
    def load(cls, store: Store) -> Self:
        """The product as it is in a folder."""
        return cls(store.folder)

    @cached_property
    def data(self) -> xr.Dataset:
        """The dataset."""
        return read(self.folder / self.FILE)


def rows_of(dataset: xr.Dataset) -> str:
    """Name of the dimension along which the ground motions lie.

    Returns
    -------
    str, ``pgv_pga`` for pulses and ``record`` for records
    """
    return "record" if "record" in dataset.dims else "pgv_pga"


def split(dataset: xr.Dataset, size: str, sample: str = "sample") -> list[xr.Dataset]:
    """The records, runs or cases of a ragged dataset, each with its own samples.

    Parameters
    ----------
    size : str
        Variable that holds how many samples each has.
    """
    owner, ends = str(dataset[size].dims[0]), dataset[size].values.cumsum()
    spans = zip(ends - dataset[size].values, ends, strict=True)
    return [dataset.isel({owner: n, sample: slice(*span)}) for n, span in enumerate(spans)]


def netcdf(dataset: xr.Dataset) -> Writer:
    """Writer of a dataset as compressed NetCDF."""

    def write(path: Path) -> None:
        encoding: dict[str, dict[str, Any]] = {}
        for name, variable in dataset.variables.items():
            given = dict(variable.encoding)
            given.setdefault("_FillValue", None)
            if variable.dtype.kind in "fiu" and variable.ndim:
                given |= {"zlib": True, "complevel": 4}
            encoding[str(name)] = given
        try:
            # As to_netcdf does it, which loads all of dask to see which lock it would want.
            with closing(NetCDF4DataStore.open(str(path), mode="w", lock=_LOCK)) as file:
                dataset.dump_to_store(file, encoding=encoding)
        except RuntimeError as error:  # one way in which netCDF4 says that the disk is full
            raise OSError(str(error)) from error

    return write


def read(path: Path) -> xr.Dataset:
    """Read a product whole."""
    return xr.load_dataset(path, engine="netcdf4", mask_and_scale=False)
