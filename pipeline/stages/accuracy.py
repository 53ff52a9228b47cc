"""Accuracy: error of the boundary against CPU time, of this project and of other ways.

The products hold CPU times, which are their subject: unlike all others they differ from call to
call.
"""

from __future__ import annotations

import csv
import random
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import ROOT
from pipeline.cluster import Batch
from pipeline.datasets import described, netcdf, read
from pipeline.keys import digest_file
from pipeline.layers import Site
from pipeline.scenes import RUN_CODE, prepared
from pipeline.stage import Job, Product, Stage
from pipeline.stages.precision import FILE as PRECISION
from pipeline.stages.precision import rows_of, time_step
from vsr_core import GRAVITY
from vsr_core.errors import Unfit
from vsr_core.outcome import Outcome

if TYPE_CHECKING:
    import xarray as xr

    from vsr_core.comparison import Target
    from vsr_core.scene import Rock

FILE, TABLE, PAGE, PICTURE = "accuracy.nc", "accuracy.csv", "accuracy.html", "work_precision"

MOST_ROWS = 4
"""Rows on which ways of running are compared; some take seconds a run."""

CELLS = 160
"""Cells of the grid that are run in every engine and at a sixteenth of the step."""

STEPS = tuple(1.0 / n for n in (240, 480, 1000, 2000, 4000, 8000, 16000, 32000))
"""Time steps of the reference suite [s]."""

COLUMNS = ("part", "method", "setting", "error", "worst", "rows", "cpu_s", "lost", "note")

TEMPLATE = Path(__file__).parents[1] / "templates" / PAGE

Record = dict[str, Any]
Place = tuple[float, float]  # yaw [degree], PGV/PGA [s]


def make(job: Job) -> Product:
    """Compare ways of running on the site's own rows, and run the reference suite."""
    from vsr_core import peers

    targets = _targets(job)
    records = _scores(job, targets)
    cells = _cells(job)
    records += _agreement(cells)
    records += _suite(job)
    records += [
        _record("method", peers.load(name).LABEL, note=f"not installed: {', '.join(absent)}")
        for name in peers.names()
        if (absent := peers.missing(name))
    ]
    from pipeline.accuracy_page import page, pictures

    chosen = read(job.path(PRECISION))
    text = page(job.site.name, job.config, records, targets, chosen, TEMPLATE.read_text("utf-8"))
    files = {
        FILE: netcdf(described(_dataset(targets, cells), job, "Accuracy")),
        TABLE: lambda path: _write_table(path, records),
        PAGE: lambda path: _write(path, text),
        **pictures(PICTURE, records, job.config.simulation.tolerance, job.site.name),
    }
    return Product(files, _summary(records))


def installed() -> tuple[str, ...]:
    """Engines whose library is there, the default first."""
    from vsr_core import engines

    found = []
    for name in engines.names():
        try:
            engines.load(name)
        except Unfit:
            continue
        found.append(name)
    return tuple(found)


def _places(rock: Rock) -> list[Place]:
    """At most ``MOST_ROWS`` rows: each direction once, short and long pulses in turn."""
    from vsr_core import precision

    rows = rows_of(rock)
    if len(rows) <= MOST_ROWS:
        return list(rows)
    yaws = sorted({yaw for yaw, _ in rows})
    periods = precision.periods(rock)
    return [(yaw, periods[at % len(periods)]) for at, yaw in enumerate(yaws)][:MOST_ROWS]


def _targets(job: Job) -> dict[Place, Target]:
    from pipeline import measuring
    from pipeline.stages.rock import load_rock

    rock, _ = load_rock(job.store)
    friction = job.config.contact.friction[0]
    names = installed()
    batches = (Batch(place, str(place[0]), ((place[1], names),)) for place in _places(rock))
    job.log("accuracy: references of the boundaries")
    done = job.cluster.run(
        measuring.find_target,
        batches,
        lambda yaw: prepared(job.config, job.store, float(yaw), friction),
    )
    found = {batch.tag: results[0] for batch, results in done if results is not None}
    return {place: wanted for place, wanted in sorted(found.items()) if wanted.right}


