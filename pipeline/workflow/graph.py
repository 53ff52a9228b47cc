"""The graph of stages: what is asked for, what is fresh, why not, and making it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from pipeline.config.layers import Site
from pipeline.config.problems import InputError, Problem, edited_since
from pipeline.workflow import aside, keys, pages, site_folder
from pipeline.workflow.grammar import counted, listed
from pipeline.workflow.log import complain
from pipeline.workflow.parameters import WORK, Asked, Made, Parts, Setting, Values, changes
from pipeline.workflow.registry import (
    BY_NAME,
    FINDERS,
    MAKERS,
    asked,
    inputs_of,
    needs,
    settings_of,
    upstream,
)
from pipeline.workflow.run_store import RUNS, RunsLost, is_there
from pipeline.workflow.stage import Input, Job, Product, Refusal, Stage, Work, named
from pipeline.workflow.store import Store
from vsr_core.errors import reason
from vsr_core.source import tracing

T = TypeVar("T")


@dataclass(frozen=True)
class Identity:
    """What a stage's product is made from, and the key of it all.

    Attributes
    ----------
    inputs : dict, what was found besides the configuration, by the paths of its classes
    """

    facts: dict[str, Any]
    inputs: dict[str, Input | None] = field(default_factory=dict, compare=False)

    @property
    def key(self) -> str:
        """Digest of the facts."""
        return keys.digest(self.facts)


def identities(name: str, site: Site, *, to_make: bool = True) -> dict[str, Identity]:
    """Identity of each stage that a product needs and that applies, each after what it needs.

    What cannot be made is refused where it is ``to_make``; a plan tells what it would cost.
    """
    found: dict[str, Identity] = {}
    inputs: dict[str, Input | None] = {}
    values = Values(site.settings)
    stages = [stage for stage in upstream(name) if stage.applies(site.settings)]
    for stage in stages:
        for path in filter(None, (stage.refuses, stage.bounds if to_make else "")):
            named(path)(site)
    for stage in stages:
        for path in inputs_of(stage.make):
            if path not in inputs:
                inputs[path] = _found(path, site)
        own = {path: inputs[path] for path in inputs_of(stage.make)}
        above = {need: found[need].key for need in needs(stage.name) if need in found}
        found[stage.name] = identity(stage, values, own, above)
    return found


def checked(name: str, job: Job) -> dict[str, Identity]:
    """The same of a job; what is read from where its results go is refused."""
    found = identities(name, job.site)
    inputs = (one for part in found.values() for one in part.inputs.values())
    for one in filter(None, inputs):
        job.store.check_apart(one.files_read())
    return found


def identity(
    stage: Stage, values: Values, inputs: dict[str, Input | None], above: dict[str, str]
) -> Identity:
    """What a stage's product is made from.

    Parameters
    ----------
    above : dict, keys of the products that it needs
    """
    config = {key: values.plain(key) for key in sorted(settings_of(stage.make))}
    given = {path: one.digests_as_read() for path, one in inputs.items() if one is not None}
    return made_from(stage, config, _by_name(given), above, inputs)


def _by_name(given: dict[str, dict[str, str]]) -> dict[str, str]:
    """Digests of what is read, by its name."""
    digests: dict[str, str] = {}
    for path, one in given.items():
        for name, digest in one.items():
            digests[f"{name} ({path})" if name in digests else name] = digest
    return digests


def made_from(
    stage: Stage,
    config: dict[str, Any],
    digests: dict[str, str],
    above: dict[str, str],
    inputs: dict[str, Input | None] | None = None,
) -> Identity:
    """The identity of what is made from some settings, files and products."""
    roots = [stage.make, *stage.code]
    for path, one in (inputs or {}).items():
        roots += [FINDERS[path].find, *(one.code if one is not None else ())]
    code = tracing.reached(roots)
    digests = digests | {name: pages.digest(name) for name in stage.files}
    versions = {library: keys.installed_version(library) for library in stage.versions}
    facts = {"config": config, "code": code, "inputs": digests, "versions": versions}
    return Identity({**facts, "needs": above}, inputs or {})


def _found(path: str, site: Site) -> Input | None:
    nothing: dict[Made, Any] = {}  # an input is found before any product is made
    found: Input | None = _built(asked(FINDERS[path].find), site, nothing.__getitem__)
    return found


def _built(parts: Parts, site: Site, made: Callable[[Made], Any], work: Work | None = None) -> Any:
    """Call a function, or a class, with what its parameters stand for, and nothing else."""
    values = Values(site.settings)

    def value(one: Asked) -> Any:
        if isinstance(one, Setting):
            return values.given(one.key)
        if isinstance(one, Made):
            return made(one)
        if isinstance(one, Parts):
            return _built(one, site, made, work)
        return work if one.what == WORK else site.origin

    return named(parts.path)(**{name: value(one) for name, one in parts.asked.items()})


def why(stage: Stage, identity: Identity, store: Store) -> Iterator[str]:
    """Reasons why a stage has to be made; none if its products are fresh."""
    manifest = store.manifest(stage.name)
    if manifest is None:
        yield "never made here"
        return
    if damage := store.damage(stage.name):
        yield damage
    elif stage.in_database and not is_there(store.runs):
        yield f"{RUNS} is missing"
    if manifest["retry"]:
        yield f"{counted(manifest['retry'], 'run')} crashed before"
    if manifest["key"] != identity.key:
        yield from differences(manifest["facts"], identity.facts)


def differences(old: dict[str, Any], new: dict[str, Any]) -> Iterator[str]:
    """What tells the facts of two identities apart, in words."""
    yield from changes(old["config"], new["config"])
    for part, label in (("inputs", "file"), ("versions", "version of"), ("code", "code")):
        for item in sorted({*old[part], *new[part]}):
            if old[part].get(item) != new[part].get(item):
                verb = (
                    "new"
                    if item not in old[part]
                    else "gone"
                    if item not in new[part]
                    else "edited"
                )
                yield f"{label} {item} {verb}"
    for need in sorted({*old["needs"], *new["needs"]}):
        if old["needs"].get(need) != new["needs"].get(need):
            yield f"stage {need} changed" if need in new["needs"] else f"no stage {need} any more"


def make(name: str, job: Job) -> int:
    """Bring a product up to date; returns the number of unresolved runs."""
    wanted = checked(name, job)
    _forget_crashed(name, job.store)
    try:
        _Making(wanted, job).all()
    except RunsLost as lost:
        for problem in lost.problems:
            complain(f"vsr: warning: {problem.file}: {problem.given}; they are done again")
        for stage in wanted:
            if BY_NAME[stage].in_database:
                job.store.forget(stage)
        _Making(wanted, job).all()
    site_folder.settle(job)
    site_folder.mark(job)
    manifests = [job.store.manifest(stage) or {"unresolved": 0} for stage in wanted]
    for warning in filter(None, (manifest.get("warning") for manifest in manifests)):
        complain(f"vsr: warning: {job.store.folder}: {warning}")
    return max(int(manifest["unresolved"]) for manifest in manifests)


def built(what: type[T], job: Job) -> T:
    """A product that is there, or a class whose fields are settings and such products."""
    path = f"{what.__module__}:{what.__name__}"
    if path in MAKERS:
        found: T = _Products({}, job).get(Made(path))
    else:
        inputs = {product: _found(product, job.site) for product in inputs_of(path)}
        found = _built(asked(path), job.site, _Products(inputs, job).get)
    return found


class _Products:
    """Products and inputs as functions ask for them, each loaded once."""

    def __init__(
        self,
        inputs: dict[str, Input | None],
        job: Job,
        awaited: Callable[[str], None] = lambda name: None,
    ) -> None:
        self._inputs, self._job, self._awaited = inputs, job, awaited
        self._loaded: dict[str, Any] = {}

    def get(self, one: Made) -> Any:
        """Load a product, or say how to."""
        if one.product in FINDERS:
            return self._inputs[one.product]
        return partial(self._load, one.product) if one.late else self._load(one.product)

    def _load(self, product: str) -> Any:
        stage = BY_NAME[MAKERS[product]]
        if not stage.applies(self._job.site.settings):
            return None
        self._awaited(stage.name)
        if product not in self._loaded:
            load = getattr(named(product), "load")  # noqa: B009 (of a class, as the checker sees)
            self._loaded[product] = load(self._job.store)
        return self._loaded[product]


class _Making:
    """Making stages that are not fresh, some of them beside others."""

    def __init__(self, wanted: dict[str, Identity], job: Job) -> None:
        self._wanted, self._job = wanted, job
        self._under_way: dict[str, aside.Begun[str]] = {}
        self._ahead = list(wanted)
        inputs = {path: one for part in wanted.values() for path, one in part.inputs.items()}
        self._products = _Products(inputs, job, self._awaited)

    def all(self) -> None:
        """Make them in their order; what is made aside ends where this does."""
        try:
            self._all()
        finally:
            for one in self._under_way.values():
                one.stop()

    def _all(self) -> None:
        late = {need for name in self._wanted for need in needs(name, late=True)}
        for name, own in self._wanted.items():
            stage = BY_NAME[name]
            self._ahead.remove(name)
            # What reads the user's files ends, or refuses them, before anything else is made.
            for other in (self._under_way.keys() - late) | set(needs(name, late=False)):
                self._awaited(other)
            if _is_ours_to_make(stage, own, self._job.store):
                self._begin(stage, own)
        for name in tuple(self._under_way):
            self._awaited(name)

    def _begin(self, stage: Stage, own: Identity) -> None:
        job = self._job
        if aside.possible() and job.cluster.free and stage.aside(job.site.settings):
            # A copy of a process that once had workers cannot have any: Dask's threads are gone.
            alone = replace(job, cluster=job.cluster.in_process())
            self._under_way[stage.name] = aside.Begun(partial(self._make, stage, own, alone))
        else:
            job.log(self._make(stage, own, job, settles=True))

    def _awaited(self, name: str) -> None:
        if name not in self._under_way:
            return
        for coming in self._ahead:  # meanwhile, what will be needed next
            named(BY_NAME[coming].make)
            for one in self._wanted[coming].inputs.values():
                if one is not None:
                    one.get_ready()
        line = self._under_way[name]()
        del self._under_way[name]
        site_folder.settle(self._job)
        self._job.log(line)

    def _make(self, stage: Stage, own: Identity, job: Job, *, settles: bool = False) -> str:
        """Make and keep a stage's products; returns a line that says so."""
        if lender := job.store.borrow(stage.name, own.key):
            return f"{stage.name}: as in {lender}"
        work = work_of(stage.name, own.key, job)
        try:
            product: Product = _built(asked(stage.make), job.site, self._products.get, work)
        except Refusal as refusal:
            if not job.shows:
                raise InputError(*refusal.problems) from None
            job.store.show(stage.name, refusal.files)
            raise refusal.shown_in(job.store.folder) from None
        except FileNotFoundError as error:
            folder = job.store.folder
            if not Path(str(error.filename)).resolve().is_relative_to(folder.resolve()):
                raise
            given = f"a folder from which files are gone since ({reason(error)})"
            rule = "nothing else changes a folder in which a command is at work"
            raise InputError(
                Problem(str(folder), "", given, rule, "give the same command again")
            ) from None
        _check_unedited(stage, own, job)
        if settles:
            site_folder.settle(job)
        keep(stage.name, own, product, job.store)
        return f"{stage.name}: {product.summary}"


