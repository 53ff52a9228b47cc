"""What datasets of the Python way show of themselves in a notebook, as ``dataset.vsr``."""

from __future__ import annotations

import html
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from pipeline.config.problems import InputError, Problem
from pipeline.drawing.style import png
from pipeline.stages.displacement.trajectory_maps import trajectories
from pipeline.stages.fragility.fragility_figures import fragility_by_yaw, overturning_diagram
from pipeline.stages.fragility.summary import groups
from pipeline.workflow.datasets import read

PAGES = {"fragility": "report.html", "responses": "report.html", "boundary": "report.html"}
"""Pages of datasets that have another name than theirs."""

MADE: dict[Path, Callable[..., Path]] = {}
"""Of each dataset made here, what replays a run of it: a function of coordinates in words."""


class Page:
    """A page that stands in a notebook below the cell that gives it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def _repr_html_(self) -> str:
        page = html.escape(self.path.read_text(encoding="utf-8"))
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

    def _repr_html_(self) -> str:
        return self.page._repr_html_()

    @property
    def page(self) -> Page:
        """The page of the product.

        Raises
        ------
        InputError
            If it was not made.
        """
        own = self._path.stem
        page = self._path.with_name(PAGES.get(own, f"{own}.html"))
        if not page.is_file():
            remedy = "make it, e.g. vsr.run('report', site)"
            raise InputError(Problem("vsr", "", str(page), "the page is there", remedy))
        return Page(page)

    def plot(self, yaw: float | None = None, friction: float | None = None) -> Figure:
        """The figure of the product.

        Of a fragility that is the overturning diagram of one yaw [degree] and friction, and
        without a yaw the boundary around the circle; of a displacement the map of all paths.

        Raises
        ------
        InputError
            If the dataset has no figure of its own, or no such yaw or friction.
        """
        figure = self._figure(yaw, friction)
        vars(figure)["_repr_png_"] = partial(png, figure)  # by which a notebook shows it
        return figure

    def _figure(self, yaw: float | None, friction: float | None) -> Figure:
        folder, kind = self._path.parent, self._path.stem
        if kind == "displacement":
            terrain = read(folder / "terrain.nc")
            return trajectories(self._dataset, terrain, terrain.attrs.get("source", ""))
        if kind != "fragility":
            rule = "fragility and displacement have a figure"
            raise InputError(Problem("vsr.plot", "", kind, rule, "see its page, .vsr.page"))
        fragility = self._dataset
        if yaw is None and fragility.sizes["yaw"] > 1:
            return fragility_by_yaw(fragility, read(folder / "rock.nc"))
        place = _at(fragility, "yaw", yaw), _at(fragility, "friction", friction)
        return overturning_diagram(
            read(folder / "responses.nc"), fragility, place, dict(groups(fragility))[place]
        )

    def replay(self, **coordinates: float | str) -> Page:
        """The page that replays one run, at its yaw [degree], pga [g], pgv_pga [s] and friction.

        Raises
        ------
        InputError
            For what ``vsr replay`` refuses, and for a dataset that was not made by this module.
        """
        if self._path not in MADE:
            rule = "it was made, or read, by a function of vsr"
            raise InputError(Problem("vsr.replay", "", str(self._path), rule, "call vsr.run"))
        return Page(MADE[self._path](**coordinates))


def _at(data: xr.Dataset, name: str, value: float | None) -> int:
    """Place of a value along a dimension; of none, the first."""
    values = data[name].values
    places = np.flatnonzero(np.isclose(values, values[0] if value is None else value))
    if not len(places):
        rule = f"it is one of {', '.join(f'{one:g}' for one in values)}"
        raise InputError(Problem("vsr.plot", name, f"{value:g}", rule, "give one of these"))
    return int(places[0])
