"""From the options of a command to the job that it asks for."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.config.layers import Site, layers_of, load_site
from pipeline.config.problems import InputError, Problem
from pipeline.config.set_once import check_set_once, values_of
from pipeline.config.slips import warnings
from pipeline.config.sweep import Sweep, load_sweep
from pipeline.config.yaml_text import in_yaml
from pipeline.workflow import graph, site_folder
from pipeline.workflow.cluster import Cluster
from pipeline.workflow.log import complain, log
from pipeline.workflow.outside_settings import check_settings
from pipeline.workflow.products import DELIVERABLES, GRIDDED
from pipeline.workflow.stage import Job, named
from pipeline.workflow.store import Store


def check_asked(stage: str, job: Job) -> None:
    """Refuse an ensemble where nothing is drawn, and observations where there are none."""
    if stage in ("uncertainty", "observations"):
        _check_drawn(job)
    if stage == "observations":
        _check_observed(job)


def _check_drawn(job: Job) -> None:
    if job.config.uncertain:
        return
    if job.config.on_own_ground:
        key, given = "pedestal.mesh", "a terrain in a file of its own"
        rule, remedy = "seats are drawn of a scan that holds both", "set pedestal.shape: flat"
    else:
        key, given = "uncertainty.members", "0"
        rule, remedy = "rocks are drawn, one a member", "give a number of draws, such as 32"
    raise InputError(Problem(job.site.file_of(key), key, given, rule, remedy))


def _check_observed(job: Job) -> None:
    if not job.config.observed:
        rule, remedy = "draws are weighed by what was observed", "give one, such as a tilt test"
        file = job.site.file_of("observations")
        raise InputError(Problem(file, "observations", "none", rule, remedy))


def others_of(job: Job) -> Iterator[tuple[str, Job]]:
    """Stages and jobs of other rocks and settings, whose fragilities a site's hazard reads."""
    graph.checked("hazard", job)  # refused before anything is made
    found = named("pipeline.stages.hazard.other_rocks:find")(job.config.hazard, job.site)
    for line in found.told:
        complain(f"vsr: warning: {line}")
    for other in found.made:
        store = Store(other.folder(job.store.folder))
        yield other.stage, replace(job, site=other.site, store=store)


def _settings(given: dict[str, Any]) -> tuple[str, ...]:
    """Settings of the command line: ``--set``, and what has an option of its own.

    Raises
    ------
    InputError
        If one is given by both.
    """
    found = list(given["settings"])
    check_set_once(found)
    _check_given_once(given)
    for one, other in (("curves", "events"), ("events", "curves")):
        if given.get(one) is not None:
            found += [f"hazard.{one}={in_yaml(given[one])}", f"hazard.{other}=null"]
    if given.get("age") is not None:
        age = {"kind": "normal", "mean": given["age"], "sd": given.get("age_sd") or 0.0}
        age["source"] = ""  # that of the configuration is of another age
        found.append(f"hazard.age={in_yaml(age)}")
    elif given.get("age_sd") is not None:
        found.append(f"hazard.age.sd={in_yaml(given['age_sd'])}")
    return tuple(found)


def _check_given_once(given: dict[str, Any]) -> None:
    """Refuse a setting that an option stands over, as it would be dropped."""
    values = (one for layer in layers_of(given["settings"]) for one in values_of(layer))
    known = [".".join(key) for key, value in values if value is not None]
    either = ("hazard.curves", "hazard.events")
    age = {"age": ("hazard.age",), "age_sd": ("hazard.age.sd",)}
    for option, keys in ({"curves": either, "events": either} | age).items():
        for key in keys if given.get(option) is not None else ():
            if any(f"{one}.".startswith(f"{key}.") for one in known):
                option = option.replace("_", "-")
                said, rule = f"--set {key} beside it", "one of them is given"
                remedy = f"leave out --{option}, or --set {key}"
                raise InputError(Problem(f"--{option}", key, said, rule, remedy))


def sweep_of(options: argparse.Namespace) -> Sweep | None:
    """What the study of a command sweeps over."""
    product = options.product or "study"
    study, stage = options.study, DELIVERABLES[product].stage
    found = None
    if study is not None and product != "validation":
        found = load_sweep(options.site, study, _settings(vars(options)), gridded=stage in GRIDDED)
    if options.product == "study" and found is None:
        rule = f"{study} has no sweep" if study else "no study given"
        remedy = "give one with a sweep, e.g. --study friction, or with make STUDY=friction"
        raise InputError(Problem("--study", "", "", rule, remedy))
    return found


def job_of(options: argparse.Namespace, sweep: Sweep | None = None) -> Job:
    """What a command asks for."""
    given = vars(options)
    if given.get("product") == "validation":
        site_of = named("pipeline.stages.studies.validation.recorded_tests:site_of")
        if not options.table:
            rule = "no folder of shake-table tests given"
            remedy = "give one, e.g. --table my_tests, or with make TABLE=my_tests"
            raise InputError(Problem("--table", "", "", rule, remedy))
        site = site_of(Path(options.table))
    elif sweep is not None:
        site = sweep.reference.site
    else:
        site = load_site(options.site, options.study, _settings(given))
    sites = [site] if sweep is None else [member.site for member in sweep.members]
    for one in ("curves", "events"):
        if given.get(one) is not None:  # beside who gives them, not beside the site's YAML
            for each in sites:
                each.places["hazard", one] = (f"--{one}", Path.cwd())
    if sweep is not None and given.get("product") == "hazard":
        _check_alone(sites)
    for warning in dict.fromkeys(str(one) for each in sites for one in warnings(each)):
        complain(f"vsr: warning: {warning}")
    store = site_folder.store_of(site, options.derived, given.get("name"))
    if store.runs.name != site.name:
        log(f"vsr: results of another {site.name}.yaml are there; those of this: {store.folder}")
    return Job(site, store, cluster_of(given), log)


def _check_alone(sites: list[Site]) -> None:
    """Refuse a sweep of the hazard of a rock beside which others are made, each with its runs."""
    for site in sites:
        for key in ("rocks", "compare", "history"):
            if getattr(site.config.hazard, key):
                place, rule = f"hazard.{key}", "a sweep of a hazard is one of a single rock"
                remedy = f"give --set {place}=[], or a command for each value"
                raise InputError(Problem(site.file_of(place), place, "", rule, remedy))


def cluster_of(given: dict[str, Any]) -> Cluster:
    """The workers that the options name; all cores of this machine by default."""
    check_settings()
    workers = given.get("workers")
    elsewhere = given.get("scheduler") or given.get("scheduler_file")
    if elsewhere and workers is not None:
        rule, remedy = "a scheduler that exists has its own workers", "leave one of the two out"
        raise InputError(Problem("--workers", "", f"{workers} beside {elsewhere}", rule, remedy))
    return Cluster(
        cores() if workers is None else workers,
        given.get("scheduler"),
        given.get("scheduler_file"),
        given.get("cluster") == "slurm",
        log,
    )


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
