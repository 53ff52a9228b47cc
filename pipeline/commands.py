"""What each command does; imported when a command is given, not for its help.

A command returns the number of unresolved runs.
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path

from pipeline.config.layers import CONFIGS, STUDIES, TABLES, known
from pipeline.config.paths import is_text, located
from pipeline.config.problems import InputError, Problem, printable
from pipeline.config.sweep import Sweep
from pipeline.inspection import disk
from pipeline.inspection.answers import Answer, Comparison, Inspected, Known
from pipeline.inspection.completion import script
from pipeline.workflow import front_page, graph, output, writers
from pipeline.workflow.grammar import form
from pipeline.workflow.jobs import check_asked, cluster_of, job_of, others_of, sweep_of
from pipeline.workflow.log import complain, log, show
from pipeline.workflow.products import DELIVERABLES
from pipeline.workflow.registry import BY_NAME
from pipeline.workflow.stage import Job, named
from pipeline.workflow.store import writing
from vsr_core import engines

MOST_NAMED = 5
"""Files that a line names; of more their number."""


def run(options: argparse.Namespace) -> int:
    """Make a product and all that it needs."""
    return made(options)[1]


def made(options: argparse.Namespace) -> tuple[Job, int]:
    """Make a product; the job, and how many runs are unresolved."""
    sweep, wanted = sweep_of(options), DELIVERABLES[options.product]
    engines.require(wanted.engine)
    job = job_of(options, sweep)
    check_asked(wanted.stage, job)
    beside = 0
    if options.product == "hazard" and sweep is None:
        for stage, other in others_of(job):
            log(f"{other.store.folder}:")
            with other.store, other.cluster:
                beside += graph.make(stage, other)
    with job.store, job.cluster:
        if sweep is None:
            unresolved = graph.make(wanted.stage, job)
        else:
            job, unresolved = _swept(sweep, wanted.stage, job)
    unresolved += beside
    for name in wanted.shown if sweep is None else ("study.html", "study.nc"):
        log(f"-> {job.path(name)}")
    if unresolved:
        complain(f"{unresolved} {form(unresolved, *wanted.unresolved)}")
    return job, unresolved


def _swept(sweep: Sweep, stage: str, job: Job) -> tuple[Job, int]:
    """Make all members of a sweep and the study of them; its job, and unresolved runs."""
    swept = named("pipeline.workflow.sweeps:of_job")(sweep, stage, job)
    return swept.job, named("pipeline.workflow.sweeps:make")(swept)


def prep(options: argparse.Namespace) -> int:
    """Make a rock, and its terrain, of a scan, and the page of every step."""
    job = job_of(options)
    alone = job.config.rock_alone
    if not alone and not job.config.on_terrain:
        rule, remedy = "what is prepared is a scan", "set rock.shape: mesh and name it in rock.mesh"
        file = job.site.file_of("rock.shape")
        raise InputError(Problem(file, "rock.shape", "a box", rule, remedy))
    with job.store, job.cluster:
        own = job.config.on_own_ground
        graph.make("closed_rock" if alone else "placed" if own else "scan", job)
        log(f"-> {job.path('prep.html')}")
        if job.config.on_terrain and not own and job.config.pedestal.cut is None:
            log("the cut is a proposal; to accept it, set pedestal.cut: proposal")
            return 0
        graph.make("rock" if alone else "terrain", job)
    log(f"-> {job.path('rock.nc' if alone else 'terrain.nc')}")
    return 0


def _inspected(question: str, options: argparse.Namespace) -> int:
    """Print what would run and what it costs, what is done, or why something would run again."""
    names = {"product", "study", "name", "settings", "table", "curves", "events", "age", "age_sd"}
    about = (vars(options)[name] for name in names)
    if question == "status" and not options.site and all(one in (None, []) for one in about):
        return _told(named("pipeline.status:overview")(options.derived), options)
    sweep = sweep_of(options)
    product = options.product or ("fragility" if sweep is None else "study")
    stage, ask = DELIVERABLES[product].stage, named(f"pipeline.status:{question}")
    job = job_of(options, sweep)
    if question == "plan" and options.graph is not None:
        _draw(stage, job, options.graph)
    if sweep is None:
        others = others_of(job) if product == "hazard" else ()
        answers = [ask(stage, job), *(ask(*other) for other in others)]
        return _told(Inspected(question, product, answers), options)
    swept = named("pipeline.workflow.sweeps:of_job")(sweep, stage, job)
    answers, reasons = named("pipeline.workflow.sweeps:asked")(ask, swept)
    members, folder = [member.name for member in sweep.members], str(swept.job.store.folder)
    compared = Comparison(folder, members, reasons)
    return _told(Inspected(question, product, answers, compared), options)


def _draw(stage: str, job: Job, path: Path) -> None:
    """Write the picture of a product's stages."""
    output.check("--graph", path, ".svg")
    found = graph.identities(stage, job.site, to_make=False)
    stages = {name: any(graph.why(BY_NAME[name], own, job.store)) for name, own in found.items()}
    svg = named("pipeline.inspection.picture:svg")(job.site.name, stages)
    output.put("--graph", path, writers.text(svg))
    log(f"-> {path}")


