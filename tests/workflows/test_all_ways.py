"""Every way through the program ends with a product that opens, or with a line that says why not.

A way is a product of a ground, shaken by a motion, in an engine, on some workers. Here go ways that
hold each pair of these, but for those that take longest. These go in the slow suite, as does each
three of these at a given time step, and each pair at one that is measured. Draws of what is
uncertain, of hundreds of runs, go two ways there.
"""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import xarray as xr
from conftest import Ran
from matplotlib.figure import Figure
from support import ways
from support.dask_processes import Farm
from support.ways import Way

from pipeline import ROOT
from pipeline.drawing import style
from pipeline.stages.displacement import timelapse
from pipeline.stages.mesh import scan_figures
from pipeline.stages.studies.accuracy import comparison, quantity_fronts, worker_tasks
from pipeline.stages.studies.servo import drive_runs
from pipeline.workflow.products import DELIVERABLES
from vsr_core.verification import reference

SCENES = {
    "ground": tuple(ways.GROUNDS),
    "motion": tuple(ways.MOTIONS),
    "engine": ways.ENGINES,
    "workers": ("none", "default", "scheduler"),
}
QUICK = ("fragility", "displacement", "study", "replay")
SLOW = ("uncertainty", "hazard", "accuracy", "drive", "feasible")

EMPTY = Figure(figsize=(0.1, 0.1))
"""In place of the pictures that take longest and have tests of their own."""

CURVES = ROOT / "data" / "raw" / "hazard" / "made_up"
SWEEP = "sweep: {turned: {yaw: [0, 30]}}\n"


@pytest.fixture(scope="module")
def quick_time_step() -> None:
    """The whole ladder of time steps: a shorter one would not reach the workers' processes."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the scans, the record and the sweep that all ways use."""
    place = tmp_path_factory.mktemp("ways")
    ways.write_scans(place)
    (place / "sweep.yaml").write_text(SWEEP)
    return place


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a scheduler with a worker."""
    with Farm(tmp_path_factory.mktemp("farm")) as farm:
        farm.worker()
        yield farm.address


@pytest.fixture
def go(
    vsr: Callable[..., Ran], folder: Path, derived: Path, scheduler: str
) -> Callable[[Way, str], None]:
    """Go a way at a time step; what is made of a terrain's scan is made once for each engine."""

    def to_the_end(way: Way, time_step: str) -> None:
        site = folder / "rock.yaml"
        site.write_text(ways.site(way, time_step))
        if way["ground"] == "terrain" and not ways.refusal(way):
            prepared = folder / way["engine"]
            if not prepared.exists():
                assert vsr("prep", "--site", site, into=prepared).code == 0
            shutil.copytree(prepared, derived)
        ran = vsr(*command(way, site, scheduler))
        key = ways.refusal(way)
        if key:
            assert ran.code == 2, ran.err
            told = [line for line in ran.err.splitlines() if line.startswith("vsr: ")]
            assert any(line.startswith(f"vsr: {site}: {key}") for line in told), ran.err
            assert all(line.count("; ") >= 2 for line in told), ran.err
        else:
            assert ran.code in (0, 1), ran.err
            opens(way, derived / "rock")

    return to_the_end


def command(way: Way, site: Path, scheduler: str) -> list[str]:
    """The command line of a way."""
    product, cell = way["product"], ["--yaw", "30", "--pga", "0.5"]
    row = ["--record", "shaking"] if way["motion"] == "record" else ["--pgv-pga", "0.2"]
    ratio = 0.052 if way["motion"] == "record" else 0.2  # of the one row
    more = {
        "study": ["--study", str(site.with_name("sweep.yaml"))],
        "hazard": [
            *("--curves", str(CURVES), "--age", "20"),  # of which few runs tell enough
            *("--set", f"hazard.pgv_pga={{pga: [0.3], median: [{ratio}], log_sd: [0.2]}}"),
        ],
        "replay": cell + row,
        "feasible": ["--table", "mini_shake_robot"],
    }.get(product, [])
    where = {"none": ["--workers", "0"], "scheduler": ["--scheduler", scheduler]}
    asked = [product] if product in ("replay", "feasible") else ["run", product]
    workers = [] if product == "feasible" else where.get(way["workers"], [])
    return [*asked, "--site", str(site), *more, *workers]


