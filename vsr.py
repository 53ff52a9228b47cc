"""The virtual shake robot from Python: a rock and its shaking in, an xarray dataset out.

Products are made by the same stages, from the same store and under the same keys as by the command
``vsr run``; what exists is read.

>>> import vsr
>>> fragility = vsr.fragility("double_rock", yaw=[0, 90])  # doctest: +SKIP
>>> block = vsr.box(1.0, 1.0, 2.0, density=2110)
>>> responses = vsr.responses(block, vsr.pulses([0.3, 0.5], [0.2]))  # doctest: +SKIP
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import commands
from pipeline.cli import renew_index
from pipeline.config.outside import content
from pipeline.config.paths import working_folder
from pipeline.config.problems import InputError as InputError
from pipeline.config.problems import Problem
from pipeline.config.yaml_text import in_yaml
from pipeline.workflow import graph, option_values, output
from pipeline.workflow.cluster import GUARDED
from pipeline.workflow.command_line import parsed
from pipeline.workflow.jobs import job_of
from pipeline.workflow.keys import digest
from pipeline.workflow.log import complain
from pipeline.workflow.products import DELIVERABLES
from vsr_core.source import tracing

if TYPE_CHECKING:
    import xarray as xr

tracing.texts()  # what is edited later is not what is imported here

Settings = Mapping[str, Any]
"""Keys of the configuration, as in a site's YAML."""

Site = str | os.PathLike[str] | Settings

_ONE_AT_A_TIME = threading.Lock()
"""Threads of a process own the same folders and files."""

WITHOUT_DATASET = ("stability", "geodata", "model")
"""Products that are files of other kinds."""


def box(x: float, y: float, z: float, density: float) -> Settings:
    """A block [m, kg m-3] as a site."""
    return {"rock": {"shape": "box", "size": [x, y, z], "density": density}}


def mesh(scan: str | os.PathLike[str], density: float, **more: Any) -> Settings:
    """A scanned rock [kg m-3] as a site; ``more`` are other keys of ``rock``, e.g. ``scale``."""
    return {
        "rock": {"shape": "mesh", "mesh": str(Path(scan).resolve()), "density": density, **more}
    }


def pulses(pga: Any, pgv_pga: Any, kind: str = "cosine_pulse") -> Settings:
    """A grid of pulses.

    Parameters
    ----------
    pga, pgv_pga : number, sequence, array or mapping with start, stop and num [g, s]
    """
    return {"motion": {"kind": kind, "pga": pga, "pgv_pga": pgv_pga}}


def records(files: Any, pga: Any, **more: Any) -> Settings:
    """Recorded motions, each scaled to every PGA [g]; ``more`` are other keys of ``motion``."""
    paths = [files] if isinstance(files, str | os.PathLike) else files
    given = {"order": "none", "highpass": None, "lowpass": None}
    found = [str(Path(path).resolve()) for path in paths]
    return {"motion": {"kind": "record", "files": found, "pga": pga, "processing": given, **more}}


def run(
    product: str,
    site: Site,
    *layers: Settings,
    name: str | None = None,
    study: str | os.PathLike[str] | None = None,
    derived: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    **keys: Any,
) -> xr.Dataset:
    """Make a product and open its dataset.

    Parameters
    ----------
    product : str, as of ``vsr run``; with a ``study`` that sweeps, the dataset is that of the study
    site : name of a shipped site, path of a YAML file, or its content; for ``validation`` the
        folder of recorded tests
    layers : settings over those of the site and the study; each key in one of them, or in ``keys``
    name : str, of the folder of results where the site is given by its content, by default
        ``rock``; of any other site that of a variant, which has a folder of its own, as by
        ``--name`` of the command
    derived : folder of results, by default ``data/derived`` of the working folder
    keys : sections or keys of the configuration, as another layer, e.g. ``yaw=[0, 90]``

    Raises
    ------
    InputError
        For what ``vsr run`` refuses, and for a name whose YAML in the folder of results is of
        another's hand; its text has one line for each problem.
    """
    import xarray

    from pipeline.inspection import in_notebook

    if workers != 0 and getattr(multiprocessing.current_process(), "_inheriting", False):
        complain(f"vsr: a worker process of its own ends: {GUARDED}")
        raise SystemExit(2)
    if product in WITHOUT_DATASET:
        rule, remedy = "it has no dataset", f"use the command vsr run {product}"
        raise InputError(Problem("vsr.run", "", product, rule, remedy))
    folder = working_folder() / "data" / "derived"
    if derived is not None:
        folder = option_values.folder(_path("derived", derived))
    settings: list[str] = []
    for layer in (*layers, keys):
        if not isinstance(layer, Mapping):
            rule, remedy = "a layer is a dict of settings", "e.g. {'yaw': 30}"
            raise InputError(Problem("vsr.run", "layers", f"{layer!r:.60}", rule, remedy))
        for key, value in layer.items():
            settings += ["--set", f"{key}={in_yaml(_plain(value))}"]
    if not isinstance(site, str | os.PathLike | Mapping):
        rule, remedy = "it is a name, a path or a dict", "e.g. double_rock"
        raise InputError(Problem("vsr.run", "site", f"{site!r:.60}", rule, remedy))
    file: Callable[[], str | os.PathLike[str]]
    if isinstance(site, Mapping):
        own = "rock" if name is None else name
        file, variant = partial(_written, folder.absolute(), own, _plain(site)), []
    else:
        file, variant = partial(os.fspath, site), [] if name is None else [f"--name={name}"]
    given = "--table" if product == "validation" else "--site"
    with _ONE_AT_A_TIME:
        words = [given, os.fspath(file()), *variant, *settings]
        words += [] if study is None else ["--study", _path("study", study)]
        words += [] if workers is None else ["--workers", str(workers)]
        job, _ = commands.made(parsed(["run", product, *words, "--derived", str(folder)]))
        study_of_sweep = job.store.folder / "study.nc"
        of_rock = job.store.folder / f"{'fragility' if product == 'report' else product}.nc"
        made = study_of_sweep if study_of_sweep.exists() else of_rock
        words += ["--derived", str(folder.absolute())]
        if product != "validation":
            of = "" if made == study_of_sweep else DELIVERABLES[product].stage
            key = (job.store.manifest(of) or {"key": ""})["key"] if of else ""
            in_notebook.MADE[made.resolve()] = partial(_replayed, file, words, of, key)
        renew_index(folder)
        return xarray.load_dataset(made)


