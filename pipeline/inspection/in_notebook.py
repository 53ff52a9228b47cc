"""What datasets of the Python way show of themselves in a notebook, as ``dataset.vsr``."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import netCDF4
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import png
from pipeline.inspection.in_short import in_short, with_places
from pipeline.stages.displacement.trajectory_maps import trajectories
from pipeline.stages.fragility.fragility_figures import fragility_by_yaw, overturning_diagram
from pipeline.stages.fragility.summary import groups
from pipeline.stages.hazard.hazard_figures import survival
from pipeline.workflow.datasets import opened, read, rows_of
from pipeline.workflow.site_folder import remade
from pipeline.workflow.store import Store

PAGES = {"fragility": "report.html", "responses": "report.html", "boundary": "report.html"}
"""Pages of datasets that have another name than theirs."""

MADE: dict[Path, Callable[..., Path]] = {}
"""Of each dataset made here, what replays a run of it: a function of coordinates in words."""

_PLACES = {"yaw", "friction"}
_PARTS = _PLACES | {"pgv_pga", "record", "pga", "branch"}
"""Dimensions a part of which has a figure."""

_BACK = re.compile(r'<nav class="back">.*?</nav>', re.DOTALL)
_TO_A_FILE = re.compile(r'<a href="(?!#|\w+:)[^"]*">(.*?)</a>', re.DOTALL)


class Page:
    """A page that stands in a notebook below the cell that gives it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def _repr_html_(self) -> str:
        page = _BACK.sub("", self.path.read_text(encoding="utf-8"))
        page = html.escape(_TO_A_FILE.sub(r"\1", page))  # from a notebook no link leads to a file
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 40rem; border: 0"></iframe>'


@xr.register_dataset_accessor("vsr")
class Shown:
    """A product of a study: its page, its figure, and its runs."""

    def __init__(self, dataset: xr.Dataset) -> None:
        source = dataset.encoding.get("source", "")
        self._dataset, self._path = dataset, Path(source).resolve()
        if "vsr_key" not in dataset.attrs or not self._path.is_file():
            rule = "it is a dataset of a product, as vsr.run returns it"
            raise InputError(Problem("vsr", "", source, rule, "ask the dataset that it is made of"))

    def _check_folder(self, *, beside: bool = True) -> tuple[dict[str, int], set[str]]:
        """Refuse a dataset whose folder has come to hold another result since.

        Parameters
        ----------
        beside : bool, whether what it was made of is to be beside it still

        Returns
        -------
        dict, sizes of the file's dimensions
        set, those of them along which it is not known where the dataset is, or it is over all
        """
        if not self._path.is_file():
            holds = "no such file any more"
        else:
            with netCDF4.Dataset(self._path) as file:
                same = getattr(file, "vsr_key", "") == self._dataset.attrs["vsr_key"]
                sizes = {name: one.size for name, one in file.dimensions.items()}
                lost = {*sizes} & {*file.variables} - {*map(str, self._dataset.coords)}
            anew = remade(self._path.stem, Store(self._path.parent).manifests()) if beside else ""
            if same and not anew:
                return sizes, lost
            holds = f"another {anew or 'result'} than that of this dataset"
        remedy = "make it again, and give each rock in a notebook its own name="
        rule = "a dataset shows what is in its folder"
        raise InputError(Problem(str(self._path), "", holds, rule, remedy))

    def _repr_html_(self) -> str:
        """The page, or in short what the dataset holds where none was made."""
        page = self._page()
        if page.path.is_file():
            return page._repr_html_()
        _, lost = self._check_folder()
        return in_short(self._dataset, self._path, is_of_runs=not lost)

    @property
    def page(self) -> Page:
        """The page of the product.

        Raises
        ------
        InputError
            If it was not made.
        """
        page = self._page()
        if not page.path.is_file():
            rule, remedy = f"{page.path} was not made", "see the dataset itself"
            if self._path.stem in PAGES:
                remedy = "call vsr.fragility(...) with the same settings"
            raise InputError(Problem("vsr.page", "", "", rule, remedy))
        return page

    def _page(self) -> Page:
        self._check_folder(beside=False)
        own = self._path.stem
        return Page(self._path.with_name(PAGES.get(own, f"{own}.html")))

    def plot(self, yaw: float | None = None, friction: float | None = None) -> Figure:
        """The figure of the product.

        Of a fragility that is the overturning diagram of one yaw [degree] and friction, and
        without a yaw the boundary around the circle; of responses the cells of one yaw and
        friction; of a displacement the map of all paths; of a hazard survival against age.

        Raises
        ------
        InputError
            If the dataset has no figure of its own, or no such yaw or friction.
        """
        figure = self._figure(yaw, friction)
        vars(figure)["_repr_png_"] = partial(png, figure)  # by which a notebook shows it
        return figure

    def _figure(self, yaw: float | None, friction: float | None) -> Figure:
        folder, kind, (sizes, lost) = self._path.parent, self._path.stem, self._check_folder()
        for key, given, rule, remedy in _faults(self._dataset, kind, sizes, lost):
            raise InputError(Problem("vsr.plot", key, given, rule, remedy))
        if kind == "displacement":
            terrain, rock = read(folder / "terrain.nc"), read(folder / "rock.nc")
            # as it is in the file: samples are of runs in that order
            return trajectories(read(self._path), terrain, rock.attrs["shape_source"])
        if kind == "hazard":
            settings = json.loads(self._dataset.attrs["vsr_config_json"])["hazard"]
            return survival(self._in_order(), settings["minimum_survival_probability"])
        data = with_places(self._in_order())
        place = _at(data, "yaw", yaw), _at(data, "friction", friction)
        if kind == "fragility" and yaw is None and data.sizes["yaw"] > 1:
            chosen = data if friction is None else data.isel(friction=[place[1]])
            return fragility_by_yaw(chosen, read(folder / "rock.nc"))
        name, fits = dict(groups(data))[place], None
        one = data.isel(yaw=[place[0]], friction=[place[1]])
        if kind == "fragility":
            same = {name: one[name].values for name in ("yaw", "friction", rows_of(one))}
            try:
                one, fits = read(folder / "responses.nc").sel(same), one
            except KeyError:
                rule, remedy = "it is of the runs beside it", "plot the dataset as it was made"
                raise InputError(Problem("vsr.plot", "", name, rule, remedy)) from None
        return overturning_diagram(one, fits, (0, 0), name)

    def _in_order(self) -> xr.Dataset:
        """The dataset with dimensions in the order of its file, and numbers along them ascending.

        What has words along it, such as the ends of intervals, is as in the file, too.

        Raises
        ------
        InputError
            If variables of the file are not in it, or are along more than there.
        """
        order = opened(self._path)
        if gone := sorted(map(str, order.data_vars.keys() - self._dataset.data_vars.keys())):
            rule, remedy = "the figure needs all variables", "plot the whole dataset"
            raise InputError(Problem("vsr.plot", gone[0], "", rule, remedy))

        def placed(one: xr.DataArray) -> xr.DataArray:
            if more := {*one.dims} - {*order[one.name].dims}:
                rule = "the figure needs variables along the dimensions of their file"
                key, given = str(one.name), f"values along {', '.join(sorted(map(str, more)))}"
                raise InputError(Problem("vsr.plot", key, given, rule, "plot the whole dataset"))
            return one.transpose(*(name for name in order[one.name].dims if name in one.dims))

        own = self._dataset[[*order.data_vars]].map(placed, keep_attrs=True)
        numbers = [name for name, along in own.indexes.items() if along.dtype.kind == "f"]
        words = {name: order[name].values for name in own.indexes.keys() - {*numbers, *_PARTS}}
        return own.sel(words).sortby(numbers)

    def replay(self, **coordinates: float | str) -> Page:
        """The page that replays one run, at its yaw [degree], pga [g], pgv_pga [s] and friction.

        Raises
        ------
        InputError
            For what ``vsr replay`` refuses, and for a dataset that was not made by this module.
        """
        self._check_folder()
        if self._path not in MADE:
            given = f"{self._path}, of which only the file is known here"
            rule = "a run is replayed with the settings with which vsr made its dataset"
            remedy = "call vsr.fragility(...) first, which reads what exists"
            raise InputError(Problem("vsr.replay", "", given, rule, remedy))
        return Page(MADE[self._path](**coordinates))