def opens(way: Way, made: Path) -> None:
    """Open what a way has made."""
    product = way["product"]
    if product in ("replay", "feasible"):
        shown = [
            path.name for path in made.rglob({"replay": "*.html", "feasible": "*.csv"}[product])
        ]
        assert shown
    else:
        shown = ["study.html", "study.nc"] if product == "study" else DELIVERABLES[product].shown
    for name in shown:
        (path,) = made.rglob(name)
        if path.suffix == ".nc":
            with xr.open_dataset(path) as data:
                assert data.data_vars
        elif path.suffix == ".csv":
            head, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
            assert {len(row) for row in rows} <= {len(head)}
        else:
            assert path.stat().st_size > 1000


LONG_RUN: Way = {"ground": "block", "motion": "record", "engine": "auto", "workers": "default"}
"""Its sample in Bullet is work for workers, which start while other stages are made."""


def told(way: Way) -> str:
    return "-".join(way.values())


DRAWS: tuple[Way, ...] = (
    {"ground": "block", "motion": "cosine", "engine": "bullet", "workers": "scheduler"},
    {"ground": "mesh", "motion": "record", "engine": "nonsmooth", "workers": "default"},
)

RICKER: Way = {"ground": "mesh", "motion": "ricker", "engine": "bullet", "workers": "none"}
"""To the program it is a sine of another shape: one way, and the slow suite's."""

QUICK_WAYS = [
    *ways.cover(
        {"product": QUICK, **SCENES}
        | {"motion": tuple(name for name in ways.MOTIONS if name != "ricker")},
        together=2,
    ),
    *({"product": "fragility", **scene} for scene in (LONG_RUN, RICKER)),
    *({"product": "uncertainty", **scene} for scene in DRAWS),
]


def takes_long(way: Way) -> bool:
    """Bullet on a terrain, which `test_displacement_product` has, too; draws; a whole report of a
    mesh, of which other products have every part."""
    many_steps = (way["ground"], way["engine"]) == ("terrain", "bullet")
    whole_report = (way["product"], way["ground"]) == ("fragility", "mesh")
    return many_steps or whole_report or way["product"] == "uncertainty"


@pytest.mark.usefixtures("few_samples")
@pytest.mark.parametrize(
    "way",
    [
        pytest.param(way, id=told(way), marks=[pytest.mark.slow] * takes_long(way))
        for way in QUICK_WAYS
    ],
)
def test_each_pair_has_a_way(
    way: Way, go: Callable[[Way, str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("separation", "closed_rock", "seat"):
        monkeypatch.setattr(scan_figures, name, lambda *given: EMPTY)
    monkeypatch.setattr(timelapse, "timelapse", lambda *given: EMPTY)
    monkeypatch.setattr(timelapse, "animation", lambda *given: style.png(EMPTY))
    go(way, "0.0015")


@pytest.fixture(scope="module")
def few_runs() -> Iterator[None]:
    """Of the studies that take a minute each: all of their steps, on few rows and cells."""
    with pytest.MonkeyPatch.context() as patch:
        for module, values in (
            (drive_runs, {"ROWS": 2, "LEVELS": 3, "HALVINGS": 1}),
            (comparison, {"CELLS": 6, "MOST_ROWS": 1, "STEPS": (1 / 500, 1 / 1000)}),
            (quantity_fronts, {"PULSES": 4}),
            (reference, {"cases": lambda cases=reference.cases: cases()[::10]}),
            (worker_tasks, {"BUDGET": 0.5}),
        ):
            for name, value in values.items():
                patch.setattr(module, name, value)
        yield


ALL = {"product": QUICK + SLOW, **SCENES}


@pytest.mark.slow
@pytest.mark.usefixtures("few_runs", "small_pictures")
@pytest.mark.parametrize("way", ways.cover(ALL, together=3), ids=told)
def test_each_three_have_a_way(way: Way, go: Callable[[Way, str], None]) -> None:
    go(way, "0.0015")


@pytest.mark.slow
@pytest.mark.usefixtures("few_runs", "small_pictures")
@pytest.mark.parametrize("way", ways.cover(ALL, together=2), ids=told)
def test_each_pair_has_a_way_at_a_measured_step(way: Way, go: Callable[[Way, str], None]) -> None:
    go(way, "auto")
