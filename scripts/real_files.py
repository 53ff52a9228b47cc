"""What the readers say of files from elsewhere: how many are read, doubted and refused, and why.

    python -m scripts.real_files FOLDER

Rules against damaged files also meet files that are whole, as other programs write them. This reads
all records and meshes in a folder, such as a checkout of another project with its tests'
data, by their endings, without settings: counts of miniSEED and SAC are taken for m/s2, and a mesh
for one in metres. What is listed as refused is to be looked at: some of it is rightly so.
"""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from pipeline.config.problems import InputError
from pipeline.stages.mesh import mesh_files
from vsr_core.errors import InvalidInput
from vsr_core.motions import order
from vsr_core.motions.records.formats import Reading, read_all
from vsr_core.rock import doubts

MESHES = {".dae", ".glb", ".obj", ".ply", ".stl"}
RECORDS = {".at2", ".cosmos", ".ew", ".ew1", ".ew2", ".mseed", ".ns", ".ns1", ".ns2", ".sac", ".ud",
           ".ud1", ".ud2", ".v1", ".v1c", ".v2", ".v2c"}  # fmt: skip


def said_of(path: Path) -> Iterator[str]:
    """What is doubted of a file.

    Raises
    ------
    InvalidInput, InputError
        If it is refused.
    """
    kind = path.suffix.lower()
    if kind in MESHES:
        mesh = mesh_files.read(path)
        mesh.merge_vertices()
        if mesh.is_watertight:
            yield from doubts.spikes(mesh)
    else:
        unit = "m/s2" if kind in (".mseed", ".sac") else None
        record = read_all(path.read_bytes(), kind, Reading(unit=unit))
        for channel in np.atleast_2d(record.acceleration.T):
            yield from order.doubts(channel, "it")


def report(paths: Iterable[Path]) -> Iterator[str]:
    """Lines of a table of the files, and of why some are refused or doubted."""
    number, why = defaultdict[str, list[int]](lambda: [0, 0, 0]), defaultdict[str, list[Path]](list)
    for path in paths:
        of_kind = number[path.suffix.lower()]
        try:
            said = list(said_of(path))
            of_kind[1 if said else 0] += 1
        except (InvalidInput, InputError) as error:
            said = [str(error).replace(f"{path}: ", "")]
            of_kind[2] += 1
        for line in said:
            why[re.sub(r"-?\d[\d.,e+-]*|'.*'", "~", line)].append(path)
    yield f"{'':10} {'read':>7} {'doubted':>7} {'refused':>7}"
    for kind, counts in sorted(number.items()):
        yield f"{kind:10} {counts[0]:7} {counts[1]:7} {counts[2]:7}"
    for line, files in sorted(why.items(), key=lambda one: -len(one[1])):
        yield f"{len(files):5}  {line[:120]}  ({files[0].name})"


if __name__ == "__main__":
    files = (path for path in sorted(Path(sys.argv[1]).rglob("*")) if path.is_file())
    for told in report(path for path in files if path.suffix.lower() in MESHES | RECORDS):
        print(told)