def _faults(
    data: xr.Dataset, kind: str, sizes: dict[str, int], lost: set[str]
) -> Iterator[tuple[str, str, str, str]]:
    """Why a dataset, or a part of one, cannot be drawn: key, given, rule and remedy.

    Parameters
    ----------
    sizes, lost : as of ``Shown._check_folder``
    """
    if kind not in ("fragility", "responses", "displacement", "hazard"):
        rule = "responses, fragility, displacement and hazard have a figure"
        yield "", kind, rule, "plot its variables"
    if kind == "displacement" and dict(data.sizes) != sizes:
        rule = "the figure needs all runs and their samples"
        yield "", "a part of the dataset", rule, "plot the whole dataset"
    if differ := {*map(str, data.sizes)} - _PLACES ^ {*sizes} - _PLACES:
        rule = "the figure needs all dimensions but yaw and friction, and no other"
        yield ", ".join(sorted(differ)), "", rule, "select along yaw and friction only"
    if lost:
        rule = "the figure is of known places along each axis"
        yield ", ".join(sorted(lost)), "dropped, or averaged over", rule, "plot the whole dataset"
    if short := sorted(name for name in sizes if _is_short(data, name, sizes[name])):
        rule = "the figure needs all that is along it"
        yield ", ".join(short), "a part", rule, "plot the whole dataset"
    if twice := sorted(name for name in sizes if _is_twice(data, name)):
        rule = "the figure has each value of an axis once"
        yield ", ".join(twice), "values twice", rule, "plot the whole dataset"


def _is_short(data: xr.Dataset, name: str, size: int) -> bool:
    """Whether nothing is left along a dimension, or a part where no part has a figure."""
    held = data.sizes.get(name, 1)
    return held == 0 or (held != size and name not in _PARTS)


def _is_twice(data: xr.Dataset, name: str) -> bool:
    """Whether a value stands twice along a dimension."""
    return name in data.indexes and not data.indexes[name].is_unique


def _at(data: xr.Dataset, name: str, value: float | None) -> int:
    """Place of a value along a dimension; of none, the first."""
    values = data[name].values
    try:
        sought = float(values[0] if value is None else value)
    except (TypeError, ValueError):
        sought = np.nan
    places = np.flatnonzero(np.isclose(values, sought))
    if not len(places):
        given = repr(value) if np.isnan(sought) else f"{sought:g}"
        rule = f"it is one of {', '.join(f'{one:g}' for one in values)}"
        raise InputError(Problem("vsr.plot", name, given, rule, "give one of these"))
    return int(places[0])
