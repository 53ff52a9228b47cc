"""A site's results, what they were made from and with, in one file."""

from __future__ import annotations

import os
import platform
import re
import shlex
import time
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from pipeline import ROOT
from pipeline.bundles import crate
from pipeline.bundles.layout import (
    ABOUT,
    CRATE,
    INPUTS,
    RESULTS,
    SCHEMA,
    SUMS,
    About,
    Given,
    is_plain,
    sha256,
    sums,
)
from pipeline.config.layers import STUDIES
from pipeline.config.outside import text
from pipeline.config.paths import SHIPPED, shown
from pipeline.config.problems import InputError, Problem, printable
from pipeline.stages.mesh.sources import ORIGIN, origin_of
from pipeline.workflow import keys, output
from pipeline.workflow.grammar import listed
from pipeline.workflow.products import DELIVERABLES
from pipeline.workflow.registry import ASIDE, BY_NAME, upstream
from pipeline.workflow.site_folder import FILE, SETTINGS, require_whole, stale
from pipeline.workflow.store import Store, manifest_text

OF_CHECKOUT = ("CITATION.cff", "requirements.lock", "LICENSE")
"""Of the checkout, where there is one."""

_HEAD = "# resolved configuration of "
_SHA256 = re.compile(r"[0-9a-f]{64}")

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time of every member, so that the same results are the same bytes."""


@dataclass(frozen=True)
class Inputs:
    """Files that products were made from, by their place in the bundle.

    Attributes
    ----------
    base : str, folder in the bundle from which a command names the site
    site : str, its YAML from there
    """

    base: str
    site: str
    config: str
    files: dict[str, Path]
    given: list[Given]


def export(folder: Path, path: Path, *, inputs: bool, licence: str) -> About:
    """Write the bundle of a site's folder.

    Parameters
    ----------
    inputs : whether the files are in it that products were made from, or their digests alone
    licence : address of the licence that the results are given under; empty where none is
    """
    output.check("--to", path, ".zip", folder)
    if not licence.isprintable():
        rule, remedy = "it is an address in one line", "e.g. https://spdx.org/licenses/CC-BY-4.0"
        raise InputError(Problem("--licence", "", repr(licence), rule, remedy))
    store = Store(folder)
    manifests = store.manifests()
    place = Path((manifests.get(SETTINGS) or {}).get("place", ""))
    if SETTINGS not in manifests or place.suffix not in (".yaml", ".yml"):
        rule, remedy = "it is the folder of a site", "e.g. data/derived/cuboid_1x1x2"
        raise InputError(Problem("vsr export", "", str(folder), rule, remedy))
    require_whole(store, str(folder))
    _require_fresh(store, place)
    found = _inputs(folder, place, manifests, inputs=inputs)
    members = dict(_members(folder, manifests, found))
    about = About(
        schema_version=SCHEMA,
        name=printable(folder.resolve().name),
        site=found.site,
        base=found.base,
        vsr=keys.installed_version("vsr"),
        products=sorted(manifests.keys() - {SETTINGS}),
        versions=_versions(),
        inputs=found.given,
        files={},
    )
    newest = max(path.stat().st_mtime for path in (folder / ".stages").glob("*.json"))
    day = time.strftime("%Y-%m-%d", time.gmtime(newest))
    members["README.md"] = _readme(about, licence).encode()
    members[CRATE] = crate.text(about, members, day, licence).encode()
    files = {name: sha256(held) for name, held in sorted(members.items())}
    members[SUMS] = sums(files)
    members[ABOUT] = about.model_copy(update={"files": files}).model_dump_json(indent=1).encode()
    output.put("--to", path, partial(_pack, members))
    return about


def _require_fresh(store: Store, site: Path) -> None:
    """Refuse products that the settings beside them did not make."""
    if found := stale(store):
        *_, last = found
        given = f"what other settings or inputs made ({found[last]})"
        rule = f"all products are of the settings in {FILE}"
        again = f"{_command(last)} --site {shown(site)}"
        again += _variant(store.folder.resolve().name, site.stem)
        remedy = f"make it again there with those, e.g. vsr {again}"
        remedy += ", or, where they make none, make the others with --name in a folder of their own"
        raise InputError(Problem(str(store.folder), listed([*found]), given, rule, remedy))


def _variant(folder: str, site: str) -> str:
    """The option that names the folder of a variant; the name of a site may have an @, too.

    >>> _variant("a@rough", "a"), _variant("a-0b1c2d@rough", "a"), _variant("a@b", "a@b")
    (' --name rough', ' --name rough', '')
    """
    found = re.fullmatch(rf"{re.escape(site)}(-[0-9a-f]{{6}})?@(.+)", folder)
    return f" --name {found[2]}" if found else ""


def _command(stage: str) -> str:
    """The words of a command that makes the products of a stage."""
    if verb := next((one for one in ASIDE if stage.startswith(one)), ""):
        return verb
    known = ((name, one.stage) for name, one in DELIVERABLES.items() if name != "study")
    return f"run {next(name for name, end in known if BY_NAME[stage] in upstream(end))}"


def _pack(members: dict[str, bytes], path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, held in sorted(members.items()):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), held, zipfile.ZIP_DEFLATED)


def _members(
    folder: Path, manifests: dict[str, dict[str, Any]], found: Inputs
) -> Iterator[tuple[str, bytes]]:
    """Files of the bundle, but for those that are made of all others."""
    for stage, manifest in manifests.items():
        kept = {**manifest, "place": ""} if stage == SETTINGS else manifest
        yield f"{RESULTS}/.stages/{stage}.json", manifest_text(kept).encode()
        for name, checksum in manifest["files"].items():
            held = (folder / name).read_bytes()
            if sha256(held) != checksum:
                given, rule = f"{name} written anew meanwhile", "no command is at work there"
                raise InputError(Problem(str(folder), stage, given, rule, "wait for it to end"))
            yield f"{RESULTS}/{name}", held
    yield f"{found.base}/{found.site}", found.config.encode()
    for name, path in found.files.items():
        yield name, path.read_bytes()
    for name in OF_CHECKOUT:
        if (ROOT / name).is_file():
            yield name, (ROOT / name).read_bytes()


def _inputs(
    folder: Path, place: Path, manifests: dict[str, dict[str, Any]], *, inputs: bool
) -> Inputs:
    """Files that the settings name and whose digests the manifests hold."""
    first, _, config = text(folder / FILE).partition("\n")
    label = first.removeprefix(_HEAD)
    tree = yaml.safe_load(config)
    wanted = {
        digest: name
        for manifest in manifests.values()
        for name, digest in manifest["facts"]["inputs"].items()
        if _SHA256.fullmatch(str(digest))
    }
    there = {value: files for value in sorted(set(_texts(tree)))
             if value and (files := _of(value, place.parent, wanted))}  # fmt: skip
    above = PurePosixPath(label).parent
    ways = [os.path.normpath(above / value) for value in there if not Path(value).is_absolute()]
    ups = max((way.split("/").count("..") for way in ways), default=0)
    base = "/".join([INPUTS, *["up"] * ups])
    held: dict[str, Path] = {}
    given = []
    for number, (value, files) in enumerate(there.items()):
        inside = Path(value)
        if inside.is_absolute():  # which only one machine knows
            inside = Path("files", str(number), inside.name)
            tree = _replaced(tree, value, str(inside))
            config = yaml.safe_dump(tree, sort_keys=False)
        for name, path in files.items():
            at = os.path.normpath(f"{base}/{above}/{inside}/{name}")
            if not is_plain(at):
                continue
            held[at], digest = path, keys.digest_file(path)
            if digest in wanted:
                kept = at if inputs else ""
                one = Given(name=wanted[digest], sha256=digest, path=kept, source=_source(path))
                given.append(one)
    known = {one.sha256 for one in given}
    given += [Given(name=name, sha256=one) for one, name in wanted.items() if one not in known]
    given.sort(key=lambda one: (one.name, one.path))
    return Inputs(base, label, f"{first}\n{config}", held if inputs else {}, given)


def _of(value: str, beside: Path, wanted: dict[str, str]) -> dict[str, Path]:
    """Files that a setting names and products were made from, by the way from what it names.

    Nothing else in a folder is anybody's but the user's. With a scan comes the note beside it of
    where it is from, which products tell.
    """
    for place in (beside, STUDIES, Path.cwd(), SHIPPED):
        path = place / value
        with suppress(OSError, ValueError):
            there = [path, *path.glob("*"), *path.glob("*/*")]
            made_of = [one for one in there if one.is_file() and keys.digest_file(one) in wanted]
            notes = [one.with_name(ORIGIN) for one in made_of if origin_of(one)]
            if made_of:
                return {os.path.relpath(one, path): one for one in sorted({*made_of, *notes})}
    return {}


def _source(path: Path) -> str:
    """Where a file is from, as what stands beside it says."""
    return "; ".join(f"{key}: {one}" for key, one in origin_of(path).items())


def _texts(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, dict | list):
        for one in tree.values() if isinstance(tree, dict) else tree:
            yield from _texts(one)


def _replaced(tree: Any, old: str, new: str) -> Any:
    if isinstance(tree, dict):
        return {key: _replaced(one, old, new) for key, one in tree.items()}
    if isinstance(tree, list):
        return [_replaced(one, old, new) for one in tree]
    return new if tree == old else tree


def _versions() -> dict[str, str]:
    """Python, and every library that is installed."""
    there = {str(one.metadata["Name"]): one.version for one in metadata.distributions()}
    return {"python": platform.python_version(), **dict(sorted(there.items()))}


def _readme(about: About, licence: str) -> str:
    """What a reader finds first."""
    out = [one for one in about.inputs if not one.path]
    site = shlex.quote(f"./{about.site}" if about.site.startswith("-") else about.site)
    missing = "".join(f"- {one.name}, SHA-256 {one.sha256} {one.source}\n" for one in out)
    return f"""# {about.name}

Results of vsr {about.vsr}, the virtual shake robot, with what they were made from.

- `{RESULTS}/`: products; `.stages/` holds what each was made of.
- `{about.base}/{about.site}`: every setting.
- `{SUMS}`: checksums, for `sha256sum -c {SUMS}`; `{ABOUT}`: versions and inputs.
- `requirements.lock`, if there: libraries by their hashes.

To check it: `vsr check FILE.zip`. To make it again, unpack it and, in `{about.base}`:

    vsr run PRODUCT --site {site} --derived again

Licence of the results: {licence or "none was stated by who made them"}.
To cite: the paper in `CITATION.cff` (doi:10.26443/seismica.v3i1.692), and this file.
{chr(10) + "Inputs that are not in it:" + chr(10) * 2 + missing if out else ""}"""
