"""The command line: prep, run, plan, status, why, feasible, list, clean, fetch."""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import ROOT
from pipeline.problems import InputError, Problem

if TYPE_CHECKING:
    from pipeline.stage import Job

DONE, UNRESOLVED, REFUSED, BROKEN, STOPPED = 0, 1, 2, 3, 130

PRODUCTS = (
    "rock",
    "motions",
    "responses",
    "fragility",
    "report",
    "displacement",
    "accuracy",
    "stability",
    "drive",
    "validation",
)
"""What `run` can make; each is a stage of that name."""

ALIASES: dict[str, str] = {"fragility": "report", "displacement": "displacement_report"}
"""Products that come with more: fragility and displacement with their reports."""

SHOWN = {
    "fragility": ("report.html", "fragility.csv", "responses.nc"),
    "report": ("report.html", "fragility.csv", "responses.nc"),
    "displacement": ("displacement.html", "trajectories.html", "correlation.csv"),
    "prep": ("prep.html", "terrain.nc"),
    "accuracy": ("accuracy.html", "accuracy.csv", "work_precision.png"),
    "stability": ("stability.html", "stability.csv", "stability_map.png"),
    "drive": ("drive.html", "drive.csv", "drive.nc"),
    "validation": ("validation.html", "validation.csv", "validation.nc"),
    "feasible": ("feasible.png", "feasible.csv"),
}
"""Files that are named when a product is done."""

LOST = "runs are without a verdict; the report and responses.nc say which"
UNRESOLVED_ARE = {"stability": "cases are silently wrong; stability.html says which"}
"""What an exit code of 1 means, where it is not that runs are without a verdict."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command; returns the exit code.

    0 done; 1 finished, but some runs are without a verdict; 2 usage or input; 3 a fault of the
    program; 130 stopped by Ctrl-C.
    """
    try:
        options = _parser().parse_args(arguments)
        return int(options.verb(options))
    except InputError as error:
        for problem in error.problems:
            print(f"vsr: {problem}", file=sys.stderr)
        return REFUSED
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except KeyboardInterrupt:
        _log("stopped; what was done is kept, and the same command goes on from there")
        return STOPPED
    except Exception as error:  # noqa: BLE001 (the last door: never a traceback on the screen)
        report = Path(options.derived) / "vsr-fault.txt"
        where = f"details in {report}"
        try:
            report.parent.mkdir(parents=True, exist_ok=True)
            report.write_text(traceback.format_exc(), encoding="utf-8")
        except OSError as unwritten:
            where = f"no details, because of {unwritten}"
        print(f"vsr: a fault of the program: {error!r}; {where}", file=sys.stderr)
        return BROKEN


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="vsr", description="Virtual shake robot.")
    verbs = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(
        name: str, verb: Callable[[argparse.Namespace], int], text: str
    ) -> argparse.ArgumentParser:
        sub = verbs.add_parser(name, help=text, description=text)
        sub.set_defaults(verb=verb)
        sub.add_argument("--derived", default=str(ROOT / "data" / "derived"), metavar="DIR")
        return sub

    def add_site(sub: argparse.ArgumentParser, required: bool = True) -> None:
        sub.add_argument("--site", required=required, metavar="NAME_OR_YAML")
        sub.add_argument("--study", metavar="NAME_OR_YAML")
        sub.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings")

    run = add("run", _run, "make a product and all that it needs")
    run.add_argument("product", choices=PRODUCTS, metavar="PRODUCT", help=", ".join(PRODUCTS))
    add_site(run, required=False)
    run.add_argument("--table", metavar="FOLDER", help="recorded shake-table tests to predict")
    prep = add("prep", _prep, "rock and terrain of a scan, with a page of every step to look at")
    add_site(prep)
    where = run.add_mutually_exclusive_group()
    where.add_argument("--workers", type=_workers, metavar="N", help="worker processes; 0 for none")
    where.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler")
    where.add_argument("--scheduler-file", metavar="F")
    where.add_argument("--cluster", choices=("slurm",))
    for name, verb, text in (
        ("plan", _plan, "what would run and what it costs"),
        ("status", _status, "what is done"),
        ("why", _why, "why it would run again"),
    ):
        sub = add(name, verb, text)
        sub.add_argument(
            "product", nargs="?", default="fragility", choices=PRODUCTS, metavar="PRODUCT"
        )
        add_site(sub)
    feasible = add("feasible", _feasible, "what a shake table can do of a site's motions")
    add_site(feasible)
    feasible.add_argument("--table", required=True, metavar="NAME_OR_YAML")
    feasible.add_argument("--export", metavar="DIR", help="write the table's commands there")
    add("list", _list, "sites, studies, tables and products")
    clean = add("clean", _clean, "remove derived data, of one site or all; never data/raw")
    clean.add_argument("--site", metavar="NAME")
    clean.add_argument("--yes", action="store_true", help="do not ask")
    fetch = add("fetch", _fetch, "download a public original into data/raw")
    fetch.add_argument("name", metavar="NAME")
    fetch.add_argument("--url", help="another place that serves the same file")
    return parser


