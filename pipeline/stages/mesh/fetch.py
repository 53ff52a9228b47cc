"""Public originals: downloaded once, checked, scaled to metres and put where a scan belongs."""

from __future__ import annotations

import json
import os
import tempfile
from hashlib import sha256
from pathlib import Path

import pooch
import requests
import trimesh

from pipeline.config.layers import CONFIGS
from pipeline.config.paths import working_folder
from pipeline.config.problems import InputError, Problem
from pipeline.stages.mesh.originals import ORIGINALS, Original
from pipeline.stages.mesh.sources import ORIGIN, SUFFIXES
from pipeline.workflow import output
from pipeline.workflow.grammar import listed
from pipeline.workflow.keys import digest_file
from pipeline.workflow.log import complain
from pipeline.workflow.store import writing
from pipeline.workflow.writers import binary
from vsr_core.errors import reason


def fetch(name: str, url: str | None = None, raw: Path | None = None) -> Path:
    """Download an original and keep it as ``<raw>/<name>/<name>.ply`` in metres.

    A copy under ``../shared/data`` is taken in place of the download. The specimen of shake-table
    tests is ``sp1.ply``, in a folder that ``make validate`` reads. Files in the folder that hold
    something else than what comes with it are left as they are, and told; the note of where a scan
    is from is that of the original.

    Parameters
    ----------
    url : str, optional, another place that serves the same bytes
    """
    if name not in ORIGINALS:
        rule = f"originals are known of {', '.join(ORIGINALS)}"
        raise InputError(Problem("NAME", "", repr(name), rule, "give one of them"))
    folder = (raw or working_folder() / "data" / "raw") / name
    there = [p.name for p in folder.glob("[!.]*") if p.suffix.lower() in SUFFIXES]
    if there:
        raise _problem(
            str(folder), there[0], "a site has one scan", "remove it to fetch the original"
        )
    original = ORIGINALS[name]
    with tempfile.TemporaryDirectory() as temporary:
        file = None if url else _copy(original)
        if file is None:
            file = _download(name, original, url or original.url, Path(temporary))
        return _keep(name, original, file, folder)


def _copy(original: Original) -> Path | None:
    """The same file beside the project, if it is there."""
    beside = working_folder().parent / "shared" / "data"
    files = beside.glob(f"*/{Path(original.url).name}")
    return next((file for file in files if digest_file(file) == original.sha256), None)


def _download(name: str, original: Original, url: str, folder: Path) -> Path:
    pooch.get_logger().setLevel("ERROR")
    try:
        file = pooch.retrieve(url, None, fname=Path(original.url).name, path=folder)
    except (requests.RequestException, OSError, ValueError) as error:
        raise _problem(
            url,
            f"no download ({reason(error)[:160]})",
            "the file can be reached",
            "check the network, or give --url",
        ) from None
    found = digest_file(Path(file))
    if found != original.sha256:
        raise _problem(
            url,
            f"a file with SHA-256 {found[:12]}...",
            f"{name} has {original.sha256[:12]}...",
            "the transfer broke or the file is another; try again, or another --url",
        )
    return Path(file)


def _keep(name: str, original: Original, file: Path, folder: Path) -> Path:
    mesh = trimesh.load_mesh(file, process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if original.height is not None:
        mesh.apply_scale(original.height / float(mesh.extents[2]))
    final = folder / ("sp1.ply" if original.tests else f"{name}.ply")
    held = trimesh.Trimesh(mesh.vertices, mesh.faces).export(file_type="ply")
    assert isinstance(held, bytes)
    facts = {"from": original.credit, "url": original.url, "sha256": sha256(held).hexdigest()}
    files = {}
    if original.tests:
        files = {path.name: path.read_bytes() for path in (CONFIGS / "tests" / name).iterdir()}
    note, own = folder / ORIGIN, json.dumps(facts, indent=1).encode()
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        changed = os.path.lexists(note) and not _holds(note, own)
        if note.is_symlink():  # to the note of another scan, which stays
            note.unlink()
        there = sorted(one for one in files if os.path.lexists(folder / one))
        others = [one for one in there if not _holds(folder / one, files[one])]
    for one in files.keys() - there:
        output.put("vsr fetch", folder / one, binary(files[one]))
    output.put("vsr fetch", note, binary(own))
    output.put("vsr fetch", final, binary(held))  # last: with it the folder is whole
    if changed:
        complain(f"vsr: warning: {folder}: {ORIGIN}, which was of another scan, written anew")
    if others:
        told = f"{listed(others)} other than what comes with {name} by now, left as found"
        complain(f"vsr: warning: {folder}: {told}")
    return final


def _holds(path: Path, held: bytes) -> bool:
    return path.is_file() and path.read_bytes() == held


def _problem(file: str, given: str, rule: str, remedy: str) -> InputError:
    return InputError(Problem(f"fetch {file}", "", given, rule, remedy))
