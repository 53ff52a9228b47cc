"""What of a bundle does not match: its files, its inputs, and the program that is here."""

from __future__ import annotations

import platform
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import netCDF4

from pipeline.bundles.layout import (
    ABOUT,
    INPUTS,
    RESULTS,
    SUMS,
    About,
    about,
    digest,
    names,
    opened,
    sha256,
    sums,
    unpack,
)
from pipeline.config.folder_names import NOT_READ
from pipeline.config.layers import load_site
from pipeline.config.outside import damaged_heap
from pipeline.config.problems import InputError, Problem, printable
from pipeline.workflow import graph, keys
from pipeline.workflow.grammar import counted, listed
from pipeline.workflow.registry import ASIDE, BY_NAME
from pipeline.workflow.site_folder import FILE, SETTINGS, lacking
from pipeline.workflow.store import Store


def check(path: Path) -> tuple[list[str], list[str]]:
    """What is wrong with a bundle, and what would be made otherwise here, in lines."""
    with opened(path) as archive:
        told = about(path, archive)
        wrong = [printable(line) for line in _files(archive, told)]
        if wrong:
            return wrong, []
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary).resolve()
            for name in names(archive):
                if name.startswith((f"{INPUTS}/", f"{RESULTS}/.stages/")):
                    unpack(path, archive, name, folder)
            manifests = Store(folder / RESULTS).manifests()
            if wrong := [printable(line) for line in _not_as_made(told, manifests)]:
                return wrong, []
            for stage, manifest in manifests.items():
                for name in sorted(one for one in manifest["files"] if one.endswith(".nc")):
                    file = unpack(path, archive, f"{RESULTS}/{name}", folder)
                    if fault := _not_of(manifest["key"], file):
                        wrong.append(printable(f"{RESULTS}/{name} {fault} of {stage}"))
                    file.unlink()
            if wrong:
                return wrong, []
            manifests.pop(SETTINGS)
            return [], [printable(line) for line in _otherwise(folder, told, manifests)]


def _files(archive: zipfile.ZipFile, told: About) -> Iterator[str]:
    """Files that are not what they were, inputs that are not there."""
    there = set(names(archive)) - {ABOUT, SUMS}
    if SUMS not in names(archive) or digest(archive, SUMS) != sha256(sums(told.files)):
        yield f"{SUMS} does not hold the checksums of {ABOUT}"
    for name in sorted(told.files.keys() - there):
        yield f"{name} is missing"
    for name in sorted(there - told.files.keys()):
        yield f"{name} is not of it"
    for name in sorted(there & told.files.keys()):
        if digest(archive, name) != told.files[name]:
            yield f"{name} is not what was written"
    if f"{told.base}/{told.site}" not in told.files:
        yield f"{told.site}, the site, is missing"
    for one in told.inputs:
        if one.path and told.files.get(one.path) != one.sha256:
            yield f"input {one.name} is missing"


def _not_as_made(told: About, manifests: dict[str, dict[str, Any]]) -> Iterator[str]:
    """Products that are missing, or of which a file is not what its stage wrote."""
    if missing := sorted({*told.products, SETTINGS} - manifests.keys()):
        yield from (f"{RESULTS}/.stages/{name}.json tells nothing of {name}" for name in missing)
        return
    named = {f"{RESULTS}/.stages/{stage}.json" for stage in manifests}
    for stage, manifest in manifests.items():
        for name, checksum in sorted(manifest["files"].items()):
            named.add(f"{RESULTS}/{name}")
            if told.files.get(f"{RESULTS}/{name}") != checksum:
                yield f"{RESULTS}/{name} is not what {stage} wrote"
    for stage, fault in lacking(manifests):
        yield f"{RESULTS}/{stage}: {fault}"
    if FILE not in manifests[SETTINGS]["files"]:
        yield f"{RESULTS}/.stages/{SETTINGS}.json does not name {FILE}"
    for name in sorted(told.files.keys() - named):
        if name.startswith(f"{RESULTS}/"):
            yield f"{name} is of no product"


def _not_of(key: str, file: Path) -> str:
    """Why a dataset is not what has a key; empty where it is, and of one without a key."""
    try:
        if damaged_heap(file) is not None:
            return "is no dataset that HDF5 would come to the end of"
        with netCDF4.Dataset(file) as data:
            return "" if getattr(data, "vsr_key", key) == key else "has another key than that"
    except (OSError, RuntimeError, ValueError):
        return "is no dataset"


def _otherwise(folder: Path, told: About, manifests: dict[str, dict[str, Any]]) -> Iterator[str]:
    """What the program that is here would make in another way, and why."""
    for one in told.inputs:
        if not one.path:
            source = f"; {one.source}" if one.source else ""
            yield f"input {one.name} (SHA-256 {one.sha256}) is not in it{source}"
    yield from _versions(told, manifests)
    yield from _stages(folder, told, manifests)


def _versions(told: About, manifests: dict[str, dict[str, Any]]) -> Iterator[str]:
    """Libraries of another version here, those that a product depends on one by one."""
    using: dict[str, list[str]] = {}
    for stage, one in manifests.items():
        for name in one["facts"]["versions"]:
            using.setdefault(_plain(name), []).append(stage)
    others = []
    for name, was in {**told.versions, "vsr": told.vsr}.items():
        here = platform.python_version() if name == "python" else keys.installed_version(name)
        if here == was:
            continue
        if stages := using.get(_plain(name)):
            yield f"{name} is {here} here and was {was}: {listed(stages)} depend on it"
        elif name in ("vsr", "python"):
            yield f"{name} is {here} here and was {was}: no product depends on it"
        else:
            others.append(name)
    if others:
        names = listed([*others[:3], *["others"] * (len(others) > 3)])
        yield f"of other versions here, without a product that depends on them: {names}"


def _plain(name: str) -> str:
    """Name of a library as PyPI compares it."""
    return name.lower().replace("_", "-").replace(".", "-")


def _packed(facts: dict[str, Any]) -> dict[str, Any]:
    """Facts of a product without the names of files that it does not read: these may be others."""
    read = {name: value for name, value in facts["inputs"].items() if value != NOT_READ}
    return {**facts, "inputs": read}


def _stages(folder: Path, told: About, manifests: dict[str, dict[str, Any]]) -> Iterator[str]:
    """Products whose settings, inputs or code are others here."""
    try:
        site = load_site(str(folder / told.base / told.site))
        for stage, manifest in manifests.items():
            if stage.startswith(ASIDE):
                continue
            if stage not in BY_NAME:
                yield f"{stage} is a stage that is not known here"
                continue
            own = graph.identities(stage, site, to_make=False).get(stage)
            if own is None:  # as where no engine is there that repeats a sample
                yield f"{stage} is not made of these settings on this machine"
                continue
            if own.key == manifest["key"]:
                continue
            differences = list(graph.differences(_packed(manifest["facts"]), _packed(own.facts)))
            code = [one for one in differences if one.startswith("code ")]
            yield from (f"{stage}: {one}" for one in differences if one not in code)
            if code:
                others = f" and {counted(len(code) - 1, 'other definition')}" if code[1:] else ""
                yield f"{stage}: {code[0]}{others}; it would be made anew"
    except InputError as error:
        for one in error.problems:
            parts = {key: part.replace(f"{folder}/", "") for key, part in asdict(one).items()}
            yield str(Problem(**parts))
