"""Run the benchmarks; each prints its rows as they are measured: what, measured, target.

    python -m benchmarks [--scan FILE] [--tests FOLDER] [--quick]

``--scan`` takes a scan of Double Rock in metres; without it the surrogate is measured. ``--tests``
takes recorded shake-table tests, without which the validation is not measured. ``--quick`` leaves
out the whole site, the terrain, the validation and grids of many runs, which take minutes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from itertools import chain
from pathlib import Path

from benchmarks import accuracy, displacement, engine, many_runs, speed
from benchmarks.table import show


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks")
    parser.add_argument("--scan", type=Path, help="scan of Double Rock in metres")
    parser.add_argument("--tests", type=Path, help="folder of recorded shake-table tests")
    parser.add_argument("--quick", action="store_true", help="leave out what takes long")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        site = speed.site_file(folder, options.scan)
        show((f"Double Rock: {options.scan or 'surrogate'}; {speed.WORKERS} workers", "", ""))
        parts = [engine.against_bullet(site, folder), engine.command(site, folder)]
        parts += [speed.loop(site, folder), speed.one_yaw(site, folder)]
        if not options.quick:
            parts += [speed.whole_site(site, folder), displacement.grid(folder)]
            parts += [displacement.against_bullet(folder), displacement.reductions(folder)]
            parts += [engine.validation(options.tests, folder)]
            parts += [many_runs.rows(folder / "many", many_runs.NUMBER)]
        for row in chain(*parts, accuracy.blocks()):
            show(row)
    return 0


if __name__ == "__main__":
    sys.exit(main())
