"""The command line: options are checked before anything is loaded, then the command runs."""

from __future__ import annotations

import argparse
import errno
import importlib
import os
import sys
import traceback
from pathlib import Path
from typing import NoReturn

from pipeline.config.paths import located, working_folder
from pipeline.config.problems import InputError, Problem, Unfinished
from pipeline.workflow.log import begin, complain, log
from pipeline.workflow.products import DELIVERABLES
from vsr_core.errors import InvalidInput, reason

DONE, UNRESOLVED, REFUSED, BROKEN, STOPPED = 0, 1, 2, 3, 130

MAKING = ("run", "prep", "figures", "feasible", "replay", "join", "archive", "clean")
"""Commands after which the index of all results is updated."""

FEWEST_SHAPES = 100
"""Shapes from which equations can be fitted at all."""

JSON = "print JSON, as of docs/answers.schema.json"

MOST_WORKERS = 10_000
"""More worker processes than any machine starts."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command; returns the exit code.

    0 done; 1 some runs are unresolved, or not done as the scheduler was lost; 2 usage or input
    error; 3 internal error; 130 stopped by Ctrl-C or SIGTERM.
    """
    options = argparse.Namespace(verb="", derived=Path("data", "derived"))  # until they are read
    try:
        options = parsed(arguments)
        _begin_log(options)
        commands = importlib.import_module("pipeline.commands").COMMANDS
        unresolved = commands[options.verb](options)
        if options.verb in MAKING:
            _renew_index(options.derived)
        return UNRESOLVED if unresolved else DONE
    except InputError as error:
        return _refused(error)
    except InvalidInput as error:  # what no stage has blamed on a key
        return _refused(InputError.from_invalid(options.verb, "", error))
    except Unfinished as end:
        complain(f"vsr: {end}")
        return UNRESOLVED
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except KeyboardInterrupt:
        log("stopped; what was done is kept, and the same command goes on from there")
        return STOPPED
    except Exception as error:  # noqa: BLE001 (the last door: never a traceback on the screen)
        report = options.derived / "vsr-fault.txt"
        where = f"details in {report}"
        try:
            report.parent.mkdir(parents=True, exist_ok=True)
            report.write_text(traceback.format_exc(), encoding="utf-8", errors="backslashreplace")
        except OSError as unwritten:
            where = f"no details, because of {unwritten}"
        complain(f"vsr: internal error: {error!r}; {where}")
        return BROKEN


def _begin_log(options: argparse.Namespace) -> None:
    file: Path | None = options.log_file
    try:
        if file is not None and file.is_fifo():
            raise OSError(errno.EINVAL, "a pipe, which may never be read")
        begin(quiet=options.quiet, file=file)
    except OSError as error:
        given, rule = f"{file}: {reason(error)}", "lines can be added to the file of a log"
        raise InputError(Problem("--log-file", "", given, rule, "give another path")) from error


def _renew_index(derived: Path) -> None:
    """Renew the index of all results; what is wrong with it is told and decides nothing."""
    try:
        importlib.import_module("pipeline.workflow.front_page").renew(derived)
    except Exception as error:  # noqa: BLE001 (the command has done its work)
        complain(f"vsr: warning: index: not renewed ({reason(error)})")


def _refused(error: InputError) -> int:
    for problem in error.problems:
        complain(f"vsr: {problem}")
    return REFUSED


def parsed(arguments: list[str] | None = None) -> argparse.Namespace:
    """Options of a command line, checked."""
    return _parser().parse_args(arguments)


