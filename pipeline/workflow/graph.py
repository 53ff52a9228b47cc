"""The graph of stages: what is asked for, what is fresh, why not, and making it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pipeline.config.layers import Site
from pipeline.config.problems import InputError
from pipeline.workflow import aside, keys
from pipeline.workflow.registry import BY_NAME, upstream
from pipeline.workflow.run_store import RunsLost
from pipeline.workflow.stage import Job, Product, Refusal, Stage
from pipeline.workflow.store import Store
from vsr_core.source import tracing


@dataclass(frozen=True)
class Identity:
    """What a stage's product is made from, and the key of it all."""

    facts: dict[str, Any]

    @property
    def key(self) -> str:
        """Digest of the facts."""
        return keys.digest(self.facts)


def identities(name: str, site: Site) -> dict[str, Identity]:
    """Identity of each stage that a product needs and that applies, each after what it needs."""
    found: dict[str, Identity] = {}
    for stage in upstream(name):
        if not stage.is_for(site.settings):
            continue
        found[stage.name] = Identity(
            {
                "config": stage.settings(site.settings),
                "code": tracing.reached(stage.roots()),
                "inputs": stage.input_digests(site),
                "versions": {
                    library: keys.installed_version(library) for library in stage.versions
                },
                "needs": {need: found[need].key for need in stage.needs if need in found},
            }
        )
    return found


def why(stage: Stage, identity: Identity, store: Store) -> Iterator[str]:
    """Reasons why a stage has to be made; none if its products are fresh."""
    manifest = store.manifest(stage.name)
    if manifest is None:
        yield "never made here"
        return
    damage = store.damage(stage.name) or stage.fault(store)
    if damage:
        yield damage
    if manifest["retry"]:
        yield f"{manifest['retry']} runs crashed and are tried again"
    if manifest["key"] != identity.key:
        yield from _differences(manifest["facts"], identity.facts)


def _differences(old: dict[str, Any], new: dict[str, Any]) -> Iterator[str]:
    was, now = (dict(_leaves(facts["config"])) for facts in (old, new))
    for key in sorted(now):
        if was.get(key) != now[key]:
            yield f"{key} changed: {_change(was.get(key), now[key])}"
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
    for need in sorted(new["needs"]):
        if old["needs"].get(need) != new["needs"][need]:
            yield f"stage {need} changed"


def make(name: str, job: Job) -> int:
    """Bring a product up to date; returns the number of unresolved runs."""
    wanted = identities(name, job.site)
    _forget_crashed(name, job.store)
    try:
        _make_all(wanted, job)
    except RunsLost as lost:
        for problem in lost.problems:
            job.log(f"{problem.file}: {problem.given}; they are done again")
        _make_all(wanted, job)
    manifests = (job.store.manifest(stage) or {"unresolved": 0} for stage in wanted)
    return max(int(manifest["unresolved"]) for manifest in manifests)


def _make_all(wanted: dict[str, Identity], job: Job) -> None:
    """Make the stages that are not fresh, some of them beside others."""
    under_way: dict[str, Callable[[], str]] = {}
    ahead = list(wanted)
    waited_for = {need for needed in wanted for need in BY_NAME[needed].late}

    def awaited(name: str) -> None:
        if name in under_way:
            for coming in ahead:  # meanwhile, what will be needed next
                BY_NAME[coming].get_ready(job.site)
            job.log(under_way.pop(name)())

    for needed, identity in wanted.items():
        stage = BY_NAME[needed]
        ahead.remove(needed)
        # What reads the user's files ends, or refuses them, before anything else is made.
        for other in (under_way.keys() - waited_for) | (set(stage.needs) - set(stage.late)):
            awaited(other)
        if not _is_ours_to_make(stage, identity, job.store):
            continue
        own = replace(job, awaited=awaited)
        if aside.POSSIBLE and job.cluster.free and stage.is_made_aside(job.site.settings):
            # A copy of a process that once had workers cannot have any: Dask's threads are gone.
            own = replace(own, cluster=job.cluster.in_process())
            under_way[needed] = aside.begin(partial(_make, stage, identity, own))
        else:
            job.log(_make(stage, identity, own))
    for needed in tuple(under_way):
        awaited(needed)


def _is_ours_to_make(stage: Stage, identity: Identity, store: Store) -> bool:
    """Whether a stage is not fresh; if so the folder is owned from then on."""
    if not any(why(stage, identity, store)):
        return False
    just_owned = store.open()  # until when another command may have made it
    return not just_owned or any(why(stage, identity, store))


def _make(stage: Stage, identity: Identity, job: Job) -> str:
    """Make and keep a stage's products; returns a line that says so."""
    if lender := job.store.borrow(stage.name, identity.key):
        return f"{stage.name}: as in {lender}"
    try:
        product = stage.product(replace(job, key=identity.key, stage=stage.name))
    except Refusal as refusal:
        if not job.shows:
            raise InputError(*refusal.problems) from None
        job.store.show(stage.name, refusal.files)
        raise refusal.shown_in(job.store.folder) from None
    keep(stage, identity, product, job.store)
    return f"{stage.name}: {product.summary}"


def keep(stage: Stage, identity: Identity, product: Product, store: Store) -> None:
    """Write what a stage made, and what it was made from."""
    facts = {
        "key": identity.key,
        "facts": identity.facts,
        "unresolved": product.unresolved,
        "retry": product.retry,
    }
    store.publish(stage.name, facts, product.files)


def _forget_crashed(name: str, store: Store) -> None:
    """Forget stages with crashed runs, and all that was made from them."""
    forgotten: set[str] = set()
    for stage in upstream(name):
        crashed = (store.manifest(stage.name) or {"retry": 0})["retry"]
        if crashed or forgotten.intersection(stage.needs):
            store.open()
            store.forget(stage.name)
            forgotten.add(stage.name)


def _leaves(tree: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Values of a configuration by dotted key."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _change(old: Any, new: Any) -> str:
    if isinstance(old, list) and isinstance(new, list):
        added, removed = (
            len(set(map(str, new)) - set(map(str, old))),
            len(set(map(str, old)) - set(map(str, new))),
        )
        return f"{added} values added, {removed} removed"
    return f"{old!r} is now {new!r}"