def _check_unedited(stage: Stage, own: Identity, job: Job) -> None:
    """Refuse what was made of files, or by code, of which some is not that of its key any more."""
    of_pages = {name: own.facts["inputs"][name] for name in stage.files}
    given = {path: one.digests() for path, one in own.inputs.items() if one is not None}
    code = tracing.by_now(own.facts["code"])
    check_same(own, {"inputs": _by_name(given) | of_pages, "code": code}, job)


def check_same(own: Identity, now: dict[str, Any], job: Job) -> None:
    """Refuse what is made of other than its key stands for, as facts say by now."""
    edited = [*differences(own.facts, own.facts | now)]
    if edited:
        given = f"{listed(edited)} while a command that reads it was at work"
        raise edited_since(job.site.file, given)


def work_of(stage: str, key: str, job: Job) -> Work:
    """What the function of a stage works with."""
    site, store = job.site, job.store
    provenance = {
        "history": f"made by stage {stage} from {site.label}",
        "vsr_key": key,
        "vsr_config_json": json.dumps(site.settings.model_dump(mode="json"), sort_keys=True),
    }
    return Work(
        stage,
        site.origin,
        job.cluster,
        job.log,
        store.runs,
        store.up,
        site.settings.engine,
        provenance,
        partial(store.note, stage),
        store.notes,
    )


def _is_ours_to_make(stage: Stage, identity: Identity, store: Store) -> bool:
    """Whether a stage is not fresh; if so the folder is owned from then on."""
    if not any(why(stage, identity, store)):
        return False
    just_owned = store.open()  # until when another command may have made it
    return not just_owned or any(why(stage, identity, store))


def keep(name: str, identity: Identity, product: Product, store: Store) -> None:
    """Write what a stage made, and what it was made from."""
    facts = {
        "key": identity.key,
        "facts": identity.facts,
        "unresolved": product.unresolved,
        "retry": product.retry,
        "warning": product.warning,
    }
    store.publish(name, facts, product.files)


def _forget_crashed(name: str, store: Store) -> None:
    """Forget stages with crashed runs, and all that was made from them."""
    forgotten: set[str] = set()
    for stage in upstream(name):
        crashed = (store.manifest(stage.name) or {"retry": 0})["retry"]
        if crashed or forgotten.intersection(needs(stage.name)):
            store.open()
            store.forget(stage.name)
            forgotten.add(stage.name)
