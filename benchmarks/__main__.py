"""Run the benchmarks and print one line each: what, measured, target.

    python -m benchmarks [--scan FILE] [--quick]

``--scan`` takes a scan of Double Rock in metres; without it the surrogate is measured. ``--quick``
leaves out the whole site, which takes minutes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks import accuracy, displacement, speed


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="benchmarks")
    parser.add_argument("--scan", type=Path, help="scan of Double Rock in metres")
    parser.add_argument("--quick", action="store_true", help="leave out the whole site")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        site = speed.site_file(folder, options.scan)
        print(f"Double Rock: {options.scan or 'surrogate'}; {speed.WORKERS} workers\n")
        rows = speed.loop(site, folder)
        rows += speed.one_yaw(site, folder)
        if not options.quick:
            rows += speed.whole_site(site, folder)
            rows += displacement.grid(folder)
            rows += displacement.reductions(folder)
        rows += accuracy.blocks()
        for what, measured, target in rows:
            print(f"{what:<62} {measured:>18}   {target}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
