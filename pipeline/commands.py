"""What each command does; imported when a command is given, not for its help.

A command returns the number of runs without a verdict.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.config.layers import STUDIES, TABLES, known, load_site
from pipeline.config.problems import InputError, Problem
from pipeline.config.sweep import Sweep, load_sweep
from pipeline.workflow import front_page, graph
from pipeline.workflow.cluster import Cluster, check_settings
from pipeline.workflow.owner import LOCK, Ownership
from pipeline.workflow.products import DELIVERABLES, GRIDDED
from pipeline.workflow.stage import Job, named
from pipeline.workflow.store import Store, writing


def run(options: argparse.Namespace) -> int:
    """Make a product and all that it needs.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, runs without a verdict
    """
    sweep, wanted = _sweep(options), DELIVERABLES[options.product]
    job = _job(options, sweep)
    if options.product == "uncertainty":
        _check_drawn(job)
    if options.product == "hazard" and sweep is None:
        for other in _others(options, job):
            _log(f"{other.store.folder}:")
            with other.store, other.cluster:
                graph.make(other.stage, other)
    with job.store, job.cluster:
        if sweep is None:
            unresolved = graph.make(wanted.stage, job)
        else:
            job, unresolved = _swept(sweep, wanted.stage, job)
    for name in wanted.shown if sweep is None else ("study.html", "study.nc"):
        _log(f"-> {job.path(name)}")
    if unresolved:
        _log(f"{unresolved} {wanted.unresolved}")
    return unresolved


def _swept(sweep: Sweep, stage: str, job: Job) -> tuple[Job, int]:
    """Make all members of a sweep and the study of them; its job, and runs without a verdict."""
    swept = named("pipeline.workflow.sweeps:of_job")(sweep, stage, job)
    return swept.job, named("pipeline.workflow.sweeps:make")(swept)


def prep(options: argparse.Namespace) -> int:
    """Make rock and terrain of a scan, and the page of every step.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    job = _job(options)
    if not job.config.on_terrain:
        shape = f"a {job.config.pedestal.shape} pedestal"
        rule, remedy = "rock and terrain are parts of one scan", "set pedestal.shape: mesh"
        raise InputError(Problem(job.site.file, "pedestal.shape", shape, rule, remedy))
    with job.store, job.cluster:
        graph.make("scan", job)
        _log(f"-> {job.path('prep.html')}")
        if job.config.pedestal.cut is None:
            _log("the cut is a proposal; to accept it, set pedestal.cut: proposal")
            return 0
        graph.make("terrain", job)
    _log(f"-> {job.path('terrain.nc')}")
    return 0


def plan(options: argparse.Namespace) -> int:
    """Print what would run and what it costs.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    return _inspected("plan", options)


def status(options: argparse.Namespace) -> int:
    """Print what is done.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    return _inspected("status", options)


def why(options: argparse.Namespace) -> int:
    """Print why something would run again.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    return _inspected("why", options)


def _inspected(question: str, options: argparse.Namespace) -> int:
    sweep = _sweep(options)
    product = options.product or ("fragility" if sweep is None else "study")
    stage, ask = DELIVERABLES[product].stage, named(f"pipeline.status:{question}")
    job = _job(options, sweep)
    if sweep is None:
        return _show(ask(stage, job))
    swept = named("pipeline.workflow.sweeps:of_job")(sweep, stage, job)
    return _show(named("pipeline.workflow.sweeps:told")(ask, swept))


def figures(options: argparse.Namespace) -> int:
    """Make figures of the paper, and the page of its claims.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, runs without a verdict
    """
    unresolved = int(
        named("pipeline.stages.figures.making:make")(options, _cluster(vars(options)), _log)
    )
    _log(f"-> {options.derived / 'figures' / 'claims.html'}")
    return unresolved


def feasible(options: argparse.Namespace) -> int:
    """Print and write what a table of hardware can do of a site's motions.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    make = named("pipeline.stages.studies.capacity.feasible:make")
    job = replace(_job(options), stage="feasible")
    with job.store, job.cluster:
        job.store.open()
        lines = make(job, options.table, Path(options.export) if options.export else None)
    for name in ("feasible.png", "feasible.csv"):
        _log(f"-> {job.path(name)}")
    return _show(lines)


def replay(options: argparse.Namespace) -> int:
    """Make a page that plays one run of a study, and the study as far as it needs it.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    make = named("pipeline.stages.replay.replay_page:make")
    given = {name: vars(options)[name] for name in ("yaw", "friction", "pgv_pga", "record", "pga")}
    job = replace(_job(options), stage="replay")
    with job.store, job.cluster:
        page = make(job, given, options.beside)
    _log(f"-> {job.path(page)}")
    return 0


def index(options: argparse.Namespace) -> int:
    """Write the page that leads to all results.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    page = front_page.renew(options.derived)
    if page is None:
        raise InputError(
            Problem(
                str(options.derived),
                "",
                "no index of results",
                "there are products in the folder, and it can be written to",
                "make one, e.g. make fragility SITE=cuboid_1x1x2",
            )
        )
    _log(f"-> {page}")
    return 0