def _scores(job: Job, targets: dict[Place, Target]) -> list[Record]:
    """Every way of running on every row, summed up over the rows."""
    from pipeline import measuring
    from vsr_core import peers, sweep

    shape = prepared(job.config, job.store, 0.0, job.config.contact.friction[0]).full.rock.shape
    engine = job.config.simulation.engine
    ways = [("project", name) for name in installed()]
    ways += [("peer", name) for name in peers.names() if not peers.missing(name)]
    ways += [
        ("sweep", str(number))
        for number, variation in enumerate(sweep.variations())
        if engine in variation.engines and shape in variation.shapes
    ]

    def batches() -> Iterator[Batch]:
        for way in ways:
            for place in targets:
                yield Batch(place, f"{place[0]}/{place[1]}", (way,))

    job.log(f"accuracy: {len(ways)} ways of running on {len(targets)} boundaries")
    scored: dict[tuple[str, str, str], list[Any]] = defaultdict(list)
    shared = partial(_shared, job, targets)
    for _, results in job.cluster.run(measuring.score, batches(), shared):
        for result in (results or [[]])[0]:
            scored[result[:3]].append(result.score)
    return [
        _record(
            part,
            method,
            setting,
            error=_kept([score.error for score in scores]),
            worst=max(score.error for score in scores),
            rows=len(scores),
            cpu_s=sum(score.seconds for score in scores) / len(scores),
            lost=sum(score.lost for score in scores),
        )
        for (part, method, setting), scores in sorted(scored.items())
    ]


def _shared(job: Job, targets: dict[Place, Target], name: str) -> Any:
    from vsr_core.simulate import Settings

    yaw, pgv_pga = map(float, name.split("/"))
    friction = job.config.contact.friction[0]
    case = prepared(job.config, job.store, yaw, friction)
    simulation = job.config.simulation
    step = time_step(job.config, job.store, friction)
    settings = Settings(step, simulation.reduce, simulation.engine)
    return case, targets[yaw, pgv_pga], settings


def _kept(errors: list[float]) -> float:
    import numpy as np

    from vsr_core import precision

    return float(np.quantile(errors, precision.KEPT_BY, method="inverted_cdf"))


def _cells(job: Job) -> list[Record]:
    """Random cells of the grid in every engine, and at a sixteenth of the step."""
    from pipeline import measuring
    from vsr_core.simulate import Settings

    config, friction = job.config, job.config.contact.friction[0]
    step = time_step(config, job.store, friction)
    names = installed()
    every = [Settings(step, config.simulation.reduce, name) for name in names]
    every.append(Settings(step / 16.0, config.simulation.reduce, config.simulation.engine))
    rng = random.Random(1)
    grid = [(r, a) for r in config.motion.pgv_pga for a in config.motion.pga]
    wanted = [(rng.choice(config.yaw), *rng.choice(grid)) for _ in range(CELLS)]

    def batches() -> Iterator[Batch]:
        for yaw in sorted(set(config.yaw)):
            cells = [(r, a * GRAVITY) for at, r, a in wanted if at == yaw]
            for start in range(0, len(cells), 10):
                yield Batch(yaw, str(yaw), tuple(cells[start : start + 10]))

    job.log(f"accuracy: {CELLS} cells in {', '.join(names)}, and at a sixteenth of the step")
    found = []
    for batch, results in job.cluster.run(
        measuring.run_cells,
        batches(),
        lambda yaw: (prepared(config, job.store, float(yaw), friction), tuple(every)),
    ):
        for (pgv_pga, pga), outcomes in zip(batch.items, results or [], strict=False):
            cell = {"cell_yaw": batch.tag, "cell_pgv_pga": pgv_pga, "cell_pga": pga / GRAVITY}
            cell |= {f"outcome_{name}": o for name, o in zip(names, outcomes, strict=False)}
            found.append({**cell, "outcome_fine": outcomes[-1]})
    return sorted(found, key=lambda cell: tuple(cell.values()))