class _Version(argparse.Action):
    """Tells the version, the code of the engines and the libraries, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(*importlib.import_module("pipeline.workflow.versions").lines(), sep="\n")
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """Parser whose usage errors are one line, as all other errors are."""

    def error(self, message: str) -> NoReturn:
        """Raise a usage error."""
        raise InputError(Problem(self.prog, "", "", message, f"see {self.prog} --help"))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="vsr", description="Virtual shake robot.")
    parser.add_argument("--version", action=_Version, nargs=0, help="versions, for a report")
    verbs = parser.add_subparsers(metavar="COMMAND", required=True)

    def add(name: str, text: str) -> argparse.ArgumentParser:
        sub = verbs.add_parser(name, help=text, description=text)
        sub.set_defaults(verb=name)
        results = working_folder() / "data" / "derived"
        sub.add_argument("--derived", type=_folder, default=results, metavar="DIR")
        sub.add_argument("--quiet", action="store_true", help="show only what is wrong")
        sub.add_argument("--log-file", type=Path, metavar="FILE", help="add what is told to it")
        return sub

    _add_run(add("run", "make a product and its prerequisites"))
    _add_site(add("prep", "prepare rock and terrain from a scan, with a page of every step"))
    for name, text in (
        ("plan", "list what would run and the cost"),
        ("status", "list what is done"),
        ("why", "explain why something would run again"),
    ):
        sub = add(name, text)
        sub.add_argument("product", nargs="?", choices=DELIVERABLES, metavar="PRODUCT")
        _add_site(sub)
        sub.add_argument("--json", action="store_true", help=JSON)
        if name == "plan":
            sub.add_argument("--graph", type=Path, metavar="SVG", help="draw the stages, too")
    figures = add("figures", "make every figure of the paper and check its claims")
    figures.add_argument("--fig", default="", metavar="NAME", help="one of them, e.g. 12")
    figures.add_argument("--record", default="", metavar="FILE", help="recorded motion for Fig. 7")
    _add_settings(figures)
    _add_where(figures)
    feasible = add("feasible", "compare a site's motions with the limits of a shake table")
    _add_site(feasible)
    feasible.add_argument("--table", required=True, metavar="NAME_OR_YAML")
    feasible.add_argument(
        "--export", metavar="DIR", help="write the commands for the table into this folder"
    )
    _add_replay(add("replay", "make a page that replays one run"))
    joined = add("join", "take runs of a study that were done in other folders")
    joined.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    _add_site(joined)
    _add_where(joined)
    archive = add("archive", "boundaries of rocks known by two angles and a distance or a height")
    archive.add_argument("rocks", metavar="ROCKS.CSV")
    equations = add("archive-equations", "make the equations anew by which archives are answered")
    equations.add_argument("--shapes", type=_shapes, default=1750, metavar="N")
    equations.add_argument("--workers", type=_workers, default=2, metavar="N")
    equations.add_argument(
        "--ship", action="store_true", help="put them in place of the shipped ones"
    )
    add("index", "make a page with links to all results")
    doctor = add("doctor", "see whether this machine can do runs, and what to do where not")
    doctor.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler to try")
    listed = add("list", "list sites, studies, tables and products")
    listed.add_argument("--json", action="store_true", help=JSON)
    clean = add("clean", "remove results of one site or all; never data/raw")
    clean.add_argument("--site", metavar="NAME")
    clean.add_argument("--older", type=_days, metavar="DAYS", help="made so long ago, e.g. 30d")
    clean.add_argument("--yes", action="store_true", help="do not ask")
    completion = add("completion", "print what completes commands, options and names in a shell")
    completion.add_argument("shell", choices=("bash", "zsh", "fish"), metavar="SHELL")
    completion.set_defaults(parser=parser)
    export = add("export", "put a site's results and what they were made from into one file")
    export.add_argument("folder", type=Path, metavar="STUDY_FOLDER")
    export.add_argument("--to", type=Path, required=True, metavar="ZIP")
    export.add_argument(
        "--digests", action="store_true", help="of inputs their digests and sources, not the files"
    )
    export.add_argument("--licence", default="", metavar="URL", help="of the results")
    check = add("check", "tell what of an exported file does not match: bytes, inputs, versions")
    check.add_argument("bundle", type=Path, metavar="ZIP")
    compare = add("compare", "tell how two results differ: settings, cells, boundaries; as a page")
    for name in ("one", "other"):
        compare.add_argument(name, type=Path, metavar="FOLDER_OR_ZIP")
    compare.add_argument("--to", type=Path, default=Path("comparison.html"), metavar="HTML")
    init = add("init", "write a commented site and a README into a new folder")
    init.add_argument("folder", type=Path, metavar="FOLDER")
    fetch = add("fetch", "download a public scan into data/raw")
    fetch.add_argument("name", metavar="NAME")
    fetch.add_argument("--url", help="alternative address of the same file")
    return parser


def _add_run(run: argparse.ArgumentParser) -> None:
    run.add_argument("product", choices=DELIVERABLES, metavar="PRODUCT", help="one of those below")
    products = (f"  {name:<14}{one.about}" for name, one in DELIVERABLES.items())
    example = "  vsr run fragility --site double_rock --set yaw=[0,90]"
    run.epilog = "\n".join(("products:", *products, "", "example:", example))
    run.formatter_class = argparse.RawDescriptionHelpFormatter
    _add_site(run)
    run.add_argument("--table", metavar="FOLDER", help="recorded shake-table tests to predict")
    shaking = run.add_mutually_exclusive_group()
    shaking.add_argument(
        "--curves", metavar="FOLDER", help="hazard curves, or OpenQuake's calc_N.hdf5"
    )
    shaking.add_argument(
        "--events", metavar="FOLDER", help="OpenQuake's events, or its calc_N.hdf5"
    )
    run.add_argument("--age", type=float, metavar="YEARS", help="age of the rock's position")
    run.add_argument("--age-sd", type=float, metavar="YEARS", help="standard deviation of the age")
    _add_where(run)


def _add_replay(replay: argparse.ArgumentParser) -> None:
    _add_site(replay)
    for name, what in (
        ("yaw", "direction of shaking [degree]"),
        ("friction", "friction of rock on pedestal"),
        ("pgv-pga", "PGV/PGA [s]"),
        ("record", "name of the record, in place of PGV/PGA"),
        ("pga", "peak ground acceleration [g]"),
    ):
        replay.add_argument(f"--{name}", metavar="VALUE", help=what)
    replay.add_argument(
        "--and",
        metavar="WHAT",
        dest="beside",
        help="a second run: neighbour, or its differences, e.g. engine=bullet or yaw=30,pga=0.5",
    )
    _add_where(replay)


def _add_site(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--site", default="", metavar="NAME_OR_YAML")
    sub.add_argument(
        "--name", metavar="NAME", help="a variant: a folder of its own, stored runs shared"
    )
    sub.add_argument("--study", metavar="NAME_OR_YAML")
    _add_settings(sub)


def _add_settings(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings")


def _add_where(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--workers", type=_workers, metavar="N", help="worker processes; 0 for none")
    where = sub.add_mutually_exclusive_group()
    where.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler")
    where.add_argument("--scheduler-file", metavar="F")
    where.add_argument("--cluster", choices=("slurm",), help="workers as cluster jobs")


def _workers(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 10) or int(text) > MOST_WORKERS:
        rule = f"the number of workers is 0 to {MOST_WORKERS}"
        raise InputError(Problem("--workers", "", repr(text), rule, "e.g. 2"))
    return int(text)


def _shapes(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 7) or int(text) < FEWEST_SHAPES:
        rule = f"the number of shapes is {FEWEST_SHAPES} to 999999"
        raise InputError(Problem("--shapes", "", repr(text), rule, "e.g. 1750"))
    return int(text)


def _days(text: str) -> float:
    number = text.removesuffix("d")
    if not (number.isascii() and number.isdecimal() and len(number) < 6):
        rule = "an age is a whole number of days"
        raise InputError(Problem("--older", "", repr(text), rule, "e.g. 30d"))
    return float(number)


def _folder(text: str) -> Path:
    if located(Path.cwd(), text, "--derived", "").is_file():
        rule = "results need a folder, and this is a file"
        raise InputError(Problem("--derived", "", text, rule, "give another path"))
    return Path(text)
