"""The words of a command: what each takes, its help with an example, what is refused at once."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

from pipeline import ROOT
from pipeline.config.paths import shown, working_folder
from pipeline.config.problems import InputError, Problem
from pipeline.workflow import option_values
from pipeline.workflow.log import show
from pipeline.workflow.products import DELIVERABLES, OF_A_SITE

ANSWERS = ROOT / "pipeline" / "inspection" / "answers.schema.json"
JSON = f"print JSON, of the shapes in {shown(ANSWERS)}".replace("%", "%%")

DOCUMENTATION = """\
vsr COMMAND --help and vsr run PRODUCT --help tell of one command and of one product.
documentation: docs/index.md of the checkout, which `make docs` makes a site of"""

COMPLETING = """\
in the file that the shell reads when it starts:
  bash  source <(vsr completion bash)
  zsh   autoload -U compinit && compinit
        source <(vsr completion zsh)
  fish  vsr completion fish | source"""

_RUN_EXAMPLES = tuple(
    f"run {name} {DELIVERABLES[name].example}" for name in ("fragility", "displacement", "hazard")
)

_OPTIONS: dict[str, dict[str, Any]] = {
    "site": {
        "default": "",
        "metavar": "NAME_OR_YAML",
        "help": "a site that vsr list names, or a YAML file",
    },
    "name": {"metavar": "NAME", "help": "a variant: a folder of its own, stored runs shared"},
    "study": {
        "metavar": "NAME_OR_YAML",
        "help": "settings over those of the site: a study that vsr list names, or a YAML file",
    },
    "set": {
        "action": "append",
        "default": [],
        "metavar": "KEY=VALUE",
        "dest": "settings",
        "help": "any key of the configuration, e.g. motion.pga.num=20; may be given again",
    },
    "table": {"metavar": "FOLDER", "help": "recorded shake-table tests to predict"},
    "curves": {"metavar": "FOLDER", "help": "hazard curves, or OpenQuake's calc_N.hdf5"},
    "events": {"metavar": "FOLDER", "help": "OpenQuake's events, or its calc_N.hdf5"},
    "age": {"type": float, "metavar": "YEARS", "help": "age of the rock's position"},
    "age-sd": {"type": float, "metavar": "YEARS", "help": "standard deviation of the age"},
}
"""What products take, as ``pipeline.workflow.products`` has it for each."""


def parsed(arguments: list[str] | None = None) -> argparse.Namespace:
    """Options of a command line, checked."""
    options = parser().parse_args(arguments)
    if "product" in options:
        _refuse_others(options)
    return options


class _Version(argparse.Action):
    """Tells the version, the code of the engines and the libraries, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        show(importlib.import_module("pipeline.workflow.versions").lines())
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """Parser whose usage errors are one line, as all other errors are."""

    def __init__(self, *words: Any, **more: Any) -> None:
        super().__init__(*words, **more)
        self.register("action", None, option_values.Stored)

    def error(self, message: str) -> NoReturn:
        """Raise a usage error."""
        raise InputError(Problem("command line", "", "", message, f"see {self.prog} --help"))

    def print_help(self, file: object = None) -> None:
        """Print the help; refused where it cannot be written."""
        show([self.format_help().rstrip("\n")])