def _written(folder: Path, name: str, site: Settings) -> Path:
    """A site's content as a file: JSON, which is YAML, too; never over one by another hand."""
    path = folder / f"{name}.yaml"
    plain = isinstance(name, str) and name.isprintable() and f"{name}."[0] != "."
    if path.parent != folder or not plain:
        rule, remedy = "results go to a folder of that name", "give a plain name, such as rock"
        raise InputError(Problem("vsr.run", "name", repr(name), rule, remedy))
    if os.path.lexists(path) and not _is_of_content(path):
        rule = "only what vsr.run wrote is written over"
        remedy = "give its path as the site, or another name=, or remove it"
        raise InputError(Problem(str(path), "", "a file by another hand", rule, remedy))

    def write(part: Path) -> None:
        part.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(_signed(in_yaml(site, indent=1)), encoding="utf-8")

    output.put("vsr.run", path, write)
    return path


def _signed(plain: str) -> str:
    """A text below its digest, by which a change by hand is seen."""
    return f"# written by vsr.run: {digest(plain)}\n{plain}"


def _is_of_content(path: Path) -> bool:
    """Whether a file is as it was written here."""
    try:
        text = content(path).decode()
    except (InputError, ValueError):
        return False
    return text == _signed(text.partition("\n")[2])


def _replayed(
    file: Callable[[], object], words: list[str], stage: str, key: str, **coordinates: Any
) -> Path:
    """Page that replays a run of what was made of a file with some words of the command line."""
    at = (f"--{name.replace('_', '-')}={_plain(value)}" for name, value in coordinates.items())
    with _ONE_AT_A_TIME:
        file()  # which may have the content of another site by now
        options = parsed(["replay", *words, *at])
        if not stage:
            rule = "a run of one rock is replayed"
            remedy = "make one member, with what is swept as a setting of its own"
            raise InputError(Problem("vsr.replay", words[1], "a dataset of a sweep", rule, remedy))
        if graph.identities(stage, job_of(options).site)[stage].key != key:
            given = "other files or settings than those of this dataset, or another working folder"
            rule, remedy = "a run is replayed as it was in its dataset", "make the dataset again"
            raise InputError(Problem("vsr.replay", words[1], given, rule, remedy))
        return commands.replayed(options)


def _plain(value: Any) -> Any:
    """Arrays, tuples and paths as what JSON has."""
    if hasattr(value, "to_numpy") and value.ndim < 2:  # such as a coordinate of another dataset
        value = value.to_numpy()
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str | bytes | bytearray):
        return [_plain(one) for one in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    rule, remedy = "a value is a number, a text, or a list or dict of them", "write it so"
    raise InputError(Problem("vsr.run", "", f"{value!r:.60}", rule, remedy))


def _path(key: str, given: Any) -> str:
    """A path that a parameter gives, as text."""
    text = os.fspath(given) if isinstance(given, str | os.PathLike) else None
    if isinstance(text, str) and "\0" not in text:
        return text
    rule, remedy = "it is a name or a path", "write it as a text"
    raise InputError(Problem("vsr.run", key, f"{given!r:.60}", rule, remedy))


def responses(site: Site, *layers: Settings, **options: Any) -> xr.Dataset:
    """How each run ended: dimensions yaw, friction, pgv_pga and pga."""
    return run("responses", site, *layers, **options)


def fragility(site: Site, *layers: Settings, **options: Any) -> xr.Dataset:
    """First-overturning PGA and fitted fragility models of each yaw and friction."""
    return run("fragility", site, *layers, **options)


def displacement(site: Site, *layers: Settings, **options: Any) -> xr.Dataset:
    """Trajectories of large displacements, over a terrain."""
    return run("displacement", site, *layers, **options)


def uncertainty(site: Site, *layers: Settings, **options: Any) -> xr.Dataset:
    """Probability of overturning over the prior distributions of rock and shaking."""
    return run("uncertainty", site, *layers, **options)


def hazard(
    site: Site,
    *layers: Settings,
    curves: str | os.PathLike[str] | None = None,
    events: str | os.PathLike[str] | None = None,
    **options: Any,
) -> xr.Dataset:
    """Survival probability of the rock under each branch of a hazard model.

    Parameters
    ----------
    curves, events : path of its curves, or events, from the working folder; by default those of
        the site
    """
    if curves is not None or events is not None:
        given = {"hazard.curves": curves, "hazard.events": events}
        found = {key: path and Path(_path(key, path)).resolve() for key, path in given.items()}
        layers += (found,)
    return run("hazard", site, *layers, **options)


if __name__ == "__main__":
    from pipeline.__main__ import program

    raise SystemExit(program())
