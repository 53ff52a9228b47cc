"""Datasets as products: units and names from the catalogue, provenance, and writing."""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Iterable
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
from xarray.backends import BackendArray, NetCDF4DataStore
from xarray.backends.common import ArrayWriter
from xarray.core import indexing

from pipeline.config.motion_schema import is_along_x
from pipeline.config.yaml_text import parse
from pipeline.workflow import pages
from pipeline.workflow.keys import installed_version
from pipeline.workflow.stage import Work
from pipeline.workflow.store import Store
from pipeline.workflow.writers import Writer
from vsr_core import outcome
from vsr_core.arrays import Array

if "dask" not in sys.modules:
    # At its first array xarray loads dask's arrays, to know them; there are none here.
    sys.modules["dask"] = cast(ModuleType, None)
    xr.Variable((), 0)
    del sys.modules["dask"]

Place = tuple[int | slice, ...]
"""Of a part of a grid: an index or a range along each of its dimensions."""

LARGE = 4_000_000
"""Bytes from which a variable is read by parts."""

_LOCK = Lock()
"""Of the NetCDF library, which does one thing at a time."""

_VERSIONS = ("vsr", "numpy", "scipy", "xarray")

IN_G = "g is standard gravity, 9.80665 m s-2; UDUNITS would read gram"

_ENGINES = {"bullet": "PyBullet", "mujoco": "MuJoCo", "nonsmooth": "numba"}
"""Libraries of the engines."""


def is_shaken_along_x(data: xr.Dataset) -> bool:
    """Whether the motions of the settings that a dataset was made with are along x alone."""
    motion = json.loads(data.attrs.get("vsr_config_json", "{}")).get("motion")
    return motion is None or is_along_x(motion)


@cache
def catalogue() -> dict[str, dict[str, str]]:
    """Every variable of every dataset."""
    return dict(parse(pages.source("catalogue.yaml")))  # refuses a name given twice


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
        attributes: dict[str, Any] = {"long_name": entry["long_name"]}
        if dataset[name].dtype.kind not in "OU":  # a text has no unit
            attributes["units"] = entry["units"]
        if "g" in entry["units"].split():
            attributes["comment"] = IN_G
        if "flags" in entry:
            flags = list(getattr(outcome, entry["flags"]))
            kind = dataset[name].dtype  # CF: of the variable's own type
            attributes["flag_values"] = np.array([flag.value for flag in flags], kind)
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


@dataclass(frozen=True)
class Opened(Stored):
    """The same of one that may be larger than memory: what is looked at is read, when it is."""

    @cached_property
    def data(self) -> xr.Dataset:
        """The dataset; each look at a part of a large variable reads that part."""
        return opened(self.folder / self.FILE)


def rows_of(dataset: xr.Dataset) -> str:
    """Name of the dimension along which the ground motions lie.

    Returns
    -------
    str, ``pgv_pga`` for pulses and ``record`` for records
    """
    return "record" if "record" in dataset.dims else "pgv_pga"


def open_below(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A variable; 0 for a first-overturning PGA below all that was run, of which one is assumed."""
    lower = dataset.get(f"{name}_lower")
    if lower is None:
        return dataset[name]
    return dataset[name].where(lower.notnull() | ~np.isfinite(dataset[name]), 0.0)


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


def unwritten(dims: tuple[str, ...], shape: tuple[int, ...], dtype: str) -> xr.Variable:
    """A variable of numbers whose values are written by parts and not held; -1 or NaN is none."""
    kind = np.dtype(dtype)
    fill = kind.type(-1 if kind.kind == "i" else np.nan)
    return xr.Variable(dims, np.broadcast_to(fill, shape), {"_FillValue": fill})


def netcdf(
    dataset: xr.Dataset, parts: Iterable[tuple[Place, dict[str, Array]]] = (), at_once: Place = ()
) -> Writer:
    """Writer of a dataset as compressed NetCDF.

    Parameters
    ----------
    parts : iterable of (place, values by name), of all variables that are ``unwritten``
    at_once : tuple of int, size of a part, in which these are compressed and read
    """

    def write(path: Path) -> None:
        apart = [str(n) for n, one in dataset.variables.items() if "_FillValue" in one.attrs]
        encoding: dict[str, dict[str, Any]] = {}
        for name, variable in dataset.variables.items():
            given = dict(variable.encoding)
            given.setdefault("_FillValue", None)
            if variable.dtype.kind in "fiu" and variable.ndim:
                given |= {"zlib": True, "complevel": 4}
            if name in apart:
                given |= {"chunksizes": at_once}
            encoding[str(name)] = given
        try:
            # As to_netcdf does it, which loads all of dask to see which lock it would want.
            with closing(NetCDF4DataStore.open(str(path), mode="w", lock=_LOCK)) as file:
                dataset.dump_to_store(file, encoding=encoding, writer=_Others(apart))
                file.ds.set_auto_maskandscale(False)
                for place, values in parts:
                    for name, part in values.items():
                        file.ds[name][place] = part
        except RuntimeError as error:  # one way in which netCDF4 says that the disk is full
            raise OSError(str(error)) from error

    return write


class _Others(ArrayWriter):
    """Writes all variables but some."""

    def __init__(self, apart: list[str]) -> None:
        super().__init__()
        self._apart = apart

    def add(self, source: Any, target: Any, region: Any = None) -> None:
        if target.variable_name not in self._apart:
            super().add(source, target, region)


def read(path: Path) -> xr.Dataset:
    """Read a product whole."""
    return xr.load_dataset(path, engine="netcdf4", mask_and_scale=False)


def opened(path: Path) -> xr.Dataset:
    """Open a product, of which large variables are read when looked at, as far as looked at."""
    with xr.open_dataset(path, engine="netcdf4", mask_and_scale=False) as file:
        large = [name for name, one in file.data_vars.items() if one.nbytes > LARGE]
        whole = file.drop_vars(large).load()
        for name in large:
            one = file[name].variable
            values = indexing.LazilyIndexedArray(_InFile(path, str(name), one.shape, one.dtype))
            whole[name] = xr.Variable(one.dims, values, one.attrs, one.encoding)
        return whole[list(file.data_vars)]


@dataclass(frozen=True)
class _InFile(BackendArray):
    """Values of a variable; the file is open only while some of them are read."""

    path: Path
    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        support = indexing.IndexingSupport.OUTER
        return indexing.explicit_indexing_adapter(key, self.shape, support, self._read)

    def _read(self, key: tuple[Any, ...]) -> Any:
        with closing(NetCDF4DataStore.open(str(self.path), mode="r", lock=_LOCK)) as file:
            variable = file.ds[self.name]
            variable.set_auto_maskandscale(False)
            with _LOCK:
                return variable[key]