def _run(options: argparse.Namespace) -> int:
    from pipeline import graph

    job = _job(options)
    job.store.open()
    with job.cluster:
        unresolved = graph.make(ALIASES.get(options.product, options.product), job)
    for name in SHOWN.get(options.product, ()):
        _log(f"-> {job.path(name)}")
    if unresolved:
        _log(f"{unresolved} {UNRESOLVED_ARE.get(options.product, LOST)}")
        return UNRESOLVED
    return DONE


def _prep(options: argparse.Namespace) -> int:
    from pipeline import graph

    job = _job(options)
    if not job.config.on_terrain:
        shape = f"a {job.config.pedestal.shape} pedestal"
        rule, remedy = "rock and terrain are parts of one scan", "set pedestal.shape: mesh"
        raise InputError(Problem(job.site.file, "pedestal.shape", shape, rule, remedy))
    job.store.open()
    with job.cluster:
        graph.make("scan", job)
        page, terrain = SHOWN["prep"]
        _log(f"-> {job.path(page)}")
        if job.config.pedestal.cut is None:
            _log("the cut is a proposal; to accept it, set pedestal.cut: proposal")
            return DONE
        graph.make("terrain", job)
    _log(f"-> {job.path(terrain)}")
    return DONE


def _plan(options: argparse.Namespace) -> int:
    from pipeline import inspect

    return _show(inspect.plan(ALIASES.get(options.product, options.product), _job(options)))


def _status(options: argparse.Namespace) -> int:
    from pipeline import inspect

    return _show(inspect.status(ALIASES.get(options.product, options.product), _job(options)))


def _why(options: argparse.Namespace) -> int:
    from pipeline import inspect

    return _show(inspect.why(ALIASES.get(options.product, options.product), _job(options)))


def _feasible(options: argparse.Namespace) -> int:
    from pipeline import feasible

    job = _job(options)
    job.store.open()
    with job.cluster:
        lines = feasible.make(job, options.table, Path(options.export) if options.export else None)
    for name in SHOWN["feasible"]:
        _log(f"-> {job.path(name)}")
    return _show(lines)


def _list(options: argparse.Namespace) -> int:
    from pipeline.layers import STUDIES, TABLES, known

    print("sites:   ", *known())
    print("studies: ", *(known(STUDIES) or ["none"]))
    print("tables:  ", *known(TABLES))
    print("products:", *PRODUCTS)
    return DONE


def _clean(options: argparse.Namespace) -> int:
    import shutil

    derived = Path(options.derived)
    targets = [derived / options.site] if options.site else sorted(derived.glob("*/"))
    targets = [target for target in targets if (target / ".stages").is_dir()]
    if not targets:
        print("nothing derived to remove")
        return DONE
    names = ", ".join(str(target) for target in targets)
    if not options.yes and not _agreed(f"remove {names}? [y/N] "):
        print("kept")
        return DONE
    for target in targets:
        shutil.rmtree(target)
    return DONE


def _agreed(question: str) -> bool:
    try:
        return input(question).strip().lower() == "y"
    except EOFError:  # nobody to ask
        return False


def _fetch(options: argparse.Namespace) -> int:
    from pipeline.fetch import fetch

    _log(f"-> {fetch(options.name, options.url)}")
    return DONE


def _job(options: argparse.Namespace) -> Job:
    from pipeline.cluster import Cluster
    from pipeline.layers import load_site
    from pipeline.stage import Job
    from pipeline.store import Store

    given = vars(options)
    if given.get("product") == "validation":
        from pipeline.shake_table import site_of

        site = site_of(_wanted(given, "table", "a folder of shake-table tests"))
    else:
        name = str(_wanted(given, "site", "a site, or the path of its YAML"))
        site = load_site(name, options.study, tuple(options.settings))
    cores = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    workers = given.get("workers")
    cluster = Cluster(
        cores if workers is None else workers,
        given.get("scheduler"),
        given.get("scheduler_file"),
        given.get("cluster") == "slurm",
        _log,
    )
    return Job(site, Store(Path(options.derived) / site.name), cluster, "", _log)


def _wanted(given: dict[str, Any], option: str, what: str) -> Path:
    value = given.get(option)
    if not value:
        raise InputError(
            Problem(f"--{option}", "", "nothing", f"the product needs {what}", "give it")
        )
    return Path(value)


def _workers(text: str) -> int:
    if not text.isdecimal():
        raise InputError(
            Problem("--workers", "", repr(text), "it is a whole number from 0", "e.g. 2")
        )
    return int(text)


def _show(lines: list[str]) -> int:
    print("\n".join(lines), flush=True)
    return DONE


def _log(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