class _Help(argparse.Action):
    """Shows the help of ``vsr run``, or that of the product which stands before it, and ends."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *_: object
    ) -> None:
        product: str | None = namespace.product
        (parser if product is None else _of_product(product)).print_help()
        parser.exit()


def _of_product(product: str) -> argparse.ArgumentParser:
    """Parser that shows what a product takes."""
    wanted = DELIVERABLES[product]
    example = _shown(f"run {product} {wanted.example}")
    own = _Parser(f"vsr run {product}", description=f"{product}: {wanted.about}", **example)
    _add_options(own, wanted.options)
    _add_where(own)
    _add_common(own)
    return own


def _shown(*examples: str) -> dict[str, Any]:
    """How a parser shows commands below its options."""
    lines = (
        "examples:" if len(examples) > 1 else "example:",
        *(f"  vsr {one}" for one in examples),
    )
    return {"epilog": "\n".join(lines), "formatter_class": argparse.RawDescriptionHelpFormatter}


def parser() -> argparse.ArgumentParser:
    """Parser of all commands."""
    whole = _Parser(
        prog="vsr",
        description="Virtual shake robot: how strong must shaking be to topple a rock?",
        epilog=DOCUMENTATION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    whole.add_argument("--version", action=_Version, nargs=0, help="versions, for a report")
    verbs = whole.add_subparsers(metavar="COMMAND", required=True)

    def add(name: str, text: str, *examples: str, **more: Any) -> argparse.ArgumentParser:
        sub = verbs.add_parser(name, help=text, description=text, **_shown(*examples), **more)
        sub.set_defaults(verb=name)
        _add_common(sub)
        return sub

    _add_run(add("run", "make a product and its prerequisites", *_RUN_EXAMPLES, add_help=False))
    prep = add(
        "prep",
        "prepare rock and terrain from a scan, with a page of every step",
        "prep --site double_rock_terrain",
    )
    _add_options(prep, OF_A_SITE)
    for name, text, example in (
        ("plan", "list what would run and the cost", "plan --site double_rock"),
        ("status", "list what is done, of a site or of all", "status --site double_rock"),
        ("why", "explain why something would run again", "why fragility --site double_rock"),
    ):
        sub = add(name, text, example)
        sub.add_argument(
            "product",
            nargs="?",
            choices=DELIVERABLES,
            metavar="PRODUCT",
            help="of those that vsr run --help lists; fragility unless given",
        )
        _add_options(sub, _OPTIONS)
        sub.add_argument("--json", action="store_true", help=JSON)
        if name == "plan":
            sub.add_argument(
                "--graph", type=Path, metavar="SVG", help="draw the stages into this file, too"
            )
    figures = add(
        "figures", "make every figure of the paper and check its claims", "figures --fig 12"
    )
    figures.add_argument("--fig", default="", metavar="NAME", help="one of them, e.g. 12")
    figures.add_argument("--record", default="", metavar="FILE", help="recorded motion for Fig. 7")
    _add_options(figures, ("set",))
    _add_where(figures)
    feasible = add(
        "feasible",
        "compare a site's motions with the limits of a shake table",
        "feasible --site w2_5.5cm --export commands",
    )
    _add_options(feasible, OF_A_SITE)
    feasible.add_argument(
        "--table",
        default="mini_shake_robot",
        metavar="NAME_OR_YAML",
        help="a table that vsr list names, or a YAML file; mini_shake_robot unless given",
    )
    feasible.add_argument(
        "--export", metavar="DIR", help="write the commands for the table into this folder"
    )
    _add_replay(
        add(
            "replay",
            "make a page that replays one run",
            "replay --site double_rock --yaw 90 --pga 0.4 --pgv-pga 0.3",
        )
    )
    joined = add(
        "join",
        "take runs of a study that were done in other folders",
        "join theirs/double_rock --site double_rock",
    )
    joined.add_argument(
        "folders", nargs="+", type=Path, metavar="FOLDER", help="results of the same site"
    )
    _add_options(joined, OF_A_SITE)
    _add_where(joined)
    archive = add(
        "archive",
        "boundaries of rocks known by two angles and a distance or a height",
        "archive data/raw/archive/rocks.csv",
    )
    archive.add_argument("rocks", metavar="ROCKS.CSV", help="a table with a row for each rock")
    equations = add(
        "archive-equations",
        "make the equations anew by which archives are answered",
        "archive-equations --shapes 200",
    )
    equations.add_argument(
        "--shapes",
        type=option_values.shapes,
        default=1750,
        metavar="N",
        help="shapes drawn; 1750 unless given",
    )
    equations.add_argument(
        "--workers",
        type=option_values.workers,
        default=2,
        metavar="N",
        help="worker processes; 2 unless given",
    )
    equations.add_argument(
        "--ship", action="store_true", help="put them in place of the shipped ones"
    )
    add("index", "make a page with links to all results", "index")
    doctor = add(
        "doctor", "see whether this machine can do runs, and what to do where not", "doctor"
    )
    doctor.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler to try")
    listed = add("list", "list sites, studies, tables and products", "list")
    listed.add_argument("--json", action="store_true", help=JSON)
    clean = add("clean", "remove results of one site or all; never data/raw", "clean --older 30d")
    clean.add_argument("--site", metavar="NAME", help="a site's folder of results; all if omitted")
    clean.add_argument(
        "--older", type=option_values.days, metavar="DAYS", help="made so long ago, e.g. 30d"
    )
    clean.add_argument("--yes", action="store_true", help="do not ask")
    completion = add("completion", "print what completes commands, options and names in a shell")
    completion.epilog = COMPLETING
    completion.add_argument(
        "shell", choices=("bash", "zsh", "fish"), metavar="SHELL", help="bash, zsh or fish"
    )
    completion.set_defaults(parser=whole)
    export = add(
        "export",
        "put a site's results and what they were made from into one file",
        "export data/derived/double_rock --to study.zip",
    )
    export.add_argument(
        "folder", type=Path, metavar="STUDY_FOLDER", help="a site's folder of results"
    )
    export.add_argument(
        "--to", type=Path, required=True, metavar="ZIP", help="the file that is written"
    )
    export.add_argument(
        "--digests", action="store_true", help="of inputs their digests and sources, not the files"
    )
    export.add_argument("--licence", default="", metavar="URL", help="of the results")
    check = add(
        "check",
        "tell what of an exported file does not match: bytes, inputs, versions",
        "check study.zip",
    )
    check.add_argument("bundle", type=Path, metavar="ZIP", help="what vsr export wrote")
    compare = add(
        "compare",
        "tell how two results differ: settings, cells, boundaries; as a page",
        "compare data/derived/double_rock study.zip",
    )
    for name in ("one", "other"):
        compare.add_argument(
            name, type=Path, metavar="FOLDER_OR_ZIP", help="results, or what vsr export wrote"
        )
    compare.add_argument(
        "--to",
        type=Path,
        default=Path("comparison.html"),
        metavar="HTML",
        help="the page; comparison.html unless given",
    )
    init = add("init", "write a commented site and a README into a new folder", "init my_rock")
    init.add_argument(
        "folder", type=Path, metavar="FOLDER", help="a new one, whose name is that of the site"
    )
    fetch = add("fetch", "download a public scan into data/raw", "fetch double_rock")
    fetch.add_argument(
        "name", metavar="NAME", help="double_rock, double_rock_prints or granite_boulder"
    )
    fetch.add_argument("--url", metavar="URL", help="alternative address of the same file")
    return whole


def _add_common(sub: argparse.ArgumentParser) -> None:
    results = working_folder() / "data" / "derived"
    sub.add_argument(
        "--derived",
        type=option_values.folder,
        default=results,
        metavar="DIR",
        help="folder of results; data/derived unless given",
    )
    sub.add_argument("--quiet", action="store_true", help="show only what is wrong")
    sub.add_argument(
        "--log-file", type=Path, metavar="FILE", help="append the messages to this file"
    )


def _add_run(run: argparse.ArgumentParser) -> None:
    run.add_argument(
        "-h", "--help", action=_Help, nargs=0, help="this, or after a PRODUCT what that one takes"
    )
    run.add_argument("product", choices=DELIVERABLES, metavar="PRODUCT", help="one of those below")
    products = (f"  {name:<14}{one.about}" for name, one in DELIVERABLES.items())
    run.epilog = "\n".join(("products:", *products, "", str(run.epilog)))
    _add_options(run, _OPTIONS)
    _add_where(run)


def _add_replay(replay: argparse.ArgumentParser) -> None:
    _add_options(replay, OF_A_SITE)
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


def _add_options(sub: argparse.ArgumentParser, names: Iterable[str]) -> None:
    """Add options of products, of which hazard curves and events exclude each other."""
    shaking = sub.add_mutually_exclusive_group() if "curves" in names else sub
    for name in names:
        into = shaking if name in ("curves", "events") else sub
        into.add_argument(f"--{name}", **_OPTIONS[name])


def _refuse_others(options: argparse.Namespace) -> None:
    """Refuse options that the product of a command does not take."""
    product, given = options.product or "fragility", vars(options)
    for name, how in _OPTIONS.items():
        value = given.get(how.get("dest", name.replace("-", "_")))
        if name not in DELIVERABLES[product].options and value != how.get("default"):
            rule, remedy = f"{product} takes no --{name}", f"see vsr run {product} --help"
            raise InputError(Problem(f"--{name}", "", str(value), rule, remedy))


def _add_where(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--workers",
        type=option_values.workers,
        metavar="N",
        help="worker processes; 0 for none, all cores unless given",
    )
    where = sub.add_mutually_exclusive_group()
    where.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler")
    where.add_argument(
        "--scheduler-file", metavar="F", help="the file that a Dask scheduler wrote of itself"
    )
    where.add_argument("--cluster", choices=("slurm",), help="workers as cluster jobs")
