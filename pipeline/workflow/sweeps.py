"""The members of a sweep: their folders, what is to do for them, and making them one by one.

Members are sites of their own beneath the site's folder. Their runs are in the site's database,
and what the site or one of them has made under the same key is not made again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any, TypeVar

from pipeline.config.problems import InputError, Problem, edited_since
from pipeline.config.slips import UNUSED
from pipeline.config.sweep import GRIDS, Member, Sweep
from pipeline.workflow import graph
from pipeline.workflow.datasets import catalogue
from pipeline.workflow.graph import Identity
from pipeline.workflow.jobs import check_asked
from pipeline.workflow.registry import BY_NAME, upstream
from pipeline.workflow.stage import Job, Product, Stage, named
from pipeline.workflow.store import Store

Answer = TypeVar("Answer")

FOLDER = "studies"
"""Of the sweeps of a site, in its own folder."""

DATA, PAGE = "study.nc", "study.html"

COMPARISON = Stage(
    "study",
    make="pipeline.stages.studies.sweeps.study:make",
    files=("study.html", "catalogue.yaml"),
    versions=("xarray", "matplotlib", "jinja2"),
)
"""What is made of all members, after them."""

COMPARED = {"report": "fragility"}
"""What a page is of, which reads keys for its words only: its members are compared by that."""


@dataclass(frozen=True)
class Swept:
    """A sweep, and the jobs of its members."""

    sweep: Sweep
    stage: str
    job: Job
    jobs: dict[tuple[int, ...], Job]


def of_job(sweep: Sweep, stage: str, job: Job) -> Swept:
    """Give each member a folder."""
    for one in sweep.dimensions:
        if one.name in catalogue() and one.name != GRIDS.get(one.key):
            rule = f"it stands for another thing in {DATA}: {catalogue()[one.name]['long_name']}"
            raise InputError(
                Problem(sweep.file, f"sweep.{one.name}", repr(one.name), rule, "rename it")
            )
    folder = job.store.folder / FOLDER / sweep.study
    lenders: dict[tuple[str, str], Store] = {}
    stages = [one.name for one in upstream(stage)]
    Store(job.store.folder, None, lenders).lends(stages)
    jobs = {}
    for member in sweep.members:
        store = Store(folder / member.name, job.store, lenders)
        store.lends(stages)
        job.store.check_apart(member.site.read)
        log = partial(_log, job, member)
        jobs[member.place] = replace(job, site=member.site, store=store, log=log)
        check_asked(stage, jobs[member.place])  # a stage that does not apply has no key
    whole = replace(job, site=sweep.reference.site, store=Store(folder, job.store))
    return Swept(sweep, stage, whole, jobs)


def make(swept: Swept) -> int:
    """Bring all members up to date, and what is made of them."""
    wanted = _wanted(swept)  # all input is read, or refused, before anything is made
    stages = [stage.name for stage in upstream(swept.stage)]
    for member in swept.jobs.values():
        _check(swept.stage, member)
        member.store.lends(stages)
    unresolved = 0
    for member in swept.jobs.values():
        unresolved += graph.make(swept.stage, member)
        member.store.lends(stages)
    if any(graph.why(COMPARISON, wanted, swept.job.store)):
        _check_members(swept, wanted)
        swept.job.store.open()
        product: Product = named(COMPARISON.make)(swept, wanted.key)
        graph.check_same(wanted, _wanted(swept).facts, swept.job)
        graph.keep(COMPARISON.name, wanted, product, swept.job.store)
        swept.job.log(f"study: {product.summary}")
    return unresolved


def _check_members(swept: Swept, wanted: Identity) -> None:
    """Refuse a member that was made of files as they were between those of the others."""
    for member in swept.sweep.members:
        manifest = swept.jobs[member.place].store.manifest(swept.stage)
        if manifest is None or manifest["key"] != wanted.facts["needs"][member.name]:
            graph.check_same(wanted, _wanted(swept).facts, swept.job)  # names the file, if it can
            given = f"{member.name} made of files as they were in between"
            raise edited_since(swept.job.site.file, given)


def asked(question: Callable[[str, Job], Answer], swept: Swept) -> tuple[list[Answer], list[str]]:
    """Ask something of every member, and why the comparison is not done."""
    wanted = _wanted(swept)
    reasons = list(graph.why(COMPARISON, wanted, swept.job.store))
    jobs = [swept.jobs[member.place] for member in swept.sweep.members]
    return [question(swept.stage, job) for job in jobs], reasons


def _check(stage: str, member: Job) -> None:
    """See that a member's runs can be done, before those of any are."""
    wanted = graph.identities(stage, member.site).get("time_step")
    if wanted is None or not any(graph.why(BY_NAME["time_step"], wanted, member.store)):
        return
    graph.make("rock", member)
    named("pipeline.stages.runs.scenes:refuse_runs")(member)


def _wanted(swept: Swept) -> Identity:
    """Identity of the comparison: what is swept, its reference, code, and keys of the members."""
    sweep = swept.sweep
    dimensions: dict[str, Any] = {
        one.name: {key: list(values) for key, values in one.values.items()}
        for one in sweep.dimensions
    }
    found = {m.name: graph.checked(swept.stage, swept.jobs[m.place]) for m in sweep.members}
    of = COMPARED.get(swept.stage, swept.stage)
    _refuse_idle(swept, of, {name: stages[of].key for name, stages in found.items()})
    needs = {name: stages[swept.stage].key for name, stages in found.items()}
    reference = {one.name: one.labels[one.reference] for one in sweep.dimensions}
    asked = {"sweep": dimensions, "reference": reference, "product": swept.stage}
    return graph.made_from(COMPARISON, asked, {}, needs)


def _refuse_idle(swept: Swept, of: str, keys: dict[str, str]) -> None:
    """Refuse a dimension along which nothing changes of what is compared, by the key of each.

    So is one of settings that have no part in any member, though keys change; draws have a
    restitution of their own.
    """
    members = swept.sweep.members
    drawn = {"uncertainty", "observations"} & {stage.name for stage in upstream(of)}
    for n, one in enumerate(swept.sweep.parted):
        file, key, given = swept.sweep.file, f"sweep.{one.name}", ", ".join(one.values)
        idle = [
            (rule, remedy, {*keys_of.split()} & one.values.keys())
            for keys_of, (beside, value), rule, remedy in UNUSED
            if {attrgetter(beside)(m.site.settings) for m in members} == {value}
            and not (drawn and beside == "contact.restitution")
        ]
        if one.values.keys() <= set().union(*(own for *_, own in idle)):
            rule, remedy, _ = max(idle, key=lambda entry: len(entry[-1]))
            raise InputError(Problem(file, key, given, rule, remedy))
        found = {(m.place[:n], m.place[n + 1 :], keys[m.name]) for m in members}
        if len(found) * len(one.labels) == len(members) > len(found):
            rule = f"{of} does not depend on it here"
            remedy = "sweep a product that does, or set what uses it (for a servo, drive: servo)"
            raise InputError(Problem(file, key, given, rule, remedy))


def _log(job: Job, member: Member, line: str) -> None:
    job.log(f"{member.name}: {line}")
