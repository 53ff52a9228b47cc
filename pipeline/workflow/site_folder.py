"""The folder of a site holds products of one configuration: which, and what others left there.

The settings stand beside the products as YAML, written before the first product that is made of
them. What other settings made stays until it is made anew, and is marked: in its manifest, which
``status`` and the index read, and at the head of its pages.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import yaml

from pipeline.config.layers import Site
from pipeline.config.problems import InputError, Problem
from pipeline.workflow import keys
from pipeline.workflow.parameters import Values, changes
from pipeline.workflow.stage import Job
from pipeline.workflow.store import Store
from pipeline.workflow.writers import text

SETTINGS, FILE = "settings", "config.yaml"
"""Name of the manifest of the settings, and their file."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}")


def store_of(site: Site, derived: Path, variant: str | None) -> Store:
    """Where the products of a site go.

    A variant has a folder of its own and the runs of the site. Two files of one name in different
    places are two sites, the second of which has more in its folder's name.

    Parameters
    ----------
    variant : str, its name, or None for the site itself

    Raises
    ------
    InputError
        For a name that is none, and for a folder that holds a file which the settings are from.
    """
    if variant is not None and not _NAME.fullmatch(variant):
        rule, remedy = "it has letters, digits, points and dashes", "e.g. --name rough"
        raise InputError(Problem("--name", "", repr(variant), rule, remedy))
    name = site.name
    of_variant = "" if variant is None else f"@{variant}"
    stores = (Store(derived / one) for one in (name, f"{name}{of_variant}"))
    owners = {(store.manifest(SETTINGS) or {}).get("place", "") for store in stores}
    taken = any(owner and Path(owner).exists() for owner in owners - {str(site.path)})
    own = f"{name}-{keys.digest(str(site.path))[:6]}"
    if taken or (derived / own).is_dir():
        name = own
    home = Store(derived / name)
    store = home if variant is None else Store(derived / f"{name}{of_variant}", home)
    named = () if site.request is None else site.request[:2]
    as_given = (Path(one) for one in named if one and one.endswith((".yaml", ".yml")))
    store.check_apart([*as_given, site.path, *site.read])
    return store


def settle(job: Job) -> None:
    """Write the settings of a site beside its products, where others stand there."""
    if not job.shows:  # a plan's folder, which goes with it
        return
    key, store = _key(job.site), job.store
    if (store.manifest(SETTINGS) or {}).get("key") == key and not store.damage(SETTINGS):
        return

    tree = job.site.settings.model_dump(mode="json")
    # libyaml's dumper: a grid given as a list can have 100,000 values
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    settings = yaml.dump(tree, Dumper=dumper, sort_keys=False)
    facts = {"key": key, "place": str(job.site.path), "unresolved": 0, "retry": 0,
             "facts": {"config": Values(job.site.settings).tree, "needs": {}}}  # fmt: skip
    store.open()
    mark(job)  # first: killed in between, products are taken for stale, and never for fresh
    content = f"# resolved configuration of {job.site.label}\n{settings}"
    store.publish(SETTINGS, facts, {FILE: text(content)})


def faults(job: Job) -> list[str]:
    """What is to be done for the settings beside the products of a site."""
    manifest = job.store.manifest(SETTINGS)
    if manifest is None:
        return ["never written here"]
    damage = job.store.damage(SETTINGS)
    return [damage] if damage else ["changed"] if manifest["key"] != _key(job.site) else []


def _key(site: Site) -> str:
    return keys.digest([str(site.path), site.settings.model_dump(mode="json")])


def mark(job: Job) -> None:
    """Mark the products that other settings made, and no others."""
    manifests, values = _products(job.store), Values(job.site.settings)
    known = filter(values.holds, _keys(manifests))
    reasons = _judged(manifests, {key: values.plain(key) for key in known})
    for name, manifest in manifests.items():
        if (reason := reasons.get(name, "")) != manifest.get("stale", ""):
            job.store.open()
            job.store.mark(name, reason)


def _products(store: Store) -> dict[str, dict[str, Any]]:
    return {name: one for name, one in store.manifests().items() if name != SETTINGS}


def _keys(manifests: dict[str, dict[str, Any]]) -> set[str]:
    """Settings that some products were made with."""
    return {key for one in manifests.values() for key in one["facts"]["config"]}


def _judged(manifests: dict[str, dict[str, Any]], now: dict[str, Any]) -> dict[str, str]:
    """Products that were not made of some settings and of each other, and why."""
    stale: dict[str, str] = {}
    for name in manifests:  # each after what it needs
        if reason := next(_reasons(name, manifests, stale, now), ""):
            stale[name] = reason
    return stale


def _reasons(
    name: str, manifests: dict[str, dict[str, Any]], stale: dict[str, str], now: dict[str, Any]
) -> Iterator[str]:
    """Why a product is not of these settings, the products that it needs judged before."""
    facts = manifests[name]["facts"]
    was = {key: value for key, value in facts["config"].items() if key in now}
    yield from changes(was, {key: now[key] for key in was})
    for need, key in facts["needs"].items():
        if need in stale:
            yield stale[need]
        elif need in manifests and manifests[need]["key"] != key:
            yield f"{need} was made anew since"


def remade(name: str, manifests: dict[str, dict[str, Any]]) -> str:
    """Of all that a product was made of, the first that was made anew since; empty where none."""
    needs = manifests[name]["facts"]["needs"] if name in manifests else {}
    for need in sorted(needs.keys() & manifests.keys()):
        if manifests[need]["key"] != needs[need]:
            return need
        if found := remade(need, manifests):
            return found
    return ""


def stale(store: Store) -> dict[str, str]:
    """What other settings left in the folder, each after what it needs, and what is other.

    By the manifests, too: who was stopped between two stages, or put a product there, marked none.
    """
    manifests = _products(store)
    tree = (store.manifest(SETTINGS) or {"facts": {"config": {}}})["facts"]["config"]
    known = (key for key in _keys(manifests) if key.partition(".")[0] in tree)
    judged = _judged(manifests, {key: _at(tree, key) for key in known})
    found = {name: judged.get(name) or one.get("stale", "") for name, one in manifests.items()}
    return {name: reason for name, reason in found.items() if reason}


def _at(tree: Any, key: str) -> Any:
    """A setting by its dotted key; None where there is none."""
    for part in key.split("."):
        tree = tree.get(part) if isinstance(tree, dict) else None
    return tree


def told(store: Store) -> list[str]:
    """The same in lines."""
    return [
        f"{name} is of other settings than {FILE}: {reason}"
        for name, reason in stale(store).items()
    ]


def require_whole(store: Store, name: str) -> None:
    """Refuse results of which a file or a manifest is damaged or missing."""
    manifests = store.manifests()
    unread = [(stage, "a manifest that cannot be read") for stage in store.stages()
              if stage not in manifests]  # fmt: skip
    damaged = ((stage, store.damage(stage)) for stage in manifests)
    for stage, fault in chain(unread, lacking(manifests), damaged):
        if fault:
            problem = Problem(name, stage, fault, "results are whole", "make it again")
            raise InputError(problem)


def lacking(manifests: dict[str, dict[str, Any]]) -> Iterator[tuple[str, str]]:
    """Products in a site's folder that need one which has no manifest there, and which."""
    for stage, one in manifests.items() if SETTINGS in manifests else ():
        for need in sorted(one["facts"]["needs"].keys() - manifests.keys()):
            yield stage, f"nothing there that tells of {need}, which it was made of"
