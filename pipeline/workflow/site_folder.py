"""The folder of a site holds products of one configuration: which, and what others left there.

The settings stand beside the products as YAML, written before the first product that is made of
them. What other settings made stays until it is made anew, and is marked: in its manifest, which
``status`` and the index read, and at the head of its pages.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
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
    """
    if variant is not None and not _NAME.fullmatch(variant):
        rule, remedy = "it has letters, digits, points and dashes", "e.g. --name rough"
        raise InputError(Problem("--name", "", repr(variant), rule, remedy))
    name = site.name
    of_variant = "" if variant is None else f"@{variant}"
    stores = (Store(derived / one) for one in (name, f"{name}{of_variant}"))
    owners = {(store.manifest(SETTINGS) or {}).get("place", "") for store in stores}
    if any(owner and Path(owner).exists() for owner in owners - {str(site.path)}):
        name += f"-{keys.digest(str(site.path))[:6]}"
    home = Store(derived / name)
    return home if variant is None else Store(derived / f"{name}{of_variant}", home)


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
             "facts": {"config": tree, "needs": {}}}  # fmt: skip
    store.open()
    content = f"# resolved configuration of {job.site.label}\n{settings}"
    store.publish(SETTINGS, facts, {FILE: text(content)})
    mark(job)


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
    stale: dict[str, str] = {}
    manifests = job.store.manifests()
    manifests.pop(SETTINGS, None)
    for name, manifest in manifests.items():
        if reason := next(_reasons(name, manifests, stale, Values(job.site.settings)), ""):
            stale[name] = reason
        if reason != manifest.get("stale", ""):
            job.store.mark(name, reason)


def _reasons(
    name: str, manifests: dict[str, dict[str, Any]], stale: dict[str, str], values: Values
) -> Iterator[str]:
    """Why a product is not of these settings, the products that it needs judged before."""
    facts = manifests[name]["facts"]
    of_site = {key: value for key, value in facts["config"].items() if values.holds(key)}
    yield from changes(of_site, {key: values.plain(key) for key in of_site})
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
    """What other settings left in the folder, each after what it needs, and what is other."""
    found = {name: one.get("stale", "") for name, one in store.manifests().items()}
    return {name: reason for name, reason in found.items() if reason}


def told(store: Store) -> list[str]:
    """The same in lines."""
    return [
        f"{name} is of other settings than {FILE}: {reason}"
        for name, reason in stale(store).items()
    ]