def completion(options: argparse.Namespace) -> int:
    """Print what completes the words of a command in a shell."""
    return show([script(options.shell, options.parser)])


def _told(answer: Answer, options: argparse.Namespace) -> int:
    """Print an answer: its lines, or JSON."""
    if not options.json:
        return show(answer.lines())
    return show([json.dumps(asdict(answer), ensure_ascii=False, allow_nan=False)])


def figures(options: argparse.Namespace) -> int:
    """Make figures of the paper, and the page of its claims."""
    make = named("pipeline.stages.figures.making:make")
    unresolved: int = make(options, cluster_of(vars(options)), log)
    log(f"-> {options.derived / 'figures' / 'claims.html'}")
    if unresolved:
        runs = form(unresolved, "run is", "runs are")
        complain(f"{unresolved} {runs} unresolved; responses.nc of each site says which")
    return unresolved


def feasible(options: argparse.Namespace) -> int:
    """Print and write what a table of hardware can do of a site's motions."""
    make = named("pipeline.stages.studies.feasible:make")
    if options.export is not None:
        located(Path.cwd(), options.export, "--export", "")
    job = job_of(options)
    with job.store, job.cluster:
        lines = make(job, options.table, Path(options.export) if options.export else None)
    for name in ("feasible.png", "feasible.csv"):
        log(f"-> {job.path(name)}")
    return show(lines)


def replay(options: argparse.Namespace) -> int:
    """Make a page that plays one run of a study, and the study as far as it needs it."""
    log(f"-> {replayed(options)}")
    return 0


def replayed(options: argparse.Namespace) -> Path:
    """The page of a replay."""
    make = named("pipeline.stages.replay.replay_page:make")
    given = {name: vars(options)[name] for name in ("yaw", "friction", "pgv_pga", "record", "pga")}
    job = job_of(options)
    with job.store, job.cluster:
        page = make(job, given, options.beside)
    return job.path(page)


def join(options: argparse.Namespace) -> int:
    """Take the runs of a study that other clients did in folders of their own."""
    make = named("pipeline.stages.runs.joining:make")
    job = job_of(options)
    with job.store, job.cluster:
        lines = make(job, options.folders)
    return show(lines)


def archive(options: argparse.Namespace) -> int:
    """Answer the rocks of an archive; those that cannot be read count as unresolved."""
    store, unanswered = named("pipeline.stages.archive.archive:make")(options)
    for name in ("archive.html", "archive.csv", "archive.nc"):
        log(f"-> {store.folder / name}")
    if unanswered:
        rows = form(unanswered, "row has", "rows have")
        complain(f"{unanswered} {rows} no answer, as told above")
    return int(unanswered)


def archive_equations(options: argparse.Namespace) -> int:
    """Make the equations of archives anew."""
    for line in named("pipeline.stages.archive.equations_making:make")(options, log):
        log(line)
    return 0


def index(options: argparse.Namespace) -> int:
    """Write the page that leads to all results."""
    page = front_page.renew(options.derived)
    if page is None:
        rule = "there are products in the folder, and it can be written to"
        remedy = "make one, e.g. make fragility SITE=cuboid_1x1x2"
        raise InputError(Problem(str(options.derived), "", "no index of results", rule, remedy))
    log(f"-> {page}")
    return 0


def list_known(options: argparse.Namespace) -> int:
    """Print sites, studies, tables and products."""
    return _told(Known(known(), known(STUDIES), known(TABLES), [*DELIVERABLES]), options)


def export(options: argparse.Namespace) -> int:
    """Write a bundle of a site's results."""
    make = named("pipeline.bundles.export:export")
    told = make(options.folder, options.to, inputs=not options.digests, licence=options.licence)
    for one in told.inputs:
        if not one.path:
            log(f"vsr: input {one.name} is not in it; its digest is")
    with suppress(OSError):
        if others := disk.parted(options.folder)[1]:
            log(f"vsr: {options.folder}{_left(options.folder, others)}")
    log(f"-> {options.to}")
    return 0


def check(options: argparse.Namespace) -> int:
    """Print what of a bundle does not match what is here; refused where it is not whole."""
    wrong, lines = named("pipeline.bundles.checking:check")(options.bundle)
    if wrong:
        file, remedy = str(options.bundle), "ask for it again"
        raise InputError(*(Problem(file, "", "", line, remedy) for line in wrong))
    show(lines or ["whole, and every product would be the same here"])
    return len(lines)