def _agreement(cells: list[Record]) -> list[Record]:
    """Share of the cells whose outcome differs between engines, and from the finer step."""
    names = [name for name in cells[0] if name.startswith("outcome_")] if cells else []
    pairs = [(a, b) for at, a in enumerate(names) for b in names[at + 1 :]]
    return [
        _record(
            "cells",
            f"{a.removeprefix('outcome_')} and {b.removeprefix('outcome_')}",
            error=sum(_side(cell[a]) != _side(cell[b]) for cell in cells) / len(cells),
            rows=len(cells),
            note="share of random cells of the grid whose outcome differs",
        )
        for a, b in pairs
    ]


def _side(outcome: int) -> int:
    return Outcome(outcome).overturned


def _suite(job: Job) -> list[Record]:
    from pipeline import measuring
    from vsr_core import reference

    cases = {case.name: case for case in reference.cases()}
    there = installed()
    items = [
        (name, engine) for name, case in cases.items() for engine in case.engines if engine in there
    ]
    job.log(f"accuracy: reference suite, {len(items)} cases")
    done = job.cluster.run(
        measuring.run_reference,
        (Batch(item, "steps", (item,)) for item in items),
        lambda name: STEPS,
    )
    found = [result for _, results in done if results is not None for result in results[0]]
    return [
        _record(
            "reference",
            f"{result.name} ({result.engine})",
            f"{1e3 * result.time_step:.4g} ms",
            error=result.error,
            rows=1,
            cpu_s=result.seconds,
            note=f"{cases[result.name].quantity}; {cases[result.name].answer}",
        )
        for result in sorted(found, key=lambda r: (r.name, r.engine, -r.time_step))
    ]


def _record(part: str, method: str, setting: str = "", **values: Any) -> Record:
    return {
        **dict.fromkeys(COLUMNS, ""),
        "part": part,
        "method": method,
        "setting": setting,
    } | values


def _dataset(targets: dict[Place, Target], cells: list[Record]) -> xr.Dataset:
    import xarray as xr

    dataset = xr.Dataset(
        {
            "row_yaw": ("row", [yaw for yaw, _ in targets]),
            "row_pgv_pga": ("row", [pgv_pga for _, pgv_pga in targets]),
            "row_reference": ("row", [t.boundary / GRAVITY for t in targets.values()]),
            "row_spread": ("row", [t.spread for t in targets.values()]),
        }
    )
    for name in cells[0] if cells else ():
        dataset[name] = ("cell", [cell[name] for cell in cells])
    return dataset


def _summary(records: list[Record]) -> str:
    from pipeline.figures.accuracy import cheapest

    ways = cheapest(records, 0.01)
    texts = [f"{way['method']} {1e3 * way['cpu_s']:.3g} ms" for way in ways]
    return "a run at 1 % error of the boundary: " + (", ".join(texts) or "no way gets there")


def _write_table(path: Path, records: list[Record]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in record.items()}
            for record in records
        )


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _inputs(site: Site) -> dict[str, str]:
    return {TEMPLATE.name: digest_file(TEMPLATE)}


def _modules(package: str) -> list[str]:
    """Modules of a package of the physics, whose contents are found by name only."""
    return sorted(path.stem for path in (ROOT / "vsr_core" / package).glob("[!_]*.py"))


STAGE = Stage(
    name="accuracy",
    make=make,
    needs=("rock", "precision"),
    reads=("pedestal", "contact", "motion", "yaw", "drive", "servo", "simulation"),
    code=(
        *RUN_CODE,
        "pipeline.measuring:find_target",
        "pipeline.measuring:score",
        "pipeline.measuring:run_cells",
        "pipeline.measuring:run_reference",
        "vsr_core.engines.bullet:build",
        "vsr_core.engines.mujoco:build",
        *(f"vsr_core.peers.{name}:build" for name in _modules("peers")),
        *(f"vsr_core.reference.{name}:CASES" for name in _modules("reference")),
    ),
    inputs=_inputs,
    versions=("pybullet", "matplotlib", "jinja2"),
)