def list_all(options: argparse.Namespace) -> int:
    """Print sites, studies, tables and products.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    print("sites:   ", *known())
    print("studies: ", *(known(STUDIES) or ["none"]))
    print("tables:  ", *known(TABLES))
    print("products:", *DELIVERABLES)
    return 0


def clean(options: argparse.Namespace) -> int:
    """Remove derived data; never data/raw.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    site, derived = options.site, options.derived
    if site is not None and (site in ("", "..") or site != Path(site).name):
        rule = "it is the name of a folder of derived data"
        raise InputError(Problem("--site", "", repr(site), rule, "leave it out to remove all"))
    targets = [derived / site] if site else sorted(derived.glob("*/"))
    targets = [target for target in targets if (target / ".stages").is_dir()]
    if not targets:
        print("nothing derived to remove")
        return 0
    names = ", ".join(str(target) for target in targets)
    if not options.yes and not _agreed(f"remove {names}? [y/N] "):
        print("kept")
        return 0
    for target in targets:
        _remove(target)
    return 0


def _remove(folder: Path) -> None:
    """Remove a site's folder; refused while a command is at work in it."""
    with writing(folder):
        with Ownership(folder):
            for path in folder.iterdir():
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path)
                elif path.name != LOCK:
                    path.unlink()
        with suppress(OSError):  # where the next command has come already
            folder.rmdir()


def _agreed(question: str) -> bool:
    try:
        return input(question).strip().lower() == "y"
    except EOFError:  # nobody to ask
        return False


def fetch(options: argparse.Namespace) -> int:
    """Download a public original.

    Parameters
    ----------
    options : Namespace, as parsed

    Returns
    -------
    int, always 0
    """
    path = named("pipeline.stages.mesh.fetch:fetch")(options.name, options.url)
    _log(f"-> {path}")
    return 0


def _check_drawn(job: Job) -> None:
    config = job.config
    if config.on_terrain:
        key, given, remedy = "pedestal.shape", "a terrain", "set pedestal.shape: flat"
    else:
        key, given, remedy = "uncertainty.members", "0", "give a number of draws, such as 32"
    if not config.uncertain:
        rule = "rocks are drawn on a flat pedestal, one a member"
        raise InputError(Problem(job.site.file, key, given, rule, remedy))


def _others(options: argparse.Namespace, job: Job) -> Iterator[Job]:
    """Jobs of other rocks and other settings, whose fragilities a site's hazard reads."""
    named("pipeline.stages.hazard.hazard:inputs")(job.site)  # refused before anything is made
    compared = named("pipeline.stages.hazard.others:compared")
    file, settings = str(options.site), _settings(vars(options))
    found = named("pipeline.stages.hazard.others:rocks")(job.site)
    found += compared(job.site, file, options.study, settings)
    for other in found:
        store = Store(other.folder(job.store.folder))
        yield replace(job, site=other.site, store=store, stage=other.stage)


def _settings(given: dict[str, Any]) -> tuple[str, ...]:
    """Settings of the command line: ``--set``, and what has an option of its own."""
    found = list(given["settings"])
    if given.get("curves") is not None:
        found.append(f"hazard.curves={json.dumps(given['curves'])}")
    if given.get("age") is not None:
        age = {"kind": "normal", "mean": given["age"], "sd": given.get("age_sd") or 0.0}
        found.append(f"hazard.age={json.dumps(age | {'source': ''})}")
    elif given.get("age_sd") is not None:
        found.append(f"hazard.age.sd={json.dumps(given['age_sd'])}")
    return tuple(found)


def _sweep(options: argparse.Namespace) -> Sweep | None:
    """What the study of a command sweeps over."""
    product = options.product or "study"
    study, stage = options.study, DELIVERABLES[product].stage
    found = None
    if study and product != "validation":
        site = str(_wanted(vars(options), "site", "a site, or the path of its YAML"))
        found = load_sweep(site, study, _settings(vars(options)), gridded=stage in GRIDDED)
    if options.product == "study" and found is None:
        given = "a study without a sweep" if study else "nothing"
        rule, remedy = "it says which keys to sweep over", "give one, e.g. friction"
        raise InputError(Problem("--study", "", given, rule, remedy))
    return found


def _job(options: argparse.Namespace, sweep: Sweep | None = None) -> Job:
    given = vars(options)
    if given.get("product") == "validation":
        site_of = named("pipeline.stages.studies.validation.recorded_tests:site_of")
        site = site_of(_wanted(given, "table", "a folder of shake-table tests"))
    elif sweep is not None:
        site = sweep.reference.site
    else:
        name = str(_wanted(given, "site", "a site, or the path of its YAML"))
        site = load_site(name, options.study, _settings(given))
        if given.get("curves") is not None:  # beside who gives them, not beside the site's YAML
            site = replace(site, folders={**site.folders, "hazard.curves": Path.cwd()})
    return Job(site, Store(options.derived / site.name), _cluster(given), "", _log)


def _cluster(given: dict[str, Any]) -> Cluster:
    """The workers that the options name; all cores of this machine by default."""
    check_settings()
    cores = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    workers = given.get("workers")
    elsewhere = given.get("scheduler") or given.get("scheduler_file")
    if elsewhere and workers is not None:
        rule, remedy = "a scheduler that exists has its own workers", "leave one of the two out"
        raise InputError(Problem("--workers", "", f"{workers} beside {elsewhere}", rule, remedy))
    return Cluster(
        cores if workers is None else workers,
        given.get("scheduler"),
        given.get("scheduler_file"),
        given.get("cluster") == "slurm",
        _log,
    )


def _wanted(given: dict[str, Any], option: str, what: str) -> Path:
    value = given.get(option)
    if not value:
        raise InputError(
            Problem(f"--{option}", "", "nothing", f"the product needs {what}", "give it")
        )
    return Path(value)


def _show(lines: list[str]) -> int:
    print("\n".join(lines), flush=True)
    return 0


def _log(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