def compare(options: argparse.Namespace) -> int:
    """Print and write how two results differ."""
    parts = named("pipeline.bundles.comparison:compare")(options.one, options.other, options.to)
    lines = [f"{part.name}: {line}" for part in parts for line in part.lines]
    log(f"-> {options.to}")
    return show(lines or ["no difference"])


def doctor(options: argparse.Namespace) -> int:
    """Print what of this machine is fit for runs; what is not is refused at the end."""
    problems: list[Problem] = []
    checks = named("pipeline.inspection.doctor:examined")
    for name, found, error in checks(options.derived, cluster_of(vars(options))):
        if error is not None:
            problems += error.problems
        if error is not None or not options.quiet:
            show([f"{name:<13}{found or 'not well, see below'}"])
    if problems:
        raise InputError(*problems)
    return 0


def clean(options: argparse.Namespace) -> int:
    """Remove derived data; never data/raw."""
    site, derived = options.site, options.derived
    targets = disk.folders(derived)
    if site is not None:
        there = [str(target.relative_to(derived)) for target in targets]
        targets = [target for target in targets if target == derived / site]
        if not targets and site not in known():
            rule = f"there are results of {', '.join(there) or 'no site'}"
            raise InputError(Problem("--site", "", repr(site), rule, "omit it to remove all"))
    if options.older is not None:
        targets = [target for target in targets if (disk.age(target) or 0.0) >= options.older]
    linked = [target for target in targets if disk.is_linked(target, derived)]
    for target in linked:
        show([f"{target}: a link, which is left"])
    targets = [target for target in targets if target not in linked]
    if not targets:
        show(["nothing derived to remove"])
        return 0
    freed = 0
    for target in targets:
        with writing(target):
            results, others = disk.parted(target)
            size = sum(path.lstat().st_size for path in results)
        show([f"{target}: {disk.told(size, disk.age(target))}{_left(target, others)}"])
        freed += size
    names = f"{', '.join(map(str, targets))}, which frees {freed / 1e6:.1f} MB"
    if not options.yes and not _agreed(f"remove {names}? [y/N] "):
        show(["kept"])
        return 0
    for target in targets:
        disk.remove(target)
    return 0


def _left(folder: Path, others: list[Path]) -> str:
    """What is left in a folder of results, in words."""
    names = [printable(str(path.relative_to(folder))) for path in others[:MOST_NAMED]]
    if more := len(others) - len(names):
        names.append(f"{more} more")
    return f"; left, as no results: {', '.join(names)}" if names else ""


def _agreed(question: str) -> bool:
    try:
        return input(question).strip().lower() == "y"
    except EOFError:  # nobody to ask
        return False


def init(options: argparse.Namespace) -> int:
    """Write a commented site, its schema and a README into a new folder."""
    folder: Path = options.folder
    name = folder.resolve().name
    if not is_text(str(folder)):
        rule, remedy = "a name is text in UTF-8", "give another"
        raise InputError(Problem("vsr init", "", str(folder), rule, remedy))
    if folder.exists():
        rule, remedy = "the folder exists", "give the name of a new one"
        raise InputError(Problem("vsr init", "", str(folder), rule, remedy))
    with writing(folder):
        new = [one for one in (folder, *folder.parents) if not one.exists()]
        try:
            folder.mkdir(parents=True)
            _write_site(folder, name)
        except FileExistsError:  # another command's
            raise
        except OSError:
            shutil.rmtree(new[-1], ignore_errors=True)
            raise
    log(f"-> {folder / name}.yaml")
    return 0


def _write_site(folder: Path, name: str) -> None:
    """Write the files of a new site."""
    for source, target in (("site.yaml", f"{name}.yaml"), ("README.md", "README.md")):
        text = (CONFIGS / "new" / source).read_text(encoding="utf-8")
        text = text.replace("../schema.json", "schema.json").replace("NAME", name)
        (folder / target).write_text(text, encoding="utf-8")
    shutil.copyfile(CONFIGS / "schema.json", folder / "schema.json")


def fetch(options: argparse.Namespace) -> int:
    """Download a public original."""
    path = named("pipeline.stages.mesh.fetch:fetch")(options.name, options.url)
    log(f"-> {path}")
    return 0


COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": run,
    "prep": prep,
    **{question: partial(_inspected, question) for question in ("plan", "status", "why")},
    "figures": figures,
    "feasible": feasible,
    "replay": replay,
    "join": join,
    "archive": archive,
    "archive-equations": archive_equations,
    "index": index,
    "doctor": doctor,
    "completion": completion,
    "export": export,
    "check": check,
    "compare": compare,
    "list": list_known,
    "clean": clean,
    "init": init,
    "fetch": fetch,
}
"""By the names that the command line takes."""
